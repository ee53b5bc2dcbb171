//! `heavy-top`: gravity on a body that turns about a fixed pivot.

use super::formula::{Column, Epoch, Formula, Row};
use std::sync::LazyLock;

use glam::{DQuat, DVec3};

use super::{Declaration, Frame, Model, Parameter, ParameterDeclaration, Torque, Validity, Value, Values};
use crate::bodies::BodyFrame;
use crate::math::quaternion::Quaternion;
use crate::math::real::Real;
use crate::math::vector::Vector;

/// τ = c × Rᵀ (M g), c from the pivot to the centre of mass (Lagrange, *Mécanique analytique*, 1788; F. Klein,
/// A. Sommerfeld, *Über die Theorie des Kreisels*, 1897, chapter IV). Potential energy: −M g · R c.
///
/// The body's inertia tensor is the one about the pivot.
pub struct HeavyTop;

static DECLARATION: LazyLock<Declaration> = LazyLock::new(|| {
    let source = "F. Klein, A. Sommerfeld, Über die Theorie des Kreisels, 1897, chapter IV";
    let declaration = Declaration::new("heavy-top", "τ = c × Rᵀ (M g)", source);
    declaration.pivot().note("the body's inertia tensor is the one about the pivot").parameters([
        ParameterDeclaration::number("mass", "kg", "the mass M").valid(Validity::NotNegative).factor(),
        ParameterDeclaration::vector("centre", "m", Frame::Body, "the centre of mass c from the pivot").factor(),
        ParameterDeclaration::vector("gravity", "m/s²", Frame::World, "the acceleration g").factor(),
    ])
});
const MASS: usize = 0;
const CENTRE: usize = 1;
const GRAVITY: usize = 2;

impl Torque {
    /// Gravity about a fixed pivot: mass (kg), centre of mass from the pivot in body axes (m), gravity in world axes
    /// [m/s²]; see [`HeavyTop`].
    pub fn heavy_top(
        mass: impl Into<Parameter<f64>>,
        centre_body: impl Into<Parameter<DVec3>>,
        gravity_world: impl Into<Parameter<DVec3>>,
    ) -> Self {
        let (centre, gravity) = (Value::Vector(centre_body.into()), Value::Vector(gravity_world.into()));
        Self::built(&HeavyTop, [Value::Number(mass.into()), centre, gravity])
    }
}

impl Model for HeavyTop {
    declared!(HeavyTop);

    fn rate(&self, values: Values<'_>, body: usize, middle_moment: f64) -> f64 {
        (moment_body(values, body).length() / middle_moment).sqrt()
    }

    fn columns(&self, values: Values<'_>, body: usize, frame: &BodyFrame, _: DQuat, out: &mut [f64]) {
        let moment = frame.scaled_torque(frame.to_principal(moment_body(values, body)));
        out[..3].copy_from_slice(&moment.to_array());
        out[3..6].copy_from_slice(&values.vector(GRAVITY).at(body).normalize_or_zero().to_array());
    }

    fn has_potential(&self) -> bool {
        true
    }

    fn potential_energy(&self, values: Values<'_>, body: usize, orientation: DQuat) -> f64 {
        let centre_world = orientation * values.vector(CENTRE).at(body);
        -values.number(MASS).at(body) * values.vector(GRAVITY).at(body).dot(centre_world)
    }
}

/// M |g| c in body axes, N m.
fn moment_body(values: Values<'_>, body: usize) -> DVec3 {
    values.vector(CENTRE).at(body) * (values.number(MASS).at(body) * values.vector(GRAVITY).at(body).length())
}

impl Formula for HeavyTop {
    const STEM: &'static str = "heavy_top";
    const COLUMNS: &'static [Column] = &[Column::vector("moment_principal"), Column::vector("direction_world")];

    /// c' × Rᵀ d: c' = M |g| c, d the direction of gravity.
    #[inline(always)]
    fn torque<R: Real>(row: &impl Row<R>, _: &Epoch<R>, q: Quaternion<R>, _: Vector<R>) -> Vector<R> {
        row.vector(0).cross(q.rotate_inverse(row.vector(3)))
    }
}
