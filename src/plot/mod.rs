//! Pictures of the results of benchmarks and runs, as SVG and PNG.
//!
//! A [`figure::Figure`] says what is shown; [`draw`] draws it. Colour, mark and line each distinguish curves alone, so that pictures can
//! be read in black and white and by colour-blind readers.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::bench::row::Row;
use crate::error::{Error, FileAction, Result, RowFault};

mod draw;
#[doc(hidden)]
pub mod figure;
mod map;
mod means_by_cell;
mod observed;
mod run;
mod scale;
mod skipping;
mod snapshots;
mod stability;
mod statistics_over_time;
mod sweep;
mod throughput;
mod time;
mod times_by_cell;
mod work_precision;

pub use draw::draw;
pub use skipping::skipping;
pub use stability::stability;
pub use throughput::throughput;
pub(crate) use work_precision::work_precision;

use figure::Figure;

/// Draws the contents of `folder` into it: every benchmark table; the snapshots of a run with a picture for each of `bodies`, or else the
/// final states; its statistics, histograms and events, and their map if the run swept over a grid of two axes. The tables of a run may
/// have any format. Returns the files written; none if nothing can be drawn.
///
/// # Errors
///
/// [`crate::Error::File`], [`crate::Error::Rows`] and [`crate::Error::Table`] for files that cannot be read or written.
pub fn plot_folder(folder: &Path, bodies: &[usize]) -> Result<Vec<PathBuf>> {
    std::fs::read_dir(folder).map_err(|error| Error::file(folder, FileAction::Read, &error))?;
    let mut figures = Vec::new();
    for (machine, rows) in by_machine(crate::bench::row::rows(folder, crate::bench::accuracy::TABLE)?) {
        figures.push((format!("accuracy-{machine}"), work_precision(&rows)));
    }
    for (machine, rows) in by_machine(crate::bench::row::rows(folder, crate::bench::throughput::TABLE)?) {
        figures.push((format!("throughput-{machine}"), throughput(&rows)));
    }
    for (machine, rows) in by_machine(crate::bench::row::rows(folder, crate::bench::skipping::TABLE)?) {
        figures.push((format!("skipping-{machine}"), skipping(&rows)));
    }
    for precision in crate::math::Precision::ALL {
        let table = crate::bench::stability::table(precision);
        for (machine, rows) in by_machine(crate::bench::row::rows(folder, &table)?) {
            figures.push((format!("stability-{machine}-{precision}"), stability(&rows, precision.name())));
        }
    }
    let table = |stem| observed::table(folder, stem);
    let states = |stem| table(stem).filter(|path| snapshots::is_complete(path));
    match (states("snapshots"), states("final")) {
        (Some(path), _) => figures.extend(run::run(folder, &path, bodies)?),
        _ if !bodies.is_empty() => {
            return Err(Error::Rows { path: folder.to_owned(), fault: RowFault::NoSnapshots });
        }
        (None, Some(path)) if folder.join(crate::record::REPORT).exists() => {
            figures.push(("final".to_owned(), run::last(folder, &path)?));
        }
        _ => {}
    }
    let of_quantities = [statistics_over_time::TABLE, means_by_cell::TABLE, observed::HISTOGRAMS];
    let units = match of_quantities.into_iter().any(|stem| table(stem).is_some()) {
        true => run::units(folder)?,
        false => BTreeMap::new(),
    };
    let unit = |quantity: &str| units.get(quantity).cloned();
    if let Some(path) = table(statistics_over_time::TABLE) {
        figures.push(("statistics".to_owned(), statistics_over_time::statistics(folder, &path, &unit)?));
        figures.push(("means".to_owned(), statistics_over_time::means(folder, &path, &unit)?));
    }
    if let Some(path) = table(means_by_cell::TABLE) {
        let means = means_by_cell::means_by_cell(folder, &path, &unit)?;
        figures.extend(means.map(|means| ("means_by_cell".to_owned(), means)));
    }
    if let Some(path) = table(observed::HISTOGRAMS) {
        figures.push(("histograms".to_owned(), observed::histograms(folder, &path, &unit)?));
    }
    if let Some(path) = table(observed::SURVIVAL) {
        figures.push(("survival".to_owned(), observed::survival(folder, &path)?));
    }
    if let Some(path) = table(times_by_cell::TABLE) {
        let times = times_by_cell::times_by_cell(folder, &path)?;
        figures.extend(times.map(|times| ("times_by_cell".to_owned(), times)));
    }
    if let Some(map) = map::map(folder, &unit)? {
        figures.push(("map".to_owned(), map));
    }
    let mut written = Vec::new();
    for (name, figure) in figures {
        for ending in ["svg", "png"] {
            let path = folder.join(format!("{name}.{ending}"));
            draw(&figure, &path)?;
            written.push(path);
        }
    }
    Ok(written)
}

/// Rows with their indices in the table, by mode (`quick`) and case.
type Cases = BTreeMap<(bool, String), (usize, Row)>;

/// The rows of each engine under a name for files: `cpu`, `gpu` and, if several machines or adapters have rows, their names too. Of several
/// rows of one case the last counts, and quick ones only if there are no others.
fn by_machine(rows: Vec<Row>) -> Vec<(String, Vec<Row>)> {
    let mut machines: BTreeMap<(String, String), Cases> = BTreeMap::new();
    for (index, row) in rows.into_iter().enumerate() {
        let machine = format!("{} {}", row.text("cpu"), row.text("adapter"));
        let case = (row.flag("quick"), row.text("case"));
        let cases = machines.entry((row.text("engine"), machine)).or_default();
        cases.entry(case).and_modify(|last| last.1 = row.clone()).or_insert((index, row));
    }
    let kinds: Vec<String> = machines.keys().map(|(kind, _)| kind.clone()).collect();
    machines
        .into_iter()
        .map(|((kind, machine), mut cases)| {
            if cases.keys().any(|(quick, _)| !quick) {
                cases.retain(|(quick, _), _| !quick);
            }
            let mut rows: Vec<(usize, Row)> = cases.into_values().collect();
            rows.sort_by_key(|(index, _)| *index);
            let alone = kinds.iter().filter(|other| **other == kind).count() == 1;
            let name = if alone { kind } else { format!("{kind}-{}", slug(&machine)) };
            (name, rows.into_iter().map(|(_, row)| row).collect())
        })
        .collect()
}

/// Letters and digits in lower case, everything else as single hyphens.
fn slug(text: &str) -> String {
    let parts = text.split(|character: char| !character.is_ascii_alphanumeric()).filter(|part| !part.is_empty());
    parts.map(str::to_ascii_lowercase).collect::<Vec<_>>().join("-")
}

/// The machine, command and commit of the rows.
fn origin(rows: &[Row]) -> Vec<String> {
    let Some(row) = rows.last() else { return Vec::new() };
    let text = |name: &str| row.text(name);
    let software = if row.flag("software") { ", a SOFTWARE adapter" } else { "" };
    let changes = if text("dirty") == "yes" { ", with changes" } else { "" };
    let loads: Vec<f64> = rows.iter().map(|row| row.number("load")).filter(|load| load.is_finite()).collect();
    let (least, most) = loads.iter().fold((f64::INFINITY, 0.0_f64), |(a, b), &load| (a.min(load), b.max(load)));
    let load = if loads.is_empty() { String::new() } else { format!("; load {least} to {most}") };
    let driver = if text("driver").is_empty() { String::new() } else { format!(", {}", text("driver")) };
    let quick = if row.flag("quick") { "; quick run" } else { "" };
    vec![
        format!("{}{driver}{software}; {}, {} cores{load}", text("adapter"), text("cpu"), text("cores")),
        format!(
            "{}; commit {}{changes}; {}, {} build; {}{quick}",
            text("command"),
            text("commit").chars().take(12).collect::<String>(),
            text("compiler"),
            text("profile"),
            text("date"),
        ),
    ]
}

/// A figure with the origin of its rows in the caption.
fn figure(title: &str, columns: usize, notes: &[&str], rows: &[Row]) -> Figure {
    let mut caption: Vec<String> = notes.iter().map(|note| (*note).to_owned()).collect();
    caption.extend(origin(rows));
    Figure { title: title.to_owned(), caption, columns, ..Figure::default() }
}
