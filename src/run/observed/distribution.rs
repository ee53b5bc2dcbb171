//! Statistics, quantiles and histograms of values as they come.

use std::ops::Range;

use super::evaluator::Values;
use crate::engine::reduction::Formed;
use crate::math::parallel;
use crate::record::Gathered;
use crate::scene::{Histogram, Observed, Quantity};

/// Gathers the distributions wanted at an output time.
pub(super) struct Distributions<'p> {
    observed: &'p Observed,
    /// The indices, among all quantities, of those with statistics, and of those of the histograms.
    statistics: Vec<usize>,
    histograms: Vec<usize>,
    /// The blocks by which statistics are formed.
    blocks: Vec<Range<usize>>,
    gathered: Gathered,
}

impl<'p> Distributions<'p> {
    /// For the bodies in some blocks; `number` gives the index of a quantity.
    pub fn new(observed: &'p Observed, blocks: Vec<Range<usize>>, number: impl Fn(&Quantity) -> usize) -> Self {
        let statistics = observed.statistics.iter().map(&number).collect();
        let histograms = observed.histograms.iter().map(|histogram| number(histogram.quantity())).collect();
        let gathered = Gathered::new(observed, blocks.len());
        Self { observed, statistics, histograms, blocks, gathered }
    }

    /// Takes the values of the bodies from `first_body` on.
    pub fn push(&mut self, first_body: usize, values: &Values) {
        let has_quantiles = !self.observed.quantiles.is_empty();
        let blocks = &self.blocks;
        self.gathered.bodies += values.sound();
        parallel::for_each_task(
            self.gathered.quantities.iter_mut().zip(&self.statistics),
            |_, (gathered, &quantity)| {
                for (row, values) in values.of(quantity) {
                    let bodies = first_body + row..first_body + row + values.len();
                    let first = blocks.partition_point(|block| block.end <= bodies.start);
                    for (block, moments) in blocks.iter().zip(&mut gathered.moments).skip(first) {
                        if block.start >= bodies.end {
                            break;
                        }
                        let own = block.start.max(bodies.start)..block.end.min(bodies.end);
                        let values = &values[own.start - bodies.start..own.end - bodies.start];
                        moments.add(own.start, values);
                    }
                    if has_quantiles {
                        gathered.sketch.extend(values.iter().copied());
                    }
                }
            },
        );
        let histograms = self.observed.histograms.iter().zip(&self.histograms);
        let tasks = self.gathered.histograms.iter_mut().zip(histograms);
        parallel::for_each_task(tasks, |_, (counts, (histogram, &quantity))| {
            for (_, values) in values.of(quantity) {
                count(histogram, values, counts);
            }
        });
    }

    /// For each histogram the index of its quantity and its edges.
    pub fn histograms(&self) -> Vec<(usize, &'p [f64])> {
        let edges = self.observed.histograms.iter().map(Histogram::edges);
        self.histograms.iter().copied().zip(edges).collect()
    }

    /// Takes the results formed for the bodies of a group, block by block.
    pub fn take_formed(&mut self, formed: Formed) {
        self.gathered.bodies += formed.sound;
        for (block, found) in formed.moments.into_iter().enumerate() {
            for (gathered, found) in self.gathered.quantities.iter_mut().zip(found) {
                gathered.moments[block] = gathered.moments[block].merged(found);
            }
        }
        for (counts, found) in self.gathered.histograms.iter_mut().zip(formed.histograms) {
            counts.iter_mut().zip(found).for_each(|(count, found)| *count += found);
        }
    }

    /// Returns what was gathered, and begins the next output.
    pub fn take(&mut self) -> Gathered {
        std::mem::replace(&mut self.gathered, Gathered::new(self.observed, self.blocks.len()))
    }
}

fn count(histogram: &Histogram, values: &[f64], counts: &mut [u64]) {
    for &value in values.iter().filter(|value| value.is_finite()) {
        counts[histogram.place(value)] += 1;
    }
}
