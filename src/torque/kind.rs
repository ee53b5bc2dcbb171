//! Kinds of torques as columns and kernels tell them apart.

use crate::clock::RATE_DIGITS;

/// What columns a model has and which kernel function reads them.
///
/// The order is that in which the sum is formed, in Rust and in WGSL.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(usize)]
pub enum Kind {
    /// [`super::constant_body`].
    ConstantBody,
    /// [`super::linear_drag`].
    LinearDrag,
    /// [`super::constant_world`].
    ConstantWorld,
    /// [`super::matrix_drag`].
    MatrixDrag,
    /// [`super::quadratic_drag`].
    QuadraticDrag,
    /// [`super::sinusoidal`].
    Sinusoidal,
    /// [`super::gravity_gradient`].
    GravityGradient,
    /// [`super::gravity_gradient_kepler`].
    GravityGradientKepler,
    /// [`super::heavy_top`].
    HeavyTop,
    /// [`super::magnetic_dipole`].
    MagneticDipole,
    /// [`super::orbiting_dipole`].
    OrbitingDipole,
    /// [`super::eddy_current`].
    EddyCurrent,
    /// [`super::sine_spring`].
    SineSpring,
    /// [`super::log_spring`].
    LogSpring,
    /// [`super::white_noise`].
    WhiteNoise,
    /// [`super::internal_dissipation`].
    InternalDissipation,
    /// A ramp of [`super::variable_inertia`]; of this and the next a scene has one at most.
    InertiaRamp,
    /// An oscillation of [`super::variable_inertia`].
    InertiaOscillation,
    /// [`super::linear_rotor`], which no [`super::Torque`] is: last, as it changes the sum of all others.
    LinearRotor,
}

impl Kind {
    /// All kinds, in order.
    pub const ALL: [Kind; 19] = [
        Kind::ConstantBody,
        Kind::LinearDrag,
        Kind::ConstantWorld,
        Kind::MatrixDrag,
        Kind::QuadraticDrag,
        Kind::Sinusoidal,
        Kind::GravityGradient,
        Kind::GravityGradientKepler,
        Kind::HeavyTop,
        Kind::MagneticDipole,
        Kind::OrbitingDipole,
        Kind::EddyCurrent,
        Kind::SineSpring,
        Kind::LogSpring,
        Kind::WhiteNoise,
        Kind::InternalDissipation,
        Kind::InertiaRamp,
        Kind::InertiaOscillation,
        Kind::LinearRotor,
    ];

    /// The stem of the `override` constants in `shaders/torque/sum.wgsl`, and of its files where they hold one kind.
    pub const fn stem(self) -> &'static str {
        match self {
            Kind::ConstantBody => "constant_body",
            Kind::LinearDrag => "linear_drag",
            Kind::ConstantWorld => "constant_world",
            Kind::MatrixDrag => "matrix_drag",
            Kind::QuadraticDrag => "quadratic_drag",
            Kind::Sinusoidal => "sinusoidal",
            Kind::GravityGradient => "gravity_gradient",
            Kind::GravityGradientKepler => "gravity_gradient_kepler",
            Kind::HeavyTop => "heavy_top",
            Kind::MagneticDipole => "magnetic_dipole",
            Kind::OrbitingDipole => "orbiting_dipole",
            Kind::EddyCurrent => "eddy_current",
            Kind::SineSpring => "sine_spring",
            Kind::LogSpring => "log_spring",
            Kind::WhiteNoise => "white_noise",
            Kind::InternalDissipation => "internal_dissipation",
            Kind::InertiaRamp => "inertia_ramp",
            Kind::InertiaOscillation => "inertia_oscillation",
            Kind::LinearRotor => "linear_rotor",
        }
    }

    /// Columns of one instance, without its phases.
    pub const fn parameters(self) -> usize {
        match self {
            Kind::LinearDrag | Kind::QuadraticDrag | Kind::InternalDissipation | Kind::LinearRotor => 1,
            Kind::ConstantBody | Kind::ConstantWorld => 3,
            Kind::EddyCurrent => 4,
            Kind::SineSpring | Kind::LogSpring => 5,
            Kind::MatrixDrag | Kind::Sinusoidal | Kind::HeavyTop | Kind::MagneticDipole => 6,
            Kind::GravityGradient | Kind::WhiteNoise => 10,
            Kind::GravityGradientKepler | Kind::InertiaOscillation => 12,
            Kind::InertiaRamp => 13,
            Kind::OrbitingDipole => 14,
        }
    }

    /// Phases of one instance; each has [`RATE_DIGITS`] columns and one for the rounded rate. That of a ramp is its progress:
    /// the digits are those of its start in ticks, and the rate is in ramps per second.
    pub const fn phases(self) -> usize {
        match self {
            Kind::Sinusoidal
            | Kind::GravityGradient
            | Kind::GravityGradientKepler
            | Kind::InertiaRamp
            | Kind::InertiaOscillation => 1,
            Kind::OrbitingDipole => 2,
            _ => 0,
        }
    }

    /// All columns of one instance.
    pub const fn columns(self) -> usize {
        self.parameters() + self.phases() * (RATE_DIGITS + 1)
    }

    /// Whether several instances are one with the sum of their parameters.
    pub const fn merges(self) -> bool {
        matches!(
            self,
            Kind::ConstantBody
                | Kind::LinearDrag
                | Kind::ConstantWorld
                | Kind::MatrixDrag
                | Kind::QuadraticDrag
                | Kind::InternalDissipation
        )
    }
}
