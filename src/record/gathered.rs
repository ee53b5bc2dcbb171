//! Statistics of quantities gathered at an output time, block by block of bodies, so that parts of an ensemble can be joined.

#[cfg(feature = "study")]
use std::ops::Range;

#[cfg(feature = "study")]
use serde::{Deserialize, Serialize};

use super::{HistogramCounts, Statistics, Summary};
use crate::math::{Moments, MomentsTree, Sketch};
use crate::scene::{Histogram, Observed, Quantity};

/// What is gathered for a quantity that has statistics.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "study", derive(Serialize, Deserialize))]
pub(crate) struct GatheredQuantity {
    /// By block of bodies.
    pub moments: Vec<Moments>,
    /// Empty if no quantiles are asked for.
    pub sketch: Sketch,
}

/// What is gathered for such a quantity from the bodies of a cell.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "study", derive(Serialize, Deserialize))]
pub(crate) struct GatheredInCell {
    pub moments: MomentsTree,
    /// Empty if no quantiles are asked for.
    pub sketch: Sketch,
}

/// What is gathered from the bodies of a cell ([`Observed::cells`]).
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "study", derive(Serialize, Deserialize))]
pub(crate) struct GatheredCell {
    /// Bodies that have not failed.
    pub bodies: usize,
    /// In the order in which statistics are asked for.
    pub quantities: Vec<GatheredInCell>,
    /// The counts of each histogram.
    pub histograms: Vec<Vec<u64>>,
}

/// Statistics and histograms of the bodies of a cell at an output time ([`crate::Scene::by_cell`]).
#[derive(Clone, Debug, PartialEq)]
pub struct OfCell {
    /// The statistics; without summaries if the scene asks for none.
    pub statistics: Statistics,
    /// The histograms, in the order in which the scene asks for them.
    pub histograms: Vec<HistogramCounts>,
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
    /// The same for the bodies of each cell; empty if it is not asked for.
    #[cfg_attr(feature = "study", serde(default, skip_serializing_if = "Vec::is_empty"))]
    pub(crate) cells: Vec<GatheredCell>,
}

/// Counts of the bins, and of the values on either side of them.
fn no_counts(histograms: &[Histogram]) -> Vec<Vec<u64>> {
    histograms.iter().map(|histogram| vec![0; histogram.bins() + 2]).collect()
}

#[cfg(feature = "study")]
fn add_counts(counts: &mut [Vec<u64>], found: &[Vec<u64>]) {
    for (own, found) in counts.iter_mut().zip(found) {
        own.iter_mut().zip(found).for_each(|(own, count)| *own += count);
    }
}

#[cfg(feature = "study")]
fn are_of(counts: &[Vec<u64>], histograms: &[Histogram]) -> bool {
    counts.len() == histograms.len()
        && counts.iter().zip(histograms).all(|(counts, histogram)| counts.len() == histogram.bins() + 2)
}

/// The figures of a quantity.
fn summary(quantity: &Quantity, moments: Moments, sketch: &Sketch, quantiles: &[f64]) -> Summary {
    let Moments { count, mean, squares, least, greatest } = moments;
    let any = count > 0;
    let or_nan = |value: f64| if any { value } else { f64::NAN };
    let quantile = |&percent: &f64| match any {
        true => sketch.quantile(percent).clamp(least.0, greatest.0),
        false => f64::NAN,
    };
    Summary {
        quantity: quantity.clone(),
        count: count as usize,
        mean: or_nan(mean),
        standard_deviation: or_nan((squares / count as f64).sqrt()),
        min: or_nan(least.0),
        max: or_nan(greatest.0),
        min_body: any.then_some(least.1),
        max_body: any.then_some(greatest.1),
        quantiles: quantiles.iter().map(quantile).collect(),
    }
}

impl Gathered {
    /// An empty value for this many blocks, the first of which is block `first` of the whole.
    pub(crate) fn new(observed: &Observed, blocks: usize, first: usize) -> Self {
        let quantity = GatheredQuantity { moments: vec![Moments::default(); blocks], sketch: Sketch::default() };
        let in_cell = GatheredInCell { moments: MomentsTree::before(first), sketch: Sketch::default() };
        let cell = GatheredCell {
            bodies: 0,
            quantities: vec![in_cell; observed.statistics.len()],
            histograms: no_counts(&observed.histograms),
        };
        Self {
            bodies: 0,
            quantities: vec![quantity; observed.statistics.len()],
            histograms: no_counts(&observed.histograms),
            cells: vec![cell; observed.cells.unwrap_or(0)],
        }
    }

    /// Whether it can be a result for what is asked for.
    #[cfg(feature = "study")]
    pub(crate) fn fits(&self, observed: &Observed) -> bool {
        let Observed { statistics, histograms, cells, .. } = observed;
        self.quantities.len() == statistics.len()
            && are_of(&self.histograms, histograms)
            && self.cells.len() == cells.unwrap_or(0)
            && self
                .cells
                .iter()
                .all(|cell| cell.quantities.len() == statistics.len() && are_of(&cell.histograms, histograms))
    }

    /// Whether it can be a result for this many bodies, in these blocks of the whole: nothing is counted more often, and extremes belong to
    /// them.
    #[cfg(feature = "study")]
    pub(crate) fn is_of(&self, bodies: usize, blocks: &Range<usize>) -> bool {
        let within = |counts: &[u64]| {
            counts.iter().try_fold(0_u64, |sum, count| sum.checked_add(*count)).is_some_and(|sum| sum <= bodies as u64)
        };
        let is_own = |moments: &Moments| {
            let [least, greatest] = [moments.least, moments.greatest];
            moments.count == 0
                || (least.0 <= greatest.0 && moments.squares >= 0.0 && least.1 < bodies && greatest.1 < bodies)
        };
        let are_own = |moments: &[Moments]| {
            moments.iter().all(is_own) && within(&moments.iter().map(|moments| moments.count).collect::<Vec<_>>())
        };
        let is_of_cell = |cell: &GatheredCell| {
            cell.bodies <= bodies
                && cell.quantities.iter().all(|quantity| {
                    let moments: Vec<Moments> = quantity.moments.parts().copied().collect();
                    quantity.moments.is_of(blocks) && are_own(&moments) && quantity.sketch.count() <= bodies as u64
                })
                && cell.histograms.iter().all(|counts| within(counts))
        };
        self.bodies <= bodies
            && self
                .quantities
                .iter()
                .all(|GatheredQuantity { moments, sketch }| are_own(moments) && sketch.count() <= bodies as u64)
            && self.histograms.iter().all(|counts| within(counts))
            && self.cells.iter().all(is_of_cell)
    }

    /// Appends what was gathered from the blocks that follow, whose bodies are counted from `first_body`.
    #[cfg(feature = "study")]
    pub(crate) fn append(&mut self, other: Self, first_body: usize) {
        self.bodies += other.bodies;
        for (own, found) in self.quantities.iter_mut().zip(other.quantities) {
            own.moments.extend(found.moments.into_iter().map(|moments| moments.counted_from(first_body)));
            own.sketch.merge(&found.sketch);
        }
        add_counts(&mut self.histograms, &other.histograms);
        for (own, found) in self.cells.iter_mut().zip(other.cells) {
            own.bodies += found.bodies;
            for (own, found) in own.quantities.iter_mut().zip(found.quantities) {
                own.moments.append(found.moments, first_body);
                own.sketch.merge(&found.sketch);
            }
            add_counts(&mut own.histograms, &found.histograms);
        }
    }

    /// The statistics and histograms of all of it at `time`, s.
    pub(crate) fn summed(&self, observed: &Observed, time: f64) -> (Statistics, Vec<HistogramCounts>) {
        let of_quantity = |(quantity, gathered): (&Quantity, &GatheredQuantity)| {
            let all = gathered.moments.iter().copied().fold(Moments::default(), Moments::merged);
            summary(quantity, all, &gathered.sketch, &observed.quantiles)
        };
        let summaries = observed.statistics.iter().zip(&self.quantities).map(of_quantity).collect();
        (Statistics { time, count: self.bodies, summaries }, counts_at(time, &self.histograms))
    }

    /// The same of the bodies of each cell; empty if it is not asked for.
    pub(crate) fn summed_by_cell(&self, observed: &Observed, time: f64) -> Vec<OfCell> {
        let of_quantity = |(quantity, gathered): (&Quantity, &GatheredInCell)| {
            summary(quantity, gathered.moments.all(), &gathered.sketch, &observed.quantiles)
        };
        let of_cell = |cell: &GatheredCell| {
            let summaries = observed.statistics.iter().zip(&cell.quantities).map(of_quantity).collect();
            let statistics = Statistics { time, count: cell.bodies, summaries };
            OfCell { statistics, histograms: counts_at(time, &cell.histograms) }
        };
        self.cells.iter().map(of_cell).collect()
    }
}

fn counts_at(time: f64, histograms: &[Vec<u64>]) -> Vec<HistogramCounts> {
    histograms.iter().map(|counts| HistogramCounts { time, counts: counts.clone() }).collect()
}
