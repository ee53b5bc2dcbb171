//! Rows of Parquet files as [`crate::record::parquet_file`] writes them.

use std::fs::File;
use std::path::Path;

use parquet::basic::Type as PhysicalType;
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::DataType;
use parquet::errors::Result as ParquetResult;
use parquet::file::reader::{FileReader, RowGroupReader};
use parquet::file::serialized_reader::SerializedFileReader;

use super::Values;
use super::{Shape, TableRows, read_failed, wrong};
use crate::error::Result;
use crate::record::column::{self, StateRows};
use crate::study::parquet_reader::{self, guarded};
use crate::study::parquet_sums::{self, check_group, of_groups};

#[derive(Debug)]
pub(super) struct ParquetTable {
    names: Vec<String>,
    /// Whether each row group's bytes were verified.
    checked: Vec<bool>,
}

impl ParquetTable {
    pub fn open(path: &Path, file: File) -> Result<Self> {
        let reader = reader(path, file)?;
        let columns = reader.metadata().file_metadata().schema_descr().columns();
        let is_one_of_ours = columns.iter().all(|column| {
            let expected = match column.name() {
                "body" | column::CELL => PhysicalType::INT64,
                column::STATUS => PhysicalType::INT32,
                _ => PhysicalType::DOUBLE,
            };
            column.max_def_level() == 0 && column.max_rep_level() == 0 && column.physical_type() == expected
        });
        if !is_one_of_ours {
            return Err(wrong(path, "expected the columns of states that a run writes"));
        }
        let names = columns.iter().map(|column| column.name().to_owned()).collect();
        Ok(Self { names, checked: vec![false; reader.num_row_groups()] })
    }

    pub fn names(&self) -> &[String] {
        &self.names
    }

    pub fn read(
        &mut self,
        path: &Path,
        mut file: File,
        (first, count): (u64, usize),
        shape: Shape,
    ) -> Result<TableRows> {
        let failed = |error: parquet::errors::ParquetError| wrong(path, error.to_string());
        let reader = reader(path, file.try_clone().map_err(|error| read_failed(path, &error))?)?;
        let sums = of_groups(&mut file, &reader).map_err(|reason| wrong(path, reason))?;
        let mut found = TableRows::default();
        found.rows.numbers = vec![Vec::new(); shape.columns];
        let mut start = 0;
        for (index, group) in reader.metadata().row_groups().iter().enumerate() {
            let rows = group.num_rows().max(0) as u64;
            let own = first.max(start)..(first + count as u64).min(start + rows);
            if !own.is_empty() {
                let part = ((own.start - start) as usize, (own.end - own.start) as usize);
                // The file may have been replaced since it was opened.
                if let Some(sums) = sums.as_ref().filter(|_| self.checked.get(index) != Some(&true)) {
                    check_group(&mut file, group, sums[index]).map_err(|reason| wrong(path, reason))?;
                    self.checked.get_mut(index).into_iter().for_each(|checked| *checked = true);
                }
                let reader = guarded(|| reader.get_row_group(index)).map_err(failed)?;
                found.bodies.extend(
                    guarded(|| whole(&*reader, 0, part)).map_err(failed)?.into_iter().map(|body| body as usize),
                );
                found.times.extend(guarded(|| numbers(&*reader, 1, part)).map_err(failed)?);
                for (column, all) in (2..).zip(&mut found.rows.numbers) {
                    all.extend(guarded(|| numbers(&*reader, column, part)).map_err(failed)?);
                }
                let codes = guarded(|| codes(&*reader, 2 + shape.columns, part)).map_err(failed)?;
                found.rows.status.extend(codes.into_iter().map(|code| code as u8));
            }
            start += rows;
        }
        let expected = (start.saturating_sub(first) as usize).min(count);
        let StateRows { numbers, status } = &found.rows;
        let is_whole = numbers.iter().map(Vec::len).chain([found.bodies.len(), found.times.len(), status.len()]);
        match is_whole.into_iter().all(|rows| rows == expected) {
            true => Ok(found),
            false => Err(wrong(path, "a column has fewer rows than its table says")),
        }
    }
}

/// All columns, by name; missing numbers are NaN.
pub(super) fn columns(path: &Path, file: File) -> Result<Vec<(String, Values)>> {
    use parquet::record::Field;
    let mut whole = file.try_clone().map_err(|error| read_failed(path, &error))?;
    let reader = reader(path, file)?;
    parquet_sums::check(&mut whole, &reader).map_err(|reason| wrong(path, reason))?;
    let schema = reader.metadata().file_metadata().schema_descr().columns().iter();
    let is_text = |kind| kind == PhysicalType::BYTE_ARRAY;
    let mut columns: Vec<(String, Values)> = schema
        .map(|column| match is_text(column.physical_type()) {
            true => (column.name().to_owned(), Values::Texts(Vec::new())),
            false => (column.name().to_owned(), Values::Numbers(Vec::new())),
        })
        .collect();
    let read = guarded(|| {
        for row in reader.get_row_iter(None)? {
            for ((_, values), (_, field)) in columns.iter_mut().zip(row?.get_column_iter()) {
                match (values, field) {
                    (Values::Numbers(numbers), Field::Double(number)) => numbers.push(*number),
                    (Values::Numbers(numbers), Field::Long(number)) => numbers.push(*number as f64),
                    (Values::Numbers(numbers), Field::UByte(number)) => numbers.push(f64::from(*number)),
                    (Values::Texts(texts), Field::Str(text)) => texts.push(text.clone()),
                    (Values::Numbers(numbers), _) => numbers.push(f64::NAN),
                    (Values::Texts(texts), _) => texts.push(String::new()),
                }
            }
        }
        Ok(())
    });
    read.map_err(|error| wrong(path, error.to_string()))?;
    Ok(columns)
}

fn reader(path: &Path, file: File) -> Result<SerializedFileReader<File>> {
    let cut = |error| wrong(path, format!("it is cut, or no Parquet file: {error}"));
    parquet_reader::open(file).map_err(cut)
}

/// Some rows of a column of a row group: the number of rows before them, and their number.
type Part = (usize, usize);

fn numbers(group: &dyn RowGroupReader, column: usize, part: Part) -> ParquetResult<Vec<f64>> {
    match group.get_column_reader(column)? {
        ColumnReader::DoubleColumnReader(reader) => cells(reader, part),
        _ => Ok(Vec::new()),
    }
}

fn whole(group: &dyn RowGroupReader, column: usize, part: Part) -> ParquetResult<Vec<i64>> {
    match group.get_column_reader(column)? {
        ColumnReader::Int64ColumnReader(reader) => cells(reader, part),
        _ => Ok(Vec::new()),
    }
}

fn codes(group: &dyn RowGroupReader, column: usize, part: Part) -> ParquetResult<Vec<i32>> {
    match group.get_column_reader(column)? {
        ColumnReader::Int32ColumnReader(reader) => cells(reader, part),
        _ => Ok(Vec::new()),
    }
}

fn cells<T: DataType>(mut reader: ColumnReaderImpl<T>, (before, count): Part) -> ParquetResult<Vec<T::T>> {
    let mut found = Vec::new();
    if reader.skip_records(before)? == before {
        while found.len() < count {
            let (_, values, _) = reader.read_records(count - found.len(), None, None, &mut found)?;
            if values == 0 {
                break;
            }
        }
    }
    Ok(found)
}
