//! The figures of the shipped cost table (`src/plan/cost.rs`): error coefficients and times of a step.
//!
//! ```text
//! RAYON_NUM_THREADS=1 cargo bench --bench costs
//! ```
//!
//! 4,096 bodies over 10 s, free, and under a constant torque and linear drag. A body that turns by α rad in steps of θ rad has the attitude
//! error c θ^order α; for each step size the 99th percentile of c over the bodies is printed, of `f64`, with the 99th percentile of
//! the error itself, and the median time of a step. Of adaptive steps the error is printed as a multiple of the tolerance.

use std::time::Instant;

use glam::DQuat;
use polhode::engine::batch::prepare_with;
use polhode::engine::{End, unobserved};
use polhode::kernel::method::rk8_adaptive::least_tolerance;
use polhode::math::Precision;
use polhode::scene::AdaptiveSteps;
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
        for method in [Method::Rk8, Method::Taylor] {
            adaptive(&ensemble, torques, method, &exact)?;
        }
    }
    evaluations(&ensemble)
}

/// Error as a multiple of the tolerance, and time of a step, those that were refused and waiting included, of a method in adaptive steps.
fn adaptive(ensemble: &Ensemble, torques: &[Torque], method: Method, exact: &[DQuat]) -> Result<()> {
    let engine = Engine::cpu();
    let is_series = method == Method::Taylor;
    for tolerance in [1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11] {
        let mut error = f64::NAN;
        let mut seconds = [f64::NAN; 2];
        for (seconds, precision) in seconds.iter_mut().zip(Precision::ALL) {
            if tolerance < least_tolerance(precision) || (is_series && precision == Precision::F32) {
                continue;
            }
            let steps = AdaptiveSteps { tolerance, least_step: None };
            let scene = Scene::new(ensemble.clone()).until(SPAN);
            let scene = if is_series { scene.taylor(steps) } else { scene.adaptive(steps, Some(precision)) };
            let scene = torques.iter().cloned().fold(scene, Scene::torque);
            let plan = Plan::new(&scene, &engine)?;
            let records = (0..REPEATS).map(|_| engine.run(&plan)).collect::<Result<Vec<_>>>()?;
            let mut times: Vec<f64> =
                records.iter().map(|r| r.trust().wall_time.compute / r.trust().body_steps as f64).collect();
            times.sort_by(f64::total_cmp);
            *seconds = times[REPEATS / 2];
            let state = records[0].final_state();
            error = percentile((0..BODIES).map(|body| angle_between(state.orientation(body), exact[body])).collect());
        }
        println!(
            "{:<16} {tolerance:>5.0e} {:>11.2e} {error:>11.1e} {:>13.2e} {:>13.2e}",
            if is_series { "taylor" } else { "rk8 adaptive" },
            error / tolerance,
            seconds[0],
            seconds[1]
        );
    }
    Ok(())
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
        session.advance_to(End::of_steps(dt, steps), &mut unobserved)?;
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
