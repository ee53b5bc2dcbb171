//! Sessions on the host that stand by for those of a device: they follow its progress, and continue from there.

use glam::DVec3;

use super::adaptive_session::{AdaptiveSession, StepCounts};
use super::{FreeSession, Session, SteppedSession};
use crate::bodies::columns::StateWords;
use crate::error::Result;

/// A standby session of any kind.
pub(super) trait Standby: Session {
    /// Whether it receives the states that the device reaches.
    fn has_states(&self) -> bool {
        true
    }

    /// Brings the states to the last time of the device.
    fn take_over(&mut self) -> Result<()> {
        Ok(())
    }
}

/// A standby session of equal steps.
pub(super) trait SteppedStandby: Standby + SteppedSession {
    /// Takes over the results of a device after `steps` steps of `dt` seconds from this session's time: the states of
    /// all bodies, and position (m) and velocity (m/s), world axes, of the centres of mass that it moves.
    fn follow(&mut self, states: &StateWords, centres: &[(DVec3, DVec3)], steps: (f64, u64));
}

/// A standby session of adaptive steps.
pub(super) trait AdaptiveStandby: Standby + AdaptiveSession {
    /// Takes over the results of a device at `time`, s: the states of all bodies and their numbers of steps. The
    /// following step sizes are chosen anew.
    fn follow(&mut self, states: &StateWords, counts: &[StepCounts], time: f64);
}

/// A standby session of closed forms, whose states follow from the time alone.
pub(super) trait FreeStandby: Standby + FreeSession {
    /// Notes that the device has reached `time`, s.
    fn follow(&mut self, time: f64);
}
