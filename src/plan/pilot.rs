//! The pilot: a few bodies of a class, integrated ahead, to find the step that meets an accuracy.
//!
//! For each candidate method some of the class's bodies are stepped on the CPU with the steps that the class would take, and compared with
//! a much finer reference. As the error goes as the step to the method's order, the measured error corrects the coefficient of the method's
//! [`Rule`]; stepped once more, the error must be within the target. The candidate that needs the least time is taken ([`search`]).
//!
//! A pilot has a budget of steps, a part of what the class will take ([`SHARE`]): a probe first counts the steps of a few bodies over a
//! short time. If all the bodies that the percentile needs, over the whole span, would exceed the budget, the pilot takes fewer bodies
//! (within [`SHARE_OF_BODIES`]) and, if that is not enough, a shorter span (within [`SHARE`]). Margins account for what that leaves unseen
//! ([`Pilot::margin`]): with methods of high order a wide margin costs few steps. Where bodies are few, more of them are followed in loose
//! steps, which show how much more the most sensitive ones err ([`survey`]).
//! If nothing meets the target only because of that margin, the sample or the survey that needs none is tried, within [`MOST_OF_MORE`] steps.
//!
//! What cannot be planned is refused early: bodies for which the probe predicts more steps than any run could take, and a motion that
//! loses every digit in a small part of the pilot's span, where no torque could bring it back.

mod candidates;
mod probe;
mod search;
mod survey;

use probe::{MOST_DIFFICULTY, SHORTER_PROBES};
use search::{ENOUGH, MOST_OF_CANDIDATES};
use survey::Survey;

use super::choice::{Classification, Rule, Scheme};
use super::cost::work::Work;
use super::cost::{Cost, Costs};
use super::driven::TorqueSet;
use super::reference::{Reference, SATURATED};
use super::time_limit::TimeLimit;
use super::times::Times;
use crate::error::{Error, Result};
use crate::kernel::method::rk8_adaptive::least_tolerance;
use crate::math::Precision;
use crate::math::Spread;
use crate::plan::errors::Errors;
use crate::plan::sampling::least_sample;
use crate::plan::sampling::sample;
use crate::scene::{Accuracy, Scene, Target};
use crate::torque::Torque;
use crate::torque::coupled::is_carrier;

/// Errors below this part of the target, and their distribution, say nothing about errors beyond it.
const NEGLIGIBLE_PART: f64 = 1e-2;
/// The factor on the errors of a small sample, for tails heavier than those of a log-normal distribution. Under gravity gradients on an ellipse
/// plans by some 25 bodies of 3,000 still miss the 99th percentile at times, by a factor of up to 5; with a factor of 4 plans for heavy tops
/// take steps that err a hundred times less than asked for.
pub(super) const HEAVIER: f64 = 3.0;
/// The most bodies of a class in its pilot, where the percentile asked for needs no more ([`least_sample`]).
const MOST_BODIES: usize = 1000;
/// The fewest bodies of a sample, or all where there are fewer: about what the 99th percentile needs.
const ENOUGH_BODIES: usize = 300;
/// At most one body in this many, so that the pilot costs little compared with the run.
const ONE_IN: usize = 32;
/// The number of bodies that every budget allows, and that a probe uses: a lane group.
const LEAST_BODIES: usize = 8;
/// A pilot of fewer bodies than this is accompanied by a [`survey`], and then has no more than [`MOST_SURVEYED`].
const LEAST_UNSURVEYED: usize = 64;
const MOST_SURVEYED: usize = 16;
/// How many times as fast as the bodies of a pilot let expect another must be to be among them, and the most bodies whose rates are compared.
const FASTER: f64 = 2.0;
const MOST_COMPARED: usize = 1024;
/// Bodies that turn more than [`FASTER`] times as fast as the one at the percentile asked for are left out, if they are at most this part of
/// those that the percentile leaves out: they would decide what a small sample shows of that percentile.
const MOST_LEFT_OUT: f64 = 0.5;
/// The standard deviations by which the 99th percentile of a normal distribution is above its mean.
const NORMAL_99: f64 = 2.33;
/// The most steps of a body in a probe. In what follows, the limit as a multiple of the steps that the probe predicts: a motion that takes
/// more is not smooth, or is stiff.
pub(super) const PROBED_STEPS: f64 = 1e5;
const UNEXPECTED: f64 = 100.0;
/// The angle, rad, by which the fastest body of a probe turns.
const PROBED_ANGLE: f64 = 30.0;
/// More steps of one body than a core takes in a day.
const MOST_STEPS_OF_RUN: f64 = 1e12;
/// The parts of a pilot's span after which its errors are first compared.
const EARLY: [f64; 2] = [1.0 / 64.0, 1.0 / 8.0];

/// The part of the class's steps that its pilot may take.
const SHARE: f64 = 0.1;
/// The number of steps that it may always take, without torques: some 20 ms of one core.
const FREE_STEPS: f64 = 3e5;
/// The same for more bodies than [`LEAST_BODIES`]: the whole span of a few bodies tells more than a part of the span of many.
const SHARE_OF_BODIES: f64 = 0.03;
const FREE_STEPS_OF_BODIES: f64 = 1e5;
/// The most steps that it may take, some seconds of one core, so that a run of days is not planned for hours. The second limit is for one
/// body: some 16 times its share if all took as many.
const MOST_STEPS: f64 = 3e7;
const MOST_OF_BODY: f64 = 1e7;
/// The same if the probe had to be cut short and so says little about the rest.
const MOST_AFTER_CUT: f64 = 3e6;
/// The same for a larger sample, tried where the first one did not show enough.
const MOST_OF_MORE: f64 = 2e7;
/// The same for bodies that slow down.
const MOST_SLOWED: f64 = 3e6;
/// The same if there is an alternative to this pilot.
const MOST_BRIEF: f64 = 3e5;
/// What a change of the values that sampled torques hold costs for one body, in steps: in the run, and in a pilot, whose few bodies hardly
/// share the time of forming the values and of starting anew (0.25 and 3.5 to 4.9 µs).
const CHANGE_IN_RUN: f64 = 2.5;
const CHANGE: f64 = 40.0;
/// The tolerances of the steps in which a few bodies are followed over the whole span where the others are not, the most steps of all of them,
/// and the factor by which other bodies' errors may grow more.
const OF_GROWTH: [f64; 2] = [1e-9, 1e-11];
const MOST_OF_GROWTH: f64 = 1e8;
const GROWS_MORE: f64 = 3.0;
/// The growth after which nothing is left.
const LOST: f64 = 1e30;
/// A reference that would take more than this many budgets is given up.
const MOST_BUDGETS: f64 = 3.0;
/// How many times the pilot is expected to step its bodies, in steps of the length that the class will take.
const PASSES: f64 = 6.0;

/// What a pilot found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found {
    /// How the class is stepped.
    pub rule: Rule,
    /// The class's error as a part of the target, at the percentile asked for, as predicted from the sample; the greatest, if there
    /// are several targets.
    pub part: f64,
    /// The target that has this error.
    pub worst: Target,
    /// The attitude error, rad, at that percentile.
    pub attitude: f64,
    /// Number of bodies in the sample.
    pub bodies: usize,
    /// For how long they were followed, s.
    pub span: f64,
    /// Their steps over the whole span, including rejected attempts, if they chose them.
    pub steps: Option<Spread>,
}

/// A class's bodies and what is asked of them.
pub(super) struct Pilot<'a> {
    pub scene: &'a Scene,
    pub accuracy: &'a Accuracy,
    pub costs: &'a Costs,
    /// The times at which the class's steps end.
    pub times: &'a Times,
    pub torques: &'a [Torque],
    /// Which of the scene's torques act.
    pub set: TorqueSet,
    /// The cost of a step under them.
    pub work: &'a Work,
    pub precision: Option<Precision>,
    /// Whether the engine forms Taylor series.
    pub forms_series: bool,
    /// Bodies of the class.
    pub all: usize,
    /// The sample, each body with its classification.
    pub bodies: Vec<(u32, Classification)>,
    /// The mean rate of the class's bodies as a multiple of that of the sample, if one of these was chosen for its speed; else 1.
    pub typical: f64,
    /// The greatest rate, rad/s, of bodies that are followed.
    pub fastest: f64,
    /// How long the sample is followed, s.
    pub span: f64,
    /// If that is not the whole span: how many times as great errors are at the end of the whole one, if measured.
    pub growth: Option<f64>,
    /// Steps that the reference may take, and that any one body may take.
    pub most_steps: f64,
    pub most_of_body: f64,
    /// How many times as many steps a short time predicts as bodies take, if damping slows them down ([`probe`]); else 1.
    pub slowing: f64,
    /// Whether the probe had to be cut short.
    pub is_cut: bool,
    /// Whether there is an alternative if this pilot finds nothing.
    pub is_brief: bool,
    /// Whether a larger sample may be tried if this one does not show enough.
    pub has_more: bool,
    /// The factor by which the bodies err more in adaptive steps than those of the shipped table.
    pub difficulty: f64,
    /// The factor on the errors of a small sample: [`HEAVIER`], or more where torques change fast ([`probe`]).
    pub tail: f64,
    /// What more bodies show in loose steps.
    pub survey: Option<Survey>,
    /// The time limit of all pilots, and the most that those after this one may take, in seconds of the table.
    pub limit: &'a TimeLimit,
    pub later: f64,
}

/// A result, and the error of the sample itself as a part of the target, without the margin for what the sample does not show.
pub(super) struct Tried {
    pub found: Found,
    pub shown: f64,
}

impl Found {
    /// The result for a rule that the table gives, without a trial.
    fn untried(rule: Rule) -> Self {
        Self { rule, part: 1.0, worst: Target::Attitude, attitude: rule.attitude, bodies: 0, span: 0.0, steps: None }
    }

    fn misses(&self) -> bool {
        self.part > 1.0
    }
}

/// How fast the bodies of a class turn ([`Pilot::fast`]).
struct Fast {
    /// The body whose rate is at the percentile asked for.
    body: (u32, Classification),
    /// The mean rate of the bodies that are followed, rad/s.
    mean: f64,
    /// The greatest rate that is followed, rad/s.
    fastest: f64,
    /// The part of the class that turns faster.
    beyond: f64,
    /// The mean rate of the class as a multiple of that of the bodies that are followed.
    factor: f64,
}

/// The greatest angle, rad, that a body may turn for a pilot to follow it.
const MOST_RADIANS: f64 = 1e15;
const TOO_FAR: &str = "bodies turn by more than 1e15 rad, which no steps follow: use a shorter span (s)";
const TOO_MANY_STEPS: &str = "a body would take more than 1e12 steps, which no run finishes: use a shorter span (s)";

/// The seed that selects the pilots' bodies; fixed, so that a plan made again is the same.
const SEED: u64 = 1;

/// The 99th percentile of the rates that a sample suggests, rad/s, if their logarithms are normal; at least the greatest of the sample.
fn expected_rate(bodies: &[(u32, Classification)]) -> f64 {
    let rates = || bodies.iter().map(|(_, classification)| classification.rate);
    let logarithms: Vec<f64> = rates().filter(|rate| *rate > 0.0).map(f64::ln).collect();
    let count = logarithms.len() as f64;
    let mean = logarithms.iter().sum::<f64>() / count;
    let squares: f64 = logarithms.iter().map(|logarithm| (logarithm - mean).powi(2)).sum();
    let expected = (mean + NORMAL_99 * (squares / (count - 1.0)).sqrt()).exp();
    // `max` takes the number if the other is NaN.
    rates().fold(0.0, f64::max).max(expected)
}

fn mean_rate(bodies: &[(u32, Classification)]) -> f64 {
    bodies.iter().map(|(_, classification)| classification.rate).sum::<f64>() / bodies.len() as f64
}

impl<'a> Pilot<'a> {
    /// The pilot with some bodies of its class, drawn evenly. If the `fast` one turns much faster than their rates let expect, it takes the
    /// place of the slowest: a minority of fast bodies errs most, and the percentile asked for may be theirs.
    fn of(
        self,
        (class, fast, mean): (&[u32], (u32, Classification), f64),
        count: usize,
        classification: impl Fn(u32) -> Classification,
    ) -> Self {
        let drawn = sample(class.len(), count.min(class.len()), SEED);
        let with_rate = drawn.into_iter().map(|index| class[index as usize]).map(|body| (body, classification(body)));
        let mut bodies: Vec<(u32, Classification)> = with_rate.filter(|body| self.follows(body)).collect();
        if FASTER * expected_rate(&bodies) < fast.1.rate
            && let Some(slowest) = bodies.iter_mut().min_by(|a, b| a.1.rate.total_cmp(&b.1.rate))
        {
            *slowest = fast;
            bodies.sort_unstable_by_key(|(body, _)| *body);
            let typical = mean / mean_rate(&bodies);
            return Self { bodies, typical, ..self };
        }
        Self { bodies, typical: 1.0, ..self }
    }

    /// Whether a body may be part of the sample.
    fn follows(&self, (_, classification): &(u32, Classification)) -> bool {
        classification.rate <= self.fastest
    }

    /// How fast some bodies of a class turn, and which are to be followed.
    fn fast(&self, class: &[u32], classification: impl Fn(u32) -> Classification) -> Fast {
        let drawn = sample(class.len(), class.len().min(MOST_COMPARED), SEED).into_iter();
        let mut all: Vec<_> =
            drawn.map(|index| class[index as usize]).map(|body| (body, classification(body))).collect();
        all.sort_unstable_by(|a, b| a.1.rate.total_cmp(&b.1.rate));
        let (part, count) = (0.01 * self.accuracy.percentile, all.len());
        let body = all[((part * count as f64).ceil() as usize).clamp(1, count) - 1];
        let limit = FASTER * body.1.rate;
        let followed = all.partition_point(|(_, classification)| classification.rate <= limit);
        let beyond = (count - followed) as f64 / count as f64;
        if beyond == 0.0 || beyond > MOST_LEFT_OUT * (1.0 - part) {
            return Fast { body, mean: mean_rate(&all), fastest: f64::INFINITY, beyond: 0.0, factor: 1.0 };
        }
        let mean = mean_rate(&all[..followed]);
        Fast { body, mean, fastest: limit, beyond, factor: mean_rate(&all) / mean }
    }

    /// Number of bodies that the percentile asked for needs.
    fn enough(&self) -> usize {
        let part = 0.01 * self.accuracy.percentile;
        (self.all / ONE_IN).clamp(ENOUGH_BODIES, MOST_BODIES).max(least_sample(part)).min(self.all)
    }

    /// The cheapest rule that meets the target; the most accurate where none does.
    pub fn calibrate(self, class: &[u32], classification: impl Fn(u32) -> Classification) -> Result<Found> {
        let fast = self.fast(class, &classification);
        // Of the bodies that are not left out, fewer may exceed the errors asked for.
        let left_out = 100.0 - self.accuracy.percentile - 100.0 * fast.beyond;
        let of_followed = Accuracy { percentile: 100.0 - left_out / (1.0 - fast.beyond), ..*self.accuracy };
        let accuracy = if fast.beyond > 0.0 { &of_followed } else { self.accuracy };
        let pilot = Pilot { accuracy, fastest: fast.fastest, ..self };
        let found = pilot.calibrated((class, fast.body, fast.mean), classification)?;
        // Faster bodies take as many more steps.
        let of_class = |steps: Spread| Spread { total: (fast.factor * steps.total as f64) as u64, ..steps };
        Ok(Found { steps: found.steps.map(of_class), ..found })
    }

    fn calibrated(
        mut self,
        from: (&[u32], (u32, Classification), f64),
        classification: impl Fn(u32) -> Classification,
    ) -> Result<Found> {
        let (class, ..) = from;
        self = self.of(from, LEAST_BODIES, &classification);
        if self.bodies.iter().any(|(_, classification)| classification.rate * self.span > MOST_RADIANS) {
            return Err(Error::Setting { field: "time.end", value: self.span, expected: TOO_FAR });
        }
        // A short time shows how many steps there will be; the whole span shows how much they err.
        let fastest = self.bodies.iter().map(|(_, classification)| classification.rate).fold(0.0, f64::max);
        let mut probe = self.short_probe(self.span.min(PROBED_ANGLE / fastest))?;
        self.is_cut = probe.is_cut;
        // What a probe that was cut short shows may be a transient.
        if probe.steps > MOST_STEPS_OF_RUN && !self.is_cut {
            return Err(Error::Setting { field: "time.end", value: self.span, expected: TOO_MANY_STEPS });
        }
        let (all, motions) = (self.all as f64, (1 + self.torques.len()) as f64);
        let most = match (self.is_brief, self.is_cut) {
            (true, _) => MOST_BRIEF,
            (false, true) => MOST_AFTER_CUT,
            (false, false) => MOST_STEPS,
        };
        (self.difficulty, self.tail) = (probe.difficulty, probe.tail);
        // What a body costs in steps of the probe: its own, and its changes, each of which ends a step.
        let (changes, by_series) = (self.changes(), self.part_of_series());
        let in_run = |steps: f64| CHANGE_IN_RUN.mul_add(changes.min(steps), by_series * steps);
        let in_pilot = |steps: f64| CHANGE.mul_add(changes.min(steps), by_series * steps);
        let of_budget = |share: f64, free: f64, steps: f64| {
            (share * in_run(steps) * all).max(free / motions).min(by_series * most) / PASSES / in_pilot(steps)
        };
        let part = |steps: f64| of_budget(SHARE, FREE_STEPS, steps);
        // Where series are cheaper, what may always be taken is counted in time for the span, and in steps for what goes beyond it.
        let part_in_steps = |steps: f64| of_budget(SHARE, by_series * FREE_STEPS, steps);
        let is_affordable = part_in_steps(probe.steps) > (4 * LEAST_BODIES) as f64;
        if is_affordable || self.slows_down(&probe)? {
            self.most_of_body = (UNEXPECTED * probe.steps).clamp(PROBED_STEPS, MOST_OF_BODY);
            let whole = self.probe(self.span)?;
            if whole.unfinished == 0 {
                self.slowing = self.slowing(&probe, &whole);
                probe = whole;
            }
        }
        let steps = probe.steps;
        (self.difficulty, self.tail) = (probe.difficulty, probe.tail);
        let enough = self.enough();
        let count = of_budget(SHARE_OF_BODIES, by_series * FREE_STEPS_OF_BODIES, steps) as usize;
        let count = count.clamp(LEAST_BODIES, enough.max(LEAST_BODIES));
        let are_few = count < self.needed().min(LEAST_UNSURVEYED);
        let is_surveyed = are_few && !self.is_brief && self.surveying_scheme().is_some();
        self = self.of(from, if is_surveyed { count.min(MOST_SURVEYED) } else { count }, &classification);
        // A part of the span of bodies that slow down would not show how many steps the rest takes.
        let followed = self.bodies.len() as f64;
        let is_whole = self.slowing > 1.0 && PASSES * in_pilot(steps) * followed <= MOST_SLOWED;
        let affordable = if is_whole { part(steps).max(followed) } else { part(steps) };
        let shorter = (affordable / followed).min(1.0);
        self.span *= shorter;
        self.most_steps = MOST_BUDGETS * PASSES * part_in_steps(steps).max(by_series * affordable) * steps;
        self.most_of_body = (UNEXPECTED * steps * shorter).clamp(PROBED_STEPS, MOST_OF_BODY);
        let most = |pilot: &Self| (MOST_OF_CANDIDATES + EARLY.iter().sum::<f64>()) * pilot.most_seconds();
        let all_steps = MOST_BUDGETS * PASSES * steps * enough as f64;
        let is_little = PASSES * in_pilot(steps) * enough as f64 <= MOST_OF_MORE;
        self.has_more = self.bodies.len() < enough && !self.is_brief && !self.is_cut && is_little;
        let more = if self.has_more { all_steps / self.most_steps * most(&self) } else { 0.0 };
        let of_growth = 2.0 * LEAST_BODIES as f64 * in_pilot(steps);
        let grows = shorter < 1.0 && !self.is_brief && !self.is_cut && of_growth <= by_series * MOST_OF_GROWTH;
        let growth = if grows { of_growth / self.most_steps * self.most_seconds() } else { 0.0 };
        self.limit.expect(most(&self) + more + growth + self.later);
        if shorter < 1.0 {
            if let Some(found) = self.lost_early()? {
                return Ok(found);
            }
            self.growth = if grows { self.measured_growth(steps)? } else { None };
        }
        let difficulty = self.difficulty;
        let with = |pilot: Self, survey: Option<Survey>| {
            let excess = survey.map_or(1.0, |survey| survey.excess);
            Self { survey, difficulty: (excess * difficulty).min(MOST_DIFFICULTY), ..pilot }
        };
        if is_surveyed {
            let survey = self.surveyed(class, &classification)?;
            self = with(self, survey);
        }
        let Tried { mut found, shown } = self.searched()?;
        if let Some(survey) = self.survey.filter(|_| found.misses()) {
            // More of the bodies that the sample does not have may show less of what is in the way.
            if self.has_more && shown <= ENOUGH && shorter == 1.0 && survey.bodies < enough {
                let survey = self.survey(class, &classification, enough, survey.steps)?;
                self = with(self, survey);
                found = self.searched()?.found;
            }
            self = with(self, None);
        }
        if !(found.misses() && self.has_more && shown <= ENOUGH) {
            return Ok(found);
        }
        // Only the margin for bodies or times that the sample does not show is in the way: a sample that needs none may do without it.
        let span = self.scene.end();
        self = Self { span, has_more: false, ..self.of(from, enough, classification) };
        self.most_steps = all_steps;
        self.most_of_body = (UNEXPECTED * steps).clamp(PROBED_STEPS, MOST_OF_BODY);
        Ok(self.searched()?.found)
    }

    /// The result where the reference loses all digits early in the span and cannot regain them: under torques that do not depend on
    /// the angular velocity the motion keeps the volume of phase space (J. Liouville, J. Math. Pures Appl. 3 (1838) 342), and motions that
    /// have parted do not converge again.
    fn lost_early(&self) -> Result<Option<Found>> {
        let keeps_volume = |torque: &Torque| {
            let is_held = torque.is_random() || torque.is_sampled();
            // Forces on a centre of mass that is part of the motion may remove energy.
            let acts_back = torque.is_coupled() && !is_carrier(torque);
            torque.leaves_rigid() && !is_held && !acts_back && !torque.needs().angular_velocity
        };
        if !self.torques.iter().all(keeps_volume) {
            return Ok(None);
        }
        for part in EARLY {
            let early = Self {
                bodies: self.bodies.clone(),
                span: part * self.span,
                most_steps: part * self.most_steps,
                most_of_body: (part * self.most_of_body).max(PROBED_STEPS),
                ..*self
            };
            let reference = Reference::new(&early)?;
            if let Some(lost) = reference.lost(&early).filter(|_| reference.is_saturated()) {
                return Ok(Some(lost.found));
            }
        }
        Ok(None)
    }

    /// The most time, s, that the pilot may take, known before anything was tried.
    pub fn most_ahead(&self) -> f64 {
        let cost = Cost::shipped(Scheme::ADAPTIVE_RK8);
        let tolerance = least_tolerance(Precision::F64);
        let probes = 2.0 * LEAST_BODIES as f64 * (2 + SHORTER_PROBES) as f64 * PROBED_STEPS;
        let steps = MOST_OF_CANDIDATES * MOST_BUDGETS * if self.is_brief { MOST_BRIEF } else { MOST_STEPS };
        (probes + steps) * self.work.step_seconds(cost, Precision::F64, tolerance)
    }

    /// The time, s, that a reference may take.
    pub fn most_seconds(&self) -> f64 {
        let cost = Cost::shipped(Scheme::ADAPTIVE_RK8);
        self.most_steps * self.step_seconds(&self.rule(cost, Some(Precision::F64)), cost, Precision::F64)
    }

    /// The factor on the sample's errors for the part of the span that it does not cover.
    fn unseen(&self) -> f64 {
        let longer = self.scene.end() / self.span;
        self.growth.filter(|_| longer > 1.0).unwrap_or_else(|| longer.powi(2))
    }

    /// How many times as great the errors of a few bodies, which take about as many `steps`, are at the end of the whole span as at the end of
    /// the pilot's, in steps at [`OF_GROWTH`]; at least as if they added up, and [`LOST`] where they amplify errors until nothing is left of the
    /// attitude. `None` if bodies may not choose their steps, or such steps do not show it.
    fn measured_growth(&self, steps: f64) -> Result<Option<f64>> {
        let series = Some(Scheme::TAYLOR).filter(|scheme| self.can_follow(*scheme));
        let Some(scheme) = series.or_else(|| self.probing_scheme()) else { return Ok(None) };
        // The fastest ones.
        let mut bodies = self.bodies.clone();
        bodies.sort_by(|a, b| b.1.rate.total_cmp(&a.1.rate));
        bodies.truncate(LEAST_BODIES);
        let most_of_body = (UNEXPECTED * steps).clamp(PROBED_STEPS, MOST_OF_BODY);
        let error = |span: f64| {
            let pilot = Self { bodies: bodies.clone(), span, most_of_body, ..*self };
            let [coarse, fine] = OF_GROWTH.map(|tolerance| pilot.stepped(&pilot.loose(scheme, tolerance)));
            Ok::<_, Error>(self.errors(&coarse?.states, &fine?.states).error_ratio(self.accuracy, self.all).attitude)
        };
        let (part, whole) = (error(self.span)?.max(f64::MIN_POSITIVE), error(self.scene.end())?);
        let longer = self.scene.end() / self.span;
        let is_lost = whole >= SATURATED;
        // Errors of such steps that grow no faster than without dissipation may be as great at the end.
        if is_lost && GROWS_MORE * part * longer.powi(2) >= SATURATED {
            return Ok(None);
        }
        Ok(Some(if is_lost { LOST } else { (GROWS_MORE * whole / part).clamp(longer, LOST) }))
    }

    /// The factor on the sample's errors for those that it does not show: the greater of what its own suggest and what a survey does.
    ///
    /// Errors of a motion without dissipation grow at most as the square of time, as a drift of the energy changes the rate at which
    /// bodies turn; a motion that amplifies errors may exceed that. If the sample is smaller than the percentile asks for, logarithms of
    /// errors are taken as normal, the greatest of n being √(2 ln n) standard deviations above the median (H. Cramér, *Mathematical
    /// Methods of Statistics*, 1946, section 28.6). As tails may be heavier than that, the error is multiplied by [`Pilot::tail`].
    pub fn margin(&self, errors: &mut Errors) -> f64 {
        let (span, needed) = (self.unseen(), self.needed());
        // Beyond the 99th percentile the greatest error is taken to grow with the square root of the number of bodies.
        let rarer = (needed as f64 / least_sample(0.99) as f64).sqrt().max(1.0);
        let of_others = |count: usize, spread: f64, tail: f64| {
            let beyond = ((needed as f64).ln() / (count.max(2) as f64).ln()).sqrt() - 1.0;
            if count >= needed { 1.0 } else { rarer * tail * spread.powf(beyond) }
        };
        let spread = errors.spread(NEGLIGIBLE_PART * self.accuracy.strictest());
        let own = of_others(self.bodies.len(), spread, self.tail);
        let of_survey = |survey: Survey| survey.excess * of_others(survey.bodies, survey.spread, HEAVIER);
        span * own.max(self.survey.map_or(1.0, of_survey))
    }

    /// The number of bodies that show the error at the percentile asked for.
    fn needed(&self) -> usize {
        least_sample(0.01 * self.accuracy.percentile).min(self.all)
    }
}
