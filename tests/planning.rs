//! What planning takes where it leads to nothing: studies that no run could follow are refused after a number of steps that takes less
//! than a second, and most of them after a probe. Steps are counted, not seconds, so that the machine does not matter.

use std::sync::{Mutex, PoisonError};

use glam::{DQuat, DVec3};
use polhode::plan::pilot_steps;
use polhode::scene::{AdaptiveSteps, Condition, Event, Quantity, StatisticalAccuracy, Target};
use polhode::torque::{Orbit, Parameters};
use polhode::{Accuracy, Engine, Ensemble, Error, Method, Outputs, Plan, Precision, Scene, Torque};

const BODIES: usize = 20;

/// Steps that take a fifth of a second on one core, at a tenth of a microsecond to one a microsecond each.
const A_PROBE: u64 = 300_000;

/// The end, s, that hostile scenes ask for.
const END: f64 = 10.0;

fn scene(torque: Torque) -> Scene {
    // Orientations that differ, so that bodies do.
    let turned = |body: usize| DQuat::from_rotation_x(0.3 + body as f64) * DQuat::from_rotation_z(0.7 * body as f64);
    let (moments, spin) = (DVec3::new(1.0, 2.0, 2.5), DVec3::new(1.0, 0.4, 0.1));
    let ensemble = Ensemble::from_fn(BODIES, |body| (moments, turned(body), spin)).expect("valid bodies");
    Scene::new(ensemble).until(END).accuracy(Accuracy::attitude(1e-6)).torque(torque)
}

/// Steps are counted for the whole process: plans are made one after the other.
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

/// What planning comes to, and the steps that it takes.
fn planned(scene: &Scene) -> (Result<(), Error>, u64) {
    let _alone = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    let before = pilot_steps();
    let plan = Plan::new(scene, &Engine::cpu()).map(|_| ());
    (plan, pilot_steps() - before)
}

#[test]
fn what_no_run_could_follow_is_refused_after_a_probe() {
    let cases = [
        ("a constant torque of 1e20 N m", Torque::constant_world(DVec3::X * 1e20)),
        ("a constant torque of 1e20 N m in the body", Torque::constant_body(DVec3::X * 1e20)),
        ("a spring of 1e12 N m", Torque::sine_spring(1e12, DQuat::IDENTITY)),
        ("an orbit of a millimetre", Torque::gravity_gradient(Orbit::circular(3.986e14, 1e-3))),
        ("a magnet of 1e20 A m²", Torque::magnetic_dipole(DVec3::X * 1e20, DVec3::new(2e-5, -1e-5, 3e-5))),
    ];
    for (name, torque) in cases {
        let (plan, steps) = planned(&scene(torque));
        let error = plan.expect_err(name);
        println!("{name}: {steps} steps: {error}");
        assert!(error.is_input() && error.to_string().contains("use a shorter span"), "{name}: {error}");
        assert!((1..A_PROBE).contains(&steps), "{name}: {steps} steps");
    }
}

/// The only one among thousands that a pilot, which tries a few of them, does not meet.
#[test]
fn one_body_whose_steps_would_never_end_is_refused_by_its_number() {
    const COUNT: usize = 5_001;
    const FAST: usize = 4_171;
    let of_rates = |fast: f64| {
        let row = |body: usize| {
            let spin = if body == FAST { fast } else { 1.0 + body as f64 / COUNT as f64 };
            (DVec3::new(1.0, 2.0, 2.5), DQuat::IDENTITY, DVec3::new(0.1 * spin, 0.2 * spin, spin))
        };
        let ensemble = Ensemble::from_fn(COUNT, row).expect("valid bodies");
        Scene::new(ensemble).until(END).torque(Torque::constant_body(DVec3::X * 0.1))
    };
    const STEPS: AdaptiveSteps = AdaptiveSteps { tolerance: 1e-9, least_step: None };
    type Asked = fn(Scene) -> Scene;
    let asked: [(&str, Asked); 3] = [
        ("an error", |scene| scene.accuracy(Accuracy::attitude(1e-6))),
        ("a tolerance of rk8", |scene| scene.adaptive(STEPS, None)),
        ("a tolerance of series", |scene| scene.taylor(STEPS)),
    ];
    for (name, asked) in asked {
        for fast in [1e300, 1e12] {
            let scene = asked(of_rates(fast));
            let (plan, steps) = planned(&scene);
            let error = plan.expect_err(name).to_string();
            assert!(error.starts_with(&format!("body {FAST}: rate = ")), "{name}, {fast:e} rad/s: {error}");
            assert!(error.contains("no run finishes"), "{name}, {fast:e} rad/s: {error}");
            assert!(steps < 100 * A_PROBE, "{name}, {fast:e} rad/s: {steps} steps");
        }
        let (plan, _) = planned(&asked(of_rates(1e3)));
        plan.unwrap_or_else(|error| panic!("{name}: {error}"));
    }
}

#[test]
fn the_same_scenes_over_a_span_that_can_be_followed_are_planned() {
    let cases = [
        (1e-9, Torque::constant_world(DVec3::X * 1e20)),
        (1e-5, Torque::sine_spring(1e12, DQuat::IDENTITY)),
        (1e-11, Torque::gravity_gradient(Orbit::circular(3.986e14, 1e-3))),
    ];
    for (end, torque) in cases {
        let (plan, _) = planned(&scene(torque).until(end));
        plan.unwrap_or_else(|error| panic!("{end} s: {error}"));
    }
}

#[test]
fn torques_that_change_much_faster_than_bodies_turn_are_seen_by_the_pilot() {
    for rate in [1e2, 1e4, 1e5, 1e6] {
        let scene = scene(Torque::sinusoidal(DVec3::X * 0.1, DVec3::ZERO, rate)).until(1e3 / rate);
        let engine = Engine::cpu();
        let _alone = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
        let plan = Plan::new(&scene, &engine).unwrap_or_else(|error| panic!("{rate:e} rad/s: {error}"));
        let record = engine.run(&plan).unwrap_or_else(|error| panic!("{rate:e} rad/s: {error}"));
        let recomputed = record.trust().recomputed_sample;
        assert_eq!(recomputed.met, Some(true), "{rate:e} rad/s: {recomputed}");
    }
}

/// The sample took ten times as long as such a run.
#[test]
fn samples_that_would_take_much_longer_than_the_run_are_smaller() {
    const FULL: usize = BODIES;
    const LEAST: usize = 8;
    let engine = Engine::cpu();
    let of_span = |end: f64| scene(Torque::sinusoidal(DVec3::X * 0.1, DVec3::ZERO, 1e6)).until(end);
    let _alone = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    for (end, bodies, balanced) in [(0.01, FULL, 8), (4.0, LEAST, 0)] {
        let scene = of_span(end);
        let plan = Plan::new(&scene, &engine).unwrap_or_else(|error| panic!("{end} s: {error}"));
        let sample = plan.explain().sample;
        assert_eq!(sample.bodies, bodies, "{end} s");
        assert!(sample.seconds.is_some_and(|seconds| seconds > 0.0), "{sample:?}");
        // Bodies that may be stopped have ends of their own, and share lanes all the same.
        let slow = Event::new("slow", Quantity::SpinRate, Condition::Below(1e-3)).expect("a level");
        let stopping = scene.clone().event(slow.stopping());
        let alone = Plan::new(&stopping, &engine).expect("a plan").explain().sample;
        println!("{end} s: {sample:?}, with a stop {alone:?}");
        assert_eq!(alone.bodies, bodies, "{alone:?}");
        // A part recomputes its share of the same ones.
        let part = scene.only(3..13);
        assert_eq!(plan.of_part(&part, &engine).expect("a plan").explain().sample.bodies, bodies, "{end} s");
        let trust = engine.run(&plan).unwrap_or_else(|error| panic!("{end} s: {error}")).trust().clone();
        let recomputed = trust.recomputed_sample;
        // So few say nothing of 99 %.
        assert!(recomputed.bodies == bodies && recomputed.met.is_some() == (bodies == FULL), "{end} s: {recomputed}");
        // What torques do is integrated on some of them, unless that would take too long.
        assert_eq!(trust.balance.bodies, balanced, "{end} s");
    }
}

/// Only a small part of such a span can be tried ahead, and a step may be longer than that part.
#[test]
fn steps_that_are_longer_than_what_was_tried_are_not_planned() {
    for rate in [1e7, 1e8] {
        let scene = scene(Torque::sinusoidal(DVec3::new(0.1, 0.2, 0.1), DVec3::ZERO, rate)).until(100.0);
        let _alone = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
        match Plan::new(&scene, &Engine::cpu()) {
            // A step a turn of the torque at the least.
            Ok(plan) => {
                let [least, expected] = [rate * 100.0 / 6.3, plan.explain().classes[0].steps.min as f64];
                println!("{rate:e} rad/s: {expected:e} steps");
                assert!(expected > least, "{rate:e} rad/s: {expected:e} steps, {least:e} turns");
            }
            Err(error) => {
                println!("{rate:e} rad/s: {error}");
                assert!(error.to_string().contains("use a shorter span"), "{rate:e} rad/s: {error}");
            }
        }
    }
}

#[test]
fn a_candidate_that_never_arrives_is_said_to_need_more_steps_than_planning_may_take() {
    let error = |factor: f64| Error::AccuracyOutOfReach {
        target: Box::new(Accuracy::attitude(1e-6)),
        missed: Target::Attitude,
        factor,
        method: "rk8",
        precision: Precision::F64,
        remedy: "use a shorter span",
    };
    let text = error(f64::INFINITY).to_string();
    assert!(text.contains("does not reach the end within the steps that planning may take"), "{text}");
    assert!(!text.contains("inf"), "{text}");
    let text = error(20.0).to_string();
    assert!(text.contains("misses the attitude by a factor of 20.0"), "{text}");
}

#[test]
fn steps_that_are_given_are_not_tried_ahead() {
    let (plan, steps) = planned(&scene(Torque::linear_drag(0.1)).pinned(Method::Rk4, 1e-12, None));
    assert!(plan.is_ok() && steps == 0, "{steps} steps");
}

/// Bodies whose rates are spread over six decades, under a pulse: whether equal steps suffice shows only after many times the run's steps.
#[test]
fn steps_that_are_dearer_than_others_that_suffice_are_not_refined() {
    const COUNT: usize = 1000;
    let row = |body: usize| {
        let (part, turn) = ((body as f64 + 0.5) / COUNT as f64, body as f64);
        let rate = 0.5 * part / (1.0 - part);
        let direction = DVec3::new(turn.cos(), (1.3 * turn).sin(), (0.7 * turn).sin()).normalize();
        let turned = DQuat::from_rotation_x(0.3 + turn) * DQuat::from_rotation_z(0.7 * turn);
        (DVec3::new(1.1, 2.1, 2.7), turned, rate * direction)
    };
    let text = "to_body(vec(0.3, 0.1, 0.2) * exp(-((time - 7) / 0.7)^2))";
    let pulse = Torque::custom(text, Parameters::new()).expect("a formula");
    let scene = Scene::new(Ensemble::from_fn(COUNT, row).expect("bodies")).torque(pulse).until(17.0);
    for target in [1e-7, 1e-9] {
        let _alone = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
        let (scene, before) = (scene.clone().accuracy(Accuracy::attitude(target)), pilot_steps());
        let plan = Plan::new(&scene, &Engine::cpu()).expect("a plan");
        let (planned, run) = (pilot_steps() - before, COUNT as u64 * plan.explain().classes[0].steps.median);
        println!("{target:e}: {planned} steps for a run of {run}");
        assert!(planned < 5 * run, "{target:e}: {planned} steps for a run of {run}");
    }
}

/// Bodies on an elliptic orbit that tumble in no order. Where no attitude is known, a plan of statistics follows some bodies a few times.
#[test]
fn statistics_of_a_chaotic_ensemble_are_planned_in_steps_of_some_seconds() {
    const MU: f64 = 3.986004418e14;
    let period = std::f64::consts::TAU * (7.0e6_f64.powi(3) / MU).sqrt();
    let body = |body: usize| {
        let turned = DQuat::from_rotation_x(0.3 + body as f64) * DQuat::from_rotation_z(0.7 * body as f64);
        (DVec3::new(100.0, 150.0, 200.0), turned, 1.1e-3 * DVec3::new(0.1, 0.9, 0.3 + 1e-3 * body as f64))
    };
    let wanted = StatisticalAccuracy { mean: Some(1e-3), ..StatisticalAccuracy::default() };
    let scene = Scene::new(Ensemble::from_fn(400, body).expect("bodies"))
        .torque(Torque::gravity_gradient(Orbit::kepler(MU, 7.0e6, 0.1)))
        .until(100.0 * period)
        .statistics([Quantity::SpinRate])
        .statistical_accuracy(wanted);
    let (plan, steps) = planned(&scene);
    plan.expect("a plan");
    println!("{steps} steps");
    assert!(steps < 20 * A_PROBE, "{steps}");
}

/// Outputs so close together that steps by series go beyond them: a pilot's go beyond them too.
#[test]
fn outputs_that_steps_go_beyond_cost_a_pilot_no_steps() {
    let drag = || scene(Torque::quadratic_drag(0.05)).accuracy(Accuracy::attitude(1e-9));
    let (plan, of_one) = planned(&drag());
    plan.expect("a plan");
    let outputs = drag().outputs(Outputs::Every(END / 400.0));
    assert!(Plan::new(&outputs, &Engine::cpu()).expect("a plan").explain().dense_output);
    let (plan, of_many) = planned(&outputs);
    plan.expect("a plan");
    // Of other methods, whose steps would end at outputs, it tries none that takes longer.
    println!("{of_one} steps for one output, {of_many} for 400");
    assert!(of_many < 3 * of_one, "{of_one} steps for one output, {of_many} for 400");
}

/// Drag brings all bodies to rest early in the span, and some of them turn much faster than the others at first.
#[test]
fn motions_that_end_early_are_planned_for_any_target() {
    const END: f64 = 1e6;
    let spin = |body: usize| if body.is_multiple_of(5) { 8.0 } else { 0.3 };
    let body = |body: usize| (DVec3::new(1.0, 2.0, 2.5), DQuat::IDENTITY, DVec3::new(1.0, 0.4, 0.1) * spin(body));
    let bodies = Ensemble::from_fn(BODIES, body).expect("valid bodies");
    for target in [1e-4, 1e-5, 1e-6] {
        let scene = Scene::new(bodies.clone()).until(END).torque(Torque::linear_drag(1e-3));
        let (plan, steps) = planned(&scene.accuracy(Accuracy::attitude(target)));
        println!("{target:e}: {steps} steps");
        plan.unwrap_or_else(|error| panic!("{target:e}: {error}"));
        assert!(steps < 3_000_000, "{target:e}: {steps} steps");
    }
}
