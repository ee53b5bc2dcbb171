//! `pd-attitude`: a sampled proportional-derivative law towards an attitude of the world, by ideal actuators with a limit.

use std::sync::LazyLock;

use glam::DQuat;

use super::control::{self, SOUND, SampledLaw, Sampling, limited};
use super::{Declaration, Model, Parameter, ParameterDeclaration, Torque, ValidationContext, Validity, Value};
use crate::error::Result;

/// τ = −k θ − d ω at a sample, θ = 2 sgn(s) v with (v, s) = conj(q_target) q, clamped to ±`torque_limit` axis by axis and held (B. Wie, P.
/// M. Barba, *J. Guid. Control Dyn.* 8 (1985) 360; F. L. Markley, J. L. Crassidis, *Fundamentals of Spacecraft Attitude Determination and
/// Control*, 2014, equation 7.14). θ is the angle from the target to second order.
pub struct PdAttitude;

static DECLARATION: LazyLock<Declaration> = LazyLock::new(|| {
    let source = "F. L. Markley, J. L. Crassidis, Fundamentals of Spacecraft Attitude Determination and Control, 2014, equation 7.14";
    Declaration::new("pd-attitude", "τ = −k θ − d ω of a sample, within a limit", source)
        .note(THETA)
        .parameters(law_parameters())
        .parameters([torque_limit()])
        .parameters(control::parameters())
});

/// What θ is, for models with these parameters.
pub(super) const THETA: &str =
    "θ = 2 (x, y, z) of the rotation from the target to the attitude, in body axes, with w ≥ 0";

/// Gains and target of the law.
pub(super) fn law_parameters() -> [ParameterDeclaration; 3] {
    let number = |name, unit, about| ParameterDeclaration::number(name, unit, about).valid(Validity::NotNegative);
    [
        number("stiffness", "N m", "k, per radian of θ"),
        number("damping", "N m s", "d"),
        ParameterDeclaration::rotation("target", "the attitude aimed at"),
    ]
}

/// The limit of the torque about each axis.
pub(super) fn torque_limit() -> ParameterDeclaration {
    ParameterDeclaration::number("torque_limit", "N m", "the greatest torque about each body axis")
        .valid(Validity::Positive)
}

/// The definitions of `u`, the torque that the law demands, N m in body axes.
pub(super) const ASKED: &str = "let error = conjugate(target) * attitude;
let angle = 2 * select(error.w < 0, -1, 1) * vec(error.x, error.y, error.z);
let u = -stiffness * angle - damping * angular_velocity;
";

impl Torque {
    /// A sampled law towards an attitude (body to world): k (N m per radian), d (N m s), and the limit of the torque about each axis (N m); see
    /// [`PdAttitude`].
    pub fn pd_attitude(
        stiffness: impl Into<Parameter<f64>>,
        damping: impl Into<Parameter<f64>>,
        target: impl Into<Parameter<DQuat>>,
        torque_limit: impl Into<Parameter<f64>>,
        sampling: Sampling,
    ) -> Self {
        let own = [
            Value::Number(stiffness.into()),
            Value::Number(damping.into()),
            Value::Rotation(target.into()),
            Value::Number(torque_limit.into()),
        ];
        of_values(&own.into_iter().chain(sampling.values()).collect::<Vec<_>>())
    }
}

fn of_values(values: &[Value]) -> Torque {
    let law = SampledLaw::of_model(&DECLARATION, values, []).expect(SOUND);
    let law = law.sample_vector("held", &(ASKED.to_owned() + &limited("u", "torque_limit"))).expect(SOUND);
    law.torque_of(&DECLARATION, "held").expect(SOUND)
}

impl Model for PdAttitude {
    declared!(Custom);

    fn made_for(&self, values: &[Value], _: &ValidationContext) -> Option<Result<Torque>> {
        Some(Ok(of_values(values)))
    }
}
