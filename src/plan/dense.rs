//! Which plans have steps by Taylor series that go beyond outputs: those of bodies that turn little from one output to the next.

use super::choice::classify;
use super::class::Bound;
use super::driven::ActingTorques;
use super::recomputation::follows_by_series;
use super::sampling::sample;
use super::times::Times;
use super::{Group, Plan, Treatment};
use crate::engine::cpu::kept_bytes;
use crate::kernel::method::Method;
use crate::kernel::method::rk8_adaptive::least_tolerance;
use crate::math::Precision;
use crate::scene::{Scene, Stepping};
use crate::torque::Torque;

/// The fewest times at which it is worth while.
const FEWEST: usize = 8;
/// The greatest angle, rad, by which bodies turn between two of them on average: about half of what a step by series takes.
const GREATEST_ANGLE: f64 = 1.0;
/// The most memory that the series of all bodies may take, bytes.
const MOST_BYTES: f64 = (256 << 20) as f64;
/// The bodies that are looked at, and the seed that selects them.
const SAMPLE: usize = 64;
const SEED: u64 = 3;

/// Whether steps by series in a plan for a whole scene go beyond its outputs. This is decided before a pilot calibrates tolerances, which it
/// does in steps that end where those of the run do; and once for all parts of a plan, so that each body takes the same steps in each.
pub(super) fn suits(scene: &Scene, times: &Times) -> bool {
    let tolerance = match scene.stepping() {
        Stepping::Adaptive { method: Method::Taylor, steps, .. } => steps.tolerance,
        Stepping::Accuracy(_) | Stepping::Statistics(_) => least_tolerance(Precision::F64),
        Stepping::Adaptive { .. } | Stepping::Pinned { .. } => return false,
    };
    if !may_be_dense(times, scene.torques()) {
        return false;
    }
    let count = scene.ensemble().len();
    let bodies = sample(count, SAMPLE.min(count), SEED);
    // Bodies on which no torque acts are not stepped or, where all are, their rate is not known here.
    let acting = ActingTorques::of(scene.torques());
    let rate = |&body: &u32| classify((scene, &acting), body as usize, &Bound::default()).rate;
    let rates: Vec<f64> = bodies.iter().map(rate).filter(|rate| *rate > 0.0).collect();
    let (outputs, stepped) = (times.all().len() as f64, rates.len() as f64);
    let bytes = count as f64 * stepped / bodies.len() as f64 * kept_bytes(tolerance) as f64;
    let angle = rates.iter().sum::<f64>() / stepped * scene.end();
    !rates.is_empty() && angle <= GREATEST_ANGLE * outputs && bytes <= MOST_BYTES
}

/// Whether steps by series under these torques may go beyond these times, of which there are enough.
fn may_be_dense(times: &Times, torques: &[Torque]) -> bool {
    times.all().len() >= FEWEST && times.breaks().is_empty() && follows_by_series(torques)
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
        may_be_dense(&self.times, torques)
    }

    /// The times at which steps by a method end: all advance times or, where steps by series go beyond them, the end.
    pub(crate) fn ends_of_steps(&self, method: Method) -> &[f64] {
        let times = self.advance_times();
        let is_dense = self.times.is_dense() && method == Method::Taylor;
        if is_dense { &times[times.len().saturating_sub(1)..] } else { times }
    }
}
