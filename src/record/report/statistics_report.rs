//! Statistics in `report.json`.

use std::fmt;

use serde::Serialize;

use crate::record::{Statistics, Summary};

/// Statistics of all bodies that did not fail, at the end.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StatisticsReport {
    /// How many they are.
    pub count: usize,
    /// One entry for each quantity.
    pub quantities: Vec<SummaryReport>,
}

/// Statistics of one quantity.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SummaryReport {
    /// The figures.
    #[serde(flatten)]
    pub summary: Summary,
    /// The output time at which most bodies had no finite value, the last of several; absent if every body had one at every output time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub undefined: Option<UndefinedReport>,
}

/// Bodies that had no finite value of a quantity, though they had not failed: its statistics leave them out.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct UndefinedReport {
    /// The output time, s.
    pub time: f64,
    /// How many bodies.
    pub bodies: usize,
    /// Of so many that had not failed.
    pub of: usize,
}

impl UndefinedReport {
    fn new(statistics: &Statistics, summary: &Summary) -> Option<Self> {
        let bodies = statistics.count.saturating_sub(summary.count);
        (bodies > 0).then_some(Self { time: statistics.time, bodies, of: statistics.count })
    }
}

impl StatisticsReport {
    /// The report of a run's statistics, one entry for each output time, in order; `None` if there are none.
    pub fn of<'a>(all: impl IntoIterator<Item = &'a Statistics>) -> Option<Self> {
        all.into_iter().fold(None, |earlier, next| Some(Self::after(earlier, next)))
    }

    /// The report at the output time of `next`; `earlier` is that of the one before.
    pub(crate) fn after(earlier: Option<Self>, next: &Statistics) -> Self {
        let mut report = Self::from(next);
        for (own, earlier) in report.quantities.iter_mut().zip(earlier.into_iter().flat_map(|report| report.quantities))
        {
            let bodies = |undefined: Option<UndefinedReport>| undefined.map_or(0, |undefined| undefined.bodies);
            if bodies(earlier.undefined) > bodies(own.undefined) {
                own.undefined = earlier.undefined;
            }
        }
        report
    }
}

impl From<&Statistics> for StatisticsReport {
    fn from(statistics: &Statistics) -> Self {
        let summary = |summary: &Summary| SummaryReport {
            summary: summary.clone(),
            undefined: UndefinedReport::new(statistics, summary),
        };
        Self { count: statistics.count, quantities: statistics.summaries.iter().map(summary).collect() }
    }
}

impl fmt::Display for StatisticsReport {
    /// Prints a line for each quantity, if there are bodies, and another if some bodies have no finite value of it.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.count == 0 {
            return writeln!(formatter, "  end      no statistics: no bodies are left");
        }
        let mut name = "end";
        for of in &self.quantities {
            let Summary { quantity, count, mean, standard_deviation: deviation, min, max, .. } = &of.summary;
            let (quantity, unit) = (quantity.name(), quantity.unit());
            let unit = if unit == "1" { String::new() } else { format!(" {unit}") };
            match count {
                0 => writeln!(formatter, "  {name:<8} {quantity}: no statistics, as no body has a finite value")?,
                _ => writeln!(
                    formatter,
                    "  {name:<8} {quantity}: mean {mean:.3e}{unit}, standard deviation {deviation:.3e}, from {min:.3e} to {max:.3e}"
                )?,
            }
            name = "";
            if let Some(UndefinedReport { time, bodies, of: all }) = of.undefined {
                // Of times with the same number the last is kept: that of the end, if as many lack it then.
                let at = match self.count - count {
                    at_end if at_end == bodies => "at the end".to_owned(),
                    0 => format!("at {time} s"),
                    at_end => format!("at {time} s, {at_end} of {} at the end", self.count),
                };
                let have = if bodies == 1 { "has" } else { "have" };
                writeln!(
                    formatter,
                    "           {quantity}: {bodies} of {all} bodies {have} no finite value (NaN or infinite) {at}: its statistics leave them out"
                )?;
            }
        }
        Ok(())
    }
}
