//! How many bodies are recomputed, and what that shows.

use glam::{DQuat, DVec3};
use polhode::run::balance;
use polhode::scene::{AdaptiveSteps, Condition, Event, Outputs};
use polhode::torque::{Orbit, Sampling};
use polhode::{Accuracy, Engine, Ensemble, Method, Plan, Quantity, Scene, Torque};

use crate::support::attitude_error;

const BODIES: usize = 300;

fn sampled(end: f64) -> Scene {
    let bodies = Ensemble::from_fn(BODIES, |_| (DVec3::new(1.0, 2.0, 2.5), DQuat::IDENTITY, DVec3::X)).expect("valid");
    let field = [1e-5, 2e-5, -1e-5, 1e-5].map(Into::into);
    let coils = Torque::magnetorquers(1.0, 0.2, Orbit::circular(1e-3, 1.0), field, Sampling::every(2.0));
    let steps = AdaptiveSteps { tolerance: 1e-6, least_step: None };
    Scene::new(bodies).torque(coils).until(end).adaptive(steps, None)
}

/// The work of torques, whose integration takes as long again, is first left out.
#[test]
fn of_bodies_under_sampled_torques_fewer_are_recomputed_the_more_samples_there_are() {
    // Wherever bodies end, the balance is that of the sample, or of none.
    let (orientation, omega) = ([DQuat::IDENTITY; BODIES], [DVec3::X; BODIES]);
    // A hundred samples, an hour of them, some hours, a day.
    for (end, bodies, balanced) in
        [(200.0, 192, Some(192)), (3_000.0, 28, Some(28)), (15_000.0, 15, Some(0)), (86_400.0, 8, None)]
    {
        let scene = sampled(end);
        let plan = Plan::new(&scene, &Engine::cpu()).expect("valid");
        assert_eq!(plan.explain().sample.bodies, bodies, "{end} s");
        if let Some(expected) = balanced {
            assert_eq!(balance(&plan, &orientation, &omega).expect("balanced").bodies, expected, "{end} s");
        }
    }
}

/// A formula's own operations count and, where a tolerance or a step is given, the angle by which bodies turn.
#[test]
fn of_costly_torques_and_long_runs_fewer_bodies_are_recomputed() {
    let engine = Engine::cpu();
    let formula = |terms: usize| {
        let sines: Vec<String> =
            (1..=terms).map(|k| format!("sin({k}.5 * angular_velocity.x + {k}.25 * time)")).collect();
        let text = format!("vec(1e-6 * ({}), 0, 0) - 1e-9 * angular_velocity", sines.join(" + "));
        Torque::custom(&text, Default::default()).expect("a formula")
    };
    let sampled = |terms: usize, end: f64, is_equal: bool| {
        let bodies = Ensemble::from_fn(BODIES, |_| (DVec3::new(1.0, 2.0, 2.5), DQuat::IDENTITY, DVec3::X));
        let scene = Scene::new(bodies.expect("valid")).torque(formula(terms)).until(end);
        let steps = AdaptiveSteps { tolerance: 1e-9, least_step: None };
        let scene = if is_equal { scene.pinned(Method::Rk8, 0.2, None) } else { scene.adaptive(steps, None) };
        Plan::new(&scene, &engine).expect("a plan").explain().sample
    };
    for is_equal in [false, true] {
        let [few, more, most] = [1, 30, 300].map(|terms| sampled(terms, 2e3, is_equal).bodies);
        assert!(few == 192 && more <= few && most < few && most >= 8, "{is_equal}: {few}, {more}, {most}");
        let [short, long] = [2e3, 2e6].map(|end| sampled(1, end, is_equal));
        assert!(short.bodies == 192 && (8..192).contains(&long.bodies), "{is_equal}: {short:?}, {long:?}");
        assert!(short.seconds < long.seconds, "{is_equal}: {short:?}, {long:?}");
    }
}

/// Runs in equal steps and by adaptive `rk8` are measured by Taylor series, as well as by a far finer run; where events are asked for, by those
/// that show the errors of their times.
#[test]
fn errors_of_steps_are_measured_by_series() {
    let engine = Engine::cpu();
    let finest = tops(64).taylor(AdaptiveSteps { tolerance: 2e-15, least_step: None });
    let truth = engine.run(&Plan::new(&finest, &engine).expect("a plan")).expect("a run");
    let adaptive = |tolerance: f64| tops(64).adaptive(AdaptiveSteps { tolerance, least_step: None }, None);
    let scenes = [
        tops(64).pinned(Method::Rk4, 0.01, None),
        tops(64).pinned(Method::Rk8, 0.02, None),
        tops(64).pinned(Method::Splitting2, 0.002, None),
        adaptive(1e-6),
        adaptive(1e-10),
        adaptive(1e-6).outputs(Outputs::Every(0.015)),
        adaptive(1e-6).outputs(Outputs::Every(6.0)).event(leaning()),
        tops(64).pinned(Method::Rk4, 0.01, None).event(leaning()),
    ];
    for scene in scenes {
        let record = engine.run(&Plan::new(&scene, &engine).expect("a plan")).expect("a run");
        let error = |body: usize| {
            let orientation = |record: &polhode::Record| record.final_state().orientation(body);
            attitude_error(orientation(&record), orientation(&truth))
        };
        let greatest = (0..64).map(error).fold(0.0, f64::max);
        let sample = &record.trust().recomputed_sample;
        assert_eq!((sample.bodies, record.trust().balance.bodies), (64, 8), "{:?}", scene.stepping());
        let ratio = sample.attitude.max / greatest;
        assert!((0.9..1.1).contains(&ratio), "{:?}: {greatest:e}, {sample}", scene.stepping());
    }
}

/// A top leans further than it did at the start.
fn leaning() -> Event {
    let lean = Quantity::axis_angle("lean", DVec3::Z, DVec3::Z).expect("directions");
    Event::new("leaning", lean, Condition::Rises(0.4)).expect("a finite level")
}

/// Where series would take far more than a tenth of the run and `rk8` less, finer steps of `rk8` measure errors as well.
#[test]
fn samples_that_are_dear_by_series_are_followed_by_rk8() {
    let engine = Engine::cpu();
    let bodies = 8;
    let row = |body: usize| {
        let spin = DVec3::new(0.1, 0.01 * body as f64, 0.02);
        (DVec3::new(400.0, 500.0, 600.0), DQuat::IDENTITY, spin)
    };
    let ensemble = Ensemble::from_fn(bodies, row).expect("valid");
    let orbit = Orbit::circular(3.986004418e14, 7e6);
    let eddies = Torque::orbiting_eddy_current(1e6, orbit, 7.8e15, 0.2, 0.0, 7.3e-5);
    let scene = |end: f64| Scene::new(ensemble.clone()).torque(eddies.clone()).until(end);
    let steps = |tolerance: f64| AdaptiveSteps { tolerance, least_step: None };
    let is_by_rk8 = |end: f64| {
        let scene = scene(end).adaptive(steps(1e-8), None);
        let plan = Plan::new(&scene, &engine).expect("a plan");
        println!("{end} s: {:?}", plan.explain().sample);
        plan.to_json().contains("\"by_rk8\": true")
    };
    let [short, long] = [2e4, 6e5];
    assert!(!is_by_rk8(short) && is_by_rk8(long));
    let run = |scene: Scene| engine.run(&Plan::new(&scene, &engine).expect("a plan")).expect("a run");
    let truth = run(scene(long).taylor(steps(1e-12)).recompute(0));
    let record = run(scene(long).adaptive(steps(1e-8), None));
    let error =
        |body: usize| attitude_error(record.final_state().orientation(body), truth.final_state().orientation(body));
    let greatest = (0..bodies).map(error).fold(0.0, f64::max);
    let sample = &record.trust().recomputed_sample;
    let ratio = sample.attitude.max / greatest;
    assert!(sample.bodies == bodies && (0.9..1.1).contains(&ratio), "{greatest:e}, {sample}");
}

/// Heavy tops of many rates.
fn tops(bodies: usize) -> Scene {
    let row = |body: usize| {
        let turned = DQuat::from_rotation_x(0.3 + 1e-3 * body as f64);
        (DVec3::new(1.0, 1.1, 0.4), turned, DVec3::new(0.1, 0.2, 4.0 + 0.1 * (body % 50) as f64))
    };
    Scene::new(Ensemble::from_fn(bodies, row).expect("valid"))
        .torque(Torque::heavy_top(1.0, 0.2 * DVec3::Z, -9.81 * DVec3::Z))
        .until(60.0)
}

/// Sixty-four bodies do not show what one in a thousand does, and only all show what none does.
#[test]
fn percentiles_near_100_need_more_bodies_than_the_99th() {
    let engine = Engine::cpu();
    let bodies_and_verdict = |percentile: f64, recomputed: Option<usize>| {
        let accuracy = Accuracy { percentile, ..Accuracy::attitude(1e-4) };
        let scene = tops(1000).until(5.0).accuracy(accuracy);
        let scene = if let Some(bodies) = recomputed { scene.recompute(bodies) } else { scene };
        let record = engine.run(&Plan::new(&scene, &engine).expect("a plan")).expect("a run");
        let sample = &record.trust().recomputed_sample;
        assert!(sample.attitude.max <= 1e-4, "{sample}");
        (sample.bodies, sample.met)
    };
    assert_eq!(bodies_and_verdict(99.0, None).1, Some(true));
    assert_eq!(bodies_and_verdict(99.9, None), (640, Some(true)));
    assert_eq!(bodies_and_verdict(99.9, Some(600)), (600, None));
    assert_eq!(bodies_and_verdict(100.0, None), (1000, Some(true)));
    assert_eq!(bodies_and_verdict(100.0, Some(999)), (999, None));
}

/// Near rounding `rk8` errs more than a run by series, which finer series measure.
#[test]
fn errors_of_series_near_rounding_are_measured_by_finer_series() {
    let engine = Engine::cpu();
    let run = |tolerance: f64| {
        let scene = tops(64).taylor(AdaptiveSteps { tolerance, least_step: None });
        engine.run(&Plan::new(&scene, &engine).expect("a plan")).expect("a run")
    };
    let truth = run(2e-15);
    for tolerance in [1e-8, 1e-11] {
        let record = run(tolerance);
        let error = |body: usize| {
            let orientation = |record: &polhode::Record| record.final_state().orientation(body);
            attitude_error(orientation(&record), orientation(&truth))
        };
        let greatest = (0..64).map(error).fold(0.0, f64::max);
        let sample = &record.trust().recomputed_sample;
        assert_eq!(sample.bodies, 64);
        let ratio = sample.attitude.max / greatest;
        assert!((0.5..2.0).contains(&ratio), "{tolerance:e}: {greatest:e}, {sample}");
        // `rk8` tells the work of torques on some of them.
        let balance = &record.trust().balance;
        assert!((8..64).contains(&balance.bodies), "{balance:?}");
    }
}
