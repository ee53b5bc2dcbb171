//! The work of bodies in adaptive steps.

use crate::engine::StepCounts;
use crate::math::Spread;
use crate::record::AdaptiveWork;

/// Steps of the bodies of one group.
pub(super) struct GroupWork {
    /// In the order in which bodies are advanced side by side.
    pub counts: Vec<StepCounts>,
    pub side_by_side: usize,
    pub imbalance: f64,
}

/// The work of all groups together; `None` without any.
pub(super) fn total_work(group_runs: &[GroupWork], flagged: usize) -> Option<AdaptiveWork> {
    let side_by_side = group_runs.iter().map(|group_run| group_run.side_by_side).max()?;
    let (mut own, mut with_waiting) = (0.0, 0.0);
    for group_run in group_runs {
        let attempts = group_run.counts.iter().map(StepCounts::attempts).sum::<u64>() as f64;
        own += attempts;
        with_waiting += attempts * group_run.imbalance;
    }
    let spread =
        |of: fn(&StepCounts) -> u64| Spread::of(group_runs.iter().flat_map(|run| run.counts.iter().map(of)).collect());
    Some(AdaptiveWork {
        accepted: spread(|counts| counts.accepted),
        rejected: spread(|counts| counts.rejected),
        flagged,
        side_by_side,
        imbalance: if own > 0.0 { with_waiting / own } else { 1.0 },
    })
}
