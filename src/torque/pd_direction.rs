//! `pd-direction`: a sampled proportional-derivative law that points an axis of the body in a direction of the world.

use std::sync::LazyLock;

use glam::DVec3;

use super::control::{self, SOUND, SampledLaw, Sampling, limited};
use super::pd_attitude::torque_limit;
use super::{Declaration, Frame, Model, Parameter, ParameterDeclaration, Torque, ValidationContext, Validity, Value};
use crate::error::Result;

/// τ = k a × Rᵀ d̂ − d ω at a sample, clamped to ±`torque_limit` axis by axis and held (P. C. Hughes, *Spacecraft Attitude Dynamics*, 1986,
/// section 7.3, for a spring by the sine of the angle). It damps the rotation about the axis too. An axis that points exactly away from the
/// direction, at an angle of π, feels no torque towards it.
pub struct PdDirection;

static DECLARATION: LazyLock<Declaration> = LazyLock::new(|| {
    let source = "P. C. Hughes, Spacecraft Attitude Dynamics, 1986, section 7.3";
    let number = |name, unit, about| ParameterDeclaration::number(name, unit, about).valid(Validity::NotNegative);
    let direction = ParameterDeclaration::vector("direction", "1", Frame::World, "d, of any length");
    Declaration::new("pd-direction", "τ = k a × Rᵀ d̂ − d ω of a sample, within a limit", source)
        .parameters([
            number("stiffness", "N m", "k"),
            number("damping", "N m s", "d"),
            ParameterDeclaration::vector("axis", "1", Frame::Body, "a, of any length").valid(Validity::NotZero),
            direction.valid(Validity::NotZero),
            torque_limit(),
        ])
        .parameters(control::parameters())
});

impl Torque {
    /// A sampled law that points an axis of the body in a direction of the world: k (N m), d (N m s), and the limit of the torque about each axis
    /// (N m); see [`PdDirection`].
    pub fn pd_direction(
        stiffness: impl Into<Parameter<f64>>,
        damping: impl Into<Parameter<f64>>,
        axis_body: impl Into<Parameter<DVec3>>,
        direction_world: impl Into<Parameter<DVec3>>,
        torque_limit: impl Into<Parameter<f64>>,
        sampling: Sampling,
    ) -> Self {
        let own = [
            Value::Number(stiffness.into()),
            Value::Number(damping.into()),
            Value::Vector(axis_body.into()),
            Value::Vector(direction_world.into()),
            Value::Number(torque_limit.into()),
        ];
        of_values(&own.into_iter().chain(sampling.values()).collect::<Vec<_>>())
    }
}

fn of_values(values: &[Value]) -> Torque {
    let asked =
        "let u = stiffness * cross(normalize(axis), to_body(normalize(direction))) - damping * angular_velocity;
";
    let law = SampledLaw::of_model(&DECLARATION, values, []).expect(SOUND);
    let law = law.sample_vector("held", &(asked.to_owned() + &limited("u", "torque_limit"))).expect(SOUND);
    law.torque_of(&DECLARATION, "held").expect(SOUND)
}

impl Model for PdDirection {
    declared!(Custom);

    fn made_for(&self, values: &[Value], _: &ValidationContext) -> Option<Result<Torque>> {
        Some(Ok(of_values(values)))
    }
}
