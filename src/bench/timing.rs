//! Wall times of repeated work.

use crate::error::Result;

/// How often work is repeated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Repeats {
    /// The least number, so that there is a median.
    pub least: usize,
    /// The greatest number.
    pub most: usize,
    /// The total time of the repeats, s, after which there are no more.
    pub enough: f64,
}

impl Repeats {
    /// For figures that are kept.
    pub const FULL: Self = Self { least: 3, most: 15, enough: 0.3 };
    /// For a quick run.
    pub const QUICK: Self = Self { least: 3, most: 5, enough: 0.02 };
}

/// Wall times of the repeats, s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Timing {
    /// The middle one, or the mean of the two in the middle.
    pub median: f64,
    /// The shortest.
    pub least: f64,
    /// Longest minus shortest, as a fraction of the median.
    pub spread: f64,
    /// Number of repeats.
    pub repeats: usize,
}

impl Timing {
    /// Those of work that was refused.
    pub(crate) const UNKNOWN: Self = Self { median: f64::NAN, least: f64::NAN, spread: f64::NAN, repeats: 0 };

    /// The figures of some wall times, s; `times` must not be empty.
    pub fn of(times: &mut [f64]) -> Self {
        times.sort_by(f64::total_cmp);
        let (least, greatest) = (times[0], times[times.len() - 1]);
        let median = 0.5 * (times[(times.len() - 1) / 2] + times[times.len() / 2]);
        Self { median, least, spread: (greatest - least) / median, repeats: times.len() }
    }
}

/// Repeats `work`, which returns the wall time to be counted, s.
///
/// # Errors
///
/// The first error of `work`.
pub fn repeat(repeats: Repeats, mut work: impl FnMut() -> Result<f64>) -> Result<Timing> {
    let mut times = Vec::new();
    let mut spent = 0.0;
    while times.len() < repeats.least.max(1) || (times.len() < repeats.most && spent < repeats.enough) {
        let seconds = work()?;
        spent += seconds;
        times.push(seconds);
    }
    Ok(Timing::of(&mut times))
}
