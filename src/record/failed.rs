//! Bodies that have failed.

use glam::{DQuat, DVec3};

use crate::bodies::Status;

/// How precisely the time of a failure is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum KnownTo {
    /// To the outputs at which states were read: the body failed after the last good state, at or before the given time.
    Output,
    /// To the step. For equal steps, the time is the end of the first that failed, and the last good state is that at its start; for
    /// adaptive ones both are where the body stopped, as no allowed step led on from there. This is what the CPU finds when it repeats the
    /// steps; a run on a GPU may have failed a step earlier or later.
    Step,
}

impl KnownTo {
    /// The word in results.
    pub const fn name(self) -> &'static str {
        match self {
            KnownTo::Output => "output",
            KnownTo::Step => "step",
        }
    }
}

/// A body that has failed, with what is known of it.
///
/// States are checked where outputs are read. The steps of the first thousand bodies that are found to have failed are then
/// repeated, as far as their number allows.
#[derive(Clone, Debug, PartialEq)]
pub struct FailedBody {
    /// Its index in the scene.
    pub body: usize,
    /// The reason.
    pub reason: Status,
    /// The time of the failure, s, to the precision that `known_to` says.
    pub time: f64,
    /// How precisely the time is known.
    pub known_to: KnownTo,
    /// The time of its last known good state, s; 0 is the start.
    pub last_good_time: f64,
    /// Unit quaternion that rotated body coordinates to world at that time.
    pub orientation: DQuat,
    /// Angular velocity in body axes at that time, rad/s.
    pub angular_velocity_body: DVec3,
    /// The custom torque, or change of moments, that gave no finite number, the operation that did so, and what the formula
    /// read there, if that was found.
    pub cause: Option<String>,
}
