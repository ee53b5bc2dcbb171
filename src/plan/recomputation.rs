//! The sample of a run's bodies that is recomputed more accurately: how many there are, and what that takes.
//!
//! The number follows from the time that the average body takes and from how much dearer the drawn bodies are ([`super::stratified`]). It is
//! part of the plan, so that all parts of a study together recompute what one run does. Times are those of the shipped table, so that a plan
//! that is made again is the same.

mod steps;

use super::choice::Scheme;
use super::cost::work::Work;
use super::cost::{COSTS, Cost};
use super::group::{Group, Treatment};
use super::sampling::least_judged;
use super::stratified::{Rates, SEED, Stratified};
use super::{Plan, Resolution, rate_of_body};
use crate::engine::EngineKind;
use crate::kernel::method::Method;
use crate::math::Precision;
use crate::scene::Stepping;
use crate::torque::Torque;
use crate::torque::control::Schedule;

use steps::{attempts_for_one, finer_by, is_finer, recomputing_method};
pub(crate) use steps::{finer, follows_by_series, has_finer, is_damped, is_piecewise, shorter_by, steps_of_series};

/// One body in this many is in the sample.
const ONE_IN: usize = 1000;
/// The fewest bodies in the sample, or all where there are fewer: of 64 the 99th percentile would be at best the second greatest.
const LEAST_BODIES: usize = 192;
/// The most that a percentile can ask for; one that asks for more is not judged.
const MOST_JUDGED: usize = 20_000;
/// The fewest if they are drawn by their rates, provided that the usual sample has as many.
const LEAST_DRAWN: usize = 96;
/// More bodies than the usual ones are in the sample as far as this part of the run's time goes. Bodies drawn by their rates are reduced in
/// number, so that they take no more time than the usual sample, or than this part.
const LITTLE: f64 = 0.02;
const MOST_FOR_LITTLE: usize = 4096;
/// The fewest if recomputation would exceed its share: lanes that step one body step as many in the same time.
const LEAST_OF_DEAR: usize = 8;

/// What the sample may take: a part of the run's time, or half a second of one core.
const SHARE: f64 = 0.1;
const FREE_SECONDS: f64 = 0.5;

/// What the search for unnoticed events may take: the same part, or a fifth of a second; and the time that it takes for a radian of a body's
/// motion, s of one core.
const FREE_SECONDS_OF_SEARCH: f64 = 0.2;
const SEARCH: f64 = 2e-5;
/// The greatest angle, rad, that is searched: some seconds of one core.
const MOST_SEARCHED: f64 = 131_072.0;

/// The fewest bodies on which statistics are compared, or all if there are fewer: what is left then is their scatter.
const LEAST_COMPARED: usize = 16;

/// How many times as long as by the shipped table, which is that of many bodies, a step of `rk8` takes with the work of torques for few: a lane
/// group waits for its own results.
const OF_FEW: f64 = 8.0;

/// The same of steps of the motion alone, by Taylor series or by `rk8`.
const OF_FEW_ALONE: f64 = 2.0;

/// Bodies of a sample on which `rk8` tells the work of torques, where series follow all.
pub(crate) const WITH_WORK: usize = 8;

/// The ratio of equal to adaptive steps at which the equal ones are as fine where a body needs it most: for spins that differ by a factor
/// of two between start and end.
pub(crate) const EQUAL_FOR_ADAPTIVE: u64 = 2;
/// The average factor by which the number of steps grows because it is rounded up to a power of two.
const OF_POWERS: f64 = 1.5;

/// The greatest angle, rad, by which a body turns in its first recomputed step: the error of `rk8` is then about 1e-10 a radian.
pub(crate) const REFERENCE_ANGLE: f64 = 0.5;

/// The most steps of a recomputation, as a multiple of the run's: a run whose steps leap over whole turns is not followed further.
pub(crate) const MOST_REFINEMENT: f64 = 64.0;

/// Of a body that takes fewer adaptive steps than this for each time at which they must end, most are cut there.
const CUT: f64 = 2.0;

/// Time of an evaluation, s, where the table has no row of a method.
pub(super) const EVALUATION: f64 = 3e-9;

/// How a run's bodies are recomputed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Recomputation {
    /// Number of recomputed bodies in the whole study.
    pub bodies: usize,
    /// Whether the work of torques on bodies with adaptive steps is integrated separately, in equal steps.
    pub balances: bool,
    /// The angle, rad, by which its bodies together turn while they are searched for unnoticed events, at most.
    pub searched: f64,
    /// Whether bodies of a run by adaptive `rk8` are followed by finer steps of this method, as series would take too long.
    pub by_rk8: bool,
}

/// The time of an average body, s of one core: in the run, recomputed, and for the work of torques where that is integrated separately.
#[derive(Clone, Copy, Debug, Default)]
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
/// to form the values and to start the steps anew (3.5 to 4.9 µs together with the steps for 8 to 64 bodies under `magnetorquers`).
const OF_CHANGE: OfBody = OfBody { run: CHANGE, recomputed: 1.2e-6, balance: 1.2e-6, balanced: usize::MAX };

impl OfBody {
    /// With another one's time, so many times.
    fn plus(self, other: Self, times: f64) -> Self {
        if times <= 0.0 {
            return self;
        }
        Self {
            run: self.run + times * other.run,
            recomputed: self.recomputed + times * other.recomputed,
            balance: self.balance + times * other.balance,
            balanced: self.balanced.max(other.balanced),
        }
    }

    /// The time to recompute so many bodies, dearer than the average by a factor; the work of torques is integrated on all of them, or on some
    /// that are not dearer.
    fn of_sample(&self, Recomputation { bodies, balances, .. }: Recomputation, dearness: f64) -> f64 {
        let balance = match balances {
            false => 0.0,
            true if bodies <= self.balanced => dearness * bodies as f64 * self.balance,
            true => self.balanced as f64 * self.balance,
        };
        dearness * bodies as f64 * self.recomputed + balance
    }
}

/// What decides on the number of bodies beside their times.
#[derive(Clone, Copy, Debug)]
struct Wanted {
    /// How much dearer than average the bodies of the sample are.
    dearness: f64,
    /// The number that the percentile needs, taken if it is not too dear.
    judged: f64,
    /// The part of the run's time for which more bodies than usual are recomputed.
    little: f64,
}

impl Recomputation {
    /// The recomputation of `all` bodies, which take the given time on average, if known.
    fn of(all: usize, known: Option<OfBody>, Wanted { dearness, judged, little }: Wanted) -> Self {
        let judged = (judged.ceil() as usize).min(all);
        let judged = if judged <= MOST_JUDGED { judged } else { 0 };
        let usual = (all / ONE_IN).max(LEAST_BODIES).max(judged).min(all);
        let at_a_price = |bodies: f64| (bodies / dearness) as usize;
        let least = LEAST_DRAWN.min(usual);
        let known = known.filter(|_| all > 0);
        let Some(OfBody { run, recomputed, balance, balanced }) = known else {
            let bodies = at_a_price(usual as f64).clamp(least, usual);
            return Self { bodies, balances: true, searched: MOST_SEARCHED, by_rk8: false };
        };
        let all_balanced = if balanced == usize::MAX { balance } else { 0.0 };
        let for_little = little * all as f64 * run / (recomputed + all_balanced);
        let for_little = at_a_price(for_little).min(MOST_FOR_LITTLE).min(all);
        let usual = at_a_price(usual as f64).clamp(least, usual).max(for_little);
        let recomputed = dearness * recomputed;
        let most = most_seconds(all, run);
        let within = |bodies: f64| (bodies as usize).clamp(LEAST_OF_DEAR.min(all), usual);
        // The work of torques on all of them, or on a number that does not depend on theirs.
        let (of_each, of_some) = if usual <= balanced {
            (recomputed + dearness * balance, 0.0)
        } else {
            (recomputed, balanced as f64 * balance)
        };
        let with_balance = within((most - of_some) / of_each);
        let balances = with_balance as f64 * of_each + of_some <= most;
        let searched = ((SHARE * all as f64 * run).max(FREE_SECONDS_OF_SEARCH) / SEARCH).min(MOST_SEARCHED);
        let bodies = if balances { with_balance } else { within(most / recomputed) };
        Self { bodies, balances, searched, by_rk8: false }
    }
}

/// What the recomputation of a sample may take, s of one core, after a run of `all` bodies that takes so long for each.
fn most_seconds(all: usize, run: f64) -> f64 {
    (SHARE * all as f64 * run).max(FREE_SECONDS)
}

impl Plan<'_> {
    /// How a sample of its bodies is recomputed, as many as the scene asks for or the plan has found.
    pub(crate) fn recomputation(&self) -> Recomputation {
        match self.scene().wanted_recomputed() {
            Some(bodies) if bodies > 0 => {
                let bodies = bodies.min(self.scene().part().of);
                Recomputation { bodies, balances: true, ..self.sample.recomputation }
            }
            _ => self.sample.recomputation,
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

    /// Decides how many bodies are recomputed and, for a whole scene, draws them: by their rates, unless errors of statistics and events alone
    /// are asked for, or the percentile needs many bodies.
    pub(super) fn draw_sample(&mut self) {
        let scene = self.scene();
        let all = scene.part().of;
        let is_even = matches!(scene.stepping(), Stepping::Statistics(_)) || self.least_judged() > 0.0;
        let by_rates = all == scene.ensemble().len() && !is_even;
        let rates = if by_rates || self.needs_rates() { Rates::of(scene, self.groups()) } else { None };
        let alone = self.alone();
        let of_rates = rates.as_ref().filter(|_| self.needs_rates());
        let known = |by_rk8: bool| {
            let OfBody { run, recomputed, balance, balanced } = self.average(of_rates, by_rk8)?;
            Some(OfBody { run, recomputed: alone * recomputed, balance: alone * balance, balanced })
        };
        let drawn = rates.as_ref().filter(|rates| by_rates && rates.differ());
        let (dearness, judged) = (drawn.map_or(1.0, Rates::dearness), self.least_judged());
        let by_series = known(false);
        // The time of a run on a GPU is not known here.
        let little = if self.engine.kind == EngineKind::Cpu { LITTLE } else { 0.0 };
        let wanted = Wanted { dearness, judged, little };
        let mut recomputation = Recomputation::of(all, by_series, wanted);
        if let Some(series) = by_series
            && recomputation.bodies as f64 * dearness * series.recomputed > most_seconds(all, series.run)
            && let Some(rk8) = known(true).filter(|rk8| rk8.recomputed < series.recomputed)
        {
            recomputation = Recomputation { by_rk8: true, ..Recomputation::of(all, Some(rk8), wanted) };
        }
        self.sample.recomputation = recomputation;
        let drawn = drawn.map(|rates| rates.sampled(self.recomputation().bodies, SEED));
        (self.sample.dearness, self.sample.drawn) = (dearness, drawn);
    }

    /// The recomputed bodies of the whole study, and how many bodies each stands for.
    pub(crate) fn sample(&self) -> Stratified {
        let evenly = || Stratified::evenly(self.scene().part().of, self.recomputation().bodies, SEED);
        self.sample.drawn.clone().unwrap_or_else(evenly)
    }

    /// The greatest factor by which a body takes longer if it has an end of its own, because an event may stop it: in some of the ways to
    /// recompute bodies it then has a lane group to itself.
    fn alone(&self) -> f64 {
        let shares_lanes =
            |group: &Group| group.treatment.precision_of_steps().is_none() || follows_by_series(self.scene().torques());
        if self.scene().stops() && !self.groups().iter().all(shares_lanes) { LEAST_OF_DEAR as f64 } else { 1.0 }
    }

    /// The expected wall time of recomputing the sample, s, if known: its bodies are taken to be distributed over the groups as
    /// all bodies are.
    pub(super) fn recomputation_seconds(&self) -> Option<f64> {
        let sample = self.recomputation();
        let rates = if self.needs_rates() { Rates::of(self.scene(), self.groups()) } else { None };
        let of_body = self.average(rates.as_ref(), sample.by_rk8)?;
        let seconds = self.alone() * of_body.of_sample(sample, self.sample.dearness);
        let at_once = sample.bodies.div_ceil(LEAST_OF_DEAR).clamp(1, rayon::current_num_threads());
        let search = if self.scene().wanted_events().is_empty() { 0.0 } else { SEARCH * sample.searched };
        Some((seconds + search) / at_once as f64)
    }

    /// The number of bodies, up to `usual`, on which statistics are compared without taking much longer than the run allows.
    pub(crate) fn compared_bodies(&self, usual: usize) -> usize {
        let rates = if self.needs_rates() { Rates::of(self.scene(), self.groups()) } else { None };
        let Some(OfBody { run, recomputed, .. }) = self.average(rates.as_ref(), self.recomputation().by_rk8) else {
            return usual;
        };
        let most = most_seconds(self.scene().ensemble().len(), run) / recomputed;
        (most as usize).max(LEAST_COMPARED).min(usual)
    }

    /// The finer steps of `rk8` that follow bodies of a group in place of series, if there are such and it `is_wanted`: for a run by `rk8`, under
    /// smooth torques.
    fn by_rk8(&self, group: &Group, is_wanted: bool) -> Option<Treatment> {
        let Treatment::Adaptive { method: method @ Method::Rk8, steps, .. } = group.treatment else { return None };
        let fine = finer(method, &steps);
        let is_smooth = || self.works.get(&group.class.torques).is_some_and(|work| !work.is_piecewise());
        let is_possible = || follows_by_series(&group.class.torques.of(self.scene().torques())) && is_smooth();
        let is_used = is_wanted && is_finer(&fine, &steps) && is_possible();
        is_used.then_some(Treatment::Adaptive { method, precision: Precision::F64, steps: fine })
    }

    /// The finer steps of `rk8` by which the sample of a group is recomputed in place of series, if it is.
    pub(crate) fn recomputed_by_rk8(&self, group: &Group) -> Option<Treatment> {
        self.by_rk8(group, self.recomputation().by_rk8)
    }

    /// The adaptive steps in which bodies of a group that is stepped are followed again under `torques`, those that act on it.
    pub(crate) fn recomputing_treatment(&self, group: &Group, torques: &[Torque]) -> Treatment {
        if let Some(by_rk8) = self.recomputed_by_rk8(group) {
            return by_rk8;
        }
        let method = recomputing_method(torques, self.scene().ensemble(), group.treatment.method());
        let steps = match group.treatment {
            Treatment::Adaptive { steps, .. } if !follows_by_series(torques) => finer_by(method, &steps),
            _ => steps_of_series(self.scene(), &group.treatment).0,
        };
        Treatment::Adaptive { method, precision: Precision::F64, steps }
    }

    /// Whether the plan knows how far bodies turn by their rates alone.
    fn needs_rates(&self) -> bool {
        !matches!(self.resolution(), Resolution::Accuracy { .. })
    }

    /// The time of the average body, if known; `rates` are those of the bodies where no pilot has followed any.
    fn average(&self, rates: Option<&Rates>, by_rk8: bool) -> Option<OfBody> {
        let here = self.scene().ensemble().len();
        let mut sum = OfBody::default();
        for group in self.groups() {
            let of_body = match group.treatment.precision_of_steps() {
                Some(precision) => {
                    self.of_body(group, precision, self.works.get(&group.class.torques)?, (rates, by_rk8))?
                }
                None => OfBody::default(),
            };
            // Bodies on which no torque acts are followed again by the closed form.
            let of_body =
                if group.class.is_driven() { of_body } else { OfBody { run: of_body.run, ..OfBody::default() } };
            let of_centre = self.centres.of_body(self.scene(), group, || self.steps_of(group));
            let of_body = OfBody {
                run: of_body.run + of_centre,
                recomputed: of_body.recomputed + self.centres.recomputed(of_centre),
                ..of_body
            };
            sum = sum.plus(of_body, group.members.len() as f64 / here as f64);
        }
        Some(sum.plus(OF_CHANGE, self.changes()))
    }

    /// How often what sampled torques hold changes during the run.
    fn changes(&self) -> f64 {
        Schedule::of(self.scene().torques()).map_or(0.0, |schedule| schedule.changes_in(self.scene().end()))
    }

    /// The time of a body of a group in steps.
    fn of_body(
        &self,
        group: &Group,
        precision: Precision,
        work: &Work,
        (rates, by_rk8_alone): (Option<&Rates>, bool),
    ) -> Option<OfBody> {
        let (torques, end, changes) = (self.scene().torques(), self.scene().end(), self.changes());
        let of_step = |scheme, tolerance| work.step_seconds(Cost::shipped(scheme), Precision::F64, tolerance);
        let equal = OF_FEW * of_step(Scheme::Equal(Method::Rk8), 1.0);
        let by_rk8 = |radians: f64, tolerance: f64| {
            let attempts = radians / Scheme::angle_of_attempt(Scheme::ADAPTIVE_RK8, tolerance);
            OF_FEW * attempts * of_step(Scheme::ADAPTIVE_RK8, tolerance)
        };
        let rate = rates.map_or(group.rate, Rates::mean);
        let (radians, run, by_equal_steps) = match group.treatment {
            Treatment::Adaptive { method, steps, .. } => {
                let scheme = Scheme::Adaptive(method);
                let angle = Scheme::angle_of_attempt(scheme, steps.tolerance);
                let ends = self.ends_of_steps(method).len() as f64 + changes;
                let attempts = match self.found(group) {
                    Some(found) => found.steps?.total as f64 / found.bodies.max(1) as f64,
                    None => (rates?.mean() * end / angle).max(ends),
                };
                let run = attempts * work.step_seconds(Cost::shipped(scheme), precision, steps.tolerance);
                let fine = finer(method, &steps);
                let attempts_of_rk8 = attempts * attempts_for_one(method, steps.tolerance, fine.tolerance);
                let by_equal_steps = attempts_of_rk8 * OF_POWERS * EQUAL_FOR_ADAPTIVE as f64 * equal;
                let uncut = attempts * angle;
                (if attempts < CUT * ends { uncut.min(rate * end) } else { uncut }, run, by_equal_steps)
            }
            Treatment::Stepped { method, longest_step, .. } => {
                let (steps, scheme) = (self.steps_of(group) as f64, Scheme::Equal(method));
                let rough = || f64::from(method.properties().evaluations) * EVALUATION;
                let own = COSTS.iter().find(|cost| cost.scheme == scheme);
                let of_run = own.map_or_else(rough, |cost| work.step_seconds(cost, precision, 1.0));
                let random = torques.iter().any(Torque::is_random);
                let halvings = if random { 1.0 } else { self.halvings_of(group, longest_step / shorter_by(method)) };
                (rate * end, steps * of_run, steps * shorter_by(method) * halvings * equal)
            }
            Treatment::RegularPrecession | Treatment::ClosedForm { .. } => return None,
        };
        let by_series = |attempts: f64, tolerance: f64| OF_FEW_ALONE * attempts * of_step(Scheme::TAYLOR, tolerance);
        if follows_by_series(torques) {
            let (steps, of_rk8) = steps_of_series(self.scene(), &group.treatment);
            let of_run = match group.treatment {
                Treatment::Adaptive { .. } => by_rk8(radians, of_rk8.tolerance),
                _ => by_equal_steps,
            };
            if let Some(Treatment::Adaptive { steps, .. }) = self.by_rk8(group, by_rk8_alone) {
                // Those that show events end at outputs too.
                let ends = if self.scene().observes() { self.advance_times().len() as f64 } else { 0.0 };
                let attempts = radians / Scheme::angle_of_attempt(Scheme::ADAPTIVE_RK8, steps.tolerance);
                let recomputed = OF_FEW_ALONE * attempts.max(ends) * of_step(Scheme::ADAPTIVE_RK8, steps.tolerance);
                return Some(OfBody { run, recomputed, balance: of_run, balanced: WITH_WORK });
            }
            if is_damped(self.scene(), torques, group.members.body(0), &group.treatment) {
                return Some(OfBody { run, recomputed: of_run, balance: 0.0, balanced: usize::MAX });
            }
            let attempts = radians / Scheme::angle_of_attempt(Scheme::TAYLOR, steps.tolerance);
            // Those of a run by series end where the run's do.
            let ends =
                if group.treatment.method() == Some(Method::Taylor) { self.ends_of_steps(Method::Taylor) } else { &[] };
            let recomputed = by_series(attempts.max(ends.len() as f64), steps.tolerance);
            return Some(OfBody { run, recomputed, balance: of_run, balanced: WITH_WORK });
        }
        let (recomputed, balance) = match group.treatment {
            Treatment::Adaptive { method, steps, .. } => {
                let by = recomputing_method(torques, self.scene().ensemble(), Some(method));
                // Series alone follow these: the work of torques is not integrated.
                let is_alone = torques.iter().any(Torque::is_coupled) || work.is_piecewise();
                let balance = if is_alone { 0.0 } else { by_equal_steps };
                let fine = finer_by(by, &steps);
                // Between samples, at whose ends steps end.
                let attempts = radians / Scheme::angle_of_attempt(Scheme::TAYLOR, fine.tolerance) + changes;
                match by {
                    Method::Taylor => (by_series(attempts, fine.tolerance), balance),
                    _ if is_finer(&fine, &steps) => (by_rk8(radians, fine.tolerance), by_equal_steps),
                    _ => (by_equal_steps, 0.0),
                }
            }
            _ => (by_equal_steps, 0.0),
        };
        Some(OfBody { run, recomputed, balance, balanced: usize::MAX })
    }

    /// The factor by which steps of `step` s become shorter to follow the rate of a group's first body.
    fn halvings_of(&self, group: &Group, step: f64) -> f64 {
        let (scene, body) = (self.scene(), group.members.body(0));
        let turned = rate_of_body(scene, scene.torques(), body).0 * step;
        (turned / REFERENCE_ANGLE).log2().ceil().exp2().clamp(1.0, MOST_REFINEMENT)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wanted(dearness: f64, judged: f64) -> Wanted {
        Wanted { dearness, judged, little: LITTLE }
    }

    #[test]
    fn samples_are_as_large_as_a_tenth_of_the_run_or_half_a_second_allows() {
        let dearer = |all, (run, recomputed, balance), dearness| {
            let known = OfBody { run, recomputed, balance, balanced: usize::MAX };
            Recomputation { searched: 0.0, ..Recomputation::of(all, Some(known), wanted(dearness, 0.0)) }
        };
        let of = |all, run, recomputed, balance| dearer(all, (run, recomputed, balance), 1.0);
        let sample = |bodies, balances| Recomputation { bodies, balances, searched: 0.0, by_rk8: false };
        let unknown = |all, dearness, judged| Recomputation {
            searched: 0.0,
            ..Recomputation::of(all, None, wanted(dearness, judged))
        };
        assert_eq!(unknown(1_000_000, 1.0, 0.0), sample(1000, true));
        assert_eq!(of(1_000_000, 1.0, 10.0, 10.0), sample(1000, true), "2e4 s of 1e6");
        assert_eq!(of(20, 1e-3, 1e-2, 1e-2), sample(20, true), "0.4 s");
        assert_eq!(of(1000, 1e-3, 2.5e-2, 2.5e-2), sample(10, true), "0.5 s, and a tenth of a second of the run");
        assert_eq!(of(10_000, 1.0, 10.0, 15.0), sample(40, true), "a tenth of 1e4 s");
        assert_eq!(of(20, 0.2, 0.04, 2.0), sample(12, false), "what torques do is left");
        assert_eq!(of(20, 0.2, 2.0, 2.0), sample(8, false), "no fewer than stand side by side");
        assert_eq!(of(3, 0.2, 2.0, 2.0), sample(3, false));
        let series = |balance| {
            let known = OfBody { run: 1e-3, recomputed: 1e-3, balance, balanced: WITH_WORK };
            Recomputation { searched: 0.0, ..Recomputation::of(1000, Some(known), wanted(1.0, 0.0)) }
        };
        assert_eq!([3e-2, 5.99e-2, 8e-2].map(series), [sample(192, true), sample(20, true), sample(192, false)]);
        assert_eq!(of(0, 0.2, 2.0, 2.0), sample(0, true));
        // Bodies that take longer than the average: as many as take the time of the usual sample, or a fiftieth of the run.
        assert_eq!(dearer(1_000_000, (1.0, 10.0, 0.0), 8.0), sample(250, true), "for a fiftieth of 1e6 s");
        assert_eq!(dearer(10_000, (1e-6, 1e-5, 0.0), 1.5), sample(128, true), "what 192 would");
        assert_eq!(dearer(100_000, (1e-6, 1e-5, 0.0), 5.0), sample(96, true), "no fewer");
        assert_eq!(of(100_000, 1.001e-5, 2e-5, 2e-5), sample(500, true), "for a fiftieth of a second");
        assert_eq!(of(100_000, 1e-5, 2e-5, 2e-4), sample(192, true), "for which there are fewer than usual");
        assert_eq!(of(1_000_000, 1e-5, 1e-6, 1e-6), sample(4096, true), "no more are of use");
        assert_eq!(unknown(1_000_000, 4.0, 0.0), sample(250, true));
        assert_eq!(unknown(4000, 1.0, 639.5), sample(640, true), "the percentile needs more");
        assert_eq!(unknown(300, 1.0, f64::INFINITY), sample(300, true), "all");
        assert_eq!(unknown(1_000_000, 1.0, f64::INFINITY), sample(1000, true), "too many");
    }

    #[test]
    fn events_are_searched_as_long_as_the_run_allows() {
        let searched = |all: usize, run: f64| {
            let known = OfBody { run, recomputed: run, balance: 0.0, balanced: usize::MAX };
            Recomputation::of(all, Some(known), wanted(1.0, 0.0)).searched
        };
        assert!((searched(100, 1e-3) - 10_000.0).abs() < 1e-6, "a fifth of a second");
        assert!((searched(1000, 5e-3) - 25_000.0).abs() < 1e-6, "a tenth of five seconds");
        assert_eq!(searched(1_000_000, 1.0), MOST_SEARCHED);
    }
}
