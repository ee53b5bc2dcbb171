//! The errors of a run's statistics, compared with more accurate motions.

use std::fmt;

use crate::plan::StatisticError;
use crate::scene::StatisticalAccuracy;

/// The errors due to the integration in a run's statistics and mean event times, measured on a sample of its bodies that was recomputed on
/// the CPU in `f64` (torque-free ones by the closed form, the others by Taylor series or, where these are too dear or cannot follow, by `rk8`
/// in adaptive steps), and those due to the number of bodies.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "study", derive(serde::Serialize))]
pub struct StatisticalSample {
    /// The errors asked for.
    #[cfg_attr(feature = "study", serde(flatten))]
    pub target: StatisticalAccuracy,
    /// Bodies of the sample.
    pub bodies: usize,
    /// Those of them that failed in the run.
    pub lost: usize,
    /// Those of them whose recomputation failed.
    pub diverged: usize,
    /// Bodies of the whole run that failed, which no statistic includes.
    #[cfg_attr(feature = "study", serde(skip))]
    pub failed: usize,
    /// Whether a random torque acts: another motion has other draws, and is no reference.
    #[cfg_attr(feature = "study", serde(skip))]
    pub random: bool,
    /// For each statistic with an error asked for, the time at which the evidence against it is strongest.
    #[cfg_attr(feature = "study", serde(skip))]
    pub errors: Vec<StatisticError>,
    /// Whether every error is as small as asked for, at each of the times compared, for the bodies that have a finite value
    /// ([`StatisticError::left_out`]). Not met if the sample shows that a statistic is further off, if a body of it has failed, or a larger
    /// part of all bodies than the least error asked for. `None` if this is not known: if the scatter of the sample is greater than what was
    /// asked for ([`Self::is_undecided`]), or a statistic's own resolution is ([`StatisticError::resolution`]), without bodies, if none has a
    /// finite value of a quantity, if some could not be recomputed, and if a random torque acts.
    pub met: Option<bool>,
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
        let sample = Self { target, bodies, lost, diverged, failed, random, errors, met: None };
        let is_whole = lost == 0 && failed as f64 <= sample.target.strictest() * all as f64;
        let is_missed = sample.errors.iter().any(StatisticError::is_missed);
        let is_shown = sample.errors.iter().all(StatisticError::is_shown);
        let is_decided = sample.is_measured() && (is_missed || is_shown);
        Self { met: (!is_whole || is_decided).then_some(is_whole && !is_missed), ..sample }
    }

    fn is_measured(&self) -> bool {
        self.bodies > 0 && !self.errors.is_empty() && !self.random && self.diverged == 0
    }

    /// Whether the sample neither shows that the errors are as small as asked for nor that one is greater: it scatters too much. For chaotic
    /// motions it mostly does.
    pub fn is_undecided(&self) -> bool {
        self.met.is_none() && self.is_measured() && self.errors.iter().all(StatisticError::is_known)
    }

    /// Whether only the resolution of some statistics is in the way of that: quantiles of many bodies, and event times known to an output.
    pub(crate) fn is_unresolved(&self) -> bool {
        let is_enough = |error: &StatisticError| error.is_shown() || error.is_unresolved();
        self.is_undecided() && self.errors.iter().all(is_enough)
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
        match self.met {
            Some(true) => write!(formatter, "statistics as asked for ({})", self.target),
            Some(false) => write!(formatter, "statistics NOT MET ({})", self.target),
            None if self.is_unresolved() => {
                write!(
                    formatter,
                    "statistics NOT SHOWN to be as asked for ({}), which is finer than they are known",
                    self.target
                )
            }
            None if self.is_undecided() => {
                write!(formatter, "statistics NOT SHOWN to be as asked for by {} bodies ({})", self.bodies, self.target)
            }
            None => write!(formatter, "errors of statistics not known"),
        }?;
        match self.undefined() {
            0 => Ok(()),
            undefined => write!(formatter, ", without {undefined} of {} bodies that have no finite value", self.bodies),
        }
    }
}
