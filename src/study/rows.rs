//! The rows of a CSV file in turn, each with its line.

use std::io::Read;
use std::path::{Path, PathBuf};

use csv::{ErrorKind, ReaderBuilder, StringRecord, Trim};

use super::text::{CUT, Lines, OPEN_QUOTE};
use crate::error::{Error, FileAction, Result};
use crate::error::{InputError, InputFault};

/// A table with a header, comment lines that begin with `#`, and rows with as many cells as the header.
pub(super) struct Rows<R> {
    path: PathBuf,
    reader: csv::Reader<Lines<R>>,
    header: StringRecord,
    header_line: u64,
    /// The line of the last row, from 1. The reader itself only knows where the preceding lines begin, comments included.
    line: u64,
}

impl<R: Read> Rows<R> {
    /// Reads the header of `source`, whose name in messages is `path`.
    pub fn new(path: &Path, source: R) -> Result<Self> {
        let lines = Lines::new(source);
        let mut reader = ReaderBuilder::new().trim(Trim::Headers).comment(Some(b'#')).flexible(true).from_reader(lines);
        let header = reader.headers().cloned();
        let line = reader.get_mut().next_row();
        let header = header.map_err(|error| csv_error(path, line, error))?;
        Ok(Self { path: path.to_owned(), reader, header, header_line: line, line })
    }

    pub fn header(&self) -> &StringRecord {
        &self.header
    }

    /// The header's line, from 1.
    pub fn header_line(&self) -> u64 {
        self.header_line
    }

    /// The line, from 1, of the row that was read last.
    pub fn line(&self) -> u64 {
        self.line
    }

    /// Reads the next row, with cells trimmed; returns whether there was one.
    pub fn read(&mut self, record: &mut StringRecord) -> Result<bool> {
        let read = self.reader.read_record(record);
        if matches!(read, Ok(false)) {
            return Ok(false);
        }
        self.line = self.reader.get_mut().next_row();
        read.map_err(|error| csv_error(&self.path, self.line, error))?;
        if record.len() != self.header.len() {
            return Err(self.refused("", InputFault::RowLength { found: record.len(), expected: self.header.len() }));
        }
        // A cell of several lines means rows that a quotation mark hides.
        if record.iter().any(|cell| cell.contains(['\n', '\r'])) {
            return Err(self.refused("", InputFault::Syntax { reason: OPEN_QUOTE.to_owned() }));
        }
        record.trim();
        Ok(true)
    }

    /// The refusal of a cell of the last row, or of the whole row.
    pub fn refused(&self, column: &str, fault: InputFault) -> Error {
        input_error(&self.path, self.line, column, fault)
    }

    /// Refuses a table that ended within a line.
    pub fn finish(self) -> Result<()> {
        let lines = self.reader.get_ref();
        match lines.are_cut() {
            true => Err(input_error(&self.path, lines.line(), "", InputFault::Syntax { reason: CUT.to_owned() })),
            false => Ok(()),
        }
    }
}

pub(super) fn input_error(path: &Path, line: u64, key: &str, fault: InputFault) -> Error {
    InputError { file: path.to_owned(), line: line as usize, key: key.to_owned(), fault }.into()
}

/// The error of the CSV reader: bytes that are not text, or a file system error.
fn csv_error(path: &Path, line: u64, error: csv::Error) -> Error {
    let reason = match error.into_kind() {
        ErrorKind::Io(error) => return Error::file(path, FileAction::Read, &error),
        ErrorKind::Utf8 { .. } => "expected text in UTF-8",
        _ => "expected comma-separated values",
    };
    input_error(path, line, "", InputFault::Syntax { reason: reason.to_owned() })
}
