//! Statistics, quantiles and histograms of values as they come.

use std::ops::Range;

use super::evaluator::Values;
use crate::bodies::Blocks;
use crate::engine::reduction::Formed;
use crate::math::{Moments, parallel};
use crate::record::Gathered;
use crate::run::group_run::blocks_of;
use crate::scene::{Histogram, Observed, Quantity, Scene};

/// Gathers the distributions wanted at an output time.
pub(super) struct Distributions<'p> {
    observed: &'p Observed,
    /// The indices, among all quantities, of those with statistics, and of those of the histograms.
    statistics: Vec<usize>,
    histograms: Vec<usize>,
    /// The blocks by which statistics are formed.
    blocks: Vec<Range<usize>>,
    /// The first of them among those of the whole study, and the index of the first body there.
    first_block: usize,
    first_body: usize,
    /// The moments of the bodies of a block that is not over, by cell, then by quantity.
    open: Vec<Vec<Moments>>,
    gathered: Gathered,
}

impl<'p> Distributions<'p> {
    /// For the bodies of a scene; `number` gives the index of a quantity.
    pub fn new(scene: &'p Scene, number: impl Fn(&Quantity) -> usize) -> Self {
        let observed = scene.observed();
        let statistics = observed.statistics.iter().map(&number).collect();
        let histograms = observed.histograms.iter().map(|histogram| number(histogram.quantity())).collect();
        let (blocks, part): (Vec<_>, _) = (blocks_of(scene).collect(), scene.part());
        let first_block = part.first_body / Blocks::of(part.of).size();
        let gathered = Gathered::new(observed, blocks.len(), first_block);
        let open = vec![vec![Moments::default(); observed.statistics.len()]; observed.cells.unwrap_or(0)];
        Self { observed, statistics, histograms, blocks, first_block, first_body: part.first_body, open, gathered }
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
        self.push_by_cell(first_body, values);
    }

    /// The same for each cell, if that is asked for.
    fn push_by_cell(&mut self, first_body: usize, values: &Values) {
        let Self { observed, statistics, histograms, blocks, .. } = self;
        let Some(cells) = observed.cells else { return };
        let bodies = first_body..first_body + values.count();
        let cell_of = |body: usize| (self.first_body + body) % cells;
        let mut failed = vec![0; cells];
        values.failed().iter().for_each(|&place| failed[cell_of(first_body + place)] += 1);
        // The blocks of the bodies, those of them that end here, and the first one.
        let first_block = blocks.partition_point(|block| block.end <= bodies.start);
        let blocks = &blocks[first_block..blocks.partition_point(|block| block.start < bodies.end)];
        let ended = blocks.iter().take_while(|block| block.end <= bodies.end).count();
        let tasks = self.gathered.cells.iter_mut().zip(&mut self.open).zip(&failed);
        parallel::for_each_task(tasks, |cell, ((gathered, open), failed)| {
            let mut numbers = Vec::new();
            let first_of = |start: usize| start + (cell + cells - cell_of(start)) % cells;
            let own = |bodies: Range<usize>| (first_of(bodies.start)..bodies.end).step_by(cells);
            let mut next = own(bodies.clone()).next();
            gathered.bodies += own(bodies.clone()).count() - failed;
            // Blocks before this one are over.
            let mut at = 0;
            loop {
                let block =
                    next.map_or(blocks.len(), |body| at + blocks[at..].partition_point(|block| block.end <= body));
                let over = block.min(ended).saturating_sub(at);
                if over > 0 {
                    for (gathered, open) in gathered.quantities.iter_mut().zip(open.iter_mut()) {
                        gathered.moments.push(std::mem::take(open));
                        gathered.moments.skip(over as u64 - 1);
                    }
                }
                at = block;
                let Some(first) = next else { break };
                let within = first..blocks[block].end.min(bodies.end);
                let places = gathered.quantities.iter_mut().zip(open.iter_mut()).zip(statistics.iter());
                for ((gathered, open), &quantity) in places {
                    numbers.clear();
                    numbers.extend(own(within.clone()).map(|body| values.at(quantity, body - first_body)));
                    let mut found = Moments::default();
                    found.add(0, &numbers);
                    *open = open.merged(found.renumbered(|place| first + place * cells));
                    if !observed.quantiles.is_empty() {
                        gathered.sketch.extend(numbers.iter().copied());
                    }
                }
                next = own(within.end..bodies.end).next();
            }
            let of_histograms = observed.histograms.iter().zip(histograms.iter());
            for (counts, (histogram, &quantity)) in gathered.histograms.iter_mut().zip(of_histograms) {
                numbers.clear();
                numbers.extend(own(bodies.clone()).map(|body| values.at(quantity, body - first_body)));
                count(histogram, &numbers, counts);
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
        let next = Gathered::new(self.observed, self.blocks.len(), self.first_block);
        std::mem::replace(&mut self.gathered, next)
    }
}

fn count(histogram: &Histogram, values: &[f64], counts: &mut [u64]) {
    for &value in values.iter().filter(|value| value.is_finite()) {
        counts[histogram.place(value)] += 1;
    }
}
