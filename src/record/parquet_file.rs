//! Tables as Apache Parquet files, written a row group at a time.
//!
//! Numbers are plain, not compressed: random last digits do not shrink. Indices are packed as differences; times, codes and texts,
//! which repeat, by a dictionary. No date is written, so that equal rows and equal metadata make equal bytes, however many rows came
//! at once.
//!
//! Source: Apache Parquet, *File Format*, release 2.10 (parquet.apache.org/docs/file-format).

use std::io;
use std::mem;
use std::path::PathBuf;
use std::sync::Arc;

use bytes::Bytes;
use parquet::basic::{Encoding, LogicalType, Repetition, Type as PhysicalType};
use parquet::column::writer::{ColumnCloseResult, ColumnWriter, get_column_writer};
use parquet::data_type::ByteArray;
use parquet::errors::{ParquetError, Result as ParquetResult};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties, WriterPropertiesPtr};
use parquet::file::writer::{SerializedFileWriter, SerializedPageWriter, TrackedWrite};
use parquet::schema::types::{ColumnDescPtr, ColumnPath, Type};
use rayon::prelude::*;

use super::column::{self, Layout, Named, StateRows};
use super::folder::{OutputFile, OutputFolder, SharedMetadata};
use crate::bodies::state_columns;
use crate::error::{Error, FileAction, Result};
use crate::study::Format;

/// Rows of a row group: 16 MB of a table of states.
pub(crate) const GROUP: usize = 1 << 17;

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Number,
    /// A number that stays for many rows, such as a time.
    Repeated,
    /// An index or a count.
    Whole,
    /// An index that may be missing.
    Optional,
    /// Of a byte.
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

    /// Takes the rows of a column of the same kind.
    fn extend(&mut self, other: Self) {
        match (self, other) {
            (Self::Numbers(cells), Self::Numbers(more)) => cells.extend(more),
            (Self::Whole(cells), Self::Whole(more)) => cells.extend(more),
            (Self::Optional(cells), Self::Optional(more)) => cells.extend(more),
            (Self::Codes(cells), Self::Codes(more)) => cells.extend(more),
            (Self::Texts(cells), Self::Texts(more)) => cells.extend(more),
            _ => debug_assert!(false, "rows of another kind than their column"),
        }
    }

    /// Keeps the first `count` rows and gives the others.
    fn split_off(&mut self, count: usize) -> Self {
        match self {
            Self::Numbers(cells) => Self::Numbers(cells.split_off(count)),
            Self::Whole(cells) => Self::Whole(cells.split_off(count)),
            Self::Optional(cells) => Self::Optional(cells.split_off(count)),
            Self::Codes(cells) => Self::Codes(cells.split_off(count)),
            Self::Texts(cells) => Self::Texts(cells.split_off(count)),
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
    /// One whose name says what it is, as it does in every table of bodies, or else without a unit.
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

/// The key of the footer's text on columns.
const COLUMNS: &str = "polhode.columns";

/// Unit and meaning of the columns, by name.
fn described(fields: &[Field]) -> String {
    let entry = |field: &Field| (field.name.clone(), serde_json::json!({"unit": field.unit, "meaning": field.meaning}));
    serde_json::Value::Object(fields.iter().map(entry).collect()).to_string()
}

/// A table under way.
pub(crate) struct ParquetFile {
    path: PathBuf,
    writer: SerializedFileWriter<OutputFile>,
    kinds: Vec<Kind>,
    columns: Vec<ColumnDescPtr>,
    properties: WriterPropertiesPtr,
    /// Rows that make no row group yet.
    rows: Vec<Cells>,
    metadata: SharedMetadata,
    /// Of the columns.
    described: String,
}

impl std::fmt::Debug for ParquetFile {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_struct("ParquetFile").field("path", &self.path).finish_non_exhaustive()
    }
}

impl ParquetFile {
    /// Begins a table, whose footer has the folder's metadata as they are when it is finished.
    pub(crate) fn begin(folder: &mut OutputFolder, stem: &str, columns: &[Field]) -> Result<Self> {
        let file = folder.begin(&format!("{stem}.{}", Format::Parquet.name()))?;
        let (metadata, described) = (folder.metadata(), described(columns));
        let path = file.path().to_owned();
        let properties = Arc::new(properties(columns));
        let writer = schema(columns).and_then(|schema| SerializedFileWriter::new(file, schema, properties.clone()));
        let writer = writer.map_err(|error| failed(&path, error))?;
        let kinds: Vec<Kind> = columns.iter().map(|field| field.kind).collect();
        let columns = writer.schema_descr().columns().to_vec();
        let rows = kinds.iter().map(|&kind| Cells::none(kind)).collect();
        Ok(Self { path, writer, kinds, columns, properties, rows, metadata, described })
    }

    /// Appends rows, column by column.
    pub(crate) fn append(&mut self, rows: Vec<Cells>) -> Result<()> {
        self.rows.iter_mut().zip(rows).for_each(|(column, cells)| column.extend(cells));
        while self.rows.first().is_some_and(|column| column.len() >= GROUP) {
            let rest = self.rows.iter_mut().map(|column| column.split_off(GROUP)).collect();
            let group = mem::replace(&mut self.rows, rest);
            self.write_group(group)?;
        }
        Ok(())
    }

    /// Writes a row group, of which each column is encoded by a task of its own.
    fn write_group(&mut self, rows: Vec<Cells>) -> Result<()> {
        let path = &self.path;
        let columns = rows.par_iter().zip(&self.columns);
        let encoded: ParquetResult<Vec<_>> =
            columns.map(|(cells, column)| encoded(cells, column, &self.properties)).collect();
        let written = || {
            let mut group = self.writer.next_row_group()?;
            for (bytes, closed) in encoded? {
                group.append_column(&bytes, closed)?;
            }
            group.close().map(drop)
        };
        written().map_err(|error| failed(path, error))
    }

    /// Writes the last rows and the footer.
    pub(crate) fn finish(mut self) -> Result<()> {
        let none = self.kinds.iter().map(|&kind| Cells::none(kind)).collect();
        let rows = mem::replace(&mut self.rows, none);
        if rows.first().is_some_and(|column| column.len() > 0) {
            self.write_group(rows)?;
        }
        let of_columns = (COLUMNS.to_owned(), mem::take(&mut self.described));
        for (key, value) in self.metadata.entries().into_iter().chain([of_columns]) {
            self.writer.append_key_value_metadata(KeyValue::new(key, value));
        }
        let Self { path, writer, .. } = self;
        writer.into_inner().map_err(|error| failed(&path, error))?.finish()
    }
}

/// A column chunk, encoded in memory.
fn encoded(
    cells: &Cells,
    column: &ColumnDescPtr,
    properties: &WriterPropertiesPtr,
) -> ParquetResult<(Bytes, ColumnCloseResult)> {
    let mut bytes = TrackedWrite::new(Vec::new());
    let pages = Box::new(SerializedPageWriter::new(&mut bytes));
    let mut writer = get_column_writer(column.clone(), properties.clone(), pages);
    match (&mut writer, cells) {
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
    let closed = writer.close()?;
    Ok((Bytes::from(bytes.into_inner()?), closed))
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
        .set_created_by(concat!("polhode version ", env!("CARGO_PKG_VERSION")).to_owned())
        .set_max_row_group_row_count(Some(GROUP))
        .set_statistics_enabled(EnabledStatistics::Chunk)
        .set_offset_index_disabled(true)
        .set_dictionary_enabled(false);
    for Field { name, kind, .. } in columns {
        let column = ColumnPath::new(vec![name.clone()]);
        properties = match kind {
            Kind::Number => properties.set_column_encoding(column, Encoding::PLAIN),
            Kind::Whole | Kind::Optional => properties.set_column_encoding(column, Encoding::DELTA_BINARY_PACKED),
            Kind::Repeated | Kind::Code | Kind::Text => properties.set_column_dictionary_enabled(column, true),
        };
    }
    properties.build()
}

/// What hindered the writer: the system, or the writer itself.
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

/// A table of states under way: one row a body and output time, in that order.
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

    pub(crate) fn write(&mut self, time: f64, first_body: usize, rows: &StateRows) -> Result<()> {
        let count = rows.len();
        let bodies = first_body..first_body + count;
        let mut cells =
            vec![Cells::Whole(bodies.clone().map(|body| body as i64).collect()), Cells::Numbers(vec![time; count])];
        cells.extend(rows.numbers.iter().cloned().map(Cells::Numbers));
        cells.push(Cells::Codes(rows.status.iter().copied().map(i32::from).collect()));
        cells.extend(self.cells.map(|cells| Cells::Whole(bodies.map(|body| (body % cells) as i64).collect())));
        self.file.append(cells)
    }

    pub(crate) fn finish(self) -> Result<()> {
        self.file.finish()
    }
}
