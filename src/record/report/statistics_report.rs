//! Statistics in `report.json`.

use std::fmt;

use serde::Serialize;

use crate::record::{Statistics, Summary};

/// Statistics of all bodies that did not fail, at the end.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StatisticsReport {
    /// Bodies behind the figures.
    pub count: usize,
    /// One entry for each quantity.
    pub quantities: Vec<SummaryReport>,
}

/// Statistics of one quantity.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SummaryReport {
    /// Its name.
    pub quantity: String,
    /// Its unit.
    pub unit: String,
    /// The arithmetic mean over the bodies.
    pub mean: f64,
    /// The standard deviation of the bodies as they are (divided by their number).
    pub standard_deviation: f64,
    /// The least.
    pub min: f64,
    /// The greatest.
    pub max: f64,
    /// The body with the least.
    pub min_body: Option<usize>,
    /// The body with the greatest.
    pub max_body: Option<usize>,
    /// The quantiles asked for, in ascending order.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub quantiles: Vec<f64>,
}

impl From<&Statistics> for StatisticsReport {
    fn from(statistics: &Statistics) -> Self {
        let summary = |summary: &Summary| {
            let Summary { mean, standard_deviation, min, max, min_body, max_body, .. } = *summary;
            let (quantity, unit) = (summary.quantity.name().to_owned(), summary.quantity.unit().to_owned());
            let quantiles = summary.quantiles.clone();
            SummaryReport { quantity, unit, mean, standard_deviation, min, max, min_body, max_body, quantiles }
        };
        Self { count: statistics.count, quantities: statistics.summaries.iter().map(summary).collect() }
    }
}

impl fmt::Display for StatisticsReport {
    /// Prints a line for each quantity, if there are bodies.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.count == 0 {
            return writeln!(formatter, "  end      no statistics: there are no bodies");
        }
        let mut name = "end";
        for of in &self.quantities {
            let SummaryReport { quantity, unit, mean, standard_deviation: deviation, min, max, .. } = of;
            let unit = if unit == "1" { String::new() } else { format!(" {unit}") };
            writeln!(
                formatter,
                "  {name:<8} {quantity}: mean {mean:.3e}{unit}, standard deviation {deviation:.3e}, from {min:.3e} to {max:.3e}"
            )?;
            name = "";
        }
        Ok(())
    }
}
