//! Quantities of studies that add up: integrals and counts of sign changes.

#![cfg(feature = "cli")]

use std::collections::BTreeMap;
use std::path::Path;

use glam::DVec3;
use polhode::study::Study;
use polhode::{Engine, Plan};

use crate::observed::BODIES;
use crate::workspace::{States, Workspace};

#[test]
fn what_adds_up_is_a_quantity_like_any_other_and_costs_nothing_unless_it_is_asked_for() {
    let quantities = "\
[[quantity]]
name = \"turned\"
integral = \"\"\"
let w = norm(angular_velocity); # rad/s; not a vector
w
\"\"\"
every = \"0.5 s\"
unit = \"rad\"
[[quantity]]
name = \"flips\"
sign_changes = \"angular_momentum.y\"
every = 0.25
";
    let asked = "\
[[event]]
name = \"first\"
quantity = \"flips\"
above = 0.5
[[event]]
name = \"the same\"
quantity = \"angular_velocity_y\"
crosses = 0
[output]
snapshots = true
columns = [\"wx\", \"wy\", \"wz\", \"turned\", \"flips\"]
statistics = [\"turned\"]
";
    let torques = |more: &str| {
        let study = Study::parse(Path::new("study.toml"), &format!("{BODIES}{quantities}{more}")).expect("a study");
        study.scene().expect("a scene").torques().len()
    };
    assert_eq!([torques(""), torques("[output]\nstatistics = [\"flips\"]"), torques(asked)], [0, 1, 2]);
    let workspace = Workspace::new(&format!("{BODIES}{quantities}{asked}"));
    workspace.done(&["run", "study.toml", "--engine", "cpu"]);
    let text = std::fs::read_to_string(workspace.path("study.out/snapshots.csv")).expect("a table");
    assert!(text.starts_with("body,t,wx,wy,wz,turned,flips,status\n"), "{}", text.lines().next().unwrap_or_default());
    let states = States::read(&workspace.path("study.out/snapshots.csv"));
    let column = |name: &str| states.column(name);
    let (wy, turned, flips) = (column("wy"), column("turned"), column("flips"));
    // Rows go from output to output. Bodies begin with positive wy: an odd number of flips is where it is negative.
    assert!(flips.iter().zip(wy).all(|(flips, wy)| (flips % 2.0 == 1.0) == (*wy < 0.0)));
    assert!(flips[flips.len() - 6..].iter().all(|flips| (1.0..=4.0).contains(flips)), "{flips:?}");
    // Between outputs, a second apart, no body turns by more or less than its spin rate allows.
    assert!(turned[..6].iter().all(|turned| *turned == 0.0));
    for row in 6..states.rows() {
        let rates = [row - 6, row].map(|row| [column("wx"), column("wy"), column("wz")].map(|w| w[row]));
        let mean = 0.5 * rates.map(|[x, y, z]| DVec3::new(x, y, z).length()).iter().sum::<f64>();
        assert!((turned[row] - turned[row - 6] - mean).abs() < 0.05, "row {row}: {}, {mean}", turned[row]);
    }
    let statistics = States::read(&workspace.path("study.out/statistics.csv"));
    let mean = turned[turned.len() - 6..].iter().sum::<f64>() / 6.0;
    assert!((statistics.column("turned_mean").last().expect("a row") - mean).abs() < 1e-12);
    // The events are the same, to what steps in `f64` keep.
    let events = std::fs::read_to_string(workspace.path("study.out/events.csv")).expect("events");
    let times = |event: &str| -> BTreeMap<usize, f64> {
        let rows = events.lines().filter_map(|line| line.strip_prefix(event)?.strip_prefix(','));
        let row = |row: &str| {
            let mut words = row.split(',');
            let mut word = || words.next().expect("a word");
            (word().parse().expect("a body"), word().parse().expect("a time"))
        };
        rows.map(row).collect()
    };
    let (counted, crossed) = (times("first"), times("the same"));
    assert_eq!((counted.len(), crossed.len()), (6, 6));
    assert!(counted.iter().all(|(body, time)| (time - crossed[body]).abs() < 1e-8), "{counted:?}, {crossed:?}");
}

#[test]
fn more_evaluations_than_there_may_be_are_refused_where_they_are_stated() {
    let more = "[[quantity]]\nname = \"age\"\nintegral = \"1\"\nevery = 1e-9\n[output]\nstatistics = [\"age\"]\n";
    let study = Study::parse(Path::new("study.toml"), &format!("{BODIES}{more}")).expect("a study");
    let error = Plan::new(&study.scene().expect("a scene"), &Engine::cpu()).expect_err("too many");
    insta::assert_snapshot!(study.located(error), @"study.toml:12: quantity[1].every = 1e-9: more than 1e9 samples would follow: expected a longer period, or a shorter span (s)");
}
