//! Quantities, quantiles, histograms and events of studies: what is refused, and what is written.

#![cfg(feature = "cli")]

use std::path::Path;

use glam::{DQuat, DVec3};
use polhode::study::Study;
use polhode::{Engine, Ensemble, Plan, Quantity, Scene, Torque};

use crate::workspace::{States, Workspace, report};

pub(crate) const BODIES: &str = "\
title = \"Six\"
[bodies]
count = 6
inertia = [1, 2, 2.5]
angular_velocity = { distribution = \"normal\", mean = [0, 1, 0], sigma = 0.01 }
[time]
end = 40.0
outputs = { every = 1.0, start = true }
";

fn refusal(more: &str) -> String {
    let text = format!("{BODIES}{more}");
    let error = Study::parse(Path::new("study.toml"), &text).and_then(|study| study.scene()).expect_err("refused");
    assert!(error.is_input(), "{error}");
    error.to_string()
}

macro_rules! refuses {
    ($($name:ident: $more:expr => @$expected:literal;)*) => {
        $(#[test]
        fn $name() {
            insta::assert_snapshot!(refusal($more), @$expected);
        })*
    };
}

refuses! {
    statistics_that_are_no_list: "[output]\nstatistics = \"spin_rate\"" => @r#"study.toml:10: output.statistics = "spin_rate": expected a list of quantities, such as ["kinetic_energy", "spin_rate"]"#;
    an_unknown_quantity: "[output]\nstatistics = [\"spin_rat\"]" => @r#"study.toml:10: output.statistics = "spin_rat": did you mean spin_rate? expected a quantity: kinetic_energy, spin_rate, angular_momentum, angular_momentum_x, angular_momentum_y, angular_momentum_z, angular_velocity_x, angular_velocity_y, angular_velocity_z, nutation, dynamic_inertia, separatrix_distance, latitude_least, latitude_middle, latitude_greatest, yaw, pitch, roll, potential_energy, total_energy"#;
    quantiles_of_nothing: "[output]\nquantiles = [50]" => @"study.toml:10: output.quantiles = [50]: expected output.statistics too: the quantiles are those of its quantities";
    a_quantile_that_is_no_percentage: "[output]\nstatistics = [\"yaw\"]\nquantiles = [101]" => @"study.toml:11: output.quantiles = 101: expected a list of percentages from 0 to 100, such as [5, 50, 95]";
    a_quantity_whose_name_is_no_word: "[[quantity]]\nname = \"a b\"\nformula = \"1\"" => @r#"study.toml:10: quantity[1].name = "a b": expected a name of ASCII letters, digits and underscores that begins with a letter"#;
    a_quantity_whose_name_is_taken: "[[quantity]]\nname = \"yaw\"\nformula = \"time\"" => @r#"study.toml:10: quantity[1].name = "yaw": expected a name that no other quantity has"#;
    a_quantity_of_nothing: "[[quantity]]\nname = \"x\"" => @"study.toml:9: quantity[1].formula is missing: expected how it is formed: `formula`, `axis` with `direction`, `euler` with `angle`, or `integral` or `sign_changes` with `every`";
    a_formula_that_is_a_vector: "[[quantity]]\nname = \"x\"\nformula = \"angular_velocity\"" => @"study.toml:11: quantity[1].formula: column 12: the result: found a vector, needed a number";
    a_formula_with_what_a_quantity_has_not: "[[quantity]]\nname = \"x\"\nformula = \"position.x\"" => @"study.toml:11: quantity[1].formula: column 12: `position` is not known where this formula is used";
    an_axis_without_direction: "[[quantity]]\nname = \"x\"\naxis = [0, 0, 0]\ndirection = [0, 0, 1]" => @"study.toml:11: quantity[1].axis = [0, 0, 0]: expected a vector that is finite and not zero";
    turns_that_are_no_sequence: "[[quantity]]\nname = \"x\"\neuler = \"zzx\"\nangle = 1" => @r#"study.toml:11: quantity[1].euler = "zzx": expected three axes, no two neighbouring ones equal, such as "zyx" or "zxz""#;
    a_fourth_angle: "[[quantity]]\nname = \"x\"\neuler = \"zyx\"\nangle = 4" => @"study.toml:12: quantity[1].angle = 4: expected 1, 2 or 3";
    a_quantity_in_two_ways: "[[quantity]]\nname = \"x\"\neuler = \"zyx\"\nformula = \"1\"" => @"study.toml:12: quantity[1].formula excludes euler: give one of them";
    a_sum_without_a_period: "[[quantity]]\nname = \"x\"\nintegral = \"time\"" => @"study.toml:9: quantity[1].every is missing: expected the time between two evaluations of the formula (s), above zero";
    a_sum_over_no_time: "[[quantity]]\nname = \"x\"\nintegral = \"time\"\nevery = 0" => @"study.toml:12: quantity[1].every = 0: expected the time between two evaluations of the formula (s), above zero";
    a_sum_in_two_ways: "[[quantity]]\nname = \"x\"\nintegral = \"time\"\nsign_changes = \"time\"\nevery = 1" => @"study.toml:11: quantity[1].integral excludes sign_changes: give one of them";
    a_sum_of_vectors: "[[quantity]]\nname = \"x\"\nintegral = \"let w = 2; w * angular_velocity\"\nevery = 1\n[output]\nstatistics = [\"x\"]" => @"study.toml:11: quantity[1].integral: column 24: the result: found a vector, needed a number";
    a_sum_of_what_is_known_at_the_start: "[[quantity]]\nname = \"x\"\nintegral = \"initial_angular_velocity.x\"\nevery = 1\n[output]\nstatistics = [\"x\"]" => @"study.toml:11: quantity[1].integral: column 13: unknown name `initial_angular_velocity`";
    a_table_for_a_list: "[quantity]\nname = \"x\"\nformula = \"1\"" => @"study.toml:9: quantity = [quantity]: expected a list of tables: [[quantity]]";
    a_histogram_that_ends_before_it_begins: "[[histogram]]\nquantity = \"yaw\"\nlow = 1\nhigh = 0" => @"study.toml:12: histogram[1].high = 0: expected a finite number above `low`";
    a_logarithm_of_zero: "[[histogram]]\nquantity = \"yaw\"\nlow = 0\nhigh = 1\nscale = \"log\"" => @"study.toml:11: histogram[1].low = 0: expected a number above zero";
    a_histogram_without_bins: "[[histogram]]\nquantity = \"yaw\"\nlow = 0\nhigh = 1\nbins = 0" => @"study.toml:13: histogram[1].bins = 0: expected 1 to 100000 bins";
    an_event_of_nothing: "[[event]]\nname = \"e\"\nquantity = \"yaw\"" => @"study.toml:9: event[1].below is missing: expected one of below, above, falls_below, rises_above, crosses, with a level";
    an_event_in_two_ways: "[[event]]\nname = \"e\"\nquantity = \"yaw\"\nbelow = 1\nabove = 2" => @"study.toml:12: event[1].below excludes above: give one of them";
    a_level_that_is_no_number: "[[event]]\nname = \"e\"\nquantity = \"yaw\"\nbelow = nan" => @"study.toml:12: event[1].below = nan: expected a finite level, in the quantity's unit";
    a_time_before_the_first: "[[event]]\nname = \"e\"\nquantity = \"yaw\"\nbelow = 1\noccurrence = 0" => @"study.toml:13: event[1].occurrence = 0: expected 1 for the first time, 2 for the second, and so on";
    two_events_of_one_name: "[[event]]\nname = \"e\"\nquantity = \"yaw\"\nbelow = 1\n[[event]]\nname = \"e\"\nquantity = \"yaw\"\nbelow = 2" => @r#"study.toml:14: event[2].name = "e": expected a name that no other event has"#;
}

#[test]
fn a_quantity_with_the_name_of_a_column_of_states_is_refused() {
    for name in ["t", "body", "status", "cell", "stopped_at", "qw", "wx", "lz", "x", "vz"] {
        let found = refusal(&format!("[[quantity]]\nname = \"{name}\"\nformula = \"2 * time\""));
        let expected = "expected another name: tables of states have a column of this one";
        assert_eq!(found, format!("study.toml:10: quantity[1].name = \"{name}\": {expected}"));
    }
    let found = refusal("[[quantity]]\nname = \"kinetic_energy\"\nformula = \"time\"");
    assert!(found.ends_with("expected a name that no other quantity has"), "{found}");
}

/// A study with these checks, and with an event or none.
fn refused_checks(checks: &str, more: &str) -> String {
    let text = BODIES.replace("outputs = ", &format!("checks = {checks}\noutputs = ")) + more;
    let error = Study::parse(Path::new("study.toml"), &text).and_then(|study| {
        let scene = study.scene()?;
        Plan::new(&scene, &Engine::cpu()).map(|_| ()).map_err(|error| study.located(error))
    });
    let error = error.expect_err("refused");
    assert!(error.is_input(), "{error}");
    error.to_string()
}

#[test]
fn checks_that_say_nothing_are_refused() {
    let event = "[[event]]\nname = \"e\"\nquantity = \"yaw\"\nbelow = 1\n";
    insta::assert_snapshot!(refused_checks("{ every = 0 }", event), @"study.toml:8: time.checks.every = 0: expected an interval above zero (s)");
    insta::assert_snapshot!(refused_checks("{ every = -1.5 }", event), @"study.toml:8: time.checks.every = -1.5: expected an interval above zero (s)");
    insta::assert_snapshot!(refused_checks("{ every = 1e-9 }", event), @"study.toml:8: time.checks.every = 1e-9: more than 1e7 checks would follow: use a longer interval (s)");
    insta::assert_snapshot!(refused_checks("{ often = 1 }", event), @"study.toml:8: time.checks.often is not known: known here: every");
    insta::assert_snapshot!(refused_checks("2.0", event), @"study.toml:8: time.checks = 2.0: expected { every = seconds }, the time between two checks for events");
    insta::assert_snapshot!(refused_checks("{ every = 1 }", ""), @"study.toml:8: time.checks = { every = 1 }: expected an [[event]] too: checks seek events between outputs");
}

/// While they turn about their second axes at 1 rad/s, their first axes point away from where they began for 0.9 s a turn, but not at 20 s and
/// 40 s.
const AWAY: &str = "\
[[quantity]]
name = \"first\"
formula = \"to_world(vec(1, 0, 0)).x\"
[[event]]
name = \"away\"
quantity = \"first\"
below = -0.9
";

/// What goes unnoticed between outputs is found by checks, which change no table but those of events.
#[test]
fn checks_seek_events_between_outputs_and_write_nothing() {
    let rare = BODIES.replace("every = 1.0", "every = 20.0");
    let questions = &format!("{QUESTIONS}{AWAY}");
    let workspace = Workspace::new(&format!("{rare}{questions}"));
    let rare_summary = workspace.done(&["run", "study.toml", "--engine", "cpu", "--out", "rare"]);
    let checked = format!("{}{questions}", rare.replace("outputs = ", "checks = { every = \"250 ms\" }\noutputs = "));
    std::fs::write(workspace.path("study.toml"), checked).expect("written");
    let summary = workspace.done(&["run", "study.toml", "--engine", "cpu", "--out", "checked"]);
    let bytes = |folder: &str, name: &str| std::fs::read(workspace.path(&format!("{folder}/{name}"))).expect("a table");
    for name in ["final.csv", "histograms.csv", "snapshots.csv", "statistics.csv"] {
        assert!(bytes("rare", name) == bytes("checked", name), "{name} differs");
    }
    let lines = |folder: &str, name: &str| bytes(folder, name).iter().filter(|&&byte| byte == b'\n').count();
    assert_eq!(lines("rare", "survival.csv"), lines("checked", "survival.csv"));
    let [rare, checked] = ["rare", "checked"].map(|folder| report(&workspace, folder));
    let of = |report: &serde_json::Value, key: &str| report["events"][1][key].as_u64().expect("a number");
    assert_eq!((of(&rare, "bodies"), of(&rare, "unnoticed")), (0, 6), "{}", rare["events"]);
    let sentence = "UNNOTICED in 6 of 6 bodies of the sample: they had it between two outputs";
    assert!(rare_summary.contains(sentence) && rare_summary.contains("[time] checks ="), "{rare_summary}");
    assert!(!summary.contains("UNNOTICED"), "{summary}");
    assert_eq!((of(&checked, "bodies"), of(&checked, "unnoticed"), of(&checked, "sampled")), (6, 0, 6));
    assert_eq!((checked["outputs"].as_u64(), checked["checks"].as_u64()), (Some(3), Some(158)));
    assert_eq!((rare["outputs"].as_u64(), rare["checks"].as_u64()), (Some(3), None));
    assert!(rare["events"][1]["time_error"]["median"].as_f64() > Some(37.0), "{}", rare["events"]);
    let explained = workspace.done(&["explain", "study.toml", "--engine", "cpu"]);
    assert!(explained.contains("3 output times and 158 checks for events"), "{explained}");
}

const QUESTIONS: &str = "\
[output]
snapshots = true
statistics = [\"spin_rate\", \"tilt\"]
quantiles = [50, 2.5]
[[quantity]]
name = \"tilt\"
axis = [0, 1, 0]
direction = [0, 2, 0]
[[histogram]]
quantity = \"tilt\"
low = 0.0
high = 3.15
bins = 5
[[event]]
name = \"a flip, or \\\"turn\\\"\"
quantity = \"angular_velocity_y\"
crosses = 0.0
";

#[test]
fn every_table_that_is_asked_for_is_written() {
    let workspace = Workspace::new(&format!("{BODIES}{QUESTIONS}"));
    let summary = workspace.done(&["run", "study.toml", "--engine", "cpu"]);
    assert!(summary.contains("event    a flip, or \"turn\": 6 bodies, 100.0 %"), "{summary}");
    let names = workspace.names("study.out");
    for name in
        ["events.csv", "final.csv", "histograms.csv", "snapshots.csv", "statistics.csv", "survival.csv", "times.csv"]
    {
        assert!(names.iter().any(|other| other == name), "{name} is missing: {names:?}");
    }
    let read = |name: &str| std::fs::read_to_string(workspace.path(&format!("study.out/{name}"))).expect("a table");
    let header = "t,count,spin_rate_mean,spin_rate_standard_deviation,spin_rate_min,spin_rate_max,spin_rate_min_body,\
                  spin_rate_max_body,spin_rate_q2.5,spin_rate_q50,tilt_mean";
    assert!(read("statistics.csv").starts_with(header), "{}", read("statistics.csv"));
    assert!(read("events.csv").starts_with("event,body,t,known_to,qx,qy,qz,qw,wx,wy,wz\n\"a flip, or \"\"turn\"\"\","));

    // The start is an output; each histogram counts every body at each of them.
    let states = States::read(&workspace.path("study.out/snapshots.csv"));
    assert_eq!((states.rows(), states.column("t")[0]), (6 * 41, 0.0));
    let mut reader = csv::Reader::from_path(workspace.path("study.out/histograms.csv")).expect("a table");
    let counts: Vec<u64> = reader.records().map(|row| row.expect("a row")[5].parse().expect("a count")).collect();
    assert_eq!(counts.len(), 41 * 7);
    assert!(counts.chunks(7).all(|counts| counts.iter().sum::<u64>() == 6));

    // Each event lies between the two outputs at which the sign of the spin differs for the first time.
    let mut reader = csv::Reader::from_path(workspace.path("study.out/events.csv")).expect("a table");
    let events: Vec<csv::StringRecord> = reader.records().map(|row| row.expect("a row")).collect();
    assert_eq!(events.len(), 6);
    for event in &events {
        let (body, time): (usize, f64) = (event[1].parse().expect("a body"), event[2].parse().expect("a time"));
        let spins: Vec<f64> = states.of_body(body).into_iter().map(|row| states.column("wy")[row]).collect();
        let first = spins.windows(2).position(|pair| (pair[0] < 0.0) != (pair[1] < 0.0)).expect("a flip") as f64;
        assert!((first..=first + 1.0).contains(&time), "body {body}: {time} s, not in {first} s to a second later");
        assert!(event[9].parse::<f64>().expect("wy").abs() < 1e-9, "{event:?}");
    }
    let report = report(&workspace, "study.out");
    assert_eq!(report["events"][0]["bodies"], 6);
    assert_eq!(report["events"][0]["compared"], 6);
    assert!(report["events"][0]["time_error"]["max"].as_f64().expect("a number") < 1e-5, "{}", report["events"]);
    assert_eq!(report["quantities"][1]["unit"], "rad");

    // What of a former run has these names gives way to another.
    workspace.done(&["plot", "study.out"]);
    let names = workspace.names("study.out");
    for picture in ["histograms.svg", "statistics.png", "survival.svg"] {
        assert!(names.iter().any(|name| name == picture), "{picture} is missing: {names:?}");
    }
    std::fs::write(workspace.path("study.toml"), BODIES).expect("written");
    workspace.done(&["run", "study.toml", "--engine", "cpu", "--force"]);
    assert_eq!(workspace.names("study.out"), ["final.csv", "plan.json", "report.json"]);
}

/// Spheres whose spin decays as e^(−ct/I): it is below s after I/c ln(s₀/s), in each cell of a sweep over c.
#[test]
fn times_by_which_shares_of_the_bodies_had_an_event_are_those_of_the_closed_form_in_each_cell() {
    const TIMES: &str = "\
[bodies]
file = \"bodies.csv\"
[[sweep]]
name = \"drag\"
values = [0.2, 0.1]
[[torque]]
model = \"linear-drag\"
coefficient = { sweep = \"drag\" }
[time]
end = 20.0
[accuracy]
method = \"rk8\"
tolerance = 1e-12
[[event]]
name = \"slow\"
quantity = \"spin_rate\"
below = 0.5
[output]
final = false
";
    let of_cell = 50;
    // Each row of the table is in both cells.
    let spin = |row: usize| 1.0 + row as f64 / of_cell as f64;
    let rows: Vec<String> = (0..of_cell).map(|row| format!("2,2,2,0,0,{}\n", spin(row))).collect();
    let workspace = Workspace::new(TIMES);
    let table = format!("ixx,iyy,izz,wx,wy,wz\n{}", rows.concat());
    std::fs::write(workspace.path("bodies.csv"), table).expect("written");
    workspace.done(&["run", "study.toml", "--engine", "cpu"]);
    let times = polhode::record::read(&workspace.path("study.out/times.csv")).expect("a table");
    assert_eq!(times.numbers("cell").expect("cells")[..], [0.0, 1.0]);
    let column = |name: &str, cell: usize| times.numbers(name).expect("a column")[cell];
    for (cell, decay) in [10.0, 20.0].into_iter().enumerate() {
        assert_eq!(column("bodies", cell), of_cell as f64);
        // Spins rise with the row: the k-th event is that of the k-th row.
        let expected = |k: usize| decay * (spin(k - 1) / 0.5).ln();
        let had = (1..=of_cell).take_while(|&k| expected(k) < 20.0).count();
        assert_eq!(column("had", cell), had as f64);
        // Of 50 bodies: where Wilson's interval of the share first contains 0.9, 0.5, 0.1, and where it no longer does.
        for (name, k) in PLACES {
            let (found, expected) = (column(name, cell), if k <= had { expected(k) } else { f64::NAN });
            assert!(
                (found - expected).abs() < 1e-9 || found.is_nan() && expected.is_nan(),
                "{cell}: {name} {found}, in truth {expected}"
            );
        }
    }
    assert_eq!((column("had", 0), column("had", 1)), (50.0, 18.0));
}

/// The order, among 50 bodies, of the events at which the estimate and its interval are.
const PLACES: [(&str, usize); 9] = [
    ("t10", 5),
    ("t10_low", 1),
    ("t10_high", 10),
    ("t50", 25),
    ("t50_low", 19),
    ("t50_high", 32),
    ("t90", 45),
    ("t90_low", 41),
    ("t90_high", 50),
];

#[test]
fn arrays_hold_the_same_as_text() {
    let workspace = Workspace::new(&format!("{BODIES}{QUESTIONS}"));
    workspace.done(&["run", "study.toml", "--engine", "cpu", "--out", "text"]);
    let npz = format!("{BODIES}{}", QUESTIONS.replace("snapshots = true", "format = \"npz\""));
    std::fs::write(workspace.path("study.toml"), npz).expect("written");
    workspace.done(&["run", "study.toml", "--engine", "cpu", "--out", "arrays"]);
    let numbers = |table: &str, column: &str| -> Vec<f64> {
        let mut reader = csv::Reader::from_path(workspace.path(&format!("text/{table}.csv"))).expect("a table");
        let place = reader.headers().expect("names").iter().position(|name| name == column).expect("a column");
        reader.records().map(|row| row.expect("a row")[place].parse().expect("a number")).collect()
    };
    let array = |table: &str, column: &str| -> Vec<f64> {
        let file = std::fs::File::open(workspace.path(&format!("arrays/{table}.npz"))).expect("an archive");
        let mut archive = zip::ZipArchive::new(file).expect("an archive");
        let entry = archive.by_name(&format!("{column}.npy")).expect("a column");
        npyz::NpyFile::new(entry).expect("an array").into_vec().expect("numbers")
    };
    for (table, column) in [
        ("statistics", "tilt_q2.5"),
        ("statistics", "spin_rate_max"),
        ("events", "t"),
        ("events", "wy"),
        ("survival", "share"),
        ("survival", "low"),
        ("histograms", "high"),
    ] {
        let (text, array) = (numbers(table, column), array(table, column));
        assert!(!text.is_empty() && text == array, "{table}, {column}: {text:?} and {array:?}");
    }
    // NumPy compares texts of the type U with those of Python, and no others.
    for column in ["event", "known_to"] {
        let file = std::fs::File::open(workspace.path("arrays/events.npz")).expect("an archive");
        let mut archive = zip::ZipArchive::new(file).expect("an archive");
        let mut bytes = Vec::new();
        let mut entry = archive.by_name(&format!("{column}.npy")).expect("a column");
        std::io::Read::read_to_end(&mut entry, &mut bytes).expect("an array");
        assert!(String::from_utf8_lossy(&bytes).contains("'descr': '<U"), "{column}");
    }
}

#[test]
fn both_words_for_a_logarithmic_scale_are_read() {
    let histograms = |word: &str| {
        let more = format!("[[histogram]]\nquantity = \"spin_rate\"\nlow = 0.1\nhigh = 1\nscale = \"{word}\"");
        let study = Study::parse(Path::new("study.toml"), &format!("{BODIES}{more}"));
        study.and_then(|study| study.scene()).expect("a scene").wanted_histograms().to_vec()
    };
    assert_eq!(histograms("logarithmic"), histograms("log"));
    assert_ne!(histograms("logarithmic"), histograms("linear"));
}

/// A formula over bodies that spin faster and slower than 1 rad/s.
const UNDEFINED: &str = "\
[bodies]
count = 100
inertia = [1, 2, 3]
orientation = { distribution = \"uniform\" }
angular_velocity = { distribution = \"normal\", mean = [0, 0, 1], sigma = 0.3 }
[time]
end = 100
outputs = { every = 10, start = true }
[accuracy]
mean = 1e-3
[output]
final = false
statistics = [\"dot\", \"nutation\"]
quantiles = [5, 50, 95]
[[quantity]]
name = \"dot\"
formula = \"acos(angular_velocity.z)\"
[[histogram]]
quantity = \"dot\"
low = 0
high = 3.2
bins = 4
";

const RUN: [&str; 5] = ["run", "study.toml", "--engine", "cpu", "--force"];

#[test]
fn bodies_without_a_finite_value_are_counted_and_named() {
    let workspace = Workspace::new(UNDEFINED);
    let summary = workspace.done(&RUN);
    let states = States::read(&workspace.path("study.out/statistics.csv"));
    let (all, counts) = (states.column("count"), states.column("dot_count"));
    assert!(all.len() == 11 && all.iter().all(|&count| count == 100.0), "{all:?}");
    assert!(counts[0] > 0.0 && counts[0] < 100.0, "{counts:?}");
    assert!(!states.columns.contains_key("nutation_count"));
    // The histogram, with its outer bins, counts the same bodies.
    let histograms = csv::Reader::from_path(workspace.path("study.out/histograms.csv"));
    let rows = histograms.expect("a table").into_records().map(|row| row.expect("a row"));
    let in_bins: Vec<f64> = rows.map(|row| row[5].parse().expect("a count")).collect();
    let in_bins: Vec<f64> = in_bins.chunks(6).map(|counts| counts.iter().sum()).collect();
    assert_eq!(in_bins, counts);

    let report = report(&workspace, "study.out");
    let [dot, nutation] = [0, 1].map(|place: usize| &report["statistics"]["quantities"][place]);
    assert_eq!((dot["count"].as_f64(), nutation["count"].as_f64()), (counts.last().copied(), Some(100.0)));
    let fewest = counts.iter().copied().fold(f64::INFINITY, f64::min);
    let (undefined, most) = (&dot["undefined"], 100.0 - fewest);
    assert_eq!((undefined["bodies"].as_f64(), undefined["of"].as_f64()), (Some(most), Some(100.0)));
    assert!(nutation["undefined"].is_null(), "{nutation}");
    let line = format!("           dot: {most} of 100 bodies have no finite value (NaN or infinite) at ");
    assert!(summary.contains(&line), "{line} is missing in\n{summary}");

    // A verdict on the error of the mean says for how many bodies it does not stand.
    let accuracy = &report["statistical_accuracy"];
    let left_out = &accuracy["errors"][0]["left_out"];
    assert!(left_out.as_u64().is_some_and(|count| count > 0 && count < 64), "{accuracy}");
    assert!(accuracy["met"] == true && accuracy["errors"][1]["left_out"].is_null(), "{accuracy}");
    let verdict = format!("; up to {left_out} of 64 bodies have no finite value and are left out\n");
    assert!(summary.contains(&verdict), "{verdict} is missing in\n{summary}");

    let npz = UNDEFINED.replace("final = false", "final = false\nformat = \"npz\"");
    std::fs::write(workspace.path("study.toml"), npz).expect("written");
    workspace.done(&RUN);
    let file = std::fs::File::open(workspace.path("study.out/statistics.npz")).expect("an archive");
    let mut archive = zip::ZipArchive::new(file).expect("an archive");
    let entry = archive.by_name("dot_count.npy").expect("a column");
    let array: Vec<u64> = npyz::NpyFile::new(entry).expect("an array").into_vec().expect("counts");
    assert_eq!(array.into_iter().map(|count| count as f64).collect::<Vec<_>>(), counts);
}

#[test]
fn a_quantity_that_no_body_has_is_no_number_and_no_error_of_it_is_met() {
    let run = |formula: &str| {
        let workspace = Workspace::new(&UNDEFINED.replace("acos(angular_velocity.z)", formula));
        let summary = workspace.done(&RUN);
        let mut table = csv::Reader::from_path(workspace.path("study.out/statistics.csv")).expect("a table");
        let place = table.headers().expect("names").iter().position(|name| name == "dot_count").expect("a column");
        let counts: Vec<u32> =
            table.records().map(|row| row.expect("a row")[place].parse().expect("a count")).collect();
        (summary, report(&workspace, "study.out"), counts)
    };
    let none = "dot: no statistics, as no body has a finite value\n";
    let line = |at: &str| {
        format!(
            "           dot: 100 of 100 bodies have no finite value (NaN or infinite) {at}: its statistics leave them out\n"
        )
    };
    let open = "           mean of dot: not known, 64 of 64 bodies have no finite value\n";

    let (summary, found, counts) = run("sqrt(-1 - time)");
    assert_eq!(counts, [0; 11]);
    assert!(summary.contains(none) && summary.contains(&line("at the end")), "{summary}");
    assert!(!summary.contains("dot: mean") && !summary.contains("NaN,"), "{summary}");
    assert_eq!((found["statistical_accuracy"]["met"].as_bool(), summary.contains(open)), (None, true), "{summary}");

    let (summary, found, counts) = run("sqrt(time - 50) + angular_velocity.z");
    assert_eq!(counts, [[0; 5].as_slice(), &[100; 6]].concat());
    assert!(summary.contains("dot: mean ") && summary.contains(&line("at 40 s")), "{summary}");
    assert_eq!(found["statistical_accuracy"]["errors"][0]["left_out"], 64);
    assert!(!summary.contains(open), "{summary}");
}

#[test]
fn the_plan_says_that_states_are_read() {
    let skips = |output: &str| {
        let study = Study::parse(Path::new("study.toml"), &format!("{BODIES}{output}")).expect("a study");
        let scene = study.scene().expect("a scene");
        Plan::new(&scene, &Engine::cpu()).expect("a plan").leaves_states()
    };
    assert!(skips("[output]\nfinal = false\nstatistics = [\"spin_rate\"]"));
    assert!(!skips("[output]\nfinal = false\nstatistics = [\"yaw\"]"));
    assert!(!skips("[output]\nfinal = false\nstatistics = [\"spin_rate\"]\nquantiles = [50]"));
}

#[test]
fn flips_come_when_the_formula_says() {
    let workspace = Workspace::new("");
    let run = |name: &str| {
        let study = crate::workspace::example(name);
        workspace.done(&["run", &study, "--engine", "cpu", "--out", name]);
        report(&workspace, name)["events"].clone()
    };
    // Around the middle axis a deviation grows with the rate w sqrt((I3 - I2)(I2 - I1)/(I1 I3)) = 0.577/s: half of all flip by about
    // ln(4/0.01)/0.577 = 10.4 s, and for the third time two periods later.
    let flips = run("flip_times");
    let medians: Vec<f64> = (0..2).map(|event| flips[event]["median"].as_f64().expect("half of them")).collect();
    assert!((medians[0] - 10.4).abs() < 1.0, "{medians:?}");
    assert!((medians[1] - 5.0 * medians[0]).abs() < 2.0, "{medians:?}");
}

#[test]
fn levels_and_edges_are_in_the_unit_of_their_quantity() {
    let quantity =
        |name: &str, unit: &str| format!("[[quantity]]\nname = \"{name}\"\nformula = \"time\"\nunit = \"{unit}\"\n");
    let event = |quantity: &str, level: &str| {
        format!(
            "[[event]]\nname = \"{quantity} {}\"\nquantity = \"{quantity}\"\nabove = {level}\n",
            level.replace('"', "")
        )
    };
    let text = [
        BODIES.to_owned(),
        quantity("hours", "h") + &quantity("degrees", "deg") + &quantity("radians", "rad"),
        event("hours", "2") + &event("hours", "\"90 min\"") + &event("degrees", "\"90 deg\""),
        event("degrees", "\"0.5 rev\"") + &event("radians", "\"180 deg\"") + &event("radians", "3"),
        "[[histogram]]\nquantity = \"degrees\"\nlow = \"-1 rev\"\nhigh = 90\n".to_owned(),
    ]
    .concat();
    let study = Study::parse(Path::new("study.toml"), &text).expect("a study");
    let scene = study.scene().expect("a scene");
    let levels: Vec<f64> = scene.wanted_events().iter().map(|event| event.condition().level()).collect();
    let expected = [2.0, 1.5, 90.0, 180.0, std::f64::consts::PI, 3.0];
    assert_eq!(levels.len(), expected.len());
    for (level, expected) in levels.iter().zip(expected) {
        assert!((level / expected - 1.0).abs() < 1e-15, "{levels:?}");
    }
    let edges = scene.wanted_histograms()[0].edges();
    assert!((edges[0] + 360.0).abs() < 1e-12 && edges.last() == Some(&90.0), "{edges:?}");
}

#[test]
fn each_torque_that_has_a_potential_has_an_energy() {
    let torques = "\
[[torque]]
model = \"sine-spring\"
stiffness = 0.3
target = [0, 0, 0, 1]
[[torque]]
model = \"linear-drag\"
coefficient = 0.01
[[torque]]
model = \"magnetic-dipole\"
moment = [0.2, 0, 0.4]
field = [0.1, -0.5, 0.2]
";
    let asked = "\
[[quantity]]
name = \"spring\"
formula = \"2 * 0.3 * (1 - attitude.w^2)\"
[[quantity]]
name = \"dipole\"
formula = \"-dot(vec(0.1, -0.5, 0.2), to_world(vec(0.2, 0, 0.4)))\"
[output]
snapshots = true
columns = [\"torque1_potential_energy\", \"torque3_potential_energy\", \"potential_energy\", \"spring\", \"dipole\"]
statistics = [\"torque3_potential_energy\", \"torque1_potential_energy\"]
";
    let workspace = Workspace::new(&format!("{BODIES}{torques}{asked}"));
    workspace.done(&["run", "study.toml", "--engine", "cpu"]);
    let states = States::read(&workspace.path("study.out/snapshots.csv"));
    let column = |name: &str| states.column(name);
    let (first, third) = (column("torque1_potential_energy"), column("torque3_potential_energy"));
    for row in 0..states.rows() {
        assert!((first[row] - column("spring")[row]).abs() < 1e-15, "row {row}: {}", first[row]);
        assert!((third[row] - column("dipole")[row]).abs() < 1e-15, "row {row}: {}", third[row]);
        assert!((first[row] + third[row] - column("potential_energy")[row]).abs() < 1e-15, "row {row}");
    }
    let statistics = States::read(&workspace.path("study.out/statistics.csv"));
    let mean = third[third.len() - 6..].iter().sum::<f64>() / 6.0;
    let found = *statistics.column("torque3_potential_energy_mean").last().expect("a row");
    assert!((found - mean).abs() < 1e-15, "{found}, not {mean}");

    // Drag has none, and neither has a torque that is not there.
    for name in ["torque2_potential_energy", "torque4_potential_energy"] {
        let message = refusal(&format!("{torques}[output]\nstatistics = [\"{name}\"]\n"));
        assert!(
            message.contains("expected a quantity: torque1_potential_energy, torque3_potential_energy"),
            "{message}"
        );
    }
    let other = [Torque::sine_spring(0.3, DQuat::IDENTITY)];
    let energy = Quantity::potential_energy_of(&other, 0).expect("a potential");
    let ensemble =
        Ensemble::from_columns(&[DVec3::new(1.0, 2.0, 2.5)], &[DQuat::IDENTITY], &[DVec3::X]).expect("valid");
    let scene = Scene::new(ensemble).until(1.0).torque(Torque::linear_drag(0.1)).statistics([energy]);
    let error = Plan::new(&scene, &Engine::cpu()).expect_err("drag has no potential").to_string();
    assert!(error.contains("expected the number, from 1, of a torque with a potential energy"), "{error}");
}
