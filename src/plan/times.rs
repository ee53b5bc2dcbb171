//! Output times, and steps that hit them.

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

/// The output times of a scene, checked.
pub(crate) fn output_times(scene: &Scene) -> Result<Vec<f64>> {
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
        Outputs::Every(interval) => {
            if !(interval.is_finite() && *interval > 0.0) {
                return Err(Error::Setting {
                    field: "time.outputs.every",
                    value: *interval,
                    expected: "expected a finite interval above zero (s)",
                });
            }
            let count = end / interval;
            if count > MOST_OUTPUTS as f64 {
                return Err(Error::Setting {
                    field: "time.outputs.every",
                    value: *interval,
                    expected: "more than 1e7 outputs would follow: use a longer interval (s)",
                });
            }
            let whole = steps_over(end, *interval).steps as usize;
            let mut times: Vec<f64> =
                (1..=whole).map(|n| n as f64 * interval).take_while(|&t| t < end * (1.0 - 1e-12)).collect();
            times.push(end);
            Ok(times)
        }
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
