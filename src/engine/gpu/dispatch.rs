//! Chooses the number of steps of one submission from measured times, so that none runs long.

use std::ops::Range;
use std::time::Duration;

use crate::bodies::columns::STRIDE_UNIT;

/// Bounds of one submission.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SliceLimits {
    /// The time that one submission should take. Drivers reset a device that computes for too long (2 s on some
    /// systems), and progress is reported between submissions.
    pub duration: Duration,
    /// The most steps that one dispatch takes.
    pub steps: u32,
    /// The time after which a submission without an answer counts as hung.
    pub longest_wait: Duration,
}

impl Default for SliceLimits {
    /// Half of the 100 ms that a dispatch may take, since measured times scatter; as many steps as fit; two minutes for
    /// an answer, as drivers reset a device within seconds, and a software adapter shares a busy machine.
    fn default() -> Self {
        Self { duration: Duration::from_millis(50), steps: u32::MAX, longest_wait: Duration::from_secs(120) }
    }
}

/// The largest factor by which a slice may exceed the longest one measured. The measured time includes that of submitting and waiting, some
/// 0.1 ms, so that few steps are never taken for faster than they are; this bounds what a coarse clock could do.
const GROWTH: u64 = 512;

/// The most bodies in one submission.
///
/// It bounds a single step, which slicing cannot make shorter: at 1e7 body-steps/s, far below any GPU, this many bodies
/// take 100 ms. One submission of them fills any GPU.
pub(super) const GROUP_BODIES: usize = 1 << 20;

/// Bodies of the first submission of adaptive steps, which measures the time of an attempt.
const FIRST_BODIES: usize = 1 << 16;

/// The total number of loop iterations of a shader after which a dispatch ends.
///
/// Mesa's llvmpipe, which lavapipe computes with, leaves a shader's loops after 65,535 iterations in all without an
/// error (`LP_MAX_TGSI_LOOP_ITERATIONS`, gallivm/lp_bld_limits.h): the remaining steps are lost. On a GPU the bound
/// costs nothing, as so many steps take long anyway.
const LOOP_ITERATIONS: u32 = 60_000;

/// Enough steps to make the cost of loading and storing a body small.
const ENOUGH_STEPS: u32 = 64;

#[derive(Clone, Copy, Debug)]
struct Measured {
    bodies: usize,
    steps: u32,
    seconds_per_step: f64,
}

/// Chooses the bodies and the number of steps of the next submission from those before it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slicer {
    limits: SliceLimits,
    group_bodies: usize,
    measured: Option<Measured>,
    /// The shortest time of one attempt of one body, s, over the submissions.
    attempt: Option<f64>,
}

impl Slicer {
    /// For a kernel each of whose steps has at most `loops` iterations of loops.
    pub fn new(limits: SliceLimits, loops: u32) -> Self {
        // One more for the step itself, one for the comparison that ends its loops.
        let most = (LOOP_ITERATIONS / loops.saturating_add(2)).max(1);
        let limits = SliceLimits { steps: limits.steps.min(most), ..limits };
        Self { limits, group_bodies: GROUP_BODIES, measured: None, attempt: None }
    }

    /// The most bodies of the next submission, if it has more than one chunk.
    pub fn group_bodies(&self) -> usize {
        self.group_bodies
    }

    /// Steps of the next submission of `bodies` in one dispatch, at most `left`.
    pub fn steps(&self, bodies: usize, left: u64) -> u32 {
        u64::from(self.fitting_steps(bodies).min(self.most_steps())).min(left) as u32
    }

    /// The most steps of one dispatch.
    pub fn most_steps(&self) -> u32 {
        self.limits.steps.max(1)
    }

    /// Steps of the next submission of `bodies`, in however many dispatches.
    ///
    /// The first submission is a single step, which the size of a group keeps short. The time of a step does not fall
    /// with fewer bodies (a GPU that is not full takes as long), and grows at most in proportion with more.
    pub fn fitting_steps(&self, bodies: usize) -> u32 {
        let steps = match self.measured {
            None => 1,
            Some(measured) => {
                let more = (bodies as f64 / measured.bodies as f64).max(1.0);
                let fitting = self.limits.duration.as_secs_f64() / (measured.seconds_per_step * more);
                // The cast saturates; an immeasurably short step leaves only the bound on growth.
                (fitting as u64).clamp(1, u64::from(measured.steps) * GROWTH)
            }
        };
        steps.min(u64::from(u32::MAX)) as u32
    }

    /// The number of bodies for a submission of `attempts` attempts each, or of as many as justify loading and storing
    /// a body if that is less.
    pub fn bodies(&self, attempts: u32) -> usize {
        let fitting = self.attempt.map_or(FIRST_BODIES, |attempt| {
            let all = self.limits.duration.as_secs_f64() / attempt;
            (all / f64::from(attempts.clamp(1, ENOUGH_STEPS))) as usize
        });
        // Whole workgroups, as otherwise lanes would idle.
        (fitting / STRIDE_UNIT * STRIDE_UNIT).clamp(STRIDE_UNIT, GROUP_BODIES)
    }

    /// Learns from a submission of rounds of attempts: at most `longest` of one body, and `held` of all, including
    /// those during which bodies waited. The first may include the driver's own compilation.
    pub fn record_attempts(&mut self, held: u64, longest: u32, elapsed: Duration) {
        if held == 0 {
            return;
        }
        let attempt = elapsed.as_secs_f64() / held as f64;
        // A device that is not full takes as long for fewer bodies: the shortest time is that of a full one.
        self.attempt = self.measured.map(|_| self.attempt.map_or(attempt, |least| least.min(attempt)));
        // As if the number of bodies had been constant.
        self.record(held.div_ceil(u64::from(longest)) as usize, longest, elapsed);
    }

    /// Learns from a submission.
    ///
    /// Measured times include the cost of submitting, so steps are never estimated cheaper than they are. A slice much
    /// shorter than the last, the rest of an interval, measures little else and is ignored.
    ///
    /// If a submission of few steps is long, loading and storing the bodies takes the time (on lavapipe 50 ms for a
    /// million). Then the next ones have fewer bodies, so that each stays for more steps. The first submission may
    /// include the driver's own compilation and does not count.
    pub fn record(&mut self, bodies: usize, steps: u32, elapsed: Duration) {
        if self.measured.is_some() && steps < ENOUGH_STEPS && elapsed > self.limits.duration / 2 {
            self.group_bodies = self.group_bodies.min((bodies / 2).max(1));
        }
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

/// The chunks of the next submission: the first with remaining steps and those after it with as many, as far as they
/// fit together. `sizes`: bodies of each chunk; `left`: remaining steps of each.
pub(super) fn next_group(sizes: &[usize], left: &[u64], group_bodies: usize) -> Option<Range<usize>> {
    let first = left.iter().position(|&left| left > 0)?;
    let mut bodies = sizes[first];
    let more = (first + 1..sizes.len()).take_while(|&index| {
        bodies += sizes[index];
        left[index] == left[first] && bodies <= group_bodies
    });
    Some(first..first + 1 + more.count())
}

#[cfg(test)]
mod tests {
    use super::*;

    const CHUNK: usize = 1 << 16;

    /// A device that takes `overhead` for a submission, `load` for a body and `step` for a step of 4,096 bodies or
    /// fewer.
    struct Device {
        overhead: f64,
        load: f64,
        step: f64,
    }

    /// The submissions for `steps` steps of a number of bodies.
    struct Run {
        longest: f64,
        total: f64,
        submissions: u32,
    }

    impl Device {
        fn run(&self, bodies: usize, steps: u64) -> Run {
            let mut slicer = Slicer::new(SliceLimits::default(), 0);
            let mut run = Run { longest: 0.0, total: 0.0, submissions: 0 };
            let sizes: Vec<usize> = (0..bodies).step_by(CHUNK).map(|first| CHUNK.min(bodies - first)).collect();
            let mut left = vec![steps; sizes.len()];
            while let Some(group) = next_group(&sizes, &left, slicer.group_bodies()) {
                let bodies: usize = sizes[group.clone()].iter().sum();
                let n = slicer.steps(bodies, left[group.start]);
                let step = self.step * (bodies as f64 / 4096.0).max(1.0);
                let seconds = self.overhead + self.load * bodies as f64 + step * f64::from(n);
                slicer.record(bodies, n, Duration::from_secs_f64(seconds));
                left[group].iter_mut().for_each(|left| *left -= u64::from(n));
                run.longest = run.longest.max(seconds);
                run.total += seconds;
                run.submissions += 1;
            }
            run
        }
    }

    #[test]
    fn no_slice_runs_longer_than_its_limit() {
        let limit = SliceLimits::default().duration.as_secs_f64();
        for step in [1e-9, 1e-7, 1e-5, 1.5e-4] {
            for bodies in [1, 63, 4096, CHUNK, CHUNK + 1, (1 << 20) - 3, 1 << 20, 3 << 20] {
                let device = Device { overhead: 1e-4, load: 1e-9, step };
                let longest = device.run(bodies, 10_000).longest;
                assert!(longest <= limit + 1e-4, "step {step} s, {bodies} bodies: {longest} s");
            }
        }
    }

    #[test]
    fn calibration_takes_few_submissions() {
        // 1, 454 and 4,880 steps, then slices of about 5,000: 1e6 steps of 10 us need 200.
        let submissions = Device { overhead: 1e-4, load: 1e-9, step: 1e-5 }.run(4096, 1_000_000).submissions;
        assert!(submissions <= 206, "{submissions} submissions");
    }

    #[test]
    fn loading_and_storing_do_not_take_most_of_the_time() {
        // As measured on lavapipe: 50 ns to load and store a body, 6 ns for a step of one.
        let device = Device { overhead: 1e-4, load: 5e-8, step: 6e-9 * 4096.0 };
        let (bodies, steps) = (1_000_000, 1000);
        let least = 6e-9 * bodies as f64 * steps as f64;
        let total = device.run(bodies, steps).total;
        assert!(total < 1.25 * least, "{total} s where the steps alone take {least} s");
    }

    #[test]
    fn a_full_group_stays_whole_where_steps_are_short() {
        let mut slicer = Slicer::new(SliceLimits::default(), 0);
        for steps in [1, 512, 4096] {
            slicer.record(1 << 20, steps, Duration::from_secs_f64(1e-3 + 1e-6 * f64::from(steps)));
        }
        assert_eq!(slicer.group_bodies(), GROUP_BODIES);
    }

    #[test]
    fn a_short_rest_does_not_spoil_the_calibration() {
        let mut slicer = Slicer::new(SliceLimits::default(), 0);
        slicer.record(64, 1000, Duration::from_millis(10));
        slicer.record(64, 1, Duration::from_micros(150));
        assert_eq!(slicer.steps(64, 3000), 3000);
    }
}
