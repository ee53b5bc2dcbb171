//! Angular velocities that depend on a body's own moments.

use std::sync::{Arc, LazyLock};

use glam::DVec3;

use super::vector::NAMES as NAMES_OF_VECTORS;
use super::{Scalar, Vector};
use crate::bodies::inertia::{InertiaTensor, principal_axes};
use crate::error::Result;
use crate::study::draw::{Column, Draw};
use crate::study::reader::Node;

/// Boltzmann's constant, J/K, by definition of the kelvin.
pub const BOLTZMANN: f64 = 1.380_649e-23;

/// The distribution of a body's angular velocity; the table above has formulas and sources.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum AngularVelocity {
    /// As for any vector, body axes, rad/s.
    Vector(Vector),
    /// Boltzmann's distribution of a free rotor.
    Thermal {
        /// Temperature, K.
        temperature: Scalar,
    },
    /// A fixed rotational kinetic energy.
    FixedEnergy {
        /// Energy, J.
        energy: Scalar,
    },
    /// An angular momentum of fixed magnitude, with a uniform direction in the body.
    FixedAngularMomentum {
        /// Magnitude, kg m²/s.
        angular_momentum: Scalar,
    },
    /// One for each cell of the study's design; body b has that of cell b modulo their number.
    PerCell(Arc<[AngularVelocity]>),
}

/// A least moment below this part of the greatest is that of a linear rotor, as in [`crate::bodies::inertia`].
const LINEAR: f64 = 1e-12;

/// The component under which temperature, energy and angular momentum are drawn: after those of normals and of a direction.
const BESIDE_NORMALS: u32 = 3;
const BESIDE_DIRECTION: u32 = 1;

impl AngularVelocity {
    /// The angular velocity of `body`, whose inertia tensor is given, body axes, rad/s. A negative parameter that must not be gives NaN.
    pub fn sample(&self, draw: Draw, body: usize, inertia: &InertiaTensor) -> DVec3 {
        const COLUMN: Column = Column::AngularVelocity;
        let number = |scalar: &Scalar, component| scalar.sample(draw, body, COLUMN, component);
        match self {
            AngularVelocity::Vector(vector) => vector.sample(draw, body, COLUMN),
            AngularVelocity::PerCell(cells) => cells[draw.cell(body, cells.len())].sample(draw, body, inertia),
            AngularVelocity::Thermal { temperature } => {
                let energy = BOLTZMANN * number(temperature, BESIDE_NORMALS);
                let normals = draw.normal_vector(body, COLUMN);
                along_axes(inertia, |c, moment| (energy / moment).sqrt() * normals[c])
            }
            AngularVelocity::FixedEnergy { energy } => {
                let energy = number(energy, BESIDE_DIRECTION);
                let direction = direction(draw, body, inertia);
                along_axes(inertia, |c, moment| (2.0 * energy / moment).sqrt() * direction[c])
            }
            AngularVelocity::FixedAngularMomentum { angular_momentum } => {
                let magnitude = number(angular_momentum, BESIDE_DIRECTION);
                let direction = direction(draw, body, inertia);
                along_axes(inertia, |c, moment| magnitude * direction[c] / moment)
            }
        }
    }

    pub(in crate::study) fn read(node: &Node<'_>) -> Result<Self> {
        let name = node.any_table().and_then(|table| table.find("distribution"));
        let own = name.and_then(|name| NAMES.iter().find(|own| name.string("").is_ok_and(|name| name == own.0)));
        let Some((_, key, unit, expected, make)) = own else {
            return Vector::read_among(node, "rad/s", &POSSIBLE).map(AngularVelocity::Vector);
        };
        if let Some(cells) = node.per_cell(Self::read)? {
            return Ok(AngularVelocity::PerCell(cells));
        }
        let table = node.table(*expected, &["distribution", key])?;
        let value = table.need(key, *expected)?;
        let scalar = Scalar::read(&value, unit)?;
        match scalar {
            Scalar::Constant(x) if x < 0.0 => Err(value.refuse(*expected)),
            scalar => Ok(make(scalar)),
        }
    }
}

/// The names of all distributions of an angular velocity.
static POSSIBLE: LazyLock<Vec<&'static str>> =
    LazyLock::new(|| NAMES_OF_VECTORS.iter().copied().chain(NAMES.iter().map(|named| named.0)).collect());

/// Name, key, unit, expected value, and constructor.
type Named = (&'static str, &'static str, &'static str, &'static str, fn(Scalar) -> AngularVelocity);

const NAMES: [Named; 3] = [
    ("thermal", "temperature", "K", "expected a temperature that is not negative (K)", |temperature| {
        AngularVelocity::Thermal { temperature }
    }),
    ("fixed-energy", "energy", "J", "expected an energy that is not negative (J)", |energy| {
        AngularVelocity::FixedEnergy { energy }
    }),
    (
        "fixed-angular-momentum",
        "angular_momentum",
        "kg m²/s",
        "expected a magnitude that is not negative (kg m²/s)",
        |angular_momentum| AngularVelocity::FixedAngularMomentum { angular_momentum },
    ),
];

fn is_linear(moments: DVec3) -> bool {
    moments.x <= LINEAR * moments.z
}

/// A unit vector in principal axes: uniform on the sphere, or for a linear rotor on the circle across its axis.
fn direction(draw: Draw, body: usize, inertia: &InertiaTensor) -> DVec3 {
    if !is_linear(principal_axes(inertia).moments) {
        return draw.direction(body, Column::AngularVelocity);
    }
    let (_, v) = draw.pair(body, Column::AngularVelocity, 0);
    let (sin, cos) = libm::sincos(std::f64::consts::TAU * v);
    DVec3::new(0.0, cos, sin)
}

/// The vector in body axes with components along the principal axes computed from index and moment; zero along the axis of a linear
/// rotor.
fn along_axes(inertia: &InertiaTensor, component: impl Fn(usize, f64) -> f64) -> DVec3 {
    let axes = principal_axes(inertia);
    let first = if is_linear(axes.moments) { 0.0 } else { component(0, axes.moments.x) };
    axes.principal_to_body * DVec3::new(first, component(1, axes.moments.y), component(2, axes.moments.z))
}
