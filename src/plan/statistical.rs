//! The errors of an ensemble's statistics: what the integration contributes, and what the number of bodies does.
//!
//! Some bodies are followed twice, once as a run does and once more accurately. The *differences* of a quantity, body by body, show what
//! the integration contributes to its mean: their average, with its standard error. The spread of the quantity itself shows what the number
//! of bodies contributes. Where the motion is chaotic, single bodies part and the differences are as large as the spread: their average is
//! then known only to its standard error, which may exceed the error asked for. That is reported ([`StatisticError::is_shown`]) and not
//! hidden.

mod parts;

use std::fmt;

use self::parts::{Parts, Stands, moments, of_means, of_quantiles};
use crate::math::{FEW, parallel};
use crate::plan::sampling::effective_count;
use crate::plan::unseen::student;
use crate::scene::{Event, Quantity, Scene, StatisticalAccuracy, StatisticalTarget};

/// The most output times at which statistics are compared; the end is one of them.
const MOST_COMPARED: usize = 16;

/// The accepted probability of taking scatter for an error of the integration, over all statistics and times together.
const RISK: f64 = 0.05;

/// Below this part of the greatest root mean square that a quantity has at any time compared, its spread is rounding and no measure of
/// anything.
const LEAST_SPREAD: f64 = 1e-6;

/// The error of one statistic and its parts. All but `scale` are stated as parts of `scale`.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "study", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct StatisticError {
    /// What kind of statistic it is.
    pub target: StatisticalTarget,
    /// Name of the quantity or the event.
    pub name: String,
    /// Which quantile, in percent.
    pub percent: Option<f64>,
    /// The output time, s; `None` for event times.
    pub time: Option<f64>,
    /// The unit of the errors: the standard deviation of the quantity over the bodies of the sample at that time, but at least 1e-6 of the
    /// greatest root mean square that it has at any time compared, in its unit; for event times the span, s.
    pub scale: f64,
    /// The error of the integration: the statistic as integrated less that of the more accurate motion.
    pub integration: f64,
    /// The standard error of `integration`, from the scatter of the sample's bodies.
    pub standard_error: f64,
    /// Half the width of its confidence interval, of 95 % for all statistics and times together; means and event times have more where a few
    /// bodies err far more than the others, for those that the sample may lack.
    pub confidence: f64,
    /// The error due to the number of bodies: the standard error of the statistic of all bodies, as a sample of a larger population.
    pub sampling: f64,
    /// What the statistic's own resolution adds at most, beside the integration: that of a quantile of more than 2,048 bodies; of event
    /// times that are known to an output only, or from an interval on in which an event may have come and gone while nobody looked; and of
    /// what is formed of bodies that such an event may have stopped.
    #[cfg_attr(feature = "study", serde(default, skip_serializing_if = "vanishes"))]
    pub resolution: f64,
    /// The error of the integration that is asked for.
    pub wanted: f64,
    /// Bodies of the sample that no figure includes, as one of the two motions gives them no finite value (failed ones are among them); the
    /// most at any of the times compared.
    #[cfg_attr(feature = "study", serde(default, skip_serializing_if = "is_zero"))]
    pub left_out: usize,
    /// For event times: bodies of the sample whose event the run did not notice, or not at its time
    /// ([`EventErrors::unnoticed`](crate::record::EventErrors::unnoticed)). The target is missed if there are any.
    #[cfg_attr(feature = "study", serde(default, skip_serializing_if = "is_zero"))]
    pub unnoticed: usize,
}

#[cfg(feature = "study")]
pub(super) fn is_zero(count: &usize) -> bool {
    *count == 0
}

#[cfg(feature = "study")]
fn vanishes(number: &f64) -> bool {
    *number == 0.0
}

impl StatisticError {
    /// Whether the error is known: some body of the sample has a finite value. If none has, the figures are NaN.
    pub fn is_known(&self) -> bool {
        !self.integration.is_nan()
    }

    /// The greatest error of the integration, with a confidence of 95 %.
    pub fn bound(&self) -> f64 {
        self.integration.abs() + self.confidence
    }

    /// Whether the sample shows that the target is met.
    pub fn is_shown(&self) -> bool {
        self.bound() + self.resolution <= self.wanted && self.unnoticed == 0
    }

    /// Whether only the statistic's own resolution is in the way of that.
    pub(crate) fn is_unresolved(&self) -> bool {
        self.bound() <= self.wanted && !self.is_shown() && !self.is_missed()
    }

    /// Whether the sample shows that the target is missed.
    pub fn is_missed(&self) -> bool {
        self.integration.abs() - self.confidence > self.wanted || self.unnoticed > 0
    }

    /// The statistic in words.
    pub fn label(&self) -> String {
        match (self.target, self.percent) {
            (StatisticalTarget::Mean, _) => format!("mean of {}", self.name),
            (StatisticalTarget::Quantile, percent) => {
                format!("{} % quantile of {}", percent.unwrap_or(f64::NAN), self.name)
            }
            (StatisticalTarget::EventTime, _) => format!("time of {}", self.name.replace(char::is_control, " ")),
        }
    }

    /// What the number of bodies contributes, as text; of a single body nothing is known.
    pub(crate) fn of_number(&self) -> String {
        match self.sampling.is_nan() {
            true => "not known".to_owned(),
            false => format!("{:.1e} {}", self.sampling, self.target.scale()),
        }
    }
}

impl fmt::Display for StatisticError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let at = self.time.map_or(String::new(), |time| format!(" at {time:.4e} s"));
        let verdict = match (self.is_missed(), self.is_shown()) {
            _ if !self.is_known() => "not known",
            (true, _) => "MISSED",
            (false, true) => "shown",
            _ if self.is_unresolved() => "not resolved",
            (false, false) => "not distinguishable from the scatter of the sample",
        };
        write!(
            formatter,
            "  {}{at}: integration {:.1e} +- {:.1e}, number of bodies {}; asked {:.1e}: {verdict}",
            self.label(),
            self.integration,
            self.confidence,
            self.of_number(),
            self.wanted
        )?;
        if self.resolution > 0.0 {
            write!(formatter, "; known to {:.1e}", self.resolution)?;
        }
        if self.left_out > 0 {
            let left_out = self.left_out;
            write!(formatter, "; {left_out} bodies of the sample have no finite value and are left out")?;
        }
        match self.unnoticed {
            0 => Ok(()),
            unnoticed => write!(formatter, "; unnoticed between outputs in {unnoticed} bodies of the sample"),
        }
    }
}

/// The quantities and event times of some bodies, followed with one choice of steps.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct SampleValues {
    /// The output times, s, of the values.
    pub times: Vec<f64>,
    /// By time, quantity ([`crate::scene::Observed::quantities`]) and body; NaN where there is no value.
    pub values: Vec<Vec<Vec<f64>>>,
    /// By event and body: the time, s; the end of the span if it did not happen, NaN if the body has failed.
    pub event_times: Vec<Vec<f64>>,
    /// By body: how many bodies it stands for, relative to the others; empty if all stand for as many.
    pub weights: Vec<f64>,
    /// By body: the time, s, from which an event may have stopped it that the run has not noticed; empty if no event stops bodies.
    pub uncertain: Vec<f64>,
}

/// The outputs at which statistics are compared: some evenly spaced ones of `count`, including the last.
pub(crate) fn compared_outputs(count: usize) -> Vec<usize> {
    let compared = count.min(MOST_COMPARED);
    (1..=compared).map(|k| k * count / compared - 1).collect()
}

/// The errors of all statistics for which `wanted` states an error, known or not ([`StatisticError::is_known`]), from the same bodies
/// followed twice, `as_run` and `accurate`; `all` is the number of bodies that the sample stands for, `span` the time, s, over which events
/// are looked for.
pub(crate) fn statistic_errors(
    scene: &Scene,
    wanted: &StatisticalAccuracy,
    (as_run, accurate): (&SampleValues, &SampleValues),
    (all, span): (usize, f64),
) -> Vec<StatisticError> {
    let observed = scene.observed();
    let quantities = observed.quantities();
    let number = |quantity: &Quantity| quantities.iter().position(|other| other == quantity).unwrap_or(0);
    let mut with_means: Vec<&Quantity> = Vec::new();
    for quantity in observed.statistics.iter().chain(observed.histograms.iter().map(|histogram| histogram.quantity())) {
        if !with_means.contains(&quantity) {
            with_means.push(quantity);
        }
    }
    // The least spread of each quantity.
    let least = |number: usize| {
        let at_times = accurate.values.iter().map(|values| root_mean_square(&values[number]));
        LEAST_SPREAD * at_times.fold(0.0, f64::max)
    };
    let least: Vec<f64> = (0..quantities.len()).map(least).collect();
    // One comparison: kind, name, percent, time, the error asked for with the least spread, and the values.
    type Compared<'v> = (StatisticalTarget, &'v str, Option<f64>, Option<f64>, (f64, f64), (&'v [f64], &'v [f64]));
    let mut compared: Vec<Compared<'_>> = Vec::new();
    for (place, &time) in as_run.times.iter().enumerate() {
        let values = |quantity: &Quantity| {
            let number = number(quantity);
            (&as_run.values[place][number][..], &accurate.values[place][number][..])
        };
        if let Some(wanted) = wanted.mean {
            compared.extend(with_means.iter().map(|quantity| {
                let wanted = (wanted, least[number(quantity)]);
                (StatisticalTarget::Mean, quantity.name(), None, Some(time), wanted, values(quantity))
            }));
        }
        if let Some(wanted) = wanted.quantile {
            for quantity in &observed.statistics {
                let wanted = (wanted, least[number(quantity)]);
                compared.extend(observed.quantiles.iter().map(|&percent| {
                    (StatisticalTarget::Quantile, quantity.name(), Some(percent), Some(time), wanted, values(quantity))
                }));
            }
        }
    }
    if let Some(wanted) = wanted.event_time {
        for (event, values) in observed.events.iter().zip(as_run.event_times.iter().zip(&accurate.event_times)) {
            let values = (&values.0[..], &values.1[..]);
            compared.push((StatisticalTarget::EventTime, event.name(), None, None, (wanted, 0.0), values));
        }
    }
    let count = compared.first().map_or(0, |(.., (as_run, _))| as_run.len());
    let uncertain = &as_run.uncertain;
    let weights = if as_run.weights.is_empty() { vec![1.0; count] } else { as_run.weights.clone() };
    // Whether quantiles of the whole study are formed from counts.
    let is_counted = scene.part().of > FEW;
    // 2 (1 - Φ(z)) ≤ exp(-z²/2); the risk is divided by the number of intervals, so that all hold together (C. E. Bonferroni).
    let normal_width = (2.0 * (compared.len().max(1) as f64 / RISK).ln()).sqrt();
    let error = |&(target, name, percent, time, (wanted, least), (as_run, accurate)): &Compared<'_>| {
        let is_finite = |place: &usize| as_run[*place].is_finite() && accurate[*place].is_finite();
        let bodies = as_run.len();
        let places: Vec<usize> = (0..bodies).filter(is_finite).collect();
        let of = |values: &[f64]| places.iter().map(|&place| values[place]).collect::<Vec<f64>>();
        let (own_weights, as_run, accurate) = (of(&weights), of(as_run), of(accurate));
        if bodies == 0 {
            return None;
        }
        // Of all bodies the same part has a value.
        let all = all as f64 * (own_weights.iter().sum::<f64>() / weights.iter().sum::<f64>());
        // Any of their values may be anything that there is.
        let is_doubtful =
            |place: &&usize| time.is_some_and(|time| uncertain.get(**place).is_some_and(|&from| from < time));
        let doubtful: f64 = places.iter().filter(is_doubtful).map(|&place| weights[place]).sum();
        let doubtful = doubtful / own_weights.iter().sum::<f64>();
        let stands = Stands { weights: &own_weights, all, doubtful };
        let parts = match percent {
            _ if accurate.is_empty() => Parts::UNKNOWN,
            None => of_means(&as_run, &accurate, &stands),
            Some(percent) => of_quantiles(&as_run, &accurate, (percent, is_counted), &stands),
        };
        let scale = match target {
            StatisticalTarget::EventTime => span,
            _ => spread(&accurate, &own_weights, least),
        };
        let relative = |x: f64| if x == 0.0 { 0.0 } else { (x / scale).clamp(-f64::MAX, f64::MAX) };
        let standard_error = relative(parts.standard_error);
        // Of one body the difference itself is all that is known.
        let freedom = (effective_count(&own_weights) - 1.0).round();
        let deviations = if freedom < 1.0 { normal_width } else { student(normal_width, freedom) };
        let width = deviations * standard_error + relative(parts.unseen);
        Some(StatisticError {
            target,
            name: name.to_owned(),
            percent,
            time,
            scale,
            integration: relative(parts.difference),
            standard_error,
            confidence: if accurate.is_empty() { f64::NAN } else { width.min(f64::MAX) },
            sampling: relative(parts.sampling),
            resolution: relative(parts.resolution),
            wanted,
            left_out: bodies - accurate.len(),
            unnoticed: 0,
        })
    };
    parallel::map(compared.len(), |index| error(&compared[index])).into_iter().flatten().collect()
}

/// For each statistic, the time at which the evidence against it is strongest.
pub(crate) fn worst_times(errors: Vec<StatisticError>) -> Vec<StatisticError> {
    let mut worst: Vec<StatisticError> = Vec::new();
    let rank = |error: &StatisticError| (error.is_missed(), error.bound() + error.resolution);
    for error in errors {
        let is_same = |other: &&mut StatisticError| {
            (other.target, &other.name, other.percent) == (error.target, &error.name, error.percent)
        };
        match worst.iter_mut().find(is_same) {
            Some(other) => {
                let left_out = other.left_out.max(error.left_out);
                // Of times at which all is alike, the last.
                if !other.is_known() || rank(&error) >= rank(other) {
                    *other = error;
                }
                other.left_out = left_out;
            }
            None => worst.push(error),
        }
    }
    worst
}

/// The spread of a quantity, or `least` if that is greater or there is no spread.
fn spread(values: &[f64], weights: &[f64], least: f64) -> f64 {
    // `max` takes the number if the other is NaN.
    least.max(moments(values, weights).1)
}

/// That of the finite numbers among `values`; 0 if there are none.
fn root_mean_square(values: &[f64]) -> f64 {
    let finite = values.iter().filter(|value| value.is_finite());
    let (count, sum) = finite.fold((0_usize, 0.0), |(count, sum), value| (count + 1, value.mul_add(*value, sum)));
    (sum / count.max(1) as f64).sqrt()
}

/// The time of a body's event, from its quantity at some ascending times, the first being the start, s: where the secant between two of
/// them passes the level; `end` if it does not happen. It serves to compare two motions, and is as coarse as the times are apart.
pub(crate) fn secant_time(event: &Event, points: impl Iterator<Item = (f64, f64)>, end: f64) -> f64 {
    let condition = event.condition();
    let mut last: Option<(f64, f64, Option<bool>)> = None;
    let mut count = 0;
    for (time, value) in points {
        let excess = value - condition.level();
        // A body without a value stays on its side.
        let side = match last {
            None => condition.side_at_start(excess),
            Some((.., before)) => condition.side(excess).or(before),
        };
        let met_at = match last {
            None => condition.is_met_between(None, side).then_some(time),
            Some((before, excess_before, side_before)) => condition.is_met_between(side_before, side).then(|| {
                let part = excess_before / (excess_before - excess);
                before + (time - before) * if part.is_finite() { part.clamp(0.0, 1.0) } else { 1.0 }
            }),
        };
        if let Some(met_at) = met_at {
            count += 1;
            if count == event.nth() {
                return met_at;
            }
        }
        last = Some((time, excess, side));
    }
    end
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::Ensemble;
    use crate::plan::sampling::mixed;
    use crate::scene::{Condition, StatisticalAccuracy};

    /// Numbers that look drawn from a uniform distribution on [0, 1).
    fn uniform(seed: u64, count: usize) -> Vec<f64> {
        (0..count).map(|k| (mixed(seed << 32 | k as u64) >> 11) as f64 * 2.0_f64.powi(-53)).collect()
    }

    fn scene() -> Scene {
        let none: [glam::DVec3; 0] = [];
        let slow = Event::new("slow", Quantity::SpinRate, Condition::Below(0.5)).expect("a level");
        let scene = Scene::new(Ensemble::from_columns(&none, &[], &none).expect("no bodies"));
        scene.until(10.0).statistics([Quantity::SpinRate]).quantiles(&[50.0]).expect("a percentage").event(slow)
    }

    fn errors(as_run: Vec<f64>, accurate: Vec<f64>, all: usize) -> Vec<StatisticError> {
        let sample = |values: Vec<f64>| SampleValues {
            times: vec![10.0],
            event_times: vec![values.clone()],
            values: vec![vec![values]],
            ..SampleValues::default()
        };
        let wanted = StatisticalAccuracy { mean: Some(1e-2), quantile: Some(1e-2), event_time: Some(1e-2) };
        statistic_errors(&scene(), &wanted, (&sample(as_run), &sample(accurate)), (all, 10.0))
    }

    #[test]
    fn what_has_decayed_to_rounding_is_measured_by_what_it_was() {
        let at = |size: f64| (0..100).map(|k| size * (1.0 + 1e-3 * f64::from(k))).collect::<Vec<f64>>();
        let sample = |last: f64| SampleValues {
            times: vec![1.0, 10.0],
            values: vec![vec![at(1.0)], vec![at(last)]],
            event_times: vec![vec![1.0; 100]],
            ..SampleValues::default()
        };
        let wanted = StatisticalAccuracy { mean: Some(1e-3), ..StatisticalAccuracy::default() };
        let found = statistic_errors(&scene(), &wanted, (&sample(3e-17), &sample(1e-16)), (100, 10.0));
        let [early, late] = &found[..] else { panic!("two means: {found:?}") };
        assert!(early.scale > 0.02 && (1e-6..1.1e-6).contains(&late.scale), "{found:?}");
        assert!(late.is_shown() && late.integration.abs() < 1e-9, "{late:?}");
    }

    /// A quantile that is known too roughly at one time is not shown because of another.
    #[test]
    fn the_worst_time_is_that_of_the_greatest_error_with_its_resolution() {
        let wanted = StatisticalAccuracy { quantile: Some(1e-3), ..StatisticalAccuracy::default() };
        let values = SampleValues { times: vec![1.0], values: vec![vec![uniform(1, 400)]], ..SampleValues::default() };
        let known = statistic_errors(&scene(), &wanted, (&values, &values), (400, 10.0)).remove(0);
        let narrow = StatisticError { time: Some(1.0), resolution: 2.4e-3, ..known.clone() };
        let wide = StatisticError { time: Some(2.0), integration: 6e-4, ..known };
        for errors in [vec![narrow.clone(), wide.clone()], vec![wide, narrow]] {
            let [worst] = &worst_times(errors)[..] else { panic!("one statistic") };
            assert!(worst.time == Some(1.0) && worst.is_unresolved(), "{worst:?}");
        }
    }

    #[test]
    fn an_offset_of_every_body_is_the_integrations() {
        let accurate = uniform(1, 400);
        let offset = 0.1;
        let as_run = accurate.iter().map(|value| value + offset).collect();
        let found = errors(as_run, accurate, 40_000);
        assert_eq!(
            found.iter().map(|error| error.target.name()).collect::<Vec<_>>(),
            ["mean", "quantile", "event time"]
        );
        // The deviation of a uniform distribution, and its standard errors: of a mean σ/√N, of a median 1/(2 f √N).
        let sigma = 12.0_f64.sqrt().recip();
        for (error, (scale, sampling)) in found.iter().zip([(sigma, sigma), (sigma, 0.5), (10.0, sigma)]) {
            assert!((error.scale / scale - 1.0).abs() < 0.1, "{error:?}");
            assert!((error.integration * error.scale / offset - 1.0).abs() < 1e-12, "{error:?}");
            assert!(error.confidence < 1e-12, "{error:?}");
            let expected = sampling / 200.0 / error.scale;
            assert!((error.sampling / expected - 1.0).abs() < 0.3, "{error:?}, {expected}");
        }
        // The event's target is a tenth of a second of ten; rounding decides on which side 0.1 falls.
        assert!(found[..2].iter().all(StatisticError::is_missed), "{found:?}");
    }

    /// Chaotic motions: other bodies, the same distribution. Neither met nor missed is shown, and the interval contains the true value.
    #[test]
    fn scatter_is_not_taken_for_an_error_of_the_integration() {
        let mut within = 0;
        for seed in 0..200 {
            let found = errors(uniform(2 * seed + 10, 300), uniform(2 * seed + 11, 300), 300);
            assert!(found[..2].iter().all(|error| !error.is_shown()), "{found:?}");
            within += usize::from(found.iter().all(|error| !error.is_missed()));
        }
        assert!(within >= 190, "{within} of 200");
        // A shift of a third of the spread is detected.
        let shifted = uniform(7, 1000).into_iter().map(|value| value + 0.1).collect();
        let found = errors(shifted, uniform(8, 1000), 1000);
        assert!(found[0].is_missed(), "{found:?}");
    }

    #[test]
    fn bodies_without_a_finite_value_are_counted_and_without_any_nothing_is_known() {
        let accurate = uniform(1, 400);
        let without = |count: usize| {
            let mut as_run = accurate.clone();
            as_run[..count].fill(f64::NAN);
            errors(as_run, accurate.clone(), 40_000)
        };
        let (all, most, none) = (without(0), without(100), without(400));
        assert!(all.iter().all(|error| error.left_out == 0 && error.is_shown()), "{all:?}");
        assert!(most.iter().all(|error| error.left_out == 100 && error.is_shown()), "{most:?}");
        // A mean of 30,000 bodies.
        assert!((most[0].sampling * 30_000.0_f64.sqrt() - 1.0).abs() < 1e-12, "{most:?}");
        let is_open = |error: &StatisticError| !error.is_known() && !error.is_shown() && !error.is_missed();
        assert!(none.len() == 3 && none.iter().all(|error| error.left_out == 400 && is_open(error)), "{none:?}");
        // What is known at one time counts, with the most bodies left out at any.
        for times in [[none.clone(), most.clone()], [most, none]] {
            let worst = worst_times(times.concat());
            assert!(
                worst.len() == 3 && worst.iter().all(|error| error.left_out == 400 && error.is_known()),
                "{worst:?}"
            );
        }
    }

    #[test]
    fn compared_outputs_end_with_the_last() {
        assert_eq!(compared_outputs(1), [0]);
        assert_eq!(compared_outputs(3), [0, 1, 2]);
        assert_eq!(compared_outputs(16), (0..16).collect::<Vec<_>>());
        let many = compared_outputs(1001);
        assert!(many.len() == MOST_COMPARED && many[MOST_COMPARED - 1] == 1000 && many.is_sorted_by(|a, b| a < b));
    }

    #[test]
    fn secants_pass_levels_where_lines_do() {
        let event = |condition| Event::new("e", Quantity::SpinRate, condition).expect("a level");
        let line = |event: &Event, values: &[f64]| {
            secant_time(event, values.iter().enumerate().map(|(time, &value)| (time as f64, value)), 9.0)
        };
        assert_eq!(line(&event(Condition::Below(0.5)), &[1.0, 0.75, 0.25]), 1.5);
        assert_eq!(line(&event(Condition::Below(0.5)), &[0.25, 0.75]), 0.0);
        assert_eq!(line(&event(Condition::Falls(0.5)), &[0.25, 0.75, 0.25]), 1.5);
        assert_eq!(line(&event(Condition::Falls(0.5)), &[0.25, 0.75]), 9.0);
        // To leave the level at the start is no passage.
        assert_eq!(line(&event(Condition::Crosses(0.5)), &[0.5, 0.25, 0.75]), 1.5);
        assert_eq!(line(&event(Condition::Falls(0.5)), &[0.5, 0.25]), 9.0);
        let third = event(Condition::Crosses(0.0)).occurrence(3).expect("a number");
        assert_eq!(line(&third, &[1.0, -1.0, 1.0, -1.0]), 2.5);
    }
}
