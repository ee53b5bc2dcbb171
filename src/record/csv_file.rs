//! Tables of states as comma-separated values.

use rayon::prelude::*;

use super::OutputState;
use super::column;
use super::folder::OutputFile;
use crate::error::Result;

/// Rows that one task formats.
const ROWS_PER_TASK: usize = 1024;

/// Bytes of the shortest number with its comma, `0.0,`.
pub(crate) const LEAST_BYTES: u64 = 4;
/// Bytes of a number as most are, with sign and comma.
pub(crate) const LIKELY_BYTES: u64 = 20;

/// Bytes of the number of what became of a body, with its comma.
pub(crate) const STATUS_BYTES: u64 = 2;

/// Bytes that are reserved for one number: most need 17 digits, sign, point, exponent and comma.
const BYTES_PER_NUMBER: usize = 24;

/// A table under way: one row a body and output time, in that order.
#[derive(Debug)]
pub(crate) struct CsvFile {
    file: OutputFile,
    columns: usize,
    /// Cells of the study's design, where it has one: body b lies in cell b modulo this.
    cells: Option<usize>,
}

impl CsvFile {
    pub(crate) fn begin(mut file: OutputFile, translates: bool, cells: Option<usize>) -> Result<Self> {
        file.write(header(translates, cells.is_some()).as_bytes())?;
        Ok(Self { file, columns: column::names(translates).count(), cells })
    }

    /// The rows as text, formatted on all cores.
    pub(crate) fn format(&self, time: f64, first_body: usize, states: &[OutputState]) -> Vec<Vec<u8>> {
        states
            .par_chunks(ROWS_PER_TASK)
            .enumerate()
            .map(|(task, states)| {
                format_rows((self.columns, self.cells), time, first_body + task * ROWS_PER_TASK, states)
            })
            .collect()
    }

    pub(crate) fn write(&mut self, rows: &[Vec<u8>]) -> Result<()> {
        rows.iter().try_for_each(|rows| self.file.write(rows))
    }

    pub(crate) fn finish(self) -> Result<()> {
        self.file.finish()
    }
}

fn header(translates: bool, has_cells: bool) -> String {
    let columns = ["body", "t"].into_iter().chain(column::names(translates)).chain([column::STATUS]);
    columns.chain(has_cells.then_some(column::CELL)).collect::<Vec<_>>().join(",") + "\n"
}

/// A table of one body at several times.
pub(crate) fn track(body: usize, states: &[(f64, OutputState)]) -> Vec<u8> {
    let translates = states.iter().any(|(_, state)| state.translation.is_some());
    let columns = column::names(translates).count();
    let rows = states.iter().flat_map(|&(time, state)| format_rows((columns, None), time, body, &[state]));
    header(translates, false).into_bytes().into_iter().chain(rows).collect()
}

/// Rows as text. Every number has the fewest digits that read back to the same bits.
fn format_rows(
    (columns, cells): (usize, Option<usize>),
    time: f64,
    first_body: usize,
    states: &[OutputState],
) -> Vec<u8> {
    let mut text = Vec::with_capacity(states.len() * (columns + 2) * BYTES_PER_NUMBER);
    let (mut index, mut number) = (itoa::Buffer::new(), zmij::Buffer::new());
    let time = zmij::Buffer::new().format(time).to_owned();
    for (offset, state) in states.iter().enumerate() {
        text.extend_from_slice(index.format(first_body + offset).as_bytes());
        text.push(b',');
        text.extend_from_slice(time.as_bytes());
        for value in &column::values(state)[..columns] {
            text.push(b',');
            text.extend_from_slice(number.format(*value).as_bytes());
        }
        text.push(b',');
        text.extend_from_slice(index.format(state.status().number()).as_bytes());
        if let Some(cells) = cells {
            text.push(b',');
            text.extend_from_slice(index.format((first_body + offset) % cells).as_bytes());
        }
        text.push(b'\n');
    }
    text
}
