//! The tables of events, of survival (how many bodies have not had them yet), of the times by which shares of the bodies had them, and of
//! histograms.

use std::borrow::Cow;

use super::column::CELL;
use super::events::{EventRecord, Survival, TimeBy};
use super::folder::OutputFolder;
use super::table_file::{self, TableColumn};
use super::{EventOccurrence, HistogramCounts};
use crate::error::Result;
use crate::scene::Histogram;
use crate::study::Format;

/// The percentages of the table `times`.
const PERCENTAGES: [f64; 3] = [10.0, 50.0, 90.0];

/// Writes `events`, a row for each body and event that it had, `survival`, a row for each event and output time (and the start), and `times`,
/// a row for each event; `survival` and `times` for each cell, if there are any.
/// `cells` is the number of cells of the study's design, if it has one: body b lies in cell b modulo this.
pub(crate) fn write_events(
    folder: &mut OutputFolder,
    format: Format,
    events: &[EventRecord],
    times: &[f64],
    cells: Option<usize>,
) -> Result<()> {
    let rows: Vec<(&str, EventOccurrence)> = events
        .iter()
        .flat_map(|record| record.occurrences.iter().map(|occurrence| (record.event.name(), *occurrence)))
        .collect();
    let rows = &rows;
    let mut columns = vec![
        TableColumn::text("event", |row| rows[row].0),
        TableColumn::whole("body", |row| rows[row].1.body as u64),
        TableColumn::number("t", |row| rows[row].1.time),
        TableColumn::text("known_to", |row| rows[row].1.known_to.name()),
    ];
    columns.extend(TableColumn::of_rotation(|row| (rows[row].1.orientation, rows[row].1.angular_velocity_body)));
    if let Some(cells) = cells {
        columns.push(TableColumn::whole("cell", move |row| (rows[row].1.body % cells) as u64));
    }
    table_file::write(folder, "events", format, rows.len(), &columns)?;

    let mut with_start = vec![0.0];
    with_start.extend(times.iter().copied().filter(|&time| time > 0.0));
    let rows: Vec<(&str, Survival, usize)> = events
        .iter()
        .flat_map(|record| {
            let name = record.event.name();
            let of_cell = |(cell, record): (usize, Cow<'_, EventRecord>)| {
                let survival = record.survival(&with_start);
                survival.into_iter().map(move |survival| (name, survival, cell))
            };
            of_cells(record, cells).flat_map(of_cell).collect::<Vec<_>>()
        })
        .collect();
    let mut columns = vec![
        TableColumn::text("event", |row| rows[row].0),
        TableColumn::number("t", |row| rows[row].1.time),
        TableColumn::whole("remaining", |row| rows[row].1.remaining as u64),
        TableColumn::number("share", |row| rows[row].1.share),
        TableColumn::number("low", |row| rows[row].1.low),
        TableColumn::number("high", |row| rows[row].1.high),
    ];
    if cells.is_some() {
        columns.push(TableColumn::whole("cell", |row| rows[row].2 as u64));
    }
    table_file::write(folder, "survival", format, rows.len(), &columns)?;
    write_times(folder, format, events, cells)
}

/// The event for all bodies, as cell 0, or cell by cell.
fn of_cells(
    record: &EventRecord,
    cells: Option<usize>,
) -> Box<dyn Iterator<Item = (usize, Cow<'_, EventRecord>)> + '_> {
    match cells {
        Some(cells) => Box::new(record.by_cell(cells).map(Cow::Owned).enumerate()),
        None => Box::new(std::iter::once((0, Cow::Borrowed(record)))),
    }
}

/// Writes `times`.
fn write_times(folder: &mut OutputFolder, format: Format, events: &[EventRecord], cells: Option<usize>) -> Result<()> {
    struct Row<'e> {
        event: &'e str,
        bodies: usize,
        had: usize,
        times: Vec<TimeBy>,
        cell: usize,
    }
    let rows: Vec<Row<'_>> = events
        .iter()
        .flat_map(|record| {
            of_cells(record, cells).map(|(cell, own)| {
                let (bodies, had, times) = (own.bodies, own.occurrences.len(), own.times_by(&PERCENTAGES));
                Row { event: record.event.name(), bodies, had, times, cell }
            })
        })
        .collect();
    let rows = &rows;
    let mut columns = vec![
        TableColumn::text("event", |row| rows[row].event),
        TableColumn::whole("bodies", |row| rows[row].bodies as u64),
        TableColumn::whole("had", |row| rows[row].had as u64),
    ];
    for (place, percent) in PERCENTAGES.iter().enumerate() {
        columns.push(TableColumn::number(format!("t{percent}"), move |row: usize| rows[row].times[place].time));
        columns.push(TableColumn::number(format!("t{percent}_low"), move |row: usize| rows[row].times[place].low));
        columns.push(TableColumn::number(format!("t{percent}_high"), move |row: usize| rows[row].times[place].high));
    }
    if cells.is_some() {
        columns.push(TableColumn::whole("cell", |row| rows[row].cell as u64));
    }
    table_file::write(folder, "times", format, rows.len(), &columns)
}

/// Writes `histograms`, a row for each output time, histogram and bin, and `histograms_by_cell`, a row for each output time, cell, histogram and
/// bin; the rows for values outside the bins have an infinite edge. Each as far as there are counts: by output time, and by output time and cell.
pub(crate) fn write_histograms(
    folder: &mut OutputFolder,
    format: Format,
    histograms: &[Histogram],
    (counts, by_cell): (&[Vec<HistogramCounts>], &[Vec<Vec<HistogramCounts>>]),
) -> Result<()> {
    if !counts.is_empty() {
        let all: Vec<&[HistogramCounts]> = counts.iter().map(Vec::as_slice).collect();
        write_counts(folder, "histograms", format, histograms, &all, None)?;
    }
    match by_cell.first() {
        Some(cells) => {
            let all: Vec<&[HistogramCounts]> = by_cell.iter().flatten().map(Vec::as_slice).collect();
            write_counts(folder, "histograms_by_cell", format, histograms, &all, Some(cells.len()))
        }
        None => Ok(()),
    }
}

/// Writes counts of histograms: those of each output time, or of each output time and cell.
fn write_counts(
    folder: &mut OutputFolder,
    stem: &'static str,
    format: Format,
    histograms: &[Histogram],
    counts: &[&[HistogramCounts]],
    cells: Option<usize>,
) -> Result<()> {
    // For each row: its counts, the histogram, and the index among these.
    let of_counts = |place: usize| {
        let places =
            |(index, histogram): (usize, &Histogram)| (0..histogram.bins() + 2).map(move |place| (index, place));
        let rows = histograms.iter().enumerate().flat_map(places);
        rows.map(move |(index, bin)| (place, index, bin)).collect::<Vec<_>>()
    };
    let rows: Vec<(usize, usize, usize)> = (0..counts.len()).flat_map(of_counts).collect();
    let rows = &rows;
    let edge = |index: usize, place: Option<usize>, outside: f64| {
        place.and_then(|place| histograms[index].edges().get(place)).copied().unwrap_or(outside)
    };
    let mut columns = vec![TableColumn::number("t", |row| counts[rows[row].0][rows[row].1].time)];
    if let Some(cells) = cells {
        columns.push(TableColumn::whole(CELL, move |row| (rows[row].0 % cells) as u64));
    }
    columns.extend([
        TableColumn::whole("histogram", |row| rows[row].1 as u64),
        TableColumn::text("quantity", |row| histograms[rows[row].1].quantity().name()),
        TableColumn::number("low", |row| edge(rows[row].1, rows[row].2.checked_sub(1), f64::NEG_INFINITY)),
        TableColumn::number("high", |row| edge(rows[row].1, Some(rows[row].2), f64::INFINITY)),
        TableColumn::whole("count", |row| counts[rows[row].0][rows[row].1].counts[rows[row].2]),
    ]);
    table_file::write(folder, stem, format, rows.len(), &columns)
}
