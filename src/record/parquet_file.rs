//! Tables as Apache Parquet files, written a row group at a time.
//!
//! Numbers are plain and not compressed: random last digits do not shrink. Indices are encoded as differences; times, codes and texts,
//! which repeat, by a dictionary. No date is written, so that equal rows and equal metadata make equal bytes, however the rows were
//! divided into calls.
//!
//! Source: Apache Parquet, *File Format*, release 2.10 (parquet.apache.org/docs/file-format).

use std::io::{self, Write};
use std::mem;
use std::ops::Range;
use std::path::PathBuf;
use std::sync::Arc;

use parquet::basic::{Encoding, LogicalType, Repetition, Type as PhysicalType};
use parquet::column::writer::ColumnWriter;
use parquet::data_type::ByteArray;
use parquet::errors::{ParquetError, Result as ParquetResult};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::{ColumnPath, Type};

use super::OutputState;
use super::column::{self, Layout, Named, StateRows};
use super::folder::{OutputFile, OutputFolder, SharedMetadata};
use crate::bodies::state_columns;
use crate::error::{Error, FileAction, Result};
use crate::study::Format;
use crate::study::parquet_sums::{CREATED_BY, NO_SUM, SUMS, summed_footer};

/// Rows of a row group: 16 MB of a table of states.
pub(crate) const GROUP: usize = 1 << 17;

/// The contents of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Number,
    /// A number that is the same for many rows, such as a time.
    Repeated,
    /// An index or a count.
    Whole,
    /// An index that may be missing.
    Optional,
    /// A code of one byte.
    Code,
    Text,
}

/// Some rows of a column.
#[derive(Debug)]
pub(crate) enum Cells {
    Numbers(Vec<f64>),
    Whole(Vec<i64>),
    Optional(Vec<Option<i64>>),
    Codes(Vec<i32>),
    Texts(Vec<ByteArray>),
}

impl Cells {
    fn none(kind: Kind) -> Self {
        match kind {
            Kind::Number | Kind::Repeated => Self::Numbers(Vec::new()),
            Kind::Whole => Self::Whole(Vec::new()),
            Kind::Optional => Self::Optional(Vec::new()),
            Kind::Code => Self::Codes(Vec::new()),
            Kind::Text => Self::Texts(Vec::new()),
        }
    }

    fn len(&self) -> usize {
        match self {
            Self::Numbers(cells) => cells.len(),
            Self::Whole(cells) => cells.len(),
            Self::Optional(cells) => cells.len(),
            Self::Codes(cells) => cells.len(),
            Self::Texts(cells) => cells.len(),
        }
    }

    /// Appends some rows of a column of the same kind.
    fn extend(&mut self, other: &Self, rows: Range<usize>) {
        match (self, other) {
            (Self::Numbers(cells), Self::Numbers(more)) => cells.extend_from_slice(&more[rows]),
            (Self::Whole(cells), Self::Whole(more)) => cells.extend_from_slice(&more[rows]),
            (Self::Optional(cells), Self::Optional(more)) => cells.extend_from_slice(&more[rows]),
            (Self::Codes(cells), Self::Codes(more)) => cells.extend_from_slice(&more[rows]),
            (Self::Texts(cells), Self::Texts(more)) => cells.extend_from_slice(&more[rows]),
            _ => unreachable!("rows of another kind than their column"),
        }
    }

    /// Appends numbers.
    fn push_numbers(&mut self, numbers: &[f64]) {
        match self {
            Self::Numbers(cells) => cells.extend_from_slice(numbers),
            _ => unreachable!("numbers of another kind than their column"),
        }
    }

    fn push_whole(&mut self, numbers: impl Iterator<Item = usize>) {
        match self {
            Self::Whole(cells) => cells.extend(numbers.map(|number| number as i64)),
            _ => unreachable!("indices of another kind than their column"),
        }
    }

    fn push_codes(&mut self, codes: impl Iterator<Item = u8>) {
        match self {
            Self::Codes(cells) => cells.extend(codes.map(i32::from)),
            _ => unreachable!("codes of another kind than their column"),
        }
    }

    /// Removes all rows and keeps the memory.
    fn clear(&mut self) {
        match self {
            Self::Numbers(cells) => cells.clear(),
            Self::Whole(cells) => cells.clear(),
            Self::Optional(cells) => cells.clear(),
            Self::Codes(cells) => cells.clear(),
            Self::Texts(cells) => cells.clear(),
        }
    }
}

/// A column of a table.
#[derive(Clone, Debug)]
pub(crate) struct Field {
    pub name: String,
    pub kind: Kind,
    /// As in [`Named`].
    pub unit: String,
    pub meaning: String,
}

impl Field {
    /// A column with unit and meaning from its name, if that is known in tables of bodies, otherwise without a unit.
    pub(crate) fn new(name: &str, kind: Kind) -> Self {
        let (unit, meaning) = state_columns::meaning(name).unwrap_or(match name {
            "t" => ("s", "time"),
            "body" => ("1", "index of the body"),
            column::STATUS => ("1", "what became of the body, 0 where all is well"),
            column::CELL => ("1", "cell of the sweep in which the body lies"),
            _ => ("", ""),
        });
        Self { name: name.to_owned(), kind, unit: unit.to_owned(), meaning: meaning.to_owned() }
    }
}

impl From<&Named> for Field {
    fn from(named: &Named) -> Self {
        let Named { name, unit, meaning } = named.clone();
        Self { name, kind: Kind::Number, unit, meaning }
    }
}

/// The key of the description of the columns in the footer.
const COLUMNS: &str = "polhode.columns";

/// A file whose bytes are checksummed as they are written.
struct Summed {
    file: OutputFile,
    sum: crc32fast::Hasher,
    /// The footer, once it is being written.
    footer: Option<Vec<u8>>,
}

impl Write for Summed {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if let Some(footer) = &mut self.footer {
            footer.extend_from_slice(bytes);
            return Ok(bytes.len());
        }
        let count = Write::write(&mut self.file, bytes)?;
        self.sum.update(&bytes[..count]);
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

/// Unit and meaning of the columns, by name.
fn described(fields: &[Field]) -> String {
    let entry = |field: &Field| (field.name.clone(), serde_json::json!({"unit": field.unit, "meaning": field.meaning}));
    serde_json::Value::Object(fields.iter().map(entry).collect()).to_string()
}

/// A table being written.
pub(crate) struct ParquetFile {
    path: PathBuf,
    writer: SerializedFileWriter<Summed>,
    /// Checksums of the row groups that are written.
    sums: Vec<u32>,
    /// Rows that do not fill a row group yet.
    rows: Vec<Cells>,
    metadata: SharedMetadata,
    /// The description of the columns.
    described: String,
}

impl std::fmt::Debug for ParquetFile {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_struct("ParquetFile").field("path", &self.path).finish_non_exhaustive()
    }
}

impl ParquetFile {
    /// Begins a table; its footer has the folder's metadata as they are when it is finished.
    pub(crate) fn begin(folder: &mut OutputFolder, stem: &str, columns: &[Field]) -> Result<Self> {
        let file = folder.begin(&format!("{stem}.{}", Format::Parquet.name()))?;
        let (metadata, described) = (folder.metadata(), described(columns));
        let path = file.path().to_owned();
        // Encodings are set by name.
        let is_twice =
            |(place, field): &(usize, &Field)| columns[..*place].iter().any(|other| other.name == field.name);
        if let Some((_, field)) = columns.iter().enumerate().find(is_twice) {
            let reason = format!("expected each column once: two have the name {}", field.name);
            return Err(Error::Table { path, reason });
        }
        let properties = Arc::new(properties(columns));
        let file = Summed { file, sum: crc32fast::Hasher::new(), footer: None };
        let writer = schema(columns).and_then(|schema| SerializedFileWriter::new(file, schema, properties));
        let writer = writer.map_err(|error| failed(&path, error))?;
        let rows = columns.iter().map(|field| Cells::none(field.kind)).collect();
        Ok(Self { path, writer, sums: Vec::new(), rows, metadata, described })
    }

    /// Appends rows, column by column.
    pub(crate) fn append(&mut self, rows: &[Cells]) -> Result<()> {
        self.append_by(rows.first().map_or(0, Cells::len), |part, columns| {
            columns.iter_mut().zip(rows).for_each(|(column, cells)| column.extend(cells, part.clone()));
        })
    }

    /// Appends `count` rows: `extend` appends those in a range to the given columns.
    fn append_by(&mut self, count: usize, mut extend: impl FnMut(Range<usize>, &mut [Cells])) -> Result<()> {
        let mut start = 0;
        while start < count {
            let end = count.min(start + GROUP - self.rows.first().map_or(0, Cells::len));
            extend(start..end, &mut self.rows);
            if self.rows.first().is_some_and(|column| column.len() == GROUP) {
                self.write_group()?;
            }
            start = end;
        }
        Ok(())
    }

    /// Writes the pending rows as a row group. Each page goes to the file as soon as it is encoded, so that nothing is kept twice.
    fn write_group(&mut self) -> Result<()> {
        let Self { path, writer, sums, rows, .. } = self;
        let mut written = || -> ParquetResult<()> {
            // What comes before the first row group belongs to none.
            writer.flush()?;
            writer.inner_mut().sum.reset();
            let mut group = writer.next_row_group()?;
            for cells in &mut *rows {
                let column = group.next_column()?;
                let mut column =
                    column.ok_or_else(|| ParquetError::General("more columns than expected".to_owned()))?;
                encode(cells, column.untyped())?;
                column.close()?;
                cells.clear();
            }
            group.close()?;
            writer.flush()?;
            sums.push(writer.inner().sum.clone().finalize());
            Ok(())
        };
        written().map_err(|error| failed(path, error))
    }

    /// Writes the last rows and the footer.
    pub(crate) fn finish(mut self) -> Result<()> {
        if self.rows.first().is_some_and(|column| column.len() > 0) {
            self.write_group()?;
        }
        let of_columns = (COLUMNS.to_owned(), mem::take(&mut self.described));
        let sums = self.sums.iter().map(|sum| format!("{sum:08x}")).chain([NO_SUM.to_owned()]);
        let sums = sums.collect::<Vec<_>>().join(" ");
        let own = [of_columns, (SUMS.to_owned(), sums.clone())];
        for (key, value) in self.metadata.entries().into_iter().chain(own) {
            self.writer.append_key_value_metadata(KeyValue::new(key, value));
        }
        let Self { path, mut writer, .. } = self;
        // Everything before it is in the file.
        writer.flush().map_err(|error| failed(&path, error.into()))?;
        writer.inner_mut().footer = Some(Vec::new());
        let Summed { mut file, footer, .. } = writer.into_inner().map_err(|error| failed(&path, error))?;
        let footer = summed_footer(&footer.unwrap_or_default(), &sums)
            .map_err(|reason| failed(&path, ParquetError::General(reason)))?;
        file.write_all(&footer).map_err(|error| failed(&path, error.into()))?;
        file.finish()
    }
}

fn encode(cells: &Cells, writer: &mut ColumnWriter<'_>) -> ParquetResult<()> {
    match (writer, cells) {
        (ColumnWriter::DoubleColumnWriter(writer), Cells::Numbers(cells)) => writer.write_batch(cells, None, None)?,
        (ColumnWriter::Int64ColumnWriter(writer), Cells::Whole(cells)) => writer.write_batch(cells, None, None)?,
        (ColumnWriter::Int64ColumnWriter(writer), Cells::Optional(cells)) => {
            let levels: Vec<i16> = cells.iter().map(|cell| i16::from(cell.is_some())).collect();
            let values: Vec<i64> = cells.iter().flatten().copied().collect();
            writer.write_batch(&values, Some(&levels), None)?
        }
        (ColumnWriter::Int32ColumnWriter(writer), Cells::Codes(cells)) => writer.write_batch(cells, None, None)?,
        (ColumnWriter::ByteArrayColumnWriter(writer), Cells::Texts(cells)) => writer.write_batch(cells, None, None)?,
        _ => return Err(ParquetError::General("rows of another kind than their column".to_owned())),
    };
    Ok(())
}

fn schema(columns: &[Field]) -> ParquetResult<Arc<Type>> {
    let whole = |bit_width: i8, is_signed: bool| Some(LogicalType::integer(bit_width, is_signed));
    let field = |Field { name, kind, .. }: &Field| {
        let (physical, logical) = match kind {
            Kind::Number | Kind::Repeated => (PhysicalType::DOUBLE, None),
            Kind::Whole | Kind::Optional => (PhysicalType::INT64, whole(64, true)),
            Kind::Code => (PhysicalType::INT32, whole(8, false)),
            Kind::Text => (PhysicalType::BYTE_ARRAY, Some(LogicalType::String)),
        };
        let repetition = if *kind == Kind::Optional { Repetition::OPTIONAL } else { Repetition::REQUIRED };
        let builder = Type::primitive_type_builder(name, physical).with_repetition(repetition);
        builder.with_logical_type(logical).build().map(Arc::new)
    };
    let fields = columns.iter().map(field).collect::<ParquetResult<Vec<_>>>()?;
    Type::group_type_builder("schema").with_fields(fields).build().map(Arc::new)
}

fn properties(columns: &[Field]) -> WriterProperties {
    let mut properties = WriterProperties::builder()
        .set_created_by(format!("{CREATED_BY}{}", env!("CARGO_PKG_VERSION")))
        .set_max_row_group_row_count(Some(GROUP))
        .set_statistics_enabled(EnabledStatistics::Chunk)
        .set_offset_index_disabled(true)
        .set_dictionary_enabled(false);
    for Field { name, kind, .. } in columns {
        let column = ColumnPath::new(vec![name.clone()]);
        properties = match kind {
            // Minimum and maximum would not distinguish row groups, and take a fifth of the writer's time.
            Kind::Number => properties
                .set_column_encoding(column.clone(), Encoding::PLAIN)
                .set_column_statistics_enabled(column, EnabledStatistics::None),
            Kind::Whole | Kind::Optional => properties.set_column_encoding(column, Encoding::DELTA_BINARY_PACKED),
            Kind::Repeated | Kind::Code | Kind::Text => properties.set_column_dictionary_enabled(column, true),
        };
    }
    properties.build()
}

/// The cause of the writer's failure: the system, or the writer itself.
fn failed(path: &std::path::Path, error: ParquetError) -> Error {
    let error = match error {
        ParquetError::External(cause) => match cause.downcast::<io::Error>() {
            Ok(error) => *error,
            Err(other) => io::Error::other(other),
        },
        other => io::Error::other(other.to_string()),
    };
    Error::file(path, FileAction::Write, &error)
}

/// A table of states being written: one row for each body and output time, in that order.
#[derive(Debug)]
pub(crate) struct ParquetStates {
    file: ParquetFile,
    cells: Option<usize>,
}

impl ParquetStates {
    pub(crate) fn begin(folder: &mut OutputFolder, stem: &str, layout: &Layout) -> Result<Self> {
        let mut fields = vec![Field::new("body", Kind::Whole), Field::new("t", Kind::Repeated)];
        fields.extend(layout.columns.iter().map(Field::from));
        fields.push(Field::new(column::STATUS, Kind::Code));
        fields.extend(layout.cells.map(|_| Field::new(column::CELL, Kind::Whole)));
        Ok(Self { file: ParquetFile::begin(folder, stem, &fields)?, cells: layout.cells })
    }

    /// Appends the rows of `states`, with `derived` values as in [`Layout::turn`].
    pub(crate) fn write_states(
        &mut self,
        layout: &Layout,
        (time, first_body): (f64, usize),
        states: &[OutputState],
        derived: &[&[f64]],
    ) -> Result<()> {
        let status = |part: Range<usize>| states[part].iter().map(|state| state.status().number());
        self.append(time, first_body, states.len(), status, |part, columns| {
            let derived: Vec<&[f64]> = derived.iter().map(|values| &values[part.clone()]).collect();
            layout.turn(&states[part], &derived, |place, numbers| columns[place].push_numbers(numbers));
        })
    }

    /// Appends rows of another table.
    pub(crate) fn write(&mut self, time: f64, first_body: usize, rows: &StateRows) -> Result<()> {
        let status = |part: Range<usize>| rows.status[part].iter().copied();
        self.append(time, first_body, rows.len(), status, |part, columns| {
            columns.iter_mut().zip(&rows.numbers).for_each(|(column, own)| column.push_numbers(&own[part.clone()]));
        })
    }

    /// Appends rows; `numbers` appends some of them to the columns of numbers.
    fn append<I: Iterator<Item = u8>>(
        &mut self,
        time: f64,
        first_body: usize,
        count: usize,
        status: impl Fn(Range<usize>) -> I,
        mut numbers: impl FnMut(Range<usize>, &mut [Cells]),
    ) -> Result<()> {
        let cells = self.cells;
        self.file.append_by(count, |part, columns| {
            let bodies = first_body + part.start..first_body + part.end;
            let (leading, columns) = columns.split_at_mut(2);
            let (columns, trailing) = columns.split_at_mut(columns.len() - 1 - usize::from(cells.is_some()));
            leading[0].push_whole(bodies.clone());
            leading[1].push_numbers(&vec![time; part.len()]);
            numbers(part.clone(), columns);
            trailing[0].push_codes(status(part));
            if let (Some(cells), [_, column]) = (cells, trailing) {
                column.push_whole(bodies.map(|body| body % cells));
            }
        })
    }

    pub(crate) fn finish(self) -> Result<()> {
        self.file.finish()
    }
}
