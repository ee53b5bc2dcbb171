//! Sessions on the host that stand by for those of a device: they are brought to where the device has come, and go on from there.

use glam::DVec3;

use super::adaptive_session::{AdaptiveSession, StepCounts};
use super::{FreeSession, Session, SteppedSession};
use crate::bodies::columns::StateWords;
use crate::error::Result;

/// Of any steps.
pub(super) trait Standby: Session {
    /// Whether it is given the states that the device comes to.
    fn has_states(&self) -> bool {
        true
    }

    /// Comes to where the device was last.
    fn take_over(&mut self) -> Result<()> {
        Ok(())
    }
}

/// Of equal steps.
pub(super) trait SteppedStandby: Standby + SteppedSession {
    /// Takes over what a device has come to in `steps` steps of `dt` seconds from where this session stands: the states of all bodies, and
    /// position (m) and velocity (m/s), world axes, of those centres of mass that move along.
    fn follow(&mut self, states: &StateWords, centres: &[(DVec3, DVec3)], steps: (f64, u64));
}

/// Of adaptive steps.
pub(super) trait AdaptiveStandby: Standby + AdaptiveSession {
    /// Takes over what a device has come to at `time`, s: the states of all bodies and how many steps they took. The sizes of the steps that
    /// follow are chosen anew.
    fn follow(&mut self, states: &StateWords, counts: &[StepCounts], time: f64);
}

/// Of closed forms, whose states follow from the time alone.
pub(super) trait FreeStandby: Standby + FreeSession {
    /// Notes that a device has come to `time`, s.
    fn follow(&mut self, time: f64);
}
