//! Tables whose columns are all known when they are written: initial states, cells, events, survival, histograms, failed bodies.

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::ops::Range;
use std::path::{Path, PathBuf};

use glam::{DQuat, DVec3};

use super::column;
use super::folder::{OutputFile, OutputFolder};
use super::npz_file::{Archive, npy_header};
#[cfg(feature = "parquet")]
use super::parquet_file::{Cells, Field, Kind, ParquetFile};
use super::state_table::{Values as ReadValues, columns};
use crate::error::{Error, FileAction, Result};
use crate::math::parallel;
use crate::study::Format;

/// Number of rows that are formatted before they are written.
const BLOCK: usize = 1 << 16;
/// Number of rows that one task formats.
const ROWS_PER_TASK: usize = 1024;

/// A column: its name, and its values by row.
pub(crate) struct TableColumn<'a> {
    name: String,
    values: Values<'a>,
    /// In Parquet files; `None` for what is known of columns of that name.
    #[cfg_attr(not(feature = "parquet"), expect(dead_code, reason = "only Parquet files name units"))]
    unit: Option<&'a str>,
}

type OfRow<'a, T> = Box<dyn Fn(usize) -> T + Sync + 'a>;

enum Values<'a> {
    Code(OfRow<'a, u8>),
    Whole(OfRow<'a, u64>),
    Optional(OfRow<'a, Option<usize>>),
    Number(OfRow<'a, f64>),
    Text(OfRow<'a, &'a str>),
}

impl<'a> TableColumn<'a> {
    fn new(name: impl Into<String>, values: Values<'a>) -> Self {
        Self { name: name.into(), values, unit: None }
    }

    /// The same in a unit.
    pub(crate) fn within(self, unit: &'a str) -> Self {
        Self { unit: Some(unit), ..self }
    }

    pub(crate) fn code(name: &str, values: impl Fn(usize) -> u8 + Sync + 'a) -> Self {
        Self::new(name, Values::Code(Box::new(values)))
    }

    pub(crate) fn whole(name: impl Into<String>, values: impl Fn(usize) -> u64 + Sync + 'a) -> Self {
        Self::new(name, Values::Whole(Box::new(values)))
    }

    /// Indices that may be missing.
    pub(crate) fn optional(name: impl Into<String>, values: impl Fn(usize) -> Option<usize> + Sync + 'a) -> Self {
        Self::new(name, Values::Optional(Box::new(values)))
    }

    pub(crate) fn number(name: impl Into<String>, values: impl Fn(usize) -> f64 + Sync + 'a) -> Self {
        Self::new(name, Values::Number(Box::new(values)))
    }

    /// The columns of an attitude and an angular velocity.
    pub(crate) fn of_rotation(
        rotation: impl Fn(usize) -> (DQuat, DVec3) + Sync + Copy + 'a,
    ) -> impl Iterator<Item = Self> {
        let part = move |place: usize, row: usize| match (place, rotation(row)) {
            (0..4, (orientation, _)) => orientation.to_array()[place],
            (_, (_, angular_velocity)) => angular_velocity[place - 4],
        };
        (0..7).map(move |place| Self::number(column::ROTATION_COLUMNS[place], move |row| part(place, row)))
    }

    pub(crate) fn text(name: impl Into<String>, values: impl Fn(usize) -> &'a str + Sync + 'a) -> Self {
        Self::new(name, Values::Text(Box::new(values)))
    }
}

/// A table that is being written, some rows at a time. As an archive, each column is an array of shape `[rows]`; texts are of the type `U`,
/// which NumPy compares with the texts of Python.
///
/// Where an index is missing, comma-separated values are empty, arrays have −1, and Parquet null.
#[derive(Debug)]
pub(crate) enum RowsFile {
    Csv(OutputFile),
    /// With the most characters of the texts of each column.
    Npz(Box<Archive>, Vec<usize>),
    #[cfg(feature = "parquet")]
    Parquet(Box<ParquetFile>),
}

impl RowsFile {
    /// A table that will have `rows` rows. Columns of texts have all of them already, others may have none yet.
    pub(crate) fn begin(
        folder: &mut OutputFolder,
        stem: &str,
        format: Format,
        rows: usize,
        columns: &[TableColumn<'_>],
    ) -> Result<Self> {
        let name = format!("{stem}.{}", format.name());
        match format {
            Format::Csv => {
                let mut file = folder.begin(&name)?;
                let names: Vec<String> = columns.iter().map(|column| quoted(&column.name)).collect();
                file.write((names.join(",") + "\n").as_bytes())?;
                Ok(Self::Csv(file))
            }
            Format::Npz => {
                let mut archive = Archive::new(folder.begin(&name)?);
                let mut lengths = Vec::with_capacity(columns.len());
                for (entry, column) in columns.iter().enumerate() {
                    let longest = match &column.values {
                        Values::Text(text) => (0..rows).map(|row| text(row).chars().count()).max().unwrap_or(0).max(1),
                        _ => 0,
                    };
                    let (element, bytes) = match &column.values {
                        Values::Code(_) => ("|u1".to_owned(), 1),
                        Values::Whole(_) => ("<u8".to_owned(), 8),
                        Values::Optional(_) => ("<i8".to_owned(), 8),
                        Values::Number(_) => ("<f8".to_owned(), 8),
                        Values::Text(_) => (format!("<U{longest}"), 4 * longest),
                    };
                    let header = npy_header(&element, &[rows]);
                    archive.reserve(format!("{}.npy", column.name), (header.len() + bytes * rows) as u64);
                    archive.append(entry, &header)?;
                    lengths.push(longest);
                }
                Ok(Self::Npz(Box::new(archive), lengths))
            }
            #[cfg(feature = "parquet")]
            Format::Parquet => {
                let fields: Vec<Field> = columns.iter().map(field).collect();
                Ok(Self::Parquet(Box::new(ParquetFile::begin(folder, stem, &fields)?)))
            }
        }
    }

    /// Appends some of the rows that columns have, the same columns as before.
    pub(crate) fn append(&mut self, rows: Range<usize>, columns: &[TableColumn<'_>]) -> Result<()> {
        match self {
            Self::Csv(file) => {
                let tasks = rows.clone().step_by(ROWS_PER_TASK);
                let of_task = |_, first| -> String {
                    (first..rows.end.min(first + ROWS_PER_TASK)).map(|row| line(columns, row)).collect()
                };
                let text = parallel::map_tasks(tasks, of_task);
                text.iter().try_for_each(|text| file.write(text.as_bytes()))
            }
            Self::Npz(archive, lengths) => {
                for (entry, (column, longest)) in columns.iter().zip(lengths).enumerate() {
                    let rows = rows.clone();
                    let bytes: Vec<u8> = match &column.values {
                        Values::Code(value) => rows.map(value).collect(),
                        Values::Whole(value) => rows.flat_map(|row| value(row).to_le_bytes()).collect(),
                        Values::Optional(value) => {
                            rows.flat_map(|row| value(row).map_or(-1, |index| index as i64).to_le_bytes()).collect()
                        }
                        Values::Number(value) => rows.flat_map(|row| value(row).to_le_bytes()).collect(),
                        Values::Text(value) => rows.flat_map(|row| wide(value(row), *longest)).collect(),
                    };
                    archive.append(entry, &bytes)?;
                }
                Ok(())
            }
            #[cfg(feature = "parquet")]
            Self::Parquet(file) => {
                file.append(&columns.iter().map(|column| cells(column, rows.clone())).collect::<Vec<_>>())
            }
        }
    }

    pub(crate) fn finish(self) -> Result<()> {
        match self {
            Self::Csv(file) => file.finish(),
            Self::Npz(archive, _) => archive.finish(),
            #[cfg(feature = "parquet")]
            Self::Parquet(file) => file.finish(),
        }
    }
}

/// Writes a table of `rows` rows, which the columns have.
pub(crate) fn write(
    folder: &mut OutputFolder,
    stem: &str,
    format: Format,
    rows: usize,
    columns: &[TableColumn<'_>],
) -> Result<()> {
    let mut file = RowsFile::begin(folder, stem, format, rows, columns)?;
    for start in (0..rows).step_by(BLOCK) {
        file.append(start..rows.min(start + BLOCK), columns)?;
    }
    file.finish()
}

#[cfg(feature = "parquet")]
fn field(column: &TableColumn<'_>) -> Field {
    let kind = match column.values {
        Values::Code(_) => Kind::Code,
        Values::Whole(_) => Kind::Whole,
        Values::Optional(_) => Kind::Optional,
        Values::Number(_) => Kind::Number,
        Values::Text(_) => Kind::Text,
    };
    let known = Field::new(&column.name, kind);
    Field { unit: column.unit.map_or(known.unit, str::to_owned), ..known }
}

/// Some rows of a column.
#[cfg(feature = "parquet")]
fn cells(column: &TableColumn<'_>, rows: Range<usize>) -> Cells {
    let (count, row) = (rows.len(), |row: usize| rows.start + row);
    match &column.values {
        Values::Code(value) => Cells::Codes(parallel::rows(count, ROWS_PER_TASK, &|own| i32::from(value(row(own))))),
        Values::Whole(value) => Cells::Whole(parallel::rows(count, ROWS_PER_TASK, &|own| value(row(own)) as i64)),
        Values::Optional(value) => {
            Cells::Optional(parallel::rows(count, ROWS_PER_TASK, &|own| value(row(own)).map(|index| index as i64)))
        }
        Values::Number(value) => Cells::Numbers(parallel::rows(count, ROWS_PER_TASK, &|own| value(row(own)))),
        Values::Text(value) => Cells::Texts(parallel::rows(count, ROWS_PER_TASK, &|own| value(row(own)).into())),
    }
}

/// Writes a table whose rows are those of some tables written by [`write`], one after the other: columns named [`WHOLE`] hold indices,
/// others texts or numbers.
pub(crate) fn concatenate(folder: &mut OutputFolder, stem: &str, format: Format, tables: &[PathBuf]) -> Result<()> {
    let name = format!("{stem}.{}", format.name());
    match format {
        Format::Csv => {
            let mut file = folder.begin(&name)?;
            for (place, path) in tables.iter().enumerate() {
                let failed = |error: std::io::Error| Error::file(path, FileAction::Read, &error);
                let mut source = BufReader::with_capacity(COPIED, File::open(path).map_err(failed)?);
                if place > 0 {
                    skip_header(&mut source).map_err(failed)?;
                }
                loop {
                    let bytes = source.fill_buf().map_err(failed)?;
                    if bytes.is_empty() {
                        break;
                    }
                    file.write(bytes)?;
                    let count = bytes.len();
                    source.consume(count);
                }
            }
            file.finish()
        }
        Format::Npz => {
            let mut all = Vec::new();
            for path in tables {
                extend(&mut all, columns(path)?, path)?;
            }
            write(folder, stem, format, rows_of(&all), &typed(&all))
        }
        #[cfg(feature = "parquet")]
        Format::Parquet => {
            let mut file = None;
            for path in tables {
                let part = columns(path)?;
                let (rows, part) = (rows_of(&part), typed(&part));
                let file = match &mut file {
                    Some(file) => file,
                    None => file.insert(RowsFile::begin(folder, stem, format, rows, &part)?),
                };
                file.append(0..rows, &part)?;
            }
            file.map_or(Ok(()), RowsFile::finish)
        }
    }
}

/// Number of bytes copied at once.
const COPIED: usize = 1 << 16;

/// Columns of indices.
const WHOLE: [&str; 3] = ["body", column::CELL, "bodies"];

/// Skips the header line of a table, whose names may hold line breaks in quotation marks.
fn skip_header(source: &mut impl BufRead) -> std::io::Result<()> {
    let mut quotes = 0;
    loop {
        let mut line = Vec::new();
        let count = source.read_until(b'\n', &mut line)?;
        quotes += line.iter().filter(|byte| **byte == b'"').count();
        if count == 0 || quotes % 2 == 0 {
            return Ok(());
        }
    }
}

/// Appends the rows of a table, which has the same columns.
fn extend(all: &mut Vec<(String, ReadValues)>, part: Vec<(String, ReadValues)>, path: &Path) -> Result<()> {
    if all.is_empty() {
        *all = part;
        return Ok(());
    }
    let count = part.len();
    let mut taken = 0;
    for ((own, values), (name, more)) in all.iter_mut().zip(part) {
        match (values, more) {
            (ReadValues::Numbers(values), ReadValues::Numbers(more)) if *own == name => values.extend(more),
            (ReadValues::Texts(values), ReadValues::Texts(more)) if *own == name => values.extend(more),
            _ => continue,
        }
        taken += 1;
    }
    match taken == count && count == all.len() {
        true => Ok(()),
        false => Err(Error::Table {
            path: path.to_owned(),
            reason: "expected the columns of the other parts' table: run the part again".to_owned(),
        }),
    }
}

fn rows_of(columns: &[(String, ReadValues)]) -> usize {
    columns.first().map_or(0, |(_, values)| values.len())
}

fn typed(columns: &[(String, ReadValues)]) -> Vec<TableColumn<'_>> {
    fn column((name, values): &(String, ReadValues)) -> TableColumn<'_> {
        match values {
            ReadValues::Texts(texts) => TableColumn::text(name.as_str(), |row| texts[row].as_str()),
            ReadValues::Numbers(numbers) if WHOLE.contains(&name.as_str()) => {
                TableColumn::whole(name, |row| numbers[row] as u64)
            }
            ReadValues::Numbers(numbers) => TableColumn::number(name.as_str(), |row| numbers[row]),
        }
    }
    columns.iter().map(column).collect()
}

/// A row as text. Every number has the fewest digits that read back to the same bits.
fn line(columns: &[TableColumn<'_>], row: usize) -> String {
    let mut text = String::new();
    for (place, column) in columns.iter().enumerate() {
        if place > 0 {
            text.push(',');
        }
        match &column.values {
            Values::Code(value) => text += itoa::Buffer::new().format(value(row)),
            Values::Whole(value) => text += itoa::Buffer::new().format(value(row)),
            Values::Optional(value) => {
                value(row).into_iter().for_each(|index| text += itoa::Buffer::new().format(index));
            }
            Values::Number(value) => text += zmij::Buffer::new().format(value(row)),
            Values::Text(value) => text += &quoted(value(row)),
        }
    }
    text.push('\n');
    text
}

/// A cell of text, in quotation marks if it needs them (RFC 4180).
fn quoted(text: &str) -> String {
    match text.contains([',', '"', '\n', '\r']) || text.starts_with('#') {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text.to_owned(),
    }
}

/// A text of NumPy's type `U`: UTF-32, padded with zeros.
fn wide(text: &str, length: usize) -> Vec<u8> {
    let characters = text.chars().map(u32::from).chain(std::iter::repeat(0)).take(length);
    characters.flat_map(u32::to_le_bytes).collect()
}
