//! `flat-plates`: pressure of sunlight, or of a thin gas, on the flat plates that make up a body's surface.
//!
//! Its kernel is not a fixed function but an expression that follows from the plates, as in [`super::custom`].

use std::sync::LazyLock;

use glam::DVec3;

use super::{
    Declaration, Frame, Model, Parameter, ParameterDeclaration, Preset, Torque, ValidationContext, Validity, Value,
    Values,
};
use crate::error::{Error, Result};
use crate::expression::{Expression, Fault, Shape, Symbol, Symbols};
use crate::math::real::Real;
use crate::math::vector::Vector;

/// τ = Σ r × F, where each plate that faces the source, c = n · u > 0, feels F = −p A c (a u + (b + d c) n).
///
/// u is the unit vector in body axes from the body towards the source: towards the Sun, or in the direction of flight through a gas at
/// rest; p is the pressure, that of sunlight (4.56e-6 N/m² at the Earth) or ρ v². Plates cast no shadow on each other, what one reflects
/// does not meet another, and the body's own rotation is neglected in the flow. The torque is continuous where a plate turns into the
/// light, but its derivative jumps there, so that steps across it are of a lower order.
pub struct FlatPlates;

/// The most plates of one torque.
pub const MOST_FACETS: usize = 16;

/// A flat plate with one exposed side. A thin plate with two exposed sides is two plates with opposite normals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Facet {
    /// A, m², not negative.
    pub area: f64,
    /// n, the outward normal in body axes, of any length above zero.
    pub normal_body: DVec3,
    /// r, the plate's centre from the body's centre of mass, body axes, m.
    pub centre_body: DVec3,
    /// How the plate interacts with the incident flux.
    pub surface: Surface,
}

/// How a plate interacts with the incident flux, which determines a, b and d in −p A c (a u + (b + d c) n).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Surface {
    /// The coefficients themselves.
    Coefficients {
        /// a, 0 to 1: the part along the direction of the source.
        along: f64,
        /// b, −1 to 1: the part across the plate that does not depend on the angle. It is negative if a plate radiates more
        /// heat from its back.
        constant: f64,
        /// d, 0 to 2: the part across the plate in proportion to the cosine.
        across: f64,
    },
    /// Light of which a part is reflected as by a mirror, a part by Lambert's law, and the rest absorbed: a = 1 − ρs, b = ⅔ ρd,
    /// d = 2 ρs (J. R. Wertz, *Spacecraft Attitude Determination and Control*, 1978, section 17.2; C. R. McInnes, *Solar Sailing*,
    /// 1999, section 2.6, without its emission of heat).
    Solar {
        /// ρs, 0 to 1.
        specular: f64,
        /// ρd, 0 to 1, at most 1 − ρs.
        diffuse: f64,
    },
    /// A thin gas that meets the plate much faster than its molecules move (the hyperthermal limit of free molecular flow):
    /// a = σt, b = σn v_w/v, d = 2 − σn − σt (S. A. Schaaf, P. L. Chambré, *Flow of Rarefied Gases*, 1961; P. C. Hughes,
    /// *Spacecraft Attitude Dynamics*, 1986, section 8.2).
    Drag {
        /// σn, 0 to 1: the part of the normal momentum that is given up.
        normal_accommodation: f64,
        /// σt, 0 to 1: the part of the tangential momentum that is given up.
        tangential_accommodation: f64,
        /// v_w/v, 0 to 1: v_w = √(π R T/2) with the wall's temperature T and the specific gas constant R, over the speed v of
        /// the flow.
        wall_speed_ratio: f64,
    },
}

static DECLARATION: LazyLock<Declaration> = LazyLock::new(|| {
    let source =
        "C. R. McInnes, Solar Sailing, 1999, section 2.6; S. A. Schaaf, P. L. Chambré, Flow of Rarefied Gases, 1961";
    let direction = "u, from the body towards the source";
    Declaration::new("flat-plates", "τ = Σ r × F, F = −p A c (a u + (b + d c) n), c = n · u > 0", source).parameters([
        ParameterDeclaration::number("pressure", "N/m²", "p, of sunlight or ρ v²")
            .valid(Validity::NotNegative)
            .factor(),
        ParameterDeclaration::vector("direction", "1", Frame::World, direction).valid(Validity::NotZero),
        ParameterDeclaration::list("facets", (1, MOST_FACETS), "the plates", facet_parameters()),
    ])
});
const PRESSURE: usize = 0;
const DIRECTION: usize = 1;
const FACETS: usize = 2;

/// The parameters of a plate, in the order of [`Facet::values`].
fn facet_parameters() -> Vec<ParameterDeclaration> {
    let number =
        |name, valid, about| ParameterDeclaration::number(name, "1", about).valid(valid).choice("surface").constant();
    // These three stand side by side, each zero by default; the others stand in a table.
    let coefficient = |name, valid, about| number(name, valid, about).beside("along").or(Preset::Number(0.0));
    let part = Validity::Range(0.0, 1.0);
    vec![
        ParameterDeclaration::number("area", "m²", "A").valid(Validity::NotNegative).constant(),
        ParameterDeclaration::vector("normal", "1", Frame::Body, "n, outward").valid(Validity::NotZero).constant(),
        ParameterDeclaration::vector("centre", "m", Frame::Body, "r, from the centre of mass").constant(),
        coefficient("along", part, "a; a facet states one of these, solar and drag"),
        coefficient("constant", Validity::Range(-1.0, 1.0), "b"),
        coefficient("across", Validity::Range(0.0, 2.0), "d"),
        number("solar.specular", part, "ρs: a = 1 − ρs, d = 2 ρs"),
        number("solar.diffuse", part, "ρd: b = ⅔ ρd"),
        number("drag.normal_accommodation", part, "σn: d = 2 − σn − σt"),
        number("drag.tangential_accommodation", part, "σt: a = σt"),
        number("drag.wall_speed_ratio", part, "v_w/v: b = σn v_w/v").or(Preset::Number(0.0)),
    ]
}

impl Torque {
    /// The pressure p (N/m²) of a flux from a direction (world axes, from the body towards the source, of any length) on 1 to
    /// [`MOST_FACETS`] flat plates; see [`FlatPlates`].
    ///
    /// ```
    /// use glam::DVec3;
    /// use polhode::torque::Torque;
    /// use polhode::torque::flat_plates::{Facet, Surface};
    ///
    /// let surface = Surface::Solar { specular: 0.3, diffuse: 0.2 };
    /// let panel = Facet { area: 0.5, normal_body: DVec3::X, centre_body: DVec3::new(0.0, 1.0, 0.0), surface };
    /// let back = Facet { normal_body: -DVec3::X, ..panel };
    /// let light = Torque::flat_plates(4.56e-6, DVec3::new(1.0, 0.0, 0.2), &[panel, back])?;
    /// assert_eq!(light.name(), "flat-plates");
    /// # Ok::<(), polhode::Error>(())
    /// ```
    ///
    /// # Errors
    ///
    /// As [`formula`].
    pub fn flat_plates(
        pressure: impl Into<Parameter<f64>>,
        direction_world: impl Into<Parameter<DVec3>>,
        facets: &[Facet],
    ) -> Result<Self> {
        let list: Vec<Vec<Value>> = facets.iter().map(Facet::values).collect();
        let values =
            vec![Value::Number(pressure.into()), Value::Vector(direction_world.into()), Value::List(list.into())];
        Ok(of_formula(formula(facets)?, values))
    }
}

fn of_formula(formula: Expression, values: Vec<Value>) -> Torque {
    let torque = Torque::expressed_by(DECLARATION.clone(), formula, None, values);
    torque.unwrap_or_else(|fault| panic!("the formula of flat plates: {fault}"))
}

impl Model for FlatPlates {
    declared!(Custom);

    fn made_for(&self, values: &[Value], context: &ValidationContext) -> Option<Result<Torque>> {
        let facets: Vec<Facet> = values[FACETS].as_list().unwrap_or(&[]).iter().map(|row| Facet::of(row)).collect();
        let refused = |error| match error {
            Error::Item { index, field, value, expected, .. } => {
                context.refusal(None, format!("facets[{}].{field}", index + 1), value, expected)
            }
            Error::Setting { field, value, expected } => context.refusal(None, field, value, expected),
            other => other,
        };
        Some(formula(&facets).map_err(refused).map(|formula| of_formula(formula, values.to_vec())))
    }
}

/// The torque in body axes, N m, as a formula of the attitude and the parameters `pressure` and `direction` (three numbers, world axes).
///
/// # Errors
///
/// [`Error::Setting`] unless there are 1 to [`MOST_FACETS`] facets; [`Error::Item`] for the first of them with a negative area, a zero
/// normal, a coefficient out of its range, or a number that is not finite; [`Error::Setting`] within the recording of another formula.
pub fn formula(facets: &[Facet]) -> Result<Expression> {
    if facets.is_empty() || facets.len() > MOST_FACETS {
        let expected = "expected a list of 1 to 16 facets";
        return Err(Error::Setting { field: "facets", value: facets.len() as f64, expected });
    }
    let plates = facets.iter().enumerate().map(|(index, facet)| facet.plate(index)).collect::<Result<Vec<_>>>()?;
    recorded(&plates).map_err(|fault| match fault {
        Fault::Nested => {
            let expected = "expected to be made before the recording of another formula begins";
            Error::Setting { field: "facets", value: facets.len() as f64, expected }
        }
        // The names and shapes are ours, and constants of plates are in range.
        fault => panic!("the formula of flat plates: {fault}"),
    })
}

fn recorded(plates: &[Plate]) -> std::result::Result<Expression, Fault> {
    let declared = &DECLARATION.parameters;
    let symbols = Symbols::rotation()
        .with_full_inertia()
        .parameter(&declared[PRESSURE].name, Shape::Number)?
        .parameter(&declared[DIRECTION].name, Shape::Vector)?;
    Expression::record(&symbols, |s| {
        let direction = s.vector(&declared[DIRECTION].name);
        let u = s.to_body(direction * (Symbol::splat(1.0) / direction.dot(direction).sqrt()));
        // Σ A c a r and Σ A c (b + d c) r × n: one product with u is enough for all.
        let (mut along, mut across) = (Vector::zero(), Vector::zero());
        for plate in plates {
            let lit = constant(plate.normal).dot(u).max(Symbol::splat(0.0));
            along = constant(plate.along).axpy(lit, along);
            across = constant(plate.across).axpy(lit, constant(plate.constant)).axpy(lit, across);
        }
        (along.cross(u) + across) * -s.number(&declared[PRESSURE].name)
    })
}

fn constant(vector: DVec3) -> Vector<Symbol> {
    Vector::new(Symbol::splat(vector.x), Symbol::splat(vector.y), Symbol::splat(vector.z))
}

/// The constants of a facet in the formula.
struct Plate {
    normal: DVec3,
    /// A a r.
    along: DVec3,
    /// A b r × n.
    constant: DVec3,
    /// A d r × n.
    across: DVec3,
}

impl Facet {
    /// The values in the order of [`facet_parameters`].
    fn values(&self) -> Vec<Value> {
        let mut surface = [None; 8];
        match self.surface {
            Surface::Coefficients { along, constant, across } => {
                surface[..3].copy_from_slice(&[along, constant, across].map(Some));
            }
            Surface::Solar { specular, diffuse } => surface[3..5].copy_from_slice(&[specular, diffuse].map(Some)),
            Surface::Drag { normal_accommodation, tangential_accommodation, wall_speed_ratio } => {
                let numbers = [normal_accommodation, tangential_accommodation, wall_speed_ratio];
                surface[5..].copy_from_slice(&numbers.map(Some));
            }
        }
        let number = |x: f64| Value::Number(x.into());
        [number(self.area), Value::Vector(self.normal_body.into()), Value::Vector(self.centre_body.into())]
            .into_iter()
            .chain(surface.into_iter().map(|x| x.map_or(Value::Absent, number)))
            .collect()
    }

    /// A facet from values in that order; defaults may be among them.
    fn of(values: &[Value]) -> Self {
        let values = Values { values, first_body: 0 };
        let given = |place| values.given(place).and_then(Value::as_number).map(|number| number.at(0));
        let or_zero = |place| given(place).unwrap_or(0.0);
        let surface = match (given(6), given(8)) {
            (Some(specular), _) => Surface::Solar { specular, diffuse: or_zero(7) },
            (_, Some(normal_accommodation)) => Surface::Drag {
                normal_accommodation,
                tangential_accommodation: or_zero(9),
                wall_speed_ratio: or_zero(10),
            },
            _ => Surface::Coefficients { along: or_zero(3), constant: or_zero(4), across: or_zero(5) },
        };
        Self {
            area: values.number(0).at(0),
            normal_body: values.vector(1).at(0),
            centre_body: values.vector(2).at(0),
            surface,
        }
    }

    /// The facet's constants in the formula; `index` is its place in the list.
    fn plate(&self, index: usize) -> Result<Plate> {
        let refuse = |field, value, expected| Err(Error::Item { item: "facet", index, field, value, expected });
        let Self { area, normal_body, centre_body, surface } = *self;
        if !(area.is_finite() && area >= 0.0) {
            return refuse("area", area, "expected a finite number that is not negative (m²)");
        }
        // Divided by the largest component first, so that no square overflows or underflows.
        let largest = normal_body.abs().max_element();
        if !(normal_body.is_finite() && largest > 0.0) {
            return refuse("normal", largest, "expected finite components that are not all zero");
        }
        let normal = (normal_body / largest).normalize();
        if !centre_body.is_finite() {
            return refuse("centre", centre_body.length(), "expected finite components (m)");
        }
        let coefficients = match surface.coefficients() {
            Ok(coefficients) => coefficients,
            Err((field, value, expected)) => return refuse(field, value, expected),
        };
        let [along, constant, across] = coefficients;
        let arm = area * centre_body;
        let lever = arm.cross(normal);
        let plate = Plate { normal, along: along * arm, constant: constant * lever, across: across * lever };
        // Constants of the formula are written into shaders of either precision.
        let is_small = |v: DVec3| v.abs().max_element() <= f64::from(f32::MAX) && v.is_finite();
        if !(is_small(plate.along) && is_small(plate.constant) && is_small(plate.across)) {
            return refuse("area", area, "area times centre must be at most 3e38 (m³)");
        }
        Ok(plate)
    }
}

/// A field that is not valid, its value, and what would be valid.
type Refused = (&'static str, f64, &'static str);

impl Surface {
    /// a, b and d.
    fn coefficients(self) -> std::result::Result<[f64; 3], Refused> {
        const PART: &str = "expected a finite number from 0 to 1";
        let part = |field, value: f64| if (0.0..=1.0).contains(&value) { Ok(value) } else { Err((field, value, PART)) };
        match self {
            Surface::Coefficients { along, constant, across } => {
                part("along", along)?;
                if !(-1.0..=1.0).contains(&constant) {
                    return Err(("constant", constant, "expected a finite number from -1 to 1"));
                }
                if !(0.0..=2.0).contains(&across) {
                    return Err(("across", across, "expected a finite number from 0 to 2"));
                }
                Ok([along, constant, across])
            }
            Surface::Solar { specular, diffuse } => {
                let (specular, diffuse) = (part("solar.specular", specular)?, part("solar.diffuse", diffuse)?);
                // Decimal numbers that add up to 1 may miss it by a rounding.
                if specular + diffuse > 1.0 + f64::EPSILON {
                    return Err(("solar.diffuse", diffuse, "specular and diffuse together must be at most 1"));
                }
                Ok([1.0 - specular, 2.0 / 3.0 * diffuse, 2.0 * specular])
            }
            Surface::Drag { normal_accommodation, tangential_accommodation, wall_speed_ratio } => {
                let normal = part("drag.normal_accommodation", normal_accommodation)?;
                let tangential = part("drag.tangential_accommodation", tangential_accommodation)?;
                let ratio = part("drag.wall_speed_ratio", wall_speed_ratio)?;
                Ok([tangential, normal * ratio, 2.0 - normal - tangential])
            }
        }
    }
}
