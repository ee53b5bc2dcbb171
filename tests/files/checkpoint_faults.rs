//! Checkpoints whose pieces are damaged, and disks and folders that fail under them.

#![cfg(feature = "cli")]

use std::fs;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use assert_cmd::cargo::cargo_bin;

use crate::checkpoints::{assert_same, stopped, whole};
use crate::in_parts::{STATISTICS, done, tables};
use crate::workspace::{Workspace, words};

/// Pieces that are cut, altered or missing are computed again, and no others.
#[test]
#[cfg(unix)]
fn damaged_pieces_are_computed_again() {
    type Spoil = fn(&[u8]) -> Vec<u8>;
    let study = STATISTICS.replace("count = 900", "count = 2000").replace("final = false", "snapshots = true");
    let workspace = Workspace::new(&study);
    let whole = whole(&workspace, "cpu");
    stopped(&workspace, &[]);
    let place = workspace.path("out.checkpoint");
    fs::rename(&place, workspace.path("kept")).expect("renamed");
    let mut pieces: Vec<(usize, String)> = workspace
        .names("kept")
        .into_iter()
        .filter_map(|name| {
            let first = name.strip_prefix("bodies-")?.split_once('-')?.0.parse().ok()?;
            Some((first, name))
        })
        .collect();
    pieces.sort();
    // The one under way was finished.
    assert!(pieces.len() > 1, "{pieces:?}");
    let replaced = |bytes: &[u8], from: &str, to: &str| {
        let text = words(bytes);
        assert!(text.contains(from), "{text}");
        text.replace(from, to).into_bytes()
    };
    let altered: [(&str, Spoil, &str); 6] = [
        ("snapshots.csv", |bytes| bytes[..bytes.len() - 1].to_vec(), "it is not as its run wrote it"),
        ("blocks.jsonl", |bytes| [bytes, b" "].concat(), "it is not as its run wrote it"),
        // Numbers that no sum of another file holds.
        ("part.json", |bytes| bytes[..bytes.len() - 9].to_vec(), "expected what a run"),
        ("part.json", |bytes| [b" ", bytes].concat(), "it is not as its run wrote it: its sum differs"),
        ("plan.json", |bytes| [bytes, b"\n"].concat(), "it is not as its run wrote it"),
        ("report.json", |_| Vec::new(), "it is not as its run wrote it"),
    ];
    let resumed = |piece: &str, word: &str| {
        let run = ["run", "study.toml", "--out", "out", "--engine", "cpu", "--quiet", "--resume", "--checkpoint", "60"];
        let output = workspace.polhode(&run);
        let error = words(&output.stderr);
        assert!(output.status.success(), "{error}");
        let bodies = piece.strip_prefix("bodies-").expect("a piece").replace('-', " to ");
        let expected = format!("note: bodies {bodies} are computed again: out.checkpoint");
        assert!(error.starts_with(&expected) && error.contains(word) && error.lines().count() == 1, "{error}");
        assert!(!error.contains("--force"), "{error}");
        assert_same(&whole, &tables(&workspace, "out"));
        assert!(!place.exists());
        fs::remove_dir_all(workspace.path("out")).expect("removed");
    };
    let put_back = || {
        let copied = Command::new("cp").arg("-r").args([&workspace.path("kept"), &place]).status().expect("cp");
        assert!(copied.success());
    };
    let (first, last) = (&pieces[0].1, &pieces[pieces.len() - 1].1);
    for (index, (name, spoil, word)) in altered.into_iter().enumerate() {
        put_back();
        let piece = if index % 2 == 0 { first } else { last };
        let path = place.join(piece).join(name);
        fs::write(&path, spoil(&fs::read(&path).expect("a file"))).expect("written");
        resumed(piece, word);
    }
    for name in ["", "part.json", "snapshots.csv"] {
        put_back();
        let path = place.join(first).join(name);
        fs::remove_dir_all(&path).or_else(|_| fs::remove_file(&path)).expect("removed");
        resumed(first, if name.is_empty() { "no piece has them" } else { name });
    }
    // Allowed failures are in no other file.
    put_back();
    let path = place.join(first).join("part.json");
    let part = replaced(&fs::read(&path).expect("a file"), "\"allowed_failures\":0", "\"allowed_failures\":9");
    fs::write(&path, part).expect("written");
    resumed(first, "its sum differs");
}

/// A limit on the size of files, in KiB, stands for a disk that fills up: with a piece, or with what the pieces make together.
#[test]
#[cfg(unix)]
fn a_full_disk_at_any_stage_leaves_what_resume_goes_on_with() {
    // A piece of 64 bodies, and few of one each, which all wait for the disk.
    let study = STATISTICS.replace("count = 900", "count = 160").replace("final = false", "snapshots = true");
    let workspace = Workspace::new(&study);
    let whole = whole(&workspace, "cpu");
    let (mut in_pieces, mut in_tables) = (0, 0);
    for limit in [1, 3, 12, 30, 60, 120] {
        let script = format!(
            "trap '' XFSZ; ulimit -f {limit}; exec '{}' run study.toml --out out --engine cpu --quiet --checkpoint 1e-9",
            cargo_bin!("polhode").display()
        );
        let run = Command::new("bash").current_dir(workspace.folder()).args(["-c", &script]).output();
        let output = run.expect("bash starts");
        let errors = words(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{limit} KiB: {errors}");
        assert!(errors.contains("cannot be written: File too large"), "{errors}");
        assert!(!workspace.path("out").exists(), "{limit} KiB");
        match errors.contains("error: out/") {
            true => in_tables += 1,
            false => in_pieces += 1,
        }
        if workspace.path("out.checkpoint").exists() {
            let kept = workspace.names("out.checkpoint");
            assert!(kept.iter().all(|name| !name.starts_with('.')), "{kept:?}");
        }
        done(&workspace, 2, &["run", "study.toml", "--out", "out", "--engine", "cpu", "--quiet", "--resume"]);
        assert_same(&whole, &tables(&workspace, "out"));
        fs::remove_dir_all(workspace.path("out")).expect("removed");
    }
    assert!(in_pieces > 0 && in_tables > 0, "{in_pieces} within a piece, {in_tables} within a table");
}

/// The folder of pieces goes while they are computed, a piece goes before they are taken up, or something else has the folder's name.
#[test]
#[cfg(unix)]
fn folders_that_vanish_or_cannot_be_written_are_named() {
    let study = STATISTICS.replace("count = 900", "count = 2000").replace("final = false", "snapshots = true");
    let workspace = Workspace::new(&study);
    let whole = whole(&workspace, "cpu");
    let run = ["run", "study.toml", "--out", "out", "--engine", "cpu", "--quiet", "--checkpoint", "1e-9"];
    let mut command = Command::new(cargo_bin!("polhode"));
    command.current_dir(workspace.folder()).args(run).stdout(Stdio::null()).stderr(Stdio::piped());
    let child = command.spawn().expect("the command starts");
    let place = workspace.path("out.checkpoint");
    let clock = Instant::now();
    while !(place.is_dir() && workspace.names("out.checkpoint").len() > 4) && clock.elapsed() < Duration::from_secs(60)
    {
        std::thread::sleep(Duration::from_millis(1));
    }
    fs::rename(&place, workspace.path("elsewhere")).expect("renamed");
    let output = child.wait_with_output().expect("it ends");
    let errors = words(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{errors}");
    assert!(errors.contains("out.checkpoint"), "{errors}");
    assert!(!workspace.path("out").exists());

    // What is elsewhere is whole: it goes on from there.
    let _ = fs::remove_dir_all(&place);
    fs::rename(workspace.path("elsewhere"), &place).expect("renamed");
    let again = ["run", "study.toml", "--out", "out", "--engine", "cpu", "--quiet", "--resume"];
    done(&workspace, 2, &again);
    assert_same(&whole, &tables(&workspace, "out"));

    fs::remove_dir_all(workspace.path("out")).expect("removed");
    fs::write(&place, "mine").expect("written");
    let error = workspace.refused(&again, 2);
    assert!(error.contains("out.checkpoint: cannot be read: Not a directory"), "{error}");
    assert_eq!(fs::read_to_string(&place).expect("read"), "mine");
}
