//! Sampled torques in studies and tables: refusals, columns of their own state, parts, checkpoints, replays, and what commands say of them.

#![cfg(feature = "cli")]

use std::fs;
use std::path::Path;

use polhode::record::StateTable;
use polhode::study::Study;

use crate::in_parts::{done, leave_the_bytes_of, tables};
use crate::workspace::{States, Workspace, report};

/// Wheels by a law of one's own and coils of the library, with an event and statistics.
pub const STUDY: &str = r#"
seed = 4
[bodies]
count = 500
inertia = { moments = [0.02, 0.025, 0.03], scatter = 0.1 }
orientation = { distribution = "uniform" }
angular_velocity = { distribution = "normal", mean = [0, 0, 0], sigma = 0.05 }
[orbit]
mu = 3.986004418e14
radius = 6.9e6
inclination = 0.9
[[torque]]
model = "custom"
every = "0.5 s"
delay = "0.2 s"
parameters = { k = { distribution = "uniform", low = 0.002, high = 0.004 }, d = 0.02 }
state = { h = { distribution = "normal", mean = [0, 0, 0], sigma = 1e-4 }, count = 0 }
sample = { u = "2 * k * select(attitude.w < 0, -1, 1) * vec(attitude.x, attitude.y, attitude.z) + d * angular_velocity" }
d_h = "u"
next_count = "count + 1"
torque = "-d_h - cross(angular_velocity, h)"
[[torque]]
model = "magnetorquers"
gain = 2e4
moment_limit = 0.1
strength = 7.8e15
every = "3 s"
[time]
end = 20.0
outputs = { every = 3.3 }
[accuracy]
method = "rk8"
tolerance = 1e-10
[[event]]
name = "slow"
quantity = "spin_rate"
below = 0.02
[output]
snapshots = true
statistics = ["spin_rate"]
quantiles = [50]
"#;

fn refusal(old: &str, new: &str) -> String {
    assert_eq!(STUDY.matches(old).count(), 1, "{old}");
    let study = Study::parse(Path::new("study.toml"), &STUDY.replace(old, new));
    let scene = study.and_then(|study| study.scene().map_err(|error| study.located(error)));
    scene.map(|_| ()).expect_err(new).to_string()
}

#[test]
fn what_makes_no_sense_is_refused_with_its_line() {
    let cases = [
        ("every = \"0.5 s\"\n", "", "torque[1].every is missing"),
        ("every = \"0.5 s\"", "every = 0", "torque[1].every = 0: expected a period above zero (s)"),
        ("every = \"0.5 s\"", "every = \"0.5 m\"", "torque[1].every = \"0.5 m\""),
        ("delay = \"0.2 s\"", "delay = -1", "torque[1].delay = -1: expected a delay that is not negative (s)"),
        ("d_h = \"u\"\n", "", "torque[1].state.h"),
        ("d_h = \"u\"\n", "d_h = \"u\"\nnext_h = \"h\"\n", "`h` needs one law: `d_h`, its rate, or `next_h`"),
        ("d_h = \"u\"\n", "d_h = \"u.x\"\n", "the result: found a number, needed a vector"),
        ("d_h = \"u\"\n", "d_h = \"u\"\nd_g = \"u\"\n", "expected `g` in the table `state`"),
        ("count = 0 }", "count = [0, 0, 0, 1] }", "torque[1].state.count"),
        ("sample = { u =", "sample = { h =", "`h` is defined twice"),
        ("- cross(angular_velocity, h)\"", "- cross(angular_velocity, g)\"", "unknown name `g`"),
        ("- cross(angular_velocity, h)\"", "+ sin(count * time) * h\"", "such rates are constant"),
        ("d = 0.02 }", "every = 0.02 }", "`every` is defined twice"),
    ];
    for (old, new, expected) in cases {
        let message = refusal(old, new);
        assert!(message.starts_with("study.toml:") && message.contains(expected), "{new}: {message}");
        assert_eq!(message.lines().count(), 1, "{message}");
    }
}

#[test]
fn more_samples_than_a_run_comes_to_the_end_of_are_refused() {
    for (old, new, expected) in [
        ("every = \"3 s\"", "every = 1e-9", "torque[2].every = 1e-9: more than 1e9 samples"),
        ("delay = \"0.2 s\"", "delay = \"1 h\"", "torque[1].delay = 3600.0: expected at most 1000 periods"),
        (
            "every = \"3 s\"",
            "every = 3\ndelay = -1",
            "torque[2].delay = -1.0: expected a finite number that is not negative (s)",
        ),
    ] {
        let workspace = Workspace::new(&STUDY.replace(old, new));
        let error = workspace.refused(&["run", "study.toml", "--engine", "cpu"], 2);
        assert!(error.contains(expected), "{error}");
    }
}

#[test]
fn tables_have_the_own_state_and_commands_name_what_is_sampled() {
    let workspace = Workspace::new(STUDY);
    workspace.done(&["run", "study.toml", "--quiet", "--engine", "cpu"]);
    let text = fs::read_to_string(workspace.path("study.out/snapshots.csv")).expect("a table");
    let own = "torque1_h_x,torque1_h_y,torque1_h_z,torque1_count,torque2_b_x,torque2_b_y,torque2_b_z,torque2_seen";
    let head = format!("body,t,qx,qy,qz,qw,wx,wy,wz,lx,ly,lz,kinetic_energy,{own},status\n");
    assert!(text.starts_with(&head), "{}", &text[..200]);
    let states = States::read(&workspace.path("study.out/snapshots.csv"));
    for row in 0..states.rows() {
        let time = states.column("t")[row];
        // Sample 0 is counted at the start.
        assert_eq!(states.column("torque1_count")[row], (time / 0.5 + 1e-9).floor() + 1.0, "at {time} s");
        assert_eq!(states.column("torque2_seen")[row], 1.0);
        let b = states.vector(["torque2_b_x", "torque2_b_y", "torque2_b_z"], row).length();
        assert!(b > 1e-5 && b < 1e-4, "{b} T");
    }
    let explained = workspace.done(&["explain", "study.toml", "--engine", "cpu"]);
    for line in [
        "sampled: torque 1 (custom) every 0.5 s, in effect 0.2 s later: 41 samples, each of which ends a step\n",
        "sampled: torque 2 (magnetorquers) every 3.0 s: 7 samples, each of which ends a step\n",
    ] {
        assert!(explained.contains(line), "{explained}");
    }
    let verified = workspace.done(&["verify", "study.toml", "--engine", "cpu"]);
    assert!(verified.contains("samples of torques, which the host forms in f64"), "{verified}");
    // The recomputed sample follows the same samples.
    let error = report(&workspace, "study.out")["accuracy"]["attitude"]["max"].as_f64().expect("a number");
    assert!(error < 1e-7, "{error:e}");
    // By another method: rk8 would take the same steps, and find no error at all.
    assert!(error > 1e-18, "{error:e}");
}

#[test]
fn every_format_holds_the_same_own_state() {
    let read = |format: &str| {
        let workspace = Workspace::new(&STUDY.replace("[output]", &format!("[output]\nformat = \"{format}\"")));
        workspace.done(&["run", "study.toml", "--quiet", "--engine", "cpu"]);
        let mut table = StateTable::open(&workspace.path(&format!("study.out/final.{format}"))).expect("a table");
        table.read(0, 500).expect("rows").len()
    };
    assert_eq!((read("csv"), read("npz")), (500, 500));
    if cfg!(feature = "parquet") {
        assert_eq!(read("parquet"), 500);
    }
}

/// Also the own state, the event times across samples, and in equal steps: nothing depends on which bodies are computed together.
#[test]
fn parts_and_pieces_leave_the_bytes_of_one_run() {
    for steps in
        ["method = \"rk8\"\ntolerance = 1e-10", "method = \"rk4\"\ndt = 0.07\nprecision = \"f32\"", "attitude = 1e-7"]
    {
        let workspace = Workspace::new(&STUDY.replace("method = \"rk8\"\ntolerance = 1e-10", steps));
        done(&workspace, 2, &["run", "study.toml", "--out", "whole", "--quiet", "--engine", "cpu"]);
        let (whole, of_whole) = (tables(&workspace, "whole"), report(&workspace, "whole"));
        assert!(whole.contains_key("snapshots.csv") && whole.contains_key("events.csv"), "{:?}", whole.keys());
        for folder in leave_the_bytes_of(&whole, &workspace, "0.2") {
            assert_eq!(report(&workspace, folder)["body_steps"], of_whole["body_steps"], "{steps}, {folder}");
        }
    }
}

#[test]
fn a_plan_belongs_to_the_law() {
    let workspace = Workspace::new(STUDY);
    workspace.done(&["plan", "study.toml", "--out", "plan.json", "--quiet", "--engine", "cpu"]);
    let run = ["run", "study.toml", "--plan", "plan.json", "--quiet", "--engine", "cpu", "--force"];
    workspace.done(&run);
    for (old, new) in [
        ("every = \"0.5 s\"", "every = \"0.6 s\""),
        ("delay = \"0.2 s\"", "delay = \"0.3 s\""),
        ("d_h = \"u\"", "d_h = \"u + h\""),
        ("next_count = \"count + 1\"", "next_count = \"count + 2\""),
        ("+ d * angular_velocity\"", "- d * angular_velocity\""),
    ] {
        fs::write(workspace.path("study.toml"), STUDY.replace(old, new)).expect("written");
        let error = workspace.refused(&run, 2);
        assert!(error.contains("the fingerprint of shared parameters"), "{new}: {error}");
    }
}

#[test]
fn a_replay_follows_the_samples() {
    let workspace = Workspace::new(STUDY);
    workspace.done(&["run", "study.toml", "--out", "out", "--quiet", "--engine", "cpu"]);
    let arguments = ["replay", "out", "--body", "77", "--engine", "cpu", "--json", "--out", "track.csv"];
    let found: serde_json::Value = serde_json::from_str(&workspace.done(&arguments)).expect("JSON");
    let errors = found["errors"].as_array().expect("errors");
    assert_eq!(errors.len(), 7);
    assert!(errors.iter().all(|row| row["attitude"].as_f64().is_some_and(|error| error < 1e-7)), "{errors:?}");
}

#[test]
fn a_gpu_holds_what_the_cpu_holds() {
    let workspace = Workspace::new(STUDY);
    for engine in ["cpu", "gpu"] {
        workspace.done(&["run", "study.toml", "--out", engine, "--quiet", "--engine", engine]);
    }
    let [cpu, gpu] = ["cpu", "gpu"].map(|folder| States::read(&workspace.path(&format!("{folder}/final.csv"))));
    for name in ["qx", "wx", "torque1_h_x", "torque2_b_z", "torque1_count"] {
        for (own, other) in gpu.column(name).iter().zip(cpu.column(name)) {
            assert!((own - other).abs() < 1e-9, "{name}: {own} and {other}");
        }
    }
}
