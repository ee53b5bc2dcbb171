//! Errors of statistics in `report.json`.

use std::fmt;

use serde::Serialize;

use crate::plan::StatisticError;
use crate::record::StatisticalSample;

/// The errors of the statistics for which errors are asked, due to the integration and to the number of bodies.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StatisticalAccuracyReport {
    /// Error asked for means, as a part of the quantity's spread.
    pub mean: Option<f64>,
    /// Error asked for quantiles, likewise.
    pub quantile: Option<f64>,
    /// Error asked for mean event times, as a part of the span.
    pub event_time: Option<f64>,
    /// Bodies of the sample that was recomputed.
    pub bodies: usize,
    /// Those of them that failed in the run.
    pub lost: usize,
    /// Those of them whose recomputation failed.
    pub diverged: usize,
    /// For each statistic, the time at which the evidence against it is strongest.
    pub errors: Vec<StatisticErrorReport>,
    /// Whether the errors are as small as asked for ([`StatisticalSample::met`]).
    pub met: Option<bool>,
    #[serde(skip)]
    sample: StatisticalSample,
}

/// A statistic's error and its parts, stated as parts of `scale`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StatisticErrorReport {
    /// The statistic, the parts of its error and the error asked for.
    #[serde(flatten)]
    pub error: StatisticError,
    /// Whether the sample shows that the error of the integration is less than asked for.
    pub shown: bool,
    /// Whether it shows that the error is greater.
    pub missed: bool,
}

impl From<StatisticalSample> for StatisticalAccuracyReport {
    fn from(sample: StatisticalSample) -> Self {
        let report = |error: &StatisticError| StatisticErrorReport {
            error: error.clone(),
            shown: error.is_shown(),
            missed: error.is_missed(),
        };
        Self {
            mean: sample.target.mean,
            quantile: sample.target.quantile,
            event_time: sample.target.event_time,
            bodies: sample.bodies,
            lost: sample.lost,
            diverged: sample.diverged,
            errors: sample.errors.iter().map(report).collect(),
            met: sample.met,
            sample,
        }
    }
}

/// The most lines in the summary, the worst statistics first.
const MOST_LINES: usize = 8;

impl fmt::Display for StatisticalAccuracyReport {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(formatter, "  asked    {}, of the integration", self.sample.target)?;
        let mut errors: Vec<&StatisticError> = self.sample.errors.iter().collect();
        errors.sort_by(|a, b| {
            let rank = |error: &StatisticError| (error.bound() / error.wanted, error.is_missed());
            let (a, b) = (rank(a), rank(b));
            b.1.cmp(&a.1).then(b.0.total_cmp(&a.0))
        });
        let left_out = |count: usize| format!("{count} of {} bodies have no finite value", self.bodies);
        for error in errors.iter().take(MOST_LINES) {
            if !error.is_known() {
                writeln!(formatter, "           {}: not known, {}", error.label(), left_out(error.left_out))?;
                continue;
            }
            let at = error.time.map_or(String::new(), |time| format!(" at {time:.4e} s"));
            writeln!(
                formatter,
                "           {}{at}: integration {:.1e} (+- {:.1e}), number of bodies {}",
                error.label(),
                error.integration,
                error.confidence,
                error.of_number()
            )?;
        }
        if errors.len() > MOST_LINES {
            writeln!(formatter, "           and {} more, in report.json", errors.len() - MOST_LINES)?;
        }
        let bodies = if self.bodies == 1 { "body" } else { "bodies" };
        let of = format!("{} {bodies} recomputed in f64", self.bodies);
        write!(formatter, "           ")?;
        match self.met {
            Some(true) => write!(formatter, "met, shown by {of}")?,
            Some(false) => write!(formatter, "NOT MET in {of}")?,
            None if self.sample.is_undecided() => {
                write!(formatter, "NOT SHOWN to be met: {of} scatter by more than that")?;
            }
            None if self.sample.random => {
                write!(formatter, "not measured: a random torque has other draws in other steps")?
            }
            None => write!(formatter, "not known")?,
        }
        if self.lost > 0 {
            write!(formatter, ", {} of the sample failed", self.lost)?;
        } else if self.sample.failed > 0 {
            write!(formatter, ", {} of all bodies failed", self.sample.failed)?;
        }
        if self.diverged > 0 {
            write!(formatter, ", {} could not be recomputed", self.diverged)?;
        }
        match self.sample.undefined() {
            0 => {}
            undefined => write!(formatter, "; up to {} and are left out", left_out(undefined))?,
        }
        writeln!(formatter)
    }
}
