//! Time of adaptive steps to an attitude error, on the problems of `bench`, on both engines.
#![cfg(feature = "bench")]

mod common;

use polhode::Engine;
use polhode::batch::{Precision, prepare_members};
use polhode::bench::problem::{Problem, Truth};
use polhode::engine::adaptive::{AdaptiveSteps, StepCounts};
use polhode::engine::{Backend, unobserved};
use polhode::method::rk8_adaptive::least_tolerance;
use polhode::method::work::order;
use polhode::plan::Members;
use polhode::record::Quantiles;

const BODIES: usize = 4096;
const RUNS: usize = 5;

/// What one run came to.
struct Outcome {
    attitude: Quantiles,
    seconds: f64,
    attempts: u64,
    rejected: u64,
    imbalance: f64,
}

fn run(engine: &Engine, (problem, truth): (&Problem, &Truth), precision: Precision, tolerance: f64) -> Outcome {
    let spins: Vec<f64> = problem.ensemble.angular_velocity_body().iter().map(|omega| omega.length()).collect();
    let members = Members::Some(order(&spins).into_iter().map(|body| body as u32).collect());
    let (frames, batch) =
        prepare_members(&problem.ensemble, &problem.torques, problem.span, &members, precision).expect("enough memory");
    let steps = AdaptiveSteps { tolerance, least_step: None };
    let mut session = engine.start_adaptive(batch, steps).expect("started");
    let clock = std::time::Instant::now();
    session.advance_to(problem.span, &mut unobserved).expect("advanced");
    let words = session.read(0..BODIES).expect("read");
    let seconds = clock.elapsed().as_secs_f64();
    let mut states = vec![frames[0].body_state(words.combined(0)); BODIES];
    for (row, frame) in frames.iter().enumerate() {
        states[members.body(row)] = frame.body_state(words.combined(row));
    }
    let counts = session.counts().expect("counted");
    Outcome {
        attitude: truth.errors(&states).attitude,
        seconds,
        attempts: counts.iter().map(StepCounts::attempts).sum(),
        rejected: counts.iter().map(|counts| counts.rejected).sum(),
        imbalance: session.imbalance().expect("measured"),
    }
}

/// The greatest tolerance, by factors of √10, with which the 99th percentile comes to an error, and what it takes.
#[test]
#[ignore = "a measurement: run with --release --nocapture, on a quiet machine"]
fn time_to_an_error() {
    for name in ["free", "forced"] {
        let problem = Problem::named(name, BODIES).expect("enough memory").expect("a problem");
        let truth = Truth::of(&problem).expect("a truth");
        let posed = (&problem, &truth);
        for (engine_name, engine) in [("CPU", Engine::cpu()), ("GPU", common::gpu())] {
            for (precision, target) in [(Precision::F32, 1e-5), (Precision::F64, 1e-5), (Precision::F64, 1e-9)] {
                let least = least_tolerance(precision);
                let tolerances = (6..30).map(|half| 10.0_f64.powf(-0.5 * f64::from(half)));
                let mut fitting = tolerances.take_while(|tolerance| *tolerance > 0.9 * least).map(|t| t.max(least));
                let fits = |&tolerance: &f64| run(&engine, posed, precision, tolerance).attitude.p99 <= target;
                let Some(tolerance) = fitting.find(fits) else {
                    let attitude = run(&engine, posed, precision, least).attitude;
                    println!(
                        "{name} {engine_name} {precision}: {target:e} rad is not reached: {attitude:?} at {least:e}"
                    );
                    continue;
                };
                let mut runs: Vec<_> = (0..RUNS).map(|_| run(&engine, posed, precision, tolerance)).collect();
                runs.sort_by(|a, b| a.seconds.total_cmp(&b.seconds));
                let Outcome { attitude, seconds, attempts, rejected, imbalance } = &runs[RUNS / 2];
                println!(
                    "{name} {engine_name} {precision} to {target:e}: tolerance {tolerance:.1e}, error p99 {:.1e} max {:.1e}, \
                     {seconds:.4} s (least {:.4}), {:.2e} body s/s, {attempts} attempts, {rejected} refused, \
                     imbalance {imbalance:.3}",
                    attitude.p99,
                    attitude.max,
                    runs[0].seconds,
                    BODIES as f64 * problem.span / seconds,
                );
            }
        }
    }
}
