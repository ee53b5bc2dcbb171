//! The errors of a run's statistics, compared with more accurate motions.

use std::fmt;

use crate::plan::StatisticError;
use crate::scene::StatisticalAccuracy;

/// The errors due to the integration in a run's statistics and mean event times, measured on a sample of its bodies that was recomputed on
/// the CPU in `f64` (torque-free ones by the closed form, the others by `rk8` in adaptive steps at a tolerance of 1e-13), and those due to
/// the number of bodies.
#[derive(Clone, Debug, PartialEq)]
pub struct StatisticalSample {
    /// The errors asked for.
    pub target: StatisticalAccuracy,
    /// Bodies of the sample.
    pub bodies: usize,
    /// Those of them that failed in the run.
    pub lost: usize,
    /// Those of them whose recomputation failed.
    pub diverged: usize,
    /// Bodies of the whole run that failed, which no statistic includes.
    pub failed: usize,
    /// Whether a random torque acts: another motion has other draws, and is no reference.
    pub random: bool,
    /// For each statistic with an error asked for, the time at which the evidence against it is strongest.
    pub errors: Vec<StatisticError>,
    /// Whether the sample is consistent with the errors asked for: no statistic is further off, at any of the times compared, than the
    /// scatter of the sample explains, for the bodies that have a finite value ([`StatisticError::left_out`]). Not met if a body of the
    /// sample has failed, or a larger part of all bodies than the least error asked for. `None` if this is not known: without bodies, if
    /// none has a finite value of a quantity, if some could not be recomputed, and if a random torque acts.
    pub met: Option<bool>,
    /// Whether the sample proves that every error is as small as asked for, rather than only being consistent with it. For chaotic motions
    /// a sample seldom does.
    pub shown: bool,
}

impl StatisticalSample {
    /// The verdict from `errors` and the missing bodies, out of `all` bodies.
    pub(crate) fn new(
        target: StatisticalAccuracy,
        (bodies, lost, diverged): (usize, usize, usize),
        (failed, all): (usize, usize),
        random: bool,
        errors: Vec<StatisticError>,
    ) -> Self {
        let is_measured = bodies > 0 && !errors.is_empty() && !random && diverged == 0;
        let is_whole = lost == 0 && failed as f64 <= target.strictest() * all as f64;
        let is_missed = errors.iter().any(StatisticError::is_missed);
        let is_decided = is_measured && (is_missed || errors.iter().all(StatisticError::is_known));
        Self {
            target,
            bodies,
            lost,
            diverged,
            failed,
            random,
            met: (lost > 0 || !is_whole || is_decided).then_some(is_whole && !is_missed),
            shown: is_measured && is_whole && errors.iter().all(StatisticError::is_shown),
            errors,
        }
    }

    /// Bodies of the sample that had no finite value of a quantity, beside those that failed or could not be recomputed: the most for any
    /// statistic; 0 if they may all be such.
    pub(crate) fn undefined(&self) -> usize {
        let left_out = self.errors.iter().map(|error| error.left_out).max().unwrap_or(0);
        if left_out > self.lost + self.diverged { left_out } else { 0 }
    }
}

impl fmt::Display for StatisticalSample {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.met, self.shown) {
            (Some(true), true) => write!(formatter, "statistics as asked for ({})", self.target),
            (Some(true), false) => {
                write!(formatter, "statistics as asked for as far as {} bodies tell ({})", self.bodies, self.target)
            }
            (Some(false), _) => write!(formatter, "statistics NOT MET ({})", self.target),
            (None, _) => write!(formatter, "errors of statistics not known"),
        }?;
        match self.undefined() {
            0 => Ok(()),
            undefined => write!(formatter, ", without {undefined} of {} bodies that have no finite value", self.bodies),
        }
    }
}
