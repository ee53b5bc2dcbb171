//! The choice of steps where errors of statistics and event times are asked for.
//!
//! The first guess takes the error of a statistic for that of every body's attitude, for which a [`Pilot`] finds the cheapest steps. If no
//! steps keep attitudes that long, because the motion is chaotic, each body takes adaptive steps at a tolerance for which errors that only
//! add up, and are not amplified, would meet the target. Each body then moves as the equations say except for small kicks; these change its
//! attitude, but not a distribution that the motion itself has mixed.
//!
//! Either guess is then tried: some bodies are followed in the chosen steps and in much finer ones, and their statistics and event times
//! are compared ([`statistic_errors`]). As long as these differ, or may differ, by more than is asked for, steps are refined, unless
//! refining does not help because only the scatter of the sample is left of the difference.

use super::choice::{Classification, Rule, Scheme};
use super::cost::Cost;
use super::pilot::{Found, PROBED_STEPS, Pilot};
use super::sampled::{AtOnce, Followed};
use super::statistical::{SampleValues, StatisticError, compared_outputs, secant_time, statistic_errors, worst_times};
use super::stratified::{Stratified, for_statistics};
use crate::bodies::{BodyState, Ensemble};
use crate::error::{Error, Result};
use crate::kernel::method::Method;
use crate::math::Precision;
use crate::plan::sampling::sample;
use crate::scene::{Accuracy, QuantityEvaluator, Scene, StatisticalAccuracy, StatisticalTarget, Target};
use crate::torque::Torque;

/// The most bodies that are compared, as far as their steps fit in the budget; never fewer than the least, over the whole span.
const MOST_BODIES: usize = 300;
const LEAST_BODIES: usize = 16;
/// The number of steps that following them once may take: a part of those of all bodies, within these limits, some hundredths and some tenths
/// of a second of one core.
const SHARE: f64 = 0.1;
const FREE_STEPS: f64 = 3e4;
const MOST_STEPS: f64 = 2e5;
/// The steps of a body, as a multiple of those expected, beyond which it is given up.
const UNEXPECTED: f64 = 100.0;

/// How many of the bodies that were given up are followed further, and the attempts at steps after which one has no end in sight.
const MOST_ENDLESS: usize = 4;
const ENDLESS_ATTEMPTS: f64 = 1e5;

/// The most times at which events are looked for, beside the breaks.
const MOST_TIMES: usize = 256;

/// How much finer the steps of the comparison are, so that their own error does not count; and the least by which they have to be, so that a
/// comparison also serves for the next trial.
const FINER: f64 = 1e-3;
const LEAST_FINER: f64 = 1e-2;

/// The most refinements, the least and the greatest factor of each, and the part of the target that they aim at.
const REFINEMENTS: usize = 5;
const LEAST_REFINEMENT: f64 = 0.1;
const MOST_REFINEMENT: f64 = 1e-4;
const AIM: f64 = 0.3;

/// The most pilots of attitudes; each takes much more than the comparison after it.
pub(super) const PILOTS: f64 = (REFINEMENTS + 1) as f64;

/// The least attitude error, rad, that is asked of a pilot: none is known better.
const LEAST_STATE_ERROR: f64 = 1e-13;

/// The least error of a statistic, as a part of its scale: some units in the last place of a number.
const LEAST_ERROR: f64 = 1e-15;

/// A refinement that lowers the bound by less than this factor shows that the bound is no longer due to the integration.
const HELPS: f64 = 0.5;

/// The greatest relative change of kinetic energy, spin rate or angular momentum by rounding in `f32` in the closed form; its attitude
/// errors are below 9e-7 ([`super::CLOSED_FORM_F32`]).
const NARROW: f64 = 2e-6;

/// The part of a target that this may use up.
const NARROW_SHARE: f64 = 0.25;

/// The seed that selects the bodies; others than those of a run's own sample.
const SEED: u64 = 3;

/// A trial: the steps, the error of the integration in each statistic, and whether bodies were lost that finer steps keep.
struct Tried {
    found: Found,
    errors: Vec<StatisticError>,
    loses: bool,
}

impl Tried {
    /// The greatest ratio of a bound to the error asked for.
    fn bound(&self) -> f64 {
        let greatest = self.errors.iter().map(|error| error.bound() / error.wanted).fold(0.0, f64::max);
        if self.loses { f64::INFINITY } else { greatest }
    }

    fn is_missed(&self) -> bool {
        self.loses || self.errors.iter().any(StatisticError::is_missed)
    }
}

/// The steps of a class, and the errors of its statistics that result.
pub(super) fn choose(
    base: &Pilot<'_>,
    class: &[u32],
    classification: impl Fn(u32) -> Classification,
    wanted: &StatisticalAccuracy,
) -> Result<(Found, Vec<StatisticError>)> {
    if wanted.strictest() < LEAST_ERROR {
        let factor = LEAST_ERROR / wanted.strictest();
        return Err(out_of_reach(wanted, None, Some(factor), ROUNDING));
    }
    let mut state_error = wanted.strictest().clamp(LEAST_STATE_ERROR, 1.0);
    let (mut is_predictable, mut before) = (true, None::<Tried>);
    let (mut reference, mut known_steps) = (None::<StatisticalReference>, 0.0);
    for refinement in 0..=REFINEMENTS {
        let accuracy = Accuracy::attitude(state_error);
        let later = base.later + (REFINEMENTS - refinement) as f64 * base.most_ahead();
        let pilot = |accuracy| Pilot { accuracy, bodies: Vec::new(), later, ..*base };
        let calibrated = match is_predictable {
            true => Some(pilot(&accuracy).calibrate(class, &classification)?),
            false => None,
        };
        // As torques may force them, which the rates of bodies do not tell.
        let of_body = |found: &Found| found.steps.map_or(0.0, |steps| steps.total as f64 / found.bodies.max(1) as f64);
        known_steps = calibrated.as_ref().map_or(0.0, of_body).max(known_steps);
        let found = calibrated.filter(|found| found.part <= 1.0);
        // Other steps draw other random numbers, so that there is nothing to compare.
        if base.torques.iter().any(Torque::is_random) {
            return match found {
                Some(found) => Ok((found, Vec::new())),
                None => Err(out_of_reach(wanted, None, None, RANDOM)),
            };
        }
        is_predictable = found.is_some();
        let pilot = pilot(&accuracy);
        let fine = match reference.take().filter(|fine| FINER * fine.state_error <= LEAST_FINER * state_error) {
            Some(fine) => fine,
            None => StatisticalReference::new(&pilot, class, &classification, known_steps)?,
        };
        let tried = compared(&pilot, reference.insert(fine), found, wanted)?;
        let bound = tried.bound();
        let is_last = refinement == REFINEMENTS || state_error <= LEAST_STATE_ERROR;
        let (chosen, is_settled) = match before.take() {
            // Finer steps do not help: what is left is scatter, or rounding.
            Some(coarser) if !coarser.is_missed() && !tried.is_missed() && bound > HELPS * coarser.bound() => {
                (coarser, true)
            }
            _ => (tried, bound <= 1.0),
        };
        if is_settled || (is_last && !chosen.is_missed()) {
            return Ok((chosen.found, worst_times(chosen.errors)));
        }
        if is_last {
            return Err(out_of_reach(wanted, Some(&chosen), None, ROUNDING));
        }
        before = Some(chosen);
        state_error = (state_error * (AIM / bound).clamp(MOST_REFINEMENT, LEAST_REFINEMENT)).max(LEAST_STATE_ERROR);
    }
    // The last refinement has returned.
    Err(out_of_reach(wanted, None, None, ROUNDING))
}

const ENDLESS: &str = "some bodies would take steps without end, as where dry friction brings them to rest and the formula's torque \
                       jumps: smooth the jump (w / max(norm(w), small) for w / norm(w)), or name a method, a tolerance and the \
                       least_step at which such a body fails";
const RANDOM: &str = "a random torque is in the way: name a method and a step (accuracy.method, dt)";
const ROUNDING: &str = "rounding is in the way, or steps finer than planning may try: use a larger error, precision f64, or name a \
                        method and its steps (accuracy.method)";

/// The error for a target that is out of reach. `factor` replaces the measured ratio where nothing was tried.
fn out_of_reach(
    wanted: &StatisticalAccuracy,
    tried: Option<&Tried>,
    factor: Option<f64>,
    remedy: &'static str,
) -> Error {
    let ratio = |error: &&StatisticError| error.integration.abs() / error.wanted;
    let worst = tried.and_then(|tried| tried.errors.iter().max_by(|a, b| ratio(a).total_cmp(&ratio(b))));
    let strictest = wanted.targets().into_iter().filter_map(|(target, wanted)| Some((target, wanted?)));
    let strictest = strictest.min_by(|a, b| a.1.total_cmp(&b.1));
    let missed = worst.map(|error| error.target).or(strictest.map(|(target, _)| target));
    Error::StatisticsOutOfReach {
        target: wanted.to_string(),
        field: missed.unwrap_or(StatisticalTarget::Mean).key(),
        statistic: match (worst, missed) {
            (Some(worst), _) => worst.label(),
            (None, missed) => missed.unwrap_or(StatisticalTarget::Mean).name().to_owned(),
        },
        factor: match (worst, tried) {
            (_, Some(tried)) if tried.loses => Some(f64::INFINITY),
            (Some(worst), _) => Some(ratio(&worst)),
            (None, _) => factor,
        },
        remedy,
    }
}

/// A sample of bodies in steps that are much finer than those that keep a state error.
struct StatisticalReference {
    /// The sample, how long it is followed, s, and the most steps of a body.
    bodies: Vec<(u32, Classification)>,
    span: f64,
    most_of_body: f64,
    /// The times at which it is observed.
    times: Vec<f64>,
    state_error: f64,
    /// Its steps.
    rule: Rule,
    followed: Followed,
    values: SampleValues,
}

impl StatisticalReference {
    /// Draws the bodies and follows them; `known_steps` is the least number of steps that a body is known to take over the whole span.
    fn new(
        pilot: &Pilot<'_>,
        class: &[u32],
        classification: impl Fn(u32) -> Classification,
        known_steps: f64,
    ) -> Result<Self> {
        let of_class = (class.len(), &(|index: u32| class[index as usize]) as _);
        let sampled = |count: usize| for_statistics(pilot.scene, of_class, count, SEED);
        let drawn = |sampled: &Stratified| -> Vec<(u32, Classification)> {
            sampled.bodies.iter().map(|&body| (body, classification(body))).collect()
        };
        let state_error = pilot.accuracy.strictest();
        let precise = Accuracy::attitude(FINER * state_error);
        let few = Pilot { bodies: drawn(&sampled(LEAST_BODIES)), accuracy: &precise, ..*pilot };
        let steps = few.expected_steps(&few.local_rule(true)).max(known_steps);
        let budget = (SHARE * steps * class.len() as f64).clamp(FREE_STEPS, MOST_STEPS);
        let sampled = sampled(((budget / steps) as usize).clamp(LEAST_BODIES, MOST_BODIES));
        let bodies = drawn(&sampled);
        let part = (budget / (steps * bodies.len() as f64)).min(1.0);
        let span = part * pilot.scene.end();
        let most_of_body = (UNEXPECTED * part * steps).clamp(PROBED_STEPS, UNEXPECTED * MOST_STEPS);
        let pilot = Pilot { bodies: bodies.clone(), span, most_of_body, accuracy: &precise, ..*pilot };
        let times = pilot.followed_times();
        let rule = pilot.local_rule(true);
        let followed = pilot.followed(&rule, &times)?;
        let values = SampleValues { weights: sampled.weights, ..pilot.values(&followed, &times)? };
        Ok(Self { bodies, span, most_of_body, times, state_error, rule, followed, values })
    }
}

/// Tries the steps that were found, or those of a tolerance if none keep the attitude, on the reference's bodies.
fn compared(
    pilot: &Pilot<'_>,
    reference: &StatisticalReference,
    found: Option<Found>,
    wanted: &StatisticalAccuracy,
) -> Result<Tried> {
    let &StatisticalReference { ref bodies, span, most_of_body, ref times, .. } = reference;
    let pilot = Pilot { bodies: bodies.clone(), span, most_of_body, ..*pilot };
    let rule = found.map_or_else(|| pilot.local_rule(false), |found| found.rule);
    // In the reference's own steps there would be no difference, where chaos leaves nothing else.
    let is_same = rule.scheme == reference.rule.scheme && rule.adapts_like(&reference.rule, Precision::F64);
    let coarse = pilot.followed(&if is_same { rule.loosened() } else { rule }, times)?;
    let as_run = SampleValues { weights: reference.values.weights.clone(), ..pilot.values(&coarse, times)? };
    let loses = coarse.loses(&reference.followed);
    let given_up: Vec<u32> = coarse.times.last().map_or(Vec::new(), AtOnce::given_up);
    if !given_up.is_empty() && pilot.is_endless(&rule, &given_up)? {
        return Err(out_of_reach(wanted, None, Some(f64::INFINITY), ENDLESS));
    }
    let scene = pilot.scene;
    let samples = (&as_run, &reference.values);
    let mut errors = statistic_errors(scene, wanted, samples, (scene.ensemble().len(), scene.end()));
    // Steps cannot be chosen by quantities that no body has; the run reports them as not known.
    errors.retain(StatisticError::is_known);
    // An event that no body had for as long as they were followed may be had later.
    let is_vacuous = |error: &StatisticError| {
        error.target == StatisticalTarget::EventTime && error.bound() == 0.0 && error.sampling == 0.0
    };
    errors.retain(|error| span >= scene.end() || !is_vacuous(error));
    let part = errors.iter().map(|error| error.integration.abs() / error.wanted).fold(0.0, f64::max);
    let local = || Found {
        rule,
        part,
        worst: Target::Attitude,
        // The attitude is not known.
        attitude: std::f64::consts::PI,
        bodies: pilot.bodies.len(),
        span,
        steps: coarse.steps,
    };
    let found = found.unwrap_or_else(local);
    Ok(Tried { found: Found { span: span.min(found.span), ..found }, errors, loses })
}

impl Pilot<'_> {
    /// Steps by a tolerance at which errors that add up along the way, and are not amplified, meet the target; equal steps if bodies
    /// may not choose theirs. In `f64` if `is_precise`.
    fn local_rule(&self, is_precise: bool) -> Rule {
        let precision = if is_precise { None } else { self.precision }.or(Some(Precision::F64));
        let of_cost = |cost| {
            let rule = self.rule(cost, if cost.scheme == Scheme::TAYLOR { Some(Precision::F64) } else { precision });
            (rule, self.seconds_in_run(&rule, cost, None))
        };
        let adaptive = self.costs.rows().iter().filter(|cost| cost.scheme.is_adaptive() && self.allows(cost.scheme));
        let leaps = |rule: &Rule| self.may_leap(rule.scheme);
        let order = |a: &(Rule, f64), b: &(Rule, f64)| leaps(&a.0).cmp(&leaps(&b.0)).then(a.1.total_cmp(&b.1));
        let cheapest = adaptive.map(of_cost).min_by(order);
        cheapest.map_or_else(|| self.rule(Cost::shipped(Scheme::Equal(Method::Rk8)), precision), |(rule, _)| rule)
    }

    /// Whether a body that was given up takes steps without end, instead of failing where they come to nothing or arriving after all.
    fn is_endless(&self, rule: &Rule, given_up: &[u32]) -> Result<bool> {
        let bodies = self.bodies.iter().filter(|(body, _)| given_up.contains(body)).take(MOST_ENDLESS);
        let few = Pilot { bodies: bodies.copied().collect(), ..*self };
        let unexpected = UNEXPECTED * few.expected_steps(rule) * self.span / self.scene.end();
        few.exceeds(rule, unexpected.max(self.most_of_body).max(ENDLESS_ATTEMPTS) as u64)
    }

    /// Steps of a body over the whole span, on average.
    fn expected_steps(&self, rule: &Rule) -> f64 {
        let span = self.scene.end();
        let of_body = |(_, classification): &(u32, Classification)| match rule.scheme {
            Scheme::Adaptive(_) => rule.expected_attempts(Precision::F64, classification.rate * span),
            Scheme::Equal(_) => span / rule.longest_step(classification.rate, span),
        };
        let sum = self.bodies.iter().map(of_body).sum::<f64>() / self.bodies.len().max(1) as f64;
        if self.goes_beyond_outputs(rule.scheme) { sum } else { sum.max(self.times.all().len().min(MOST_TIMES) as f64) }
    }

    /// The times at which bodies are observed, within the span over which they are followed; all breaks are among them.
    fn followed_times(&self) -> Vec<f64> {
        let (all, breaks) = (self.times.all(), self.times.breaks());
        let kept = all.len().min(MOST_TIMES);
        let some = (1..=kept).map(|k| all[k * all.len() / kept - 1]);
        let mut times: Vec<f64> = some.chain(breaks.iter().copied()).filter(|&time| time < self.span).collect();
        times.sort_by(f64::total_cmp);
        times.dedup();
        times.push(self.span);
        times
    }

    /// Quantities and event times of the bodies, from their states at some times.
    fn values(&self, followed: &Followed, times: &[f64]) -> Result<SampleValues> {
        let observed = self.scene.observed();
        let quantities = observed.quantities();
        let evaluator = QuantityEvaluator::new(self.scene, &quantities)?;
        let bodies = || self.bodies.iter().map(|&(body, _)| body as usize);
        let value = |quantity: usize, body: usize, time: f64, at: &AtOnce| {
            at.of(body).map_or(f64::NAN, |state| evaluator.value(quantity, body, time, state))
        };
        let compared = compared_outputs(times.len());
        let at = |&place: &usize| {
            let of_quantity =
                |quantity| bodies().map(|body| value(quantity, body, times[place], &followed.times[place])).collect();
            (0..quantities.len()).map(of_quantity).collect()
        };
        let event_times = observed.events.iter().map(|event| {
            let number = quantities.iter().position(|other| other == event.quantity()).unwrap_or(0);
            let of_body = |body: usize| {
                let is_sound = followed.times.iter().all(|at| at.of(body).is_some());
                let start = (&initial_state(self.scene.ensemble(), body), followed.start.of(body));
                let later = times.iter().zip(&followed.times);
                let later = later.map(|(&time, at)| (time, value(number, body, time, at)));
                let points = std::iter::once((0.0, evaluator.value(number, body, 0.0, start))).chain(later);
                if is_sound { secant_time(event, points, self.span) } else { f64::NAN }
            };
            bodies().map(of_body).collect()
        });
        Ok(SampleValues {
            times: compared.iter().map(|&place| times[place]).collect(),
            values: compared.iter().map(at).collect(),
            event_times: event_times.collect(),
            ..SampleValues::default()
        })
    }
}

/// The state in which a body starts.
fn initial_state(ensemble: &Ensemble, body: usize) -> BodyState {
    let (orientation, omega) = (ensemble.orientation()[body], ensemble.angular_velocity_body()[body]);
    let momentum = ensemble.inertia()[body].to_matrix() * omega;
    BodyState {
        orientation,
        angular_velocity_body: omega,
        angular_momentum_world: orientation * momentum,
        kinetic_energy: 0.5 * omega.dot(momentum),
        norm_error: 0.0,
        status: crate::bodies::Status::Valid,
    }
}

/// Whether rounding in `f32` is far below the errors asked for. Considers kinetic energy, spin rate and angular momentum, whose spreads at
/// the start are known and whose relative errors are those of the closed form.
pub(super) fn allows_narrow(scene: &Scene, wanted: &StatisticalAccuracy) -> Result<bool> {
    if scene.plain_statistics().is_empty() {
        return Ok(false);
    }
    let quantities = scene.observed().quantities();
    let evaluator = QuantityEvaluator::new(scene, &quantities)?;
    let ensemble = scene.ensemble();
    let bodies = sample(ensemble.len(), MOST_BODIES.min(ensemble.len()), SEED);
    let is_wide = |quantity: usize| {
        let value =
            |&body: &u32| evaluator.value(quantity, body as usize, 0.0, (&initial_state(ensemble, body as usize), &[]));
        let values: Vec<f64> = bodies.iter().map(value).collect();
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let square = values.iter().map(|value| value * value).sum::<f64>() / count;
        let variance = values.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>() / count;
        NARROW * square.sqrt() <= NARROW_SHARE * wanted.strictest() * variance.sqrt()
    };
    Ok(!bodies.is_empty() && (0..quantities.len()).all(is_wide))
}
