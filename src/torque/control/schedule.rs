//! The times at which torques are sampled, and at which the sampled values take effect.

use super::Control;
use crate::math::equal_steps::steps_over;
use crate::torque::{Torque, Value};

/// The sampling period of a torque, and the delay until the values take effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampling {
    /// The period, s, above zero.
    pub every: f64,
    /// The delay, s, not negative.
    pub delay: f64,
}

impl Sampling {
    /// Samples every `every` seconds, in effect at once.
    pub fn every(every: f64) -> Self {
        Self { every, delay: 0.0 }
    }

    /// The same with this delay, s.
    #[must_use]
    pub fn delayed(self, delay: f64) -> Self {
        Self { delay, ..self }
    }

    /// The values in the order of [`super::parameters`].
    pub(in crate::torque) fn values(self) -> [Value; 2] {
        [self.every, self.delay].map(|seconds| Value::Number(seconds.into()))
    }
}

/// The times, s, at which the values that torques hold change.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Schedule {
    laws: Vec<Sampling>,
}

/// Times closer together than this part of a sampling period count as one.
const TOGETHER: f64 = 1e-9;

impl Sampling {
    /// The number of periods from `first` to `time`, and the tolerance of that number.
    fn periods(self, time: f64, first: f64) -> (f64, f64) {
        let periods = (time - first) / self.every;
        (periods, TOGETHER + 8.0 * f64::EPSILON * periods.abs())
    }

    /// The number of the sample at `time`, from 0, if there is one.
    pub(crate) fn sample_at(self, time: f64) -> Option<u64> {
        self.at(time, 0.0)
    }

    /// The number of the sample whose values take effect at `time`, if values are delayed.
    pub(crate) fn effect_at(self, time: f64) -> Option<u64> {
        if self.delay > 0.0 { self.at(time, self.delay) } else { None }
    }

    fn at(self, time: f64, first: f64) -> Option<u64> {
        let (periods, tolerance) = self.periods(time, first);
        let nearest = periods.round();
        (nearest >= 0.0 && (periods - nearest).abs() <= tolerance).then_some(nearest as u64)
    }

    /// The next sample or effect after `time`.
    fn next_after(self, time: f64) -> f64 {
        let next = |first: f64| {
            let (periods, tolerance) = self.periods(time, first);
            (periods + tolerance).floor().max(-1.0).mul_add(self.every, self.every + first)
        };
        if self.delay > 0.0 { next(0.0).min(next(self.delay)) } else { next(0.0) }
    }
}

impl Schedule {
    /// The schedule of some torques; `None` if none is sampled.
    pub fn of(torques: &[Torque]) -> Option<Self> {
        let mut laws: Vec<Sampling> = torques.iter().filter_map(Torque::control).map(Control::sampling).collect();
        laws.sort_by(|a, b| a.every.total_cmp(&b.every).then(a.delay.total_cmp(&b.delay)));
        laws.dedup();
        (!laws.is_empty()).then_some(Self { laws })
    }

    /// The next change after `time`.
    pub fn next_after(&self, time: f64) -> f64 {
        self.laws.iter().map(|law| law.next_after(time)).fold(f64::INFINITY, f64::min)
    }

    /// The end of the part without changes that begins at `time`: the next change, or `end` if that comes first or nearly coincides with
    /// the change.
    pub fn part(&self, time: f64, end: f64) -> f64 {
        let next = self.next_after(time);
        let shortest = self.laws.iter().map(|law| law.every).fold(f64::INFINITY, f64::min);
        if next + TOGETHER * shortest < end { next } else { end }
    }

    /// Whether anything changes at `time`.
    pub fn changes_at(&self, time: f64) -> bool {
        self.laws.iter().any(|law| law.sample_at(time).is_some() || law.effect_at(time).is_some())
    }

    /// The approximate number of changes within a span.
    pub fn changes_in(&self, span: f64) -> f64 {
        let of_law = |law: &Sampling| span / law.every * if law.delay > 0.0 { 2.0 } else { 1.0 };
        self.laws.iter().map(of_law).sum()
    }

    /// The number of equal steps of at most `longest` from `start` to `end`, with a step ending at each change.
    pub fn steps(&self, start: f64, end: f64, longest: f64) -> u64 {
        let steps = |from: f64, to: f64| steps_over(to - from, longest).steps;
        let (mut time, mut sum) = (start, 0_u64);
        // For a single law without a delay, all parts except the first and the last are alike.
        if let [Sampling { every, delay: 0.0 }] = self.laws[..] {
            let first = self.part(start, end);
            let whole = ((end - first) / every - TOGETHER).floor();
            if whole > 2.0 {
                let whole = whole - 1.0;
                sum = steps(start, first).saturating_add(steps_over(every, longest).steps.saturating_mul(whole as u64));
                time = first + whole * every;
            }
        }
        while time < end {
            let next = self.part(time, end);
            sum = sum.saturating_add(steps(time, next));
            time = next;
        }
        sum
    }
}

/// The number of equal steps between two times, of at most `longest` seconds, where the values that torques hold may change in between.
pub(crate) fn steps_between(schedule: Option<&Schedule>, (start, end): (f64, f64), longest: f64) -> u64 {
    match schedule {
        Some(schedule) => schedule.steps(start, end, longest),
        None => steps_over(end - start, longest).steps,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parts(schedule: &Schedule, start: f64, end: f64) -> Vec<f64> {
        let mut times = vec![start];
        while *times.last().expect("one") < end {
            let next = schedule.part(*times.last().expect("one"), end);
            assert!(next > *times.last().expect("one"));
            times.push(next);
        }
        times
    }

    #[test]
    fn a_span_is_cut_at_samples_and_effects_and_nowhere_else() {
        let one = Schedule { laws: vec![Sampling { every: 0.1, delay: 0.0 }] };
        assert_eq!(parts(&one, 0.0, 0.25), [0.0, 0.1, 0.2, 0.25]);
        // Three times 0.1 is not exactly 0.3.
        assert_eq!(parts(&one, 0.15, 0.3), [0.15, 0.2, 0.3]);
        assert!(one.changes_at(0.3) && one.changes_at(3.0 * 0.1) && !one.changes_at(0.301));
        let delayed = Schedule { laws: vec![Sampling { every: 1.0, delay: 1.25 }] };
        assert_eq!(parts(&delayed, 0.0, 3.0), [0.0, 1.0, 1.25, 2.0, 2.25, 3.0]);
        assert_eq!(delayed.laws[0].effect_at(0.25), None);
        assert_eq!((delayed.laws[0].effect_at(2.25), delayed.laws[0].sample_at(2.25)), (Some(1), None));
        let two = Schedule { laws: vec![Sampling { every: 0.3, delay: 0.0 }, Sampling { every: 0.2, delay: 0.0 }] };
        assert_eq!(parts(&two, 0.0, 0.7).len(), 6);
    }

    #[test]
    fn steps_are_counted_as_they_are_cut() {
        let schedules = [
            Schedule { laws: vec![Sampling { every: 0.1, delay: 0.0 }] },
            Schedule { laws: vec![Sampling { every: 0.07, delay: 0.02 }] },
            Schedule { laws: vec![Sampling { every: 0.3, delay: 0.0 }, Sampling { every: 0.2, delay: 0.45 }] },
        ];
        for schedule in &schedules {
            for (start, end) in [(0.0, 10.0), (0.05, 7.33), (0.1, 0.15), (3.0, 3.0), (0.0, 0.1), (0.3, 1000.0)] {
                for longest in [0.013, 0.04, 0.1, 5.0] {
                    let cut = parts(schedule, start, end);
                    let one_by_one: u64 = cut.windows(2).map(|pair| steps_over(pair[1] - pair[0], longest).steps).sum();
                    assert_eq!(schedule.steps(start, end, longest), one_by_one, "{schedule:?} {start} {end} {longest}");
                }
            }
        }
    }

    #[test]
    fn late_samples_are_still_told_apart() {
        let law = Sampling { every: 0.1, delay: 0.0 };
        for sample in [1_u64, 999_999, 123_456_789] {
            let time = sample as f64 * 0.1;
            for time in [time.next_down(), time, time.next_up()] {
                assert_eq!(law.sample_at(time), Some(sample));
                assert_eq!(law.sample_at(law.next_after(time)), Some(sample + 1));
            }
        }
    }
}
