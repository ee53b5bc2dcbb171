//! Tables of bodies in Parquet files: the columns of the CSV ones, numbers of any width, texts in UTF-8. Messages count rows from 1.

use std::collections::BTreeSet;
use std::fs::File;
use std::path::Path;

use csv::StringRecord;
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::DataType;
use parquet::errors::{ParquetError, Result as ParquetResult};
use parquet::file::reader::{FileReader, RowGroupReader};
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
                cells.ok_or_else(|| refused(0, "(of another type)", "expected a column of numbers or of text"))?;
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

/// The first rows of a column; `None` if it holds neither numbers nor texts.
fn cells(
    group: &dyn RowGroupReader,
    column: usize,
    descriptor: &ColumnDescriptor,
    count: usize,
) -> ParquetResult<Option<Cells>> {
    let level = descriptor.max_def_level();
    Ok(match group.get_column_reader(column)? {
        ColumnReader::DoubleColumnReader(reader) => Some(Cells::Numbers(decoded(reader, level, count, |x| Ok(*x))?)),
        ColumnReader::FloatColumnReader(reader) => {
            Some(Cells::Numbers(decoded(reader, level, count, |x| Ok(f64::from(*x)))?))
        }
        ColumnReader::Int32ColumnReader(reader) => {
            Some(Cells::Numbers(decoded(reader, level, count, |x| Ok(f64::from(*x)))?))
        }
        ColumnReader::Int64ColumnReader(reader) => {
            Some(Cells::Numbers(decoded(reader, level, count, |x| Ok(*x as f64))?))
        }
        ColumnReader::ByteArrayColumnReader(reader) => {
            Some(Cells::Texts(decoded(reader, level, count, |x| Ok(x.as_utf8()?.into()))?))
        }
        _ => None,
    })
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
