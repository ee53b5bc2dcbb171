//! Tables of bodies in Parquet files: the columns of the CSV ones, numbers of any width, integers without a sign and
//! decimals stored as integers among them, texts in UTF-8. Messages count rows from 1.

use std::collections::BTreeSet;
use std::fmt::Debug;
use std::fs::File;
use std::path::Path;

use csv::StringRecord;
use parquet::basic::{Compression, ConvertedType, LogicalType};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::DataType;
use parquet::errors::{ParquetError, Result as ParquetResult};
use parquet::file::metadata::RowGroupMetaData;
use parquet::file::reader::{FileReader, RowGroupReader};
use parquet::file::serialized_reader::SerializedFileReader;
use parquet::schema::types::ColumnDescriptor;

use super::{BodyTable, NUMBERS, header_places, input_error};
use crate::error::{InputFault, Result};
use crate::study::parquet_reader::{self, guarded};
use crate::study::parquet_sums;

/// Number of rows that are decoded at once.
const BATCH: usize = 1 << 16;

/// Cells of a column of a row group.
enum Cells {
    Numbers(Vec<Option<f64>>),
    Texts(Vec<Option<Box<str>>>),
}

/// Reads the first `most` rows of a file, as [`BodyTable::read_with`].
pub(super) fn read(
    path: &Path,
    file: File,
    most: usize,
    extra: &BTreeSet<String>,
    carried: &BTreeSet<String>,
) -> Result<BodyTable> {
    let broken = |error: ParquetError| {
        let reason = format!("expected a Parquet file that is whole: {error}");
        input_error(path, 1, "", InputFault::Syntax { reason })
    };
    let again = file.try_clone().map_err(|error| broken(error.into()));
    let reader = parquet_reader::open(file).map_err(broken)?;
    parquet_sums::check(&mut again?, &reader).map_err(|reason| broken(ParquetError::General(reason)))?;
    if let Some(codec) = codec(&reader) {
        let reason =
            format!("its columns are compressed ({codec}): expected a Parquet file that is written uncompressed");
        return Err(input_error(path, 1, "", InputFault::Syntax { reason }));
    }
    let columns = reader.metadata().file_metadata().schema_descr().columns();
    let header: StringRecord = columns.iter().map(|column| column.path().string()).collect();
    let places = header_places(path, &header, 1, extra, carried)?;
    let mut table = BodyTable::empty(path, &header, &places, extra, carried);
    for index in 0..reader.num_row_groups() {
        let group = guarded(|| reader.get_row_group(index)).map_err(broken)?;
        let wanted = (group.metadata().num_rows().max(0) as usize).min(most - table.lines.len());
        let before = table.lines.len();
        let row = |place: usize| (before + place + 1) as u64;
        for (column, descriptor) in columns.iter().enumerate() {
            let name = &header[column];
            let refused = |place: usize, value: &str, expected: &'static str| {
                let fault = InputFault::Value { value: value.to_owned(), expected: expected.into() };
                input_error(path, row(place), name, fault)
            };
            let is_carried = carried.contains(name);
            if places[column].is_none() && !is_carried {
                continue;
            }
            if descriptor.max_rep_level() > 0 {
                return Err(refused(0, "(a list)", "expected a column of single values"));
            }
            let cells = guarded(|| cells(&*group, column, descriptor, wanted)).map_err(broken)?;
            let cells =
                cells.ok_or_else(|| refused(0, &type_name(descriptor), "expected a column of numbers or of text"))?;
            if is_carried {
                let texts = texts(&cells);
                let Some((_, all)) = table.carried.iter_mut().find(|(known, _)| known == name) else { continue };
                all.extend(texts);
            }
            let Some(place) = places[column] else { continue };
            let Cells::Numbers(numbers) = cells else {
                return Err(refused(0, "(text)", "expected a finite number"));
            };
            for (row, number) in numbers.into_iter().enumerate() {
                let text = number.map_or("(null)".to_owned(), |number| format!("{number:?}"));
                let number = number.filter(|number| number.is_finite());
                let number = number.ok_or_else(|| refused(row, &text, "expected a finite number"))?;
                match &mut table.columns.get_mut(place) {
                    Some(Some(column)) => column.push(number),
                    _ => table.extra[place - NUMBERS.len()].1.push(number),
                }
            }
        }
        table.lines.extend((0..wanted).map(row));
    }
    Ok(table)
}

/// The codec of the first column that is compressed: this build has none.
fn codec(reader: &SerializedFileReader<File>) -> Option<String> {
    let mut chunks = reader.metadata().row_groups().iter().flat_map(RowGroupMetaData::columns);
    let codec = chunks.find_map(|chunk| Some(chunk.compression()).filter(|codec| *codec != Compression::UNCOMPRESSED));
    codec.map(|codec| first_word(&codec))
}

/// The name of a variant, in small letters.
fn first_word(variant: &impl Debug) -> String {
    let text = format!("{variant:?}");
    text.split('(').next().unwrap_or_default().to_lowercase()
}

/// How the values of a column are to be read.
#[derive(Clone, Copy)]
enum Reading {
    /// As they are stored: numbers, or texts.
    Stored,
    /// As numbers without a sign.
    Unsigned,
    /// As decimals with so many digits after the point.
    Decimal(i32),
}

/// How a column is to be read by its logical type, or by what older files have in its place; `None` for dates, times and all else that is
/// neither a number nor a text.
fn reading(descriptor: &ColumnDescriptor) -> Option<Reading> {
    use ConvertedType as Converted;
    match (descriptor.logical_type_ref(), descriptor.converted_type()) {
        (Some(LogicalType::Integer(integer)), _) if !integer.is_signed => Some(Reading::Unsigned),
        (Some(LogicalType::Decimal(decimal)), _) => Some(Reading::Decimal(decimal.scale)),
        (Some(LogicalType::Integer(_) | LogicalType::String | LogicalType::Enum | LogicalType::Json), _) => {
            Some(Reading::Stored)
        }
        (Some(_), _) => None,
        (None, Converted::UINT_8 | Converted::UINT_16 | Converted::UINT_32 | Converted::UINT_64) => {
            Some(Reading::Unsigned)
        }
        (None, Converted::DECIMAL) => Some(Reading::Decimal(descriptor.type_scale())),
        (None, Converted::INT_8 | Converted::INT_16 | Converted::INT_32 | Converted::INT_64) => Some(Reading::Stored),
        (None, Converted::NONE | Converted::UTF8 | Converted::ENUM | Converted::JSON) => Some(Reading::Stored),
        (None, _) => None,
    }
}

/// The type of a column in messages.
fn type_name(descriptor: &ColumnDescriptor) -> String {
    let stored = descriptor.physical_type();
    match (descriptor.logical_type_ref(), descriptor.converted_type()) {
        (Some(logical), _) => format!("(of type {} in {stored})", first_word(logical)),
        (None, ConvertedType::NONE) => format!("(of type {stored})"),
        (None, converted) => format!("(of type {} in {stored})", first_word(&converted)),
    }
}

/// The number with these digits, of which `scale` stand after the point, rounded to nearest.
fn decimal(digits: i64, scale: i32) -> ParquetResult<f64> {
    let refused = |_| ParquetError::General("a decimal has no number".to_owned());
    format!("{digits}e{}", -i64::from(scale)).parse().map_err(refused)
}

/// The first rows of a column; `None` if it holds neither numbers nor texts.
fn cells(
    group: &dyn RowGroupReader,
    column: usize,
    descriptor: &ColumnDescriptor,
    count: usize,
) -> ParquetResult<Option<Cells>> {
    let level = descriptor.max_def_level();
    let Some(reading) = reading(descriptor) else { return Ok(None) };
    let numbers = match (group.get_column_reader(column)?, reading) {
        (ColumnReader::DoubleColumnReader(reader), Reading::Stored) => decoded(reader, level, count, |x| Ok(*x)),
        (ColumnReader::FloatColumnReader(reader), Reading::Stored) => {
            decoded(reader, level, count, |x| Ok(f64::from(*x)))
        }
        (ColumnReader::Int32ColumnReader(reader), reading) => decoded(reader, level, count, |x| match reading {
            Reading::Stored => Ok(f64::from(*x)),
            Reading::Unsigned => Ok(f64::from(x.cast_unsigned())),
            Reading::Decimal(scale) => decimal(i64::from(*x), scale),
        }),
        (ColumnReader::Int64ColumnReader(reader), reading) => decoded(reader, level, count, |x| match reading {
            Reading::Stored => Ok(*x as f64),
            Reading::Unsigned => Ok(x.cast_unsigned() as f64),
            Reading::Decimal(scale) => decimal(*x, scale),
        }),
        (ColumnReader::ByteArrayColumnReader(reader), Reading::Stored) => {
            let texts = decoded(reader, level, count, |x| Ok(x.as_utf8()?.into()))?;
            return Ok(Some(Cells::Texts(texts)));
        }
        _ => return Ok(None),
    };
    numbers.map(|numbers| Some(Cells::Numbers(numbers)))
}

fn decoded<T: DataType, C>(
    mut reader: ColumnReaderImpl<T>,
    level: i16,
    count: usize,
    cell: impl Fn(&T::T) -> ParquetResult<C>,
) -> ParquetResult<Vec<Option<C>>> {
    // A file may claim any number of rows.
    let mut found = Vec::with_capacity(count.min(BATCH));
    while found.len() < count {
        let (mut levels, mut values) = (Vec::new(), Vec::new());
        let most = BATCH.min(count - found.len());
        let (records, _, _) = reader.read_records(most, (level > 0).then_some(&mut levels), None, &mut values)?;
        if records == 0 {
            return Err(ParquetError::EOF("a column has fewer rows than its table".to_owned()));
        }
        let mut values = values.iter();
        let is_there = |row: usize| level == 0 || levels.get(row) == Some(&level);
        for row in 0..records {
            found.push(if is_there(row) { values.next().map(&cell).transpose()? } else { None });
        }
    }
    Ok(found)
}

/// The cells as text; empty where a cell is missing.
fn texts(cells: &Cells) -> Vec<Box<str>> {
    match cells {
        Cells::Texts(texts) => texts.iter().map(|text| text.clone().unwrap_or_default()).collect(),
        Cells::Numbers(numbers) => {
            let text =
                |number: &Option<f64>| number.map_or(String::new(), |x| zmij::Buffer::new().format(x).to_owned());
            numbers.iter().map(|number| text(number).into()).collect()
        }
    }
}
