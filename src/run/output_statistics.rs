//! Statistics at output times: where the states are, or from the states that were read.

use super::OutputState;
use crate::error::Result;
use crate::kernel::observe::{Partial, Statistic, merge};
use crate::record::Statistics;
use crate::run::group_run::GroupRun;

/// The statistics of all groups' bodies, formed where their states are.
pub(super) fn reduced(group_runs: &mut [GroupRun<'_>], statistics: &[Statistic], time: f64) -> Result<Statistics> {
    let mut total = vec![Partial::none(); statistics.len()];
    for group_run in group_runs {
        for (total, found) in total.iter_mut().zip(group_run.reduce(statistics)?) {
            *total = merge(*total, found);
        }
    }
    Ok(Statistics::new(time, statistics, &total))
}

/// Takes states as they are read.
pub(super) struct FromStates<'a> {
    statistics: &'a [Statistic],
    total: Vec<Partial<f64>>,
}

impl<'a> FromStates<'a> {
    pub fn new(statistics: &'a [Statistic]) -> Self {
        Self { statistics, total: vec![Partial::none(); statistics.len()] }
    }

    /// Takes the states of the bodies from `first_body` on.
    pub fn push(&mut self, first_body: usize, states: &[OutputState]) {
        for (total, &statistic) in self.total.iter_mut().zip(self.statistics) {
            let sound = states.iter().enumerate().filter(|(_, state)| state.rotation.is_sound());
            let values: Vec<(u32, f64)> =
                sound.map(|(row, state)| ((first_body + row) as u32, statistic.of(&state.rotation))).collect();
            *total = merge(*total, Partial::of_values(&values, 0));
        }
    }

    pub fn finish(self, time: f64) -> Statistics {
        Statistics::new(time, self.statistics, &self.total)
    }
}
