//! Statistics at output times, formed where the states are.

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
