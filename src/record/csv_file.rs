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
        let mut header = "body,t".to_owned();
        for name in column::names(translates) {
            header.push(',');
            header.push_str(name);
        }
        header.push(',');
        header.push_str(column::STATUS);
        if cells.is_some() {
            header.push(',');
            header.push_str(column::CELL);
        }
        header.push('\n');
        file.write(header.as_bytes())?;
        Ok(Self { file, columns: column::names(translates).count(), cells })
    }

    /// The rows as text, formatted on all cores.
    pub(crate) fn format(&self, time: f64, first_body: usize, states: &[OutputState]) -> Vec<Vec<u8>> {
        states
            .par_chunks(ROWS_PER_TASK)
            .enumerate()
            .map(|(task, states)| self.rows(time, first_body + task * ROWS_PER_TASK, states))
            .collect()
    }

    pub(crate) fn write(&mut self, rows: &[Vec<u8>]) -> Result<()> {
        rows.iter().try_for_each(|rows| self.file.write(rows))
    }

    pub(crate) fn finish(self) -> Result<()> {
        self.file.finish()
    }

    /// Rows as text. Every number has the fewest digits that read back to the same bits.
    fn rows(&self, time: f64, first_body: usize, states: &[OutputState]) -> Vec<u8> {
        let mut text = Vec::with_capacity(states.len() * (self.columns + 2) * BYTES_PER_NUMBER);
        let (mut index, mut number) = (itoa::Buffer::new(), zmij::Buffer::new());
        let time = zmij::Buffer::new().format(time).to_owned();
        for (offset, state) in states.iter().enumerate() {
            text.extend_from_slice(index.format(first_body + offset).as_bytes());
            text.push(b',');
            text.extend_from_slice(time.as_bytes());
            for value in &column::values(state)[..self.columns] {
                text.push(b',');
                text.extend_from_slice(number.format(*value).as_bytes());
            }
            text.push(b',');
            text.extend_from_slice(index.format(state.status().number()).as_bytes());
            if let Some(cells) = self.cells {
                text.push(b',');
                text.extend_from_slice(index.format((first_body + offset) % cells).as_bytes());
            }
            text.push(b'\n');
        }
        text
    }
}
