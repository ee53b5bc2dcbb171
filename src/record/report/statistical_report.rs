//! Errors of statistics in `report.json`.

use std::fmt;

use serde::Serialize;

use crate::plan::StatisticError;
use crate::record::StatisticalSample;
use crate::scene::StatisticalTarget;

/// The errors of the statistics for which errors are asked, due to the integration and to the number of bodies.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StatisticalAccuracyReport {
    /// The errors asked for, and the sample that was recomputed.
    #[serde(flatten)]
    pub sample: StatisticalSample,
    /// For each statistic, the time at which the evidence against it is strongest.
    pub errors: Vec<StatisticErrorReport>,
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
        Self { errors: sample.errors.iter().map(report).collect(), sample }
    }
}

/// The most lines in the summary, the worst statistics first.
const MOST_LINES: usize = 8;

impl fmt::Display for StatisticalAccuracyReport {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sample = &self.sample;
        writeln!(formatter, "  asked    {}, of the integration", sample.target)?;
        let mut errors: Vec<&StatisticError> = sample.errors.iter().collect();
        errors.sort_by(|a, b| {
            let rank = |error: &StatisticError| (error.bound() / error.wanted, error.is_missed());
            let (a, b) = (rank(a), rank(b));
            b.1.cmp(&a.1).then(b.0.total_cmp(&a.0))
        });
        let left_out = |count: usize| format!("{count} of {} bodies have no finite value", sample.bodies);
        for error in errors.iter().take(MOST_LINES) {
            if !error.is_known() {
                writeln!(formatter, "           {}: not known, {}", error.label(), left_out(error.left_out))?;
                continue;
            }
            let at = error.time.map_or(String::new(), |time| format!(" at {time:.4e} s"));
            writeln!(
                formatter,
                "           {}{at}: integration {:.1e} (+- {:.1e}), number of bodies {}{}{}",
                error.label(),
                error.integration,
                error.confidence,
                error.of_number(),
                match error.is_unresolved() {
                    true => format!("; known to {:.1e} {}", error.resolution, error.target.scale()),
                    false => String::new(),
                },
                match error.unnoticed {
                    0 => String::new(),
                    unnoticed => format!("; it went unnoticed in {unnoticed} of {} bodies", sample.bodies),
                }
            )?;
        }
        if errors.len() > MOST_LINES {
            writeln!(formatter, "           and {} more, in report.json", errors.len() - MOST_LINES)?;
        }
        let bodies = if sample.bodies == 1 { "body" } else { "bodies" };
        let of = format!("{} {bodies} recomputed in f64", sample.bodies);
        write!(formatter, "           ")?;
        match sample.met {
            Some(true) => write!(formatter, "met, shown by {of}")?,
            Some(false) => write!(formatter, "NOT MET in {of}")?,
            None if sample.is_unresolved() => {
                let is_by_events =
                    |error: &&StatisticError| error.is_unresolved() && error.target != StatisticalTarget::Quantile;
                let why = match sample.errors.iter().any(|error| is_by_events(&error)) {
                    true => ", as events may come and go between two times at which they are sought (time.checks)",
                    false => "",
                };
                write!(
                    formatter,
                    "NOT SHOWN to be met by {of}: what is asked for is finer than the figures are known{why}"
                )?;
            }
            None if sample.is_undecided() => {
                write!(formatter, "NOT SHOWN to be met: {of} scatter by more than that")?;
            }
            None if sample.random => write!(formatter, "not measured: a random torque has other draws in other steps")?,
            None => write!(formatter, "not known")?,
        }
        if sample.lost > 0 {
            write!(formatter, ", {} of the sample failed", sample.lost)?;
        } else if sample.failed > 0 {
            write!(formatter, ", {} of all bodies failed", sample.failed)?;
        }
        if sample.diverged > 0 {
            write!(formatter, ", {} could not be recomputed", sample.diverged)?;
        }
        match sample.undefined() {
            0 => {}
            undefined => write!(formatter, "; up to {} and are left out", left_out(undefined))?,
        }
        writeln!(formatter)
    }
}
