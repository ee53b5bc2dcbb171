//! Steps by Taylor series that go beyond outputs where an error is asked for: a pilot calibrates what the run then does.

use glam::{DQuat, DVec3};
use polhode::scene::StatisticalAccuracy;
use polhode::study::draw::{Column, Draw};
use polhode::torque::{Orbit, Torque};
use polhode::{Accuracy, Engine, Ensemble, Method, Outputs, Plan, Quantity, Record, Scene};

use crate::support::attitude_error;

const BODIES: usize = 400;
/// s, a third of an orbit.
const END: f64 = 2000.0;

/// Satellites that turn a few times an orbit, under four torques, which make equal steps dear.
fn satellites() -> Scene {
    let draw = Draw::new(4);
    let body = |body: usize| {
        let omega = DVec3::Z * 1.1e-3 + 1e-3 * draw.normal_vector(body, Column::AngularVelocity);
        (DVec3::new(0.02, 0.09, 0.1), draw.rotation(body, Column::Orientation), omega)
    };
    let orbit = || Orbit::circular(3.986004418e14, 7.0e6).inclined(0.9);
    let magnet = DVec3::new(1e-3, 0.0, 2e-3);
    Scene::new(Ensemble::from_fn(BODIES, body).expect("satellites"))
        .torque(Torque::gravity_gradient(orbit()))
        .torque(Torque::orbiting_dipole(magnet, orbit(), 7.8e15, 0.0, 0.0, 0.0))
        .torque(Torque::linear_drag(1e-6))
        .torque(Torque::constant_body(DVec3::new(1e-9, 2e-9, 0.0)))
        .until(END)
}

fn run(scene: &Scene) -> Record {
    let engine = Engine::cpu();
    engine.run(&Plan::new(scene, &engine).unwrap_or_else(|error| panic!("{error}"))).expect("a run")
}

/// Accepted steps of all bodies.
fn steps(record: &Record) -> u64 {
    record.trust().adaptive.expect("adaptive steps").accepted.total
}

#[test]
fn steps_go_beyond_outputs_and_meet_the_error_asked_for() {
    let outputs: Vec<f64> = (1..=400).map(|k| END * k as f64 / 400.0).collect();
    let few = Outputs::Times(vec![outputs[63], outputs[300], END]);
    let exact = run(&satellites().outputs(few).accuracy(Accuracy::attitude(1e-13)));
    for target in [1e-11, 1e-12] {
        let scene = satellites().outputs(Outputs::Times(outputs.clone())).accuracy(Accuracy::attitude(target));
        let plan = Plan::new(&scene, &Engine::cpu()).expect("a plan");
        assert!(plan.explain().dense_output && plan.method() == Method::Taylor, "{}", plan.explain());
        let record = run(&scene);
        let sample = &record.trust().recomputed_sample;
        assert_eq!(sample.met, Some(true), "{sample:?}");
        assert!(steps(&record) < 30 * BODIES as u64, "{} steps", steps(&record));
        for (index, place) in [63, 300, 399].into_iter().enumerate() {
            let (found, expected) = (&record.snapshots()[place], &exact.snapshots()[index]);
            let of_body = |body| attitude_error(found.orientation(body), expected.orientation(body));
            let mut errors: Vec<f64> = (0..BODIES).map(of_body).collect();
            errors.sort_by(f64::total_cmp);
            let p99 = errors[BODIES * 99 / 100];
            println!("{target:e} at output {place}: {p99:.1e}");
            assert!(0.0 < p99 && p99 <= target, "{target:e} at output {place}: {p99:e}");
        }
    }
}

#[test]
fn statistics_are_formed_between_the_ends_of_steps() {
    let scene = |outputs: Outputs| satellites().outputs(outputs).statistics([Quantity::SpinRate]).without_states();
    let wanted = StatisticalAccuracy { mean: Some(1e-11), ..StatisticalAccuracy::default() };
    let dense = scene(Outputs::Every(END / 400.0)).statistical_accuracy(wanted);
    let plan = Plan::new(&dense, &Engine::cpu()).expect("a plan");
    assert!(plan.explain().dense_output, "{}", plan.explain());
    let (found, expected) = (run(&dense), run(&scene(Outputs::Every(END / 4.0)).accuracy(Accuracy::attitude(1e-11))));
    assert!(steps(&found) < 30 * BODIES as u64, "{} steps", steps(&found));
    for quarter in 1..=4 {
        let [found, expected] = [(&found, 100 * quarter - 1), (&expected, quarter - 1)]
            .map(|(record, place)| record.statistics()[place].of(Quantity::SpinRate).expect("asked for").mean);
        assert!((found / expected - 1.0).abs() < 1e-10, "{found} and {expected}");
    }
}

/// Where bodies turn far between two outputs, steps end there, and tolerances are found for steps that do.
#[test]
fn steps_of_fast_bodies_end_at_outputs() {
    let body =
        |body: usize| (DVec3::new(1.0, 2.0, 3.0), DQuat::IDENTITY, DVec3::new(1.0, 0.1, 2.0 + 1e-3 * body as f64));
    let scene = Scene::new(Ensemble::from_fn(BODIES, body).expect("bodies"))
        .torque(Torque::quadratic_drag(0.05))
        .until(200.0)
        .outputs(Outputs::Every(10.0))
        .accuracy(Accuracy::attitude(1e-9));
    let plan = Plan::new(&scene, &Engine::cpu()).expect("a plan");
    assert!(!plan.explain().dense_output && plan.method() == Method::Taylor, "{}", plan.explain());
}
