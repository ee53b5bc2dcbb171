//! What adaptive steps took.

/// Steps of the bodies that were advanced in adaptive steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdaptiveWork {
    /// Steps taken.
    pub accepted: Spread,
    /// Steps tried again with a smaller size.
    pub rejected: Spread,
    /// Bodies that would have needed a step below the limit; they have failed ([`super::Trust::failures`]).
    pub flagged: usize,
    /// Bodies that were advanced side by side: lanes, or a workgroup.
    pub side_by_side: usize,
    /// Attempts including those that bodies waited for others beside them, as a multiple of the attempts alone: 1 where all
    /// finish together, [`AdaptiveWork::side_by_side`] where one works and the others wait.
    pub imbalance: f64,
}

/// How a count is spread over bodies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "study", derive(serde::Serialize, serde::Deserialize))]
pub struct Spread {
    /// Of all bodies together.
    pub total: u64,
    /// The least of a body.
    pub min: u64,
    /// Half of the bodies are at or below.
    pub median: u64,
    /// The most of a body.
    pub max: u64,
}

impl Spread {
    /// The spread of one count a body; zeros without bodies.
    pub(crate) fn of(mut counts: Vec<u64>) -> Self {
        counts.sort_unstable();
        let at = |index: usize| counts.get(index).copied().unwrap_or(0);
        Self {
            total: counts.iter().sum(),
            min: at(0),
            median: at(counts.len().saturating_sub(1) / 2),
            max: at(counts.len().saturating_sub(1)),
        }
    }
}

impl std::fmt::Display for Spread {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(formatter, "{} (min {}, median {}, max {} a body)", self.total, self.min, self.median, self.max)
    }
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
