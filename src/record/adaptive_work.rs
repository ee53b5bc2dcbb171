//! The work of adaptive steps.

use crate::math::Spread;

/// Steps of the bodies that were advanced in adaptive steps.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "study", derive(serde::Serialize))]
pub struct AdaptiveWork {
    /// Accepted steps.
    pub accepted: Spread,
    /// Rejected steps, which were tried again with a smaller size.
    pub rejected: Spread,
    /// Bodies that would have needed a step below the limit; they have failed ([`super::Trust::failures`]).
    pub flagged: usize,
    /// Number of bodies advanced side by side: lanes, or a workgroup.
    pub side_by_side: usize,
    /// Attempts including those during which bodies waited for their neighbours, as a multiple of the attempts alone: 1 if all
    /// finish together, [`AdaptiveWork::side_by_side`] if one works and the others wait.
    pub imbalance: f64,
}

impl std::fmt::Display for AdaptiveWork {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            formatter,
            "{} accepted, {} rejected, {} flagged, imbalance {:.3} over {} side by side",
            self.accepted, self.rejected, self.flagged, self.imbalance, self.side_by_side
        )
    }
}
