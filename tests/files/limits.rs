//! What does not fit is refused before work begins: memory, disk, threads.

#![cfg(all(target_os = "linux", feature = "cli"))]

use std::process::{Command, Output};

use assert_cmd::cargo::cargo_bin;

use crate::workspace;

use workspace::{Workspace, words};

/// A study of so many bodies in two steps.
fn study(bodies: u64) -> String {
    format!(
        "[bodies]\ncount = {bodies}\ninertia = [1.0, 2.0, 2.5]\norientation = {{ distribution = \"uniform\" }}\n\
         angular_velocity = [0.1, 0.2, 0.3]\n[[torque]]\nmodel = \"linear-drag\"\ncoefficient = 0.1\n\
         [time]\nend = 0.1\n[accuracy]\nmethod = \"rk4\"\ndt = 0.05\n[output]\n"
    )
}

/// Runs the command under `limits` of bash's `ulimit`.
fn limited(workspace: &Workspace, limits: &str, arguments: &str, threads: &str) -> Output {
    let script = format!("{limits}; exec '{}' {arguments}", cargo_bin!("polhode").display());
    let mut bash = Command::new("bash");
    bash.current_dir(workspace.folder())
        .env("RAYON_NUM_THREADS", threads)
        .args(["-c", &script])
        .output()
        .expect("bash starts")
}

/// The one line of a refusal.
fn refused(output: &Output, status: i32) -> String {
    let errors = words(&output.stderr);
    assert_eq!((output.status.code(), errors.lines().count()), (Some(status), 1), "{errors}");
    errors
}

#[test]
fn three_million_bodies_under_a_limit_of_memory_are_refused_and_do_not_abort() {
    let workspace = Workspace::new(&study(3_000_000));
    for limit in ["-v 400000", "-v 600000", "-v 800000", "-v 1000000", "-d 300000", "-d 600000"] {
        // All in memory together: otherwise they are computed in pieces.
        let run = "run study.toml --engine cpu --quiet --no-skip";
        let line = refused(&limited(&workspace, &format!("ulimit {limit}"), run, "2"), 2);
        assert!(
            line.starts_with(
                "error: study.toml:2: bodies.count = 3000000: 3000000 bodies: their run needs 900000000 bytes, "
            ),
            "{limit}: {line}"
        );
        assert_eq!(workspace.names("."), ["study.toml"], "nothing is left");
    }
    for limit in ["-v 1000000", "-d 1000000"] {
        std::fs::write(workspace.path("study.toml"), study(1000)).expect("written");
        let run = "run study.toml --engine cpu --quiet --force";
        let output = limited(&workspace, &format!("ulimit {limit}"), run, "2");
        assert!(output.status.success(), "{limit}: {}", words(&output.stderr));
    }
}

#[test]
fn threads_that_make_no_sense_or_are_refused_are_an_error_and_no_panic() {
    let workspace = Workspace::new(&study(10));
    for threads in ["99999999", "-1", "two", "1e3"] {
        let line = refused(&limited(&workspace, "true", "explain study.toml --engine cpu", threads), 2);
        let expected = format!(
            "error: RAYON_NUM_THREADS = {threads}: expected a number of threads up to 4096, 0 for one per core\n"
        );
        assert_eq!(line, expected);
    }
    for command in ["explain study.toml", "run study.toml --engine cpu", "verify --engine cpu --bodies 2", "devices"] {
        let line = refused(&limited(&workspace, "ulimit -v 300000", command, "1000"), 1);
        assert!(line.starts_with("error: no threads to compute with: "), "{command}: {line}");
    }
    for threads in ["", "0", "1", "3"] {
        let output = limited(&workspace, "true", "explain study.toml --engine cpu", threads);
        assert!(output.status.success(), "{threads:?}: {}", words(&output.stderr));
    }
}

#[test]
fn a_trillion_rows_are_refused_before_they_are_begun() {
    for format in ["csv", "npz"] {
        let more = format!("snapshots = true\nformat = \"{format}\"\n");
        let workspace =
            Workspace::new(&(study(1_000_000).replace("end = 0.1", "end = 1e6\noutputs = { every = 1.0 }") + &more));
        let line = workspace.refused(&["run", "study.toml", "--engine", "cpu"], 2);
        assert!(
            line.starts_with("error: study.out: 1000001000000 rows need ") && line.contains(" are free: "),
            "{line}"
        );
        assert_eq!(workspace.names("."), ["study.toml"], "nothing is left");
    }
}
