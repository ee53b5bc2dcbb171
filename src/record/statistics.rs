//! Statistics of an ensemble at an output time.

use crate::engine::reduction::merged;
use crate::kernel::observe::{Partial, Statistic};
use crate::scene::Quantity;

/// Statistics of all bodies at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct Statistics {
    /// The time, s.
    pub time: f64,
    /// Bodies whose state is finite and for which no step reported failure; [`Summary::count`] says how many have a quantity.
    pub count: usize,
    /// The summary of each quantity asked for, in that order.
    pub summaries: Vec<Summary>,
}

/// Statistics of one quantity, in its unit ([`Quantity::unit`]); without bodies all figures but the count are NaN.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "study", derive(serde::Serialize))]
pub struct Summary {
    /// The quantity.
    #[cfg_attr(feature = "study", serde(flatten, serialize_with = "name_and_unit"))]
    pub quantity: Quantity,
    /// Bodies behind the figures: those with a finite value, of the bodies that have not failed ([`Statistics::count`]).
    pub count: usize,
    /// The arithmetic mean over the bodies.
    pub mean: f64,
    /// The square root of the mean squared deviation from the mean, over the bodies as they are (not as a sample of a larger
    /// population: divided by their number, not by one less).
    pub standard_deviation: f64,
    /// The least.
    pub min: f64,
    /// The greatest.
    pub max: f64,
    /// The body with the least; of equal ones, one of them.
    pub min_body: Option<usize>,
    /// The body with the greatest; of equal ones, one of them.
    pub max_body: Option<usize>,
    /// The quantiles that the scene asks for, in that order ([`crate::Scene::quantiles`]).
    #[cfg_attr(feature = "study", serde(skip_serializing_if = "Vec::is_empty"))]
    pub quantiles: Vec<f64>,
}

#[cfg(feature = "study")]
fn name_and_unit<S: serde::Serializer>(of: &Quantity, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map([("quantity", of.name()), ("unit", of.unit())])
}

impl Statistics {
    /// Statistics of all bodies from those of each of their blocks, in order.
    pub(crate) fn new(time: f64, statistics: &[Statistic], blocks: &[Vec<Partial<f64>>]) -> Self {
        let found = &merged(blocks, statistics.len());
        let summary = |(&statistic, found): (&Statistic, &Partial<f64>)| {
            let any = found.count > 0;
            Summary {
                quantity: statistic.into(),
                count: found.count as usize,
                mean: found.mean(),
                standard_deviation: found.standard_deviation(),
                min: if any { found.least.value() } else { f64::NAN },
                max: if any { found.greatest.value() } else { f64::NAN },
                min_body: any.then_some(found.least.body as usize),
                max_body: any.then_some(found.greatest.body as usize),
                quantiles: Vec::new(),
            }
        };
        Self {
            time,
            count: found.first().map_or(0, |found| found.count as usize),
            summaries: statistics.iter().zip(found).map(summary).collect(),
        }
    }

    /// The summary of one quantity, if it was asked for.
    pub fn of(&self, quantity: impl Into<Quantity>) -> Option<&Summary> {
        let quantity = quantity.into();
        self.summaries.iter().find(|summary| summary.quantity == quantity)
    }
}
