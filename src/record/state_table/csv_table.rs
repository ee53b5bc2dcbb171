//! Rows of comma-separated values as [`crate::record::csv_file`] writes them.

use std::fs::File;
use std::io::{BufRead, BufReader, Seek, SeekFrom};
use std::path::Path;

use super::{Shape, TableRows, read_failed, wrong};
use crate::error::Result;
use crate::study::text::CUT;

/// The position of the next row.
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

/// Number of bytes read at once.
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
        shape: Shape,
    ) -> Result<TableRows> {
        if first < self.next.row {
            self.next = self.start;
        }
        let failed = |error: std::io::Error| read_failed(path, &error);
        file.seek(SeekFrom::Start(self.next.offset)).map_err(failed)?;
        let mut reader = BufReader::with_capacity(BUFFER, file);
        let (mut found, mut line) = (TableRows::default(), String::new());
        found.rows.numbers = vec![Vec::new(); shape.columns];
        while found.bodies.len() < count {
            line.clear();
            let bytes = reader.read_line(&mut line).map_err(failed)?;
            if bytes == 0 {
                break;
            }
            if self.next.row >= first {
                let cells = line.strip_suffix('\n');
                let cells = cells.ok_or_else(|| wrong(path, format!("line {}: {CUT}", self.next.row + 2)))?;
                push(cells, shape, &mut found).ok_or_else(|| {
                    wrong(path, format!("row {}: expected {} numbers", self.next.row + 1, self.names.len()))
                })?;
            }
            self.next = Cursor { row: self.next.row + 1, offset: self.next.offset + bytes as u64 };
        }
        Ok(found)
    }
}

/// Appends a row.
fn push(row: &str, shape: Shape, found: &mut TableRows) -> Option<()> {
    let mut cells = row.split(',');
    found.bodies.push(cells.next()?.parse().ok()?);
    found.times.push(cells.next()?.parse().ok()?);
    for column in &mut found.rows.numbers {
        column.push(cells.next()?.parse().ok()?);
    }
    found.rows.status.push(cells.next()?.parse().ok()?);
    if shape.has_cells {
        cells.next()?.parse::<usize>().ok()?;
    }
    cells.next().is_none().then_some(())
}
