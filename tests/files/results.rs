//! Results are there as a whole or not at all: killed runs, two writers, full disks, links, folders that cannot be renamed.

#![cfg(all(unix, feature = "cli"))]

use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use assert_cmd::cargo::cargo_bin;

use crate::workspace;

use workspace::{Workspace, words};

const BODIES: usize = 200;

/// The text of a study; another seed draws other bodies, so that results can be told apart.
fn study(seed: u64) -> String {
    format!(
        "seed = {seed}\n[bodies]\ncount = {BODIES}\ninertia = [1.0, 2.0, 2.5]\n\
         orientation = {{ distribution = \"uniform\" }}\n\
         angular_velocity = {{ distribution = \"normal\", mean = 0, sigma = 1 }}\n\
         [time]\nend = 1.0\noutputs = {{ every = 0.1 }}\n[accuracy]\nmethod = \"rk4\"\ndt = 0.01\n\
         [output]\nsnapshots = true\n"
    )
}

/// A study that takes hours.
fn long_study() -> String {
    study(1).replace(&format!("count = {BODIES}"), "count = 100_000").replace("end = 1.0", "end = 1e6")
}

/// Files of a result that depend on nothing but the study.
const TABLES: [&str; 2] = ["final.csv", "snapshots.csv"];

/// A folder with a study for each seed, and the tables that each gives.
struct Studies {
    workspace: Workspace,
    expected: Vec<[Vec<u8>; TABLES.len()]>,
}

impl Studies {
    fn new() -> Self {
        let workspace = Workspace::new("");
        let expected = (0..2)
            .map(|seed| {
                fs::write(workspace.path(&format!("{seed}.toml")), study(seed)).expect("written");
                let folder = workspace.path(&format!("expected-{seed}"));
                let output = run(&workspace, seed, &folder, &[]).wait_with_output().expect("the run ends");
                assert!(output.status.success(), "{}", words(&output.stderr));
                let tables = TABLES.map(|name| fs::read(folder.join(name)).expect("a table"));
                fs::remove_dir_all(folder).expect("removed");
                tables
            })
            .collect::<Vec<_>>();
        assert!(expected[0] != expected[1]);
        Self { workspace, expected }
    }

    /// Which seed's result lies in `folder`, whole; `None` where there is none at all.
    fn seed_in(&self, folder: &Path) -> Option<u64> {
        let read = |name: &str| fs::read(folder.join(name));
        let Ok(report) = read("report.json") else {
            let any = fs::read_dir(folder).is_ok_and(|mut entries| {
                entries.any(|entry| {
                    let name = entry.expect("an entry").file_name().into_string().expect("a name");
                    TABLES.contains(&&*name) || name == "plan.json"
                })
            });
            assert!(!any, "files of a result without its report");
            return None;
        };
        let report: serde_json::Value = serde_json::from_slice(&report).expect("a whole report");
        for file in report["files"].as_array().expect("files") {
            assert!(read(file.as_str().expect("a name")).is_ok(), "{file} is missing");
        }
        let seed = report["study"]["seed"].as_u64().expect("a seed");
        for (name, expected) in TABLES.iter().zip(&self.expected[seed as usize]) {
            assert!(read(name).expect("a table") == *expected, "{name} is not that of seed {seed}");
        }
        Some(seed)
    }
}

/// Begins a run of one of the [`Studies`].
fn run(workspace: &Workspace, seed: u64, folder: &Path, more: &[&str]) -> Child {
    start(workspace, &format!("{seed}.toml"), &[&["--out", folder.to_str().expect("text"), "--quiet"], more].concat())
}

fn start(workspace: &Workspace, study: &str, more: &[&str]) -> Child {
    Command::new(cargo_bin!("polhode"))
        .current_dir(workspace.folder())
        .args(["run", study, "--engine", "cpu"])
        .args(more)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the command starts")
}

fn finished(child: Child) -> Output {
    child.wait_with_output().expect("the run ends")
}

/// Names in a folder that begin with a dot.
fn hidden(folder: &Path) -> Vec<String> {
    let names = fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").file_name());
    let mut names: Vec<_> = names.map(|name| name.into_string().expect("a name")).collect();
    names.retain(|name| name.starts_with('.'));
    names.sort();
    names
}

/// Waits until a run has begun to write beside `folder`.
fn wait_for_partial(folder: &Path) -> PathBuf {
    let since = Instant::now();
    loop {
        let place = folder.parent().expect("a parent");
        if let Some(name) = hidden(place).into_iter().find(|name| name.ends_with(".partial")) {
            return place.join(name);
        }
        assert!(since.elapsed() < Duration::from_secs(30), "the run does not begin");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// A number below 1 for every `index`, spread evenly.
fn spread(index: u32) -> f64 {
    (f64::from(index) * 0.618_033_988_749_895).fract()
}

/// When a run is killed.
#[derive(Clone, Copy, Debug)]
enum Moment {
    /// At this part of the time that a run takes.
    Part(f64),
    /// So long after its report has been begun, the last file.
    Report(Duration),
    /// So long after the former result has been moved aside.
    Aside(Duration),
}

/// Kills a run, if it has not ended by then.
fn kill(mut child: Child, workspace: &Workspace, moment: Moment, duration: Duration) {
    match moment {
        Moment::Part(part) => std::thread::sleep(duration.mul_f64(part)),
        Moment::Report(delay) | Moment::Aside(delay) => {
            let left = |ending: &str| hidden(workspace.folder()).into_iter().find(|name| name.ends_with(ending));
            let has_come = || match moment {
                Moment::Aside(_) => left(".former").is_some(),
                _ => left(".partial").is_some_and(|name| workspace.path(&name).join("report.json").exists()),
            };
            while child.try_wait().expect("a state").is_none() && !has_come() {}
            let since = Instant::now();
            // Sleeping takes longer than asked for.
            while since.elapsed() < delay {}
        }
    }
    // One that has ended cannot be killed, which is as good.
    let _ = child.kill();
    child.wait().expect("it ends");
}

/// Kills as many runs that replace one another's results, each at another moment, and looks at what lies there.
fn kill_loop(kills: u32) {
    let studies = Studies::new();
    let folder = studies.workspace.path("results");
    let since = Instant::now();
    assert!(finished(run(&studies.workspace, 0, &folder, &[])).status.success());
    let duration = since.elapsed();
    fs::write(folder.join("notes.txt"), "mine").expect("written");
    let (mut replaced, mut last, mut unfinished, mut aside) = (0, 0, 0, 0);
    for number in 0..kills {
        let child = run(&studies.workspace, u64::from(number % 2), &folder, &["--force"]);
        let moment = match number % 4 {
            0 => Moment::Part(1.2 * spread(number)),
            1 => Moment::Report(Duration::from_millis(30).mul_f64(spread(number))),
            _ => Moment::Aside(Duration::from_millis(3).mul_f64(spread(number))),
        };
        kill(child, &studies.workspace, moment, duration);
        let left = hidden(studies.workspace.folder());
        unfinished += u32::from(left.iter().any(|name| name.ends_with(".partial")));
        aside += u32::from(left.iter().any(|name| name.ends_with(".former")));
        match studies.seed_in(&folder) {
            Some(found) => {
                replaced += u32::from(found != last);
                last = found;
            }
            None => assert!(left.iter().any(|name| name.ends_with(".former")), "the result is lost: {left:?}"),
        }
    }
    let output = finished(run(&studies.workspace, 0, &folder, &["--force"]));
    assert!(output.status.success(), "{}", words(&output.stderr));
    assert_eq!(studies.seed_in(&folder), Some(0));
    assert_eq!(fs::read_to_string(folder.join("notes.txt")).expect("still there"), "mine");
    assert_eq!(hidden(studies.workspace.folder()), [""; 0], "nothing is left");
    println!(
        "{kills} kills: {unfinished} before the new result was there, {aside} while the former one was aside, {replaced} after; \
         none lost or mixed"
    );
    assert!(unfinished > 0 && aside > 0 && replaced > 0, "the kills come at the wrong times");
}

#[test]
fn a_kill_at_any_time_leaves_the_former_result_or_the_new_one() {
    kill_loop(40);
}

#[test]
#[ignore = "minutes: cargo test --test files results::kills -- --ignored --nocapture"]
fn a_thousand_kills_leave_the_former_result_or_the_new_one() {
    kill_loop(1000);
}

/// Lets as many pairs of runs write into one folder at the same time.
fn two_writers(pairs: u32) {
    let studies = Studies::new();
    let (mut refused, mut both) = (0, 0);
    let since = Instant::now();
    assert!(finished(run(&studies.workspace, 0, &studies.workspace.path("first"), &[])).status.success());
    let duration = since.elapsed();
    for pair in 0..pairs {
        let folder = studies.workspace.path(&format!("pair-{pair}"));
        // New folders and such as hold a result.
        let more: &[&str] = if pair % 2 == 0 { &[] } else { &["--force"] };
        if pair % 2 == 1 {
            assert!(finished(run(&studies.workspace, 0, &folder, &[])).status.success());
        }
        let first = run(&studies.workspace, 0, &folder, more);
        std::thread::sleep(duration.mul_f64(1.5 * spread(pair)));
        let second = run(&studies.workspace, 1, &folder, more);
        let outputs = [finished(first), finished(second)];
        let done: Vec<_> = (0..2_u64).filter(|&seed| outputs[seed as usize].status.success()).collect();
        for output in outputs.iter().filter(|output| !output.status.success()) {
            let errors = words(&output.stderr);
            assert_eq!((output.status.code(), errors.lines().count()), (Some(2), 1), "{errors}");
            assert!(
                errors.contains("another run writes there (") || (errors.contains("is not empty") && more.is_empty()),
                "{errors}"
            );
            refused += 1;
        }
        let found = studies.seed_in(&folder).expect("a result");
        assert!(done.contains(&found), "seed {found} lies there, {done:?} said that they were done");
        assert!(done.len() == 1 || !more.is_empty(), "both runs wrote into a new folder");
        both += u32::from(done.len() == 2);
        assert_eq!(hidden(studies.workspace.folder()), [""; 0], "nothing is left");
    }
    println!("{pairs} pairs: {refused} refused, {both} one after the other, none lost or mixed");
    assert!(refused > 0, "no two runs met");
}

#[test]
fn of_two_runs_into_one_folder_one_is_refused_or_comes_after_the_other() {
    two_writers(10);
}

#[test]
#[ignore = "minutes: cargo test --test files results::pairs -- --ignored --nocapture"]
fn of_five_hundred_pairs_of_runs_into_one_folder_no_result_is_lost_or_mixed() {
    two_writers(500);
}

#[test]
fn a_second_run_is_refused_at_once_and_names_the_first() {
    let workspace = Workspace::new(&long_study());
    let mut first = start(&workspace, "study.toml", &["--quiet"]);
    wait_for_partial(&workspace.path("study.out"));
    let since = Instant::now();
    let line = workspace.refused(&["run", "study.toml", "--engine", "cpu"], 2);
    assert!(since.elapsed() < Duration::from_secs(5), "{:?}", since.elapsed());
    let expected = format!("error: study.out: another run writes there (process {}, since 20", first.id());
    assert!(line.starts_with(&expected) && line.ends_with(", or name another folder with --out\n"), "{line}");
    first.kill().expect("killed");
    first.wait().expect("it ends");
}

#[test]
fn what_a_killed_run_has_left_is_reported_and_removed() {
    let workspace = Workspace::new(&long_study());
    let mut killed = start(&workspace, "study.toml", &["--quiet"]);
    let partial = wait_for_partial(&workspace.path("study.out"));
    killed.kill().expect("killed");
    killed.wait().expect("it ends");
    assert_eq!(
        workspace.names("."),
        [partial.file_name().unwrap().to_str().unwrap(), ".study.out.polhode-lock", "study.toml"]
    );
    // Of other runs, and of nobody.
    let others = [".study.out.polhode-0123456789abcdef.mine", ".study.out.polhode-1.partial", ".other.polhode-lock"];
    others.iter().for_each(|name| fs::write(workspace.path(name), "").expect("written"));

    fs::write(workspace.path("study.toml"), study(0)).expect("written");
    let output = workspace.polhode(&["run", "study.toml", "--engine", "cpu", "--quiet"]);
    assert!(output.status.success());
    let note =
        format!("note: removed what a killed run had left: {}\n", partial.canonicalize().unwrap_or(partial).display());
    assert_eq!(words(&output.stderr), note);
    let mut expected = [&others[..], &["study.out", "study.toml"]].concat();
    expected.sort_unstable();
    assert_eq!(workspace.names("."), expected);
}

#[test]
fn a_result_that_was_aside_when_its_run_was_killed_is_put_back() {
    let workspace = Workspace::new(&study(0));
    workspace.done(&["run", "study.toml", "--engine", "cpu", "--quiet"]);
    let aside = workspace.path(".study.out.polhode-0123456789abcdef.former");
    fs::rename(workspace.path("study.out"), &aside).expect("renamed");
    let output = workspace.polhode(&["run", "study.toml", "--engine", "cpu", "--quiet"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(words(&output.stderr).contains("the output folder is not empty"), "{}", words(&output.stderr));
    assert_eq!(workspace.names("study.out"), ["final.csv", "plan.json", "report.json", "snapshots.csv"]);
}

#[test]
fn a_full_disk_at_any_size_is_a_failure_that_leaves_the_former_result() {
    let studies = Studies::new();
    let folder = studies.workspace.path("results");
    assert!(finished(run(&studies.workspace, 0, &folder, &[])).status.success());
    // A limit on the size of files, in KiB, stands for a disk that fills up.
    let (mut failed, mut done) = (0, 0);
    for limit in (1..40).step_by(3).chain([400, 4000]) {
        let script = format!(
            "trap '' XFSZ; ulimit -f {limit}; exec '{}' run 1.toml --engine cpu --quiet --out results --force",
            cargo_bin!("polhode").display()
        );
        let output = Command::new("bash")
            .current_dir(studies.workspace.folder())
            .args(["-c", &script])
            .output()
            .expect("bash starts");
        let errors = words(&output.stderr);
        if output.status.success() {
            done += 1;
            assert_eq!(studies.seed_in(&folder), Some(1));
        } else {
            failed += 1;
            assert_eq!((output.status.code(), errors.lines().count()), (Some(1), 1), "{errors}");
            assert!(errors.contains("cannot be written: File too large"), "{errors}");
            assert_eq!(studies.seed_in(&folder), Some(0), "{limit} KiB");
        }
        assert_eq!(hidden(studies.workspace.folder()), [""; 0], "nothing is left");
    }
    assert!(failed > 10 && done > 0, "{failed} failed, {done} done");
}

#[test]
fn links_are_replaced_and_never_written_through() {
    let workspace = Workspace::new(&study(0));
    fs::create_dir(workspace.path("elsewhere")).expect("made");
    fs::write(workspace.path("elsewhere/final.csv"), "precious").expect("written");
    fs::create_dir(workspace.path("study.out")).expect("made");
    for name in ["final.csv", "report.json"] {
        symlink(workspace.path("elsewhere/final.csv"), workspace.path("study.out").join(name)).expect("linked");
    }
    symlink("../elsewhere", workspace.path("study.out/mine")).expect("linked");
    workspace.done(&["run", "study.toml", "--engine", "cpu", "--quiet", "--force"]);
    assert_eq!(fs::read_to_string(workspace.path("elsewhere/final.csv")).expect("read"), "precious");
    assert_eq!(fs::read_to_string(workspace.path("study.out/mine/final.csv")).expect("read"), "precious");
    assert!(fs::symlink_metadata(workspace.path("study.out/final.csv")).expect("there").is_file());

    // A lock that leads out of the folder.
    symlink(workspace.path("elsewhere/final.csv"), workspace.path(".b.polhode-lock")).expect("linked");
    let line = workspace.refused(&["run", "study.toml", "--engine", "cpu", "--out", "b"], 2);
    assert!(line.contains("is not a regular file"), "{line}");
    assert_eq!(fs::read_to_string(workspace.path("elsewhere/final.csv")).expect("read"), "precious");

    // The output folder itself may be a link, to a folder.
    fs::create_dir(workspace.path("real")).expect("made");
    symlink("real", workspace.path("link")).expect("linked");
    workspace.done(&["run", "study.toml", "--engine", "cpu", "--quiet", "--out", "link"]);
    assert!(fs::symlink_metadata(workspace.path("link")).expect("there").is_symlink());
    assert!(workspace.path("real/report.json").exists());
    symlink("nowhere", workspace.path("dangling")).expect("linked");
    let line = workspace.refused(&["run", "study.toml", "--engine", "cpu", "--out", "dangling"], 2);
    assert!(line.contains("a symbolic link that leads nowhere"), "{line}");
}

#[test]
fn the_current_folder_is_filled_in_place() {
    let workspace = Workspace::new(&study(0));
    workspace.done(&["run", "study.toml", "--engine", "cpu", "--quiet", "--out", ".", "--force"]);
    let names = ["final.csv", "plan.json", "report.json", "snapshots.csv", "study.toml"];
    assert_eq!(workspace.names("."), names);
    fs::write(workspace.path("study.toml"), study(0).replace("snapshots = true", "snapshots = false"))
        .expect("written");
    workspace.done(&["run", "study.toml", "--engine", "cpu", "--quiet", "--out", ".", "--force"]);
    assert_eq!(workspace.names("."), ["final.csv", "plan.json", "report.json", "study.toml"]);
}

#[test]
fn runs_into_a_folder_from_inside_and_from_outside_exclude_each_other() {
    let workspace = Workspace::new(&long_study());
    fs::create_dir(workspace.path("inner")).expect("made");
    fs::copy(workspace.path("study.toml"), workspace.path("inner/study.toml")).expect("copied");
    let refused = |folder: &str, out: &str, first: &mut Child| {
        let output = Command::new(cargo_bin!("polhode"))
            .current_dir(workspace.path(folder))
            .args(["run", "study.toml", "--engine", "cpu", "--quiet", "--force", "--out", out])
            .output()
            .expect("the command starts");
        let errors = words(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{errors}");
        assert!(errors.contains(&format!("another run writes there (process {}, since 20", first.id())), "{errors}");
        first.kill().expect("killed");
        first.wait().expect("it ends");
    };
    let begun = |folder: &str, out: &str, partial: &str| {
        let child = Command::new(cargo_bin!("polhode"))
            .current_dir(workspace.path(folder))
            .args(["run", "study.toml", "--engine", "cpu", "--quiet", "--force", "--out", out])
            .stderr(Stdio::null())
            .spawn()
            .expect("the command starts");
        let since = Instant::now();
        while !workspace.names(partial).iter().any(|name| name.ends_with(".partial")) {
            assert!(since.elapsed() < Duration::from_secs(60), "it does not begin");
            std::thread::sleep(Duration::from_millis(5));
        }
        child
    };
    refused(".", "inner", &mut begun("inner", ".", "inner"));
    // What the killed one has left in the folder goes with the next run from outside.
    refused("inner", ".", &mut begun(".", "inner", "."));
    fs::write(workspace.path("study.toml"), study(0)).expect("written");
    let output = workspace.polhode(&["run", "study.toml", "--engine", "cpu", "--quiet", "--force", "--out", "inner"]);
    assert!(output.status.success(), "{}", words(&output.stderr));
    assert_eq!(workspace.names("inner"), ["final.csv", "plan.json", "report.json", "snapshots.csv", "study.toml"]);
    assert_eq!(hidden(workspace.folder()), [""; 0], "nothing is left");
}

#[test]
fn a_result_that_cannot_be_moved_into_its_folder_is_kept_whole() {
    let workspace = Workspace::new(&long_study().replace("end = 1e6", "end = 20.0"));
    let run = start(&workspace, "study.toml", &["--quiet", "--out", ".", "--force"]);
    wait_for_partial(&workspace.path("study.toml"));
    // A folder came meanwhile, where a file of the result belongs; files are moved one by one.
    fs::create_dir_all(workspace.path("final.csv/mine")).expect("made");
    let output = finished(run);
    let errors = words(&output.stderr);
    assert_eq!((output.status.code(), errors.lines().count()), (Some(1), 1), "{errors}");
    let kept = workspace.names(".").into_iter().find(|name| name.ends_with(".kept")).expect("what was kept");
    assert!(errors.ends_with(&format!("{kept}\n")), "{errors}");
    assert!(workspace.path(&kept).join("report.json").exists() && workspace.path(&kept).join("final.csv").exists());
    assert!(workspace.path("final.csv/mine").is_dir());
}

#[test]
fn a_users_own_files_and_folders_stay_where_they_are() {
    let workspace = Workspace::new("");
    fs::write(workspace.path("0.toml"), study(0)).expect("written");
    let folder = workspace.path("o");
    fs::create_dir_all(folder.join("notes")).expect("made");
    for name in ["states.csv", "final.feather", "notes.txt", "notes/a"] {
        fs::write(folder.join(name), "mine").expect("written");
    }
    let output = run(&workspace, 0, &folder, &["--force"]).wait_with_output().expect("the run ends");
    assert!(output.status.success(), "{}", words(&output.stderr));
    for name in ["states.csv", "final.feather", "notes.txt", "notes/a"] {
        assert_eq!(fs::read(folder.join(name)).expect("there"), b"mine", "{name}");
    }

    // A folder with the name of a table is in the way, and is left alone with all that is beside it.
    let former = fs::read(folder.join("final.csv")).expect("there");
    fs::remove_file(folder.join("snapshots.csv")).expect("removed");
    fs::create_dir(folder.join("snapshots.csv")).expect("made");
    let output = run(&workspace, 0, &folder, &["--force"]).wait_with_output().expect("the run ends");
    assert!(!output.status.success());
    assert!(words(&output.stderr).contains("the folder snapshots.csv in it has the name of a result's file"));
    assert_eq!(fs::read(folder.join("final.csv")).expect("there"), former);
    assert!(folder.join("snapshots.csv").is_dir());
}

#[test]
fn pictures_of_a_former_run_go_with_it() {
    let workspace = Workspace::new(&study(0));
    workspace.done(&["run", "study.toml", "--engine", "cpu", "--quiet"]);
    workspace.done(&["plot", "study.out", "--body", "3"]);
    fs::write(workspace.path("study.out/running.png"), "mine").expect("written");
    assert!(workspace.path("study.out/run-body-3.svg").exists());
    workspace.done(&["run", "study.toml", "--engine", "cpu", "--quiet", "--force"]);
    assert_eq!(workspace.names("study.out"), ["final.csv", "plan.json", "report.json", "running.png", "snapshots.csv"]);
}

#[test]
fn a_folder_deleted_mid_run_is_a_failure_of_the_run() {
    let workspace = Workspace::new(&long_study().replace("end = 1e6", "end = 20.0"));
    let run = start(&workspace, "study.toml", &["--quiet", "--out", "deep/study.out"]);
    let partial = wait_for_partial(&{
        while !workspace.path("deep").is_dir() {
            std::thread::sleep(Duration::from_millis(5));
        }
        workspace.path("deep/study.out")
    });
    fs::remove_dir_all(partial).expect("removed");
    let output = finished(run);
    let errors = words(&output.stderr);
    assert_eq!((output.status.code(), errors.lines().count()), (Some(1), 1), "{errors}");
    assert!(errors.contains("cannot be written: No such file or directory"), "{errors}");
    assert_eq!(workspace.names("."), ["study.toml"], "nothing is left");
}

#[test]
fn results_that_cannot_get_their_name_are_kept_and_named() {
    let workspace = Workspace::new(&study(0).replace(&format!("count = {BODIES}"), "count = 50_000"));
    let run = start(&workspace, "study.toml", &["--quiet", "--force"]);
    wait_for_partial(&workspace.path("study.out"));
    // Somebody else's file, which came meanwhile.
    fs::write(workspace.path("study.out"), "mine").expect("written");
    let output = finished(run);
    let errors = words(&output.stderr);
    assert_eq!((output.status.code(), errors.lines().count()), (Some(1), 1), "{errors}");
    let kept = workspace.names(".").into_iter().find(|name| name.ends_with(".kept")).expect("what was kept");
    assert!(errors.starts_with("error: study.out: cannot be written: Not a directory"), "{errors}");
    assert!(errors.ends_with(&format!("{kept}\n")), "{errors}");
    assert_eq!(workspace.names(&kept), ["final.csv", "plan.json", "report.json", "snapshots.csv"]);
    assert_eq!(fs::read_to_string(workspace.path("study.out")).expect("read"), "mine");
    assert_eq!(hidden(workspace.folder()), [""; 0], "nothing else is left");
}
