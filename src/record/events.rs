//! The times at which bodies had an event, and how many have not had it.

use glam::{DQuat, DVec3};

use crate::math::Quantiles;
use crate::scene::Event;

/// How the time of an event is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum EventTime {
    /// At the start of the run.
    Start,
    /// Found between two outputs, to within 1e-12 of the scene's span, on the body's motion from the first of them.
    Located,
    /// The body was on the other side at the output before: the event was between the two. This is all that is known if a random torque
    /// acts, which has no meaning between a run's own steps, or if a step of the search failed.
    Output,
}

impl EventTime {
    /// All variants.
    pub const ALL: &'static [Self] = &[Self::Start, Self::Located, Self::Output];

    /// The word in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Start => "start",
            Self::Located => "located",
            Self::Output => "output",
        }
    }
}

/// An event of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EventOccurrence {
    /// The body.
    pub body: usize,
    /// The time, s; for [`EventTime::Output`] that of the output after it.
    pub time: f64,
    /// How precisely the time is known.
    pub known_to: EventTime,
    /// The orientation at that time, body to world.
    pub orientation: DQuat,
    /// The angular velocity at that time, rad/s, body axes.
    pub angular_velocity_body: DVec3,
}

/// A body that failed, or was stopped by another event, without having had an event.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Censored {
    /// The body.
    pub body: usize,
    /// When its failure was noticed, or when it was stopped, s.
    pub time: f64,
    /// Whether it was stopped.
    pub stopped: bool,
}

/// An event, over all bodies.
#[derive(Clone, Debug, PartialEq)]
pub struct EventRecord {
    /// The event.
    pub event: Event,
    /// Number of bodies.
    pub bodies: usize,
    /// The bodies that had it, by time and, for equal times, by body.
    pub occurrences: Vec<EventOccurrence>,
    /// The bodies that failed, or were stopped by another event, without having had it, by time; nothing is known of them from then on.
    pub censored: Vec<Censored>,
    /// The differences from the times of the recomputed sample's bodies.
    pub errors: EventErrors,
}

/// The differences between a run's event times and those of a sample of its bodies that was recomputed more accurately.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "study", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct EventErrors {
    /// Bodies of the sample.
    pub bodies: usize,
    /// Those of them that had the event in both.
    pub compared: usize,
    /// Those of them that had it in only one of the two.
    pub differing: usize,
    /// Those of them that had it earlier than the run says, or that never had it in the run, because a quantity passed its level and came
    /// back between two times at which the run seeks events. The bodies of the sample are followed all the time.
    pub unnoticed: usize,
    /// The least part of the time between outputs for which a body of the sample was followed, in [0, 1]: less than 1 for bodies that turn
    /// very often, so that this takes no longer than some seconds.
    pub searched: f64,
    /// The errors of the times of the compared bodies, s, ascending; and of the unnoticed ones that never had the event in the run, the
    /// time from the event to the end.
    pub times: Vec<f64>,
}

impl Default for EventErrors {
    /// Of no bodies.
    fn default() -> Self {
        Self { bodies: 0, compared: 0, differing: 0, unnoticed: 0, searched: 1.0, times: Vec::new() }
    }
}

impl EventErrors {
    /// The median, 99th percentile and greatest error of the time, s; zeros if nothing was compared.
    pub fn time(&self) -> Quantiles {
        Quantiles::of(&mut self.times.clone())
    }

    /// The errors of the samples of all parts of a study.
    #[cfg(feature = "study")]
    pub(crate) fn together(parts: impl IntoIterator<Item = Self>) -> Self {
        let mut all = Self::default();
        for part in parts {
            all.bodies += part.bodies;
            all.compared += part.compared;
            all.differing += part.differing;
            all.unnoticed += part.unnoticed;
            all.searched = all.searched.min(part.searched);
            all.times.extend(part.times);
        }
        all.times.sort_by(f64::total_cmp);
        all
    }
}

/// The share of bodies that have not had an event yet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Survival {
    /// The time, s.
    pub time: f64,
    /// Bodies that have neither had it nor failed, and that no other event has stopped.
    pub remaining: usize,
    /// The share of a population of such bodies that has not had it, in [0, 1], by the Kaplan-Meier estimator: bodies that fail,
    /// or are stopped by another event, count until then.
    pub share: f64,
    /// The lower end of its 95 % confidence interval.
    pub low: f64,
    /// The upper end.
    pub high: f64,
}

/// The time by which a share of the bodies has had an event.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeBy {
    /// The share of a population of such bodies, in percent.
    pub percent: f64,
    /// The first time, s, by which the Kaplan-Meier estimate says that the share has had the event; NaN if it does not get there.
    pub time: f64,
    /// The lower end of its 95 % confidence interval, s; NaN if the interval lies beyond what was observed.
    pub low: f64,
    /// The upper end, s; NaN if the interval has none within what was observed.
    pub high: f64,
}

/// The quantile of the normal distribution for 95 %.
const NORMAL: f64 = 1.959_963_984_540_054;

impl EventRecord {
    /// The share of bodies that have not had the event yet, at each of some ascending times: E. L. Kaplan, P. Meier (*J. Am. Stat. Assoc.*
    /// 53 (1958) 457), with M. Greenwood's variance and K. J. Rothman's interval (*J. Chronic Dis.* 31 (1978) 557), which without failures
    /// is E. B. Wilson's interval of a binomial share. Where that variance is zero, at the shares 1 and 0, the interval is that of the bodies
    /// that could still have the event: of nobody it is [0, 1].
    pub fn survival(&self, times: &[f64]) -> Vec<Survival> {
        let (mut had, mut lost) = (0, 0);
        // Greenwood's sum of d/(n (n − d)).
        let (mut share, mut sum) = (1.0, 0.0);
        // The upper end once all have had it.
        let mut high_at_zero = 0.0;
        let of_time = |&time: &f64| {
            while let Some(next) = self.occurrences.get(had).filter(|next| next.time <= time) {
                // A body that fails at the same time counts as still present.
                lost += self.censored[lost..].iter().take_while(|censored| censored.time < next.time).count();
                let at_once = self.occurrences[had..].iter().take_while(|other| other.time == next.time).count();
                let at_risk = (self.bodies - had - lost) as f64;
                // Of those left, and of all before them.
                let (of_last, of_all) = (share * wilson(0.0, at_risk).1, equivalent_bodies(share, sum));
                high_at_zero = of_all.map_or(of_last, |bodies| of_last.max(wilson(0.0, bodies).1));
                share *= 1.0 - at_once as f64 / at_risk;
                sum += at_once as f64 / (at_risk * (at_risk - at_once as f64));
                had += at_once;
            }
            lost += self.censored[lost..].iter().take_while(|censored| censored.time <= time).count();
            let remaining = self.bodies - had - lost;
            let (low, high) = match equivalent_bodies(share, sum) {
                Some(bodies) => wilson(share, bodies),
                None if share > 0.0 => wilson(share, remaining as f64),
                None => (0.0, high_at_zero),
            };
            Survival { time, remaining, share, low, high }
        };
        times.iter().map(of_time).collect()
    }

    /// The same for the bodies of each of `cells` cells in turn: body b lies in cell b modulo their number ([`crate::study::Design`]).
    pub fn by_cell(&self, cells: usize) -> impl Iterator<Item = Self> {
        let occurrences = sorted_by_cell(&self.occurrences, cells, |occurrence| occurrence.body);
        let censored = sorted_by_cell(&self.censored, cells, |censored| censored.body);
        (0..cells).map(move |cell| Self {
            event: self.event.clone(),
            bodies: self.bodies / cells + usize::from(cell < self.bodies % cells),
            occurrences: of_cell(&occurrences, cell, cells, |occurrence| occurrence.body),
            censored: of_cell(&censored, cell, cells, |censored| censored.body),
            errors: EventErrors::default(),
        })
    }

    /// The times by which some percentages of the bodies have had the event, with 95 % confidence intervals: all times at which the interval
    /// of [`EventRecord::survival`] contains the share (R. Brookmeyer, J. Crowley, *Biometrics* 38 (1982) 29). An interval that contains it
    /// from the start on begins at 0. Times are those of the events themselves and of bodies that failed or were stopped, not of outputs.
    pub fn times_by(&self, percentages: &[f64]) -> Vec<TimeBy> {
        let had = self.occurrences.iter().map(|occurrence| occurrence.time);
        let mut times: Vec<f64> = had.chain(self.censored.iter().map(|censored| censored.time)).collect();
        let rounding = self.rounding();
        times.sort_by(f64::total_cmp);
        times.dedup();
        let events = self.survival(&times);
        // Before the first event nobody has had it.
        let (low, high) = wilson(1.0, self.bodies as f64);
        let start = Survival { time: 0.0, remaining: self.bodies, share: 1.0, low, high };
        let points = || std::iter::once(&start).filter(|_| self.bodies > 0).chain(&events);
        let first = |is_reached: &dyn Fn(&Survival) -> bool| {
            points().find(|point| is_reached(point)).map_or(f64::NAN, |point| point.time)
        };
        let of_percent = |&percent: &f64| {
            let left = 1.0 - 0.01 * percent;
            TimeBy {
                percent,
                time: first(&|point| point.share <= left + rounding),
                low: first(&|point| point.low <= left + rounding),
                high: first(&|point| point.high < left - rounding),
            }
        };
        percentages.iter().map(of_percent).collect()
    }

    /// The time by which the share has fallen to one half, s, if it has.
    pub fn median(&self) -> Option<f64> {
        let times: Vec<f64> = self.occurrences.iter().map(|occurrence| occurrence.time).collect();
        let half = 0.5 + self.rounding();
        self.survival(&times).into_iter().find(|survival| survival.share <= half).map(|survival| survival.time)
    }

    /// How far rounding may put a share off: each of its factors may be rounded upward, twice.
    fn rounding(&self) -> f64 {
        self.occurrences.len() as f64 * f64::EPSILON
    }
}

/// Sorted by the cells of their bodies; those of a cell keep their order.
fn sorted_by_cell<T: Clone>(all: &[T], cells: usize, body: impl Fn(&T) -> usize) -> Vec<T> {
    let mut sorted = all.to_vec();
    sorted.sort_by_key(|one| body(one) % cells);
    sorted
}

/// Those of a cell among all that are sorted by cells.
fn of_cell<T: Clone>(sorted: &[T], cell: usize, cells: usize, body: impl Fn(&T) -> usize) -> Vec<T> {
    let [start, end] = [cell, cell + 1].map(|first| sorted.partition_point(|one| body(one) % cells < first));
    sorted[start..end].to_vec()
}

/// The number of bodies that would give a share its variance without failures; `None` where the variance is zero.
fn equivalent_bodies(share: f64, sum: f64) -> Option<f64> {
    let is_inner = share > 0.0 && share < 1.0 && sum.is_finite();
    is_inner.then(|| (1.0 - share) / (share * sum))
}

/// Wilson's interval of a share of `count` bodies.
fn wilson(share: f64, count: f64) -> (f64, f64) {
    if count == 0.0 {
        return (0.0, 1.0);
    }
    let part = NORMAL * NORMAL / count;
    let middle = (share + 0.5 * part) / (1.0 + part);
    let half = (part * (share * (1.0 - share) + 0.25 * part)).sqrt() / (1.0 + part);
    ((middle - half).clamp(0.0, share), (middle + half).clamp(share, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Condition, Quantity};

    fn record(bodies: usize, times: &[f64], censored: &[f64]) -> EventRecord {
        let occurrence = |(body, &time): (usize, &f64)| EventOccurrence {
            body,
            time,
            known_to: EventTime::Located,
            orientation: DQuat::IDENTITY,
            angular_velocity_body: DVec3::ZERO,
        };
        EventRecord {
            event: Event::new("e", Quantity::SpinRate, Condition::Below(1.0)).expect("a level"),
            bodies,
            occurrences: times.iter().enumerate().map(occurrence).collect(),
            censored: censored
                .iter()
                .enumerate()
                .map(|(body, &time)| Censored { body, time, stopped: false })
                .collect(),
            errors: EventErrors::default(),
        }
    }

    /// The remission times of 21 patients under 6-mercaptopurine (E. J. Freireich et al., *Blood* 21 (1963) 699), the textbook case: D.
    /// Collett, *Modelling Survival Data in Medical Research*, gives 0.857, 0.807, 0.753, 0.690, 0.627, 0.538, 0.448.
    #[test]
    fn a_textbook_case() {
        let relapses = [6.0, 6.0, 6.0, 7.0, 10.0, 13.0, 16.0, 22.0, 23.0];
        let censored = [6.0, 9.0, 10.0, 11.0, 17.0, 19.0, 20.0, 25.0, 32.0, 32.0, 34.0, 35.0];
        let survival = record(21, &relapses, &censored).survival(&[0.0, 6.0, 7.0, 10.0, 13.0, 16.0, 22.0, 23.0, 40.0]);
        let found: Vec<f64> = survival.iter().map(|point| (point.share * 1e3).round() / 1e3).collect();
        assert_eq!(found, [1.0, 0.857, 0.807, 0.753, 0.690, 0.627, 0.538, 0.448, 0.448]);
        assert!(survival.iter().all(|point| point.low <= point.share && point.share <= point.high));
        assert_eq!(survival.iter().map(|point| point.remaining).collect::<Vec<_>>(), [21, 17, 16, 13, 11, 10, 6, 5, 0]);
    }

    /// The same patients: the median is 23 weeks (Collett). The ends were computed apart from this code, from shares, Greenwood's variances and
    /// Wilson's formula; the upper band stays above a half to the end.
    #[test]
    fn times_of_the_textbook_case() {
        let relapses = [6.0, 6.0, 6.0, 7.0, 10.0, 13.0, 16.0, 22.0, 23.0];
        let censored = [6.0, 9.0, 10.0, 11.0, 17.0, 19.0, 20.0, 25.0, 32.0, 32.0, 34.0, 35.0];
        let found = record(21, &relapses, &censored).times_by(&[10.0, 50.0, 90.0]);
        let times = |place: usize| (found[place].time, found[place].low, found[place].high);
        assert_eq!((times(0), times(1).0, times(1).1), ((6.0, 0.0, 10.0), 23.0, 13.0));
        assert!(times(1).2.is_nan() && found[2].time.is_nan() && found[2].low.is_nan() && found[2].high.is_nan());
    }

    /// Without censored bodies the k-th of n events is at the share k/n. Its ends are where Wilson's interval of a share of n bodies, which
    /// any table has, leaves the share asked for.
    #[test]
    fn times_of_complete_records_are_order_statistics() {
        for (bodies, expected) in [
            (10, [[1.0, 0.0, 3.0], [5.0, 2.0, 9.0], [9.0, 8.0, f64::NAN]]),
            (67, [[7.0, 2.0, 12.0], [34.0, 26.0, 42.0], [61.0, 56.0, 66.0]]),
            (100, [[10.0, 5.0, 16.0], [50.0, 41.0, 60.0], [90.0, 85.0, 96.0]]),
        ] {
            let times: Vec<f64> = (1..=bodies).map(f64::from).collect();
            let found = record(bodies as usize, &times, &[]).times_by(&[10.0, 50.0, 90.0]);
            let found: Vec<f64> = found.iter().flat_map(|by| [by.time, by.low, by.high]).collect();
            let is_same = |(found, expected): (&f64, &f64)| found == expected || found.is_nan() && expected.is_nan();
            assert!(found.iter().zip(expected.as_flattened()).all(is_same), "{bodies}: {found:?}, {expected:?}");
        }
        // All had it at the start; nobody had it; nobody is there.
        let at_start = record(50, &[0.0; 50], &[]).times_by(&[50.0])[0];
        assert_eq!((at_start.time, at_start.low, at_start.high), (0.0, 0.0, 0.0));
        let never = record(50, &[], &[]).times_by(&[10.0])[0];
        assert!(never.time.is_nan() && never.low.is_nan() && never.high.is_nan());
        let nobody = record(0, &[], &[]).times_by(&[10.0])[0];
        assert!(nobody.time.is_nan() && nobody.low.is_nan() && nobody.high.is_nan());
    }

    /// The upper ends are z²/(n + z²) with z² = 3.841: Wilson's for none of n.
    #[test]
    fn at_shares_of_one_and_zero_the_interval_is_that_of_the_bodies_left() {
        let at = |record: &EventRecord, time: f64| {
            let survival = record.survival(&[time])[0];
            (survival.remaining, survival.share, [survival.low, survival.high].map(|x| (x * 1e3).round() / 1e3))
        };
        let lost = |count: usize| vec![1.0; count];
        // Nobody has had it: of 1,000 bodies, all are left, four, nobody.
        assert_eq!(at(&record(1000, &[], &[]), 2.0), (1000, 1.0, [0.996, 1.0]));
        assert_eq!(at(&record(1000, &[], &lost(996)), 2.0), (4, 1.0, [0.51, 1.0]));
        assert_eq!(at(&record(1000, &[], &lost(1000)), 2.0), (0, 1.0, [0.0, 1.0]));
        // All have had it: of 100, of the 50 or the one that were left.
        let times: Vec<f64> = (1..=100).map(f64::from).collect();
        assert_eq!(at(&record(100, &times, &[]), 100.0), (0, 0.0, [0.0, 0.037]));
        assert_eq!(at(&record(100, &[3.0; 50], &lost(50)), 4.0), (0, 0.0, [0.0, 0.071]));
        assert_eq!(at(&record(1000, &[3.0], &lost(999)), 4.0), (0, 0.0, [0.0, 0.793]));
        // Half have had it before all but one of the others fail: half of what one body tells.
        let mut half = vec![0.5; 50];
        half.push(3.0);
        assert_eq!(at(&record(100, &half, &lost(49)), 4.0), (0, 0.0, [0.0, 0.397]));
    }

    #[test]
    fn cells_have_the_bodies_whose_index_is_theirs_modulo_their_number() {
        let all = record(7, &[1.0, 2.0, 3.0, 4.0], &[0.5, 0.6]);
        let cells: Vec<EventRecord> = all.by_cell(3).collect();
        assert_eq!(cells.iter().map(|cell| cell.bodies).collect::<Vec<_>>(), [3, 2, 2]);
        let times: Vec<Vec<f64>> =
            cells.iter().map(|cell| cell.occurrences.iter().map(|occurrence| occurrence.time).collect()).collect();
        assert_eq!(times, [vec![1.0, 4.0], vec![2.0], vec![3.0]]);
        assert_eq!(cells.iter().map(|cell| cell.censored.len()).collect::<Vec<_>>(), [1, 1, 0]);
    }

    #[test]
    fn without_failures_the_share_is_binomial() {
        let record = record(10, &[1.0, 2.0, 3.0], &[]);
        let survival = record.survival(&[0.5, 2.5, 9.0]);
        assert_eq!(survival.iter().map(|point| point.remaining).collect::<Vec<_>>(), [10, 8, 7]);
        // Wilson's interval for 7 of 10, as in any table: 0.397 to 0.892.
        assert!((survival[2].low - 0.3968).abs() < 1e-4 && (survival[2].high - 0.8922).abs() < 1e-4, "{survival:?}");
        // For 10 of 10: 0.722 to 1.
        assert!((survival[0].low - 0.7225).abs() < 1e-4 && survival[0].high == 1.0, "{survival:?}");
        assert_eq!(record.median(), None);
    }

    #[test]
    fn the_median_is_not_an_event_late_where_rounding_leaves_more_than_a_half() {
        let mut rounded_up = 0;
        for half in 1..200 {
            let times: Vec<f64> = (1..=2 * half).map(f64::from).collect();
            let record = record(2 * half as usize, &times, &[]);
            rounded_up += usize::from(record.survival(&[f64::from(half)])[0].share > 0.5);
            assert_eq!(record.median(), Some(f64::from(half)), "{} bodies", 2 * half);
        }
        assert!(rounded_up > 0, "no share is rounded upward");
        // One more body, and the middle one's event is the median.
        let times: Vec<f64> = (1..=201).map(f64::from).collect();
        assert_eq!(record(201, &times, &[]).median(), Some(101.0));
    }

    #[test]
    fn all_or_no_bodies() {
        let all = record(2, &[1.0, 2.0], &[]);
        assert_eq!(all.median(), Some(1.0));
        let end = all.survival(&[2.0])[0];
        assert_eq!((end.share, end.low, end.remaining), (0.0, 0.0, 0));
        let none = record(0, &[], &[]).survival(&[1.0])[0];
        assert_eq!((none.low, none.high), (0.0, 1.0));
    }
}
