//! The error that was asked for is met, on bodies that no coefficient was tuned on, and not overpaid.

use glam::{DQuat, DVec3};
use polhode::study::draw::{Column, Draw};
use polhode::study::problem;
use polhode::torque::{Orbit, Torque};
use polhode::{Accuracy, Engine, Ensemble, Method, Plan, Precision, Scene};

/// Bodies of each problem: the 99th percentile is the sixth largest error.
const BODIES: usize = 500;
/// Not the seeds of anything that was measured for the shipped table.
const SEEDS: [u64; 2] = [20_261, 777_001];

/// A problem, and the step at which `rk4` in `f64` is exact to [`REFERENCE`] in it.
struct Problem {
    name: &'static str,
    scene: fn(u64) -> Scene,
    reference_step: f64,
}

/// The error of the reference, rad: below every target by a factor of ten.
const REFERENCE: f64 = 1e-12;

fn column<V>(of_body: impl Fn(usize) -> V) -> Vec<V> {
    (0..BODIES).map(of_body).collect()
}

/// The forced problem of the design: a constant body torque, components uniform in [−1, 1], and linear drag with a coefficient
/// uniform in [0.01, 0.1], for 10 s.
fn forced(seed: u64) -> Scene {
    let draw = Draw::new(seed ^ 0x5555);
    let signed = |body, component| 2.0 * draw.uniform(body, Column::Mass, component) - 1.0;
    let torque = column(|body| DVec3::new(signed(body, 0), signed(body, 1), signed(body, 2)));
    let drag = column(|body| 0.01 + 0.09 * draw.uniform(body, Column::SpinRate, 0));
    Scene::new(problem::free(BODIES, seed).expect("valid"))
        .until(10.0)
        .torque(Torque::constant_body(torque))
        .torque(Torque::linear_drag(drag))
}

fn drag(seed: u64) -> Scene {
    Scene::new(problem::free(BODIES, seed).expect("valid")).until(10.0).torque(Torque::quadratic_drag(0.05))
}

fn heavy_top(seed: u64) -> Scene {
    let draw = Draw::new(seed);
    let ensemble = Ensemble::from_fn(BODIES, |body| {
        let tilt = 0.2 + draw.uniform(body, Column::Orientation, 0);
        let spin = 10.0 + 10.0 * draw.uniform(body, Column::SpinRate, 0);
        (DVec3::new(0.5, 0.5, 0.3), DQuat::from_rotation_x(tilt), DVec3::new(0.1, 0.0, spin))
    });
    Scene::new(ensemble.expect("valid")).until(5.0).torque(Torque::heavy_top(
        1.0,
        DVec3::new(0.0, 0.0, 0.2),
        DVec3::new(0.0, 0.0, -9.81),
    ))
}

fn gravity_gradient(seed: u64) -> Scene {
    let draw = Draw::new(seed);
    let ensemble = Ensemble::from_fn(BODIES, |body| {
        let omega = 0.003 * draw.normal_vector(body, Column::AngularVelocity);
        (DVec3::new(100.0, 120.0, 150.0), draw.rotation(body, Column::Orientation), omega)
    });
    Scene::new(ensemble.expect("valid"))
        .until(3000.0)
        .torque(Torque::gravity_gradient(Orbit::circular(3.986004418e14, 7.0e6).inclined(0.9)))
}

fn free(seed: u64) -> Scene {
    Scene::new(problem::free(BODIES, seed).expect("valid")).until(10.0)
}

const PROBLEMS: [Problem; 5] = [
    Problem { name: "free", scene: free, reference_step: 2e-4 },
    Problem { name: "forced", scene: forced, reference_step: 2e-4 },
    Problem { name: "drag", scene: drag, reference_step: 5e-4 },
    Problem { name: "heavy top", scene: heavy_top, reference_step: 1e-4 },
    Problem { name: "gravity gradient", scene: gravity_gradient, reference_step: 0.25 },
];

fn percentile(mut errors: Vec<f64>, part: f64) -> f64 {
    errors.sort_by(f64::total_cmp);
    errors[(part * errors.len() as f64).ceil() as usize - 1]
}

fn errors(a: &polhode::Record, b: &polhode::Record) -> Vec<f64> {
    let angle = |body| {
        let relative: DQuat = a.final_state().orientation(body).conjugate() * b.final_state().orientation(body);
        2.0 * DVec3::new(relative.x, relative.y, relative.z).length().atan2(relative.w.abs())
    };
    (0..a.final_state().len()).map(angle).collect()
}

/// How much better than asked for a plan may be. A step of the whole span, or of half a radian, is never made longer; and
/// the closed form has no cheaper neighbour.
const OVERPAID: f64 = 100.0;

#[test]
#[ignore = "minutes, and the contract is not yet met for every problem and target: cargo test --release --test accuracy -- --ignored"]
fn the_error_asked_for_is_met_and_not_overpaid() {
    let engine = Engine::cpu();
    for problem in &PROBLEMS {
        for seed in SEEDS {
            let scene = (problem.scene)(seed);
            let pinned = |step| scene.clone().pinned(Method::Rk4, step, Some(Precision::F64));
            let run = |scene: &Scene| engine.run(&Plan::new(scene, &engine).expect("a plan")).expect("a run");
            let exact = run(&pinned(problem.reference_step));
            let coarser = percentile(errors(&run(&pinned(2.0 * problem.reference_step)), &exact), 0.99);
            // The error of a method of order 4 falls by 16 from one to the other, until rounding takes over.
            assert!(coarser / 15.0 < REFERENCE, "{}: the reference is good to {:e}", problem.name, coarser / 15.0);
            for target in [1e-2, 1e-4, 1e-6, 1e-8, 1e-11] {
                let asked = scene.clone().accuracy(Accuracy::attitude(target));
                let plan = Plan::new(&asked, &engine).expect("a plan");
                let found = engine.run(&plan).expect("a run");
                let achieved = percentile(errors(&found, &exact), 0.99);
                let steps = plan.body_steps() as f64 / BODIES as f64;
                println!(
                    "{:<17} {target:.0e}: {achieved:.1e} in {steps:.0} steps a body of {} in {}, shadow p99 {:.1e}",
                    problem.name,
                    plan.method(),
                    plan.precision(),
                    found.trust().shadow.attitude.p99
                );
                assert!(achieved <= target, "{} {seed} {target:e}: {achieved:e}", problem.name);
                if !plan.is_closed_form() && steps > 4.0 {
                    assert!(achieved * OVERPAID >= target, "{} {seed} {target:e}: {achieved:e}", problem.name);
                }
                assert_eq!(
                    found.trust().shadow.met,
                    Some(true),
                    "{} {target:e}: {}",
                    problem.name,
                    found.trust().shadow
                );
            }
        }
    }
}

#[test]
#[ignore = "more than a minute of pilots: cargo test --release --test accuracy -- --ignored"]
fn what_f32_cannot_reach_is_said_before_the_run() {
    let engine = Engine::cpu();
    let scene = forced(SEEDS[0]).accuracy(Accuracy::attitude(1e-9)).precision(Some(Precision::F32));
    let error = Plan::new(&scene, &engine).expect_err("out of reach").to_string();
    assert!(error.contains("f64"), "{error}");
}

#[test]
fn energy_and_angular_velocity_are_targets_too() {
    let engine = Engine::cpu();
    let loose = Accuracy { attitude: Some(1e-2), energy: Some(1e-9), ..Accuracy::attitude(1e-2) };
    let scene = forced(SEEDS[1]).accuracy(loose);
    let record = engine.run(&Plan::new(&scene, &engine).expect("a plan")).expect("a run");
    let shadow = record.trust().shadow;
    assert!(shadow.kinetic_energy.p99 <= 1e-9 && shadow.met == Some(true), "{shadow:?}");
}
