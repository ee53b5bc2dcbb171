//! `polhode replay`: a body of a study or of a run's folder, computed alone.

#![cfg(feature = "cli")]

use std::fs;

use crate::support::attitude_error;
use crate::workspace::{States, Workspace};

const STUDY: &str = r#"
seed = 3
[bodies]
count = 300
inertia = { moments = [1.0, 1.7, 2.2], scatter = 0.2 }
mass = 2.0
position = { distribution = "normal", mean = 0.0, sigma = 1.0 }
angular_velocity = { distribution = "normal", mean = 0.0, sigma = 1.0 }
[[torque]]
model = "linear-drag"
coefficient = { distribution = "uniform", low = 0.01, high = 0.1 }
[[force]]
model = "gravity"
acceleration = [0, 0, -9.81]
[time]
end = 5.0
outputs = { every = 2.0 }
[accuracy]
attitude = 1e-6
[output]
snapshots = true
"#;

fn replayed(workspace: &Workspace, of: &str, body: &str, more: &[&str]) -> serde_json::Value {
    let arguments = [&["replay", of, "--body", body, "--engine", "cpu", "--json"], more].concat();
    serde_json::from_str(&workspace.done(&arguments)).expect("JSON")
}

#[test]
fn a_replay_says_how_far_a_runs_values_are_off_and_leaves_the_track() {
    for format in ["csv", "npz"] {
        let study = format!("{STUDY}format = \"{format}\"\n");
        let workspace = Workspace::new(&study);
        workspace.done(&["run", "study.toml", "--out", "out", "--quiet", "--engine", "cpu"]);
        let of_folder = replayed(&workspace, "out", "123", &["--samples", "51", "--out", "track.csv"]);
        // With the same samples, as steps end at them.
        let of_study = replayed(&workspace, "study.toml", "123", &["--samples", "51"]);
        let times: Vec<f64> = of_folder["errors"]
            .as_array()
            .expect("errors")
            .iter()
            .map(|row| row["time"].as_f64().expect("s"))
            .collect();
        assert_eq!(times, [2.0, 4.0, 5.0]);
        // The body alone has the bits that stand in the run's tables.
        assert_eq!(of_folder["errors"], of_study["errors"], "{format}");
        for row in of_folder["errors"].as_array().expect("errors") {
            let error = row["attitude"].as_f64().expect("rad");
            assert!(error > 0.0 && error < 2e-6, "{error:e}");
            assert!(row["position"].as_f64().is_some_and(|error| error < 1e-12));
        }
        assert!(of_folder["own_error"]["attitude"].as_f64().is_some_and(|error| error < 1e-11));

        let track = States::read(&workspace.path("track.csv"));
        assert!(track.column("body").iter().all(|&body| body == 123.0));
        assert_eq!(track.rows(), 51, "multiples of a tenth of a second are the output times too");
        assert_eq!(of_study["track"], "study.body-123.csv");
        if format == "csv" {
            let table = States::read(&workspace.path("out/snapshots.csv"));
            for row in table.of_body(123) {
                let time = table.column("t")[row];
                let own = track.column("t").iter().position(|&other| other == time).expect("an output time");
                assert!(attitude_error(table.orientation(row), track.orientation(own)) < 3e-6);
                assert_eq!(table.column("z")[row], track.column("z")[own]);
            }
        }
        let shown = workspace.done(&["replay", "out", "--body", "123"]);
        assert!(shown.contains("Body 123 alone, on the CPU in f64: rk8 in adaptive steps, tolerance 1e-14"), "{shown}");
        assert!(shown.contains("t = 5.0 s: attitude "), "{shown}");
    }
}

/// A table need not have all columns: what is there is compared, and a body is not taken for failed because of what is not.
#[test]
fn tables_of_chosen_columns_are_compared_as_far_as_they_go() {
    let chosen = |columns: &str| {
        let study = format!("{STUDY}initial = false\ncolumns = [{columns}]\n");
        let workspace = Workspace::new(&study);
        workspace.done(&["run", "study.toml", "--out", "out", "--quiet", "--engine", "cpu"]);
        workspace
    };
    let workspace = chosen(r#""qx", "qy", "qz", "qw", "wx", "wy", "wz", "spin_rate""#);
    let shown = workspace.done(&["replay", "out", "--body", "7"]);
    assert!(
        shown.contains("t = 5.0 s: attitude ") && !shown.contains("failed") && !shown.contains("energy NaN"),
        "{shown}"
    );
    let of_run = replayed(&workspace, "out", "7", &["--out", "track.csv"]);
    let last = of_run["errors"].as_array().and_then(|errors| errors.last()).expect("errors");
    assert_eq!((last["status"].as_u64(), last["kinetic_energy"].is_null()), (Some(0), true), "{of_run}");
    let error = chosen(r#""spin_rate", "qx""#).refused(&["replay", "out", "--body", "7"], 2);
    assert!(error.contains("expected columns of orientation and angular velocity: it has no qy"), "{error}");
}

#[test]
fn what_cannot_be_replayed_is_refused_by_name() {
    let workspace = Workspace::new(STUDY);
    let error = workspace.refused(&["replay", "study.toml", "--body", "300"], 2);
    assert!(error.contains("--body 300: expected the index of a body, from 0 to 299"), "{error}");
    workspace.done(&["run", "study.toml", "--out", "out", "--quiet", "--engine", "cpu"]);
    fs::write(workspace.path("study.toml"), STUDY.replace("seed = 3", "seed = 4")).expect("written");
    let error = workspace.refused(&["replay", "out", "--body", "3"], 2);
    assert!(error.contains("the fingerprint of bodies and their parameters"), "{error}");
    fs::rename(workspace.path("study.toml"), workspace.path("elsewhere.toml")).expect("renamed");
    let error = workspace.refused(&["replay", "out", "--body", "3"], 2);
    assert!(error.contains("study.toml: cannot be read") && error.contains("report.json names it"), "{error}");
    fs::write(workspace.path("study.toml"), STUDY).expect("written");
    let table = workspace.path("out/snapshots.csv");
    let text = fs::read_to_string(&table).expect("a table");
    fs::write(&table, &text[..text.len() / 2]).expect("written");
    let error = workspace.refused(&["replay", "out", "--body", "299"], 2);
    assert!(error.contains("out/snapshots.csv: "), "{error}");
    let error = workspace.refused(&["replay", ".", "--body", "3"], 2);
    assert!(error.contains("report.json: cannot be read"), "{error}");
}

/// A slip of the hand in --out costs neither a study nor its bodies.
#[test]
fn no_command_replaces_its_input_or_what_it_has_not_written() {
    let study = "[bodies]\nfile = \"data/bodies.csv\"\n[time]\nend = 1.0\n";
    let workspace = Workspace::new(study);
    fs::create_dir(workspace.path("data")).expect("made");
    fs::write(workspace.path("data/bodies.csv"), "ixx,iyy,izz,wx,wy,wz\n1,1.5,2,0,0,1\n").expect("written");
    fs::write(workspace.path("notes.txt"), "mine").expect("written");
    workspace.done(&["run", "study.toml", "--out", "out", "--engine", "cpu", "--quiet"]);
    let plan = ["plan", "study.toml", "--engine", "cpu", "--quiet", "--out"];
    let replay = ["replay", "out", "--body", "0", "--engine", "cpu", "--json", "--out"];
    let contents = |name: &str| fs::read_to_string(workspace.path(name)).expect("read");
    let inputs = ["study.toml", "./data/../study.toml", "data/bodies.csv"];
    for command in [&plan[..], &replay] {
        for (name, more) in inputs.iter().flat_map(|name| [(name, &[][..]), (name, &["--force"])]) {
            let before = contents(name);
            let error = workspace.refused(&[command, &[name], more].concat(), 2);
            assert!(error.contains(&format!("--out {name}: the study is read from this file")), "{error}");
            assert_eq!(contents(name), before);
        }
        let error = workspace.refused(&[command, &["notes.txt"]].concat(), 2);
        assert!(error.contains("--out notes.txt: this file exists: expected another name, or --force"), "{error}");
        assert_eq!(contents("notes.txt"), "mine");
        workspace.done(&[command, &["notes.txt", "--force"]].concat());
        assert_ne!(contents("notes.txt"), "mine");
        fs::write(workspace.path("notes.txt"), "mine").expect("written");
    }
    // A plan again, and a track by the default name.
    for _ in 0..2 {
        workspace.done(&[&plan[..], &["plan.json"]].concat());
        workspace.done(&replay[..replay.len() - 1]);
    }
    workspace.done(&[&replay[..], &["track.csv"]].concat());
    workspace.refused(&[&replay[..], &["track.csv"]].concat(), 2);
}
