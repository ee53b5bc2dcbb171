//! The peak memory of a run; a test file of its own for each engine, since the peak is that of the process.

use polhode::math::Precision;
use polhode::study::problem;
use polhode::{Engine, Method, Plan, Scene};

/// What the issue asks for, in bytes.
const LIMIT: u64 = 600_000_000;

const BODIES: usize = 1_000_000;
/// Runs a million bodies and holds the process's peak against the limit.
pub fn check(engine: &Engine, steps: u32) {
    let dt = 1.0 / 64.0;
    let scene = Scene::new(problem::free(BODIES, 1).expect("valid")).until(f64::from(steps) * dt).pinned(
        Method::Rk4,
        dt,
        Some(Precision::F32),
    );
    let record = engine.run(&Plan::new(&scene, engine).expect("valid")).expect("runs");
    assert_eq!(record.final_state().len(), BODIES);
    assert_eq!(record.trust().body_steps, BODIES as u64 * u64::from(steps));
    assert_eq!(record.trust().failed_bodies, Vec::<usize>::new());
    // Systems that do not say it in this way measure nothing, and this test says so.
    let status = std::fs::read_to_string("/proc/self/status").expect("a system with /proc");
    let line = status.lines().find(|line| line.starts_with("VmHWM:")).expect("the peak of the resident set");
    let kibibytes: u64 = line.split_whitespace().nth(1).and_then(|x| x.parse().ok()).expect("a number");
    let peak = kibibytes * 1024;
    println!("peak {peak} bytes, wall time {:?}", record.trust().wall_time);
    assert!(peak < LIMIT, "peak {peak} bytes, more than {LIMIT}");
}
