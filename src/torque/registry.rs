//! The models that a scene's torques may have: the only list of them on the host's side.

use super::constant_body::ConstantBody;
use super::constant_world::ConstantWorld;
use super::eddy_current::EddyCurrent;
use super::gravity_gradient::GravityGradient;
use super::heavy_top::HeavyTop;
use super::internal_dissipation::InternalDissipation;
use super::linear_drag::LinearDrag;
use super::log_spring::LogSpring;
use super::magnetic_dipole::MagneticDipole;
use super::matrix_drag::MatrixDrag;
use super::orbiting_dipole::OrbitingDipole;
use super::quadratic_drag::QuadraticDrag;
use super::sine_spring::SineSpring;
use super::sinusoidal::Sinusoidal;
use super::variable_inertia::VariableInertia;
use super::white_noise::WhiteNoise;
use super::{Declaration, Model};

/// All models, in the order in which they are listed everywhere.
pub(crate) static MODELS: &[&dyn Model] = &[
    &ConstantBody,
    &ConstantWorld,
    &LinearDrag,
    &MatrixDrag,
    &QuadraticDrag,
    &Sinusoidal,
    &GravityGradient,
    &HeavyTop,
    &MagneticDipole,
    &OrbitingDipole,
    &EddyCurrent,
    &SineSpring,
    &LogSpring,
    &InternalDissipation,
    &WhiteNoise,
    &VariableInertia,
];

/// The declarations of all models.
pub fn declarations() -> impl Iterator<Item = &'static Declaration> {
    MODELS.iter().map(|model| model.declaration())
}
