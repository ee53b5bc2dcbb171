//! The sample of a run's bodies that is recomputed more accurately: how many there are, and what that takes.
//!
//! The number follows from what all parts of a study share: the resolution, how much dearer than average the drawn bodies are
//! ([`super::stratified`]) and the number of all bodies. All parts together thus recompute what one run does. For the same reason times are
//! those of the shipped table; only the predicted wall time is that of the bodies at hand.

use super::choice::Scheme;
use super::cost::Cost;
use super::cost::work::Work;
use super::group::{Group, Treatment};
use super::sampling::least_judged;
use super::stratified::{Rates, Stratified};
use super::{Plan, Resolution, greatest_rate, steps_over};
use crate::bodies::Ensemble;
use crate::engine::batch::frame_of;
use crate::kernel::method::Method;
use crate::kernel::method::rk8_adaptive::least_tolerance;
use crate::math::Precision;
use crate::scene::{AdaptiveSteps, Stepping};
use crate::torque::Torque;
use crate::torque::control::Schedule;

/// One body in this many is in the sample.
const ONE_IN: usize = 1000;
/// The fewest bodies in the sample, or all where there are fewer.
const LEAST_BODIES: usize = 64;
/// The most that a percentile can ask for; one that asks for more is not judged.
const MOST_JUDGED: usize = 20_000;
/// The fewest if they are drawn by their rates, provided that the usual sample has as many.
const LEAST_DRAWN: usize = 32;
/// Bodies drawn by their rates are reduced in number, so that they take no more than this many times the time of the usual sample, or this
/// part of the run's.
const PRICE_OF_DRAWN: f64 = 2.0;
const SHARE_OF_DRAWN: f64 = 0.02;
/// The fewest if recomputation would exceed its share: lanes that step one body step as many in the same time.
const LEAST_OF_DEAR: usize = 8;

/// What the sample may take: a part of the run's time, or half a second of one core.
const SHARE: f64 = 0.1;
const FREE_SECONDS: f64 = 0.5;

/// How many times as long as by the shipped table, which is that of many bodies, a step of `rk8` takes with the work of torques for few: a lane
/// group waits for its own results.
const OF_FEW: f64 = 8.0;

/// The time of finer series, as a multiple of that of the run's.
const OF_FINER_SERIES: f64 = 2.0;

/// Bodies of a sample of a run by series on which `rk8` tells the work of torques.
pub(crate) const WITH_WORK: usize = 16;

/// The ratio of equal to adaptive steps at which the equal ones are as fine where a body needs it most: for spins that differ by a factor
/// of two between start and end.
pub(crate) const EQUAL_FOR_ADAPTIVE: u64 = 2;
/// The average factor by which the number of steps grows because it is rounded up to a power of two.
const OF_POWERS: f64 = 1.5;

/// A method of this order or more is compared with `rk8` in finer steps; one of a lower order in its own steps, in which the error of `rk8`
/// is far smaller.
const HIGH_ORDER: u32 = 6;

/// The greatest angle, rad, by which a body turns in its first recomputed step: the error of `rk8` is then about 1e-10 a radian.
pub(crate) const REFERENCE_ANGLE: f64 = 0.5;

/// The most steps of a recomputation, as a multiple of the run's: a run whose steps leap over whole turns is not followed further.
pub(crate) const MOST_REFINEMENT: f64 = 64.0;

/// The greatest tolerance of a recomputation: with a greater one, steps may leap over what changes fast.
const GREATEST_TOLERANCE: f64 = 1e-7;

/// A tolerance must be less than the run's by this factor to say anything of the run's error.
const LEAST_REFINEMENT: f64 = 8.0;

/// Time of an evaluation, s, where the table has no row of a method.
pub(super) const EVALUATION: f64 = 3e-9;

/// How a run's bodies are recomputed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Recomputation {
    /// Number of recomputed bodies in the whole study.
    pub bodies: usize,
    /// Whether the work of torques on bodies with adaptive steps is integrated separately, in equal steps.
    pub balances: bool,
}

/// The time of one body, s of one core: in the run, recomputed, and for the work of torques where that is integrated separately.
#[derive(Clone, Copy, Debug)]
struct OfBody {
    run: f64,
    recomputed: f64,
    balance: f64,
    /// The most bodies on which the work of torques is integrated.
    balanced: usize,
}

/// Time to update what a sampled built-in torque holds for one body, s of one core, including reading and writing its columns.
pub(super) const CHANGE: f64 = 0.25e-6;
/// The time of one body from one such change to the next, beside that of its steps. The sample has few bodies, which share little of the time
/// to form the values and to start the steps anew (3.5 to 4.9 µs together for 8 to 64 bodies under `magnetorquers`).
const OF_CHANGE: OfBody = OfBody { run: CHANGE, recomputed: 2.5e-6, balance: 2.5e-6, balanced: usize::MAX };

impl OfBody {
    /// With so many changes of what sampled torques hold.
    fn with_changes(self, changes: f64) -> Self {
        let more = OF_CHANGE;
        Self {
            run: self.run + changes * more.run,
            recomputed: self.recomputed + changes * more.recomputed,
            balance: self.balance + changes * more.balance,
            balanced: self.balanced,
        }
    }
}

impl Recomputation {
    /// The recomputation of `all` bodies, each of which takes up to the given time, if known; those of the sample are dearer than average
    /// by `dearness`, and there are to be `judged` at least if that is not too dear.
    fn of(all: usize, known: Option<OfBody>, dearness: f64, judged: f64) -> Self {
        let judged = (judged.ceil() as usize).min(all);
        let judged = if judged <= MOST_JUDGED { judged } else { 0 };
        let usual = (all / ONE_IN).max(LEAST_BODIES).max(judged).min(all);
        let at_a_price = |bodies: f64| (bodies / dearness) as usize;
        let least = LEAST_DRAWN.min(usual);
        let known = known.filter(|_| all > 0);
        let Some(OfBody { run, recomputed, balance, balanced }) = known else {
            return Self { bodies: at_a_price(PRICE_OF_DRAWN * usual as f64).clamp(least, usual), balances: true };
        };
        let worth = (SHARE_OF_DRAWN * all as f64 * run / recomputed).max(PRICE_OF_DRAWN * usual as f64);
        let usual = at_a_price(worth).clamp(least, usual);
        let (recomputed, balance) = (dearness * recomputed, dearness * balance);
        let most = (SHARE * all as f64 * run).max(FREE_SECONDS);
        let within = |bodies: f64| (bodies as usize).clamp(LEAST_OF_DEAR.min(all), usual);
        // The work of torques on all of them, or on a number that does not depend on theirs.
        let (of_each, of_some) =
            if usual <= balanced { (recomputed + balance, 0.0) } else { (recomputed, balanced as f64 * balance) };
        let with_balance = within((most - of_some) / of_each);
        let balances = with_balance as f64 * of_each + of_some <= most;
        Self { bodies: if balances { with_balance } else { within(most / recomputed) }, balances }
    }
}

/// Adaptive steps of `rk8` in `f64` at a part of the run's tolerance, or at the least there is, so that their error is far below the run's.
/// Taylor series err less at the same tolerance (for heavy tops over ten turns, by a factor of 200), and keep to it even where torques
/// change much faster than bodies turn, where `rk8` leaps over whole periods.
pub(crate) fn finer(method: Method, steps: &AdaptiveSteps) -> AdaptiveSteps {
    let (part, greatest) = if method == Method::Taylor { (1e-3, 1e-10) } else { (1e-2, GREATEST_TOLERANCE) };
    let tolerance = (part * steps.tolerance).clamp(least_tolerance(Precision::F64), greatest);
    AdaptiveSteps { tolerance, least_step: None }
}

/// The method that follows bodies again in adaptive steps: `rk8`, or Taylor series if centres of mass are part of the motion, and where formulas
/// decide between cases ([`is_piecewise`]). Under sampled torques every step ends at a sample, at any tolerance, so that `rk8` would reproduce a
/// run by `rk8` to the bit; such a run is recomputed by Taylor series.
pub(crate) fn recomputing_method(torques: &[Torque], ensemble: &Ensemble, of_run: Option<Method>) -> Method {
    if torques.iter().any(Torque::is_coupled) || is_piecewise(torques, ensemble) {
        return Method::Taylor;
    }
    let ends_at_samples = torques.iter().any(Torque::is_sampled) && !torques.iter().any(Torque::is_random);
    if ends_at_samples && of_run != Some(Method::Taylor) { Method::Taylor } else { Method::Rk8 }
}

/// Whether formulas decide between cases, so that torques have kinks or jumps. Series end their steps there; `rk8` takes tiny steps or, without
/// an error estimate, loses its order.
pub(crate) fn is_piecewise(torques: &[Torque], ensemble: &Ensemble) -> bool {
    let is_another = |torque: &Torque| torque.is_random() || torque.is_coupled();
    !torques.iter().any(is_another) && Work::of(torques, ensemble).is_piecewise()
}

/// Whether bodies of a run by this method are recomputed in finer series, and the work of torques on some of them is integrated apart: by series,
/// under torques that are neither sampled nor act on centres of mass.
pub(crate) fn by_series_alone(torques: &[Torque], method: Method) -> bool {
    method == Method::Taylor && !torques.iter().any(|torque| torque.is_sampled() || torque.is_coupled())
}

/// Whether bodies of a run by this method and these steps are recomputed together with the work of torques on them, in adaptive steps of
/// `rk8`. Otherwise the work takes equal steps of its own: that of sampled torques, and where no adaptive steps are finer than the run's.
pub(crate) fn recomputes_at_once(torques: &[Torque], (method, steps): (Method, &AdaptiveSteps)) -> bool {
    let is_plain = !torques.iter().any(|torque| torque.is_sampled() || torque.is_coupled());
    is_plain && is_finer(&finer(method, steps), steps)
}

/// Of a body that would take fewer steps of its own than this for each interval between the times at which they must end, most are cut.
const CUT: f64 = 2.0;

/// Whether a run's steps by `method` are cut by the times at which they end, rather than chosen by their tolerance: then they err much less than
/// that allows, and only the strictest steps err less still.
pub(crate) fn are_cut(plan: &Plan<'_>, (method, steps): (Method, &AdaptiveSteps), rate: f64) -> bool {
    let angle = Scheme::angle_of_attempt(Scheme::Adaptive(method), steps.tolerance);
    rate * plan.scene().end() < CUT * angle * plan.ends_of_steps(method).len() as f64
}

/// Whether the finer steps are fine enough to compare with: near the least tolerance there are none.
pub(crate) fn is_finer(fine: &AdaptiveSteps, steps: &AdaptiveSteps) -> bool {
    LEAST_REFINEMENT * fine.tolerance <= steps.tolerance
}

/// The factor by which the steps of `rk8` are first made shorter than the run's equal ones, before each body's own rate is considered.
pub(crate) fn shorter_by(method: Method) -> f64 {
    if method.order() >= HIGH_ORDER { 2.0 } else { 1.0 }
}

/// Attempts of adaptive `rk8` at tolerance `fine` for each attempt of `method` at `tolerance`.
fn attempts_for_one(method: Method, tolerance: f64, fine: f64) -> f64 {
    let angle = |scheme, tolerance| Scheme::angle_of_attempt(scheme, tolerance);
    angle(Scheme::Adaptive(method), tolerance) / angle(Scheme::ADAPTIVE_RK8, fine)
}

impl Plan<'_> {
    /// How a sample of its bodies is recomputed.
    pub(crate) fn recomputation(&self) -> Recomputation {
        let alone = self.alone();
        let known = self.dearest().map(|of_body| OfBody {
            recomputed: alone * of_body.recomputed,
            balance: alone * of_body.balance,
            ..of_body
        });
        let all = self.scene().part().of;
        match self.scene().wanted_recomputed() {
            Some(bodies) if bodies > 0 => Recomputation { bodies: bodies.min(all), balances: true },
            _ => Recomputation::of(all, known, self.sample.dearness, self.least_judged()),
        }
    }

    /// The fewest bodies from which the percentile asked for can be judged.
    fn least_judged(&self) -> f64 {
        match self.scene().stepping() {
            Stepping::Accuracy(accuracy) => least_judged(0.01 * accuracy.percentile),
            Stepping::Statistics(_) | Stepping::Pinned { .. } | Stepping::Adaptive { .. } => 0.0,
        }
    }

    /// Whether any bodies are recomputed. If not, the sample still shows the drift of runs whose states are not read.
    pub(crate) fn recomputes(&self) -> bool {
        self.scene().wanted_recomputed() != Some(0)
    }

    /// Draws the bodies to be recomputed, for a whole scene: by their rates, unless states are not read (the drift is then that of the same
    /// bodies), statistics and events are asked for (whose errors are those of an even sample), or the percentile needs many bodies.
    pub(super) fn draw_sample(&mut self) {
        let scene = self.scene();
        let is_even = self.leaves_states() || scene.observes() || self.least_judged() > 0.0;
        if scene.part().of != scene.ensemble().len() || is_even {
            return;
        }
        let Some(rates) = Rates::of(scene, self.groups()) else { return };
        self.sample.dearness = rates.dearness();
        self.sample.drawn = Some(rates.sampled(self.recomputation().bodies));
    }

    /// The recomputed bodies of the whole study, and how many bodies each stands for.
    pub(crate) fn sample(&self) -> Stratified {
        let evenly = || Stratified::evenly(self.scene().part().of, self.recomputation().bodies);
        self.sample.drawn.clone().unwrap_or_else(evenly)
    }

    /// The greatest factor by which a body takes longer if it has an end of its own, because an event may stop it: in some of the ways to
    /// recompute bodies it then has a lane group to itself.
    fn alone(&self) -> f64 {
        let shares_lanes = |group: &Group| match &group.treatment {
            Treatment::Adaptive { method, steps, .. } => recomputes_at_once(self.scene().torques(), (*method, steps)),
            treatment => treatment.precision_of_steps().is_none(),
        };
        if self.scene().stops() && !self.groups().iter().all(shares_lanes) { LEAST_OF_DEAR as f64 } else { 1.0 }
    }

    /// The time of a body of the dearest class, as far as the resolution and the samples of torques tell: the resolution does not for steps
    /// that follow each body's rate.
    fn dearest(&self) -> Option<OfBody> {
        let changes = self.changes();
        let only_changes = || OfBody { run: 0.0, recomputed: 0.0, balance: 0.0, balanced: usize::MAX };
        let of_steps = self.dearest_in_steps().or_else(|| (changes > 0.0).then(only_changes));
        of_steps.map(|of_body| of_body.with_changes(changes))
    }

    /// How often what sampled torques hold changes during the run.
    fn changes(&self) -> f64 {
        Schedule::of(self.scene().torques()).map_or(0.0, |schedule| schedule.changes_in(self.scene().end()))
    }

    fn dearest_in_steps(&self) -> Option<OfBody> {
        let shipped = |scheme| Cost::shipped(scheme).step_seconds(Precision::F64, false);
        let equal = shipped(Scheme::Equal(Method::Rk8));
        match self.resolution() {
            Resolution::Pinned { method, longest_step, .. } => {
                let all = 0..self.advance_times().len();
                let steps: f64 = all.map(|index| steps_over(self.span_before(index), *longest_step).steps as f64).sum();
                Some(OfBody {
                    run: steps * f64::from(method.properties().evaluations) * EVALUATION,
                    recomputed: OF_FEW * steps * shorter_by(*method) * equal,
                    balance: 0.0,
                    balanced: usize::MAX,
                })
            }
            Resolution::Adaptive { .. } => None,
            Resolution::Accuracy { stepped, .. } => {
                let torques = self.scene().torques();
                let at_once = |steps: &AdaptiveSteps, method| recomputes_at_once(torques, (method, steps));
                let of_class = |found: &super::Found| {
                    let Scheme::Adaptive(method) = found.rule.scheme else { return None };
                    let attempts = found.steps?.total as f64 / found.bodies.max(1) as f64;
                    let steps = AdaptiveSteps { tolerance: found.rule.tolerance(Precision::F64), least_step: None };
                    let fine = finer(method, &steps);
                    let run = attempts * shipped(found.rule.scheme);
                    let by_rk8 = OF_FEW * attempts * attempts_for_one(method, steps.tolerance, fine.tolerance);
                    if by_series_alone(torques, method) {
                        let balance = by_rk8 * shipped(Scheme::ADAPTIVE_RK8);
                        return Some(OfBody { run, recomputed: OF_FINER_SERIES * run, balance, balanced: WITH_WORK });
                    }
                    let apart = by_rk8 * OF_POWERS * EQUAL_FOR_ADAPTIVE as f64 * equal;
                    let (own, balance) = if !is_finer(&fine, &steps) {
                        (apart, 0.0)
                    } else if at_once(&steps, method) {
                        (0.0, 0.0)
                    } else {
                        (0.0, apart)
                    };
                    let recomputed = by_rk8 * shipped(Scheme::ADAPTIVE_RK8) + own;
                    Some(OfBody { run, recomputed, balance, balanced: usize::MAX })
                };
                let classes = stepped.iter().filter_map(|entry| of_class(&entry.found));
                classes.max_by(|a, b| a.recomputed.total_cmp(&b.recomputed))
            }
        }
    }

    /// The expected wall time of recomputing the sample, s, if known: its bodies are taken to be distributed over the groups as
    /// all bodies are.
    pub(super) fn recomputation_seconds<'w>(&self, work: impl Fn(&Group) -> Option<&'w Work>) -> Option<f64> {
        let sample = self.recomputation();
        let dearness = self.sample.dearness;
        let here = self.scene().ensemble().len().max(1) as f64;
        let mut seconds = 0.0;
        for group in self.groups() {
            if !group.class.is_driven() || group.treatment.precision_of_steps().is_none() {
                continue;
            }
            let share = sample.bodies as f64 * group.members.len() as f64 / here;
            seconds += dearness * self.alone() * share * self.seconds_of_recomputed(group, work(group)?, sample)?;
        }
        let at_once = sample.bodies.div_ceil(LEAST_OF_DEAR).clamp(1, rayon::current_num_threads());
        Some(seconds / at_once as f64)
    }

    /// The time to recompute one body of a group, s of one core.
    fn seconds_of_recomputed(&self, group: &Group, work: &Work, sample: Recomputation) -> Option<f64> {
        let balance = if sample.balances { OF_CHANGE.balance } else { 0.0 };
        let of_changes = self.changes() * (OF_CHANGE.recomputed + balance);
        Some(self.seconds_of_steps(group, work, sample)? + of_changes)
    }

    fn seconds_of_steps(&self, group: &Group, work: &Work, sample: Recomputation) -> Option<f64> {
        let Recomputation { bodies, balances } = sample;
        let of_step = |scheme, tolerance| work.step_seconds(Cost::shipped(scheme), Precision::F64, tolerance);
        let equal = OF_FEW * of_step(Scheme::Equal(Method::Rk8), 1.0);
        match group.treatment {
            Treatment::Adaptive { method, steps, .. } => {
                let found = self.found(group)?;
                let attempts = found.steps?.total as f64 / found.bodies.max(1) as f64;
                let fine = finer(method, &steps);
                let by_rk8 = attempts * attempts_for_one(method, steps.tolerance, fine.tolerance);
                let rk8 = OF_FEW * of_step(Scheme::ADAPTIVE_RK8, fine.tolerance);
                if by_series_alone(self.scene().torques(), method) {
                    let share = if balances { WITH_WORK.min(bodies) as f64 / bodies.max(1) as f64 } else { 0.0 };
                    let series = OF_FINER_SERIES * attempts * of_step(Scheme::TAYLOR, steps.tolerance);
                    return Some(series + share * by_rk8 * rk8);
                }
                let at_once = recomputes_at_once(self.scene().torques(), (method, &steps));
                let apart = match (balances && !at_once) || !is_finer(&fine, &steps) {
                    true => by_rk8 * OF_POWERS * EQUAL_FOR_ADAPTIVE as f64 * equal,
                    false => 0.0,
                };
                Some(by_rk8 * rk8 + apart)
            }
            Treatment::Stepped { method, longest_step, .. } => {
                let steps = self.steps_of(group) as f64 * shorter_by(method);
                let random = self.scene().torques().iter().any(Torque::is_random);
                let halvings = if random { 1.0 } else { self.halvings_of(group, longest_step / shorter_by(method)) };
                Some(steps * halvings * equal)
            }
            Treatment::RegularPrecession | Treatment::ClosedForm { .. } => Some(0.0),
        }
    }

    /// The factor by which steps of `step` s become shorter to follow the rate of a group's first body.
    fn halvings_of(&self, group: &Group, step: f64) -> f64 {
        let (scene, body) = (self.scene(), group.members.body(0));
        let frame = frame_of(scene.ensemble(), scene.torques(), body);
        let momentum = frame.angular_momentum_principal(scene.ensemble(), body);
        let turned = greatest_rate(scene, body, &frame, momentum) * step;
        (turned / REFERENCE_ANGLE).log2().ceil().exp2().clamp(1.0, MOST_REFINEMENT)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_as_large_as_a_tenth_of_the_run_or_half_a_second_allows() {
        let dearer = |all, (run, recomputed, balance), dearness| {
            let known = OfBody { run, recomputed, balance, balanced: usize::MAX };
            Recomputation::of(all, Some(known), dearness, 0.0)
        };
        let of = |all, run, recomputed, balance| dearer(all, (run, recomputed, balance), 1.0);
        let sample = |bodies, balances| Recomputation { bodies, balances };
        assert_eq!(Recomputation::of(1_000_000, None, 1.0, 0.0), sample(1000, true));
        assert_eq!(of(1_000_000, 1.0, 10.0, 10.0), sample(1000, true), "2e4 s of 1e6");
        assert_eq!(of(20, 1e-3, 1e-2, 1e-2), sample(20, true), "0.4 s");
        assert_eq!(of(1000, 1e-3, 2.5e-2, 2.5e-2), sample(10, true), "0.5 s, and a tenth of a second of the run");
        assert_eq!(of(10_000, 1.0, 10.0, 15.0), sample(40, true), "a tenth of 1e4 s");
        assert_eq!(of(20, 0.2, 0.04, 2.0), sample(12, false), "what torques do is left");
        assert_eq!(of(20, 0.2, 2.0, 2.0), sample(8, false), "no fewer than stand side by side");
        assert_eq!(of(3, 0.2, 2.0, 2.0), sample(3, false));
        let series = |balance| {
            let known = OfBody { run: 1e-3, recomputed: 1e-3, balance, balanced: WITH_WORK };
            Recomputation::of(1000, Some(known), 1.0, 0.0)
        };
        assert_eq!([2e-2, 2.997e-2, 4e-2].map(series), [sample(64, true), sample(20, true), sample(64, false)]);
        assert_eq!(of(0, 0.2, 2.0, 2.0), sample(0, true));
        // Bodies that take eight times as long as the average: as many as take twice the time of the usual sample, or a fiftieth of the
        // run.
        assert_eq!(dearer(1_000_000, (1.0, 10.0, 0.0), 8.0), sample(250, true));
        assert_eq!(dearer(100_000, (1e-6, 1e-5, 0.0), 5.0), sample(40, true), "what 200 would, 2 ms");
        assert_eq!(dearer(10_000, (1e-6, 1e-6, 0.0), 3.0), sample(64, true), "a fiftieth of 10 ms is worth 200");
        assert_eq!(dearer(1000, (1e-6, 1e-5, 0.0), 8.0), sample(32, true), "no fewer");
        assert_eq!(Recomputation::of(1_000_000, None, 4.0, 0.0), sample(500, true));
        assert_eq!(Recomputation::of(4000, None, 1.0, 639.5), sample(640, true), "the percentile needs more");
        assert_eq!(Recomputation::of(300, None, 1.0, f64::INFINITY), sample(300, true), "all");
        assert_eq!(Recomputation::of(1_000_000, None, 1.0, f64::INFINITY), sample(1000, true), "too many");
    }
}
