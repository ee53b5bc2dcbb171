//! A pilot's bodies stepped by a rule: their final states, their distance from a reference, and the cost.

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::sync::atomic::{AtomicU64, Ordering};

use super::choice::{Classification, Rule, Scheme, narrowest};
use super::cost::Cost;
use super::group::{LEVELS_PER_OCTAVE, Treatment, level_of, step_of};
use super::pilot::Pilot;
use crate::bodies::BodyState;
use crate::bodies::Members;
use crate::bodies::Status;
use crate::engine::StepCounts;
use crate::engine::controlled::Controls;
use crate::error::Result;
use crate::kernel::method::Method;
use crate::math::Precision;
use crate::math::Spread;
use crate::math::parallel;
use crate::plan::errors::{ErrorRatio, Errors};
use crate::plan::own_state::{OwnOfBodies, OwnStates};
use crate::plan::subset::{AtTime, SubsetStates, Watcher, propagate_subset, propagate_subset_through};
use crate::scene::AdaptiveSteps;
use crate::scene::Target;
use crate::torque::control::Schedule;

/// If steps end at more times than this, the pilot's end at the breaks alone.
const MOST_TIMES: usize = 1000;

/// The most parts, about, into which all intervals beside breaks together are cut.
const MOST_PARTS: usize = 20_000;

/// The part of the time to the first end of steps after which one more step ends where roundings are compared.
const EARLY: f64 = 1.0 / 64.0;

/// The attitude error, rad, of equal steps by rounding, as a part of the angle times the square root of their number: each step rounds the
/// momentum by some part of 2⁻⁵³, which adds up as in a random walk and turns the body too far from then on. Measured on 24 bodies in a
/// magnetic field, in steps of 0.7 to 0.02 s: the greatest errors are 0.3 to 0.4 of 2⁻⁵³ times that, the median 0.1.
const ROUNDING_OF_STEPS: f64 = 0.3 / 9.007_199_254_740_992e15;

/// The number of bodies that fill the lanes of a core.
const FULL: f64 = 16.0;

static TAKEN: AtomicU64 = AtomicU64::new(0);

/// Steps that the pilots of this process have taken so far, including rejected attempts.
#[doc(hidden)]
pub fn pilot_steps() -> u64 {
    TAKEN.load(Ordering::Relaxed)
}

/// States of some bodies at the end.
pub(super) type States = BTreeMap<usize, BodyState>;

/// A pilot's bodies at the end, and their steps if they chose them.
pub(super) struct Sampled {
    pub states: States,
    pub steps: Option<Spread>,
}

impl Sampled {
    /// Number of bodies whose steps fell below the limit before the end.
    pub fn unfinished(&self) -> usize {
        self.states.values().filter(|state| state.status != Status::Valid).count()
    }
}

/// A pilot's bodies at some times, and their steps if they chose them.
pub(super) struct Followed {
    /// Their own state at the start.
    pub start: OwnOfBodies,
    /// The states at each time.
    pub times: Vec<AtOnce>,
    pub steps: Option<Spread>,
}

/// A pilot's bodies at one time.
#[derive(Clone, Default)]
pub(super) struct AtOnce {
    pub states: States,
    own: OwnOfBodies,
}

impl AtOnce {
    /// The state of a body with its own state, if it has not failed.
    pub fn of(&self, body: usize) -> Option<(&BodyState, &[f64])> {
        self.states.get(&body).filter(|state| state.is_sound()).map(|state| (state, self.own.of(body)))
    }

    /// The bodies whose steps fell below the limit.
    pub fn given_up(&self) -> Vec<u32> {
        let fallen = self.states.iter().filter(|(_, state)| state.status == Status::StepBelowLimit);
        fallen.map(|(body, _)| *body as u32).collect()
    }
}

impl Followed {
    /// Whether a body fails here that `other` keeps.
    pub fn loses(&self, other: &Self) -> bool {
        let fails = |(body, state): (&usize, &BodyState), others: &States| {
            !state.is_sound() && others.get(body).is_some_and(BodyState::is_sound)
        };
        let at = |(own, other): (&AtOnce, &AtOnce)| own.states.iter().any(|state| fails(state, &other.states));
        self.times.iter().zip(&other.times).any(at)
    }
}

/// The least step of a body as a part of what its steps may be on average. A motion that is damped begins in steps far shorter than those in
/// which it ends.
const SHORTEST: f64 = 1e-3;

/// More attempts for a radian than bodies take that no torque forces to.
const ATTEMPTS_PER_RADIAN: f64 = 10.0;

impl Pilot<'_> {
    /// Gives up bodies that take more steps than any one may.
    fn watcher(&self) -> Watcher<'_, '_> {
        Watcher::Limit(&self.limit.watch, self.most_attempts() as u64)
    }

    /// Steps the sample by a rule, with states at ascending times; the last is the end of the pilot's span.
    pub fn followed(&self, rule: &Rule, times: &[f64]) -> Result<Followed> {
        let schedule = Schedule::of(self.torques);
        let own_states = OwnStates::of(self.scene.torques());
        let is_dense = self.goes_beyond_outputs(rule.scheme);
        let groups = parallel::map_tasks(self.treatments(rule), |_, (treatment, members)| {
            let (mut start, mut at_times) = (OwnOfBodies::default(), vec![AtOnce::default(); times.len()]);
            let mut take = |index: Option<usize>, states: &[(usize, BodyState)], controls: Option<&Controls>| {
                let own = |time: f64| own_states.of_all((self.set, controls), time);
                match index {
                    Some(index) => {
                        at_times[index] = AtOnce { states: states.iter().copied().collect(), own: own(times[index]) };
                    }
                    None => start = own(0.0),
                }
            };
            let members = Members::Some(members);
            let (watcher, take) = (self.watcher(), Some(&mut take as &mut AtTime<'_>));
            let treated = (&treatment, is_dense);
            let found = propagate_subset_through(self.scene, times, self.torques, &members, treated, watcher, take)?;
            TAKEN.fetch_add(
                (members.len() as f64 * equal_steps(&treatment, times, schedule.as_ref())) as u64,
                Ordering::Relaxed,
            );
            Ok((start, at_times, found))
        });
        let (mut start, mut all_times) = (OwnOfBodies::default(), vec![AtOnce::default(); times.len()]);
        let mut counts: Vec<u64> = Vec::new();
        for (at_start, at_times, SubsetStates { counts: of_group, .. }) in
            groups.into_iter().collect::<Result<Vec<_>>>()?
        {
            start.extend(at_start);
            for (all, group) in all_times.iter_mut().zip(at_times) {
                all.states.extend(group.states);
                all.own.extend(group.own);
            }
            counts.extend(of_group.iter().map(StepCounts::attempts));
        }
        TAKEN.fetch_add(counts.iter().sum(), Ordering::Relaxed);
        let steps = self.spread(counts);
        self.limit.passed(self.seconds(rule, Cost::shipped(rule.scheme), steps))?;
        Ok(Followed { start, times: all_times, steps })
    }

    /// Steps the sample by a rule.
    pub fn stepped(&self, rule: &Rule) -> Result<Sampled> {
        self.stepped_through(rule, &self.times_of(rule.scheme))
    }

    /// The same with each interval beside a break cut into `parts`, where steps are equal: such intervals may be shorter than any step, so that
    /// shorter steps alone would be the same there.
    pub fn stepped_in_parts(&self, rule: &Rule, parts: usize) -> Result<Sampled> {
        let (ends, breaks) = (self.times_of(rule.scheme), self.times.breaks());
        let parts = parts.min(MOST_PARTS / breaks.len().max(1));
        if rule.scheme.is_adaptive() || breaks.is_empty() || parts < 2 {
            return self.stepped_through(rule, &ends);
        }
        let is_break = |time: f64| breaks.binary_search_by(|other| other.total_cmp(&time)).is_ok();
        let (mut times, mut last) = (Vec::new(), 0.0);
        for end in ends {
            if is_break(last) || is_break(end) {
                let within = (1..parts).map(|part| last + (end - last) * (part as f64 / parts as f64));
                // Nothing lies between the two sides of a jump.
                times.extend(within.filter(|&time| last < time && time < end));
            }
            times.push(end);
            last = end;
        }
        self.stepped_through(rule, &times)
    }

    /// The same with a step that ends early in the span, so that all later ones start at other times and round otherwise.
    pub fn stepped_otherwise(&self, rule: &Rule) -> Result<Sampled> {
        let mut times = self.times_of(rule.scheme);
        times.insert(0, EARLY * times[0]);
        self.stepped_through(rule, &times)
    }

    fn stepped_through(&self, rule: &Rule, times: &[f64]) -> Result<Sampled> {
        // Side by side, as each group alone is too small for all cores.
        let groups = parallel::map_tasks(self.treatments(rule), |_, (treatment, members)| {
            propagate_subset(self.scene, times, self.torques, &Members::Some(members), &treatment, self.watcher())
        });
        let (mut states, mut counts) = (States::new(), Vec::new());
        for group in groups.into_iter().collect::<Result<Vec<_>>>()? {
            states.extend(group.states);
            counts.extend(group.counts.iter().map(StepCounts::attempts));
        }
        let attempts: u64 = counts.iter().sum();
        TAKEN.fetch_add(attempts.saturating_add(self.equal_steps(rule)), Ordering::Relaxed);
        let steps = self.spread(counts);
        self.limit.passed(self.seconds(rule, Cost::shipped(rule.scheme), steps))?;
        Ok(Sampled { states, steps })
    }

    /// The steps of the sample's bodies, if they choose them, in proportion to the whole span. The mean is that of the class.
    fn spread(&self, counts: Vec<u64>) -> Option<Spread> {
        let longer = self.scene.end() / self.span;
        let counts: Vec<u64> = counts.into_iter().map(|count| (count as f64 * longer) as u64).collect();
        let of_class = |all: Spread| Spread { total: (self.typical * all.total as f64) as u64, ..all };
        (!counts.is_empty()).then(|| of_class(Spread::of(counts)))
    }

    /// Whether a body of the sample makes more than `most` attempts at the adaptive steps of a rule, if they may be as short as in the run.
    pub fn exceeds(&self, rule: &Rule, most: u64) -> Result<bool> {
        for (mut treatment, members) in self.treatments(rule) {
            let Treatment::Adaptive { steps, .. } = &mut treatment else { continue };
            steps.least_step = None;
            let (times, watcher) = (self.times_of(rule.scheme), Watcher::Limit(&self.limit.watch, most));
            let members = Members::Some(members);
            let found = propagate_subset(self.scene, &times, self.torques, &members, &treatment, watcher)?;
            TAKEN.fetch_add(found.counts.iter().map(StepCounts::attempts).sum(), Ordering::Relaxed);
            if found.counts.iter().any(|counts| counts.attempts() > most) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// The most attempts of a body: one that is far faster than the others takes more than they do.
    fn most_attempts(&self) -> f64 {
        let fastest = self.bodies.iter().map(|(_, classification)| classification.rate).fold(0.0, f64::max);
        self.most_of_body.max(ATTEMPTS_PER_RADIAN * fastest * self.span)
    }

    /// The greatest attitude error, rad, of the sample's bodies over the whole span by rounding in equal steps of a rule; 0 if they are adaptive.
    pub fn rounding(&self, rule: &Rule) -> f64 {
        let span = self.scene.end();
        let of_body = |(_, classification): &(u32, Classification)| {
            let steps = (span / rule.longest_step(classification.rate, span)).max(1.0);
            ROUNDING_OF_STEPS * classification.rate * span * steps.sqrt()
        };
        if rule.scheme.is_adaptive() { 0.0 } else { self.bodies.iter().map(of_body).fold(0.0, f64::max) }
    }

    /// The sample's steps under a rule of equal steps.
    fn equal_steps(&self, rule: &Rule) -> u64 {
        let (times, schedule) = (self.times_of(rule.scheme), Schedule::of(self.torques));
        let of_group = |(treatment, members): (Treatment, Vec<u32>)| {
            members.len() as f64 * equal_steps(&treatment, &times, schedule.as_ref())
        };
        self.treatments(rule).into_iter().map(of_group).sum::<f64>() as u64
    }

    /// The sample's bodies, sorted by how a rule steps them.
    fn treatments(&self, rule: &Rule) -> Vec<(Treatment, Vec<u32>)> {
        let span = self.scene.end();
        let mut groups: BTreeMap<(Option<i32>, bool), Vec<u32>> = BTreeMap::new();
        for (body, classification) in &self.bodies {
            let step = rule.longest_step(classification.rate, span);
            let level = (step < span).then(|| level_of(step));
            groups.entry((level, rule.is_wide(classification.rate * span))).or_default().push(*body);
        }
        let treatment = |(level, wide): (Option<i32>, bool)| {
            let precision = if wide { Precision::F64 } else { Precision::F32 };
            match rule.treatment(precision, level.map_or(span, step_of)) {
                Treatment::Adaptive { method, precision, steps } => {
                    // Steps to where a torque jumps are as short as the tolerance; the attempts are limited.
                    let least_step =
                        (!self.may_leap(rule.scheme)).then_some(SHORTEST * self.span / self.most_attempts());
                    let steps = AdaptiveSteps { least_step, ..steps };
                    Treatment::Adaptive { method, precision, steps }
                }
                equal => equal,
            }
        };
        groups.into_iter().map(|(key, members)| (treatment(key), members)).collect()
    }

    /// The times within the pilot's span at which its steps of a kind end, and its end.
    pub fn times_of(&self, scheme: Scheme) -> Vec<f64> {
        let all = self.times.all();
        let kept = match self.goes_beyond_outputs(scheme) {
            true => &[],
            false if all.len() <= MOST_TIMES => all,
            false => self.times.breaks(),
        };
        let mut times: Vec<f64> = kept.iter().copied().take_while(|&time| time < self.span).collect();
        times.push(self.span);
        times
    }

    /// The times within the pilot's span at which a value changes that torques hold, each of which ends a step.
    pub fn changes(&self) -> f64 {
        Schedule::of(self.torques).map_or(0.0, |schedule| schedule.changes_in(self.span))
    }

    /// Whether adaptive steps of a rule are as short as their ends are apart, whatever their tolerance.
    pub fn is_cut_short(&self, rule: &Rule) -> bool {
        let angles = self.bodies.iter().map(|(_, classification)| classification.rate * self.span);
        let attempts: f64 = angles.map(|angle| rule.expected_attempts(Precision::F64, angle)).sum();
        self.times_of(rule.scheme).len() as f64 + self.changes() >= attempts / self.bodies.len().max(1) as f64
    }

    /// Whether steps of a kind go beyond outputs.
    pub fn goes_beyond_outputs(&self, scheme: Scheme) -> bool {
        scheme == Scheme::TAYLOR && self.times.is_dense()
    }

    /// The times at which the run's steps end or states are formed from their series, within the pilot's span.
    fn outputs(&self) -> f64 {
        self.times.all().partition_point(|&time| time <= self.span).max(1) as f64
    }

    /// The ratio of the class's errors over the whole span, at the percentile asked for, to the targets; and that of the sample's errors alone.
    pub fn error_ratio(&self, mut errors: Errors) -> (ErrorRatio, f64) {
        let margin = self.margin(&mut errors);
        let ErrorRatio { part, worst, attitude } = errors.error_ratio(self.accuracy, self.all);
        // No angle is greater than π.
        let most =
            self.accuracy.attitude.filter(|_| worst == Target::Attitude).map_or(f64::INFINITY, |target| PI / target);
        let of_all =
            ErrorRatio { part: (margin * part).min(most.max(part)), worst, attitude: (margin * attitude).min(PI) };
        (of_all, part)
    }

    /// The differences between the bodies' final states and those of a reference.
    pub fn errors(&self, states: &States, reference: &States) -> Errors {
        let mut errors = Errors::default();
        for (body, state) in states {
            if let Some(reference) = reference.get(body) {
                errors.push(state, reference);
            }
        }
        errors
    }

    /// Time of a step under the pilot's torques, s.
    pub fn step_seconds(&self, rule: &Rule, cost: &Cost, precision: Precision) -> f64 {
        self.work.step_seconds(cost, precision, rule.tolerance(precision))
    }

    /// The sample's part of the time that the run will take, s, by which candidates are compared: that of its steps, and of the waits for a
    /// device, which the pilot itself has none of. `known` gives the number of steps where bodies choose them.
    pub fn seconds_in_run(&self, rule: &Rule, cost: &Cost, known: Option<Spread>) -> f64 {
        let full = FULL * self.bodies.len() as f64 / self.all as f64;
        self.seconds_in_lanes(rule, cost, known, full) + self.waiting(rule)
    }

    /// The time, s, of a pass over the sample, whose groups may be too small to fill the lanes of a core.
    pub fn seconds_of_pass(&self, rule: &Rule) -> f64 {
        self.seconds_in_lanes(rule, Cost::shipped(rule.scheme), None, FULL)
    }

    /// The sample's part of the time for which a run waits for its device.
    fn waiting(&self, rule: &Rule) -> f64 {
        let outputs = self.outputs();
        let of_body = |(_, classification): &(u32, Classification)| {
            let precision = rule.precision_of(classification.rate * self.scene.end());
            self.costs.waiting(rule.scheme, precision, outputs)
        };
        self.bodies.iter().map(of_body).sum::<f64>() / self.all as f64
    }

    /// Time that the sample's steps take in full lanes, s; `known` gives their number where bodies choose them.
    pub fn seconds(&self, rule: &Rule, cost: &Cost, known: Option<Spread>) -> f64 {
        self.seconds_in_lanes(rule, cost, known, 0.0)
    }

    /// The same where groups of fewer bodies than `full` take as long as that many.
    fn seconds_in_lanes(&self, rule: &Rule, cost: &Cost, known: Option<Spread>, full: f64) -> f64 {
        let (times, schedule) = (self.times_of(rule.scheme), Schedule::of(self.torques));
        let is_dense = self.goes_beyond_outputs(rule.scheme);
        // In the run, a step ends at each output.
        let least = if is_dense { 1.0 } else { self.outputs() };
        if rule.scheme.is_adaptive() {
            let ends = least + self.changes();
            let part = self.span / self.scene.end();
            let mean = known.map(|steps| part * steps.total as f64 / self.bodies.len() as f64);
            let evaluations = if is_dense { self.outputs() * cost.output_seconds() } else { 0.0 };
            let of_body = |(_, classification): &(u32, Classification)| {
                let precision = rule.precision_of(classification.rate * self.scene.end());
                let angle = classification.rate * self.span / self.slowing;
                let attempts = mean.unwrap_or_else(|| rule.expected_attempts(precision, angle));
                attempts.max(ends) * self.step_seconds(rule, cost, precision) + evaluations
            };
            let seconds: Vec<f64> = self.bodies.iter().map(of_body).collect();
            let longest = seconds.iter().copied().fold(0.0, f64::max);
            // Lanes are filled again until the last body.
            return seconds.iter().sum::<f64>().max(full * longest);
        }
        let of_group = |(treatment, members): &(Treatment, Vec<u32>)| {
            let precision = treatment.precision_of_steps().unwrap_or(Precision::F64);
            (members.len() as f64).max(full)
                * equal_steps(treatment, &times, schedule.as_ref()).max(least)
                * self.step_seconds(rule, cost, precision)
        };
        self.treatments(rule).iter().map(of_group).sum()
    }
}

/// Equal steps of a body through some times; changes of the values that torques hold end some steps early.
fn equal_steps(treatment: &Treatment, times: &[f64], schedule: Option<&Schedule>) -> f64 {
    let mut last = 0.0;
    let steps = |&time: &f64| treatment.steps_between(schedule, (std::mem::replace(&mut last, time), time)) as f64;
    times.iter().map(steps).sum()
}

impl Rule {
    /// Whether every body of a pilot takes the longest step there is, or the greatest tolerance.
    pub(super) fn takes_longest(&self, pilot: &Pilot<'_>) -> bool {
        self.steps_like(&Rule { coefficient: 1e-4 * self.coefficient, ..*self }, pilot)
    }

    /// Whether every body of a pilot takes the same steps by this rule as by another of the same scheme.
    pub(super) fn steps_like(&self, other: &Rule, pilot: &Pilot<'_>) -> bool {
        let span = pilot.scene.end();
        let alike = |(_, classification): &(u32, Classification)| match self.scheme {
            Scheme::Equal(_) => {
                self.longest_step(classification.rate, span) == other.longest_step(classification.rate, span)
            }
            Scheme::Adaptive(_) => self.adapts_like(other, self.precision_of(classification.rate * span)),
        };
        pilot.bodies.iter().all(alike)
    }

    /// The factor in the coefficient between neighbouring levels of steps; tolerances have no levels and use that of `rk8`.
    pub(super) fn level(&self) -> f64 {
        let order = match self.scheme {
            Scheme::Equal(method) => method.order(),
            Scheme::Adaptive(_) => Method::Rk8.order(),
        };
        2.0_f64.powf(f64::from(order) / f64::from(LEVELS_PER_OCTAVE))
    }

    /// The arithmetic of a body that turns by `angle` rad.
    pub(super) fn precision_of(&self, angle: f64) -> Precision {
        self.precision.unwrap_or_else(|| narrowest(self.attitude, angle))
    }

    /// Whether a body that turns by `angle` rad is stepped in `f64`.
    pub(super) fn is_wide(&self, angle: f64) -> bool {
        self.precision_of(angle) == Precision::F64
    }
}
