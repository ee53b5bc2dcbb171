//! Benchmarks: run time against error, and the machine's ceilings.
//!
//! Every benchmark appends [rows](row::Row) to a [table](row::Table), one for each case, each with its [`provenance`]. A new benchmark
//! lists its cases, each with a [`Case`] label, measures one at a time through `sweep`, which handles the filter, progress, existing rows
//! and Ctrl-C, and joins its cells to those of [`Bench::origin`].

use std::collections::HashSet;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use crate::engine::Engine;
use crate::error::Result;

pub mod accuracy;
pub(crate) mod ceiling;
pub mod compare;
mod costs;
pub mod drift;
pub mod front;
pub mod kernels;
pub mod problem;
pub mod provenance;
pub mod row;
pub mod skipping;
pub mod stability;
pub(crate) mod strategy;
pub mod throughput;
pub(crate) mod timing;
mod warm;

use provenance::Provenance;
use row::{Row, Table};
use timing::Repeats;
use warm::Warm;

/// The options of all benchmarks.
#[derive(Clone, Debug)]
pub struct Bench {
    /// Whether the run is a quick one of about a minute rather than one whose figures are kept.
    pub quick: bool,
    /// Only cases whose label contains this.
    pub filter: Option<String>,
    /// Skip cases for which the table has a row of the same commit, adapter and mode.
    pub resume: bool,
    /// The engines to measure.
    pub engines: Vec<Engine>,
    /// The provenance of rows.
    pub provenance: Provenance,
}

impl Bench {
    /// The first cells of a row made now with `engine`.
    pub fn origin(&self, engine: &Engine) -> Row {
        self.provenance.of(&engine.description(), rayon::current_num_threads()).with("quick", self.quick)
    }

    /// How often work is repeated.
    pub fn repeats(&self) -> Repeats {
        if self.quick { Repeats::QUICK } else { Repeats::FULL }
    }
}

/// The progress of a benchmark.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step<'a> {
    /// Cases done.
    pub done: usize,
    /// Cases in all.
    pub total: usize,
    /// The next case; empty at the end.
    pub label: &'a str,
}

/// Receives progress and decides whether to go on.
pub type Watcher<'a> = dyn FnMut(Step<'_>) -> ControlFlow<()> + 'a;

/// One thing to be measured.
pub trait Case {
    /// The label that distinguishes it within its benchmark, for the filter, progress and the column `case`.
    fn label(&self) -> String;

    /// The engine that it is measured on.
    fn engine(&self) -> &Engine;
}

/// The results of a sweep.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Swept {
    /// The rows of this run, in order.
    pub rows: Vec<Row>,
    /// Cases that were not measured, because the watcher broke off or because their rows existed.
    pub left_out: usize,
    /// The tables that rows are appended to.
    pub tables: Vec<PathBuf>,
}

/// Measures the cases one by one and appends a row for each to the table `name` in `folder` as soon as it is measured.
///
/// A row is [`Bench::origin`], the label in the column `case`, and what `measure` returns.
fn sweep<C: Case>(
    bench: &Bench,
    folder: &Path,
    name: &str,
    cases: &[C],
    watcher: &mut Watcher<'_>,
    mut measure: impl FnMut(&C, &mut Warm) -> Result<Row>,
) -> Result<Swept> {
    let mut table = Table::open(folder, name)?;
    let present = if bench.resume { keys(&table.rows()?) } else { HashSet::new() };
    let wanted = |label: &str| bench.filter.as_deref().is_none_or(|part| label.contains(part));
    let cases: Vec<(String, &C)> =
        cases.iter().map(|case| (case.label(), case)).filter(|(label, _)| wanted(label)).collect();
    let total = cases.len();
    let mut warm: Option<Warm> = None;
    let mut swept = Swept { tables: vec![folder.join(format!("{name}.csv"))], ..Swept::default() };
    for (done, (label, case)) in cases.into_iter().enumerate() {
        if watcher(Step { done, total, label: &label }).is_break() {
            swept.left_out += total - done;
            return Ok(swept);
        }
        let head = bench.origin(case.engine()).with("case", label.as_str());
        if bench.resume && present.contains(&key(&head)) {
            swept.left_out += 1;
            continue;
        }
        let description = case.engine().description();
        let mut device = match warm.take().filter(|warm| warm.is_for(&description)) {
            Some(warm) => warm,
            None => Warm::new(&description)?,
        };
        let row = head.join(&measure(case, &mut device)?);
        warm = Some(device);
        table.append(&row)?;
        swept.rows.push(row);
    }
    let _ = watcher(Step { done: total, total, label: "" });
    Ok(swept)
}

/// The key that distinguishes rows of different runs.
fn key(row: &Row) -> [String; 6] {
    ["commit", "dirty", "adapter", "threads", "quick", "case"].map(|name| row.text(name))
}

fn keys(rows: &[Row]) -> HashSet<[String; 6]> {
    rows.iter().map(key).collect()
}
