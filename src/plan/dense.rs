//! Which plans have steps that go beyond outputs: those whose outputs are closer together than steps by series.

use super::recomputation::follows_by_series;
use super::sampled::MOST_TIMES;
use super::times::Times;
use super::{Group, Plan, Treatment};
use crate::engine::cpu::kept_bytes;
use crate::kernel::method::Method;
use crate::scene::Stepping;
use crate::torque::Torque;

/// The fewest times at which it is worth while.
const FEWEST: usize = 8;
/// The greatest angle, rad, by which a body turns between two of them: about half of what a step by series takes.
const GREATEST_ANGLE: f64 = 1.0;
/// The most memory that the series of all bodies may take, bytes.
const MOST_BYTES: usize = 256 << 20;

/// Whether the steps of a plan for a whole scene may go beyond its outputs, and do so with a gain. All parts of a plan share the answer, so that
/// each body takes the same steps in each.
pub(super) fn suits(plan: &Plan<'_>) -> bool {
    let (scene, count) = (plan.scene(), plan.times.all().len());
    // Where a pilot's steps end at outputs, it has found a tolerance for steps that do.
    let suits_pilot = match scene.stepping() {
        Stepping::Adaptive { .. } => true,
        Stepping::Accuracy(_) => count > MOST_TIMES,
        Stepping::Statistics(_) | Stepping::Pinned { .. } => false,
    };
    if !suits_pilot || !plan.may_be_dense(scene.torques()) {
        return false;
    }
    let mut bytes = 0_usize;
    for group in &plan.groups {
        let Treatment::Adaptive { method: Method::Taylor, steps, .. } = group.treatment else { continue };
        // Of bodies on which no torque acts the rate is not known here.
        if !(group.rate > 0.0 && group.rate * scene.end() <= GREATEST_ANGLE * count as f64) {
            return false;
        }
        bytes = bytes.saturating_add(group.members.len().saturating_mul(kept_bytes(steps.tolerance)));
    }
    0 < bytes && bytes <= MOST_BYTES
}

/// Marks the groups whose steps go beyond outputs.
pub(super) fn mark(groups: &mut [Group], times: &Times) {
    for group in groups {
        let by_series = matches!(group.treatment, Treatment::Adaptive { method: Method::Taylor, .. });
        group.is_dense = times.is_dense() && by_series;
    }
}

impl Plan<'_> {
    /// Whether steps by series under these torques may go beyond outputs, of which there are enough.
    pub(crate) fn may_be_dense(&self, torques: &[Torque]) -> bool {
        self.times.all().len() >= FEWEST && self.times.breaks().is_empty() && follows_by_series(torques)
    }

    /// The times at which steps by a method end: all advance times or, where steps by series go beyond them, the end.
    pub(crate) fn ends_of_steps(&self, method: Method) -> &[f64] {
        let times = self.advance_times();
        let is_dense = self.times.is_dense() && method == Method::Taylor;
        if is_dense { &times[times.len().saturating_sub(1)..] } else { times }
    }
}
