//! Torques and forces that begin late, grow from nothing or pass quickly, and what they do to bodies at rest.

use std::f64::consts::PI;

use glam::{DQuat, DVec3};
use polhode::bodies::Status;
use polhode::bodies::ensemble::Translation;
use polhode::scene::{AdaptiveSteps, Condition, Event};
use polhode::torque::Parameters;
use polhode::{Accuracy, Engine, Ensemble, Force, Method, Outputs, Plan, Precision, Quantity, Record, Scene, Torque};

use crate::common;

const MOMENTS: DVec3 = DVec3::new(1.0, 2.0, 3.0);

fn run(engine: &Engine, scene: &Scene) -> Record {
    engine.run(&Plan::new(scene, engine).expect("a plan")).expect("a run")
}

fn custom(text: &str) -> Torque {
    Torque::custom(text, Parameters::new()).expect("a formula")
}

/// One body that turns at `omega` rad/s about its first axis.
fn one(omega: f64) -> Ensemble {
    Ensemble::from_columns(&[MOMENTS], &[DQuat::IDENTITY], &[DVec3::X * omega]).expect("valid")
}

/// The scene in steps that each body chooses, and for an error.
fn by_own_steps(scene: &Scene) -> [Scene; 3] {
    let steps = AdaptiveSteps { tolerance: 1e-9, least_step: None };
    [
        scene.clone().adaptive(steps, Some(Precision::F64)),
        scene.clone().taylor(steps),
        scene.clone().accuracy(Accuracy::attitude(1e-7)),
    ]
}

/// A torque about a principal axis τ(t) turns a body at rest at ∫τ dt/I, however weak it is at first: a pulse, an S-curve and jumps.
#[test]
fn bodies_at_rest_are_set_in_motion_by_torques_that_begin_late() {
    for (torque, omega) in [
        ("vec(exp(-(time - 10)^2), 0, 0)", DVec3::X * PI.sqrt()),
        ("vec(1 / (1 + exp(-(time - 10) / 0.3)), 0, 0)", DVec3::X * 10.0),
        ("vec(0, 0, 0.1 * step(7.3, time))", DVec3::Z * (0.1 * 12.7 / 3.0)),
        ("vec(1e-20 + step(5, time), 0, 0)", DVec3::X * 15.0),
    ] {
        let scene = Scene::new(one(0.0)).torque(custom(torque)).until(20.0);
        for (engine_name, engine) in [("CPU", Engine::cpu()), ("scalar", Engine::cpu_scalar()), ("GPU", common::gpu())]
        {
            for (number, scene) in by_own_steps(&scene).into_iter().enumerate() {
                let Ok(plan) = Plan::new(&scene, &engine) else {
                    // A GPU forms no series.
                    assert!(engine_name == "GPU" && number == 1, "{engine_name}: {torque}, {number}");
                    continue;
                };
                let record = engine.run(&plan).expect("a run");
                let (end, what) = (record.final_state(), format!("{engine_name}, {torque}, {number}"));
                assert_eq!(end.statuses(), [Status::Valid], "{what}");
                let off = (end.angular_velocity_body(0) - omega).length();
                assert!(off <= 3e-7 * omega.length(), "{what}: {off:e}");
            }
        }
    }
}

/// Steps of which a quaternion's norm overflows lose the body, and no plan takes them: the angle is ∬τ/I dt².
#[test]
fn a_quaternion_that_overflows_is_lost() {
    let torque = custom("vec(1 / (1 + exp(-(time - 3.13) / 0.232)), 0, 0)");
    let scene = Scene::new(one(1e-3)).torque(torque).until(20.0);
    let engine = Engine::cpu();
    let lost = run(&engine, &scene.clone().pinned(Method::Rk4, 3.2, Some(Precision::F64)));
    assert!(lost.final_state().statuses() != [Status::Valid], "{:?}", lost.final_state().orientation(0));
    let steps = AdaptiveSteps { tolerance: 1e-13, least_step: None };
    let exact = run(&engine, &scene.clone().taylor(steps)).final_state().orientation(0);
    for target in [1e-4, 1e-6] {
        let found = run(&engine, &scene.clone().accuracy(Accuracy::attitude(target))).final_state().orientation(0);
        let between = exact.conjugate() * found;
        let off = 2.0 * between.xyz().length().atan2(between.w.abs());
        assert!((found.length() - 1.0).abs() < 1e-12 && off <= target, "{target:e}: {off:e}");
    }
}

/// The impulse of a pulse of a hundred thousandth of the span is all there.
#[test]
fn narrow_pulses_are_not_passed_over() {
    const WIDTH: f64 = 0.006;
    let bodies = Ensemble::from_fn(8, |body| {
        let spin = DVec3::new(0.01, 0.02, 0.1) * (1.0 + 0.1 * body as f64);
        (MOMENTS, DQuat::from_rotation_y(body as f64), spin)
    });
    for centre in [130.3894, 300.0, 412.77713] {
        let torque = custom(&format!("to_body(vec(0, 0, 10 * exp(-((time - {centre}) / {WIDTH})^2)))"));
        let scene = Scene::new(bodies.clone().expect("valid")).torque(torque).until(600.0);
        for (number, scene) in by_own_steps(&scene).into_iter().enumerate() {
            let record = run(&Engine::cpu(), &scene);
            for body in 0..8 {
                let off = (gained(&scene, &record, body) - DVec3::Z * (10.0 * WIDTH * PI.sqrt())).length();
                assert!(off <= 1e-6, "{centre}, {number}: body {body} is off by {off:e} N m s");
            }
        }
    }
}

/// The angular velocity, rad/s, about its third axis of a body that starts at rest and is turned about that axis by a torque, N m, of the time and of
/// the scalar part of its attitude, after a hundred s.
fn turned(torque: impl Fn(f64, f64) -> f64) -> f64 {
    const STEPS: usize = 200_000;
    let (dt, mut angle, mut rate) = (100.0 / STEPS as f64, 0.0_f64, 0.0);
    let slope = |time: f64, angle: f64| torque(time, (0.5 * angle).cos()) / MOMENTS.z;
    for step in 0..STEPS {
        let time = step as f64 * dt;
        // Nyström's method of fourth order, for a slope that does not depend on the rate.
        let middle = angle + 0.5 * dt * rate;
        let first = slope(time, angle);
        let second = slope(time + 0.5 * dt, middle + 0.125 * dt * dt * first);
        let last = slope(time + dt, angle + dt * rate + 0.5 * dt * dt * second);
        angle += dt * rate + dt * dt / 6.0 * (first + 2.0 * second);
        rate += dt / 6.0 * (first + 4.0 * second + last);
    }
    rate
}

/// Formulas that are nothing to all digits for most of the time, and depend on it by its sine, or on the attitude.
#[test]
fn pulses_of_sines_of_powers_and_of_the_attitude_are_not_passed_over() {
    let logistic = |x: f64| 1.0 / (1.0 + x.exp());
    let far = |time: f64| (0.05 * time - 2.0).cos();
    let bodies = Ensemble::from_columns(&[MOMENTS; 3], &[DQuat::IDENTITY; 3], &[DVec3::ZERO; 3]).expect("valid");
    for (text, expected) in [
        ("exp(-100 * (1 - cos(0.05 * time - 2)))", turned(|time, _| 0.05 * (-100.0 * (1.0 - far(time))).exp())),
        ("pow(0.5 + 0.5 * cos(0.05 * time - 2), 200)", turned(|time, _| 0.05 * (0.5 + 0.5 * far(time)).powi(200))),
        (
            "1 / (1 + exp(-200 * (cos(0.05 * time - 2) - 0.9)))",
            turned(|time, _| 0.05 * logistic(-200.0 * (far(time) - 0.9))),
        ),
        ("exp(-((time - 40) / 0.3)^2 * (2 + attitude.w))", {
            turned(|time, w| 0.05 * (-((time - 40.0) / 0.3).powi(2) * (2.0 + w)).exp())
        }),
        ("exp(-300 * (1 - sin(0.5 * time)))", turned(|time, _| 0.05 * (-300.0 * (1.0 - (0.5 * time).sin())).exp())),
    ] {
        let scene = Scene::new(bodies.clone()).torque(custom(&format!("vec(0, 0, 0.05 * {text})"))).until(100.0);
        let series = scene.clone().taylor(AdaptiveSteps { tolerance: 1e-12, least_step: None });
        for scene in [series, scene.clone().accuracy(Accuracy::attitude(1e-6))] {
            for engine in [Engine::cpu(), Engine::cpu_scalar()] {
                let record = run(&engine, &scene);
                let off = (record.final_state().angular_velocity_body(0).z - expected).abs();
                assert!(off <= 1e-6 * expected, "{text}: {off:e} of {expected:e} rad/s");
            }
        }
    }
}

/// Pulses that come again and again do not make a regular motion look as if nothing were left of it, and all bodies meet their target.
#[test]
fn pulses_that_come_again_are_within_reach() {
    let bodies = Ensemble::from_fn(100, |body| {
        let spin = DQuat::from_rotation_y(body as f64) * DVec3::new(0.02, 0.05, 0.08);
        (MOMENTS, DQuat::from_rotation_x(body as f64), spin)
    });
    let torque = custom("0.05 * vec(1, 2, 3) * exp(-200 * (1 - cos(0.7 * time)))");
    let scene = Scene::new(bodies.expect("valid")).torque(torque).until(100.0);
    let exact = run(&Engine::cpu(), &scene.clone().pinned(Method::Rk8, 0.01, Some(Precision::F64)));
    let record = run(&Engine::cpu(), &scene.accuracy(Accuracy::attitude(1e-6)));
    assert_eq!(record.trust().recomputed_sample.met, Some(true));
    for body in 0..100 {
        let [a, b] = [&exact, &record].map(|record| record.final_state().orientation(body));
        let off = 2.0 * (a.conjugate() * b).xyz().length();
        assert!(off <= 1e-4, "body {body}: {off:e} rad");
    }
}

/// The same of pulses of a thousandth of the span whose height, or time, is each body's own.
#[test]
fn pulses_of_each_bodys_own_height_or_time_are_not_passed_over() {
    const WIDTH: f64 = 0.6;
    let bodies = Ensemble::from_fn(8, |body| {
        let spin = DVec3::new(0.01, 0.02, 0.1) * (1.0 + 0.1 * body as f64);
        (MOMENTS, DQuat::from_rotation_y(body as f64), spin)
    });
    let bodies = bodies.expect("valid");
    let (height, time) = (|body: usize| 0.05 + 0.01 * body as f64, |body: usize| 137.6 + 41.7 * body as f64);
    for (has_heights, has_times) in [(true, false), (false, true), (true, true)] {
        let given = |name: &str, parameters: Parameters, of: &dyn Fn(usize) -> f64, is_own: bool| match is_own {
            true => parameters.number(name, (0..8).map(of).collect::<Vec<f64>>()).expect("a name"),
            false => parameters.number(name, of(4)).expect("a name"),
        };
        let parameters = given("a", Parameters::new(), &height, has_heights);
        let parameters = given("t", parameters, &time, has_times).number("w", WIDTH).expect("a name");
        let text = "to_body(vec(0, 0, a * exp(-((time - t) / w)^2)))";
        let torque = Torque::custom(text, parameters).expect("a formula");
        let scene = Scene::new(bodies.clone()).torque(torque).until(600.0);
        for (number, scene) in by_own_steps(&scene).into_iter().enumerate() {
            let record = run(&Engine::cpu(), &scene);
            for body in 0..8 {
                let expected = height(if has_heights { body } else { 4 }) * WIDTH * PI.sqrt();
                let off = (gained(&scene, &record, body) - DVec3::Z * expected).length();
                assert!(off <= 1e-6, "{has_heights}, {has_times}, {number}: body {body} is off by {off:e} N m s");
            }
        }
    }
}

/// Three of 200 bodies have pulses that are shorter than those of the others, and of no row that a spread of a few rows has. Series watch them;
/// `rk8` has only the times that are found beforehand.
#[test]
fn short_pulses_of_a_few_bodies_are_not_passed_over() {
    let is_short = |body: usize| [23, 111, 187].contains(&body);
    let bodies = Ensemble::from_fn(200, |_| (MOMENTS, DQuat::IDENTITY, DVec3::Z * 0.01)).expect("valid");
    let times: Vec<f64> = (0..200).map(|body| 100.0 + 1.9 * body as f64).collect();
    let widths: Vec<f64> = (0..200).map(|body| if is_short(body) { 1.3 } else { 40.0 }).collect();
    let parameters = Parameters::new().number("t", times).expect("a name").number("w", widths.clone()).expect("a name");
    let text = "to_body(vec(0, 0, 0.05 * exp(-((time - t) / w)^2)))";
    let torque = Torque::custom(text, parameters).expect("a formula");
    let scene = Scene::new(bodies).torque(torque).until(600.0);
    for (number, scene) in by_own_steps(&scene).into_iter().enumerate() {
        let record = run(&Engine::cpu(), &scene);
        for body in (0..200).filter(|&body| is_short(body)) {
            let off = (gained(&scene, &record, body).z - 0.05 * widths[body] * PI.sqrt()).abs();
            assert!(off <= 1e-9, "{number}: body {body} is off by {off:e} N m s");
        }
    }
}

/// The angular momentum in world axes that a body has gained in a run.
fn gained(scene: &Scene, record: &Record, body: usize) -> DVec3 {
    let momentum = |orientation: DQuat, omega: DVec3| orientation * (MOMENTS * omega);
    let (ensemble, end) = (scene.ensemble(), record.final_state());
    momentum(end.orientation(body), end.angular_velocity_body(body))
        - momentum(ensemble.orientation()[body], ensemble.angular_velocity_body()[body])
}

fn moving(velocity: DVec3, omega: DVec3) -> Ensemble {
    let ensemble = Ensemble::from_columns(&[MOMENTS], &[DQuat::IDENTITY], &[omega]).expect("valid");
    let translation = Translation { mass: vec![2.0], position: vec![DVec3::ZERO], velocity: vec![velocity] };
    ensemble.with_translation(translation).expect("valid")
}

fn force(text: &str) -> Force {
    Force::custom(text, Parameters::new()).expect("a formula")
}

/// A pulse of a force on a centre of mass that is integrated with the rotation; the figures are those of SciPy's DOP853 at 1e-13, cut at the pulse.
#[test]
fn a_pulse_of_a_force_moves_a_coupled_centre() {
    let scene = Scene::new(moving(DVec3::X, DVec3::Z * 0.1))
        .force(force("-0.01 * velocity * norm(velocity)"))
        .force(force("2 * vec(exp(-((time - 10) / 0.1)^2), 0, 0)"))
        .torque(custom("1e-3 * cross(to_body(velocity), vec(0, 0, 1))"))
        .until(20.0);
    let steps = AdaptiveSteps { tolerance: 1e-12, least_step: None };
    // No target can be set for the velocity.
    for (scene, bound) in [(scene.clone().taylor(steps), 1e-9), (scene.accuracy(Accuracy::attitude(1e-6)), 1e-4)] {
        let record = run(&Engine::cpu(), &scene);
        let end = record.final_state();
        let off = (end.velocities()[0].x - 1.069_240_198).abs();
        assert!(off <= bound, "{off:e}");
        assert!((end.angular_velocity_body(0).z - 0.099_890_9).abs() <= 1e-6, "{}", end.angular_velocity_body(0));
    }
}

/// A force that begins to act on a centre of mass at rest: v = ∫F dt/m.
#[test]
fn a_centre_at_rest_is_set_in_motion_by_a_force_that_begins_late() {
    for (text, speed) in [("2 * vec(step(5, time), 0, 0)", 15.0), ("2 * vec(step(1.3, time), 0, 0)", 18.7)] {
        let scene = Scene::new(moving(DVec3::ZERO, DVec3::Z * 0.1)).force(force(text)).until(20.0);
        let record = run(&Engine::cpu(), &scene.accuracy(Accuracy::attitude(1e-6)));
        assert_eq!(record.final_state().statuses(), [Status::Valid], "{text}");
        let off = (record.final_state().velocities()[0] - DVec3::X * speed).length();
        assert!(off <= 1e-9 * speed, "{text}: {off:e}");
    }
}

/// ω = 1.2 e^(−0.4 t) about z: acos(ω) has a value from ln(1.2)/0.4 s on, and exceeds 0.3 where ω falls below cos 0.3.
#[test]
fn an_event_of_a_quantity_without_a_value_before_is_located() {
    let tilt = Quantity::formula("tilt", "rad", "acos(angular_velocity.z)").expect("a formula");
    let bodies = Ensemble::from_columns(&[DVec3::splat(2.0)], &[DQuat::IDENTITY], &[DVec3::Z * 1.2]).expect("valid");
    let scene = Scene::new(bodies)
        .torque(Torque::linear_drag(0.8))
        .event(Event::new("tilted", tilt, Condition::Above(0.3)).expect("a level"))
        .until(4.0)
        .outputs(Outputs::Every(1.0));
    for scene in by_own_steps(&scene) {
        let record = run(&Engine::cpu(), &scene);
        let found = record.events()[0].occurrences[0].time;
        assert!((found - (1.2 / 0.3_f64.cos()).ln() / 0.4).abs() < 1e-6, "{found}");
    }
}
