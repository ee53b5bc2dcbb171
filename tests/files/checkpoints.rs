//! Runs with checkpoints: however often one is stopped or killed, what comes out are the bytes of one that was not; what is foreign is
//! refused by name.

#![cfg(feature = "cli")]

use std::cell::Cell;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::ops::ControlFlow;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use assert_cmd::cargo::cargo_bin;
use polhode::record::OutputFolder;
use polhode::run::Checkpoint;
use polhode::study::{Format, Study};
use polhode::{Engine, Error, Plan};

use crate::in_parts::{OBSERVED, PINNED, STATISTICS, done, observed_names, tables};
use crate::workspace::{Workspace, words};

/// Kills of a study; `POLHODE_KILLS=100` by hand.
fn kills() -> u32 {
    std::env::var("POLHODE_KILLS").map_or(5, |count| count.parse().expect("POLHODE_KILLS is a number"))
}

/// A run with checkpoints in 2 folders, `whole` without and `out` with them; gives the tables of the former.
pub(crate) fn whole(workspace: &Workspace, engine: &str) -> BTreeMap<String, Vec<u8>> {
    done(workspace, 2, &["run", "study.toml", "--out", "whole", "--quiet", "--engine", engine]);
    tables(workspace, "whole")
}

pub(crate) fn assert_same(whole: &BTreeMap<String, Vec<u8>>, found: &BTreeMap<String, Vec<u8>>) {
    assert_eq!(found.keys().collect::<Vec<_>>(), whole.keys().collect::<Vec<_>>());
    for (name, bytes) in whole {
        assert!(found[name] == *bytes, "{name} differs");
    }
}

#[test]
fn a_run_in_pieces_leaves_the_bytes_of_one() {
    for format in ["csv", "parquet"] {
        let study =
            OBSERVED.replace("[output]", &format!("[checkpoint]\nevery = \"1 ms\"\n[output]\nformat = \"{format}\""));
        let workspace = Workspace::new(&study);
        let plain = Workspace::new(&OBSERVED.replace("[output]", &format!("[output]\nformat = \"{format}\"")));
        let whole = whole(&plain, "cpu");
        assert_eq!(whole.keys().cloned().collect::<Vec<_>>(), observed_names(format));
        done(&workspace, 2, &["run", "study.toml", "--out", "out", "--quiet", "--engine", "cpu"]);
        let found = tables(&workspace, "out");
        if format == "parquet" {
            // Their footers have the text of the study, which says how often it is written.
            assert_eq!(found.keys().collect::<Vec<_>>(), whole.keys().collect::<Vec<_>>());
        } else {
            assert_same(&whole, &found);
        }
        let report = crate::workspace::report(&workspace, "out");
        assert!(report["shards"].as_u64() > Some(3), "{}", report["shards"]);
        assert!(!workspace.path("out.checkpoint").exists(), "{:?}", workspace.names("out.checkpoint"));
        // In pieces of another size, on one thread.
        done(
            &workspace,
            1,
            &["run", "study.toml", "--out", "out", "--force", "--checkpoint", "0.012", "--quiet", "--engine", "cpu"],
        );
        assert_same(&tables(&workspace, "out"), &found);
    }
}

fn start(workspace: &Workspace, arguments: &[&str]) -> Child {
    let mut command = Command::new(cargo_bin!("polhode"));
    command.current_dir(workspace.folder()).args(arguments).stdout(Stdio::null()).stderr(Stdio::null());
    command.spawn().expect("the command starts")
}

/// Kills a run, or asks it to stop, or asks twice, in turn.
fn end(child: &mut Child, turn: u32) {
    for _ in 0..turn % 3 {
        // It may have ended by itself.
        let _ = Command::new("kill").args(["-INT", &child.id().to_string()]).stderr(Stdio::null()).status();
    }
    if turn.is_multiple_of(3) {
        child.kill().expect("a process");
    }
}

/// Kills runs of a study, with a checkpoint each `every` s, at moments that are spread over the time of one, and resumes them.
fn killed_and_resumed(study: &str, engine: &str, every: &str) {
    let workspace = Workspace::new(study);
    let whole = whole(&workspace, engine);
    let run = |resume: bool| {
        let mut run = vec!["run", "study.toml", "--out", "out", "--engine", engine, "--checkpoint", every, "--quiet"];
        run.extend(resume.then_some("--resume"));
        run
    };
    let clock = Instant::now();
    done(&workspace, 2, &run(false));
    let of_one = clock.elapsed();
    assert_same(&whole, &tables(&workspace, "out"));
    fs::remove_dir_all(workspace.path("out")).expect("removed");
    let (kills, mut in_the_middle) = (kills(), 0);
    let mut left = kills;
    while left > 0 {
        // A golden section, so that no moment comes twice.
        let part = (0.37 + f64::from(kills - left) * 0.618_033_988_749_895).fract();
        let mut child = start(&workspace, &run(true));
        std::thread::sleep(of_one.mul_f64(0.05 + part));
        end(&mut child, kills - left);
        let ended = child.wait().expect("it ends").success();
        left -= 1;
        in_the_middle += u32::from(!ended && workspace.path("out.checkpoint").is_dir());
        if workspace.path("out").exists() {
            // It had come to the end before the kill, or that came between two renames of the last moment.
            assert_same(&whole, &tables(&workspace, "out"));
            fs::remove_dir_all(workspace.path("out")).expect("removed");
        }
    }
    assert!(in_the_middle > 0, "no kill has met a run: the longest was {of_one:?}");
    let resumed = workspace.polhode(&run(true));
    assert!(resumed.status.success(), "{}", words(&resumed.stderr));
    assert_same(&whole, &tables(&workspace, "out"));
    let names = workspace.names("");
    assert_eq!(names, ["out", "study.toml", "whole"], "nothing else is left");
    // A kill while the pieces of a finished run are removed leaves some of them, and no plan.
    done(&workspace, 2, &[&run(false)[..], &["--force"]].concat());
    fs::create_dir_all(workspace.path("out.checkpoint/bodies-64-127")).expect("made");
    fs::write(workspace.path("out.checkpoint/plan.json.removed"), "{}").expect("written");
    fs::remove_dir_all(workspace.path("out")).expect("removed");
    done(&workspace, 2, &run(true));
    assert_same(&whole, &tables(&workspace, "out"));
    assert_eq!(workspace.names(""), ["out", "study.toml", "whole"], "nothing else is left");
}

#[test]
fn killed_runs_are_resumed_to_the_same_bytes() {
    killed_and_resumed(OBSERVED, "cpu", "0.02");
    killed_and_resumed(PINNED, "cpu", "0.002");
}

#[test]
fn so_are_those_under_sampled_torques() {
    killed_and_resumed(&crate::control::STUDY.replace("count = 500", "count = 60"), "cpu", "0.002");
}

#[test]
fn so_are_those_of_a_gpu() {
    // Equal steps of a simple method, which the driver compiles in a fraction of the time.
    let study = STATISTICS.replace("final = false", "snapshots = true");
    let study = study.replace("method = \"rk8\"\ntolerance = 1e-8", "method = \"rk4\"\ndt = 0.01");
    killed_and_resumed(&study, "gpu", "0.02");
}

/// A run that was stopped in the middle; gives what it has said.
pub(crate) fn stopped(workspace: &Workspace, more: &[&str]) -> String {
    let run = ["run", "study.toml", "--out", "out", "--engine", "cpu", "--checkpoint", "1e-9"];
    let mut command = Command::new(cargo_bin!("polhode"));
    command.current_dir(workspace.folder()).args(run).args(more).stdout(Stdio::null()).stderr(Stdio::piped());
    let child = command.spawn().expect("the command starts");
    let clock = Instant::now();
    // Until the first piece is finished and the second is there.
    let pieces = || {
        let names = workspace.path("out.checkpoint").is_dir().then(|| workspace.names("out.checkpoint"));
        names.is_some_and(|names| {
            // A piece under way has a name that begins with a dot, or a file beside it that does.
            let first_body = |name: &String| name.split_once("bodies-")?.1.split('-').next().map(str::to_owned);
            let begun: BTreeSet<String> = names.iter().filter_map(first_body).collect();
            names.iter().any(|name| name.starts_with("bodies-")) && begun.len() > 1
        })
    };
    while !pieces() && clock.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(2));
    }
    let interrupt = Command::new("kill").args(["-INT", &child.id().to_string()]).status().expect("kill");
    assert!(interrupt.success());
    let output = child.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(1), "{}", words(&output.stderr));
    words(&output.stderr)
}

#[test]
#[cfg(unix)]
fn a_stopped_run_says_how_it_goes_on_and_what_does_not_belong_to_it_is_refused() {
    // Many blocks, so that it does not end before it is stopped.
    let study = STATISTICS.replace("count = 900", "count = 2000").replace("final = false", "snapshots = true");
    let workspace = Workspace::new(&study);
    let error = stopped(&workspace, &[]);
    let hint = "of 2000 bodies are in out.checkpoint; `polhode run study.toml --out out --engine cpu --resume` continues the run";
    assert!(error.contains("stopped by the user: ") && error.contains(hint), "{error}");
    let is_finished =
        error.lines().find_map(|line| line.strip_prefix("stopping when bodies ")?.split_once(" are computed"));
    let (_, last) = is_finished.and_then(|(bodies, _)| bodies.split_once(" to ")).expect("what it finishes");
    let computed = last.parse::<usize>().expect("a number") + 1;
    assert!(error.contains(&format!("stopped by the user: {computed} of 2000 bodies are in")), "{error}");
    assert!(!workspace.path("out").exists());
    let refused = |arguments: &[&str], word: &str| {
        let run = [&["run", "study.toml", "--out", "out", "--engine", "cpu", "--quiet"], arguments].concat();
        let error = workspace.refused(&run, 2);
        assert!(error.contains(word), "{error}");
        assert!(!workspace.path("out").exists());
    };
    refused(&["--checkpoint", "60"], "--resume continues it, --force starts anew");
    refused(&["--resume", "--shard", "1/2"], "--resume");
    refused(&["--resume", "--no-skip"], "begun with skipping, this is without skipping (--no-skip): choose");

    // Another study, or the same with other output, or in other arithmetic.
    fs::write(workspace.path("study.toml"), study.replace("high = 0.1", "high = 0.2")).expect("written");
    refused(&["--resume"], "cannot be resumed; --force removes it and starts anew");
    fs::write(workspace.path("study.toml"), &study).expect("written");
    refused(&["--resume", "--precision", "f32"], "precision");
    fs::write(workspace.path("study.toml"), &study).expect("written");
    // Of another release, or without its plan.
    let first =
        workspace.names("out.checkpoint").into_iter().find(|name| name.starts_with("bodies-0-")).expect("a piece");
    let spoilt = |name: &str, spoil: &dyn Fn(&[u8]) -> Vec<u8>, word: &str| {
        let path = workspace.path("out.checkpoint").join(name);
        let bytes = fs::read(&path).expect("a file");
        fs::write(&path, spoil(&bytes)).expect("written");
        refused(&["--resume"], word);
        fs::write(&path, bytes).expect("written");
    };
    let of_first = |name: &str| format!("{first}/{name}");
    let release = |bytes: &[u8]| words(bytes).replace(env!("CARGO_PKG_VERSION"), "0.0.9").into_bytes();
    spoilt(&of_first("part.json"), &release, "it is of polhode 0.0.9");
    spoilt("plan.json", &|bytes| bytes[..bytes.len() / 2].to_vec(), "plan.json:");
    done(&workspace, 2, &["run", "study.toml", "--out", "whole", "--engine", "cpu", "--quiet"]);
    done(&workspace, 2, &["run", "study.toml", "--out", "out", "--engine", "cpu", "--quiet", "--resume"]);
    assert_same(&tables(&workspace, "whole"), &tables(&workspace, "out"));
}

/// The command that a stopped run names has no `--checkpoint`.
#[test]
#[cfg(unix)]
fn a_resumed_run_keeps_to_the_time_between_checkpoints_that_it_was_given() {
    let study = STATISTICS.replace("count = 900", "count = 600").replace("final = false", "snapshots = true");
    let workspace = Workspace::new(&study);
    stopped(&workspace, &[]);
    let place = workspace.path("out.checkpoint");
    let nanosecond = Duration::from_nanos(1);
    assert_eq!(Checkpoint::interval(&place), Some(nanosecond));
    let resume = ["run", "study.toml", "--out", "out", "--engine", "cpu", "--quiet", "--resume"];
    let pieces = || crate::workspace::report(&workspace, "out")["shards"].as_u64().map(|pieces| pieces as usize);
    let found = || {
        let study = Study::read(&workspace.path("study.toml")).expect("a study");
        Checkpoint::find(&place, &study).expect("read").expect("a checkpoint")
    };
    let (size, finished) = (polhode::bodies::Blocks::of(600).size(), || {
        workspace.names("out.checkpoint").iter().filter(|name| name.starts_with("bodies-")).count()
    });
    let left = || (600 - found().bodies_done()).div_ceil(size);
    let of_blocks = finished() + left();
    assert!(left() > 20, "it was stopped late: {}", left());
    done(&workspace, 2, &resume);
    assert_eq!(pieces(), Some(of_blocks), "a block each, as at 1e-9 s");
    assert!(!place.exists(), "{:?}", workspace.names("out.checkpoint"));
    fs::remove_dir_all(workspace.path("out")).expect("removed");

    // Another time replaces it, for this run and for those that continue it.
    stopped(&workspace, &[]);
    let (found, of_blocks) = (found(), finished() + left());
    found.note_interval(Duration::from_millis(1500)).expect("noted");
    assert_eq!(Checkpoint::interval(&place), Some(Duration::from_millis(1500)));
    found.note_interval(nanosecond).expect("noted");
    done(&workspace, 2, &[&resume[..], &["--checkpoint", "60"]].concat());
    assert!(pieces() < Some(of_blocks), "{:?} of {of_blocks}", pieces());
}

#[test]
#[cfg(unix)]
fn a_run_begun_without_skipping_is_resumed_without() {
    let workspace = Workspace::new(&STATISTICS.replace("final = false", "snapshots = true"));
    let error = stopped(&workspace, &["--no-skip"]);
    assert!(
        error.contains("`polhode run study.toml --out out --engine cpu --no-skip --resume` continues the run"),
        "{error}"
    );
    let run = ["run", "study.toml", "--out", "out", "--engine", "cpu", "--quiet"];
    let error = workspace.refused(&[&run[..], &["--resume"]].concat(), 2);
    assert!(error.contains("begun without skipping (--no-skip), this is with skipping: choose"), "{error}");
    let resume = ["--no-skip", "--resume", "--checkpoint", "60"];
    done(&workspace, 2, &[&run[..], &resume].concat());
}

/// The command that a stopped `--force` names continues it; results that the run was not to replace stay.
#[test]
#[cfg(unix)]
fn a_stopped_run_that_replaces_results_is_resumed_as_it_says() {
    let study = STATISTICS.replace("count = 900", "count = 2000").replace("final = false", "snapshots = true");
    let workspace = Workspace::new(&study);
    let whole = whole(&workspace, "cpu");
    let resume = ["run", "study.toml", "--out", "out", "--resume", "--engine", "cpu", "--quiet"];
    fs::create_dir(workspace.path("out")).expect("made");
    fs::write(workspace.path("out/report.json"), "former").expect("written");
    let error = stopped(&workspace, &["--force"]);
    assert!(error.contains("`polhode run study.toml --out out --engine cpu --resume` continues the run"), "{error}");
    assert_eq!(fs::read_to_string(workspace.path("out/report.json")).expect("read"), "former");

    // Another run has put its results there since.
    fs::write(workspace.path("out/report.json"), "another").expect("written");
    let error = workspace.refused(&resume, 2);
    assert!(error.contains("out: the output folder is not empty"), "{error}");
    assert!(error.contains("move them away, or begin anew with --force"), "{error}");
    assert_eq!(fs::read_to_string(workspace.path("out/report.json")).expect("read"), "another");
    fs::write(workspace.path("out/report.json"), "former").expect("written");
    done(&workspace, 2, &resume);
    assert_same(&whole, &tables(&workspace, "out"));
    assert!(!workspace.path("out.checkpoint").exists());

    // A run into no folder, or an empty one, was not to replace what comes there meanwhile.
    fs::remove_dir_all(workspace.path("out")).expect("removed");
    stopped(&workspace, &["--force"]);
    fs::create_dir(workspace.path("out")).expect("made");
    fs::write(workspace.path("out/mine.txt"), "mine").expect("written");
    let error = workspace.refused(&resume, 2);
    assert!(error.contains("out: the output folder is not empty"), "{error}");
    assert_eq!(workspace.names("out"), ["mine.txt"]);
}

/// A script may always pass `--resume`: where the run is complete, nothing is done and nothing refused.
#[test]
fn a_finished_run_is_resumed_to_nothing_and_another_study_is_refused() {
    let workspace = Workspace::new(STATISTICS);
    for (out, cut) in [("whole", &[][..]), ("pieces", &["--checkpoint", "1e-9"])] {
        let run = |more: &[&'static str]| [&["run", "study.toml", "--out", out, "--engine", "cpu"], more].concat();
        done(&workspace, 2, &[&run(&["--quiet"])[..], cut].concat());
        let (before, report) =
            (tables(&workspace, out), fs::read(workspace.path(out).join("report.json")).expect("read"));
        let output = workspace.polhode(&run(&["--resume"]));
        let note = words(&output.stderr);
        assert!(output.status.success() && output.stdout.is_empty(), "{note}");
        let expected = "has all results of this study: the run is complete, nothing is left to do";
        assert_eq!(note, format!("note: {out} {expected}\n"));
        done(&workspace, 2, &run(&["--resume", "--quiet"]));
        let json: serde_json::Value =
            serde_json::from_str(&workspace.done(&run(&["--resume", "--quiet", "--json"]))).expect("JSON");
        assert_eq!(json, crate::workspace::report(&workspace, out));
        // What a kill has left of the pieces, after the results had appeared, goes.
        let left = workspace.path(&format!("{out}.checkpoint"));
        fs::create_dir_all(left.join("bodies-64-127")).expect("made");
        fs::write(left.join("plan.json.removed"), "{}").expect("written");
        done(&workspace, 2, &run(&["--resume", "--quiet"]));
        assert!(!left.exists());

        // Another text, other arithmetic, without skipping, or with a file less.
        let refused = |more: &[&'static str]| {
            let error = workspace.refused(&[&run(&["--resume", "--quiet"])[..], more].concat(), 2);
            assert!(error.contains(&format!("{out}: the output folder is not empty")), "{error}");
        };
        fs::write(workspace.path("study.toml"), STATISTICS.replace("high = 0.1", "high = 0.2")).expect("written");
        refused(&[]);
        fs::write(workspace.path("study.toml"), STATISTICS).expect("written");
        refused(&["--precision", "f32"]);
        refused(&["--no-skip"]);
        assert_same(&before, &tables(&workspace, out));
        assert!(fs::read(workspace.path(out).join("report.json")).expect("read") == report);
        let name = json["files"][0].as_str().expect("a name");
        fs::remove_file(workspace.path(out).join(name)).expect("removed");
        refused(&[]);
    }
    // A table of bodies that has changed since.
    let study = "[bodies]\nfile = \"bodies.csv\"\n[time]\nend = 1.0\n";
    let table = "ixx,iyy,izz,wx,wy,wz\n1,2,2.5,0,0.1,1\n";
    fs::write(workspace.path("study.toml"), study).expect("written");
    fs::write(workspace.path("bodies.csv"), table).expect("written");
    let run = ["run", "study.toml", "--out", "rows", "--engine", "cpu", "--quiet", "--resume"];
    done(&workspace, 2, &run);
    done(&workspace, 2, &run);
    fs::write(workspace.path("bodies.csv"), table.replace("0.1", "0.2")).expect("written");
    let error = workspace.refused(&run, 2);
    assert!(error.contains("rows: the output folder is not empty"), "{error}");
}

/// Final states that go to their table as they are computed, in pieces of some blocks: once, and the same bytes; what is left of such a run
/// says that there is nothing to go on with.
#[test]
fn final_states_written_through_are_those_of_one_run() {
    /// In pieces of a block; breaks before the piece of a number, or in it.
    fn advance(checkpoint: &mut Checkpoint, study: &Study, before: usize, within: usize) -> (Result<(), Error>, usize) {
        let pieces = Cell::new(0);
        let flow = |stops: bool| if stops { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
        let done = checkpoint.advance(
            &Engine::cpu(),
            study,
            Duration::from_nanos(1),
            &mut |_, _, _| {
                pieces.set(pieces.get() + 1);
                flow(pieces.get() == before)
            },
            &mut |_| flow(pieces.get() == within),
        );
        (done, pieces.get())
    }
    for format in Format::ALL.iter().map(|format| format.name()) {
        let pinned = PINNED.replace("snapshots = true", "").replace("format = \"npz\"", "");
        // A block has one body, and the first piece 64.
        for study in [OBSERVED.replace("count = 250", "count = 35"), pinned.replace("count = 333", "count = 110")] {
            let workspace = Workspace::new(&study.replace("[output]", &format!("[output]\nformat = \"{format}\"")));
            let whole = whole(&workspace, "cpu");
            let study = Study::read(&workspace.path("study.toml")).expect("a study");
            let scene = study.scene().expect("a scene");
            let plan = Plan::new(&scene, &Engine::cpu()).expect("a plan");
            let place = workspace.path("out.checkpoint");
            let begun = || {
                Checkpoint::remove(&place);
                let mut folder = OutputFolder::create(&workspace.path("out"), false).expect("a folder");
                let mut checkpoint = Checkpoint::begin(&place, &plan).expect("begun");
                checkpoint.write_through(&study, &plan, &mut folder).expect("written through");
                (checkpoint, folder)
            };
            let (mut stopped, folder) = begun();
            let (done, pieces) = advance(&mut stopped, &study, 4, 0);
            assert!(done.is_err() && pieces == 4 && stopped.bodies_done() > 0 && !stopped.is_kept(), "{pieces}");
            let of_piece = fs::read_dir(&place).expect("a folder").flatten().map(|piece| piece.path());
            assert!(
                of_piece.filter(|piece| piece.is_dir()).all(|piece| !piece.join(format!("final.{format}")).exists())
            );
            assert!(Checkpoint::find(&place, &study).expect("read").is_none(), "states are lost with the value");
            // It has its table still, and goes on.
            assert!(advance(&mut stopped, &study, 0, 0).0.is_ok());
            stopped.finish(folder, &mut |_| ControlFlow::Continue(())).expect("merged");
            assert_same(&whole, &tables(&workspace, "out"));
            assert!(!place.exists());
            fs::remove_dir_all(workspace.path("out")).expect("removed");
            let (mut torn, folder) = begun();
            assert!(advance(&mut torn, &study, 0, 2).0.is_err());
            let again = advance(&mut torn, &study, 0, 0).0.err();
            for error in [again, torn.finish(folder, &mut |_| ControlFlow::Continue(())).err()] {
                let error = error.expect("rows may be there twice").to_string();
                assert!(error.contains("begin anew"), "{error}");
            }
        }
    }
}

/// Whatever the memory: a plan of the first 2^20, pieces, kept or written through, parts, and all bodies together.
#[test]
fn more_than_a_million_bodies_are_run_in_pieces_to_the_bytes_of_one_run() {
    let study = "[bodies]\ncount = 1_100_000\ninertia = [1, 2, 2.5]\norientation = { distribution = \"uniform\" }\n\
                 angular_velocity = { distribution = \"normal\", mean = 0, sigma = 0.5 }\n[time]\nend = 5.0\n\
                 [output]\ncolumns = [\"qz\", \"wx\"]\nformat = \"npz\"\nstatistics = [\"kinetic_energy\", \"angular_momentum_x\"]\n";
    let workspace = Workspace::new(study);
    let engine = ["--engine", "cpu", "--quiet"];
    let polhode = |arguments: &[&str]| done(&workspace, 2, &[arguments, &engine].concat());
    polhode(&["run", "study.toml", "--out", "pieces"]);
    let found = tables(&workspace, "pieces");
    assert_eq!(found.keys().collect::<Vec<_>>(), ["final.npz", "plan.json", "statistics.npz"]);
    assert!(crate::workspace::report(&workspace, "pieces")["parts"].as_array().is_some_and(|parts| !parts.is_empty()));
    polhode(&["run", "study.toml", "--out", "kept", "--checkpoint", "0.3"]);
    assert_same(&found, &tables(&workspace, "kept"));
    polhode(&["plan", "study.toml", "--out", "plan.json"]);
    polhode(&["run", "study.toml", "--out", "together", "--plan", "plan.json"]);
    for part in ["1/3", "2/3", "3/3"] {
        polhode(&["run", "study.toml", "--out", "parts", "--plan", "plan.json", "--shard", part]);
    }
    done(&workspace, 2, &["merge", "parts", "--out", "merged", "--quiet"]);
    assert_same(&found, &tables(&workspace, "merged"));
    // Of all bodies in memory; its plan counts them.
    let together = tables(&workspace, "together");
    for name in ["final.npz", "statistics.npz"] {
        assert!(together[name] == found[name], "{name} differs");
    }
}

/// Nobody asked for checkpoints, and the run is short: it is begun again.
#[test]
#[cfg(unix)]
fn a_killed_run_that_wrote_through_is_begun_again() {
    let study = "[bodies]\ncount = 3_000_000\ninertia = [1, 2, 2.5]\norientation = { distribution = \"uniform\" }\n\
                 angular_velocity = { distribution = \"normal\", mean = 0, sigma = 0.5 }\n[time]\nend = 5.0\n\
                 [output]\ncolumns = [\"wx\"]\nformat = \"npz\"\n";
    let workspace = Workspace::new(study);
    let run = ["run", "study.toml", "--out", "out", "--engine", "cpu"];
    let place = workspace.path("out.checkpoint");
    let with_pieces = || {
        let (child, clock) = (start(&workspace, &run), Instant::now());
        let pieces = || place.is_dir() && workspace.names("out.checkpoint").len() > 3;
        while clock.elapsed() < Duration::from_secs(60) && !pieces() {
            std::thread::sleep(Duration::from_millis(2));
        }
        child
    };
    // Asked to stop, it leaves nothing.
    let mut child = with_pieces();
    let interrupt = Command::new("kill").args(["-INT", &child.id().to_string()]).status().expect("kill");
    assert!(interrupt.success() && child.wait().expect("it ends").code() == Some(1));
    assert_eq!(workspace.names("."), ["study.toml"]);
    let mut child = with_pieces();
    child.kill().expect("a process");
    child.wait().expect("it ends");
    assert!(place.is_dir() && !workspace.path("out").exists());
    done(&workspace, 2, &[&run[..], &["--quiet"]].concat());
    assert_eq!(workspace.names("."), ["out", "study.toml"], "what was left is gone");
    done(&workspace, 2, &["run", "study.toml", "--out", "kept", "--engine", "cpu", "--quiet", "--checkpoint", "1"]);
    assert_same(&tables(&workspace, "kept"), &tables(&workspace, "out"));
}

#[test]
fn times_that_make_no_sense_are_refused() {
    let workspace = Workspace::new(STATISTICS);
    for wrong in ["0", "-1", "soon", "nan", "inf"] {
        let error = workspace.refused(&["run", "study.toml", "--checkpoint", wrong], 2);
        assert!(error.contains("a number of seconds above zero"), "{error}");
    }
    for (wrong, word) in [("0", "above zero"), ("\"3 m\"", "s"), ("true", "above zero")] {
        let study = STATISTICS.replace("[time]", &format!("[checkpoint]\nevery = {wrong}\n[time]"));
        fs::write(workspace.path("study.toml"), study).expect("written");
        let error = workspace.refused(&["run", "study.toml"], 2);
        assert!(error.contains("checkpoint.every") && error.contains(word), "{error}");
    }
}
