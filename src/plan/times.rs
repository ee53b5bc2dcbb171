//! Output times, other times at which steps end, and steps that hit all of them.

use crate::error::{Error, Result};
pub use crate::math::equal_steps::Interval;
pub(crate) use crate::math::equal_steps::steps_over;
use crate::scene::{Outputs, Scene};

/// More output times than this are refused: nobody reads them, and the list alone takes 80 MB.
pub const MOST_OUTPUTS: usize = 10_000_000;

/// The longest step over `span` seconds. A span of zero takes no step, so it allows every length.
pub(crate) fn longest_over(span: f64) -> f64 {
    if span > 0.0 { span } else { 1.0 }
}

const TOO_MANY_OUTPUTS: &str = "more than 1e7 outputs would follow: use a longer interval (s)";
const TOO_MANY_CHECKS: &str = "more than 1e7 checks would follow: use a longer interval (s)";

/// A check this near an output, as a part of the interval between checks, is left out: the output is one.
const SAME: f64 = 1e-9;

/// The times at which a run stops to look at its bodies.
#[derive(Clone, Debug)]
pub(crate) struct Times {
    /// The output times, s.
    outputs: Vec<f64>,
    /// These, the times between them at which events are checked, and the breaks, s, if there are any of the latter two.
    with_others: Option<Vec<f64>>,
    /// The number of checks.
    checks: usize,
    /// Other times at which steps end, s.
    breaks: Vec<f64>,
    /// Whether steps by series end at none of them.
    is_dense: bool,
}

impl Times {
    /// Outputs and checks of a scene.
    pub fn of(scene: &Scene) -> Result<Self> {
        let outputs = output_times(scene)?;
        let with_others = match scene.event_check_interval().filter(|_| !scene.wanted_events().is_empty()) {
            Some(every) => Some(with_checks(&outputs, every, scene.end())?),
            None => None,
        };
        let checks = with_others.as_ref().map_or(0, |all| all.len() - outputs.len());
        Ok(Self { outputs, with_others, checks, breaks: Vec::new(), is_dense: false })
    }

    /// The same with breaks, ascending. Those at an output or a check are left out, and those near one unless they are one side of a jump, whose
    /// other side is the next number.
    pub fn with_breaks(self, mut breaks: Vec<f64>) -> Self {
        let known = self.all();
        let least = SAME * known.last().copied().unwrap_or(0.0);
        let is_far = |time: f64, other: Option<&f64>| other.is_none_or(|other| (time - other).abs() > least);
        let is_in = |times: &[f64], time: f64| times.binary_search_by(|other| other.total_cmp(&time)).is_ok();
        let all = breaks.clone();
        let is_at_jump =
            |time: f64| [time.next_down(), time.next_up()].iter().any(|&next| is_in(&all, next) || is_in(known, next));
        breaks.retain(|&time| {
            let place = known.partition_point(|&known| known < time);
            let is_apart =
                is_far(time, known.get(place)) && is_far(time, place.checked_sub(1).map(|before| &known[before]));
            is_apart || is_at_jump(time) && !is_in(known, time)
        });
        if breaks.is_empty() {
            return self;
        }
        let mut all = [known, &breaks].concat();
        all.sort_by(f64::total_cmp);
        Self { with_others: Some(all), breaks, ..self }
    }

    /// Sets whether steps by series go beyond all of them.
    pub fn set_dense(&mut self, is_dense: bool) {
        self.is_dense = is_dense;
    }

    /// Whether steps by series go beyond all of them.
    pub fn is_dense(&self) -> bool {
        self.is_dense
    }

    /// The number of checks for events between output times, if there are any.
    pub fn checks(&self) -> Option<usize> {
        (self.checks > 0).then_some(self.checks)
    }

    /// The times that are neither outputs nor checks, s, ascending.
    pub fn breaks(&self) -> &[f64] {
        &self.breaks
    }

    /// The output times, s.
    pub fn outputs(&self) -> &[f64] {
        &self.outputs
    }

    /// All of them, s.
    pub fn all(&self) -> &[f64] {
        self.with_others.as_deref().unwrap_or(&self.outputs)
    }
}

/// Output times, and the multiples of `every` seconds that are none.
fn with_checks(outputs: &[f64], every: f64, end: f64) -> Result<Vec<f64>> {
    let checks = multiples(every, end, ("time.checks.every", TOO_MANY_CHECKS))?;
    let is_near =
        |check: f64, output: Option<&f64>| output.is_some_and(|output| (check - output).abs() <= SAME * every);
    let is_between = |&check: &f64| {
        let place = outputs.partition_point(|&output| output < check);
        !is_near(check, outputs.get(place)) && !is_near(check, place.checked_sub(1).map(|before| &outputs[before]))
    };
    let mut all: Vec<f64> = outputs.iter().copied().chain(checks.into_iter().filter(is_between)).collect();
    all.sort_by(f64::total_cmp);
    Ok(all)
}

/// The multiples of an interval up to the end, which is the last; `field` names the interval, with what is expected where there are too many.
fn multiples(interval: f64, end: f64, (field, too_many): (&'static str, &'static str)) -> Result<Vec<f64>> {
    if !(interval.is_finite() && interval > 0.0) {
        return Err(Error::Setting { field, value: interval, expected: "expected a finite interval above zero (s)" });
    }
    if end / interval > MOST_OUTPUTS as f64 {
        return Err(Error::Setting { field, value: interval, expected: too_many });
    }
    let whole = steps_over(end, interval).steps as usize;
    let mut times: Vec<f64> =
        (1..=whole).map(|n| n as f64 * interval).take_while(|&t| t < end * (1.0 - 1e-12)).collect();
    times.push(end);
    Ok(times)
}

/// The output times of a scene, checked.
fn output_times(scene: &Scene) -> Result<Vec<f64>> {
    let mut times = times_asked_for(scene)?;
    if scene.records_start() && times.first() != Some(&0.0) {
        times.insert(0, 0.0);
    }
    Ok(times)
}

fn times_asked_for(scene: &Scene) -> Result<Vec<f64>> {
    let end = scene.end();
    if !(end.is_finite() && end >= 0.0) {
        return Err(Error::Setting {
            field: "time.end",
            value: end,
            expected: "expected a finite time that is not negative (s)",
        });
    }
    match scene.output_times() {
        Outputs::End => Ok(vec![end]),
        Outputs::Every(interval) => multiples(*interval, end, ("time.outputs.every", TOO_MANY_OUTPUTS)),
        Outputs::Times(list) => {
            let mut times = Vec::with_capacity(list.len() + 1);
            let mut last = -1.0;
            for &time in list {
                if !(time.is_finite() && time >= 0.0 && time <= end) {
                    return Err(Error::Setting {
                        field: "time.outputs.times",
                        value: time,
                        expected: "expected times from 0 to the end (s)",
                    });
                }
                if time <= last {
                    return Err(Error::Setting {
                        field: "time.outputs.times",
                        value: time,
                        expected: "expected increasing times (s)",
                    });
                }
                last = time;
                times.push(time);
            }
            if last != end {
                times.push(end);
            }
            Ok(times)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checks_lie_between_outputs_and_leave_these_as_they_are() {
        let outputs = [0.0, 0.3, 1.0, 2.5];
        assert_eq!(with_checks(&outputs, 0.5, 2.5).expect("times"), [0.0, 0.3, 0.5, 1.0, 1.5, 2.0, 2.5]);
        // 3 × 0.1 is not 0.3 in binary.
        let found = with_checks(&outputs, 0.1, 2.5).expect("times");
        assert_eq!(found.len(), 26);
        assert!(outputs.iter().all(|output| found.contains(output)) && found.is_sorted_by(|a, b| a < b), "{found:?}");
        assert_eq!(with_checks(&outputs, 10.0, 2.5).expect("times"), outputs);
        for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-9] {
            assert!(matches!(
                with_checks(&outputs, wrong, 2.5),
                Err(Error::Setting { field: "time.checks.every", .. })
            ));
        }
    }

    /// A break at an output is left out, and so is one that rounding has put beside it; both sides of a jump stay, also if one is an output, and
    /// again if they are read from a plan.
    #[test]
    fn breaks_are_apart_from_outputs_unless_they_are_sides_of_a_jump() {
        let times =
            || Times { outputs: vec![1.0, 4.0], with_others: None, checks: 0, breaks: Vec::new(), is_dense: false };
        let jump = [3.0_f64.next_down(), 3.0];
        let found = times().with_breaks([&[0.5, 1.0 + 1e-12], &jump[..], &[4.0_f64.next_down()]].concat());
        let expected = [0.5, jump[0], jump[1], 4.0_f64.next_down()];
        assert_eq!(found.breaks(), expected);
        assert_eq!(found.all(), [0.5, 1.0, jump[0], jump[1], 4.0_f64.next_down(), 4.0]);
        assert_eq!(times().with_breaks(expected.to_vec()).breaks(), expected);
        assert_eq!(times().with_breaks(vec![1.0, 4.0 - 1e-12]).breaks(), [0.0; 0]);
    }
}
