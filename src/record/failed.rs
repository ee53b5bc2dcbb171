//! Bodies that have failed.

use glam::{DQuat, DVec3};

use crate::bodies::Status;

/// How sharply it is known when a body failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum KnownTo {
    /// To the outputs at which states were read: it failed after the last good state and up to the time that is given.
    Output,
    /// To the step. Of equal steps, the time is the end of the first that failed, and the last good state that at its start; of adaptive
    /// ones both are where the body stopped, as no step that the limit allows led on from there. What the CPU finds where it
    /// takes the steps again; a run on a GPU may have failed a step earlier or later.
    Step,
}

impl KnownTo {
    /// Both.
    pub const ALL: [KnownTo; 2] = [KnownTo::Output, KnownTo::Step];

    /// The word that stands for it in results.
    pub const fn name(self) -> &'static str {
        match self {
            KnownTo::Output => "output",
            KnownTo::Step => "step",
        }
    }
}

/// A body that has failed, with what is known of it.
///
/// States are looked at where outputs are read, and the steps of the first thousand of those that are found to have failed are then taken
/// again, as far as their number allows.
#[derive(Clone, Debug, PartialEq)]
pub struct FailedBody {
    /// Its index in the scene.
    pub body: usize,
    /// Why.
    pub reason: Status,
    /// When it failed, s, to the precision that `known_to` says.
    pub time: f64,
    /// How sharply that is known.
    pub known_to: KnownTo,
    /// The time of its last good state that is known, s; 0 is the start.
    pub last_good_time: f64,
    /// Unit quaternion that rotated body coordinates to world then.
    pub orientation: DQuat,
    /// Angular velocity in body axes then, rad/s.
    pub angular_velocity_body: DVec3,
    /// The torque, or the change of moments, of the user's own that gave no finite number, the operation that did, and what the formula
    /// reads there, where that was found.
    pub cause: Option<String>,
}
