//! The models that a scene's torques may have: the only list of them on the host's side.

use super::{Declaration, Model};

/// Registers models: one line for each, in the order in which they are listed everywhere.
macro_rules! models {
    ($($module:ident::$model:ident),* $(,)?) => {
        /// All models, in the order in which they are listed everywhere.
        pub(crate) static MODELS: &[&dyn Model] = &[$(&super::$module::$model),*];
    };
}

models! {
    constant_body::ConstantBody,
    constant_world::ConstantWorld,
    linear_drag::LinearDrag,
    matrix_drag::MatrixDrag,
    quadratic_drag::QuadraticDrag,
    sinusoidal::Sinusoidal,
    gravity_gradient::GravityGradient,
    heavy_top::HeavyTop,
    magnetic_dipole::MagneticDipole,
    orbiting_dipole::OrbitingDipole,
    eddy_current::EddyCurrent,
    orbiting_eddy_current::OrbitingEddyCurrent,
    flat_plates::FlatPlates,
    sine_spring::SineSpring,
    log_spring::LogSpring,
    internal_dissipation::InternalDissipation,
    pd_attitude::PdAttitude,
    pd_direction::PdDirection,
    reaction_wheels::ReactionWheels,
    magnetorquers::Magnetorquers,
    white_noise::WhiteNoise,
    variable_inertia::VariableInertia,
}

/// The declarations of all models.
pub fn declarations() -> impl Iterator<Item = &'static Declaration> {
    MODELS.iter().map(|model| model.declaration())
}
