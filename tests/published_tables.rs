//! The attitude errors of `polhode bench accuracy`, held against tables that were measured by another program on other draws of
//! the same problems.
#![cfg(feature = "bench")]

use polhode::Method;
use polhode::batch::{BodyState, Precision, prepare_with};
use polhode::bench::problem::{Problem, Truth};
use polhode::engine::{Engine, unobserved};

/// Bodies of the tables.
const BODIES: usize = 4096;

/// How far a 99th percentile of 4,096 draws may lie from that of 4,096 others, as a factor. Over 16 seeds the 99th percentiles
/// of these cases lie within 1.4 (`rk4`) and 1.6 (`rk8`) of their median; both sides have such a scatter.
const SCATTER: f64 = 2.0;

/// Problem, method, steps over ten seconds, 99th percentile of the attitude error, rad; `f64`. Equal steps for all bodies,
/// where they are short enough for the error to follow its order.
const PUBLISHED: [(&str, Method, u64, f64); 11] = [
    ("free", Method::Rk4, 34, 1.6e-2),
    ("free", Method::Rk4, 100, 2.4e-4),
    ("free", Method::Rk4, 334, 1.9e-6),
    ("free", Method::Rk4, 1000, 2.4e-8),
    ("free", Method::Rk8, 20, 8.7e-7),
    ("free", Method::Rk8, 50, 5.7e-10),
    ("forced", Method::Rk4, 100, 3.0e-2),
    ("forced", Method::Rk4, 334, 2.5e-4),
    ("forced", Method::Rk4, 1000, 3.2e-6),
    ("forced", Method::Rk8, 50, 5.6e-6),
    ("forced", Method::Rk8, 100, 2.2e-8),
];

/// The states after `steps` equal steps.
fn stepped(problem: &Problem, method: Method, steps: u64) -> Vec<BodyState> {
    let (frames, batch) =
        prepare_with(&problem.ensemble, &problem.torques, problem.span, Precision::F64).expect("prepared");
    let mut session = Engine::cpu().start(batch, method).expect("started");
    session.advance(problem.span / steps as f64, steps, &mut unobserved).expect("advanced");
    let words = session.read(0..frames.len()).expect("read");
    frames.iter().enumerate().map(|(body, frame)| frame.body_state(words.combined(body))).collect()
}

#[test]
fn errors_are_those_of_the_published_tables() {
    let mut misses = Vec::new();
    for name in ["free", "forced"] {
        let problem = Problem::named(name, BODIES).expect("enough memory").expect("a problem");
        let truth = Truth::of(&problem).expect("a truth");
        for (_, method, steps, published) in PUBLISHED.iter().filter(|row| row.0 == name) {
            let error = truth.errors(&stepped(&problem, *method, *steps)).attitude.p99;
            println!("{name} {method} {steps}: {error:.1e}, published {published:.1e}");
            if !(published / SCATTER..=published * SCATTER).contains(&error) {
                misses.push(format!("{name}, {method}, {steps} steps: {error:.1e} rad, published {published:.1e}"));
            }
        }
    }
    assert!(misses.is_empty(), "{misses:#?}");
}
