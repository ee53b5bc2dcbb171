//! Sessions on the host that stand by for those of a device: they follow its progress, and continue from there.

use glam::DVec3;

use super::{End, Session, StepCounts};
use crate::bodies::columns::StateWords;
use crate::error::Result;

/// A session that stands by for one of a device.
pub(super) trait Standby: Session {
    /// Whether it receives the states that the device reaches; if not, they follow from the time alone.
    fn has_states(&self) -> bool {
        true
    }

    /// Takes over what the device has reached at `end`. The sizes of the following adaptive steps are chosen anew.
    fn follow(&mut self, reached: &Reached, end: End);

    /// Brings the states to the last time of the device.
    fn take_over(&mut self) -> Result<()> {
        Ok(())
    }
}

/// The results of a device after an advance; empty for a session that does not receive them.
#[derive(Default)]
pub(super) struct Reached {
    /// The states of all bodies.
    pub states: StateWords,
    /// Position (m) and velocity (m/s), world axes, of the centres of mass that the device moves.
    pub centres: Vec<(DVec3, DVec3)>,
    /// The adaptive steps of all bodies.
    pub counts: Vec<StepCounts>,
}
