//! What torques cost: `cargo bench --bench torques`.
//!
//! rk4 on the bodies of the *free* problem, in body-steps a second of wall time on one core, without torques, under the
//! constant torque and drag of the *forced* problem, and under each other model; beside it the time that a body-step
//! takes longer than a free one. Then what a formula of the user's own costs: models written down again, in both precisions, by rk4 and in
//! adaptive steps of rk8, as the speed of the model over that of its copy, both measured in turn.

use std::time::Instant;

use glam::{DMat3, DQuat, DVec3};
use polhode::engine::batch::prepare_with;
use polhode::engine::{Backend, End, Engine, unobserved};
use polhode::math::Precision;
use polhode::scene::AdaptiveSteps;
use polhode::study::problem;
use polhode::torque::variable_inertia::{InertiaChange, Law};
use polhode::torque::{Orbit, Parameters, Torque};
use polhode::{Ensemble, Method};

const BODIES: usize = 4096;
const STEPS: u64 = 1000;
const RUNS: usize = 7;

/// The least time of a body-step over some runs, s.
fn body_step(ensemble: &Ensemble, torques: &[Torque], precision: Precision) -> f64 {
    let engine = Engine::cpu();
    let batch = prepare_with(ensemble, torques, 1e3, precision).expect("enough memory").1;
    let mut session = engine.start(batch, Method::Rk4).expect("started");
    let mut least = f64::INFINITY;
    for _ in 0..RUNS {
        let clock = Instant::now();
        session.advance_to(End::of_steps(0.01, STEPS), &mut unobserved).expect("advanced");
        least = least.min(clock.elapsed().as_secs_f64());
    }
    least / (BODIES as f64 * STEPS as f64)
}

/// The least time of a run in adaptive steps over some, s.
fn adaptive(ensemble: &Ensemble, torque: &Torque, precision: Precision) -> f64 {
    let engine = Engine::cpu();
    let tolerance = if precision == Precision::F64 { 1e-9 } else { 1e-5 };
    let seconds = || {
        let batch = prepare_with(ensemble, std::slice::from_ref(torque), 1e3, precision).expect("enough memory").1;
        let steps = AdaptiveSteps { tolerance, least_step: None };
        let mut session = engine.start_adaptive(batch, steps).expect("started");
        let clock = Instant::now();
        session.advance_to(End::at(10.0), &mut unobserved).expect("advanced");
        clock.elapsed().as_secs_f64()
    };
    (0..RUNS).map(|_| seconds()).fold(f64::INFINITY, f64::min)
}

/// Models, and the same as a user would write them.
fn copies() -> Vec<(&'static str, Torque, Torque)> {
    let (u, v) = (DVec3::new(0.1, -0.2, 0.3), DVec3::new(0.4, 0.2, -0.1));
    let parameters = || Parameters::new().vector("u", u).and_then(|p| p.vector("v", v)).expect("names");
    let custom = |text: &str| Torque::custom(text, parameters()).expect("a formula");
    let place = "let s = kepler_sin(time, 0.1);\nlet c = kepler_cos(time, 0.1);\nlet size = 1 - 0.1 * c;\n\
                 let r = to_body(vec(c - 0.1, sqrt(0.99) * s, 0) / size);\n";
    vec![
        (
            "quadratic-drag",
            Torque::quadratic_drag(0.1),
            custom("-(angular_velocity * (0.1 * sqrt(dot(angular_velocity, angular_velocity))))"),
        ),
        ("heavy-top", Torque::heavy_top(1.0, u, v), custom("cross(u, to_body(v))")),
        ("magnetic-dipole", Torque::magnetic_dipole(u, v), custom("cross(u, to_body(v))")),
        (
            "eddy-current",
            Torque::eddy_current(0.1, v),
            custom("let b = to_body(v);\n0.1 * cross(cross(angular_velocity, b), b)"),
        ),
        (
            "gravity-gradient, elliptic",
            Torque::gravity_gradient(Orbit::kepler(1.0, 1.0, 0.1)),
            custom(&format!("{place}(3 / (size * size * size)) * cross(r, inertia * r)")),
        ),
    ]
}

fn main() {
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().expect("one thread");
    let (ensemble, forced) = problem::forced(BODIES, 42).expect("enough memory");
    let drag: Vec<f64> = (0..BODIES).map(|body| 0.01 + 1e-5 * body as f64).collect();
    let target = DQuat::from_xyzw(0.1, 0.3, -0.2, 0.8);
    let (u, v) = (DVec3::new(0.1, -0.2, 0.3), DVec3::new(0.4, 0.2, -0.1));
    let scenes = [
        ("free", vec![]),
        ("constant-body and linear-drag", forced.to_vec()),
        ("constant-world", vec![Torque::constant_world(u)]),
        ("matrix-drag", vec![Torque::matrix_drag(DMat3::from_diagonal(DVec3::new(0.1, 0.2, 0.3)))]),
        ("quadratic-drag", vec![Torque::quadratic_drag(0.1)]),
        ("sinusoidal", vec![Torque::sinusoidal(u, v, 1.5)]),
        ("sinusoidal, a rate a body", vec![Torque::sinusoidal(u, v, drag)]),
        ("gravity-gradient", vec![Torque::gravity_gradient(Orbit::circular(1.0, 1.0))]),
        ("gravity-gradient, elliptic", vec![Torque::gravity_gradient(Orbit::kepler(1.0, 1.0, 0.1))]),
        ("heavy-top", vec![Torque::heavy_top(1.0, u, v)]),
        ("magnetic-dipole", vec![Torque::magnetic_dipole(u, v)]),
        ("orbiting-dipole", vec![Torque::orbiting_dipole(u, Orbit::circular(1.0, 1.0), 1.0, 0.2, 0.0, 0.1)]),
        ("eddy-current", vec![Torque::eddy_current(0.1, v)]),
        (
            "orbiting-eddy-current",
            vec![Torque::orbiting_eddy_current(0.1, Orbit::circular(1.0, 1.0), 1.0, 0.2, 0.0, 0.1)],
        ),
        ("sine-spring", vec![Torque::sine_spring(1.0, target)]),
        ("log-spring", vec![Torque::log_spring(1.0, target)]),
        ("white-noise", vec![Torque::white_noise(0.1, 1)]),
        ("internal-dissipation", vec![Torque::internal_dissipation(0.01)]),
        ("variable-inertia", vec![Torque::variable_inertia(InertiaChange::factor(0.5), Law::oscillation(1.5))]),
    ];
    println!("{:30} {:>4} {:>12} {:>12}", "torques", "", "steps/s", "ns over free");
    for precision in Precision::ALL {
        let mut free = 0.0;
        for (name, torques) in &scenes {
            let seconds = body_step(&ensemble, torques, precision);
            if torques.is_empty() {
                free = seconds;
            }
            println!("{name:30} {precision:>4} {:12.3e} {:12.2}", 1.0 / seconds, (seconds - free) * 1e9);
        }
    }
    println!("\n{:30} {:>12} {:>12} {:>12} {:>12}", "model over its copy", "rk4 f32", "rk4 f64", "rk8 f32", "rk8 f64");
    for (name, model, copy) in &copies() {
        print!("{name:30}");
        for precision in Precision::ALL {
            let seconds = |torque: &Torque| body_step(&ensemble, std::slice::from_ref(torque), precision);
            print!(" {:12.2}", seconds(model) / seconds(copy));
        }
        for precision in Precision::ALL {
            print!(" {:12.2}", adaptive(&ensemble, model, precision) / adaptive(&ensemble, copy, precision));
        }
        println!();
    }
}
