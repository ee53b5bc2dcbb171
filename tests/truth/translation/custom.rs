//! Forces of the user's own, as texts and as closures: golden cases, closed forms, refusals, lost bodies.

use glam::{DQuat, DVec3};
use polhode::bodies::Status;
use polhode::bodies::ensemble::Translation;
use polhode::engine::Backend;
use polhode::engine::cpu::Cpu;
use polhode::math::Width;
use polhode::torque::Parameters;
use polhode::{Accuracy, Ensemble, Force, Method, Outputs, Plan, Precision, Scene, Torque};

use super::support::golden::{number, vector};
use super::{ATTITUDE_F32, BETWEEN, attitude, case, common, run, scene, within};

/// Errors of steps of [`polhode::torque::force::adaptive_translation::TOLERANCE`], some thousands of them.
const ADAPTIVE: f64 = 1e-10;

fn text(text: &str, parameters: Parameters) -> Force {
    Force::custom(text, parameters).unwrap_or_else(|error| panic!("{error}"))
}

/// Bodies of one kind that spin about an axis of inertia, with these positions and velocities.
fn bodies(mass: &[f64], position: &[DVec3], velocity: &[DVec3], spin: DVec3) -> Ensemble {
    let count = mass.len();
    let ensemble = Ensemble::from_fn(count, |_| (DVec3::new(1.0, 1.5, 2.0), DQuat::IDENTITY, spin));
    let translation = Translation { mass: mass.into(), position: position.into(), velocity: velocity.into() };
    ensemble.and_then(|ensemble| ensemble.with_translation(translation)).expect("valid bodies")
}

#[test]
fn a_copy_of_quadratic_drag_moves_bodies_as_the_golden_case_says() {
    let case = case("quadratic_air_drag_p");
    let model = &case.record["model"];
    let parameters = || {
        let parameters = Parameters::new().vector("g", vector(&model["g"])).expect("a name");
        parameters.number("c", number(&model["c"])).expect("a name")
    };
    let written = text("mass * g - c * norm(velocity) * velocity", parameters());
    let recorded = Force::recorded(parameters(), |s| {
        let (g, v) = (s.vector("g"), s.velocity());
        let speed = polhode::math::real::Real::sqrt(v.dot(v));
        g * s.number("mass") - v * (s.number("c") * speed)
    });
    let engine = Cpu::new(Width::Lanes);
    for force in [written, recorded.expect("a formula")] {
        let scene = scene(&case, &[force]);
        within("in closed form", &run(&engine, &scene), &case, ADAPTIVE);
        within("in steps", &run(&engine, &scene.clone().pinned(Method::Rk4, 0.5, None)), &case, ADAPTIVE);
        within("without skipping", &run(&engine, &scene.skipping(false)), &case, ADAPTIVE);
    }
}

#[test]
fn a_copy_of_thrust_follows_the_rotation_of_every_engine() {
    let case = case("body_thrust_p");
    let force = || {
        let parameters = Parameters::new().vector("f", vector(&case.record["model"]["F_body"])).expect("a name");
        text("to_world(f)", parameters)
    };
    let free = scene(&case, &[force()]).accuracy(Accuracy::attitude(1e-6));
    within("closed form", &run(&Cpu::new(Width::Lanes), &free), &case, ADAPTIVE);
    let dt = 0.0625 / case.angular_velocity_body.length();
    for (precision, bound) in [(Precision::F64, BETWEEN), (Precision::F32, BETWEEN + ATTITUDE_F32)] {
        let scene = scene(&case, &[force()]).pinned(Method::Rk8, dt, Some(precision));
        let engines: [(&str, Box<dyn Backend>); 3] = [
            ("lanes", Box::new(Cpu::new(Width::Lanes))),
            ("one by one", Box::new(Cpu::new(Width::Scalar))),
            ("GPU", Box::new(common::gpu())),
        ];
        for (name, engine) in engines {
            let record = run(&*engine, &scene);
            within(name, &record, &case, bound + attitude(&record, &case));
        }
    }
}

/// Ellipses under −GM/r² (I. Newton 1687): after one period of its own each body is where it was.
#[test]
fn bodies_on_ellipses_return_after_their_periods() {
    const GM: f64 = 3.986004418e14;
    let eccentricities = [0.0, 0.1, 0.5, 0.9];
    let semi_major = 2.4e7;
    let period = std::f64::consts::TAU * (semi_major * semi_major * semi_major / GM).sqrt();
    let perigees: Vec<DVec3> = eccentricities.iter().map(|e| DVec3::X * (semi_major * (1.0 - e))).collect();
    let speed = |e: &f64| DVec3::new(0.0, 0.6, 0.8) * (GM / semi_major * (1.0 + e) / (1.0 - e)).sqrt();
    let speeds: Vec<DVec3> = eccentricities.iter().map(speed).collect();
    let ensemble = bodies(&[0.1, 1.0, 100.0, 5e4], &perigees, &speeds, DVec3::Z);
    let parameters = Parameters::new().number("gm", GM).expect("a name");
    let gravity = text("-(gm * mass / pow(dot(position, position), 1.5)) * position", parameters);
    let scene = Scene::new(ensemble).until(period).force(gravity).accuracy(Accuracy::attitude(1e-6));
    let record = run(&Cpu::new(Width::Lanes), &scene);
    let (end, mut largest) = (record.final_state(), 0.0_f64);
    for (body, e) in eccentricities.iter().enumerate() {
        // An error along the orbit is largest where the body is fastest.
        let (x, v) = (end.positions()[body] - perigees[body], end.velocities()[body] - speeds[body]);
        largest = largest.max(x.length());
        let (x, v) = (x.length() / perigees[body].length(), v.length() / speeds[body].length());
        // A part of the energy becomes 3π/2 of it in the phase, and that so much of the distance at the perigee.
        let bound = 1e-11 * 3.0 * std::f64::consts::PI * ((1.0 + e) / (1.0 - e)).sqrt() / (1.0 - e);
        assert!(x < bound && v < bound, "eccentricity {e}: {x:e}, {v:e}, bound {bound:e}");
    }
    // The report's own reference is stepped more finely, and sees that.
    let recomputed = record.trust().recomputed_sample;
    assert_eq!(recomputed.translating, 4);
    assert!((recomputed.position.max / largest - 1.0).abs() < 0.1, "{largest:e} m, {}", recomputed.position);
}

/// The slope of the cubic between steps of 0.04 rad is off by up to (0.04/2)³ √3/27 of itself, but as much to one side in the first half of
/// a step as to the other in the second.
const BETWEEN_RATES: f64 = 1.5e-8;

/// S ω × v of a constant ω turns the velocity at the rate S ω/M, and the body goes round a circle.
#[test]
fn a_spinning_ball_curves_as_magnus_says() {
    let (strength, spin, mass, speed) = (0.3, 4.0, [0.5, 2.0], 10.0);
    let ensemble = bodies(&mass, &[DVec3::ZERO; 2], &[DVec3::X * speed; 2], DVec3::Z * spin);
    let parameters = Parameters::new().number("s", vec![strength, 2.0 * strength]).expect("a name");
    let lift = text("s * cross(to_world(angular_velocity), velocity)", parameters);
    let end = 7.0;
    let free = Scene::new(ensemble).until(end).force(lift);
    let stepped = free.clone().pinned(Method::Rk8, 0.01, Some(Precision::F64)).skipping(false);
    for (name, scene, bound) in [("closed form", free, ADAPTIVE), ("steps", stepped, BETWEEN_RATES)] {
        let record = run(&Cpu::new(Width::Lanes), &scene);
        for (body, strength) in [strength, 2.0 * strength].into_iter().enumerate() {
            let rate = strength * spin / mass[body];
            let (sin, cos) = (rate * end).sin_cos();
            let velocity = DVec3::new(cos, sin, 0.0) * speed;
            let position = DVec3::new(sin, 1.0 - cos, 0.0) * (speed / rate);
            let found = record.final_state();
            let (x, v) = (found.positions()[body] - position, found.velocities()[body] - velocity);
            let (x, v) = (x.length() / (speed * end), v.length() / speed);
            assert!(x < bound && v < bound, "{name}, body {body}: {x:e}, {v:e}");
        }
    }
}

#[test]
fn time_is_that_of_the_run_across_outputs_and_steps() {
    let ensemble = || bodies(&[2.0], &[DVec3::ZERO], &[DVec3::ZERO], DVec3::Z);
    let force = || text("vec(sin(3 * time), 0, time)", Parameters::new());
    let outputs = vec![0.7, 2.0, 5.0];
    let scene = Scene::new(ensemble()).until(5.0).outputs(Outputs::Times(outputs.clone())).force(force());
    let turned = text("to_world(to_body(vec(sin(3 * time), 0, time)))", Parameters::new());
    let follows = Scene::new(ensemble()).until(5.0).outputs(Outputs::Times(outputs.clone())).force(turned);
    let follows = follows.torque(Torque::linear_drag(0.3)).pinned(Method::Rk8, 0.01, Some(Precision::F64));
    for (name, scene, bound) in [("alone", scene, ADAPTIVE), ("along the rotation", follows, 1e-9)] {
        let record = run(&Cpu::new(Width::Lanes), &scene);
        for (snapshot, t) in record.snapshots().iter().zip(&outputs) {
            let position = DVec3::new((3.0 * t - (3.0 * t).sin()) / 18.0, 0.0, t.powi(3) / 12.0);
            let velocity = DVec3::new((1.0 - (3.0 * t).cos()) / 6.0, 0.0, t * t / 4.0);
            let (x, v) = (snapshot.positions()[0] - position, snapshot.velocities()[0] - velocity);
            assert!(x.length() < bound && v.length() < bound, "{name} at {t} s: {x}, {v}");
        }
    }
}

#[test]
fn built_in_and_custom_forces_add_up() {
    let (mass, v) = ([2.0], [DVec3::new(3.0, 0.0, 1.0)]);
    let end = |forces: &[Force]| {
        let scene = Scene::new(bodies(&mass, &[DVec3::ZERO], &v, DVec3::Z)).until(4.0);
        let scene = forces.iter().fold(scene, |scene, force| scene.force(force.clone()));
        let record = run(&Cpu::new(Width::Lanes), &scene);
        record.final_state().positions()[0]
    };
    let gravity = || Force::gravity(DVec3::new(0.0, 0.0, -1.0));
    let built_in = [gravity(), Force::quadratic_drag(0.3), Force::thrust(DVec3::X)];
    let own = text("-0.3 * norm(velocity) * velocity + to_world(vec(1, 0, 0))", Parameters::new());
    let halves = |part: &str| text(&format!("{part} * norm(velocity) * velocity"), Parameters::new());
    let expected = end(&built_in);
    let whole = end(&[gravity(), own]);
    let mixed = end(&[halves("-0.1"), gravity(), Force::thrust(DVec3::X), halves("-0.2")]);
    // Built-in forces alone are stepped to 1e-9 only.
    assert!((whole - expected).length() < 1e-8, "{whole} {expected}");
    assert!((whole - mixed).length() < ADAPTIVE, "{whole} {mixed}");
}

#[test]
fn a_force_that_is_no_number_fails_its_body_alone() {
    let positions = [DVec3::X, DVec3::new(4.0, 0.0, 0.0)];
    let ensemble = bodies(&[1.0; 2], &positions, &[-DVec3::X * 3.0, DVec3::X], DVec3::Z);
    // The first body passes the origin within a second.
    let force = text("vec(sqrt(position.x), 0, 0)", Parameters::new());
    let record = run(&Cpu::new(Width::Lanes), &Scene::new(ensemble).until(8.0).force(force));
    assert!(record.final_state().positions()[1].is_finite());
    assert_eq!(record.final_state().statuses(), [Status::CentreNotFinite, Status::Valid]);
}

#[test]
fn what_cannot_act_is_refused() {
    insta::assert_snapshot!(
        Force::custom("inertia * angular_velocity", Parameters::new()).expect_err("refused"),
        @"line 1, column 1: `inertia` is not known where this formula is used"
    );
    let taken = Parameters::new().number("mass", 1.0).expect("free in torques");
    insta::assert_snapshot!(Force::custom("vec(mass, 0, 0)", taken).expect_err("refused"), @"line 1, column 1: `mass` is defined twice");
    let refusal = |scene: Scene| Plan::new(&scene, &Cpu::new(Width::Lanes)).expect_err("refused").to_string();
    let body = || bodies(&[1.0], &[DVec3::ZERO], &[DVec3::ZERO], DVec3::Z);
    let parameters = Parameters::new().number("k", f64::NAN).expect("a name");
    insta::assert_snapshot!(
        refusal(Scene::new(body()).until(1.0).force(text("vec(k, 0, 0)", parameters))),
        @"force 1 (custom): k = NaN: expected a finite number"
    );
    let thrust = Scene::new(body()).until(1.0).force(text("to_world(vec(1, 0, 0))", Parameters::new()));
    let steps = polhode::scene::AdaptiveSteps { tolerance: 1e-9, least_step: None };
    insta::assert_snapshot!(refusal(thrust.adaptive(steps, None)), @"tolerance = 1e-9: a force that turns with the body follows equal steps of the attitude: use a method with a step dt, or taylor where torques act");
    let massless = Ensemble::from_fn(1, |_| (DVec3::new(1.0, 1.5, 2.0), DQuat::IDENTITY, DVec3::Z)).expect("valid");
    let scene = Scene::new(massless).until(1.0).force(text("vec(1, 0, 0)", Parameters::new()));
    assert!(refusal(scene).contains("mass"));
}
