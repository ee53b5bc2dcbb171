//! Changes of moments of inertia, as a scene describes them; see [`super::variable_inertia`].

use super::Parameter;
use crate::bodies::inertia::InertiaTensor;

/// The tensor I₁ after the change; the one before is the body's own.
#[derive(Clone, Debug, PartialEq)]
pub enum InertiaChange {
    /// A tensor in body axes, kg m², with the principal axes of the body's own.
    Tensor(Parameter<InertiaTensor>),
    /// The body's own times a factor above zero.
    Factor(Parameter<f64>),
}

/// The time dependence of the moments between I₀ and I₁.
#[derive(Clone, Debug, PartialEq)]
pub enum Law {
    /// Once, smoothly.
    Ramp {
        /// t₀, s, not negative.
        start: Parameter<f64>,
        /// Δ, s, above zero.
        duration: Parameter<f64>,
    },
    /// Periodically, starting from I₀ at t = 0.
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
}
