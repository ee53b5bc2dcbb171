//! Rows of figures: the results of a benchmark, as comma-separated values and as lines of JSON.
//!
//! Both files only ever grow: a row is appended in one write, and a later run appends to it. A row carries its provenance
//! ([`super::provenance`]), so rows of several machines and commits may share a file.

use std::fs::{self, File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use crate::error::RowFault;
use crate::error::{Error, FileAction, Result};
use crate::study::text::{CUT, Lines};

/// One cell.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A name or sentence.
    Text(String),
    /// A measured or computed number, in SI units; NaN if there is none.
    Real(f64),
    /// A whole number.
    Count(u64),
    /// Yes or no.
    Flag(bool),
}

impl From<&str> for Value {
    fn from(text: &str) -> Self {
        Value::Text(text.to_owned())
    }
}

impl From<String> for Value {
    fn from(text: String) -> Self {
        Value::Text(text)
    }
}

impl From<f64> for Value {
    fn from(number: f64) -> Self {
        Value::Real(number)
    }
}

impl From<u64> for Value {
    fn from(count: u64) -> Self {
        Value::Count(count)
    }
}

impl From<usize> for Value {
    fn from(count: usize) -> Self {
        Value::Count(count as u64)
    }
}

impl From<bool> for Value {
    fn from(flag: bool) -> Self {
        Value::Flag(flag)
    }
}

impl std::fmt::Display for Value {
    /// As in a CSV file; a number has the fewest digits that read back to the same bits, and NaN is empty.
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Value::Text(text) => formatter.write_str(text),
            Value::Real(number) if number.is_nan() => Ok(()),
            Value::Real(number) => formatter.write_str(zmij::Buffer::new().format(*number)),
            Value::Count(count) => write!(formatter, "{count}"),
            Value::Flag(flag) => write!(formatter, "{flag}"),
        }
    }
}

impl Value {
    fn to_json(&self) -> serde_json::Value {
        match self {
            Value::Text(text) => text.as_str().into(),
            // A number that is not finite becomes `null`, as JSON cannot express it.
            Value::Real(number) => (*number).into(),
            Value::Count(count) => (*count).into(),
            Value::Flag(flag) => (*flag).into(),
        }
    }
}

/// Named cells in order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Row {
    cells: Vec<(String, Value)>,
}

impl Row {
    /// A row without cells.
    pub fn new() -> Self {
        Self::default()
    }

    /// The row with one more cell.
    #[must_use]
    pub fn with(mut self, name: &str, value: impl Into<Value>) -> Self {
        self.cells.push((name.to_owned(), value.into()));
        self
    }

    /// The row with the median, 99th percentile and maximum of a quantity: `name_median`, `name_p99`, `name_max`.
    #[must_use]
    pub(crate) fn with_quantiles(self, name: &str, quantiles: &crate::math::Quantiles) -> Self {
        self.with(&format!("{name}_median"), quantiles.median)
            .with(&format!("{name}_p99"), quantiles.p99)
            .with(&format!("{name}_max"), quantiles.max)
    }

    /// The row followed by the cells of another.
    #[must_use]
    pub fn join(mut self, other: &Row) -> Self {
        self.cells.extend_from_slice(&other.cells);
        self
    }

    /// Names of the cells, in order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.cells.iter().map(|(name, _)| name.as_str())
    }

    /// A cell.
    pub fn value(&self, name: &str) -> Option<&Value> {
        self.cells.iter().find(|(cell, _)| cell == name).map(|(_, value)| value)
    }

    /// A cell as text; empty if there is none.
    pub fn text(&self, name: &str) -> String {
        self.value(name).map(Value::to_string).unwrap_or_default()
    }

    /// A cell as a number; NaN if there is none.
    pub fn number(&self, name: &str) -> f64 {
        match self.value(name) {
            Some(Value::Real(number)) => *number,
            Some(Value::Count(count)) => *count as f64,
            Some(Value::Text(text)) => text.parse().unwrap_or(f64::NAN),
            _ => f64::NAN,
        }
    }

    /// Whether a cell is true.
    pub fn flag(&self, name: &str) -> bool {
        match self.value(name) {
            Some(Value::Flag(flag)) => *flag,
            Some(Value::Text(text)) => text == "true",
            _ => false,
        }
    }

    fn to_csv(&self) -> Vec<u8> {
        csv_line(self.cells.iter().map(|(_, value)| value.to_string()))
    }

    fn to_json(&self) -> Vec<u8> {
        // Written by hand, so that the cells keep their order; the JSON library escapes names and values.
        let cells: Vec<String> =
            self.cells.iter().map(|(name, value)| format!("{}:{}", serde_json::json!(name), value.to_json())).collect();
        format!("{{{}}}\n", cells.join(",")).into_bytes()
    }
}

fn csv_line(cells: impl Iterator<Item = String>) -> Vec<u8> {
    let mut writer = csv::WriterBuilder::new().has_headers(false).from_writer(Vec::new());
    // Writing to memory does not fail.
    let _ = writer.write_record(cells);
    writer.into_inner().unwrap_or_default()
}

/// The rows of one benchmark: `NAME.csv` and the same as lines of JSON in `NAME.json`.
#[derive(Debug)]
pub struct Table {
    csv: PathBuf,
    json: PathBuf,
    header: Option<Vec<String>>,
}

impl Table {
    /// Opens the table `name` in `folder`, which is made if it does not exist. Rows of earlier runs are kept.
    ///
    /// # Errors
    ///
    /// [`Error::File`] if the folder cannot be made or the table not be read; [`Error::Rows`] if it is not a table.
    pub fn open(folder: &Path, name: &str) -> Result<Self> {
        fs::create_dir_all(folder).map_err(|error| Error::file(folder, FileAction::Create, &error))?;
        let csv = folder.join(format!("{name}.csv"));
        // All rows are read, as a truncated last row would run into the first of this run.
        let header = if csv.exists() { rows_of(&csv).and_then(|_| header_of(&csv)).map(Some)? } else { None };
        Ok(Self { json: csv.with_extension("json"), csv, header })
    }

    /// Appends a row to both files.
    ///
    /// # Errors
    ///
    /// [`Error::File`] if a file cannot be written; [`Error::Rows`] if the file has other columns.
    pub fn append(&mut self, row: &Row) -> Result<()> {
        match &self.header {
            Some(header) if !row.names().eq(header.iter().map(String::as_str)) => {
                return Err(Error::Rows { path: self.csv.clone(), fault: RowFault::Columns });
            }
            Some(_) => {}
            None => {
                let names: Vec<String> = row.names().map(str::to_owned).collect();
                append(&self.csv, &csv_line(names.iter().cloned()))?;
                self.header = Some(names);
            }
        }
        append(&self.csv, &row.to_csv())?;
        append(&self.json, &row.to_json())
    }

    /// The rows so far, of this run and of earlier ones; every cell is text.
    ///
    /// # Errors
    ///
    /// [`Error::File`] if the file cannot be read; [`Error::Rows`] if it is not a table.
    pub fn rows(&self) -> Result<Vec<Row>> {
        if self.header.is_some() { rows_of(&self.csv) } else { Ok(Vec::new()) }
    }
}

/// The rows of the table `name` in `folder`; none if there is no such table.
///
/// # Errors
///
/// As [`Table::rows`].
pub fn rows(folder: &Path, name: &str) -> Result<Vec<Row>> {
    let csv = folder.join(format!("{name}.csv"));
    if csv.exists() { rows_of(&csv) } else { Ok(Vec::new()) }
}

/// Appends in one write, so that a row is written in full or not at all; a link is not followed.
fn append(path: &Path, bytes: &[u8]) -> Result<()> {
    let failed = |error: &std::io::Error| Error::file(path, FileAction::Write, error);
    if path.is_symlink() {
        return Err(failed(&std::io::Error::other("it is a symbolic link")));
    }
    let mut file = OpenOptions::new().create(true).append(true).open(path).map_err(|error| failed(&error))?;
    file.write_all(bytes).map_err(|error| failed(&error))
}

fn reader(path: &Path) -> Result<csv::Reader<Lines<File>>> {
    let file = File::open(path).map_err(|error| Error::file(path, FileAction::Read, &error))?;
    Ok(csv::Reader::from_reader(Lines::new(file)))
}

/// Refuses a table whose last row is truncated: the next row would be appended to it.
fn refuse_cut(path: &Path, reader: &csv::Reader<Lines<File>>) -> Result<()> {
    let fault = || RowFault::Csv(format!("line {}: {CUT}", reader.position().line()));
    if reader.get_ref().are_cut() { Err(Error::Rows { path: path.to_owned(), fault: fault() }) } else { Ok(()) }
}

fn no_table(path: &Path) -> impl Fn(csv::Error) -> Error {
    move |error| Error::Rows { path: path.to_owned(), fault: RowFault::Csv(error.to_string()) }
}

fn header_of(path: &Path) -> Result<Vec<String>> {
    Ok(reader(path)?.headers().map_err(no_table(path))?.iter().map(str::to_owned).collect())
}

fn rows_of(path: &Path) -> Result<Vec<Row>> {
    let names = header_of(path)?;
    let mut reader = reader(path)?;
    let rows = reader
        .records()
        .map(|record| {
            let record = record.map_err(no_table(path))?;
            let cells = names.iter().zip(&record).map(|(name, cell)| (name.clone(), Value::from(cell)));
            Ok(Row { cells: cells.collect() })
        })
        .collect();
    refuse_cut(path, &reader)?;
    rows
}
