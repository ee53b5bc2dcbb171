//! `reaction-wheels`: three wheels along the body's axes that turn the body towards an attitude by a sampled law, within their limits.

use std::sync::LazyLock;

use glam::{DQuat, DVec3};

use super::control::{self, SOUND, SampledLaw, Sampling, limited};
use super::pd_attitude::{ASKED, THETA, law_parameters, torque_limit};
use super::{
    Declaration, Frame, Model, Parameter, ParameterDeclaration, Preset, Torque, ValidationContext, Validity, Value,
};
use crate::error::Result;

/// τ = −dh/dt − ω × h, where dh/dt = −u is held: u is the torque that [`pd-attitude`](super::pd_attitude) demands at a sample, clamped to
/// ±`torque_limit` axis by axis (F. L. Markley, J. L. Crassidis, *Fundamentals of Spacecraft Attitude Determination and Control*, 2014,
/// equations 3.147 and 7.14). No wheel exceeds ±`momentum_limit`: one that would reach it within the period is driven to it by the period's
/// end, and from then on gives no torque in that direction. A wheel that starts beyond the limit is not driven further.
///
/// h is the wheels' angular momentum along the body's axes relative to the body; the inertia tensor is that of the body with its wheels.
/// The total L + R h of body and wheels is conserved. The own state is `h`.
pub struct ReactionWheels;

static DECLARATION: LazyLock<Declaration> = LazyLock::new(|| {
    let source = "F. L. Markley, J. L. Crassidis, Fundamentals of Spacecraft Attitude Determination and Control, 2014, equation 3.147";
    let limit = ParameterDeclaration::number("momentum_limit", "kg m²/s", "the greatest momentum of a wheel");
    let start = ParameterDeclaration::vector("momentum", "kg m²/s", Frame::Body, "h at t = 0");
    Declaration::new("reaction-wheels", "τ = −dh/dt − ω × h, dh/dt = k θ + d ω of a sample, within limits", source)
        .note(THETA)
        .parameters(law_parameters())
        .parameters([torque_limit(), limit.valid(Validity::Positive), start.or(Preset::Number(0.0))])
        .parameters(control::parameters())
        .own_state([ParameterDeclaration::vector("h", "kg m²/s", Frame::Body, "the momentum of the wheels")])
});
const MOMENTUM: usize = 5;

/// The limits and the initial momentum of three wheels along the body's axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Wheels {
    /// The greatest torque of a wheel, N m.
    pub torque_limit: Parameter<f64>,
    /// The greatest angular momentum of a wheel, kg m²/s.
    pub momentum_limit: Parameter<f64>,
    /// The angular momentum of the wheels at t = 0, body axes, kg m²/s.
    pub momentum: Parameter<DVec3>,
}

impl Torque {
    /// Three wheels that turn the body towards an attitude (body to world) by a sampled law: k (N m per radian) and d (N m s); see
    /// [`ReactionWheels`].
    ///
    /// ```
    /// use glam::{DQuat, DVec3};
    /// use polhode::torque::{Sampling, Torque};
    /// use polhode::torque::reaction_wheels::Wheels;
    ///
    /// let wheels = Wheels {
    ///     torque_limit: 1e-3.into(),
    ///     momentum_limit: 0.02.into(),
    ///     momentum: DVec3::ZERO.into(),
    /// };
    /// let torque = Torque::reaction_wheels(2e-3, 8e-3, DQuat::IDENTITY, wheels, Sampling::every(0.5).delayed(0.1));
    /// assert!(torque.is_sampled());
    /// ```
    pub fn reaction_wheels(
        stiffness: impl Into<Parameter<f64>>,
        damping: impl Into<Parameter<f64>>,
        target: impl Into<Parameter<DQuat>>,
        wheels: Wheels,
        sampling: Sampling,
    ) -> Self {
        let own = [
            Value::Number(stiffness.into()),
            Value::Number(damping.into()),
            Value::Rotation(target.into()),
            Value::Number(wheels.torque_limit),
            Value::Number(wheels.momentum_limit),
            Value::Vector(wheels.momentum),
        ];
        of_values(&own.into_iter().chain(sampling.values()).collect::<Vec<_>>())
    }
}

fn of_values(values: &[Value]) -> Torque {
    let Value::Vector(momentum) = &values[MOMENTUM] else { panic!("{SOUND}") };
    // Towards 0 a wheel may always turn, even one that starts beyond its limit.
    let within = |axis| {
        let (low, high) =
            (format!("(-momentum_limit - h.{axis}) / every"), format!("(momentum_limit - h.{axis}) / every"));
        format!("clamp(-u.{axis}, min({low}, 0), max({high}, 0))")
    };
    let rate = format!("vec({}, {}, {})", within('x'), within('y'), within('z'));
    let law = SampledLaw::of_model(&DECLARATION, values, []).expect(SOUND);
    let law = law.vector("h", momentum.clone()).expect(SOUND);
    let law = law.sample_vector("u", &(ASKED.to_owned() + &limited("u", "torque_limit"))).expect(SOUND);
    let law = law.rate("h", &rate).expect(SOUND);
    law.torque_of(&DECLARATION, "-d_h - cross(angular_velocity, h)").expect(SOUND)
}

impl Model for ReactionWheels {
    declared!(Custom);

    fn made_for(&self, values: &[Value], _: &ValidationContext) -> Option<Result<Torque>> {
        Some(Ok(of_values(values)))
    }
}
