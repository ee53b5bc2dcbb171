//! Kinds of torques, as columns and kernels distinguish them.

use super::formula::{Formula, FormulaTask, Role};
use crate::math::clock::RATE_DIGITS;

/// Registers kernels: one line for each, in the order in which the sum is formed on every engine.
macro_rules! kinds {
    ($($module:ident::$kind:ident),* $(,)?) => {
        /// Determines the columns of a model and the kernel that reads them.
        ///
        /// The order is that in which the sum is formed.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(usize)]
        pub enum Kind {
            $(#[doc = concat!("[`super::", stringify!($module), "`].")] $kind,)*
        }

        impl Kind {
            /// All kinds, in order.
            pub const ALL: &'static [Kind] = &[$(Kind::$kind),*];

            /// The stem of its names in shaders.
            pub const fn stem(self) -> &'static str {
                match self { $(Kind::$kind => super::$module::$kind::STEM,)* }
            }

            /// The source file of its formula; below `shaders/`, the name of the text that is recorded from it.
            pub(crate) const fn source_file(self) -> &'static str {
                match self { $(Kind::$kind => concat!("src/torque/", stringify!($module), ".rs"),)* }
            }

            /// The name of its shader text.
            pub(crate) const fn file(self) -> &'static str {
                match self { $(Kind::$kind => concat!("torque/", stringify!($module), ".wgsl"),)* }
            }

            /// Parameter columns of one instance, without those of its phases.
            pub const fn parameters(self) -> usize {
                match self { $(Kind::$kind => super::$module::$kind::PARAMETERS,)* }
            }

            /// Phases of one instance; each has [`RATE_DIGITS`] columns and one for the rounded rate. That of a ramp is its progress:
            /// the digits are those of its start in ticks, and the rate is in ramps per second.
            pub const fn phases(self) -> usize {
                match self { $(Kind::$kind => super::$module::$kind::PHASES.len(),)* }
            }

            /// Whether several instances merge into one with the sum of their parameters.
            pub const fn merges(self) -> bool {
                match self { $(Kind::$kind => super::$module::$kind::MERGES,)* }
            }

            /// Whether its time-dependent part reads a column.
            pub(crate) fn epoch_reads(self, column: usize) -> bool {
                match self { $(Kind::$kind => super::$module::$kind::epoch_reads(column),)* }
            }

            /// What it affects.
            pub(crate) const fn role(self) -> Role {
                match self { $(Kind::$kind => super::$module::$kind::ROLE,)* }
            }

            /// Runs a task with the formula of the kind.
            #[inline(always)]
            pub(crate) fn with<W: FormulaTask>(self, task: W) -> W::Output {
                match self { $(Kind::$kind => task.run::<super::$module::$kind>(),)* }
            }
        }
    };
}

kinds! {
    constant_body::ConstantBody,
    linear_drag::LinearDrag,
    constant_world::ConstantWorld,
    matrix_drag::MatrixDrag,
    quadratic_drag::QuadraticDrag,
    sinusoidal::Sinusoidal,
    gravity_gradient::GravityGradient,
    gravity_gradient_kepler::GravityGradientKepler,
    gravity_gradient_drifting::GravityGradientDrifting,
    heavy_top::HeavyTop,
    magnetic_dipole::MagneticDipole,
    orbiting_dipole::OrbitingDipole,
    orbiting_dipole_drifting::OrbitingDipoleDrifting,
    eddy_current::EddyCurrent,
    orbiting_eddy_current::OrbitingEddyCurrent,
    orbiting_eddy_current_drifting::OrbitingEddyCurrentDrifting,
    sine_spring::SineSpring,
    log_spring::LogSpring,
    custom::Custom,
    white_noise::WhiteNoise,
    internal_dissipation::InternalDissipation,
    // A scene has at most one of the next three.
    variable_inertia::InertiaRamp,
    variable_inertia::InertiaOscillation,
    custom_inertia::InertiaFormula,
    // Not a torque of a scene; it comes last, as it changes the sum of all others.
    linear_rotor::LinearRotor,
}

impl Kind {
    /// The number of columns of one instance, if it is the same for all instances.
    pub const fn columns(self) -> usize {
        self.parameters() + self.phases() * (RATE_DIGITS + 1)
    }

    /// The kinds under which moments of inertia change in time.
    pub(crate) const CHANGES: [Kind; 3] = [Kind::InertiaRamp, Kind::InertiaOscillation, Kind::InertiaFormula];
}
