//! `orbiting-dipole`: a magnet fixed in the body, in the field of a planet's tilted dipole, along an orbit.

use super::formula::{Column, Epoch, Formula, MOST_PHASES, Rates, Row, rates};
use super::magnetic_dipole::magnetic_dipole;
use glam::{DQuat, DVec3};
use std::sync::LazyLock;

use super::gravity_gradient_kepler::place_and_cube;
use super::orbit::drift::{DRIFTING_COLUMNS, DRIFTING_NUMBERS, DRIFTING_PHASES, DriftingOrbit};
use super::orbit::{self, ELEMENTS, Elements, elements};
use super::{
    Declaration, Frame, Kind, Model, Orbit, Parameter, ParameterDeclaration, Preset, Torque, ValidationContext, Value,
    Values,
};
use crate::bodies::BodyFrame;
use crate::error::Result;
use crate::math::quaternion::Quaternion;
use crate::math::real::{Real, sin_cos};
use crate::math::vector::Vector;

/// τ = m × Rᵀ B with B = b/r³ (3 (d · r̂) r̂ − d), d the direction of the planet's dipole, which turns about the world's
/// z axis (J. R. Wertz, *Spacecraft Attitude Determination and Control*, 1978, equation H-16).
///
/// b is μ₀/4π times the planet's dipole moment; the Earth's is 7.8e15 T m³ with a tilt of π less 0.17 rad.
pub struct OrbitingDipole;

static DECLARATION: LazyLock<Declaration> = LazyLock::new(|| {
    let source = "J. R. Wertz, Spacecraft Attitude Determination and Control, 1978, equation H-16";
    Declaration::new("orbiting-dipole", "τ = m × Rᵀ B, B = b/r³ (3 (d · r̂) r̂ − d)", source)
        .parameters(orbit::parameters())
        .parameters([ParameterDeclaration::vector("moment", "A m²", Frame::Body, "the magnetic moment m").factor()])
        .parameters(field_parameters())
        .parameters(orbit::drift::parameters())
});
const MOMENT: usize = ELEMENTS;

impl Torque {
    /// A magnetic moment in body axes (A m²) in a planet's dipole field along an orbit: strength [T m³], tilt and azimuth
    /// of the dipole (rad), rate of the planet's rotation (rad/s); see [`OrbitingDipole`].
    pub fn orbiting_dipole(
        moment_body: impl Into<Parameter<DVec3>>,
        orbit: Orbit,
        strength: impl Into<Parameter<f64>>,
        tilt: impl Into<Parameter<f64>>,
        azimuth: impl Into<Parameter<f64>>,
        rotation: impl Into<Parameter<f64>>,
    ) -> Self {
        let field = [strength.into(), tilt.into(), azimuth.into(), rotation.into()];
        Self::built(&OrbitingDipole, field_values(orbit, Value::Vector(moment_body.into()), field))
    }
}

impl Model for OrbitingDipole {
    declared!();

    fn kind(&self, values: Values<'_>) -> Kind {
        if orbit::drift::is_drifting(values) { Kind::OrbitingDipoleDrifting } else { Kind::OrbitingDipole }
    }

    fn validate(&self, values: Values<'_>, context: &ValidationContext) -> Result<()> {
        orbit::validate(values, context)
    }

    fn rate(&self, values: Values<'_>, body: usize, middle_moment: f64) -> f64 {
        let orbit = elements(values, body);
        let nearest = 1.0 - orbit.eccentricity;
        let field = 2.0 * field_scale(values, body, &orbit).abs() / (nearest * nearest * nearest);
        (values.vector(MOMENT).at(body).length() * field / middle_moment).sqrt()
    }

    fn columns(&self, values: Values<'_>, body: usize, frame: &BodyFrame, _: DQuat, out: &mut [f64]) {
        let scale = field_scale(values, body, &elements(values, body));
        let moment = frame.to_principal(values.vector(MOMENT).at(body)) * scale;
        out[..3].copy_from_slice(&frame.scaled_torque(moment).to_array());
        // The table has determined which of the two kinds it is.
        let drifts = out.len() == Kind::OrbitingDipoleDrifting.columns();
        field_columns(values, body, drifts, &mut out[3..]);
    }

    fn phase_rates(&self, values: Values<'_>, body: usize) -> Rates {
        field_phase_rates(values, body)
    }

    fn sets_phase_rate(&self, values: Values<'_>, parameter: &ParameterDeclaration) -> bool {
        orbit::drift::sets_phase_rate(values, parameter)
    }
}

// A model in the field declares the orbit first, then one parameter of its own, then those of the field, then those of the drift.
const STRENGTH: usize = ELEMENTS + 1;
const TILT: usize = ELEMENTS + 2;
const AZIMUTH: usize = ELEMENTS + 3;
const ROTATION: usize = ELEMENTS + 4;

/// The parameters of the planet's dipole.
pub(super) fn field_parameters() -> [ParameterDeclaration; 4] {
    let or_zero = |name, unit, about| ParameterDeclaration::number(name, unit, about).or(Preset::Number(0.0));
    [
        ParameterDeclaration::number("strength", "T m³", "b, the planet's dipole moment times μ0/4π").factor(),
        or_zero("tilt", "rad", "the dipole's angle from the world's z axis"),
        or_zero("azimuth", "rad", "the dipole's azimuth at t = 0 from the world's x axis"),
        or_zero("rotation", "rad/s", "the planet's rate about the world's z axis").phase_rate(),
    ]
}

/// The values of a model in the field; `of_body` is its own parameter.
pub(super) fn field_values(orbit: Orbit, of_body: Value, field: [Parameter<f64>; 4]) -> Vec<Value> {
    let (elements, drift) = orbit.values();
    elements.into_iter().chain([of_body]).chain(field.map(Value::Number)).chain(drift).collect()
}

/// b/a³, T.
pub(super) fn field_scale(values: Values<'_>, body: usize, orbit: &Elements) -> f64 {
    let a = orbit.semi_major_axis;
    values.number(STRENGTH).at(body) / a / a / a
}

/// Writes the columns that [`DipoleField::of_row`] reads, or [`DriftingDipoleField::of_row`] if an orbit `drifts`.
pub(super) fn field_columns(values: Values<'_>, body: usize, drifts: bool, out: &mut [f64]) {
    let orbit = elements(values, body);
    let (x, y) = orbit.axes();
    let (sin, cos) = values.number(TILT).at(body).sin_cos();
    let azimuth = values.number(AZIMUTH).at(body) / std::f64::consts::TAU;
    let dipole = [sin, cos, azimuth - azimuth.round()];
    if drifts {
        orbit.drifting_columns(out);
        out[DRIFTING_NUMBERS..DRIFTING_FIELD_NUMBERS].copy_from_slice(&dipole);
        return;
    }
    out[..3].copy_from_slice(&x.to_array());
    out[3..6].copy_from_slice(&y.to_array());
    out[6] = orbit.eccentricity;
    out[7] = orbit.anomaly_turns();
    out[8..FIELD_NUMBERS].copy_from_slice(&dipole);
}

/// Rates of the phases of the field, rad/s, in two words; those of the orbit come first.
pub(super) fn field_phase_rates(values: Values<'_>, body: usize) -> Rates {
    let rotation = (values.number(ROTATION).at(body), 0.0);
    let [anomaly, pericentre, node] = elements(values, body).rates();
    match orbit::drift::is_drifting(values) {
        true => [anomaly, pericentre, node, rotation],
        false => rates([anomaly, rotation]),
    }
}

/// A column of the model itself, then those of the field.
pub(super) const fn with_field(own: Column) -> [Column; 8] {
    [
        own,
        Column::vector("x_world"),
        Column::vector("y_world"),
        Column::number("eccentricity"),
        Column::number("start"),
        Column::number("sin_tilt"),
        Column::number("cos_tilt"),
        Column::number("azimuth"),
    ]
}

/// Number of columns that describe the field.
pub(super) const FIELD_NUMBERS: usize = 11;
/// The phases of the field.
pub(super) const FIELD_PHASES: &[&str] = &["orbit_phase", "rotation_phase"];

/// A column of the model itself, then those of the field along an orbit that drifts.
pub(super) const fn with_drifting_field(own: Column) -> [Column; 10] {
    let [sin, cos, node, pericentre, eccentricity, start] = DRIFTING_COLUMNS;
    let dipole = [Column::number("sin_tilt"), Column::number("cos_tilt"), Column::number("azimuth")];
    [own, sin, cos, node, pericentre, eccentricity, start, dipole[0], dipole[1], dipole[2]]
}

/// Number of columns that describe the field along an orbit that drifts.
pub(super) const DRIFTING_FIELD_NUMBERS: usize = DRIFTING_NUMBERS + 3;
/// Its phases.
pub(super) const DRIFTING_FIELD_PHASES: &[&str] =
    &[DRIFTING_PHASES[0], DRIFTING_PHASES[1], DRIFTING_PHASES[2], "rotation_phase"];

/// The constants of the field along an orbit that drifts.
#[derive(Clone, Copy, Debug)]
pub(super) struct DriftingDipoleField<R> {
    orbit: DriftingOrbit<R>,
    /// Sine and cosine of the dipole's angle from the z axis.
    tilt: [R; 2],
    /// The dipole's azimuth at t = 0, turns.
    azimuth: R,
}

impl<R: Real> DriftingDipoleField<R> {
    /// The field from an instance's columns from `first` on.
    #[inline(always)]
    pub fn of_row(row: &impl Row<R>, first: usize) -> Self {
        let behind = first + DRIFTING_NUMBERS;
        Self {
            orbit: DriftingOrbit::of_row(row, first),
            tilt: [row.number(behind), row.number(behind + 1)],
            azimuth: row.number(behind + 2),
        }
    }

    /// As [`DipoleField::at`].
    #[inline(always)]
    pub fn at(&self, [anomaly, pericentre, node, rotation]: [R; MOST_PHASES]) -> Vector<R> {
        let (r, cube) = self.orbit.place_and_cube([anomaly, pericentre, node]);
        field_at(r, cube, self.tilt, rotation + self.azimuth)
    }
}

/// (a/r)³ (3 (d · r̂) r̂ − d), in world axes, from the direction r̂ and (a/r)³; `tilt` is sine and cosine of the angle of d from the z
/// axis, `azimuth` that of d in turns.
#[inline(always)]
fn field_at<R: Real>(r: Vector<R>, cube: R, [sin_tilt, cos_tilt]: [R; 2], azimuth: R) -> Vector<R> {
    let (sin, cos) = sin_cos((azimuth - azimuth.round()) * R::splat(std::f64::consts::TAU));
    let dipole = Vector::new(sin_tilt * cos, sin_tilt * sin, cos_tilt);
    (r.axpy(R::splat(3.0) * dipole.dot(r), -dipole)) * cube
}

/// The constants of the field.
#[derive(Clone, Copy, Debug)]
pub(super) struct DipoleField<R> {
    /// Towards the pericentre, world axes.
    x_world: Vector<R>,
    /// Perpendicular to it in the direction of motion, world axes.
    y_world: Vector<R>,
    /// Eccentricity of the orbit.
    eccentricity: R,
    /// Mean anomaly at t = 0, turns.
    start: R,
    /// Sine of the dipole's angle from the z axis.
    sin_tilt: R,
    /// Cosine of it.
    cos_tilt: R,
    /// The dipole's azimuth at t = 0, turns.
    azimuth: R,
}

impl<R: Real> DipoleField<R> {
    /// The field from an instance's columns from `first` on.
    #[inline(always)]
    pub fn of_row(row: &impl Row<R>, first: usize) -> Self {
        Self {
            x_world: row.vector(first),
            y_world: row.vector(first + 3),
            eccentricity: row.number(first + 6),
            start: row.number(first + 7),
            sin_tilt: row.number(first + 8),
            cos_tilt: row.number(first + 9),
            azimuth: row.number(first + 10),
        }
    }

    /// (a/r)³ (3 (d · r̂) r̂ − d), in world axes; both phases in turns.
    #[inline(always)]
    pub fn at(&self, orbit_phase: R, rotation_phase: R) -> Vector<R> {
        let (r, cube) = place_and_cube(self.x_world, self.y_world, self.eccentricity, self.start, orbit_phase);
        field_at(r, cube, [self.sin_tilt, self.cos_tilt], rotation_phase + self.azimuth)
    }
}

impl Formula for OrbitingDipole {
    const STEM: &'static str = "orbiting_dipole";
    const COLUMNS: &'static [Column] = &with_field(Column::vector("moment_principal"));
    const PHASES: &'static [&'static str] = FIELD_PHASES;
    #[inline(always)]
    fn epoch_reads(column: usize) -> bool {
        (3..3 + FIELD_NUMBERS).contains(&column)
    }

    #[inline(always)]
    fn epoch<R: Real>(row: &impl Row<R>, phases: [R; MOST_PHASES]) -> Epoch<R> {
        Epoch::vector(DipoleField::of_row(row, 3).at(phases[0], phases[1]))
    }

    /// m' × Rᵀ (a/r)³ (3 (d · r̂) r̂ − d), m' = m b/a³.
    #[inline(always)]
    fn torque<R: Real>(row: &impl Row<R>, epoch: &Epoch<R>, q: Quaternion<R>, _: Vector<R>) -> Vector<R> {
        magnetic_dipole(row.vector(0), epoch.vector, q)
    }
}
