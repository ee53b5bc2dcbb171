//! Finds the step at which bodies failed: they alone take their steps again, on the CPU.
//!
//! A run examines states only at outputs, so it knows the two outputs between which a body failed. The steps are
//! repeated from the start rather than from the last good state: no output holds all words of a state, so only steps
//! from the start have the same bits as the run. These depend neither on the bodies beside it nor on how steps are
//! divided into calls. For a run on a GPU the CPU repeats the steps with the shaders' twins; if these do not fail
//! between the same outputs, only the outputs are reported.

use std::collections::BTreeSet;

use super::OutputState;
use super::translation::Centres;
use crate::bodies::Members;
use crate::bodies::Status;
use crate::engine::cpu::Cpu;
use crate::engine::{Observer, Progress};
use crate::error::{Error, Result};
use crate::math::Width;
use crate::plan::{Group, Interval, Plan, Treatment};
use crate::record::{FailedBody, KnownTo, WallTime};
use crate::run::group_run::GroupRun;
use crate::torque::Torque;

/// The most bodies whose steps are repeated.
const MOST_BODIES: usize = 1000;

/// The most body-steps that are repeated, a few seconds of work, or one in [`SHARE`] of the run's own if that is more.
const BUDGET: u64 = 20_000_000;

/// One in this many of a run's own body-steps may be repeated.
const SHARE: u64 = 10;

/// The approximate number of examinations of the states in one passage through the steps.
const EXAMINATIONS: u64 = 4096;

/// The cost of a step, in steps, if the host moves centres of mass along the rotation step by step.
const FOLLOWED: u64 = 16;

/// Finds the step at which each body failed, within the budget. `attempts` gives the number of adaptive steps that a
/// failed body has tried.
pub(super) fn find(
    plan: &Plan<'_>,
    failures: &mut [FailedBody],
    attempts: &dyn Fn(usize) -> u64,
    observer: &mut Observer<'_>,
) -> Result<()> {
    if failures.is_empty() {
        return Ok(());
    }
    let some = failures.len().min(MOST_BODIES);
    let mut budget = BUDGET.max(plan.body_steps() / SHARE);
    for group in plan.groups() {
        let is_own = |failed: &&mut FailedBody| !group.members.rows(failed.body..failed.body + 1).is_empty();
        let own: Vec<&mut FailedBody> = failures[..some].iter_mut().filter(is_own).collect();
        if own.is_empty() {
            continue;
        }
        match group.treatment {
            // Not under sampled torques: steps are numbered from output to output, without those that end at changes.
            _ if group.class.torques.of(plan.scene().torques()).iter().any(Torque::is_sampled) => {}
            Treatment::Stepped { .. } => in_equal_steps(plan, group, own, &mut budget, observer)?,
            Treatment::Adaptive { .. } => in_adaptive_steps(plan, group, own, attempts, &mut budget, observer)?,
            Treatment::RegularPrecession | Treatment::ClosedForm { .. } => {}
        }
    }
    Ok(())
}

/// The equal steps of a group, numbered through from the start.
struct Steps<'p> {
    plan: &'p Plan<'p>,
    treatment: Treatment,
    /// The number of steps up to each output.
    ends: Vec<u64>,
}

impl<'p> Steps<'p> {
    fn of(plan: &'p Plan<'_>, treatment: Treatment) -> Self {
        let mut end = 0_u64;
        let ends = (0..plan.advance_times().len()).map(|index| {
            end = end.saturating_add(treatment.interval(plan.span_before(index)).steps);
            end
        });
        Self { plan, treatment, ends: ends.collect() }
    }

    /// The steps up to an output, or to the start.
    fn until(&self, time: f64) -> u64 {
        let index = self.plan.advance_times().partition_point(|&output| output < time);
        if time > 0.0 { self.ends.get(index).copied().unwrap_or(0) } else { 0 }
    }

    /// The index of the interval of a step, the interval, its start (s), and the number of steps before it.
    fn interval(&self, step: u64) -> (usize, Interval, f64, u64) {
        let index = self.ends.partition_point(|&end| end <= step).min(self.ends.len() - 1);
        let interval = self.treatment.interval(self.plan.span_before(index));
        let (start, before) = match index {
            0 => (0.0, 0),
            _ => (self.plan.advance_times()[index - 1], self.ends[index - 1]),
        };
        (index, interval, start, before)
    }

    /// The time after a number of steps, s.
    fn time(&self, steps: u64) -> f64 {
        let Some(last) = steps.checked_sub(1) else { return 0.0 };
        let (index, interval, start, before) = self.interval(last);
        if steps == self.ends[index] {
            self.plan.advance_times()[index]
        } else {
            start + interval.dt * (steps - before) as f64
        }
    }

    /// Advances bodies by the steps of `taken`.
    fn advance(
        &self,
        group_run: &mut GroupRun<'_>,
        taken: std::ops::Range<u64>,
        observer: &mut Observer<'_>,
    ) -> Result<()> {
        let mut at = taken.start;
        while at < taken.end {
            let (index, interval, start, before) = self.interval(at);
            let end = taken.end.min(self.ends[index]);
            group_run.take_steps((start, interval.dt), at - before..end - before, self.time(end), observer)?;
            at = end;
        }
        Ok(())
    }
}

/// The steps between which a body fails.
struct Bracket<'f> {
    failed: &'f mut FailedBody,
    /// The number of steps after which it was good in the run, later the greatest after which it is good.
    good: u64,
    /// The least number of steps after which it has failed.
    bad: u64,
    /// The state after `good` steps, if it was read here.
    state: Option<OutputState>,
    /// Whether the repeated steps agree with the run.
    agrees: bool,
}

impl Bracket<'_> {
    /// Narrows the bracket by the state after a number of steps.
    fn take(&mut self, steps: u64, state: &OutputState) {
        if steps < self.good || steps > self.bad {
            return;
        }
        match has_failed(state, self.failed.reason) {
            true if steps == self.good => self.agrees = false,
            true => self.bad = steps,
            false if steps == self.bad => self.agrees = false,
            false => {
                if steps > self.good {
                    self.state = Some(*state);
                }
                self.good = steps;
            }
        }
    }

    /// The steps after which states are examined, in about this many parts.
    fn examined(&self, parts: u64) -> impl Iterator<Item = u64> {
        let (good, width) = (self.good, self.bad - self.good);
        let parts = parts.min(width).max(1);
        (0..=parts).map(move |part| good + (u128::from(width) * u128::from(part) / u128::from(parts)) as u64)
    }
}

/// Whether a state has failed in the sense of the run's reason. A centre of mass that is lost first does not stop the
/// rotation.
fn has_failed(state: &OutputState, reason: Status) -> bool {
    match state.status() {
        Status::Valid | Status::Stopped => false,
        Status::CentreNotFinite => reason == Status::CentreNotFinite,
        _ => true,
    }
}

fn in_equal_steps<'f>(
    plan: &Plan<'_>,
    group: &Group,
    failures: Vec<&'f mut FailedBody>,
    budget: &mut u64,
    observer: &mut Observer<'_>,
) -> Result<()> {
    let steps = Steps::of(plan, group.treatment);
    let bracket = |failed: &'f mut FailedBody| {
        let (good, bad) = (steps.until(failed.last_good_time), steps.until(failed.time));
        (good < bad).then_some(Bracket { failed, good, bad, state: None, agrees: true })
    };
    let mut open: Vec<Bracket<'f>> = failures.into_iter().filter_map(bracket).collect();
    while !open.is_empty() {
        let cost = passage(plan, group, &steps, &mut open, *budget, observer)?;
        *budget -= cost.min(*budget);
        let mut left = Vec::new();
        for bracket in open.into_iter().filter(|bracket| bracket.agrees) {
            let Bracket { good, bad, state, .. } = bracket;
            if bad - good > 1 {
                left.push(bracket);
                continue;
            }
            let failed = bracket.failed;
            (failed.time, failed.known_to) = (steps.time(bad), KnownTo::Step);
            if let Some(OutputState { rotation, .. }) = state {
                failed.last_good_time = steps.time(good);
                (failed.orientation, failed.angular_velocity_body) =
                    (rotation.orientation, rotation.angular_velocity_body);
            }
        }
        open = left;
    }
    Ok(())
}

/// Passes through the steps with as many bodies as the budget allows, which narrows their brackets; the other bodies
/// are dropped. Returns the body-steps taken.
fn passage(
    plan: &Plan<'_>,
    group: &Group,
    steps: &Steps<'_>,
    open: &mut Vec<Bracket<'_>>,
    budget: u64,
    observer: &mut Observer<'_>,
) -> Result<u64> {
    let scene = plan.scene();
    let weight = if scene.forces().iter().any(crate::torque::force::Force::needs_attitude) { FOLLOWED } else { 1 };
    // All of them go as far as the last one needs.
    let mut last = 0;
    let affordable = open.iter().zip(1_u64..).take_while(|(bracket, count)| {
        last = last.max(bracket.bad);
        last.saturating_mul(*count).saturating_mul(weight) <= budget
    });
    let count = affordable.count();
    open.truncate(count);
    let Some(last) = open.iter().map(|bracket| bracket.bad).max() else { return Ok(0) };
    let apart: BTreeSet<(u64, u64)> = open.iter().map(|bracket| (bracket.good, bracket.bad)).collect();
    let parts = (EXAMINATIONS / apart.len() as u64).max(8);
    let examined: BTreeSet<u64> = open.iter().flat_map(|bracket| bracket.examined(parts)).collect();

    let members = Members::Some(open.iter().map(|bracket| bracket.failed.body as u32).collect());
    let group = Group { members, ..group.clone() };
    let mut group_run = GroupRun::start(&Cpu::new(Width::Lanes), scene, &group, false, &mut WallTime::default())?;
    // Without skipping, a run steps the centres of mass of all bodies at once, which is not repeated here.
    let mut centres = scene.may_skip().then(|| Centres::start(plan));
    let mut taken = 0;
    for step in examined {
        if open.iter().all(|bracket| step > bracket.bad || !bracket.agrees) {
            break;
        }
        steps.advance(&mut group_run, taken..step, observer)?;
        taken = step;
        if let Some(centres) = &mut centres {
            centres.advance(steps.time(step), Interval { steps: 0, dt: 0.0 });
        }
        let states = group_run.output_states(&|body| centres.as_ref().and_then(|centres| centres.of_body(body)))?;
        open.iter_mut().zip(&states).for_each(|(bracket, state)| bracket.take(step, state));
        let done = taken.saturating_mul(count as u64);
        if observer(Progress { done, total: last.saturating_mul(count as u64) }).is_break() {
            return Err(Error::Interrupted { steps: taken });
        }
    }
    Ok(last.saturating_mul(count as u64).saturating_mul(weight))
}

/// For bodies whose steps fell below the limit, finds the time at which they stopped, and their states then.
fn in_adaptive_steps(
    plan: &Plan<'_>,
    group: &Group,
    mut failures: Vec<&mut FailedBody>,
    attempts: &dyn Fn(usize) -> u64,
    budget: &mut u64,
    observer: &mut Observer<'_>,
) -> Result<()> {
    failures.retain(|failed| failed.reason == Status::StepBelowLimit);
    let mut cost = 0_u64;
    let affordable = failures.iter().take_while(|failed| {
        cost = cost.saturating_add(attempts(failed.body));
        cost <= *budget
    });
    let count = affordable.count();
    failures.truncate(count);
    *budget -= failures.iter().map(|failed| attempts(failed.body)).sum::<u64>().min(*budget);
    let members = Members::Some(failures.iter().map(|failed| failed.body as u32).collect());
    let group = Group { members, ..group.clone() };
    if failures.is_empty() {
        return Ok(());
    }
    let mut group_run =
        GroupRun::start(&Cpu::new(Width::Lanes), plan.scene(), &group, false, &mut WallTime::default())?;
    let mut left: Vec<Option<&mut FailedBody>> = failures.into_iter().map(Some).collect();
    for (index, &time) in plan.advance_times().iter().enumerate() {
        group_run.advance(time, plan.span_before(index), true, observer)?;
        for (row, place) in left.iter_mut().enumerate() {
            let Some(failed) = place else { continue };
            if time > failed.time {
                *place = None;
            } else if time > failed.last_good_time
                && let Some((stopped, state)) = group_run.stopped(row)?
            {
                if state.is_finite() && stopped >= failed.last_good_time {
                    (failed.time, failed.last_good_time, failed.known_to) = (stopped, stopped, KnownTo::Step);
                    (failed.orientation, failed.angular_velocity_body) =
                        (state.orientation, state.angular_velocity_body);
                }
                *place = None;
            }
        }
        if left.iter().all(Option::is_none) {
            break;
        }
    }
    Ok(())
}
