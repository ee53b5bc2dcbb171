//! When bodies failed, to the step: they take their steps once more, by themselves, on the CPU.
//!
//! A run looks at states where outputs are read, so that it knows of a failed body two outputs between which it failed. Its steps are
//! taken again from the start rather than from its last good state: no output holds all words of a state, and only from the start are
//! the bits those of the run, as they depend neither on the bodies beside it nor on how steps are cut into calls. Of a run on a GPU the
//! CPU repeats what the shaders' twins do; where that does not fail between the same outputs, these are all that is said.

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

/// The most bodies whose steps are taken again.
const MOST_BODIES: usize = 1000;

/// Body-steps that are taken again at the most, a few seconds of them, or the [`SHARE`] of the run's own where that is more.
const BUDGET: u64 = 20_000_000;

/// What part of a run's own body-steps may be taken again.
const SHARE: u64 = 10;

/// Looks at the states in one passage through the steps, about.
const LOOKS: u64 = 4096;

/// What a step is counted as where the host follows the rotation step by step with the centres of mass.
const FOLLOWED: u64 = 16;

/// Finds the step at which each body failed, within the budget. `attempts` says how many adaptive steps a failed body has
/// tried.
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
            // Their steps are numbered from output to output, without those that end at changes of what torques hold.
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
    /// How many there are up to each output.
    ends: Vec<u64>,
}

impl<'p> Steps<'p> {
    fn of(plan: &'p Plan<'_>, treatment: Treatment) -> Self {
        let mut end = 0_u64;
        let ends = (0..plan.times().len()).map(|index| {
            end = end.saturating_add(treatment.interval(plan.span_before(index)).steps);
            end
        });
        Self { plan, treatment, ends: ends.collect() }
    }

    /// The steps up to an output, or to the start.
    fn until(&self, time: f64) -> u64 {
        let index = self.plan.times().partition_point(|&output| output < time);
        if time > 0.0 { self.ends.get(index).copied().unwrap_or(0) } else { 0 }
    }

    /// The interval that a step is in, where it starts (s), and how many steps lie before it.
    fn interval(&self, step: u64) -> (usize, Interval, f64, u64) {
        let index = self.ends.partition_point(|&end| end <= step).min(self.ends.len() - 1);
        let interval = self.treatment.interval(self.plan.span_before(index));
        let (start, before) = match index {
            0 => (0.0, 0),
            _ => (self.plan.times()[index - 1], self.ends[index - 1]),
        };
        (index, interval, start, before)
    }

    /// The time after a number of steps, s.
    fn time(&self, steps: u64) -> f64 {
        let Some(last) = steps.checked_sub(1) else { return 0.0 };
        let (index, interval, start, before) = self.interval(last);
        if steps == self.ends[index] { self.plan.times()[index] } else { start + interval.dt * (steps - before) as f64 }
    }

    /// Brings bodies on that have taken the first steps of `taken`.
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
    /// Steps after which it was good in the run, then the most after which it is.
    good: u64,
    /// The fewest after which it has failed.
    bad: u64,
    /// The state after `good` steps, where it was read here.
    state: Option<OutputState>,
    /// Whether what is seen here agrees with the run.
    agrees: bool,
}

impl Bracket<'_> {
    /// Advances to the state after a number of steps.
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
    fn looks(&self, parts: u64) -> impl Iterator<Item = u64> {
        let (good, width) = (self.good, self.bad - self.good);
        let parts = parts.min(width).max(1);
        (0..=parts).map(move |part| good + (u128::from(width) * u128::from(part) / u128::from(parts)) as u64)
    }
}

/// Whether a state is one of those of which the run says that they failed for a reason. A centre of mass that is lost first does
/// not stop the rotation.
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

/// One passage of as many bodies through their steps as the budget allows, which makes their brackets narrower; the others are let go.
/// Gives the body-steps that it took.
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
    // All of them go as far as the last one has to.
    let mut last = 0;
    let affordable = open.iter().zip(1_u64..).take_while(|(bracket, count)| {
        last = last.max(bracket.bad);
        last.saturating_mul(*count).saturating_mul(weight) <= budget
    });
    let count = affordable.count();
    open.truncate(count);
    let Some(last) = open.iter().map(|bracket| bracket.bad).max() else { return Ok(0) };
    let apart: BTreeSet<(u64, u64)> = open.iter().map(|bracket| (bracket.good, bracket.bad)).collect();
    let parts = (LOOKS / apart.len() as u64).max(8);
    let looks: BTreeSet<u64> = open.iter().flat_map(|bracket| bracket.looks(parts)).collect();

    let members = Members::Some(open.iter().map(|bracket| bracket.failed.body as u32).collect());
    let group = Group { members, ..group.clone() };
    let mut group_run = GroupRun::start(&Cpu::new(Width::Lanes), scene, &group, false, &mut WallTime::default())?;
    // Without skipping they are stepped for all bodies at once, and not here.
    let mut centres = scene.may_skip().then(|| Centres::start(plan));
    let mut taken = 0;
    for look in looks {
        if open.iter().all(|bracket| look > bracket.bad || !bracket.agrees) {
            break;
        }
        steps.advance(&mut group_run, taken..look, observer)?;
        taken = look;
        if let Some(centres) = &mut centres {
            centres.advance(steps.time(look), Interval { steps: 0, dt: 0.0 });
        }
        let states = group_run.output_states(&|body| centres.as_ref().and_then(|centres| centres.of_body(body)))?;
        open.iter_mut().zip(&states).for_each(|(bracket, state)| bracket.take(look, state));
        let done = taken.saturating_mul(count as u64);
        if observer(Progress { done, total: last.saturating_mul(count as u64) }).is_break() {
            return Err(Error::Interrupted { steps: taken });
        }
    }
    Ok(last.saturating_mul(count as u64).saturating_mul(weight))
}

/// Bodies whose steps fell below the limit: the time at which they stopped, and the state that they stand in.
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
    for (index, &time) in plan.times().iter().enumerate() {
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
