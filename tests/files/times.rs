//! How long work takes: said before it begins, refused where it is too long, and ended by an interrupt.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use assert_cmd::cargo::cargo_bin;

use crate::cli::SMALL;
use crate::workspace::{Workspace, words};

#[cfg(unix)]
#[test]
fn an_interrupt_ends_the_run_and_leaves_nothing() {
    // Work for hours.
    let long = SMALL.replace("count = 10", "count = 100_000").replace("end = 4.0", "end = 1e6");
    let workspace = Workspace::new(&long);
    // The first snapshots are being written when the table has been begun.
    let begun = |partial: &Path| partial.join("snapshots.csv").exists();
    interrupt(&workspace, Duration::from_millis(300), || {
        partial_folder(&workspace).is_some_and(|partial| begun(&partial))
    });
}

#[cfg(unix)]
#[test]
fn an_interrupt_ends_planning_and_leaves_nothing() {
    // A tenth of a run of days.
    let (start, _) = SMALL.split_once("outputs").expect("outputs");
    let long = start.replace("count = 10", "count = 100_000").replace("end = 4.0", "end = 1e8");
    let drag = "[[torque]]\nmodel = \"linear-drag\"\ncoefficient = 1e-9\n";
    let workspace = Workspace::new(&format!("{long}{drag}"));
    // While bodies are drawn, and later.
    for after in [0, 300] {
        interrupt(&workspace, Duration::from_millis(after), || partial_folder(&workspace).is_some());
    }
}

/// The longest that a run may take to end when it is asked to.
#[cfg(unix)]
const LONGEST_END: Duration = Duration::from_secs(1);

#[cfg(unix)]
#[test]
fn an_interrupt_ends_every_stage_within_a_second() {
    let study = |bodies: &str, more: &str| format!("[bodies]\n{bodies}\n{more}");
    let many = "count = 6_000_000\ninertia = [1, 2, 2.5]\n\
                angular_velocity = { distribution = \"normal\", mean = [0, 0, 0], sigma = 0.5 }";
    let row = "1,2,2.5,0.123456789,0.987654321,0.555555555\n";
    let snapshots = "[time]\nend = 100.0\noutputs = { every = 2.5 }\n[output]\nsnapshots = true\n";
    let drag = "[[torque]]\nmodel = \"linear-drag\"\ncoefficient = 0.01\n";
    let adaptive = "[accuracy]\nmethod = \"rk8\"\ntolerance = 1e-13\n";
    let studies = [
        study(many, snapshots),
        study(many, &format!("{snapshots}format = \"npz\"\n")),
        study("file = \"bodies.csv\"", snapshots),
        study(many, &format!("{drag}[time]\nend = 1e4\n{adaptive}")),
        study("count = 1\ninertia = [1, 2, 2.5]\nangular_velocity = [1, 0.4, 0.1]", &{
            format!("{drag}[time]\nend = 1e9\n[accuracy]\nmethod = \"rk4\"\ndt = 1e-3\n")
        }),
    ];
    for (number, study) in studies.iter().enumerate() {
        for moment in [50, 900] {
            let workspace = Workspace::new(study);
            fs::write(workspace.path("bodies.csv"), format!("ixx,iyy,izz,wx,wy,wz\n{}", row.repeat(1_000_000)))
                .unwrap();
            let mut run = Command::new(cargo_bin!("polhode"))
                .current_dir(workspace.folder())
                .args(["run", "study.toml", "--engine", "cpu"])
                .stderr(std::process::Stdio::piped())
                .spawn()
                .expect("the command starts");
            std::thread::sleep(Duration::from_millis(moment));
            let begin = std::time::Instant::now();
            let asked = Command::new("kill").args(["-INT", &run.id().to_string()]).status().expect("kill starts");
            assert!(asked.success());
            let status = run.wait().expect("the run ends");
            let took = begin.elapsed();
            assert!(took < LONGEST_END, "study {number} takes {took:?} to end after {moment} ms");
            // Within the first milliseconds the signal does what it does by default.
            assert!(matches!(status.code(), Some(1) | None), "study {number}: {status}");
            assert_eq!(workspace.names("."), ["bodies.csv", "study.toml"], "nothing is left of study {number}");
        }
    }
}

/// The folder that a run writes to while it works.
#[cfg(unix)]
fn partial_folder(workspace: &Workspace) -> Option<PathBuf> {
    let is_partial = |name: &String| name.starts_with(".study.out.polhode-") && name.ends_with(".partial");
    workspace.names(".").into_iter().find(is_partial).map(|name| workspace.path(&name))
}

/// Interrupts a run some time `after` it has `begun`; it must end at once and leave nothing but the study.
#[cfg(unix)]
fn interrupt(workspace: &Workspace, after: Duration, begun: impl Fn() -> bool) {
    let run = Command::new(cargo_bin!("polhode"))
        .current_dir(workspace.folder())
        .args(["run", "study.toml", "--engine", "cpu"])
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .expect("the command starts");
    for _ in 0..6000 {
        if begun() {
            break;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    assert!(begun(), "the run does not begin");
    std::thread::sleep(after);
    let killed = Command::new("kill").args(["-INT", &run.id().to_string()]).status().expect("kill starts");
    assert!(killed.success());
    let output = run.wait_with_output().expect("the run ends");
    let errors = words(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{errors}");
    // A note before it says how long the run would have taken.
    let errors: Vec<_> = errors.lines().filter(|line| !line.starts_with("note: about ")).collect();
    assert_eq!(errors, ["error: stopped by the user: nothing was written"]);
    assert_eq!(workspace.names("."), ["study.toml"], "nothing is left");
}

/// What a run says by the time at which it writes, where it is then killed.
fn said_as_it_begins(workspace: &Workspace, arguments: &[&str]) -> String {
    let mut command = Command::new(cargo_bin!("polhode"));
    command.current_dir(workspace.folder()).args(arguments).stdout(Stdio::null()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("the command starts");
    let since = Instant::now();
    while !workspace.names(".").iter().any(|name| name.ends_with(".partial") || name.ends_with(".checkpoint")) {
        assert!(since.elapsed() < Duration::from_secs(60), "it does not begin");
        std::thread::sleep(Duration::from_millis(5));
    }
    std::thread::sleep(Duration::from_millis(300));
    child.kill().expect("killed");
    let errors = words(&child.wait_with_output().expect("it ends").stderr);
    let lines = workspace.names(".");
    for name in lines.iter().filter(|name| *name != "study.toml") {
        let path = workspace.path(name);
        let _ = fs::remove_dir_all(&path).or_else(|_| fs::remove_file(&path));
    }
    errors
}

/// Ten bodies in steps of 1e-13 s, of which a core takes some 1e7 a second.
fn in_tiny_steps(end: &str) -> Workspace {
    let study = SMALL.split("[time]").next().unwrap().to_owned();
    Workspace::new(&format!("{study}[time]\nend = {end}\n[accuracy]\nmethod = \"rk4\"\ndt = 1e-13\n"))
}

#[test]
fn a_run_of_days_says_so_before_it_begins() {
    let workspace = in_tiny_steps("3.0");
    for arguments in
        [&["run", "study.toml", "--engine", "cpu"][..], &["run", "study.toml", "--engine", "cpu", "--checkpoint", "60"]]
    {
        let errors = said_as_it_begins(&workspace, arguments);
        let lines: Vec<&str> = errors.lines().collect();
        assert!(
            lines[0].starts_with("note: about ")
                && lines[0].ends_with(" days of computing are expected; Ctrl-C ends the run"),
            "{errors}"
        );
        assert!(lines[1..].iter().all(|line| line.contains("to recompute 8 of its bodies")), "{errors}");
    }
    assert_eq!(said_as_it_begins(&workspace, &["run", "study.toml", "--engine", "cpu", "--quiet"]), "");
}

#[test]
fn a_run_whose_words_go_to_a_file_says_now_and_then_how_far_it_is() {
    let workspace = in_tiny_steps("3.0");
    let begin = |arguments: &[&str]| {
        let mut command = Command::new(cargo_bin!("polhode"));
        command.current_dir(workspace.folder()).args(["run", "study.toml", "--engine", "cpu"]).args(arguments);
        command.env("RAYON_NUM_THREADS", "1").stdout(Stdio::null()).stderr(Stdio::piped());
        command.spawn().expect("the command starts")
    };
    let mut quiet = begin(&["--out", "quiet", "--quiet"]);
    let mut told = begin(&["--out", "told"]);
    let mut lines = BufReader::new(told.stderr.take().expect("a pipe")).lines().map(|line| line.expect("text"));
    let line = lines.find(|line| line.contains("% done"));
    [&mut told, &mut quiet].into_iter().for_each(|run| run.kill().expect("killed"));
    told.wait().expect("it ends");
    let line = line.expect("a line");
    assert!(line.starts_with("note: 0.0 % done after ") && line.ends_with(" days left"), "{line:?}");
    assert!(!line.contains(char::is_control), "{line:?}");
    assert_eq!(words(&quiet.wait_with_output().expect("it ends").stderr), "");
}

#[test]
fn a_run_of_more_than_a_month_is_refused_unless_it_is_asked_for() {
    let workspace = in_tiny_steps("40.0");
    let run = ["run", "study.toml", "--engine", "cpu"];
    for arguments in [&run[..], &[&run[..], &["--quiet"]].concat(), &[&run[..], &["--checkpoint", "60"]].concat()] {
        let line = workspace.refused(arguments, 2);
        assert!(line.starts_with("error: study.toml:10: time.end = 40.0: about "), "{line}");
        assert!(line.contains(" days of computing are expected: ") && line.contains("--however-long"), "{line}");
        assert_eq!(workspace.names("."), ["study.toml"], "{arguments:?}");
    }
    let errors = said_as_it_begins(&workspace, &[&run[..], &["--however-long"]].concat());
    assert!(errors.contains(" days of computing are expected; Ctrl-C ends the run"), "{errors}");
}

#[test]
fn planning_that_takes_long_says_how_long_it_takes_at_most() {
    // Two classes of tops of 48,000 turns a second, each of which is planned for some seconds.
    let study = r#"
[bodies]
count = 400
inertia = [1.0, 1.0, 2.0]
orientation = { distribution = "uniform" }
angular_velocity = [0.1, 0.4, 300000.0]
[[torque]]
model = "heavy-top"
mass = 1.0
centre = [0, 0, 0.1]
gravity = [0, 0, -9.81]
[[torque]]
model = "heavy-top"
mass = { distribution = "mixture", weights = [1, 1], of = [0.0, 1e-3] }
centre = [0, 0, 0.1]
gravity = [0, 0, -9.81]
[time]
end = 100.0
"#;
    let workspace = Workspace::new(study);
    let since = Instant::now();
    let mut command = Command::new(cargo_bin!("polhode"));
    let output = command.current_dir(workspace.folder()).args(["explain", "study.toml", "--engine", "cpu"]).output();
    let (taken, errors) = (since.elapsed().as_secs_f64(), words(&output.expect("it runs").stderr));
    let said = errors.lines().find_map(|line| line.strip_prefix("note: methods and steps are tried on some bodies, "));
    let said = said.unwrap_or_else(|| panic!("{taken} s: {errors}"));
    let amount: f64 = said.split(' ').nth(2).and_then(|amount| amount.parse().ok()).expect(said);
    let most = if said.contains("minutes") { 60.0 * amount } else { amount };
    assert!(taken < most, "{taken} s: {said}");
}
