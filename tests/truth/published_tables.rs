//! The attitude errors of `polhode bench accuracy`, held against tables that were measured by another program on other draws of
//! the same problems.
#![cfg(feature = "study")]

use glam::DQuat;
use polhode::engine::batch::prepare_with;
use polhode::engine::{End, Engine, unobserved};
use polhode::math::Precision;
use polhode::study::problem;
use polhode::torque::Torque;
use polhode::{Ensemble, Method};

/// Bodies of the tables.
const BODIES: usize = 4096;

/// Draws whose median is compared; the first is that of the benchmarks.
const SEEDS: [u64; 5] = [1, 2, 3, 4, 5];

/// How far the 99th percentile of one draw of 4,096 bodies may lie from the median of others, as a factor: of 16 draws the
/// farthest is at 1.45, of `rk8`, whose error goes as the ninth power of the fastest bodies' spin.
const SCATTER: f64 = 1.5;

/// Simulated time, s.
const SPAN: f64 = 10.0;

/// Steps of `rk8` that are exact here: the error is 1e-8 of that of 100 steps.
const EXACT: u64 = 1000;

/// Problem, method, steps over ten seconds, 99th percentile of the attitude error, rad; `f64`, equal steps for all bodies.
const PUBLISHED: [(&str, Method, u64, f64); 16] = [
    ("free", Method::Rk4, 34, 1.6e-2),
    ("free", Method::Rk4, 100, 2.4e-4),
    ("free", Method::Rk4, 334, 1.9e-6),
    ("free", Method::Rk4, 1000, 2.4e-8),
    ("free", Method::Rk8, 10, 1.8e-4),
    ("free", Method::Rk8, 20, 8.7e-7),
    ("free", Method::Rk8, 50, 5.7e-10),
    ("free", Method::Rk8, 100, 2.2e-12),
    ("forced", Method::Rk4, 34, 0.67),
    ("forced", Method::Rk4, 100, 3.0e-2),
    ("forced", Method::Rk4, 334, 2.5e-4),
    ("forced", Method::Rk4, 1000, 3.2e-6),
    ("forced", Method::Rk8, 10, 2.0),
    ("forced", Method::Rk8, 20, 2.5e-3),
    ("forced", Method::Rk8, 50, 5.6e-6),
    ("forced", Method::Rk8, 100, 2.2e-8),
];

/// The attitudes after `steps` equal steps.
fn stepped(ensemble: &Ensemble, torques: &[Torque], method: Method, steps: u64) -> Vec<DQuat> {
    let (frames, batch) = prepare_with(ensemble, torques, SPAN, Precision::F64).expect("prepared");
    let mut session = Engine::cpu().start(batch, method).expect("started");
    session.advance_to(End::of_steps(SPAN / steps as f64, steps), &mut unobserved).expect("advanced");
    let words = session.read(0..frames.len()).expect("read");
    frames.iter().enumerate().map(|(body, frame)| frame.body_state(words.combined(body)).orientation).collect()
}

fn p99(found: &[DQuat], exact: &[DQuat]) -> f64 {
    let angle = |(a, b): (&DQuat, &DQuat)| {
        let between = a.conjugate() * *b;
        2.0 * between.xyz().length().atan2(between.w.abs())
    };
    let mut errors: Vec<f64> = found.iter().zip(exact).map(angle).collect();
    errors.sort_by(f64::total_cmp);
    errors[(0.99 * errors.len() as f64).ceil() as usize - 1]
}

#[test]
fn errors_are_those_of_the_published_tables() {
    let mut errors = vec![Vec::new(); PUBLISHED.len()];
    for seed in SEEDS {
        let (ensemble, torques) = problem::forced(BODIES, seed).expect("enough memory");
        for (name, torques) in [("free", &[] as &[Torque]), ("forced", &torques)] {
            let exact = stepped(&ensemble, torques, Method::Rk8, EXACT);
            let rows = PUBLISHED.iter().zip(&mut errors).filter(|(row, _)| row.0 == name);
            for (&(_, method, steps, _), errors) in rows {
                errors.push(p99(&stepped(&ensemble, torques, method, steps), &exact));
            }
        }
    }
    let mut misses = Vec::new();
    for ((name, method, steps, published), mut errors) in PUBLISHED.into_iter().zip(errors) {
        errors.sort_by(f64::total_cmp);
        let median = errors[SEEDS.len() / 2];
        let line = format!("{name}, {method}, {steps} steps: {median:.1e} rad, published {published:.1e}");
        println!("{line}");
        if !(published / SCATTER..=published * SCATTER).contains(&median) {
            misses.push(line);
        }
    }
    assert!(misses.is_empty(), "{misses:#?}");
}
