//! The command as a user meets it: files in, files out, exit status, one line where something is wrong.

#![cfg(feature = "cli")]

use std::fs;
use std::path::Path;
use std::process::Command;

use assert_cmd::cargo::cargo_bin;
use polhode::study::Format;
use polhode::{Method, Quantity};

use crate::workspace;

use workspace::{States, Workspace, report, words};

/// A study with ten asymmetric bodies that takes no time to speak of.
pub const SMALL: &str = r#"
title = "Ten"
seed = 5
[bodies]
count = 10
inertia = { shape = "box", mass = 3.0, edges = [1.0, 2.0, 3.0] }
orientation = { distribution = "uniform" }
angular_velocity = { distribution = "normal", mean = 0, sigma = 1 }
[time]
end = 4.0
outputs = { times = [0.0, 0.1, 1.0] }
[accuracy]
method = "rk4"
dt = 0.015625
[output]
snapshots = true
"#;

// --- results ---

#[test]
fn a_run_writes_what_the_study_asks_for_and_says_so() {
    let workspace = Workspace::new(SMALL);
    let summary = workspace.done(&["run", "study.toml", "--engine", "cpu"]);
    assert!(summary.starts_with("Ten\n"), "{summary}");
    assert!(summary.contains("final.csv, snapshots.csv, plan.json, report.json in study.out"), "{summary}");
    assert_eq!(workspace.names("study.out"), ["final.csv", "plan.json", "report.json", "snapshots.csv"]);

    let states = States::read(&workspace.path("study.out/snapshots.csv"));
    assert_eq!(states.rows(), 40);
    let times: Vec<f64> = states.of_body(3).into_iter().map(|row| states.column("t")[row]).collect();
    assert_eq!(times, [0.0, 0.1, 1.0, 4.0], "output times are hit exactly, and the end is among them");
    for row in 0..states.rows() {
        assert!((states.orientation(row).length() - 1.0).abs() < 4.0 * f64::EPSILON, "row {row}");
    }

    let report = report(&workspace, "study.out");
    assert_eq!(report["bodies"], 10);
    assert_eq!(report["engine"]["kind"], "cpu");
    assert_eq!(report["plan"]["method"], "rk4");
    assert_eq!(report["plan"]["precision"], "f64");
    assert_eq!(report["study"]["seed"], 5);
    assert_eq!(report["failed_bodies"], serde_json::json!([]));
    assert!(report["drift"]["kinetic_energy"]["max"].as_f64().expect("a number") < 1e-8, "{report}");
    assert!(report["body_steps"].as_u64().expect("a number") >= 2560, "{report}");
}

#[test]
fn a_fallback_changes_nothing_where_nothing_fails() {
    let workspace = Workspace::new(SMALL);
    let table = |engine: &str, fallback: &str| {
        let out = format!("{engine}-{fallback}");
        workspace.done(&["run", "study.toml", "--engine", engine, "--fallback", fallback, "--quiet", "--out", &out]);
        assert!(report(&workspace, &out).get("fallback").is_none(), "{engine}");
        fs::read(workspace.path(&format!("{out}/snapshots.csv"))).expect("a table")
    };
    for engine in ["cpu", "gpu"] {
        assert!(table(engine, "cpu") == table(engine, "none"), "{engine}");
    }
    let words = workspace.refused(&["run", "study.toml", "--fallback", "gpu"], 2);
    assert!(words.contains("--fallback") && words.contains("none, cpu"), "{words}");
}

#[test]
fn numbers_read_back_to_the_same_bits_from_both_formats() {
    let workspace = Workspace::new(SMALL);
    workspace.done(&["run", "study.toml", "--engine", "cpu", "--quiet", "--out", "text"]);
    fs::write(workspace.path("study.toml"), format!("{SMALL}format = \"npz\"\n")).unwrap();
    workspace.done(&["run", "study.toml", "--engine", "cpu", "--quiet", "--out", "binary"]);

    for (stem, outputs) in [("final", None), ("snapshots", Some(4))] {
        let states = States::read(&workspace.path(&format!("text/{stem}.csv")));
        let file = fs::File::open(workspace.path(&format!("binary/{stem}.npz"))).unwrap();
        let mut archive = zip::ZipArchive::new(file).expect("a ZIP archive");
        assert_eq!(archive.len(), states.columns.len(), "{stem}");
        for index in 0..archive.len() {
            // Reading an entry to its end checks its checksum.
            let mut entry = archive.by_index(index).expect("an entry");
            let name = entry.name().expect("a name").strip_suffix(".npy").expect("an array").to_owned();
            let mut bytes = Vec::new();
            std::io::Read::read_to_end(&mut entry, &mut bytes).expect("a checksum that fits");
            let array = npyz::NpyFile::new(&bytes[..]).expect("an array");
            let shape = array.shape().to_vec();
            let text = states.column(&name);
            match name.as_str() {
                "body" => {
                    assert_eq!(shape, [10]);
                    assert_eq!(array.into_vec::<u64>().unwrap(), (0..10).collect::<Vec<u64>>());
                }
                "t" => {
                    assert_eq!(shape, outputs.map(|count| vec![count]).unwrap_or_default());
                    let times = array.into_vec::<f64>().unwrap();
                    assert_eq!(times, text.iter().copied().step_by(10).collect::<Vec<_>>());
                }
                "status" => {
                    assert_eq!(shape, outputs.map(|count| vec![count, 10]).unwrap_or(vec![10]));
                    assert!(array.into_vec::<u8>().unwrap().iter().all(|status| *status == 0), "{stem}");
                    assert!(text.iter().all(|status| *status == 0.0), "{stem}");
                }
                _ => {
                    assert_eq!(shape, outputs.map(|count| vec![count, 10]).unwrap_or(vec![10]));
                    let bits = |numbers: &[f64]| numbers.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
                    assert_eq!(bits(&array.into_vec::<f64>().unwrap()), bits(text), "{stem}, column {name}");
                }
            }
        }
    }
}

#[test]
fn statistics_read_back_to_the_same_bits_from_both_formats() {
    let study = SMALL.replace("snapshots = true", "final = false\nstatistics = [\"spin_rate\", \"kinetic_energy\"]");
    let workspace = Workspace::new(&study);
    let summary = workspace.done(&["run", "study.toml", "--engine", "cpu", "--out", "text"]);
    assert!(summary.contains("  end      spin_rate: mean "), "{summary}");
    fs::write(workspace.path("study.toml"), format!("{study}format = \"npz\"\n")).unwrap();
    workspace.done(&["run", "study.toml", "--engine", "cpu", "--quiet", "--out", "binary"]);
    assert_eq!(workspace.names("binary"), ["plan.json", "report.json", "statistics.npz"]);

    let states = States::read(&workspace.path("text/statistics.csv"));
    let file = fs::File::open(workspace.path("binary/statistics.npz")).unwrap();
    let mut archive = zip::ZipArchive::new(file).expect("a ZIP archive");
    assert_eq!((archive.len(), states.columns.len()), (14, 14));
    for index in 0..archive.len() {
        let mut entry = archive.by_index(index).expect("an entry");
        let name = entry.name().expect("a name").strip_suffix(".npy").expect("an array").to_owned();
        let mut bytes = Vec::new();
        std::io::Read::read_to_end(&mut entry, &mut bytes).expect("a checksum that fits");
        let array = npyz::NpyFile::new(&bytes[..]).expect("an array");
        assert_eq!(array.shape(), [4], "{name}");
        let numbers: Vec<f64> = if name == "count" {
            array.into_vec::<u64>().unwrap().into_iter().map(|count| count as f64).collect()
        } else if name.ends_with("_body") {
            array.into_vec::<i64>().unwrap().into_iter().map(|body| body as f64).collect()
        } else {
            array.into_vec::<f64>().unwrap()
        };
        let bits = |numbers: &[f64]| numbers.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&numbers), bits(states.column(&name)), "{name}");
    }
    let explained = workspace.done(&["explain", "study.toml", "--engine", "cpu"]);
    assert!(explained.contains("\nstates "), "{explained}");
}

#[test]
fn a_seed_gives_the_same_bytes_again_and_another_seed_other_bodies() {
    let workspace = Workspace::new(SMALL);
    for out in ["one", "two"] {
        workspace.done(&["run", "study.toml", "--engine", "cpu", "--quiet", "--out", out]);
    }
    for name in ["final.csv", "snapshots.csv"] {
        assert!(
            fs::read(workspace.path("one").join(name)).unwrap() == fs::read(workspace.path("two").join(name)).unwrap(),
            "{name}"
        );
    }
    fs::write(workspace.path("study.toml"), SMALL.replace("seed = 5", "seed = 6")).unwrap();
    workspace.done(&["run", "study.toml", "--engine", "cpu", "--quiet", "--out", "three"]);
    let (one, three) =
        (States::read(&workspace.path("one/final.csv")), States::read(&workspace.path("three/final.csv")));
    assert!((0..10).all(|row| one.orientation(row) != three.orientation(row)));
}

#[test]
fn a_smaller_study_holds_the_first_bodies_of_a_larger_one() {
    let workspace = Workspace::new(SMALL);
    workspace.done(&["run", "study.toml", "--engine", "cpu", "--quiet", "--out", "ten"]);
    fs::write(workspace.path("study.toml"), SMALL.replace("count = 10", "count = 3")).unwrap();
    workspace.done(&["run", "study.toml", "--engine", "cpu", "--quiet", "--out", "three"]);
    let (ten, three) =
        (fs::read_to_string(workspace.path("ten/final.csv")), fs::read_to_string(workspace.path("three/final.csv")));
    assert!(ten.unwrap().starts_with(&three.unwrap()));
}

/// Both engines run the same operations in f64; the CPU's lanes fuse multiply and add, the shader may. Steps differ by an
/// ulp or so each, which adds up over 256 steps, and neighbouring motions part linearly with time.
const ENGINES_AGREE: f64 = 256.0 * 8.0 * f64::EPSILON;

#[test]
fn cpu_and_gpu_give_the_same_states_and_each_the_same_bytes_again() {
    let workspace = Workspace::new(SMALL);
    for (out, engine) in [("cpu", "cpu"), ("gpu", "gpu"), ("gpu again", "gpu")] {
        workspace.done(&["run", "study.toml", "--engine", engine, "--precision", "f64", "--quiet", "--out", out]);
    }
    assert_eq!(report(&workspace, "gpu")["engine"]["kind"], "gpu");
    let bytes = |folder: &str| fs::read(workspace.path(folder).join("snapshots.csv")).unwrap();
    assert!(bytes("gpu") == bytes("gpu again"));
    let (cpu, gpu) = (States::read(&workspace.path("cpu/final.csv")), States::read(&workspace.path("gpu/final.csv")));
    for row in 0..10 {
        let (a, b) = (cpu.orientation(row), gpu.orientation(row));
        let error = 2.0 * (a.conjugate() * b).xyz().length().asin();
        assert!(error < ENGINES_AGREE, "body {row}: attitudes differ by {error:e} rad");
        let (a, b) = (cpu.vector(["wx", "wy", "wz"], row), gpu.vector(["wx", "wy", "wz"], row));
        assert!((a - b).length() < ENGINES_AGREE * a.length(), "body {row}: {a} and {b}");
    }
}

// --- bodies that fail ---

/// Drag so strong that no step of a second follows it.
const FAILING: &str = r#"
[bodies]
count = 4
inertia = [1.0, 2.0, 2.5]
angular_velocity = [0.3, 1.0, 0.2]
[[torque]]
model = "quadratic-drag"
coefficient = 1e6
[time]
end = 20.0
[accuracy]
method = "rk4"
dt = 1.0
"#;

#[test]
fn a_run_with_failed_bodies_says_so_first_and_has_failed() {
    let workspace = Workspace::new(FAILING);
    let output = workspace.polhode(&["run", "study.toml", "--engine", "cpu"]);
    assert_eq!(output.status.code(), Some(1), "{}", words(&output.stderr));
    assert!(words(&output.stderr).contains("4 of 4 bodies have failed"), "{}", words(&output.stderr));
    let summary = words(&output.stdout);
    assert!(summary.lines().nth(1).is_some_and(|line| line.contains("FAILED   4 of 4 bodies")), "{summary}");
    let report = report(&workspace, "study.out");
    assert_eq!(report["failed_bodies"], serde_json::json!([0, 1, 2, 3]));
    assert_eq!((&report["accuracy"]["bodies"], &report["accuracy"]["lost"]), (&0.into(), &4.into()));
}

#[test]
fn a_study_may_allow_as_many_failures_as_there_are_and_no_fewer() {
    for (allowed, status) in [(4, 0), (3, 1)] {
        let workspace = Workspace::new(&format!("{FAILING}[failures]\nallow = {allowed}\n"));
        let output = workspace.polhode(&["run", "study.toml", "--engine", "cpu"]);
        assert_eq!(output.status.code(), Some(status), "{allowed} allowed: {}", words(&output.stderr));
    }
    let workspace = Workspace::new(&format!("{FAILING}[failures]\nallow = -1\n"));
    let refusal = workspace.refused(&["run", "study.toml", "--engine", "cpu"], 2);
    assert!(refusal.contains("failures.allow") && refusal.contains("may fail"), "{refusal}");
}

// --- refusals and failures ---

#[test]
fn wrong_input_is_one_line_and_status_2() {
    let workspace = Workspace::new(&SMALL.replace("count = 10", "cuont = 10"));
    let line = workspace.refused(&["run", "study.toml"], 2);
    assert_eq!(
        line,
        "error: study.toml:5: bodies.cuont is not known: did you mean count? known here: count, file, carry, inertia, \
         repair_triangle_inequality, orientation, angular_velocity, mass, position, velocity\n"
    );
    assert_eq!(workspace.names("."), ["study.toml"], "nothing was made");
    workspace.refused(&["run", "absent.toml"], 2);
    workspace.refused(&["verify", "absent.toml"], 2);
    let line = workspace.refused(&["verfy"], 2);
    assert_eq!(line, "error: unrecognized subcommand 'verfy' tip: a similar subcommand exists: 'verify'\n");
    workspace.refused(&["run"], 2);
    workspace.refused(&[], 2);
    workspace.refused(&["run", "study.toml", "--engine", "abacus"], 2);
    workspace.refused(&["run", "study.toml", "--engine", "cpu", "--adapter", "0"], 2);
    workspace.refused(&["verify", "--seed", "-1"], 2);
}

#[test]
fn an_adapter_that_is_not_there_is_wrong_input() {
    let workspace = Workspace::new(SMALL);
    let line = workspace.refused(&["run", "study.toml", "--adapter", "99"], 2);
    assert!(line.contains("with index 99") && line.contains("polhode devices"), "{line}");
    assert_eq!(workspace.names("."), ["study.toml"], "nothing was made");
}

#[test]
fn results_are_replaced_only_by_force_and_then_all_of_them() {
    let workspace = Workspace::new(SMALL);
    workspace.done(&["run", "study.toml", "--engine", "cpu", "--quiet"]);
    let line = workspace.refused(&["run", "study.toml", "--engine", "cpu"], 2);
    assert_eq!(
        line,
        "error: study.out: the output folder is not empty: name another with --out, or replace its results with --force\n"
    );
    fs::write(workspace.path("study.out/notes.txt"), "mine").unwrap();
    fs::write(workspace.path("study.toml"), SMALL.replace("snapshots = true", "snapshots = false")).unwrap();
    workspace.done(&["run", "study.toml", "--engine", "cpu", "--quiet", "--force"]);
    // The snapshots belonged to the former run.
    assert_eq!(workspace.names("study.out"), ["final.csv", "notes.txt", "plan.json", "report.json"]);
}

#[test]
fn quiet_is_quiet_and_json_is_the_report() {
    let workspace = Workspace::new(SMALL);
    assert_eq!(workspace.done(&["run", "study.toml", "--engine", "cpu", "--quiet"]), "");
    let text = workspace.done(&["run", "study.toml", "--engine", "cpu", "--json", "--force"]);
    let value: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!(value, report(&workspace, "study.out"));
}

#[cfg(unix)]
#[test]
fn a_disk_that_is_full_is_a_failure_that_leaves_nothing() {
    // A limit on the size of files stands for a disk that fills up: the write fails half-way in the same place.
    let workspace = Workspace::new(&SMALL.replace("count = 10", "count = 10_000"));
    let script =
        format!("trap '' XFSZ; ulimit -f 64; exec '{}' run study.toml --engine cpu", cargo_bin!("polhode").display());
    let output =
        Command::new("bash").current_dir(workspace.folder()).args(["-c", &script]).output().expect("bash starts");
    let errors = words(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{errors}");
    assert_eq!(errors, "error: study.out/snapshots.csv: cannot be written: File too large (os error 27)\n");
    assert_eq!(workspace.names("."), ["study.toml"], "nothing is left");
}

#[test]
fn a_full_disk_says_what_to_do() {
    let error = std::io::Error::from(std::io::ErrorKind::StorageFull);
    let error = polhode::Error::file(Path::new("out/final.csv"), polhode::error::FileAction::Write, &error);
    assert_eq!(
        error.to_string(),
        "out/final.csv: cannot be written: no storage space; free some space, or write fewer snapshots"
    );
    assert!(!error.is_input());
}

// --- the other commands ---

#[test]
fn verify_agrees_on_generated_bodies_and_on_a_study() {
    let workspace = Workspace::new(SMALL);
    for arguments in [
        &["verify", "--bodies", "65", "--steps", "20"] as &[&str],
        &["verify", "--bodies", "65", "--steps", "20", "--precision", "f64", "--seed", "9"],
        &["verify", "study.toml", "--steps", "20"],
        &["verify", "study.toml", "--bodies", "4", "--steps", "20", "--engine", "cpu"],
    ] {
        let text = workspace.done(arguments);
        assert!(text.contains("verdict: they agree"), "{arguments:?}: {text}");
    }
    let text = workspace.done(&["verify", "--bodies", "7", "--steps", "3", "--json"]);
    let value: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!(value["agrees"], true);
    assert_eq!(value["bodies"], 7);
}

#[test]
fn devices_lists_the_cpu_and_what_auto_takes() {
    let workspace = Workspace::new("");
    let text = workspace.done(&["devices"]);
    assert!(text.contains("cpu ") && text.contains("--engine auto takes:"), "{text}");
    let value: serde_json::Value = serde_json::from_str(&workspace.done(&["devices", "--json"])).expect("JSON");
    assert!(value["adapters"].is_array() && value["cpu"].is_string() && value["device_cache"].is_null(), "{value}");
    assert!(workspace.done(&["devices", "--device-cache", "here"]).ends_with("\n--device-cache: here\n"));
}

#[test]
fn what_is_kept_of_devices_is_named_and_cleared() {
    let workspace = Workspace::new(SMALL);
    let kept = || workspace.names("cache");
    workspace.done(&["run", "study.toml", "--engine", "gpu", "--quiet", "--device-cache", "cache"]);
    assert_eq!(kept().len(), 1, "{:?}", kept());
    let report = report(&workspace, "study.out");
    assert_eq!(report["pipelines"].as_u64(), Some(1), "{report}");
    let cleared = workspace.done(&["devices", "--clear-cache", "--device-cache", "cache"]);
    assert!(cleared.starts_with("removed 1 file of ") && cleared.ends_with(" bytes from cache\n"), "{cleared}");
    assert!(kept().is_empty(), "{:?}", kept());
    let nothing = workspace.done(&["devices", "--clear-cache", "--device-cache", "none"]);
    assert_eq!(nothing, "there is no device cache\n");
    // As the variable says here, beside which an argument counts.
    workspace.done(&["run", "study.toml", "--engine", "gpu", "--quiet", "--force"]);
    assert!(kept().is_empty() && !workspace.path("none").exists());
    // A folder that cannot be made is said, and keeps nothing.
    let output =
        workspace.polhode(&["run", "study.toml", "--engine", "gpu", "--force", "--device-cache", "study.toml"]);
    assert_eq!(output.status.code(), Some(0), "{}", words(&output.stderr));
    let warning = "warning: nothing is kept in --device-cache study.toml: ";
    assert!(words(&output.stderr).contains(warning), "{}", words(&output.stderr));
}

#[test]
fn help_teaches_with_a_study_and_examples() {
    let workspace = Workspace::new("");
    assert!(workspace.done(&["--help"]).contains("polhode run examples/studies/tumbling.toml"));
    let help = workspace.done(&["run", "--help"]);
    for part in ["[bodies]", "--precision", "polhode run study.toml --out results --force", "report.json"] {
        assert!(help.contains(part), "{part} is missing in {help}");
    }
    assert!(workspace.done(&["verify", "--help"]).contains("polhode verify --bodies 4097"));
    assert!(workspace.done(&["--version"]).starts_with("polhode "));
}

/// These lists are written by hand, in `src/bin/polhode/arguments.rs` and `docs/questions.md`.
#[test]
fn the_help_names_every_method_quantity_and_format_and_the_docs_every_quantity() {
    fn words_of(text: &str) -> Vec<&str> {
        text.split(|c: char| !c.is_ascii_alphanumeric() && c != '_').collect()
    }
    let help = Workspace::new("").done(&["run", "--help"]);
    let (help, docs) = (words_of(&help), words_of(include_str!("../../docs/questions.md")));
    let methods = Method::ALL.into_iter().chain(Method::ADAPTIVE).map(Method::name);
    for name in methods.chain(Format::ALL.iter().map(|format| format.name())) {
        assert!(help.contains(&name), "{name} is missing in the help");
    }
    for quantity in Quantity::NAMED {
        // Components may be listed as `_x`, `_y`, `_z` of one.
        let of_vector = ["_x", "_y", "_z"].iter().find_map(|axis| quantity.name().strip_suffix(axis));
        for (place, words) in [("the help", &help), ("docs/questions.md", &docs)] {
            let is_named = |name: &str| words.contains(&name);
            assert!(is_named(quantity.name()) || of_vector.is_some_and(is_named), "{quantity} is missing in {place}");
        }
    }
}

/// The study that `polhode run --help` shows must run.
#[test]
fn the_study_in_the_help_runs() {
    let help = Workspace::new("").done(&["run", "--help"]);
    let lines = help.lines().skip_while(|line| !line.contains("seed = 42")).take_while(|line| !line.is_empty());
    let study: String = lines.flat_map(|line| [line.trim_start(), "\n"]).collect();
    let workspace = Workspace::new(&study);
    workspace.done(&["run", "study.toml", "--engine", "cpu"]);
    assert_eq!(workspace.names("study.out"), ["final.csv", "plan.json", "report.json", "snapshots.csv"]);
    // Nor of bodies of a run that has left their states at the end alone.
    fs::remove_file(workspace.path("study.out/snapshots.csv")).unwrap();
    let line = workspace.refused(&["plot", "study.out", "--body", "99"], 2);
    assert_eq!(
        line,
        "error: study.out: bodies are drawn from snapshots, and there are none: set `snapshots = true` in the study\n"
    );
    assert_eq!(workspace.names("study.out"), ["final.csv", "plan.json", "report.json"]);
}

#[test]
fn completions_and_the_manual_page_come_from_the_grammar() {
    let workspace = Workspace::new("");
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        assert!(workspace.done(&["completions", shell]).contains("precision"), "{shell}");
    }
    let page = workspace.done(&["man"]);
    assert!(page.contains(".TH polhode") && page.contains("polhode\\-run") && page.contains("STUDY.toml"), "{page}");
}

#[test]
fn versions_in_reports_are_those_of_the_lock_file() {
    let lock = fs::read_to_string(format!("{}/Cargo.lock", env!("CARGO_MANIFEST_DIR"))).unwrap();
    let expected = format!("name = \"wgpu\"\nversion = \"{}\"", polhode::record::report::WGPU_VERSION);
    assert!(lock.contains(&expected), "{expected}");
}

// --- standard output ---

/// A body that can be described without a study.
const SPHERE: &str = "inertia = { shape = \"sphere\", mass = 10.0, radius = 1.0 }\n";

/// Every command that prints, with a study (`study.toml`), a body (`sphere.toml`) and a former run (`done`).
const PRINTING: [&[&str]; 14] = [
    &["run", "study.toml", "--engine", "cpu"],
    &["run", "study.toml", "--engine", "cpu", "--json"],
    &["explain", "study.toml", "--engine", "cpu"],
    &["explain", "study.toml", "--engine", "cpu", "--json"],
    &["verify", "--bodies", "3", "--steps", "2", "--engine", "cpu"],
    &["inertia", "sphere.toml"],
    &["inertia", "sphere.toml", "--json"],
    &["devices"],
    &["devices", "--json"],
    &["--version"],
    &["plot", "done"],
    &["completions", "bash"],
    &["man"],
    &["run", "--help"],
];

fn printing_desk() -> Workspace {
    let workspace = Workspace::new(SMALL);
    fs::write(workspace.path("sphere.toml"), SPHERE).unwrap();
    workspace.done(&["run", "study.toml", "--engine", "cpu", "--quiet", "--out", "done"]);
    workspace
}

#[cfg(target_os = "linux")]
#[test]
fn standard_output_that_cannot_be_written_is_a_failure_of_every_command() {
    let workspace = printing_desk();
    for arguments in PRINTING {
        let full = fs::File::options().write(true).open("/dev/full").expect("a device that is always full");
        let run =
            Command::new(cargo_bin!("polhode")).current_dir(workspace.folder()).args(arguments).stdout(full).output();
        let output = run.expect("the command starts");
        let errors = words(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {errors}");
        assert_eq!(
            errors, "error: standard output cannot be written: No space left on device (os error 28)\n",
            "{arguments:?}"
        );
        let _ = fs::remove_dir_all(workspace.path("study.out"));
    }
}

#[cfg(unix)]
#[test]
fn a_reader_that_goes_away_is_no_error() {
    let workspace = printing_desk();
    for arguments in PRINTING {
        let mut command = Command::new(cargo_bin!("polhode"));
        let (reader, writer) = std::io::pipe().expect("a pipe");
        drop(reader);
        let output =
            command.current_dir(workspace.folder()).args(arguments).stdout(writer).output().expect("it starts");
        assert_eq!((output.status.code(), words(&output.stderr)), (Some(0), String::new()), "{arguments:?}");
        let _ = fs::remove_dir_all(workspace.path("study.out"));
    }
}

#[test]
fn words_from_files_have_no_power_over_the_terminal() {
    let workspace = Workspace::new(&SMALL.replace("\"Ten\"", "\"\\u001b[2Jcleared\\n  failed   none\""));
    let summary = workspace.done(&["run", "study.toml", "--engine", "cpu"]);
    assert!(summary.starts_with(" [2Jcleared   failed   none\n"), "{summary:?}");
    fs::write(workspace.path("study.toml"), SMALL.replace("count", "\"co\\u001b[2J\\nunt\"")).unwrap();
    let line = workspace.refused(&["explain", "study.toml"], 2);
    assert!(line.contains("bodies.co [2J unt is not known"), "{line:?}");
    fs::write(workspace.path("table.csv"), "ixx,iyy,izz,wx,wy,wz\n1,2,\u{1b}[2J,0,0,1\n").unwrap();
    fs::write(workspace.path("study.toml"), "[bodies]\nfile = \"table.csv\"\n[time]\nend = 1.0\n").unwrap();
    let line = workspace.refused(&["run", "study.toml", "--engine", "cpu"], 2);
    assert!(line.contains("izz =  [2J: expected a finite number"), "{line:?}");
    fs::write(workspace.path("a\nb.toml"), SPHERE).unwrap();
    assert!(workspace.done(&["inertia", "a\nb.toml"]).starts_with("a b.toml\n"));
}

// --- pictures ---

#[test]
fn a_picture_of_a_body_that_is_not_there_is_refused() {
    let workspace = Workspace::new(SMALL);
    workspace.done(&["run", "study.toml", "--engine", "cpu", "--quiet"]);
    let line = workspace.refused(&["plot", "study.out", "--body", "3,99"], 2);
    assert_eq!(line, "error: study.out/snapshots.csv: there is no body 99: it has 10, counted from 0\n");
    // Neither are pictures drawn of a table that was cut.
    let whole = fs::read(workspace.path("study.out/snapshots.csv")).unwrap();
    // The newline, the status, its comma, and a part of the number before.
    for cut in [1, 2, 3, 8] {
        fs::write(workspace.path("study.out/snapshots.csv"), &whole[..whole.len() - cut]).unwrap();
        let line = workspace.refused(&["plot", "study.out"], 2);
        assert!(line.starts_with("error: study.out/snapshots.csv: line 41: ") && line.contains("may be cut"), "{line}");
    }
    assert_eq!(workspace.names("study.out"), ["final.csv", "plan.json", "report.json", "snapshots.csv"]);
}
