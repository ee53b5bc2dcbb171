//! Parts of a study that separate processes run: whatever the cut and the threads, the merged tables are those of one run to the byte; what
//! is missing, foreign or altered is refused by name, and a part is run again alone.

#![cfg(feature = "cli")]

use std::collections::BTreeMap;
use std::fs;
use std::process::Command;

use assert_cmd::cargo::cargo_bin;

use crate::in_parts::{OBSERVED, PINNED, STATISTICS, done, leave_the_bytes_of, observed_names, tables};
use crate::workspace::{Workspace, words};

/// Free and driven bodies, those in adaptive steps among them, and statistics that are formed where the states are and from the states.
const ACCURACY: &str = r#"
seed = 5
[bodies]
count = 700
inertia = { moments = [1.0, 1.7, 2.2], scatter = 0.2 }
orientation = { distribution = "uniform" }
angular_velocity = { distribution = "normal", mean = 0.0, sigma = 1.5 }
[[torque]]
model = "linear-drag"
coefficient = { distribution = "log-normal", median = 0.05, sigma = 1.5 }
[[torque]]
model = "heavy-top"
mass = 0.05
centre = [0.0, 0.1, 0.3]
gravity = [0.0, 0.0, -9.81]
[time]
end = 4.0
outputs = { every = 1.0 }
[accuracy]
attitude = 1e-7
[output]
snapshots = true
statistics = ["kinetic_energy", "spin_rate", "angular_momentum"]
"#;

/// Runs all of some parts and merges them.
fn merged(workspace: &Workspace, engine: &str, (parts, threads): (usize, usize)) -> BTreeMap<String, Vec<u8>> {
    let all = format!("parts-{parts}-{threads}");
    for part in 1..=parts {
        let shard = format!("{part}/{parts}");
        let run = [
            "run",
            "study.toml",
            "--plan",
            "plan.json",
            "--shard",
            &shard,
            "--out",
            &all,
            "--quiet",
            "--engine",
            engine,
        ];
        done(workspace, threads, &run);
    }
    let out = format!("merged-{parts}-{threads}");
    done(workspace, threads, &["merge", &all, "--out", &out, "--quiet"]);
    tables(workspace, &out)
}

/// One run against parts; gives the workspace with the run in `whole`.
fn compare(study: &str, engine: &str, cuts: &[(usize, usize)], names: &[&str]) -> Workspace {
    let workspace = Workspace::new(study);
    done(&workspace, 2, &["run", "study.toml", "--out", "whole", "--quiet", "--engine", engine]);
    done(&workspace, 2, &["plan", "study.toml", "--out", "plan.json", "--quiet", "--engine", engine]);
    let whole = tables(&workspace, "whole");
    assert_eq!(whole.keys().map(String::as_str).collect::<Vec<_>>(), names);
    for &cut in cuts {
        let parts = merged(&workspace, engine, cut);
        assert_eq!(parts.keys().collect::<Vec<_>>(), whole.keys().collect::<Vec<_>>(), "{cut:?}");
        for (name, bytes) in &whole {
            assert!(parts[name] == *bytes, "{name} of {} parts on {} threads differs", cut.0, cut.1);
        }
    }
    workspace
}

/// Parts and threads.
const CUTS: [(usize, usize); 4] = [(1, 1), (1, 2), (7, 2), (64, 1)];

#[test]
fn tables_are_the_same_bytes_in_one_part_in_7_and_in_64() {
    compare(ACCURACY, "cpu", &CUTS, &["final.csv", "plan.json", "snapshots.csv", "statistics.csv"]);
}

#[test]
fn so_are_those_of_noise_translation_and_failures() {
    let names = ["failed.npz", "final.npz", "plan.json", "snapshots.npz", "statistics.npz"];
    let workspace = compare(PINNED, "cpu", &CUTS[2..], &names);
    let report = crate::workspace::report(&workspace, "merged-7-2");
    let whole = crate::workspace::report(&workspace, "whole");
    assert_eq!((&report["failed_bodies"], &report["bodies"]), (&whole["failed_bodies"], &whole["bodies"]));
    assert_eq!((report["shards"].as_u64(), report["body_steps"].as_u64()), (Some(7), whole["body_steps"].as_u64()));
    assert!(whole["failed_bodies"].as_array().is_some_and(|failed| !failed.is_empty()), "some fail");
}

#[test]
fn so_are_those_of_parquet_with_chosen_columns() {
    let columns = "format = \"parquet\"\ncolumns = [\"nutation\", \"qx\", \"wx\"]";
    let study = PINNED.replace("format = \"npz\"", columns);
    let names = ["failed.parquet", "final.parquet", "plan.json", "snapshots.parquet", "statistics.parquet"];
    compare(&study, "cpu", &CUTS[1..3], &names);
}

/// Slow spins and fast ones, so that the bodies of the sample are recomputed in steps of many sizes.
const SPREAD: &str = "[bodies]\ncount = 300\ninertia = { moments = [1.0, 1.7, 2.2], scatter = 0.2 }\n\
    angular_velocity = { distribution = \"direction\", magnitude = { distribution = \"uniform\", low = 0.02, high = 20 } }\n\
    [[torque]]\nmodel = \"linear-drag\"\ncoefficient = 0.01\n[time]\nend = 2.0\n[accuracy]\nmethod = \"rk4\"\ndt = 0.05\n\
    [output]\nformat = \"parquet\"\n";

#[test]
fn so_are_the_errors_in_footers() {
    let workspace = compare(SPREAD, "cpu", &CUTS[1..3], &["final.parquet", "plan.json"]);
    let [whole, merged] = ["whole", "merged-7-2"].map(|folder| crate::workspace::report(&workspace, folder));
    for key in ["attitude", "angular_velocity", "kinetic_energy"] {
        let greatest = &whole["accuracy"][key]["max"];
        assert_eq!(*greatest, merged["accuracy"][format!("{key}_max")], "{key}");
        assert!(greatest.as_f64() > Some(0.0), "{key}: {greatest}");
    }
}

#[test]
fn so_are_quantiles_histograms_events_and_cells() {
    for (format, cuts) in [("csv", &CUTS[1..]), ("npz", &CUTS[2..3]), ("parquet", &CUTS[2..3])] {
        let study = OBSERVED.replace("[output]", &format!("[output]\nformat = \"{format}\""));
        let names = observed_names(format);
        let workspace = compare(&study, "cpu", cuts, &names.iter().map(String::as_str).collect::<Vec<_>>());
        let [whole, merged] = ["whole", "merged-7-2"].map(|folder| crate::workspace::report(&workspace, folder));
        for key in ["events", "quantities", "statistics", "failed_bodies"] {
            assert_eq!(whole[key], merged[key], "{key}");
        }
        assert!(whole["events"][0]["compared"].as_u64() > Some(10), "{}", whole["events"]);
        // All parts together recompute the sample of the whole.
        let errors =
            |report: &serde_json::Value| (report["accuracy"]["bodies"].clone(), report["accuracy"]["beyond"].clone());
        assert_eq!(errors(&whole), errors(&merged));
        assert_eq!(whole["accuracy"]["attitude"]["max"], merged["accuracy"]["attitude_max"]);
    }
}

/// A table in each of three cells, whose columns are the bodies' own, the torques', or both: 30 bodies.
const ROWS_IN_CELLS: &str = r#"
seed = 3
[bodies]
file = "bodies.csv"
carry = ["owner"]
inertia = [1.0, 1.7, 2.2]
angular_velocity = { distribution = "normal", mean = [0, 0, 1], sigma = 0.1 }
[[sweep]]
name = "drag"
values = [0.05, 0.2, 0.6]
[[torque]]
model = "linear-drag"
coefficient = { sweep = "drag" }
[[torque]]
model = "constant-body"
torque = { columns = ["tx", "ty", "mass"] }
[[torque]]
model = "custom"
parameters = { k = { column = "k" }, heft = { column = "mass" } }
torque = "-k * heft * angular_velocity"
[[force]]
model = "constant"
force = [0, 0, -1]
[time]
end = 2.0
[accuracy]
method = "rk4"
dt = 0.05
[output]
initial = true
"#;

/// The bodies' own columns of this study.
fn rows() -> String {
    let header = "name,owner,mass,qx,qy,qz,qw,k,tx,ty\n";
    let row = |row: u32| {
        let x = f64::from(row);
        let (sin, cos) = x.sin_cos();
        let numbers = [1.0 + 0.01 * x, sin, 0.0, 0.0, cos, 0.001 * x, 0.002 * x, -0.003 * x];
        let numbers: Vec<String> = numbers.iter().map(f64::to_string).collect();
        format!("B{row},\"X, {}\",{}\n", row % 7, numbers.join(","))
    };
    header.to_owned() + &(0..10).map(row).collect::<String>()
}

#[test]
fn so_are_those_of_rows_whose_cells_lie_in_several_parts() {
    let workspace = Workspace::new(ROWS_IN_CELLS);
    fs::write(workspace.path("bodies.csv"), rows()).expect("written");
    done(&workspace, 2, &["run", "study.toml", "--out", "whole", "--quiet", "--engine", "cpu"]);
    let whole = tables(&workspace, "whole");
    let names: Vec<&str> = whole.keys().map(String::as_str).collect();
    assert_eq!(names, ["cells.csv", "final.csv", "initial.csv", "plan.json"]);
    // Pieces of one body: most begin within a row, as most parts do.
    leave_the_bytes_of(&whole, &workspace, "1e-9");
    for cut in [(7, 2), (30, 1)] {
        let parts = merged(&workspace, "cpu", cut);
        assert_eq!(parts.keys().collect::<Vec<_>>(), whole.keys().collect::<Vec<_>>(), "{cut:?}");
        for (name, bytes) in &whole {
            assert!(parts[name] == *bytes, "{name} of {} parts differs", cut.0);
        }
    }
    workspace.done(&["replay", "whole", "--body", "16", "--engine", "cpu", "--json"]);
}

#[test]
fn a_part_of_a_part_that_begins_within_a_row_has_the_rows_of_the_whole() {
    let workspace = Workspace::new(ROWS_IN_CELLS);
    fs::write(workspace.path("bodies.csv"), rows()).expect("written");
    let study = polhode::study::Study::read(&workspace.path("study.toml")).expect("a study");
    let whole = study.scene().expect("a scene");
    for bodies in [0..1, 2..4, 4..5, 4..13, 28..29] {
        let part = study.clone().part(1..30).part(bodies.clone()).scene().expect("a scene");
        for body in bodies.clone() {
            let (own, of_whole) = (body - bodies.start, body + 1);
            assert_eq!(
                part.ensemble().orientation()[own],
                whole.ensemble().orientation()[of_whole],
                "{bodies:?}: {body}"
            );
            let of = |scene: &polhode::Scene, body: usize| {
                let torque =
                    scene.torques()[1].parameter("torque").and_then(|torque| torque.as_vector()).expect("a vector");
                let k = scene.torques()[2].parameter("k").and_then(|k| k.as_number()).expect("a number");
                (torque.at(body), k.at(body), scene.ensemble().translation().expect("masses").mass[body])
            };
            assert_eq!(of(&part, own), of(&whole, of_whole), "{bodies:?}: {body}");
        }
    }
}

#[test]
fn so_are_statistics_alone() {
    compare(STATISTICS, "cpu", &CUTS[2..], &["plan.json", "statistics.csv"]);
}

#[test]
fn so_are_those_of_a_gpu() {
    for study in
        [STATISTICS.to_owned(), STATISTICS.replace("tolerance = 1e-8", "dt = 0.0625"), PINNED.replace("npz", "csv")]
    {
        let statistics_alone = study.contains("final = false");
        let all = ["failed.csv", "final.csv", "plan.json", "snapshots.csv", "statistics.csv"];
        let names = if statistics_alone { &["plan.json", "statistics.csv"][..] } else { &all };
        compare(&study, "gpu", &[(3, 2)], names);
    }
}

#[test]
fn parts_that_are_missing_foreign_or_altered_are_refused_by_name() {
    let workspace = Workspace::new(STATISTICS);
    workspace.done(&["plan", "study.toml", "--out", "plan.json", "--quiet", "--engine", "cpu"]);
    let run = |shard: &str| {
        let run = [
            "run",
            "study.toml",
            "--plan",
            "plan.json",
            "--shard",
            shard,
            "--out",
            "parts",
            "--quiet",
            "--engine",
            "cpu",
        ];
        workspace.done(&run);
    };
    let refused = |word: &str| {
        let error = workspace.refused(&["merge", "parts", "--out", "out"], 2);
        assert!(error.contains(word), "{error}");
        assert!(!workspace.path("out").exists());
    };
    refused("parts");
    ["1/5", "3/5"].into_iter().for_each(run);
    refused("expected 5 complete parts: run 2,4-5 (again)");
    let status = workspace.polhode(&["status", "parts", "--due"]);
    assert_eq!((status.status.code(), words(&status.stdout)), (Some(1), "2,4-5\n".to_owned()));
    let shown = words(&workspace.polhode(&["status", "parts"]).stdout);
    assert!(shown.starts_with("2 of 5 parts are complete\n  missing     2,4-5\n"), "{shown}");

    // A part whose run fails leaves word, and is run again alone.
    let study = fs::read_to_string(workspace.path("study.toml")).expect("a study");
    fs::write(workspace.path("study.toml"), study.replace("high = 0.1", "high = 0.2")).expect("written");
    let shard = ["run", "study.toml", "--plan", "plan.json", "--shard", "2/5", "--out", "parts", "--engine", "cpu"];
    let error = workspace.refused(&shard, 2);
    assert!(error.contains("the fingerprint of bodies and their parameters"), "{error}");
    let shown = words(&workspace.polhode(&["status", "parts"]).stdout);
    assert!(shown.contains("failed      2\n    part 2: plan.json: the fingerprint"), "{shown}");
    fs::write(workspace.path("study.toml"), &study).expect("written");
    ["2/5", "4/5", "5/5"].into_iter().for_each(run);
    let shown = workspace.done(&["status", "parts"]);
    assert_eq!(shown, "5 of 5 parts are complete\n");
    // One that is there is left as it is.
    let again = workspace.polhode(&shard);
    assert!(again.status.success() && words(&again.stderr).contains("part 2/5 is complete already"));

    // Altered, of another plan, of another output, of another cut.
    let table = workspace.path("parts/shard-2-of-5/blocks.jsonl");
    let text = fs::read_to_string(&table).expect("a file");
    fs::write(&table, text.replacen('1', "2", 1)).expect("written");
    refused("blocks.jsonl: it is not as its run wrote it");
    // What is no longer as long as it was is due again.
    fs::write(&table, format!("{text}\n")).expect("written");
    let status = workspace.polhode(&["status", "parts", "--due"]);
    assert_eq!((status.status.code(), words(&status.stdout)), (Some(1), "2\n".to_owned()));
    let shown = words(&workspace.polhode(&["status", "parts"]).stdout);
    assert!(
        shown.contains("failed      2\n    part 2: ") && shown.contains("run the part again with --force"),
        "{shown}"
    );
    fs::write(&table, text).expect("written");
    workspace.done(&["merge", "parts", "--out", "out", "--quiet"]);
    fs::remove_dir_all(workspace.path("out")).expect("removed");
    let rerun = |plan: &str, word: &str| {
        let run = [
            "run",
            "study.toml",
            "--plan",
            plan,
            "--shard",
            "2/5",
            "--out",
            "parts",
            "--quiet",
            "--force",
            "--engine",
            "cpu",
        ];
        workspace.done(&run);
        refused(word);
    };
    fs::write(workspace.path("study.toml"), study.replace("[output]", "[output]\nsnapshots = true")).expect("written");
    rerun("plan.json", "[output] differ");
    fs::write(workspace.path("study.toml"), study.replace("1e-8", "1e-9")).expect("written");
    workspace.done(&["plan", "study.toml", "--out", "finer.json", "--quiet", "--engine", "cpu"]);
    rerun("finer.json", "its plan is not that of part 1/5");
    fs::create_dir(workspace.path("parts/shard-1-of-4")).expect("made");
    refused("expected parts of one cut: there are parts of 4, of 5");
}

#[test]
fn parts_of_another_plan_or_study_are_not_complete_and_are_run_again() {
    let workspace = Workspace::new(STATISTICS);
    workspace.done(&["plan", "study.toml", "--out", "plan.json", "--quiet", "--engine", "cpu"]);
    let changed = STATISTICS.replace("[output]", "[output]\ninitial = true");
    fs::write(workspace.path("changed.toml"), changed).expect("written");
    let run = |study: &str, plan: &str, shard: &str, more: &[&str]| {
        let run = ["run", study, "--plan", plan, "--shard", shard, "--out", "parts", "--quiet", "--engine", "cpu"];
        workspace.polhode(&[&run[..], more].concat())
    };
    let done = |study: &str, plan: &str, shard: &str, more: &[&str]| {
        let output = run(study, plan, shard, more);
        assert!(output.status.success(), "{}", words(&output.stderr));
    };
    let due = |more: &[&str]| {
        let status = workspace.polhode(&[&["status", "parts", "--due"], more].concat());
        (status.status.code(), words(&status.stdout).trim_end().to_owned())
    };
    let are_due = |parts: &str| (Some(1), parts.to_owned());
    let none_is = (Some(0), String::new());
    ["1/3", "2/3"].into_iter().for_each(|shard| done("study.toml", "plan.json", shard, &[]));
    // Parts that fit each other may all be those of another study.
    assert_eq!((due(&[]), due(&["--study", "study.toml"])), (are_due("3"), are_due("3")));
    assert_eq!(due(&["--study", "changed.toml"]), are_due("1-3"));

    // The changed study has the same plan.
    done("changed.toml", "plan.json", "3/3", &[]);
    assert_eq!(due(&[]), are_due("1-2"));
    assert_eq!(due(&["--study", "study.toml", "--plan", "plan.json"]), are_due("3"));
    let shown = words(&workspace.polhode(&["status", "parts"]).stdout);
    let reason = "it does not belong to part 3, which was written last: output.initial differs\n";
    assert!(shown.starts_with("1 of 3 parts are complete\n  foreign     1-2\n    part 1: "), "{shown}");
    assert!(shown.contains(reason) && shown.contains("  run again   1-2; foreign ones with --force"), "{shown}");
    let json: serde_json::Value =
        serde_json::from_slice(&workspace.polhode(&["status", "parts", "--json"]).stdout).expect("JSON");
    assert_eq!((&json["foreign"], &json["complete"]), (&serde_json::json!([1, 2]), &serde_json::json!([3])));
    let error = workspace.refused(&["merge", "parts", "--out", "out"], 2);
    assert!(error.contains("its study is not that of part 1/3: output.initial differs"), "{error}");
    // Such a part is not taken for the one that is asked for, nor replaced unasked.
    let refused = run("changed.toml", "plan.json", "1/3", &[]);
    assert!(words(&refused.stderr).contains("not empty") && refused.status.code() == Some(2));
    ["1/3", "2/3"].into_iter().for_each(|shard| done("changed.toml", "plan.json", shard, &["--force"]));
    assert_eq!((due(&[]), due(&["--study", "study.toml"])), (none_is.clone(), are_due("1-3")));
    workspace.done(&["merge", "parts", "--out", "out", "--quiet"]);

    // Another plan.
    let finer = STATISTICS.replace("1e-8", "1e-9");
    fs::write(workspace.path("finer.toml"), finer).expect("written");
    workspace.done(&["plan", "finer.toml", "--out", "finer.json", "--quiet", "--engine", "cpu"]);
    done("finer.toml", "finer.json", "2/3", &["--force"]);
    assert_eq!((due(&[]), due(&["--plan", "plan.json"])), (are_due("1,3"), are_due("2")));
    let shown = words(&workspace.polhode(&["status", "parts", "--plan", "plan.json"]).stdout);
    assert!(shown.contains("  foreign     2\n    part 2: it follows another plan\n"), "{shown}");
    done("changed.toml", "plan.json", "2/3", &["--force"]);
    assert_eq!(due(&["--plan", "plan.json", "--study", "changed.toml"]), none_is);
}

#[test]
fn arguments_of_parts_that_make_no_sense_get_one_line() {
    let workspace = Workspace::new(&STATISTICS.replace("count = 900", "count = 10"));
    workspace.done(&["plan", "study.toml", "--out", "plan.json", "--quiet", "--engine", "cpu"]);
    let shard = |shard: &str, word: &str| {
        let error =
            workspace.refused(&["run", "study.toml", "--plan", "plan.json", "--shard", shard, "--engine", "cpu"], 2);
        assert!(error.contains(word), "{error}");
    };
    shard("3/64", "--shard 3/64: expected up to 10 parts of the study's 10 bodies");
    shard("0/4", "expected INDEX/COUNT");
    shard("auto", "no launcher says which part this is");
    assert!(!workspace.path("study.out").exists(), "nothing is left");
    let error = workspace.refused(&["run", "study.toml", "--shard", "1/2"], 2);
    assert!(error.contains("--plan"), "{error}");
    let output = Command::new(cargo_bin!("polhode"))
        .current_dir(workspace.folder())
        .env("SLURM_ARRAY_TASK_ID", "2")
        .args([
            "run",
            "study.toml",
            "--plan",
            "plan.json",
            "--shard",
            "auto/3",
            "--out",
            "parts",
            "--quiet",
            "--engine",
            "cpu",
        ])
        .output()
        .expect("the command starts");
    assert!(output.status.success() && words(&output.stderr).contains("part 2/3 (Slurm array, SLURM_ARRAY_TASK_ID=2)"));
    assert_eq!(workspace.names("parts"), ["shard-2-of-3"]);
}
