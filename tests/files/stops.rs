//! Events that stop bodies, in studies and tables: refusals, columns, reports, parts, checkpoints, replays.

#![cfg(feature = "cli")]

use std::fs;
use std::path::Path;

use polhode::bodies::Status;
use polhode::record::StateTable;
use polhode::study::Study;
use polhode::{Engine, Plan};

use crate::in_parts::{OBSERVED, done, leave_the_bytes_of, observed_names, tables};
use crate::workspace::{States, Workspace, report};

/// Spheres of 2 kg m² whose spin decays as e^(−t/10 s).
const STUDY: &str = r#"
[bodies]
count = 300
inertia = [2, 2, 2]
angular_velocity = { distribution = "log-normal", median = 0.5, sigma = 0.8 }
[[torque]]
model = "linear-drag"
coefficient = 0.2
[time]
end = 20.0
outputs = { every = 2.0 }
[accuracy]
method = "rk8"
dt = 0.05
[[event]]
name = "despun"
quantity = "spin_rate"
below = 0.5
action = "stop"
[[event]]
name = "slow"
quantity = "spin_rate"
below = 0.3
[output]
snapshots = true
"#;

#[test]
fn another_action_is_refused() {
    let text = STUDY.replace("\"stop\"", "\"halt\"");
    let error = Study::parse(Path::new("study.toml"), &text).expect_err("refused").to_string();
    insta::assert_snapshot!(error, @r#"study.toml:19: event[1].action = "halt": possible: record, stop"#);
}

#[test]
fn a_stop_of_centres_of_mass_that_are_stepped_is_refused_where_it_is_asked_for() {
    let text = STUDY.replace("[time]", "[[force]]\nmodel = \"quadratic-drag\"\ncoefficient = 0.1\n[time]");
    let text = text.replace("count = 300", "count = 300\nmass = 1.0");
    let workspace = Workspace::new(&text);
    let error = workspace.refused(&["run", "study.toml", "--engine", "cpu"], 2);
    insta::assert_snapshot!(error.trim_end(), @r#"error: study.toml:23: event[1].action = "stop": event 1 (despun): the force quadratic-drag moves the centres of mass in steps, and a body cannot be stopped between them: use action record"#);
}

#[test]
fn tables_and_the_report_say_who_was_stopped_and_when() {
    let workspace = Workspace::new(STUDY);
    let summary = workspace.done(&["run", "study.toml", "--engine", "cpu"]);
    let report = report(&workspace, "study.out");
    let stopped = report["stopped"]["bodies"].as_u64().expect("a count");
    assert!(stopped > 150 && stopped < 300, "{stopped}");
    assert!(summary.contains(&format!("  stopped  {stopped} of 300 bodies by an event\n")), "{summary}");
    assert!(summary.contains(&format!("  event    despun, which stops bodies: {stopped} bodies, ")), "{summary}");
    assert!(summary.contains("  event    slow: "), "{summary}");
    assert_eq!((&report["stopped"]["status"], &report["stopped"]["reason"]), (&6.into(), &"stopped".into()));
    let events = &report["events"];
    assert_eq!((&events[0]["action"], &events[1]["action"]), (&"stop".into(), &"record".into()));
    assert_eq!((&events[0]["bodies"], &events[0]["stopped"]), (&stopped.into(), &0.into()));
    // Whoever starts below both levels has both; nobody else comes to the lower one.
    let had = events[1]["bodies"].as_u64().expect("a count");
    assert_eq!(events[1]["stopped"].as_u64(), Some(stopped - had));
    assert_eq!((&events[1]["failed"], &report["failed_bodies"]), (&0.into(), &serde_json::json!([])));
    assert_eq!(report["statistics"], serde_json::Value::Null);

    let text = fs::read_to_string(workspace.path("study.out/final.csv")).expect("a table");
    assert!(
        text.starts_with("body,t,qx,qy,qz,qw,wx,wy,wz,lx,ly,lz,kinetic_energy,stopped_at,status\n"),
        "{}",
        &text[..90]
    );
    let states = States::read(&workspace.path("study.out/final.csv"));
    let mut times = vec![f64::NAN; 300];
    let mut reader = csv::Reader::from_path(workspace.path("study.out/events.csv")).expect("a table");
    for row in reader.records().map(|row| row.expect("a row")).filter(|row| &row[0] == "despun") {
        times[row[1].parse::<usize>().expect("a body")] = row[2].parse().expect("a time");
    }
    for (body, time) in times.iter().enumerate() {
        let (status, at) = (states.column("status")[body], states.column("stopped_at")[body]);
        assert_eq!(status == 6.0, !at.is_nan(), "body {body}");
        assert_eq!(at.to_bits(), time.to_bits(), "body {body}: {at} and {time}");
        let spin = states.vector(["wx", "wy", "wz"], body).length();
        assert!(status == 0.0 && spin > 0.5 || at == 0.0 || (spin - 0.5).abs() < 1e-9, "body {body}: {spin}");
    }
    let snapshots = States::read(&workspace.path("study.out/snapshots.csv"));
    for body in [0, 17, 133] {
        for row in snapshots.of_body(body) {
            let is_past = times[body] <= snapshots.column("t")[row];
            assert_eq!(snapshots.column("status")[row] == 6.0, is_past, "body {body}");
            assert!(!is_past || snapshots.column("wx")[row] == states.column("wx")[body], "body {body} has moved");
        }
    }
    // Equal steps: 40 to an output, of those that were under way at the output before.
    let under_way = |time: f64| times.iter().filter(|at| at.is_nan() || **at > time).count() as u64;
    let steps: u64 = (0..10).map(|output| 40 * under_way(2.0 * f64::from(output))).sum();
    assert_eq!(report["body_steps"].as_u64(), Some(steps));

    let explained = workspace.done(&["explain", "study.toml", "--engine", "cpu"]);
    assert!(explained.contains("2 events, 1 of which stops bodies, from all states"), "{explained}");
    assert!(
        explained.contains("an event stops bodies: those that it has stopped are not computed any further"),
        "{explained}"
    );
    let verified = workspace.done(&["verify", "study.toml", "--engine", "cpu"]);
    assert!(verified.contains("stops by events: all bodies are stepped on here"), "{verified}");
}

#[test]
fn every_format_holds_the_same_stops() {
    let read = |format: &str| {
        let workspace = Workspace::new(&STUDY.replace("[output]", &format!("[output]\nformat = \"{format}\"")));
        workspace.done(&["run", "study.toml", "--quiet", "--engine", "cpu"]);
        let mut table = StateTable::open(&workspace.path(&format!("study.out/final.{format}"))).expect("a table");
        let rows = table.read(0, 300).expect("rows");
        rows.iter().map(|row| (row.state.status(), row.state.stopped_at.map(f64::to_bits))).collect::<Vec<_>>()
    };
    let text = read("csv");
    assert!(text.iter().any(|(status, at)| *status == Status::Stopped && at.is_some()));
    assert!(text.iter().any(|(status, at)| *status == Status::Valid && at.is_none()));
    assert_eq!(text, read("npz"));
    if cfg!(feature = "parquet") {
        assert_eq!(text, read("parquet"));
    }
}

/// Both stop and record, with bodies that fail among them.
fn observed_and_stopped(format: &str) -> String {
    let study = OBSERVED.replace("[output]", &format!("[output]\nformat = \"{format}\""));
    study.replace("falls_below = 1.0", "falls_below = 1.0\naction = \"stop\"")
}

#[test]
fn parts_and_pieces_of_a_study_with_stops_leave_the_bytes_of_one_run() {
    let format = "csv";
    let workspace = Workspace::new(&observed_and_stopped(format));
    done(&workspace, 2, &["run", "study.toml", "--out", "whole", "--quiet", "--engine", "cpu"]);
    let whole = tables(&workspace, "whole");
    assert_eq!(whole.keys().cloned().collect::<Vec<_>>(), observed_names(format));
    let of_whole = report(&workspace, "whole");
    assert!(of_whole["stopped"]["bodies"].as_u64() > Some(50), "{}", of_whole["stopped"]);
    for folder in leave_the_bytes_of(&whole, &workspace, "0.05") {
        let merged = report(&workspace, folder);
        for key in ["events", "stopped", "failed_bodies", "body_steps"] {
            assert_eq!(merged[key], of_whole[key], "{folder}: {key}");
        }
        assert_eq!(merged["accuracy"]["attitude_max"], of_whole["accuracy"]["attitude"]["max"], "{folder}");
    }
}

#[test]
fn so_do_those_of_a_study_with_checks_between_outputs() {
    let study = observed_and_stopped("csv")
        .replace("every = 1.0", "every = 2.0")
        .replace("[accuracy]", "checks = { every = 0.3 }\n[accuracy]");
    let workspace = Workspace::new(&study);
    done(&workspace, 2, &["run", "study.toml", "--out", "whole", "--quiet", "--engine", "cpu"]);
    let whole = tables(&workspace, "whole");
    let of_whole = report(&workspace, "whole");
    assert_eq!(of_whole["checks"].as_u64(), Some(13));
    for folder in leave_the_bytes_of(&whole, &workspace, "0.05") {
        let merged = report(&workspace, folder);
        for key in ["events", "stopped", "failed_bodies", "body_steps"] {
            assert_eq!(merged[key], of_whole[key], "{folder}: {key}");
        }
    }
}

#[test]
fn a_plan_belongs_to_what_is_stopped() {
    let workspace = Workspace::new(STUDY);
    workspace.done(&["plan", "study.toml", "--out", "plan.json", "--quiet", "--engine", "cpu"]);
    let run = ["run", "study.toml", "--plan", "plan.json", "--quiet", "--engine", "cpu"];
    workspace.done(&run);
    fs::write(workspace.path("study.toml"), STUDY.replace("below = 0.5", "below = 0.6")).expect("written");
    let error = workspace.refused(&[&run[..], &["--force"]].concat(), 2);
    assert!(error.contains("the fingerprint of shared parameters"), "{error}");
    // What only records may be another.
    fs::write(workspace.path("study.toml"), STUDY.replace("below = 0.3", "below = 0.2")).expect("written");
    workspace.done(&[&run[..], &["--force"]].concat());
}

#[test]
fn a_replay_of_a_stopped_body_ends_at_its_stop() {
    let workspace = Workspace::new(STUDY);
    workspace.done(&["run", "study.toml", "--out", "out", "--quiet", "--engine", "cpu"]);
    let states = States::read(&workspace.path("out/final.csv"));
    let at = states.column("stopped_at");
    let late = (0..300).find(|&body| at[body] > 5.0).expect("a body");
    let replayed = |of: &str, body: usize| -> serde_json::Value {
        let body = body.to_string();
        let out = ["--engine", "cpu", "--json", "--out", "track.csv", "--force"];
        let arguments = [&["replay", of, "--body", &body], &out[..]].concat();
        serde_json::from_str(&workspace.done(&arguments)).expect("JSON")
    };
    for of in ["out", "study.toml"] {
        let found = replayed(of, late);
        let errors = found["errors"].as_array().expect("errors");
        let last = errors.last().expect("the stop");
        assert_eq!((last["time"].as_f64(), &last["status"]), (Some(at[late]), &6.into()), "{of}");
        assert_eq!(errors.len(), (at[late] / 2.0).ceil() as usize, "{of}");
        assert!(
            errors.iter().all(|row| row["attitude"].as_f64().is_some_and(|error| error < 1e-9)),
            "{of}: {errors:?}"
        );
        let track = States::read(&workspace.path("track.csv"));
        assert_eq!(track.column("t").last(), Some(&at[late]));
    }
    let text = workspace.done(&["replay", "out", "--body", &late.to_string(), "--engine", "cpu"]);
    assert!(text.contains(", where an event has stopped the body: "), "{text}");
    let start = (0..300).find(|&body| at[body] == 0.0).expect("a body that starts so");
    let found = replayed("out", start);
    assert_eq!(found["errors"].as_array().map(Vec::len), Some(1));
    assert!(found["errors"][0]["attitude"].as_f64().is_some_and(|error| error < 1e-15), "{}", found["errors"]);
    // A body that goes on is replayed to the end.
    let moving = (0..300).find(|&body| at[body].is_nan()).expect("a body");
    assert_eq!(replayed("out", moving)["errors"].as_array().map(Vec::len), Some(10));
}

/// The GPU leaves out what the CPU does, and writes the same times.
#[test]
fn a_gpu_stops_the_same_bodies() {
    let workspace = Workspace::new(STUDY);
    workspace.done(&["run", "study.toml", "--out", "cpu", "--quiet", "--engine", "cpu"]);
    workspace.done(&["run", "study.toml", "--out", "gpu", "--quiet", "--engine", "gpu"]);
    let [cpu, gpu] = ["cpu", "gpu"].map(|folder| States::read(&workspace.path(&format!("{folder}/final.csv"))));
    assert_eq!(cpu.column("status"), gpu.column("status"));
    for (own, other) in gpu.column("stopped_at").iter().zip(cpu.column("stopped_at")) {
        assert!((own - other).abs() < 1e-9 || own.is_nan() && other.is_nan(), "{own} and {other}");
    }
    let [cpu, gpu] = ["cpu", "gpu"].map(|folder| report(&workspace, folder)["body_steps"].clone());
    assert_eq!(cpu, gpu);
}

#[test]
fn a_scene_without_stops_has_no_column_for_them() {
    let study = Study::parse(Path::new("study.toml"), &STUDY.replace("\"stop\"", "\"record\"")).expect("a study");
    let scene = study.scene().expect("a scene");
    assert!(!scene.stops());
    let plan = Plan::new(&scene, &Engine::cpu()).expect("a plan");
    assert!(plan.skips().iter().all(|skip| skip.name.name() != "stopped"));
    let workspace = Workspace::new(&STUDY.replace("\"stop\"", "\"record\""));
    workspace.done(&["run", "study.toml", "--quiet", "--engine", "cpu"]);
    assert!(!States::read(&workspace.path("study.out/final.csv")).columns.contains_key("stopped_at"));
    assert!(report(&workspace, "study.out").get("stopped").is_none());
}
