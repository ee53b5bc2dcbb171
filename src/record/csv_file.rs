//! Tables of states as comma-separated values.

use std::ops::Range;

use super::OutputState;
use super::column::{self, Layout, StateRows};
use super::folder::OutputFile;
use crate::error::Result;
use crate::math::parallel;

/// Rows that one task formats.
const ROWS_PER_TASK: usize = 1024;

/// Bytes of the shortest number with its comma, `0.0,`.
pub(crate) const LEAST_BYTES: u64 = 4;
/// Bytes of a typical number, with sign and comma.
pub(crate) const LIKELY_BYTES: u64 = 20;

/// Bytes of the status number of a body, with its comma.
pub(crate) const STATUS_BYTES: u64 = 2;

/// Bytes that are reserved for one number: most need 17 digits, sign, point, exponent and comma.
const BYTES_PER_NUMBER: usize = 24;

/// A table being written: one row for each body and output time, in that order.
#[derive(Debug)]
pub(crate) struct CsvFile {
    file: OutputFile,
    cells: Option<usize>,
    /// Rows as text, by task; kept to reuse the memory.
    text: Vec<Vec<u8>>,
}

impl CsvFile {
    pub(crate) fn begin(mut file: OutputFile, layout: &Layout) -> Result<Self> {
        file.write(header(layout).as_bytes())?;
        Ok(Self { file, cells: layout.cells, text: Vec::new() })
    }

    /// Forms rows as text, on all cores, for [`CsvFile::write`].
    pub(crate) fn format(&mut self, time: f64, first_body: usize, rows: &StateRows) {
        let tasks = rows.len().div_ceil(ROWS_PER_TASK).max(self.text.len());
        self.text.resize(tasks, Vec::new());
        parallel::for_each_task(&mut self.text, |task, text| {
            let [start, end] = [task, task + 1].map(|task| (task * ROWS_PER_TASK).min(rows.len()));
            text.clear();
            format_rows(text, self.cells, (time, first_body), rows, start..end);
        });
    }

    /// Appends the rows that were last formatted.
    pub(crate) fn write(&mut self) -> Result<()> {
        self.text.iter().try_for_each(|rows| self.file.write(rows))
    }

    pub(crate) fn finish(self) -> Result<()> {
        self.file.finish()
    }
}

fn header(layout: &Layout) -> String {
    let columns = ["body", "t"].into_iter().chain(layout.names()).chain([column::STATUS]);
    columns.chain(layout.cells.map(|_| column::CELL)).collect::<Vec<_>>().join(",") + "\n"
}

/// A table of one body at several times.
pub(crate) fn track(body: usize, states: &[(f64, OutputState)]) -> Vec<u8> {
    let layout = Layout::of_states(states.iter().any(|(_, state)| state.translation.is_some()));
    let (mut text, mut rows) = (header(&layout).into_bytes(), StateRows::default());
    for &(time, state) in states {
        rows.fill(&layout, &[state], &[]);
        format_rows(&mut text, None, (time, body), &rows, 0..1);
    }
    text
}

/// Appends some rows as text. Every number has the fewest digits that read back to the same bits.
fn format_rows(
    text: &mut Vec<u8>,
    cells: Option<usize>,
    (time, first_body): (f64, usize),
    rows: &StateRows,
    part: Range<usize>,
) {
    text.reserve(part.len() * (rows.numbers.len() + 2) * BYTES_PER_NUMBER);
    let (mut index, mut number) = (itoa::Buffer::new(), zmij::Buffer::new());
    let time = zmij::Buffer::new().format(time).to_owned();
    for row in part {
        text.extend_from_slice(index.format(first_body + row).as_bytes());
        text.push(b',');
        text.extend_from_slice(time.as_bytes());
        for column in &rows.numbers {
            text.push(b',');
            text.extend_from_slice(number.format(column[row]).as_bytes());
        }
        text.push(b',');
        text.extend_from_slice(index.format(rows.status[row]).as_bytes());
        if let Some(cells) = cells {
            text.push(b',');
            text.extend_from_slice(index.format((first_body + row) % cells).as_bytes());
        }
        text.push(b'\n');
    }
}
