//! How moments of inertia change, as a scene describes it; see [`super::variable_inertia`].

use glam::DVec3;

use super::Parameter;
use super::variable_inertia::inertia_ramp;
use crate::batch::BodyFrame;
use crate::inertia::InertiaTensor;

/// The tensor I₁ after the change; the one before is the body's own.
#[derive(Clone, Debug, PartialEq)]
pub enum InertiaChange {
    /// A tensor in body axes, kg m², with the principal axes of the body's own.
    Tensor(Parameter<InertiaTensor>),
    /// The body's own times a factor above zero.
    Factor(Parameter<f64>),
}

/// How the moments go from I₀ to I₁.
#[derive(Clone, Debug, PartialEq)]
pub enum Law {
    /// Once, smoothly.
    Ramp {
        /// t₀, s, not negative.
        start: Parameter<f64>,
        /// Δ, s, above zero.
        duration: Parameter<f64>,
    },
    /// To and fro for ever, from I₀ at t = 0.
    Oscillation {
        /// Ω, rad/s.
        rate: Parameter<f64>,
    },
}

impl InertiaChange {
    /// To a tensor in body axes (kg m²) that all bodies share: an [`InertiaTensor`], a matrix, or three moments along the
    /// body axes.
    pub fn tensor(tensor: impl Into<InertiaTensor>) -> Self {
        Self::Tensor(Parameter::Shared(tensor.into()))
    }

    /// To a tensor of each body's own, shape `[body_count]`.
    pub fn tensors<I: Copy + Into<InertiaTensor>>(tensors: &[I]) -> Self {
        Self::Tensor(Parameter::PerBody(tensors.iter().map(|&tensor| tensor.into()).collect()))
    }

    /// To the body's own tensor times a factor.
    pub fn factor(factor: impl Into<Parameter<f64>>) -> Self {
        Self::Factor(factor.into())
    }

    /// I₁ of a body whose own tensor is `initial`.
    pub(super) fn of(&self, body: usize, initial: InertiaTensor) -> InertiaTensor {
        match self {
            Self::Tensor(tensor) => tensor.at(body),
            Self::Factor(factor) => initial * factor.at(body),
        }
    }

    /// The moments of I₁ in units of the body's own scale and along its principal axes.
    pub(super) fn scaled_moments(&self, body: usize, frame: &BodyFrame) -> DVec3 {
        match self {
            Self::Factor(factor) => frame.scaled_moments * factor.at(body),
            Self::Tensor(tensor) => {
                let tensor = tensor.at(body).rotated(frame.principal_to_body.conjugate());
                let moments = DVec3::new(tensor.xx, tensor.yy, tensor.zz);
                let moments =
                    if frame.is_linear_rotor { DVec3::splat(0.5 * moments.y + 0.5 * moments.z) } else { moments };
                DVec3::from_array(moments.to_array().map(|moment| frame.scaled(moment, 1, 0)))
            }
        }
    }
}

impl Law {
    /// From `start` over `duration`, both s.
    pub fn ramp(start: impl Into<Parameter<f64>>, duration: impl Into<Parameter<f64>>) -> Self {
        Self::Ramp { start: start.into(), duration: duration.into() }
    }

    /// With the angular frequency Ω, rad/s.
    pub fn oscillation(rate: impl Into<Parameter<f64>>) -> Self {
        Self::Oscillation { rate: rate.into() }
    }

    /// s at a time, s.
    pub(super) fn done(&self, body: usize, time: f64) -> f64 {
        match self {
            Self::Ramp { start, duration } => {
                let progress = (time - start.at(body)) / duration.at(body);
                inertia_ramp(progress.clamp(0.0, 1.0))
            }
            Self::Oscillation { rate } => {
                // Half the phase and what its rounding loses, so that it is exact after any number of turns.
                let half_rate = 0.5 * rate.at(body);
                let half_phase = half_rate * time;
                let lost = half_rate.mul_add(time, -half_phase);
                let (sin, cos) = half_phase.sin_cos();
                let sine = sin + lost * cos;
                sine * sine
            }
        }
    }
}
