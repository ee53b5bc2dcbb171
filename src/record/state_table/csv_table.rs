//! Rows of comma-separated values as [`crate::record::csv_file`] writes them.

use std::fs::File;
use std::io::{BufRead, BufReader, Seek, SeekFrom};
use std::path::Path;

use super::{StateRow, read_failed, state_of, wrong};
use crate::error::Result;
use crate::record::column::MOST_COLUMNS;

/// Where the next row is.
#[derive(Clone, Copy, Debug)]
struct Cursor {
    row: u64,
    offset: u64,
}

#[derive(Debug)]
pub(super) struct CsvTable {
    names: Vec<String>,
    start: Cursor,
    next: Cursor,
}

/// Bytes that are read at once.
const BUFFER: usize = 1 << 18;

impl CsvTable {
    pub fn open(path: &Path, file: &mut File) -> Result<Self> {
        let mut header = String::new();
        BufReader::new(file).read_line(&mut header).map_err(|error| read_failed(path, &error))?;
        let start = Cursor { row: 0, offset: header.len() as u64 };
        let names = header.trim_end().split(',').map(str::to_owned).collect();
        Ok(Self { names, start, next: start })
    }

    pub fn names(&self) -> &[String] {
        &self.names
    }

    pub fn read(
        &mut self,
        path: &Path,
        file: &mut File,
        (first, count): (u64, usize),
        columns: usize,
    ) -> Result<Vec<StateRow>> {
        if first < self.next.row {
            self.next = self.start;
        }
        let failed = |error: std::io::Error| read_failed(path, &error);
        file.seek(SeekFrom::Start(self.next.offset)).map_err(failed)?;
        let mut reader = BufReader::with_capacity(BUFFER, file);
        let (mut rows, mut line) = (Vec::with_capacity(count), String::new());
        while rows.len() < count {
            line.clear();
            let bytes = reader.read_line(&mut line).map_err(failed)?;
            if bytes == 0 {
                break;
            }
            if self.next.row >= first {
                let row = parsed(&line, columns, self.names.len()).ok_or_else(|| {
                    wrong(path, format!("row {}: expected {} numbers", self.next.row + 1, self.names.len()))
                })?;
                rows.push(row);
            }
            self.next = Cursor { row: self.next.row + 1, offset: self.next.offset + bytes as u64 };
        }
        Ok(rows)
    }
}

/// A row, which ends in a newline; `width` with the cell of studies that sweep.
fn parsed(line: &str, columns: usize, width: usize) -> Option<StateRow> {
    let mut cells = line.strip_suffix('\n')?.split(',');
    let body = cells.next()?.parse().ok()?;
    let time = cells.next()?.parse().ok()?;
    let mut numbers = [0.0; MOST_COLUMNS];
    for number in &mut numbers[..columns] {
        *number = cells.next()?.parse().ok()?;
    }
    let status = cells.next()?.parse().ok()?;
    let translates = columns == MOST_COLUMNS;
    (3 + columns + cells.count() == width).then(|| StateRow {
        body,
        time,
        state: state_of(&numbers, translates, status),
    })
}
