//! What a run says of itself on the terminal and in its report: every method that ran, what was asked for, and whether it was met.

#![cfg(feature = "cli")]

use std::fs;

#[path = "support/desk.rs"]
mod desk;

use desk::{Desk, report, words};

/// Bodies of which every tenth is slowed down by drag.
const MIXED: &str = r#"
[bodies]
file = "bodies.csv"
[[torque]]
model = "linear-drag"
coefficient = { column = "drag" }
[time]
end = 8.0
[accuracy]
attitude = 1e-5
energy = 1e-4
percentile = 95
"#;

fn mixed(count: usize) -> Desk {
    let desk = Desk::new(MIXED);
    let mut table = "ixx,iyy,izz,wx,wy,wz,drag\n".to_owned();
    for body in 0..count {
        let drag = if body % 10 == 0 { 0.1 } else { 0.0 };
        table += &format!("1,2,2.5,{},1,0.5,{drag}\n", 0.1 + 0.001 * body as f64);
    }
    fs::write(desk.path("bodies.csv"), table).expect("the table is written");
    desk
}

const RUN: [&str; 4] = ["run", "study.toml", "--engine", "cpu"];

#[test]
fn all_methods_of_a_mixed_run_are_named() {
    let desk = mixed(200);
    let summary = desk.done(&RUN);
    let plan = &report(&desk, "study.out")["plan"];
    let parts = plan["parts"].as_array().expect("a list");
    assert_eq!(parts.len(), 2, "{plan}");
    assert_eq!((&parts[0]["method"], &parts[0]["bodies"]), (&"closed form".into(), &180.into()), "{plan}");
    assert_eq!(parts[1]["bodies"], 20, "{plan}");
    let text = |value: &serde_json::Value| value.as_str().expect("a text").to_owned();
    let [free, driven] = [0, 1].map(|part: usize| (text(&parts[part]["method"]), text(&parts[part]["precision"])));
    assert_eq!(plan["method"], format!("{} + {}", free.0, driven.0));
    let precisions = if free.1 == driven.1 { free.1.clone() } else { format!("{} + {}", free.1, driven.1) };
    assert_eq!(plan["precision"], precisions);
    let line = format!("200 bodies, 8 s: 180 closed form in {}, 20 {} in {}", free.1, driven.0, driven.1);
    assert!(summary.contains(&line), "{line} is missing in\n{summary}");
}

#[test]
fn what_was_asked_for_stands_beside_what_came_out() {
    let desk = mixed(200);
    let summary = desk.done(&RUN);
    let asked = "attitude 1e-5 rad, energy 1e-4 of its value, in 95 % of the bodies";
    assert!(summary.contains(&format!("  asked    {asked}\n           met, 0 of 64 bodies beyond\n")), "{summary}");
    assert!(summary.contains("recomputed in f64 (of fewer than 100, p99 is the greatest)\n"), "{summary}");
    let errors = summary.split_once("  error    attitude (rad)   median ").expect("errors").1;
    assert!(errors.contains("\n           kinetic energy   median "), "{summary}");
    let explained = desk.done(&["explain", "study.toml", "--engine", "cpu"]);
    assert!(explained.contains(&format!("\nasked for: {asked}\n")), "{explained}");
    assert!(!explained.contains("no pilot"), "{explained}");
    let unpiloted = desk.done(&["explain", "study.toml", "--engine", "cpu", "--no-pilot"]);
    assert!(unpiloted.contains("\nno pilot: "), "{unpiloted}");

    let pinned = MIXED.split_once("attitude").expect("targets").0.to_owned() + "method = \"rk4\"\ndt = 0.01\n";
    fs::write(desk.path("study.toml"), pinned).expect("written");
    let summary = desk.done(&["run", "study.toml", "--engine", "cpu", "--force"]);
    assert!(summary.contains("200 bodies, 8 s: rk4 in f64, 800 steps of 1.000e-2 s or less\n"), "{summary}");
    assert!(!summary.contains("  asked "), "{summary}");
}

#[test]
fn no_bodies_have_no_figures() {
    let desk = mixed(0);
    fs::write(desk.path("study.toml"), format!("{MIXED}[output]\nstatistics = [\"spin_rate\"]\n")).expect("written");
    let summary = desk.done(&RUN);
    assert!(summary.contains("  work     0 bodies, 8 s: nothing to do\n"), "{summary}");
    assert!(!summary.contains("NaN") && !summary.contains("median"), "{summary}");
    assert_eq!(report(&desk, "study.out")["accuracy"]["met"], serde_json::Value::Null);
}

#[test]
fn a_study_that_asks_for_no_results_is_told_so() {
    let desk = mixed(20);
    fs::write(desk.path("study.toml"), format!("{MIXED}[output]\nfinal = false\n")).expect("written");
    let output = desk.polhode(&RUN);
    assert!(output.status.success());
    let note = words(&output.stderr);
    assert_eq!(note, "note: the study asks for no results: all that is written is plan.json and report.json\n");
    assert_eq!(desk.names("study.out"), ["plan.json", "report.json"]);
}

#[test]
fn a_target_out_of_reach_is_named_with_its_line_and_unit() {
    let desk = mixed(20);
    let refused = |targets: &str| {
        fs::write(desk.path("study.toml"), MIXED.replace("attitude = 1e-5\nenergy = 1e-4", targets)).expect("written");
        desk.refused(&RUN, 2)
    };
    let line = refused("attitude = 1e-17");
    let start =
        "error: study.toml:10: accuracy.attitude = 1e-17: out of reach: attitude 1e-17 rad, in 95 % of the bodies: ";
    assert!(line.starts_with(start), "{line}");
    assert!(line.contains(" misses the attitude by a factor of "), "{line}");
    let line = refused("attitude = 1e-3\nenergy = 1e-18");
    assert!(line.starts_with("error: study.toml:11: accuracy.energy = 1e-18: out of reach: "), "{line}");
    assert!(line.contains(" misses the energy by a factor of ") && line.contains("rounding in f64"), "{line}");
    // What nobody wrote is missed all the same, and what is written is innocent.
    let chaos = MIXED.replace("end = 8.0", "end = 800.0").replace("attitude = 1e-5\nenergy = 1e-4", "energy = 0.1")
        + "[[torque]]\nmodel = \"heavy-top\"\nmass = 3.0\ncentre = [0.3, 0.2, 0.5]\ngravity = [0, 0, -9.81]\n";
    fs::write(desk.path("study.toml"), chaos).expect("written");
    let line = desk.refused(&RUN, 2);
    assert!(line.starts_with("error: study.toml:9: accuracy.attitude = 1e-6 (where nothing is said): "), "{line}");
    assert!(line.contains("the motion amplifies every error"), "{line}");
}

#[test]
fn a_plan_of_the_long_way_says_how_it_is_repeated() {
    let desk = mixed(20);
    let run = |more: &[&'static str]| [&RUN[..], &["--quiet"], more].concat();
    desk.done(&run(&["--no-skip", "--out", "long"]));
    let line = desk.refused(&run(&["--plan", "long/plan.json", "--out", "again"]), 2);
    assert!(line.contains("skipping is forbidden") && line.contains("repeat it with --no-skip"), "{line}");
    desk.done(&run(&["--plan", "long/plan.json", "--no-skip", "--out", "again"]));
    desk.done(&run(&["--out", "short"]));
    let line = desk.refused(&run(&["--plan", "short/plan.json", "--no-skip", "--out", "third"]), 2);
    assert!(line.contains("skipping is allowed") && line.contains("repeat it without --no-skip"), "{line}");
    let bytes = |folder: &str| fs::read(desk.path(folder).join("final.csv")).expect("written");
    assert!(bytes("long") == bytes("again"));
}
