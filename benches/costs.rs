//! The figures of the shipped cost table (`src/plan/cost.rs`): error coefficients and times of a step.
//!
//! ```text
//! RAYON_NUM_THREADS=1 cargo bench --bench costs
//! ```
//!
//! 4,096 bodies over 10 s, free, and under a constant torque and linear drag. A body that turns by α rad in steps of θ rad has the attitude
//! error c θ^order α; for each step size the 99th percentile of c over the bodies is printed, of `f64`, with the 99th percentile of
//! the error itself, and the median time of a step.

use std::time::Instant;

use glam::DQuat;
use polhode::batch::{Precision, prepare_with};
use polhode::engine::unobserved;
use polhode::study::draw::{Column, Draw};
use polhode::study::problem;
use polhode::torque::Torque;
use polhode::{Accuracy, Engine, Ensemble, Method, Outputs, Plan, Result, Scene};

const BODIES: usize = 4096;
const SPAN: f64 = 10.0;
const REPEATS: usize = 7;
/// Error below which rounding hides the method's own, rad.
const ROUNDING: f64 = 1e-12;
const STEPS_PER_SECOND: [u32; 6] = [2, 4, 8, 16, 32, 64];
const METHODS: [Method; 6] =
    [Method::Rk4, Method::Rk8, Method::Cf4, Method::Splitting2, Method::Splitting4, Method::Splitting6];

fn main() -> Result<()> {
    let ensemble = problem::free(BODIES, 3)?;
    let draw = Draw::new(11);
    let signed = |body, component| 2.0 * draw.uniform(body, Column::Mass, component) - 1.0;
    let push: Vec<glam::DVec3> =
        (0..BODIES).map(|body| glam::DVec3::new(signed(body, 0), signed(body, 1), signed(body, 2))).collect();
    let drag: Vec<f64> = (0..BODIES).map(|body| 0.01 + 0.09 * draw.uniform(body, Column::SpinRate, 0)).collect();
    let spin: Vec<f64> = ensemble.angular_velocity_body().iter().map(|omega| omega.length()).collect();
    // A constant torque brings a body from rest to the rate √(τ/I) within a radian.
    let driven_rate: Vec<f64> = (0..BODIES)
        .map(|body| spin[body].max((push[body].length() / ensemble.inertia()[body].to_array()[1]).sqrt()))
        .collect();
    let forced = [Torque::constant_body(push), Torque::linear_drag(drag)];
    for (name, torques, rates) in [("free", &[] as &[Torque], &spin), ("driven", &forced, &driven_rate)] {
        let exact = states(&ensemble, torques, Method::Rk8, Precision::F64, 256)?.0;
        println!(
            "\n{name:<16} {:>5} {:>11} {:>11} {:>13} {:>13}",
            "1/dt", "c p99", "error p99", "f32 s/step", "f64 s/step"
        );
        for method in METHODS {
            for steps_per_second in STEPS_PER_SECOND {
                let (orientation, wide) = states(&ensemble, torques, method, Precision::F64, steps_per_second)?;
                let (_, narrow) = states(&ensemble, torques, method, Precision::F32, steps_per_second)?;
                let errors: Vec<f64> = orientation.iter().zip(&exact).map(|(a, b)| angle_between(*a, *b)).collect();
                let order = method.order() as i32;
                let dt = 1.0 / f64::from(steps_per_second);
                let coefficients: Vec<f64> = (0..BODIES)
                    .filter(|&body| errors[body] > ROUNDING && rates[body] * dt < 2.0)
                    .map(|body| errors[body] / ((rates[body] * dt).powi(order) * rates[body] * SPAN))
                    .collect();
                println!(
                    "{:<16} {steps_per_second:>5} {:>11.2e} {:>11.1e} {narrow:>13.2e} {wide:>13.2e}",
                    method.name(),
                    percentile(coefficients),
                    percentile(errors)
                );
            }
        }
    }
    evaluations(&ensemble)
}

/// Time of an evaluation of a torque-free motion.
fn evaluations(ensemble: &Ensemble) -> Result<()> {
    let engine = Engine::cpu();
    const TIMES: usize = 200;
    let round = Ensemble::from_columns(
        &vec![glam::DVec3::new(1.0, 1.0, 2.0); BODIES],
        ensemble.orientation(),
        ensemble.angular_velocity_body(),
    )?;
    for (name, ensemble, target) in
        [("closed form, f32", ensemble, 1e-5), ("closed form, f64", ensemble, 1e-9), ("rotation", &round, 1e-9)]
    {
        let scene = Scene::new(ensemble.clone())
            .until(SPAN)
            .outputs(Outputs::Every(SPAN / TIMES as f64))
            .accuracy(Accuracy::attitude(target));
        let plan = Plan::new(&scene, &engine)?;
        let mut seconds: Vec<f64> = (0..REPEATS)
            .map(|_| {
                let wall = engine.run(&plan)?.trust().wall_time;
                Ok((wall.compute + wall.read) / (TIMES * BODIES) as f64)
            })
            .collect::<Result<_>>()?;
        seconds.sort_by(f64::total_cmp);
        println!("{name:<20} {:.2e} s an evaluation, read and brought to the user's axes", seconds[REPEATS / 2]);
    }
    Ok(())
}

/// The attitudes at the end, and the median time of a step.
fn states(
    ensemble: &Ensemble,
    torques: &[Torque],
    method: Method,
    precision: Precision,
    steps_per_second: u32,
) -> Result<(Vec<DQuat>, f64)> {
    let dt = 1.0 / f64::from(steps_per_second);
    let steps = (SPAN / dt) as u64;
    let mut seconds = Vec::new();
    let mut orientation = Vec::new();
    for _ in 0..if steps_per_second > 64 { 1 } else { REPEATS } {
        let (frames, batch) = prepare_with(ensemble, torques, SPAN, precision)?;
        let mut session = Engine::cpu().start(batch, method)?;
        let clock = Instant::now();
        session.advance(dt, steps, &mut unobserved)?;
        seconds.push(clock.elapsed().as_secs_f64() / (steps as f64 * BODIES as f64));
        let words = session.read(0..BODIES)?;
        orientation = (0..BODIES).map(|body| frames[body].body_state(words.combined(body)).orientation).collect();
    }
    seconds.sort_by(f64::total_cmp);
    Ok((orientation, seconds[seconds.len() / 2]))
}

fn percentile(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get((0.99 * values.len() as f64) as usize).copied().unwrap_or(0.0)
}

fn angle_between(a: DQuat, b: DQuat) -> f64 {
    let relative = a.conjugate() * b;
    2.0 * relative.xyz().length().atan2(relative.w.abs())
}
