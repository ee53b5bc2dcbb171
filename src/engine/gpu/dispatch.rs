//! How many steps one submission takes: found by measuring, so that none runs long.

use std::time::Duration;

/// Bounds of one submission.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SliceLimits {
    /// What one submission should take. Drivers reset a device that computes for too long (2 s on some systems), and
    /// progress is reported between submissions.
    pub duration: Duration,
    /// The most steps that one dispatch takes.
    pub steps: u32,
}

impl Default for SliceLimits {
    /// Half of the 100 ms that a dispatch may take, since measured times scatter; as many steps as fit.
    fn default() -> Self {
        Self { duration: Duration::from_millis(50), steps: u32::MAX }
    }
}

/// The most by which a slice may outgrow the longest one measured.
const GROWTH: u64 = 16;

#[derive(Clone, Copy, Debug)]
struct Measured {
    bodies: usize,
    steps: u32,
    seconds_per_step: f64,
}

/// Chooses the number of steps of the next submission from those before it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slicer {
    limits: SliceLimits,
    measured: Option<Measured>,
}

impl Slicer {
    pub fn new(limits: SliceLimits) -> Self {
        Self { limits, measured: None }
    }

    /// Steps of the next submission of `bodies`, at most `left`.
    ///
    /// The first is a single step, which the size of a group keeps short. Time for a step does not fall with fewer
    /// bodies (a GPU that is not full waits as long), and grows at most in proportion with more.
    pub fn steps(&self, bodies: usize, left: u64) -> u32 {
        let steps = match self.measured {
            None => 1,
            Some(measured) => {
                let more = (bodies as f64 / measured.bodies as f64).max(1.0);
                let fitting = self.limits.duration.as_secs_f64() / (measured.seconds_per_step * more);
                // The cast saturates; an immeasurably short step leaves only the bound on growth.
                (fitting as u64).clamp(1, u64::from(measured.steps) * GROWTH)
            }
        };
        steps.min(u64::from(self.limits.steps.max(1))).min(left).min(u64::from(u32::MAX)) as u32
    }

    /// Learns from a submission.
    ///
    /// Measured times contain the cost of submitting, so steps are never taken for cheaper than they are. A much
    /// shorter slice than the last, the rest of an interval, says little but that cost and is not learnt from.
    pub fn record(&mut self, bodies: usize, steps: u32, elapsed: Duration) {
        let informative = match self.measured {
            None => true,
            Some(measured) => bodies > measured.bodies || steps >= measured.steps / 2 || elapsed > self.limits.duration,
        };
        if informative {
            let seconds_per_step = elapsed.as_secs_f64() / f64::from(steps);
            self.measured = Some(Measured { bodies, steps, seconds_per_step });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A device that takes `overhead` a submission and `step` a step of up to 4,096 bodies.
    fn longest_slice(overhead: f64, step: f64, sizes: &[usize], steps: u64) -> (f64, u32) {
        let mut slicer = Slicer::new(SliceLimits::default());
        let (mut longest, mut submissions) = (0.0_f64, 0);
        for &bodies in sizes {
            let mut left = steps;
            while left > 0 {
                let n = slicer.steps(bodies, left);
                let seconds = overhead + step * f64::from(n) * (bodies as f64 / 4096.0).max(1.0);
                slicer.record(bodies, n, Duration::from_secs_f64(seconds));
                longest = longest.max(seconds);
                submissions += 1;
                left -= u64::from(n);
            }
        }
        (longest, submissions)
    }

    #[test]
    fn no_slice_runs_longer_than_its_limit() {
        let limit = SliceLimits::default().duration.as_secs_f64();
        for step in [1e-7, 1e-5, 1e-3, 0.04] {
            for sizes in [vec![1 << 20, 1 << 20, 64], vec![64, 1 << 20], vec![4096; 3], vec![63]] {
                let step = step * 4096.0 / 2f64.powi(20);
                let (longest, _) = longest_slice(1e-4, step, &sizes, 100_000);
                assert!(longest <= limit + 1e-4, "step {step} s, groups {sizes:?}: {longest} s");
            }
        }
    }

    #[test]
    fn calibration_takes_few_submissions() {
        // 1, 16, 256 and 4,096 steps, then slices of about 5,000: 1e6 steps of 10 us need 200.
        let (_, submissions) = longest_slice(1e-4, 1e-5, &[4096], 1_000_000);
        assert!(submissions <= 206, "{submissions} submissions");
    }

    #[test]
    fn a_short_rest_does_not_spoil_the_calibration() {
        let mut slicer = Slicer::new(SliceLimits::default());
        slicer.record(64, 1000, Duration::from_millis(10));
        slicer.record(64, 1, Duration::from_micros(150));
        assert_eq!(slicer.steps(64, 3000), 3000);
    }
}
