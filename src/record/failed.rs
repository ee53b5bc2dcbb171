//! Bodies that have failed.

use glam::{DQuat, DVec3};

use crate::method::Status;

/// A body that has failed, with what is known of it.
///
/// States are looked at where outputs are read, so that both times are those of outputs: the body failed between them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FailedBody {
    /// Its index in the scene.
    pub body: usize,
    /// Why.
    pub reason: Status,
    /// The time of the first output at which it had failed, s.
    pub time: f64,
    /// The time of its last good state that is known, s: of the last output read before, or 0, the start.
    pub last_good_time: f64,
    /// Unit quaternion that rotated body coordinates to world then.
    pub orientation: DQuat,
    /// Angular velocity in body axes then, rad/s.
    pub angular_velocity_body: DVec3,
}
