//! The tables of events, of how many bodies have not had them yet, and of histograms.

use super::events::{EventRecord, EventTime, Survival};
use super::folder::OutputFolder;
use super::whole_table::{Column, write};
use super::{EventOccurrence, HistogramCounts};
use crate::error::Result;
use crate::scene::Histogram;
use crate::study::Format;

/// Writes `events`, a row a body and event that it had, and `survival`, a row an event and output time (and the start).
pub(crate) fn write_events(
    folder: &mut OutputFolder,
    format: Format,
    events: &[EventRecord],
    times: &[f64],
) -> Result<()> {
    let longest = events.iter().map(|record| record.event.name().len()).max().unwrap_or(0);
    let rows: Vec<(&str, EventOccurrence)> = events
        .iter()
        .flat_map(|record| record.occurrences.iter().map(|occurrence| (record.event.name(), *occurrence)))
        .collect();
    let known_to = EventTime::ALL.iter().map(|known_to| known_to.name().len()).max().unwrap_or(0);
    let orientation = |part: usize| {
        Column::numbers({
            let rows = &rows;
            move |row: usize| rows[row].1.orientation.to_array()[part]
        })
    };
    let velocity = |part: usize| {
        Column::numbers({
            let rows = &rows;
            move |row: usize| rows[row].1.angular_velocity_body.to_array()[part]
        })
    };
    let columns = [
        ("event", Column::words(longest, |row| rows[row].0)),
        ("body", Column::counts(|row| rows[row].1.body as u64)),
        ("t", Column::numbers(|row| rows[row].1.time)),
        ("known_to", Column::words(known_to, |row| rows[row].1.known_to.name())),
        ("qx", orientation(0)),
        ("qy", orientation(1)),
        ("qz", orientation(2)),
        ("qw", orientation(3)),
        ("wx", velocity(0)),
        ("wy", velocity(1)),
        ("wz", velocity(2)),
    ];
    write(folder, "events", format, rows.len(), &columns)?;

    let mut with_start = vec![0.0];
    with_start.extend(times.iter().copied().filter(|&time| time > 0.0));
    let rows: Vec<(&str, Survival)> = events
        .iter()
        .flat_map(|record| record.survival(&with_start).into_iter().map(|survival| (record.event.name(), survival)))
        .collect();
    let columns = [
        ("event", Column::words(longest, |row| rows[row].0)),
        ("t", Column::numbers(|row| rows[row].1.time)),
        ("remaining", Column::counts(|row| rows[row].1.remaining as u64)),
        ("share", Column::numbers(|row| rows[row].1.share)),
        ("low", Column::numbers(|row| rows[row].1.low)),
        ("high", Column::numbers(|row| rows[row].1.high)),
    ];
    write(folder, "survival", format, rows.len(), &columns)
}

/// Writes `histograms`, a row an output time, histogram and bin; what lies outside of the bins has rows with an infinite edge.
pub(crate) fn write_histograms(
    folder: &mut OutputFolder,
    format: Format,
    histograms: &[Histogram],
    counts: &[Vec<HistogramCounts>],
) -> Result<()> {
    // Each row: the output, the histogram, and the place among its counts.
    let of_output = |output: usize| {
        let places =
            |(index, histogram): (usize, &Histogram)| (0..histogram.bins() + 2).map(move |place| (index, place));
        let rows = histograms.iter().enumerate().flat_map(places);
        rows.map(move |(index, place)| (output, index, place)).collect::<Vec<_>>()
    };
    let rows: Vec<(usize, usize, usize)> = (0..counts.len()).flat_map(of_output).collect();
    let longest = histograms.iter().map(|histogram| histogram.quantity().name().len()).max().unwrap_or(0);
    let edge = |index: usize, place: Option<usize>, outside: f64| {
        place.and_then(|place| histograms[index].edges().get(place)).copied().unwrap_or(outside)
    };
    let columns = [
        ("t", Column::numbers(|row| counts[rows[row].0][rows[row].1].time)),
        ("histogram", Column::counts(|row| rows[row].1 as u64)),
        ("quantity", Column::words(longest, |row| histograms[rows[row].1].quantity().name())),
        ("low", Column::numbers(|row| edge(rows[row].1, rows[row].2.checked_sub(1), f64::NEG_INFINITY))),
        ("high", Column::numbers(|row| edge(rows[row].1, Some(rows[row].2), f64::INFINITY))),
        ("count", Column::counts(|row| counts[rows[row].0][rows[row].1].counts[rows[row].2])),
    ];
    write(folder, "histograms", format, rows.len(), &columns)
}
