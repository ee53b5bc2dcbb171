//! Compares two runs of the accuracy benchmark, case by case.

use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;

use super::accuracy::TABLE;
use super::row::{Row, rows};
use crate::error::Result;

/// Prefixes of the names of columns that do not depend on a clock: two runs of one program on one machine agree in them to the last
/// digit.
const WITHOUT_CLOCK: [&str; 8] =
    ["attitude_rad", "energy_drift", "momentum_drift", "steps_mean", "failed_bodies", "valid", "fault", "truth"];

/// Times that differ by more than this factor should rank alike in both runs.
const APART: f64 = 1.5;

/// How two runs agree and differ.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// Cases that both runs have.
    pub cases: usize,
    /// Cases that only one of them has.
    pub alone: usize,
    /// Cases that differ in a column without a clock, with the columns.
    pub differing: Vec<(String, Vec<String>)>,
    /// Time of the new run over that of the old one: least, median, greatest.
    pub ratio: [f64; 3],
    /// Pairs of cases of one problem that rank alike by time, and those that do not.
    pub pairs: [u64; 2],
    /// The same for pairs whose times in the old run differ by more than a factor of 1.5.
    pub pairs_apart: [u64; 2],
}

/// Compares the rows that `polhode bench accuracy` wrote in two folders; of several rows of a case the last counts.
///
/// # Errors
///
/// [`crate::Error::Rows`] and [`crate::Error::File`] for tables that cannot be read.
pub fn compare(old: &Path, new: &Path) -> Result<Comparison> {
    let (old, new) = (last_of_case(rows(old, TABLE)?), last_of_case(rows(new, TABLE)?));
    let shared: Vec<(&Row, &Row)> = old.iter().filter_map(|(case, row)| Some((row, new.get(case)?))).collect();
    let differing = shared.iter().filter_map(|(old, new)| {
        let names = columns_that_differ(old, new);
        (!names.is_empty()).then(|| (old.text("case"), names))
    });
    let seconds = |row: &Row| row.number("seconds_median");
    let mut ratios: Vec<f64> = shared.iter().map(|(old, new)| seconds(new) / seconds(old)).collect();
    ratios.retain(|ratio| ratio.is_finite());
    ratios.sort_by(f64::total_cmp);
    let at = |part: usize| ratios.get(part * ratios.len().saturating_sub(1) / 2).copied().unwrap_or(f64::NAN);
    let (mut pairs, mut pairs_apart) = ([0; 2], [0; 2]);
    for (index, (old, new)) in shared.iter().enumerate() {
        for (other_old, other_new) in &shared[index + 1..] {
            if old.text("problem") != other_old.text("problem") {
                continue;
            }
            let (before, after) = (seconds(old) / seconds(other_old), seconds(new) / seconds(other_new));
            if !(before.is_finite() && after.is_finite()) {
                continue;
            }
            let reversed = usize::from((before < 1.0) != (after < 1.0));
            pairs[reversed] += 1;
            if before.max(before.recip()) > APART {
                pairs_apart[reversed] += 1;
            }
        }
    }
    Ok(Comparison {
        cases: shared.len(),
        alone: old.len() + new.len() - 2 * shared.len(),
        differing: differing.collect(),
        ratio: [at(0), at(1), at(2)],
        pairs,
        pairs_apart,
    })
}

/// The last row of each case, by mode and case.
fn last_of_case(rows: Vec<Row>) -> BTreeMap<(bool, String), Row> {
    rows.into_iter().map(|row| ((row.flag("quick"), row.text("case")), row)).collect()
}

fn columns_that_differ(old: &Row, new: &Row) -> Vec<String> {
    let kept = |name: &&str| WITHOUT_CLOCK.iter().any(|start| name.starts_with(start));
    old.names().filter(kept).filter(|name| old.text(name) != new.text(name)).map(str::to_owned).collect()
}

/// Kendall's rank correlation: 1 if all pairs rank alike, 0 if as many do as do not.
fn correlation([alike, reversed]: [u64; 2]) -> f64 {
    (alike as f64 - reversed as f64) / (alike + reversed) as f64
}

impl fmt::Display for Comparison {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(formatter, "{} cases in both runs, {} in one", self.cases, self.alone)?;
        let same = self.cases - self.differing.len();
        writeln!(formatter, "{same} agree to the last digit in every column without a clock")?;
        for (case, columns) in &self.differing {
            writeln!(formatter, "    {case}: {}", columns.join(", "))?;
        }
        let [least, median, greatest] = self.ratio;
        writeln!(formatter, "time, new over old: median {median:.2}, {least:.2} to {greatest:.2}")?;
        let line = |pairs: [u64; 2]| {
            format!("{:.3} ({} of {} pairs reversed)", correlation(pairs), pairs[1], pairs[0] + pairs[1])
        };
        writeln!(formatter, "ranking by time within a problem, Kendall's tau: {}", line(self.pairs))?;
        writeln!(formatter, "    of times more than {APART} apart: {}", line(self.pairs_apart))
    }
}
