//! Statistics at output times, formed where the states are or from states that were read.

use std::ops::Range;

use crate::bodies::BodyState;
use crate::engine::reduction::merged;
use crate::error::Result;
use crate::kernel::observe::{Partial, Statistic, merge_all};
use crate::run::group_run::GroupRun;

/// The statistics of each block of bodies, formed where their states are.
pub(super) fn reduced(group_runs: &mut [GroupRun<'_>], statistics: &[Statistic]) -> Result<Vec<Vec<Partial<f64>>>> {
    let found = group_runs.iter_mut().map(|group_run| group_run.reduce(statistics)).collect::<Result<Vec<_>>>()?;
    let blocks = found.first().map_or(0, Vec::len);
    let of_block = |block: usize| -> Vec<Partial<f64>> {
        let of_statistic = |index: usize| {
            // Skips groups without bodies in this block: which groups exist depends on the other blocks.
            let own = found.iter().map(|group| group[block][index]).filter(|found| found.count > 0);
            merge_all(&own.collect::<Vec<_>>())
        };
        (0..statistics.len()).map(of_statistic).collect()
    };
    Ok((0..blocks).map(of_block).collect())
}

/// Forms statistics from states as they are read.
pub(super) struct FromStates<'a> {
    statistics: &'a [Statistic],
    blocks: Vec<Range<usize>>,
    /// The pieces of each block that has begun.
    found: Vec<Vec<Vec<Partial<f64>>>>,
}

impl<'a> FromStates<'a> {
    pub fn new(statistics: &'a [Statistic], blocks: Vec<Range<usize>>) -> Self {
        Self { statistics, found: vec![Vec::new(); blocks.len()], blocks }
    }

    /// Takes the states of the bodies from `first_body` on, of which `rotation` gives the rotation.
    pub fn push<S>(&mut self, first_body: usize, states: &[S], rotation: impl Fn(&S) -> &BodyState) {
        if self.statistics.is_empty() {
            return;
        }
        let end = first_body + states.len();
        let first = self.blocks.partition_point(|block| block.end <= first_body);
        for (block, found) in self.blocks.iter().zip(&mut self.found).skip(first) {
            if block.start >= end {
                break;
            }
            let bodies = block.start.max(first_body)..block.end.min(end);
            let of_statistic = |&statistic: &Statistic| {
                let own = bodies.clone().zip(states[bodies.start - first_body..].iter().map(&rotation));
                let sound = own.filter(|(_, state)| state.is_sound());
                let values: Vec<(u32, f64)> = sound.map(|(body, state)| (body as u32, statistic.of(state))).collect();
                Partial::of_values(&values, 0)
            };
            found.push(self.statistics.iter().map(of_statistic).collect());
        }
    }

    /// The statistics of each block.
    pub fn finish(self) -> Vec<Vec<Partial<f64>>> {
        self.found.iter().map(|pieces| merged(pieces, self.statistics.len())).collect()
    }
}
