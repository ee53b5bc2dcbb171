//! Memory does not grow with the number of output times; a test file of its own, since the peak is that of the process.

#![cfg(all(feature = "study", target_os = "linux"))]

use std::ops::ControlFlow;
use std::time::Instant;

use polhode::record::OutputFolder;
use polhode::run::run_to_folder;
use polhode::study::{Format, Output, problem};
use polhode::{Engine, Method, Outputs, Plan, Scene};

const BODIES: usize = 20_000;
const OUTPUTS: usize = 100;

/// Much less than the states alone would take if they were kept: 20,000 × 100 × 11 numbers of 8 bytes, 176 MB.
const LIMIT: u64 = 100_000_000;

#[test]
fn a_hundred_output_times_take_no_more_memory_than_one() {
    let engine = Engine::cpu();
    let scene = Scene::new(problem::free(BODIES, 0).expect("valid"))
        .until(OUTPUTS as f64)
        .outputs(Outputs::Every(1.0))
        .pinned(Method::Rk4, 0.125, None);
    let plan = Plan::new(&scene, &engine).expect("valid");
    let folder = tempfile::tempdir().expect("a temporary folder");
    let output = Output { snapshots: true, format: Format::Npz, ..Output::default() };
    let target = OutputFolder::create(&folder.path().join("out"), false).expect("an empty folder");
    run_to_folder(&engine, &plan, None, &output, target, Instant::now(), &mut |_| ControlFlow::Continue(()))
        .expect("runs");

    let written = std::fs::metadata(folder.path().join("out/snapshots.npz")).expect("snapshots").len();
    assert!(written > LIMIT * 3 / 2, "{written} bytes written");
    let status = std::fs::read_to_string("/proc/self/status").expect("a system with /proc");
    let line = status.lines().find(|line| line.starts_with("VmHWM:")).expect("the peak of the resident set");
    let kibibytes: u64 = line.split_whitespace().nth(1).and_then(|x| x.parse().ok()).expect("a number");
    let peak = kibibytes * 1024;
    println!("peak {peak} bytes");
    assert!(peak < LIMIT, "peak {peak} bytes, more than {LIMIT}");
}
