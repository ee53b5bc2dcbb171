//! Tables of bodies from Parquet: as others write them, of all types of numbers, with sums of pages; what is refused.

#![cfg(feature = "parquet")]

use std::fs::{self, File};
use std::path::Path;
use std::sync::Arc;

use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, FloatType, Int32Type, Int64Type};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;
use polhode::study::BodyTable;

use crate::workspace::Workspace;

/// A table of two bodies that pyarrow wrote with the sums of its pages (`write_page_checksum = True`).
const PAGE_SUMS: &[u8] = include_bytes!("../golden/page_sums.parquet");

#[test]
fn sums_of_pages_that_others_wrote_are_checked() {
    let desk = tempfile::tempdir().expect("a folder");
    let path = desk.path().join("bodies.parquet");
    fs::write(&path, PAGE_SUMS).expect("written");
    assert_eq!(BodyTable::read(&path, usize::MAX).expect("a table").len(), 2);
    for number in [1.0, 1.5, 2.0, 0.25, -1.5, 4.0_f64] {
        let bits = number.to_le_bytes();
        let place = PAGE_SUMS.windows(8).position(|bytes| bytes == bits).expect("a number of the table");
        for byte in place..place + 7 {
            let mut spoilt = PAGE_SUMS.to_vec();
            spoilt[byte] ^= 1 << (byte % 8);
            fs::write(&path, &spoilt).expect("written");
            let error = BodyTable::read(&path, usize::MAX).map(drop).expect_err("a bit is turned over").to_string();
            assert!(error.contains("bodies.parquet") && error.contains("CRC"), "{number}, {byte}: {error}");
        }
    }
}

/// A table of bodies as pandas and polars write it: columns that may be null, narrow numbers.
pub fn write_bodies(path: &Path, second_spin: Option<f64>, extra: &str) {
    let schema = format!(
        "message schema {{ optional double ixx; optional float iyy; required int32 izz; optional double wx;
         required double wy; required double wz; optional binary name (STRING); {extra} }}"
    );
    let schema = Arc::new(parse_message_type(&schema).expect("a schema"));
    let mut writer =
        SerializedFileWriter::new(File::create(path).expect("a file"), schema, Default::default()).expect("a writer");
    // Two row groups.
    for spins in [vec![Some(0.25), second_spin], vec![Some(-1.5)]] {
        let (count, there) = (spins.len(), vec![1_i16; spins.len()]);
        let mut group = writer.next_row_group().expect("a group");
        let mut column = group.next_column().expect("a column").expect("ixx");
        column.typed::<DoubleType>().write_batch(&vec![1.0; count], Some(&there), None).expect("written");
        column.close().expect("closed");
        let mut column = group.next_column().expect("a column").expect("iyy");
        column.typed::<FloatType>().write_batch(&vec![1.5; count], Some(&there), None).expect("written");
        column.close().expect("closed");
        let mut column = group.next_column().expect("a column").expect("izz");
        column.typed::<Int32Type>().write_batch(&vec![2; count], None, None).expect("written");
        column.close().expect("closed");
        let mut column = group.next_column().expect("a column").expect("wx");
        let levels: Vec<i16> = spins.iter().map(|spin| i16::from(spin.is_some())).collect();
        let values: Vec<f64> = spins.into_iter().flatten().collect();
        column.typed::<DoubleType>().write_batch(&values, Some(&levels), None).expect("written");
        column.close().expect("closed");
        for value in [0.5, 0.125] {
            let mut column = group.next_column().expect("a column").expect("wy, wz");
            column.typed::<DoubleType>().write_batch(&vec![value; count], None, None).expect("written");
            column.close().expect("closed");
        }
        let mut column = group.next_column().expect("a column").expect("name");
        let names = vec![ByteArray::from("Bénard"); count];
        column.typed::<ByteArrayType>().write_batch(&names, Some(&there), None).expect("written");
        column.close().expect("closed");
        while let Some(mut column) = group.next_column().expect("a column") {
            column.typed::<DoubleType>().write_batch(&vec![7.0; count], None, None).expect("written");
            column.close().expect("closed");
        }
        group.close().expect("closed");
    }
    writer.close().expect("closed");
}

const FROM_FILE: &str = "[bodies]\nfile = \"bodies.parquet\"\n[time]\nend = 1.0\n[output]\ninitial = true\n";

#[test]
fn tables_of_bodies_are_read_from_parquet() {
    let workspace = Workspace::new(FROM_FILE);
    write_bodies(&workspace.path("bodies.parquet"), Some(4.0), "");
    workspace.done(&["run", "study.toml", "--out", "out", "--quiet", "--engine", "cpu"]);
    let text = fs::read_to_string(workspace.path("out/initial.csv")).expect("a table");
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let header = reader.headers().expect("a header").clone();
    let rows: Vec<csv::StringRecord> = reader.records().map(|row| row.expect("a row")).collect();
    let column = |name: &str| -> Vec<&str> {
        let place = header.iter().position(|other| other == name).expect(name);
        rows.iter().map(|row| &row[place]).collect()
    };
    assert_eq!(column("wx"), ["0.25", "4.0", "-1.5"]);
    assert_eq!((column("iyy"), column("izz")), (vec!["1.5"; 3], vec!["2.0"; 3]));
    assert_eq!(column("name"), ["Bénard"; 3]);
}

#[test]
fn tables_of_bodies_that_are_wrong_are_refused_by_row_and_column() {
    let refused = |spin: Option<f64>, extra: &str| {
        let workspace = Workspace::new(FROM_FILE);
        write_bodies(&workspace.path("bodies.parquet"), spin, extra);
        let error = workspace.refused(&["run", "study.toml", "--out", "out"], 2);
        error.split_once("bodies.parquet:").expect("a place").1.trim_end().to_owned()
    };
    assert_eq!(refused(None, ""), "2: wx = (null): expected a finite number");
    assert_eq!(refused(Some(f64::INFINITY), ""), "2: wx = inf: expected a finite number");
    let unknown = refused(Some(1.0), "required double spin;");
    assert!(unknown.starts_with("1: spin"), "{unknown}");
    let workspace = Workspace::new(FROM_FILE);
    fs::write(workspace.path("bodies.parquet"), "ixx,iyy\n").expect("written");
    let error = workspace.refused(&["run", "study.toml", "--out", "out"], 2);
    assert!(error.contains("bodies.parquet:1: expected a Parquet file that is whole"), "{error}");
}

/// A table with one row of whole numbers, of types that a schema names.
fn write_whole(path: &Path, columns: &[(&str, i64)]) {
    let fields: Vec<String> = columns.iter().map(|(declaration, _)| format!("required {declaration};")).collect();
    let schema = parse_message_type(&format!("message schema {{ {} }}", fields.join(" "))).expect("a schema");
    let file = File::create(path).expect("a file");
    let mut writer = SerializedFileWriter::new(file, Arc::new(schema), Default::default()).expect("a writer");
    let mut group = writer.next_row_group().expect("a group");
    for (declaration, number) in columns {
        let mut column = group.next_column().expect("a column").expect("a column");
        let written = match declaration.starts_with("int32") {
            true => column.typed::<Int32Type>().write_batch(&[*number as i32], None, None),
            false => column.typed::<Int64Type>().write_batch(&[*number], None, None),
        };
        written.expect("written");
        column.close().expect("closed");
    }
    group.close().expect("closed");
    writer.close().expect("closed");
}

#[test]
fn decimals_and_integers_without_a_sign_are_the_numbers_that_they_mean() {
    let desk = tempfile::tempdir().expect("a folder");
    let path = desk.path().join("bodies.parquet");
    write_whole(
        &path,
        &[
            ("int32 ixx (DECIMAL(5, 1))", 15),
            ("int64 iyy (DECIMAL(18, 3))", -1_700),
            ("int64 izz (DECIMAL(18, 0))", 2),
            ("int32 wx (UINT_32)", -1),
            ("int32 wy (INTEGER(32, false))", 4_000_000_000_u32.cast_signed().into()),
            ("int64 wz (INTEGER(64, false))", i64::MIN),
            ("int32 x (INTEGER(8, true))", -3),
            ("int32 y (INT_16)", -4),
            ("int64 z", -5),
        ],
    );
    let table = BodyTable::read(&path, usize::MAX).expect("a table");
    let tensor = table.inertia(0);
    assert_eq!([tensor.xx, tensor.yy, tensor.zz], [1.5, -1.7, 2.0]);
    assert_eq!(table.angular_velocity(0).to_array(), [4_294_967_295.0, 4e9, 2.0_f64.powi(63)]);
    assert_eq!(table.position(0).to_array(), [-3.0, -4.0, -5.0]);
}

#[test]
fn columns_of_dates_and_times_are_refused_by_name_and_type() {
    let desk = tempfile::tempdir().expect("a folder");
    let path = desk.path().join("bodies.parquet");
    for (declared, named) in [
        ("int32 mass (DATE)", "date in INT32"),
        ("int32 mass (TIME(MILLIS, true))", "time in INT32"),
        ("int64 mass (TIMESTAMP(MICROS, true))", "timestamp in INT64"),
        ("int64 mass (TIMESTAMP_MILLIS)", "timestamp_millis in INT64"),
    ] {
        write_whole(&path, &[(declared, 7)]);
        let error = BodyTable::read(&path, usize::MAX).map(drop).expect_err(declared).to_string();
        let expected = format!("1: mass = (of type {named}): expected a column of numbers or of text");
        assert!(error.ends_with(&expected), "{error}\nnot {expected}");
    }
}

#[test]
fn a_table_that_is_compressed_is_refused_as_such() {
    let desk = tempfile::tempdir().expect("a folder");
    let path = desk.path().join("bodies.parquet");
    write_whole(&path, &[("int32 mass", 7)]);
    // The column's name ends its path in the footer; the codec follows: field 4 of the column's metadata, 0 for none, 1 for Snappy (zigzag 2).
    let mut bytes = fs::read(&path).expect("a file");
    let place = bytes.windows(6).position(|bytes| bytes == b"mass\x15\x00").expect("a codec");
    bytes[place + 5] = 2;
    fs::write(&path, bytes).expect("written");
    let error = BodyTable::read(&path, usize::MAX).map(drop).expect_err("it is compressed").to_string();
    let expected = "its columns are compressed (snappy): expected a Parquet file that is written uncompressed";
    assert!(error.ends_with(&format!("bodies.parquet:1: {expected}")), "{error}");
}
