//! Parquet: the numbers of the other formats, to the bit; columns that were chosen; what footers say; and tables with random faults, archives of
//! arrays among them.

#![cfg(feature = "parquet")]

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::io::{Seek, SeekFrom, Write};
use std::path::Path;

use parquet::file::reader::FileReader;
use parquet::file::serialized_reader::SerializedFileReader;
use polhode::record::{StateRow, StateTable};
use polhode::study::{BodyTable, Format};

use crate::in_parts::OBSERVED_TABLES;
use crate::workspace::{States, Workspace};

/// More rows than a row group has, of which some are NaN; `tests/parquet.sh` runs it too.
const STUDY: &str = include_str!("parquet_study.toml");

/// Runs the study, whose long steps are warned of.
fn run(workspace: &Workspace) {
    let output = workspace.polhode(&["run", "study.toml", "--out", "out", "--quiet", "--engine", "cpu"]);
    assert!(output.status.success(), "{}", crate::workspace::words(&output.stderr));
}

fn rows(path: &Path) -> Vec<StateRow> {
    let mut table = StateTable::open(path).expect("a table of states");
    let mut rows = Vec::new();
    loop {
        // Blocks that end nowhere where row groups do.
        let more = table.read(rows.len() as u64, 70_001).expect("rows");
        if more.is_empty() {
            return rows;
        }
        rows.extend(more);
    }
}

/// All numbers of a row as bits, so that NaN equals itself.
fn bits(row: &StateRow) -> Vec<u64> {
    let rotation = &row.state.rotation;
    let (position, velocity) = row.state.translation.unwrap_or_default();
    let mut numbers = vec![row.time, rotation.kinetic_energy, f64::from(rotation.status.number())];
    numbers.extend(rotation.orientation.to_array());
    for vector in [rotation.angular_velocity_body, rotation.angular_momentum_world, position, velocity] {
        numbers.extend(vector.to_array());
    }
    numbers.into_iter().map(f64::to_bits).chain([row.body as u64]).collect()
}

/// A column by its bits, all that is no number as one, or by its words.
#[derive(Debug, PartialEq)]
enum Column {
    Numbers(Vec<u64>),
    Words(Vec<String>),
}

/// The columns of words.
const WORDS: [&str; 4] = ["event", "reason", "known_to", "quantity"];

#[test]
fn every_table_of_a_run_is_read_as_a_whole_from_every_format() {
    let mut tables = BTreeMap::new();
    for format in Format::ALL.iter().map(|format| format.name()) {
        let study = crate::in_parts::OBSERVED
            .replace("[output]", &format!("[output]\nformat = \"{format}\"\nsnapshots = true"));
        let workspace = Workspace::new(&study);
        run(&workspace);
        for name in workspace.names("out").iter().filter(|name| name.ends_with(format)) {
            let table = polhode::record::read(&workspace.path("out").join(name)).expect("a table");
            let column = |name: &str| match WORDS.contains(&name) {
                true => Column::Words(table.texts(name).expect("words").to_vec()),
                false => {
                    let numbers = table.numbers(name).expect("numbers");
                    // Arrays of indices have no place for what is missing.
                    let canonical =
                        |&number: &f64| if number.is_nan() || number == -1.0 { u64::MAX } else { number.to_bits() };
                    Column::Numbers(numbers.iter().map(canonical).collect())
                }
            };
            let columns: BTreeMap<String, Column> = table.names().map(|name| (name.to_owned(), column(name))).collect();
            for (column, values) in &columns {
                let rows = match values {
                    Column::Numbers(numbers) => numbers.len(),
                    Column::Words(words) => words.len(),
                };
                assert!(rows == table.len() && !table.is_empty(), "{name}, {column}: {rows} of {} rows", table.len());
            }
            let stem = name.trim_end_matches(format).trim_end_matches('.').to_owned();
            let other: &mut BTreeMap<String, Column> =
                tables.entry(stem).or_insert_with(|| columns.keys().map(|name| (name.clone(), column(name))).collect());
            for (column, values) in &columns {
                assert!(other.get(column) == Some(values), "{name}: {column} differs");
            }
            assert_eq!(other.len(), columns.len(), "{name}");
        }
    }
    let stems: BTreeSet<&str> = tables.keys().map(String::as_str).collect();
    assert_eq!(stems, OBSERVED_TABLES.into_iter().chain(["snapshots"]).collect());
    assert!(tables["snapshots"].contains_key("tilt") && tables["snapshots"].contains_key("cell"));

    // What is cut is no table.
    let workspace = Workspace::new(&crate::in_parts::OBSERVED.replace("[output]", "[output]\nformat = \"npz\""));
    run(&workspace);
    for name in ["final.npz", "events.npz"] {
        let path = workspace.path("out").join(name);
        let bytes = fs::read(&path).expect("a file");
        fs::write(&path, &bytes[..bytes.len() / 2]).expect("written");
        let error = polhode::record::read(&path).expect_err("it is cut").to_string();
        assert!(error.contains(name) && error.contains("cut"), "{error}");
        // Nor is what has another number than was written: a bit of the first array, or of what says how long it is.
        let array = bytes.windows(6).position(|bytes| bytes == b"\x93NUMPY").expect("an array");
        for place in (array + 6..array + 128 + 64).step_by(3) {
            let mut spoilt = bytes.clone();
            spoilt[place] ^= 1 << (place % 8);
            fs::write(&path, &spoilt).expect("written");
            let error = polhode::record::read(&path).expect_err("a bit is turned over").to_string();
            assert!(error.contains(name), "{place}: {error}");
            if name == "final.npz" {
                assert!(StateTable::open(&path).is_err(), "{place}");
            }
            let is_number = place >= array + 128;
            assert!(!is_number || error.ends_with("it is not as it was written: its sum differs"), "{place}: {error}");
        }
    }
}

/// Changes a byte of a file where it lies.
fn set_byte(path: &Path, place: usize, byte: u8) {
    let mut file = fs::OpenOptions::new().write(true).open(path).expect("a file");
    file.seek(SeekFrom::Start(place as u64)).expect("a place");
    file.write_all(&[byte]).expect("written");
}

#[test]
fn a_parquet_table_in_which_a_bit_was_turned_over_is_refused() {
    // Two row groups, of which the second is small; and a table of texts, dictionaries and empty cells.
    let workspace = Workspace::new(&STUDY.replace("30_000", "35_000"));
    run(&workspace);
    let observed = Workspace::new(&crate::in_parts::OBSERVED.replace("[output]", "[output]\nformat = \"parquet\""));
    run(&observed);
    let tables = [workspace.path("out/snapshots.parquet"), observed.path("out/events.parquet")];
    for (path, groups) in tables.iter().zip([2, 1]) {
        let bytes = fs::read(path).expect("a file");
        let reader = SerializedFileReader::new(File::open(path).expect("a file")).expect("a table");
        let metadata = reader.metadata();
        assert_eq!(metadata.num_row_groups(), groups, "{}", path.display());
        let last = metadata.row_group(groups - 1);
        let start = last.columns().iter().map(|chunk| chunk.byte_range().0).min().expect("columns") as usize;
        let end = start + last.compressed_size() as usize;
        let step = ((end - start) / 150).max(1);
        let in_groups = (start..end).step_by(step).chain([4, end - 1]);
        // Every byte of the footer, its length and the closing mark.
        let in_footer = end..bytes.len();
        assert!(in_footer.len() > 500, "{}", in_footer.len());
        // And the bit that makes a capital of a letter, as hexadecimal digits are.
        let capitals = in_footer.clone().filter(|place| bytes[*place].is_ascii_lowercase()).map(|place| (place, 5));
        let any = in_groups.chain(in_footer.clone()).map(|place| (place, place % 8));
        for (place, bit) in any.chain(capitals) {
            set_byte(path, place, bytes[place] ^ (1 << bit));
            let read = polhode::record::read(path).map(drop);
            let states = || StateTable::open(path).and_then(|mut table| table.read(0, 200_000)).map(drop);
            let bodies = || BodyTable::read(path, usize::MAX).map(drop);
            let is_table_of_states = groups == 2;
            for found in [Some(read), is_table_of_states.then(states), Some(bodies())].into_iter().flatten() {
                let Err(error) = found else {
                    panic!("{}: byte {place}, row groups end at {end}, {} in all", path.display(), bytes.len())
                };
                let error = error.to_string();
                assert!(error.contains(".parquet"), "{place}: {error}");
                let is_known = error.contains("the sum of a row group differs");
                assert!(is_known || in_footer.contains(&place), "{place}: {error}");
            }
            set_byte(path, place, bytes[place]);
        }
        polhode::record::read(path).expect("it is as it was written");
    }
}

#[test]
fn arrays_that_do_not_fit_together_are_no_table() {
    let array = |count: usize| {
        let header = format!("{{'descr': '<u8', 'fortran_order': False, 'shape': ({count},), }}");
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(vec![0; 8 * count]);
        bytes
    };
    let desk = tempfile::tempdir().expect("a folder");
    let path = desk.path().join("odd.npz");
    for (counts, fit) in [
        ([3, 2, 6], true),
        ([6, 6, 6], true),
        ([0, 2, 6], false),
        ([3, 1, 6], false),
        ([4, 2, 6], false),
        ([6, 0, 6], false),
    ] {
        let mut archive = zip::ZipWriter::new(File::create(&path).expect("a file"));
        for (name, count) in ["body.npy", "t.npy", "qx.npy"].iter().zip(counts) {
            let stored = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
            archive.start_file(*name, stored).expect("begun");
            std::io::Write::write_all(&mut archive, &array(count)).expect("written");
        }
        archive.finish().expect("finished");
        match polhode::record::read(&path) {
            Ok(table) => {
                assert!(fit && table.names().all(|name| table.numbers(name).is_some_and(|row| row.len() == 6)))
            }
            Err(error) => {
                assert!(!fit && error.to_string().ends_with("its columns have no common rows"), "{counts:?}: {error}")
            }
        }
    }
}

#[test]
fn parquet_holds_the_numbers_of_the_other_formats_to_the_bit() {
    let mut tables = BTreeMap::new();
    for format in Format::ALL.iter().map(|format| format.name()) {
        let more = STUDY.replace("\"pointing\"]", "\"pointing\", \"dynamic_inertia\"]");
        let workspace = Workspace::new(&more.replace("\"parquet\"", &format!("\"{format}\"")));
        run(&workspace);
        let names: Vec<String> = workspace.names("out").into_iter().filter(|name| name.ends_with(format)).collect();
        let stems =
            ["events", "failed", "final", "histograms", "initial", "snapshots", "statistics", "survival", "times"];
        let expected: Vec<String> = stems.iter().map(|stem| format!("{stem}.{format}")).collect();
        assert_eq!(names, expected);
        for stem in ["final", "snapshots"] {
            let found: Vec<Vec<u64>> =
                rows(&workspace.path(&format!("out/{stem}.{format}"))).iter().map(bits).collect();
            tables.insert((stem, format), found);
        }
        if format == "parquet" {
            let (small, full) = (numbers(&workspace.path("out/statistics.parquet")), STATISTICS_COLUMNS);
            assert_eq!(small.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>(), full);
            tables.insert(("statistics", format), small.into_iter().map(|(_, bits)| bits).collect());
        } else if format == "csv" {
            let states = States::read(&workspace.path("out/statistics.csv"));
            let column = |name: &&str| states.column(name).iter().map(|number| number.to_bits()).collect();
            tables.insert(("statistics", format), STATISTICS_COLUMNS.iter().map(column).collect());
        }
    }
    assert_eq!((tables[&("final", "csv")].len(), tables[&("snapshots", "csv")].len()), (30_000, 150_000));
    let lost = tables[&("final", "csv")].iter().filter(|row| row[2] != 0).count();
    assert!((1..30_000).contains(&lost), "{lost} bodies failed: the study should lose some");
    for stem in ["final", "snapshots"] {
        for format in Format::ALL.iter().map(|format| format.name()) {
            assert!(tables[&(stem, "csv")] == tables[&(stem, format)], "{stem}.{format} differs from {stem}.csv");
        }
    }
    assert_eq!(tables[&("statistics", "csv")], tables[&("statistics", "parquet")]);
}

const STATISTICS_COLUMNS: [&str; 24] = [
    "t",
    "count",
    "spin_rate_mean",
    "spin_rate_standard_deviation",
    "spin_rate_min",
    "spin_rate_max",
    "spin_rate_min_body",
    "spin_rate_max_body",
    "spin_rate_q50",
    "pointing_mean",
    "pointing_standard_deviation",
    "pointing_min",
    "pointing_max",
    "pointing_min_body",
    "pointing_max_body",
    "pointing_q50",
    "dynamic_inertia_count",
    "dynamic_inertia_mean",
    "dynamic_inertia_standard_deviation",
    "dynamic_inertia_min",
    "dynamic_inertia_max",
    "dynamic_inertia_min_body",
    "dynamic_inertia_max_body",
    "dynamic_inertia_q50",
];

/// The columns of a small table as another reader of this library's dependency gives them: bits of `f64`.
fn numbers(path: &Path) -> Vec<(String, Vec<u64>)> {
    use parquet::record::Field;
    let reader = SerializedFileReader::new(File::open(path).expect("a file")).expect("a Parquet file");
    let mut columns: Vec<(String, Vec<u64>)> = Vec::new();
    for row in reader.get_row_iter(None).expect("rows") {
        for (place, (name, field)) in row.expect("a row").get_column_iter().enumerate() {
            let number = match field {
                Field::Double(number) => *number,
                Field::Long(number) => *number as f64,
                other => panic!("{name}: {other}"),
            };
            if columns.len() <= place {
                columns.push((name.clone(), Vec::new()));
            }
            columns[place].1.push(number.to_bits());
        }
    }
    columns
}

#[test]
fn footers_say_what_the_run_was_and_what_columns_are() {
    let workspace = Workspace::new(&STUDY.replace("30_000", "300"));
    run(&workspace);
    let study = fs::read_to_string(workspace.path("study.toml")).expect("the study");
    let plan = fs::read_to_string(workspace.path("out/plan.json")).expect("the plan");
    let report = crate::workspace::report(&workspace, "out");
    for name in ["final", "snapshots", "statistics", "events", "survival", "histograms", "initial"] {
        let file = File::open(workspace.path(&format!("out/{name}.parquet"))).expect("a file");
        let reader = SerializedFileReader::new(file).expect("a Parquet file");
        let metadata = reader.metadata().file_metadata();
        let pairs = metadata.key_value_metadata().expect("pairs");
        let pairs: BTreeMap<&str, &str> =
            pairs.iter().map(|pair| (pair.key.as_str(), pair.value.as_deref().unwrap_or_default())).collect();
        let [version, title] = ["polhode.version", "polhode.title"].map(|key| pairs[key]);
        assert_eq!((version, title), (env!("CARGO_PKG_VERSION"), "Thirty thousand boxes, \"some\" lost"));
        assert_eq!((pairs["polhode.study"], pairs["polhode.plan"]), (study.as_str(), plan.as_str()));
        assert_eq!(pairs["polhode.seed"], "5");
        // What bodies start with is written before the run.
        if name == "initial" {
            assert!(!pairs.contains_key("polhode.report"));
        } else {
            let of_run: serde_json::Value = serde_json::from_str(pairs["polhode.report"]).expect("JSON");
            assert_eq!([&of_run["bodies"], &of_run["span"]], [&report["bodies"], &report["span"]]);
            assert_eq!(of_run["failures"], report["failures"]);
            assert!(of_run["failures"][0]["bodies"].as_u64() > Some(0), "{of_run}");
            for key in ["bodies", "beyond", "met"] {
                assert_eq!(of_run["accuracy"][key], report["accuracy"][key], "{key}");
            }
            assert_eq!(of_run["accuracy"]["attitude_max"], report["accuracy"]["attitude"]["max"]);
        }
        let columns: serde_json::Value = serde_json::from_str(pairs["polhode.columns"]).expect("JSON");
        for column in metadata.schema_descr().columns() {
            assert!(columns[column.name()]["unit"].is_string(), "{name}: {}", column.name());
        }
        let expected = match name {
            "final" | "snapshots" => [("wx", "rad/s"), ("vx", "m/s")],
            "statistics" => [("spin_rate_mean", "rad/s"), ("pointing_q50", "rad")],
            "initial" => [("ixx", "kg m²"), ("mass", "kg")],
            "events" => [("t", "s"), ("wx", "rad/s")],
            _ => continue,
        };
        expected.iter().for_each(|(column, unit)| assert_eq!(columns[column]["unit"], *unit, "{name}: {column}"));
    }
}

#[test]
fn columns_are_those_that_were_asked_for_derived_ones_included() {
    let columns = r#"columns = ["pointing", "qw", "spin_rate", "wx", "wy", "wz", "kinetic_energy", "vx"]"#;
    for format in Format::ALL.iter().map(|format| format.name()) {
        let study = STUDY.replace("30_000", "500").replace("initial = true", columns);
        let workspace = Workspace::new(&study.replace("\"parquet\"", &format!("\"{format}\"")));
        run(&workspace);
        let table = StateTable::open(&workspace.path(&format!("out/snapshots.{format}"))).expect("a table");
        assert_eq!(table.columns(), ["pointing", "qw", "spin_rate", "wx", "wy", "wz", "kinetic_energy", "vx"]);
        let rows = rows(&workspace.path(&format!("out/snapshots.{format}")));
        assert_eq!(rows.len(), 2_500);
        assert!(rows.iter().all(|row| row.state.rotation.orientation.x.is_nan()), "no column, no number");
        if format == "csv" {
            let states = States::read(&workspace.path("out/snapshots.csv"));
            let mut compared = 0;
            for row in 0..states.rows() {
                let rate = states.vector(["wx", "wy", "wz"], row).length();
                if states.column("status")[row] == 0.0 {
                    assert!((states.column("spin_rate")[row] - rate).abs() <= 4e-16 * rate, "row {row}");
                    assert!((0.0..=std::f64::consts::PI).contains(&states.column("pointing")[row]), "row {row}");
                    compared += 1;
                } else {
                    assert!(states.column("pointing")[row].is_nan(), "row {row}");
                }
            }
            assert!(compared > 1_000, "{compared} rows compared");
        }
    }
}

#[test]
fn columns_that_cannot_be_are_refused_where_they_stand() {
    let refused = |columns: &str, other: (&str, &str)| {
        let study = STUDY.replace("initial = true", columns).replace(other.0, other.1);
        let error = Workspace::new(&study).refused(&["run", "study.toml", "--out", "out"], 2);
        error.split_once("study.toml:").expect("a place").1.trim_end().to_owned()
    };
    let begins = |error: String, expected: &str| assert!(error.starts_with(expected), "{error}");
    begins(
        refused("columns = [\"spinrate\"]", ("", "")),
        "35: output.columns = \"spinrate\": did you mean spin_rate? expected a column: qx,",
    );
    begins(refused("columns = [\"qx\", \"qx\"]", ("", "")), "35: output.columns = \"qx\": expected each column once");
    begins(refused("columns = []", ("", "")), "35: output.columns = []: expected a list of columns");
    let nothing = refused("columns = [\"qx\"]\nfinal = false", ("snapshots = true", "snapshots = false"));
    begins(nothing, "35: output.columns = [\"qx\"]: expected final = true or snapshots = true too");
}

#[test]
fn a_file_that_was_cut_is_refused() {
    let workspace = Workspace::new(&STUDY.replace("30_000", "300"));
    run(&workspace);
    let whole = fs::read(workspace.path("out/final.parquet")).expect("a file");
    for length in [0, 3, 4, 11, whole.len() / 2, whole.len() - 9, whole.len() - 1] {
        let cut = workspace.path("cut.parquet");
        fs::write(&cut, &whole[..length]).expect("written");
        let error = StateTable::open(&cut).expect_err("cut").to_string();
        assert!(error.contains("cut.parquet") && error.contains("it is cut, or no Parquet file"), "{error}");
    }
    // Not of states.
    let error = StateTable::open(&workspace.path("out/initial.parquet")).expect_err("other columns").to_string();
    assert!(error.contains("expected the columns of states"), "{error}");
}

#[test]
fn files_with_random_faults_are_read_or_refused_by_name() {
    let workspace = Workspace::new(&STUDY.replace("30_000", "40"));
    run(&workspace);
    super::parquet_bodies::write_bodies(&workspace.path("sound.parquet"), Some(4.0), "");
    let arrays = Workspace::new(&STUDY.replace("30_000", "40").replace("\"parquet\"", "\"npz\""));
    run(&arrays);
    let names = [(&workspace, "out/final.parquet"), (&workspace, "sound.parquet"), (&arrays, "out/final.npz")];
    let tables = names.map(|(workspace, name)| fs::read(workspace.path(name)).expect("a file"));
    let (mut taken, mut refused, mut number) = ([0; 3], [0; 3], 1_u64);
    let mut below = |count: usize| {
        // G. L. Steele and others, OOPSLA 2014: SplitMix64.
        number = number.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let x = (number ^ (number >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((x ^ (x >> 31)) % count as u64) as usize
    };
    for index in 0..9_000 {
        let kind = index % 3;
        let mut bytes = tables[kind].clone();
        let path = workspace.path(if kind == 2 { "faulty.npz" } else { "faulty.parquet" });
        // Bits turned over in the footer mostly, which says where everything is; in archives headers say it.
        let word = |place: usize| u32::from_le_bytes(std::array::from_fn(|byte| bytes[place + byte])) as usize;
        let footer = if kind == 2 { 0 } else { bytes.len() - word(bytes.len() - 8) - 8 };
        for _ in 0..1 + below(3) {
            let place = if below(4) > 0 { footer + below(bytes.len() - footer) } else { below(bytes.len()) };
            match below(3) {
                0 => bytes[place] ^= 1 << below(8),
                1 => bytes[place] = [0, 0xff, 0x7f, 0x80][below(4)],
                _ => drop(bytes.splice(place..place, [below(256) as u8])),
            }
        }
        fs::write(&path, &bytes).expect("written");
        let states = || StateTable::open(&path).and_then(|mut table| table.read(0, 100)).map(drop);
        let bodies = || BodyTable::read(&path, usize::MAX).map(drop);
        let clock = std::time::Instant::now();
        let found = if kind == 1 { bodies() } else { states() };
        assert!(clock.elapsed().as_secs() < 5, "{index}: {:?}", clock.elapsed());
        match found {
            Ok(()) => {
                // Of a table of a run all but the opening mark has a sum.
                assert!(kind != 0 || bytes.ends_with(&tables[0][4..]), "{index}");
                taken[kind] += 1;
            }
            Err(error) => {
                assert!(error.to_string().contains("faulty."), "{index}: {error}");
                refused[kind] += 1;
            }
        }
    }
    // Of an archive all but its headers has a sum.
    let least = [2, 150, 20];
    let are_enough = |counts: [u32; 3], least: [u32; 3]| counts.iter().zip(least).all(|(count, least)| *count > least);
    assert!(are_enough(taken, least) && are_enough(refused, [150; 3]), "{taken:?} taken, {refused:?} refused");
}
