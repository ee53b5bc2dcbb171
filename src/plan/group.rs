//! Bodies that are treated alike.

use super::class::{Bound, Class};
use super::times::{Interval, steps_over};
use crate::bodies::Members;
use crate::bodies::columns::state_columns;
use crate::kernel::free_motion::SetUp;
use crate::kernel::method::Method;
use crate::kernel::observe::error_bound;
use crate::math::Precision;
use crate::scene::AdaptiveSteps;
use crate::torque::control::{Schedule, steps_between};

/// How the motion of a group's bodies is found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Treatment {
    /// As two uniform rotations, in `f64` on the host, at the output times alone (`kernel/free_motion/precession.rs`).
    RegularPrecession,
    /// By elliptic functions, at the output times alone ([`crate::kernel::free_motion`]); on the host where the engine lacks
    /// the arithmetic.
    ClosedForm {
        /// The arithmetic.
        precision: Precision,
        /// The arithmetic of its constants.
        set_up: SetUp,
    },
    /// In steps, on the engine.
    Stepped {
        /// The integrator.
        method: Method,
        /// The arithmetic.
        precision: Precision,
        /// The longest step, s; steps are shortened so that output times are hit exactly.
        longest_step: f64,
        /// Whether states are projected after each step onto what torque-free bodies conserve.
        projected: bool,
    },
    /// In adaptive steps, which each body chooses by an estimate of their errors, on the engine.
    Adaptive {
        /// The integrator, one of [`Method::ADAPTIVE`].
        method: Method,
        /// The arithmetic.
        precision: Precision,
        /// Tolerance and least step.
        steps: AdaptiveSteps,
    },
}

impl Treatment {
    /// The integrator of a body that is stepped.
    pub(crate) fn method(&self) -> Option<Method> {
        match *self {
            Treatment::Stepped { method, .. } | Treatment::Adaptive { method, .. } => Some(method),
            Treatment::RegularPrecession | Treatment::ClosedForm { .. } => None,
        }
    }

    /// The arithmetic of a body that is stepped.
    pub(crate) fn precision_of_steps(&self) -> Option<Precision> {
        match *self {
            Treatment::Stepped { precision, .. } | Treatment::Adaptive { precision, .. } => Some(precision),
            Treatment::RegularPrecession | Treatment::ClosedForm { .. } => None,
        }
    }

    /// Bytes of a body's state as an engine holds it; 0 for treatments on the host.
    pub(crate) fn state_bytes(&self) -> u64 {
        let bytes = match self.precision() {
            Precision::F32 => state_columns::<f32>() * size_of::<f32>(),
            Precision::F64 => state_columns::<f64>() * size_of::<f64>(),
        };
        if *self == Treatment::RegularPrecession { 0 } else { bytes as u64 }
    }

    /// The relative error of statistics that are formed where the states are.
    pub(crate) fn statistics_bound(&self) -> f64 {
        error_bound(self.precision())
    }

    pub(crate) fn precision(&self) -> Precision {
        match *self {
            Treatment::ClosedForm { precision, .. }
            | Treatment::Stepped { precision, .. }
            | Treatment::Adaptive { precision, .. } => precision,
            Treatment::RegularPrecession => Precision::F64,
        }
    }

    /// The number of equal steps from one time to another, where each change of what a sampled torque holds ends a step; 0 for a group
    /// without equal steps.
    pub(crate) fn steps_between(&self, schedule: Option<&Schedule>, between: (f64, f64)) -> u64 {
        match *self {
            Treatment::RegularPrecession | Treatment::ClosedForm { .. } | Treatment::Adaptive { .. } => 0,
            Treatment::Stepped { longest_step, .. } => steps_between(schedule, between, longest_step),
        }
    }

    /// The equal steps that span `span` seconds; none for a group without equal steps.
    pub fn interval(&self, span: f64) -> Interval {
        match *self {
            Treatment::RegularPrecession | Treatment::ClosedForm { .. } | Treatment::Adaptive { .. } => {
                Interval { steps: 0, dt: span }
            }
            Treatment::Stepped { longest_step, .. } => steps_over(span, longest_step),
        }
    }
}

/// Bodies of one class that are treated alike. Steps form levels a factor of 2^(1/4) apart, one group each, so that each body takes the
/// steps that it needs, independent of its neighbours.
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// The class.
    pub class: Class,
    /// How their motion is found.
    pub treatment: Treatment,
    /// The bodies.
    pub members: Members,
    /// The greatest bound on the error that the class causes any of them.
    pub bound: Bound,
    /// The greatest rate, rad/s, that the steps of any of them must follow; 0 where no torque acts.
    pub rate: f64,
    /// Whether steps go beyond outputs, at which their series are evaluated ([`crate::engine::Backend::start_dense_taylor`]).
    pub is_dense: bool,
    /// Attempts at adaptive steps after which the CPU engine gives a body up ([`crate::bodies::Status::StepBelowLimit`]): a thousand times what the
    /// bodies of the pilot took, and at least 100,000, and 100 for each radian that the fastest of them turns. A body that dry friction has brought to rest takes steps without end.
    pub most_attempts: u64,
}

/// Number of step levels in a factor of two.
pub(super) const LEVELS_PER_OCTAVE: i32 = 4;

/// 2^(0/4) … 2^(3/4).
const FRACTIONS: [f64; LEVELS_PER_OCTAVE as usize] =
    [1.0, 1.189_207_115_002_721, std::f64::consts::SQRT_2, 1.681_792_830_507_429];

/// The level of the longest step that is no longer than `dt` s (finite, above zero).
pub(crate) fn level_of(dt: f64) -> i32 {
    let exponent = crate::math::power_of_two::binary_exponent(dt);
    let mantissa = crate::math::power_of_two::scaled_by_power_of_two(dt, -exponent);
    let fraction = FRACTIONS.iter().rposition(|&fraction| fraction <= mantissa).unwrap_or(0);
    exponent * LEVELS_PER_OCTAVE + fraction as i32
}

/// The step of a level, s.
pub(crate) fn step_of(level: i32) -> f64 {
    let (exponent, fraction) = (level.div_euclid(LEVELS_PER_OCTAVE), level.rem_euclid(LEVELS_PER_OCTAVE));
    crate::math::power_of_two::scaled_by_power_of_two(FRACTIONS[fraction as usize], exponent)
}
