//! A folder that cannot be written, a disk that is full, a folder that vanishes, at each stage of the work: the message names the place, nothing
//! that is half-written looks whole, what was there stays, and the same command goes on when the hindrance is gone.

#![cfg(all(feature = "cli", unix))]

use std::fs::{self, Permissions};
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use assert_cmd::cargo::cargo_bin;

use crate::in_parts::STATISTICS;
use crate::workspace::{Workspace, words};

/// A user without rights of its own.
const NOBODY: u32 = 65534;

/// A study, and the command for a user whom permissions bind: where this is the superuser, for another one.
struct Bound {
    workspace: Workspace,
    command: PathBuf,
    user: u32,
}

impl Bound {
    fn new() -> Self {
        let workspace = Workspace::new(&STATISTICS.replace("final = false", "snapshots = true"));
        let own = fs::metadata(workspace.folder()).expect("a folder").uid();
        let user = if own == 0 { NOBODY } else { own };
        // Where others may start it: the folder of the build may be closed to them. By another process: a file that this one has open for writing
        // cannot be started, and what other tests start meanwhile has the same files open until it runs.
        let command = workspace.path("polhode");
        let copied = Command::new("cp").arg(cargo_bin!("polhode")).arg(&command).status().expect("cp starts");
        assert!(copied.success(), "{copied}");
        set_mode(workspace.folder(), 0o755);
        Self { workspace, command, user }
    }

    fn start(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(&self.command);
        command.current_dir(self.workspace.folder()).args(arguments).stdout(Stdio::null()).stderr(Stdio::piped());
        if self.user == NOBODY {
            command.uid(NOBODY).gid(NOBODY);
        }
        command
    }

    /// Gives status and message.
    fn run(&self, arguments: &[&str]) -> (Option<i32>, String) {
        let output = self.start(arguments).output().expect("the command starts");
        (output.status.code(), words(&output.stderr))
    }

    fn done(&self, arguments: &[&str]) {
        let (status, errors) = self.run(arguments);
        assert_eq!(status, Some(0), "{arguments:?}: {errors}");
    }

    /// The command must fail, name the place and leave nothing new in the folder.
    fn refused(&self, arguments: &[&str], folder: &str, expected: &str) {
        let before = self.workspace.names(folder);
        let (status, errors) = self.run(arguments);
        assert!(matches!(status, Some(1 | 2)), "{arguments:?}: {status:?}: {errors}");
        assert!(errors.contains(expected) && errors.contains("Permission denied"), "{arguments:?}: {errors}");
        assert_eq!(errors.lines().count(), 1, "{arguments:?}: {errors}");
        assert_eq!(self.workspace.names(folder), before, "{arguments:?}: something is left");
    }

    /// A folder of the user's own.
    fn folder(&self, name: &str) -> PathBuf {
        let path = self.workspace.path(name);
        fs::create_dir(&path).expect("made");
        if self.user == NOBODY {
            std::os::unix::fs::chown(&path, Some(NOBODY), Some(NOBODY)).expect("given away");
        }
        path
    }
}

fn set_mode(path: &Path, mode: u32) {
    fs::set_permissions(path, Permissions::from_mode(mode)).expect("permissions are set");
}

/// With permission to write taken from a folder.
fn closed<T>(path: &Path, work: impl FnOnce() -> T) -> T {
    set_mode(path, 0o555);
    let done = work();
    set_mode(path, 0o755);
    done
}

const RUN: [&str; 6] = ["run", "study.toml", "--engine", "cpu", "--quiet", "--out"];

#[test]
fn a_folder_that_is_read_only_is_named_at_each_stage() {
    let bound = Bound::new();
    let place = bound.folder("place");
    let with = |more: &[&'static str]| [&RUN[..], more].concat();
    let plan = ["plan", "study.toml", "--engine", "cpu", "--quiet", "--out", "place/plan.json"];
    closed(&place, || {
        bound.refused(&with(&["place/out"]), "place", "place/out: cannot be created");
        bound.refused(&with(&["place/out", "--checkpoint", "1e-9"]), "place", "place/out");
        bound.refused(&plan, "place", "place/plan.json: cannot be written");
    });
    bound.done(&plan);
    let part = |part: &'static str| with(&["place/parts", "--plan", "place/plan.json", "--shard", part]);
    bound.done(&part("1/2"));
    closed(&place.join("parts"), || {
        bound.refused(&part("2/2"), "place/parts", "place/parts/shard-2-of-2: cannot be created");
        // Results of its own go beside what it cannot write to.
        bound.done(&with(&["place/out"]));
    });
    bound.done(&part("2/2"));
    let merge = ["merge", "place/parts", "--quiet", "--out", "place/merged"];
    closed(&place, || bound.refused(&merge, "place", "place/merged: cannot be created"));
    bound.done(&merge);
    // A former result that cannot give way stays.
    let table = |folder: &str| fs::read(place.join(folder).join("snapshots.csv")).expect("a table");
    let former = table("out");
    closed(&place, || {
        closed(&place.join("out"), || bound.refused(&with(&["place/out", "--force"]), "place/out", "place/out"));
    });
    assert!(table("out") == former && table("merged") == former);
}

#[test]
fn a_folder_that_becomes_read_only_under_a_run_costs_no_results() {
    let bound = Bound::new();
    let place = bound.folder("place");
    let study = STATISTICS.replace("final = false", "snapshots = true").replace("count = 900", "count = 60000");
    fs::write(bound.workspace.path("study.toml"), study).expect("written");
    let run = [&RUN[..], &["place/out"]].concat();
    let child = bound.start(&run).spawn().expect("the command starts");
    let clock = Instant::now();
    let partial = || bound.workspace.names("place").into_iter().find(|name| name.ends_with(".partial"));
    while partial().is_none() {
        assert!(clock.elapsed() < Duration::from_secs(60), "it does not begin");
        std::thread::sleep(Duration::from_millis(1));
    }
    let output = closed(&place, || child.wait_with_output().expect("it ends"));
    let (errors, left) = (words(&output.stderr), partial().expect("the results"));
    assert_eq!(output.status.code(), Some(1), "{errors}");
    assert!(errors.starts_with("error: place/out: cannot be written: Permission denied"), "{errors}");
    assert!(errors.trim_end().ends_with(&left), "{errors}");
    let kept = bound.workspace.path("kept");
    fs::rename(place.join(&left), &kept).expect("renamed");
    bound.done(&run);
    for name in ["plan.json", "snapshots.csv"] {
        let [found, expected] = [&kept, &place.join("out")].map(|folder| fs::read(folder.join(name)).expect("a file"));
        assert!(found == expected, "{name} differs");
    }
    assert_eq!(bound.workspace.names("place"), ["out"]);
}

#[test]
fn pieces_in_a_folder_that_is_read_only_are_resumed_when_it_is_not() {
    let bound = Bound::new();
    let place = bound.folder("place");
    let whole = [&RUN[..], &["place/whole"]].concat();
    bound.done(&whole);
    let run = [&RUN[..], &["place/out", "--checkpoint", "1e-9"]].concat();
    let child = bound.start(&run).spawn().expect("the command starts");
    let pieces = place.join("out.checkpoint");
    let clock = Instant::now();
    while !(pieces.is_dir() && bound.workspace.names("place/out.checkpoint").len() > 4) {
        assert!(clock.elapsed() < Duration::from_secs(60), "no pieces");
        std::thread::sleep(Duration::from_millis(1));
    }
    let output = closed(&pieces, || child.wait_with_output().expect("it ends"));
    let errors = words(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{errors}");
    assert!(errors.contains("out.checkpoint/bodies-") && errors.contains("Permission denied"), "{errors}");
    assert!(!place.join("out").exists());
    let resume = [&RUN[..], &["place/out", "--resume"]].concat();
    closed(&pieces, || bound.refused(&resume, "place/out.checkpoint", "out.checkpoint"));
    bound.done(&resume);
    let table = |folder: &str| fs::read(place.join(folder).join("snapshots.csv")).expect("a table");
    assert!(table("out") == table("whole"));
}

/// A limit on the size of files, in KiB, stands for a disk that fills up.
#[test]
fn a_disk_that_is_full_is_named_in_plans_parts_and_merges() {
    let workspace = Workspace::new(&STATISTICS.replace("final = false", "snapshots = true"));
    let limited = |limit: u32, arguments: &str, place: &str| {
        let script =
            format!("trap '' XFSZ; ulimit -f {limit}; exec '{}' {arguments} --quiet", cargo_bin!("polhode").display());
        let run = Command::new("bash").current_dir(workspace.folder()).args(["-c", &script]).output();
        let output = run.expect("bash starts");
        let errors = words(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{arguments}: {errors}");
        assert!(errors.contains("cannot be written: File too large"), "{arguments}: {errors}");
        assert!(errors.lines().any(|line| line.starts_with(&format!("error: {place}"))), "{arguments}: {errors}");
    };
    let part = |part: u32| format!("run study.toml --engine cpu --plan plan.json --shard {part}/2 --out parts");
    let done = |arguments: &str| {
        let arguments: Vec<&str> = arguments.split(' ').chain(["--quiet"]).collect();
        crate::in_parts::done(&workspace, 2, &arguments);
    };
    limited(0, "plan study.toml --engine cpu --out plan.json", "plan.json");
    assert_eq!(workspace.names(""), ["study.toml"]);
    done("plan study.toml --engine cpu --out plan.json");
    done(&part(1));
    for limit in [1, 20, 120] {
        limited(limit, &part(2), "parts/shard-2-of-2");
        assert_eq!(workspace.names("parts"), ["shard-1-of-2", "shard-2-of-2.failed"], "{limit} KiB");
    }
    done(&part(2));
    assert_eq!(workspace.names("parts"), ["shard-1-of-2", "shard-2-of-2"]);
    for limit in [1, 60, 400] {
        limited(limit, "merge parts --out merged", "merged");
        assert_eq!(workspace.names(""), ["parts", "plan.json", "study.toml"], "{limit} KiB");
    }
    done("merge parts --out merged");
    done("run study.toml --engine cpu --out whole");
    let [merged, whole] = ["merged", "whole"].map(|folder| crate::in_parts::tables(&workspace, folder));
    assert!(merged == whole);
}

#[test]
fn a_part_whose_folder_vanishes_is_run_again() {
    let workspace = Workspace::new(&STATISTICS.replace("final = false", "snapshots = true").replace("900", "90000"));
    workspace.done(&["plan", "study.toml", "--engine", "cpu", "--quiet", "--out", "plan.json"]);
    let part = [&RUN[..], &["parts", "--plan", "plan.json", "--shard", "1/1"]].concat();
    let mut command = Command::new(cargo_bin!("polhode"));
    let child = command.current_dir(workspace.folder()).args(&part).stderr(Stdio::piped()).spawn().expect("it starts");
    let clock = Instant::now();
    let partial = || {
        let names = if workspace.path("parts").is_dir() { workspace.names("parts") } else { Vec::new() };
        names.into_iter().find(|name| name.ends_with(".partial"))
    };
    while partial().is_none() {
        assert!(clock.elapsed() < Duration::from_secs(60), "it does not begin");
        std::thread::sleep(Duration::from_millis(1));
    }
    fs::remove_dir_all(workspace.path("parts")).expect("removed");
    let output = child.wait_with_output().expect("it ends");
    let errors = words(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{errors}");
    assert!(errors.contains("parts/shard-1-of-1") && errors.contains("No such file or directory"), "{errors}");
    workspace.done(&part);
    workspace.done(&["merge", "parts", "--out", "merged", "--quiet"]);
}
