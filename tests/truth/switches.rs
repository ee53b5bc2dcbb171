//! Taylor series under formulas that decide between cases: steps end where these do, wherever that is.

use glam::{DQuat, DVec3};
use polhode::engine::batch::prepare_with;
use polhode::engine::{Backend, End, Engine, unobserved};
use polhode::math::Precision;
use polhode::scene::{AdaptiveSteps, Outputs};
use polhode::torque::{Parameters, Torque};
use polhode::{Ensemble, Plan, Scene};

use crate::support::attitude_error;

fn steps(tolerance: f64) -> AdaptiveSteps {
    AdaptiveSteps { tolerance, least_step: None }
}

/// A torque that begins at an output time, where the sign that decides is of rounding: ω gains ½ (3 s − t₀)² about z until 3 s, of a sphere of
/// 1 kg m², and the angle (3 s − t₀)³/6.
#[test]
fn what_begins_at_an_output_time_is_not_missed() {
    /// Some roundings of the time, which the interval from t₀ is counted from, rad/s.
    const BOUND: f64 = 1e-12;
    /// Ten steps at the tolerance, rad.
    const ATTITUDE_BOUND: f64 = 1e-9;
    let ensemble = Ensemble::from_fn(17, |body| (DVec3::ONE, DQuat::IDENTITY, DVec3::Z * (0.1 * body as f64 - 0.8)));
    let (ensemble, engine) = (ensemble.expect("valid bodies"), Engine::cpu());
    let mut worst = 0.0_f64;
    for (number, text) in
        ["vec(0, 0, max(time - t0, 0))", "vec(0, 0, -min(t0 - time, 0))"].into_iter().cycle().enumerate().take(60)
    {
        // What decides is 0 there, or has a sign that is of rounding.
        let output = 0.07 * (number / 2 + 1) as f64;
        let t0 = [output, output.next_up(), output.next_down()][number % 3];
        let torque = Torque::custom(text, Parameters::new().number("t0", t0).expect("a name")).expect("a formula");
        let scene = Scene::new(ensemble.clone()).until(3.0).outputs(Outputs::Times(vec![output, 3.0]));
        let scene = scene.torque(torque).taylor(steps(1e-10));
        let record = engine.run(&Plan::new(&scene, &engine).expect("planned")).expect("ran");
        for body in 0..ensemble.len() {
            let gained = record.final_state().angular_velocity_body(body).z - ensemble.angular_velocity_body()[body].z;
            let off = (gained - 0.5 * (3.0 - t0).powi(2)).abs();
            assert!(off <= BOUND, "{text}, t0 = {t0}, body {body}: {off:e} rad/s");
            let angle = 3.0 * ensemble.angular_velocity_body()[body].z + (3.0 - t0).powi(3) / 6.0;
            let off = attitude_error(record.final_state().orientation(body), DQuat::from_rotation_z(angle));
            assert!(off <= ATTITUDE_BOUND, "{text}, t0 = {t0}, body {body}: {off:e} rad");
            worst = worst.max(off);
        }
    }
    println!("worst {worst:.1e} rad");
}

/// Each body gets a push from a time of its own on, at times so close that some lie wherever a step may end: a last step that takes in the
/// rest of an interval ends at a push, too.
#[test]
fn no_step_passes_a_jump() {
    const BODIES: usize = 5000;
    let own: Vec<f64> = (0..BODIES).map(|body| 10.0 * body as f64 / BODIES as f64).collect();
    let parameters = Parameters::new().number("t0", own.clone()).expect("a name");
    let push = Torque::custom("select(time >= t0, 0.5, 0) * vec(1, 0, 0)", parameters).expect("a formula");
    let row = (DVec3::new(1.0, 2.0, 2.5), DQuat::IDENTITY, 0.7 * DVec3::X);
    let scene = Scene::new(Ensemble::from_fn(BODIES, |_| row).expect("valid")).until(10.0).torque(push);
    let engine = Engine::cpu();
    let least_steps =
        [1e-4, 1e-6, 1e-9].map(steps).into_iter().chain([AdaptiveSteps { tolerance: 1e-9, least_step: Some(0.05) }]);
    for steps in least_steps {
        let scene = scene.clone().taylor(steps);
        let record = engine.run(&Plan::new(&scene, &engine).expect("a plan")).expect("a run");
        for (body, from) in own.iter().enumerate() {
            let spin = record.final_state().angular_velocity_body(body).x;
            let error = (spin - 0.7 - 0.5 * (10.0 - from)).abs();
            assert!(error < 1e-9, "{steps:?}, body {body}: {error:e} rad/s");
        }
    }
}

/// A body about its x axis, at rest or at a rate, under a formula's torque; its angle (within ±π) and rate at the end, and the steps taken.
fn about_x(formula: &str, rate: f64, end: f64, tolerance: f64) -> (f64, f64, u64) {
    let ensemble = Ensemble::from_columns(&[DVec3::ONE], &[DQuat::IDENTITY], &[rate * DVec3::X]).expect("valid");
    let torque = Torque::custom(&format!("{formula} * vec(1, 0, 0)"), Parameters::new()).expect("a formula");
    let scene = Scene::new(ensemble).until(end).torque(torque).taylor(steps(tolerance));
    let engine = Engine::cpu();
    let record = engine.run(&Plan::new(&scene, &engine).expect("a plan")).expect("a run");
    assert!(record.trust().failures.is_empty(), "{formula}, {tolerance:e}: {:?}", record.trust().failures);
    let (q, omega) = (record.final_state().orientation(0), record.final_state().angular_velocity_body(0));
    (2.0 * q.x.atan2(q.w), omega.x, record.trust().adaptive.expect("adaptive steps").accepted.total)
}

/// Torques that act in windows which begin and end within what would be one step: of a phase, or of the attitude. The
/// gains of the rate follow from the windows' lengths, or from the work done in them.
#[test]
fn no_step_passes_a_window() {
    /// The rate of the sine, rad/s, and the torque, N m.
    const SLOW: f64 = 1e-3;
    const TORQUE: f64 = 1e-6;
    let wide = 2.0 * 0.9_f64.acos() / SLOW;
    let turns = |end: f64| end * SLOW / std::f64::consts::TAU;
    let deep = 1.0 - 1e-3_f64.powi(2) / 2.0;
    for tolerance in [1e-4, 1e-6, 1e-9, 1e-12, 3e-15] {
        let rate = |formula: &str, end: f64| about_x(&format!("{TORQUE} * {formula}"), 0.0, end, tolerance).1;
        // From rest, where nothing but the windows asks for short steps; the sine is greatest at π/2, 5π/2, … over 0.001.
        let bound = |gained: f64| (20.0 * tolerance + 1e-13) * gained;
        let end = 1.9e4;
        let gained = TORQUE * wide * turns(end).round();
        let select = rate(&format!("select(sin({SLOW} * time) > 0.9, 1, 0)"), end);
        assert!((select - gained).abs() <= bound(gained), "{tolerance:e}: {select:e}, {gained:e}");
        let step = rate(&format!("step(0.9, sin({SLOW} * time))"), end);
        assert!((step - gained).abs() <= bound(gained), "{tolerance:e}: {step:e}, {gained:e}");
        // ∫ max(sin x - 0.9, 0) dx of a window.
        let kink = 2.0 * (0.19_f64.sqrt() - 0.9 * 0.9_f64.acos());
        let gained = TORQUE * kink / SLOW * turns(end).round();
        let max = rate(&format!("max(sin({SLOW} * time) - 0.9, 0)"), end);
        assert!((max - gained).abs() <= bound(gained), "{tolerance:e}: {max:e}, {gained:e}");
        // A narrow one, of a thousandth of a radian to each side of the greatest value: its depth is half a millionth of the sine, which looser
        // tolerances do not resolve. An error of the sine is divided by its slope at the edges, a thousandth.
        if tolerance <= 1e-9 {
            let gained = TORQUE * 2.0 * deep.acos() / SLOW;
            let narrow = rate(&format!("select(sin({SLOW} * time) > {deep:?}, 1, 0)"), 5e3);
            let bound = 1e3 * TORQUE / SLOW * (20.0 * tolerance + 1e-15);
            assert!(bound < 0.02 * gained && (narrow - gained).abs() <= bound, "{tolerance:e}: {narrow:e}, {gained:e}");
        }

        // Turns by the angle: every passage through the window of 2 · 0.3 rad adds the same work.
        let (from, torque) = (0.5_f64, 1e-3);
        let window = format!("{torque} * select(to_world(vec(0, 1, 0)).y > {:?}, 1, 0)", 0.3_f64.cos());
        let (angle, rate, taken) = about_x(&window, from, 100.0, tolerance);
        // The body starts in the middle of one, at the angle 0.
        let square = |windows: f64| from * from + 2.0 * torque * 0.6 * windows;
        let (mut time, mut windows, mut passed) = ((square(0.5).sqrt() - from) / torque, 0.5, 0.3);
        let expected = loop {
            let now = square(windows).sqrt();
            let gap = std::f64::consts::TAU - 0.6;
            if time + gap / now > 100.0 {
                break (passed + (100.0 - time) * now, now);
            }
            time += gap / now;
            passed += gap;
            let after = square(windows + 1.0).sqrt();
            let through = (after - now) / torque;
            if time + through > 100.0 {
                let left = 100.0 - time;
                break (passed + now * left + 0.5 * torque * left * left, now + torque * left);
            }
            (time, windows, passed) = (time + through, windows + 1.0, passed + 0.6);
        };
        assert!(windows > 5.0);
        let off = (angle - expected.0).rem_euclid(std::f64::consts::TAU);
        let off = off.min(std::f64::consts::TAU - off);
        let bound = 1e3 * tolerance + 1e-12;
        assert!(off <= bound && (rate - expected.1).abs() <= bound, "{tolerance:e}: {off:e} rad after {taken} steps");
    }
}

/// A deciding number that overflows, and one of rounding alone, hold nothing up: the body turns about z, whose x component in the world is 0.
#[test]
fn what_decides_may_overflow_or_be_rounding() {
    for formula in ["select(exp(1000 * time) > 5, 1, 0)", "select(to_world(vec(0, 0, 1)).x > 1e-3, 0, 1)"] {
        let text = format!("1e-3 * {formula} * vec(0, 0, 1)");
        let ensemble = Ensemble::from_columns(&[DVec3::new(1.0, 1.5, 2.0)], &[DQuat::IDENTITY], &[DVec3::Z]);
        let torque = Torque::custom(&text, Parameters::new()).expect("a formula");
        let scene = Scene::new(ensemble.expect("valid")).until(100.0).torque(torque).taylor(steps(1e-9));
        let engine = Engine::cpu();
        let record = engine.run(&Plan::new(&scene, &engine).expect("a plan")).expect("a run");
        let gained = record.final_state().angular_velocity_body(0).z - 1.0;
        // The exponential passes 5 at 1.6 ms; until it overflows at 0.71 s its series asks for short steps.
        assert!((gained - 0.05).abs() < 1e-6, "{formula}: {gained:e}");
        let taken = record.trust().adaptive.expect("adaptive steps").accepted.total;
        assert!(taken < 2000, "{formula}: {taken} steps");
    }
}

/// A square root that vanishes at the start has no series there; its first step is short, but no shorter than the least.
#[test]
fn a_root_that_vanishes_at_the_start_is_left() {
    for tolerance in [1e-6, 1e-12, 3e-15] {
        let (_, rate, _) = about_x("1e-3 * sqrt(sin(0.01 * time)^2)", 0.01, 100.0, tolerance);
        let gained = 0.1 * (1.0 - 1.0_f64.cos());
        assert!((rate - 0.01 - gained).abs() <= 1e-8 + 10.0 * tolerance, "{tolerance:e}: {rate:e}");
    }
}

/// A body that friction stops within 1 s, and that then goes to and fro about rest.
#[test]
fn a_body_that_goes_to_and_fro_across_a_switch_takes_steps_of_the_least_length() {
    const LEAST: f64 = 1e-3;
    const END: f64 = 4.0;
    let ensemble = Ensemble::from_columns(&[DVec3::ONE], &[DQuat::IDENTITY], &[0.5 * DVec3::X]).expect("valid");
    let friction = "select(angular_velocity.x > 0, -0.5, 0.5) * vec(1, 0, 0)";
    let torques = [Torque::custom(friction, Parameters::new()).expect("a formula")];
    let (frames, batch) = prepare_with(&ensemble, &torques, END, Precision::F64).expect("prepared");
    let steps = AdaptiveSteps { tolerance: 1e-9, least_step: Some(LEAST) };
    let mut session = Engine::cpu().start_taylor(batch, steps).expect("started");
    session.advance_to(End::at(END), &mut unobserved).expect("advanced");
    let state = frames[0].body_state(session.read(0..1).expect("read").combined(0));
    let taken = session.counts().expect("counted")[0].accepted;
    // Of two steps one has the least length.
    assert!((1000..=(2.0 * END / LEAST) as u64).contains(&taken), "{taken} steps");
    assert!(state.angular_velocity_body.length() <= 0.5 * LEAST, "{state:?}");
    assert!(attitude_error(state.orientation, DQuat::from_rotation_x(0.25)) < 1e-3, "{state:?}");
}
