//! `internal-dissipation`: loss of energy inside the body, which keeps its angular momentum.

use super::formula::{Column, Formula, Role};
use std::sync::LazyLock;

use glam::{DQuat, DVec3};

use super::{Declaration, Model, Parameter, ParameterDeclaration, Torque, Validity, Value, Values};
use crate::bodies::BodyFrame;
use crate::math::real::Real;
use crate::math::vector::Vector;

/// dm/dt = m × ω + k m × (m × ω): the double-bracket form (A. M. Bloch, P. S. Krishnaprasad, J. E. Marsden,
/// T. S. Ratiu, *The Euler-Poincaré equations and double bracket dissipation*, Comm. Math. Phys. 175 (1996) 1,
/// section 5).
///
/// The energy falls at the rate k |m × ω|² until the body turns about its axis of greatest moment, while |m| stays constant. It is not a
/// torque, which would change the angular momentum in the world: the body's axes turn with I⁻¹m + k m × ω instead of I⁻¹m, so that dm/dt is
/// m × that rate and the angular momentum in the world is constant as a vector. The reported velocity is I⁻¹m, and so is the one that other
/// torques read.
pub struct InternalDissipation;

static DECLARATION: LazyLock<Declaration> = LazyLock::new(|| {
    let coefficient = ParameterDeclaration::number("coefficient", "s/(kg m²)", "the coefficient k");
    Declaration::new(
        "internal-dissipation",
        "dm/dt = m × ω + k m × (m × ω)",
        "A. M. Bloch et al., Comm. Math. Phys. 175 (1996) 1, section 5",
    )
    .note("not a torque: m is constant in the world; axes turn at ω + k m × ω, torques read ω = I⁻¹ m")
    .dissipative()
    .not_rigid()
    .parameters([coefficient.valid(Validity::NotNegative).factor()])
});
const COEFFICIENT: usize = 0;

impl Torque {
    /// Loss of energy at constant angular momentum, coefficient in s/(kg m²); see [`InternalDissipation`].
    pub fn internal_dissipation(coefficient: impl Into<Parameter<f64>>) -> Self {
        Self::built(&InternalDissipation, [Value::Number(coefficient.into())])
    }
}

impl Model for InternalDissipation {
    declared!(InternalDissipation);

    fn columns(&self, values: Values<'_>, body: usize, frame: &BodyFrame, _: DQuat, out: &mut [f64]) {
        out[0] += frame.scaled(values.number(COEFFICIENT).at(body), -1, -1);
    }

    fn slip(&self, values: Values<'_>, body: usize, momentum_body: DVec3, angular_velocity_body: DVec3) -> DVec3 {
        momentum_body.cross(angular_velocity_body) * values.number(COEFFICIENT).at(body)
    }
}

/// k m × ω, which is added to the rate at which the body's axes turn, in principal axes.
#[inline(always)]
pub fn internal_dissipation<R: Real>(coefficient: R, m: Vector<R>, angular_velocity_principal: Vector<R>) -> Vector<R> {
    m.cross(angular_velocity_principal) * coefficient
}

impl Formula for InternalDissipation {
    const STEM: &'static str = "internal_dissipation";
    const COLUMNS: &'static [Column] = &[Column::number("coefficient")];
    const MERGES: bool = true;
    const ROLE: Role = Role::Slip;
}
