//! Statistics of quantities gathered at an output time, block by block of bodies, so that parts of an ensemble can be joined.

#[cfg(feature = "study")]
use serde::{Deserialize, Serialize};

use super::{HistogramCounts, Statistics, Summary};
use crate::math::{Moments, Sketch};
use crate::scene::{Observed, Quantity};

/// What is gathered for a quantity that has statistics.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "study", derive(Serialize, Deserialize))]
pub(crate) struct GatheredQuantity {
    /// By block of bodies.
    pub moments: Vec<Moments>,
    /// Empty if no quantiles are asked for.
    pub sketch: Sketch,
}

/// What is gathered from some blocks of bodies at an output time. Statistics, quantiles and histograms of all bodies are computed from it;
/// the result is the same to the bit for any number of parts.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "study", derive(Serialize, Deserialize))]
pub struct Gathered {
    /// Bodies that have not failed.
    pub(crate) bodies: usize,
    /// In the order in which statistics are asked for.
    pub(crate) quantities: Vec<GatheredQuantity>,
    /// The counts of each histogram.
    pub(crate) histograms: Vec<Vec<u64>>,
}

impl Gathered {
    /// An empty value for this many blocks.
    pub(crate) fn new(observed: &Observed, blocks: usize) -> Self {
        let quantity = GatheredQuantity { moments: vec![Moments::default(); blocks], sketch: Sketch::default() };
        Self {
            bodies: 0,
            quantities: vec![quantity; observed.statistics.len()],
            histograms: observed.histograms.iter().map(|histogram| vec![0; histogram.bins() + 2]).collect(),
        }
    }

    /// Whether it can be a result for what is asked for.
    #[cfg(feature = "study")]
    pub(crate) fn fits(&self, observed: &Observed) -> bool {
        let Observed { statistics, histograms, .. } = observed;
        self.quantities.len() == statistics.len()
            && self.histograms.len() == histograms.len()
            && self.histograms.iter().zip(histograms).all(|(counts, histogram)| counts.len() == histogram.bins() + 2)
    }

    /// Whether it can be a result for this many bodies: nothing is counted more often, and extremes belong to them.
    #[cfg(feature = "study")]
    pub(crate) fn is_of(&self, bodies: usize) -> bool {
        let within = |counts: &[u64]| {
            counts.iter().try_fold(0_u64, |sum, count| sum.checked_add(*count)).is_some_and(|sum| sum <= bodies as u64)
        };
        let is_own = |moments: &Moments| {
            let [least, greatest] = [moments.least, moments.greatest];
            moments.count == 0
                || (least.0 <= greatest.0 && moments.squares >= 0.0 && least.1 < bodies && greatest.1 < bodies)
        };
        self.bodies <= bodies
            && self.quantities.iter().all(|quantity| {
                let GatheredQuantity { moments, sketch } = quantity;
                moments.iter().all(is_own)
                    && within(&moments.iter().map(|moments| moments.count).collect::<Vec<_>>())
                    && sketch.count() <= bodies as u64
            })
            && self.histograms.iter().all(|counts| within(counts))
    }

    /// Appends what was gathered from the blocks that follow, whose bodies are counted from `first_body`.
    #[cfg(feature = "study")]
    pub(crate) fn append(&mut self, other: Self, first_body: usize) {
        self.bodies += other.bodies;
        for (own, found) in self.quantities.iter_mut().zip(other.quantities) {
            own.moments.extend(found.moments.into_iter().map(|moments| moments.counted_from(first_body)));
            own.sketch.merge(&found.sketch);
        }
        for (own, found) in self.histograms.iter_mut().zip(other.histograms) {
            own.iter_mut().zip(found).for_each(|(own, count)| *own += count);
        }
    }

    /// The statistics and histograms of all of it at `time`, s.
    pub(crate) fn summed(&self, observed: &Observed, time: f64) -> (Statistics, Vec<HistogramCounts>) {
        let summary = |(quantity, gathered): (&Quantity, &GatheredQuantity)| {
            let all = gathered.moments.iter().copied().fold(Moments::default(), Moments::merged);
            let Moments { count, mean, squares, least, greatest } = all;
            let any = count > 0;
            let or_nan = |value: f64| if any { value } else { f64::NAN };
            let quantile = |&percent: &f64| gathered.sketch.quantile(percent).clamp(least.0, greatest.0);
            Summary {
                quantity: quantity.clone(),
                count: count as usize,
                mean: or_nan(mean),
                standard_deviation: or_nan((squares / count as f64).sqrt()),
                min: or_nan(least.0),
                max: or_nan(greatest.0),
                min_body: any.then_some(least.1),
                max_body: any.then_some(greatest.1),
                quantiles: observed.quantiles.iter().map(quantile).collect(),
            }
        };
        let summaries = observed.statistics.iter().zip(&self.quantities).map(summary).collect();
        let histograms = self.histograms.iter().map(|counts| HistogramCounts { time, counts: counts.clone() });
        (Statistics { time, count: self.bodies, summaries }, histograms.collect())
    }
}
