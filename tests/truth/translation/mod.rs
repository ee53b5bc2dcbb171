//! Translation under forces that depend on velocity and attitude: golden cases, order, limits.

use crate::common;
mod coupled;
mod custom;
use crate::support;

use glam::{DQuat, DVec3};
use polhode::bodies::ensemble::Translation;
use polhode::engine::Backend;
use polhode::engine::cpu::Cpu;
use polhode::kernel::free_motion::FreeMotion;
use polhode::math::Precision;
use polhode::math::Width;
use polhode::torque::force::accelerations;
use polhode::torque::force::stepped::{Attitude, Between, Centre, NoAttitude};
use polhode::{Accuracy, Ensemble, Force, Method, Outputs, Plan, Record, Scene, Torque};
use support::golden::{self, Case, number, vector};

fn case(name: &str) -> Case {
    golden::load("forced_trans").into_iter().find(|case| case.name == name).expect("the case is there")
}

fn scene(case: &Case, forces: &[Force]) -> Scene {
    let (model, initial) = (&case.record["model"], &case.record["initial"]);
    let ensemble = Ensemble::from_columns(&[case.inertia], &[case.orientation], &[case.angular_velocity_body])
        .and_then(|ensemble| {
            ensemble.with_translation(Translation {
                mass: vec![number(&model["mass"])],
                position: vec![vector(&initial["x"])],
                velocity: vec![vector(&initial["v"])],
            })
        })
        .expect("valid bodies");
    let scene = Scene::new(ensemble).until(50.0).outputs(Outputs::Times(case.times()));
    forces.iter().fold(scene, |scene, force| scene.force(force.clone()))
}

fn run(engine: &dyn Backend, scene: &Scene) -> Record {
    let plan = Plan::new(scene, engine).expect("the plan is valid");
    polhode::run::run(engine, &plan).expect("the run succeeds")
}

/// The greatest errors of position (m) and velocity (m/s).
fn errors(record: &Record, case: &Case) -> (f64, f64) {
    let states = case.record["states"].as_array().expect("states");
    assert_eq!(record.snapshots().len(), states.len());
    // NaN is not less than anything and must not pass.
    let larger = |a: f64, b: f64| if b <= a { a } else { b };
    record.snapshots().iter().zip(states).fold((0.0, 0.0), |(x_error, v_error), (snapshot, state)| {
        let (x, v) = (vector(&state["x"]), vector(&state["v"]));
        (
            larger(x_error, (snapshot.positions()[0] - x).length()),
            larger(v_error, (snapshot.velocities()[0] - v).length()),
        )
    })
}

/// The greatest position (m) and velocity (m/s) of a case; with thrust, what it would give if it did not turn, as the
/// thrust's errors are relative to itself.
fn sizes(case: &Case) -> (f64, f64) {
    let (model, end) = (&case.record["model"], *case.times().last().expect("times"));
    if model["F_body"].is_array() {
        let acceleration = vector(&model["F_body"]).length() / number(&model["mass"]);
        return (0.5 * acceleration * end * end, acceleration * end);
    }
    let states = case.record["states"].as_array().expect("states").iter();
    states.fold((0.0, 0.0), |(x, v): (f64, f64), state| {
        (x.max(vector(&state["x"]).length()), v.max(vector(&state["v"]).length()))
    })
}

fn air_drag(case: &Case) -> [Force; 2] {
    let model = &case.record["model"];
    [Force::gravity(vector(&model["g"])), Force::quadratic_drag(number(&model["c"]))]
}

fn body_thrust(case: &Case) -> [Force; 1] {
    [Force::thrust(vector(&case.record["model"]["F_body"]))]
}

/// What `force::stepped` says of its steps of 1/64 of the velocity's own time, and of 1/32 rad.
const STEPPED: f64 = 1e-9;

/// The cubic between steps of 1/16 rad: (1/16)⁴/384 of the thrust's acceleration.
const BETWEEN: f64 = 4e-8;

/// Between outputs an attitude in f32 may be as wrong as `golden.rs` says of 80 rad, 2⁻²⁴ (4 + 80).
const ATTITUDE_F32: f64 = 5e-6;

/// The greatest attitude error (rad) of a run: a thrust that points the wrong way by so much is wrong by the same part.
fn attitude(record: &Record, case: &Case) -> f64 {
    let states = record.snapshots().iter().zip(&case.states);
    states
        .map(|(snapshot, state)| support::attitude_error(snapshot.orientation(0), state.orientation))
        .fold(0.0, f64::max)
}

fn within(name: &str, record: &Record, case: &Case, bound: f64) {
    let ((x_error, v_error), (x_size, v_size)) = (errors(record, case), sizes(case));
    let (x, v) = (x_error / x_size, v_error / v_size);
    assert!(x <= bound && v <= bound, "{name}: position {x:.1e}, velocity {v:.1e}, bound {bound:.1e}");
}

#[test]
fn quadratic_drag_moves_bodies_as_the_golden_case_says() {
    let case = case("quadratic_air_drag_p");
    let scene = scene(&case, &air_drag(&case));
    let engine = Cpu::new(Width::Lanes);
    // The rotation, however it is found, does not matter.
    within("in closed form", &run(&engine, &scene), &case, STEPPED);
    within("in steps", &run(&engine, &scene.clone().pinned(Method::Rk4, 0.5, None)), &case, STEPPED);
}

#[test]
fn thrust_follows_the_closed_form_of_a_free_body() {
    let case = case("body_thrust_p");
    let scene = scene(&case, &body_thrust(&case)).accuracy(Accuracy::attitude(1e-6));
    within("closed form", &run(&Cpu::new(Width::Lanes), &scene), &case, STEPPED);
}

#[test]
fn thrust_follows_the_steps_of_every_engine_and_precision() {
    let case = case("body_thrust_p");
    let rate = case.angular_velocity_body.length();
    for (precision, bound) in [(Precision::F64, BETWEEN), (Precision::F32, BETWEEN + ATTITUDE_F32)] {
        for method in [Method::Rk4, Method::Rk8, Method::Splitting4] {
            let scene = scene(&case, &body_thrust(&case)).pinned(method, 0.0625 / rate, Some(precision));
            for (name, engine) in [
                ("lanes", Box::new(Cpu::new(Width::Lanes)) as Box<dyn Backend>),
                ("one by one", Box::new(Cpu::new(Width::Scalar))),
                ("GPU", Box::new(common::gpu())),
            ] {
                let record = run(&*engine, &scene);
                let bound = bound + attitude(&record, &case);
                within(&format!("{method} in {precision} on {name}"), &record, &case, bound);
            }
        }
    }
}

/// A thrust under a torque, gravity and both drags: there is no closed form, so steps of half the size judge.
#[test]
fn the_order_in_the_step_is_four() {
    let (inertia, q) = (DVec3::new(1.0, 2.0, 2.5), DQuat::from_xyzw(0.3, -0.1, 0.2, 0.9).normalize());
    let end = |dt: f64| {
        let ensemble = Ensemble::from_columns(&[inertia], &[q], &[DVec3::new(0.5, 0.8, -0.3)])
            .and_then(|ensemble| {
                ensemble.with_translation(Translation {
                    mass: vec![2.0],
                    position: vec![DVec3::ZERO],
                    velocity: vec![DVec3::X],
                })
            })
            .expect("a valid body");
        let scene = Scene::new(ensemble)
            .until(8.0)
            .pinned(Method::Rk8, dt, Some(Precision::F64))
            .torque(Torque::constant_body(DVec3::new(0.1, -0.2, 0.1)))
            .torque(Torque::internal_dissipation(0.1))
            .force(Force::gravity(DVec3::new(0.1, 0.0, -0.3)))
            .force(Force::linear_drag(0.05))
            .force(Force::quadratic_drag(0.03))
            .force(Force::thrust(DVec3::new(1.0, 2.0, -1.0)));
        let record = run(&Cpu::new(Width::Lanes), &scene);
        (record.final_state().positions()[0], record.final_state().velocities()[0])
    };
    let ends: Vec<_> = (0..7).map(|n| end(0.5 / f64::from(1 << n))).collect();
    let errors: Vec<f64> = ends.windows(2).map(|pair| (pair[0].0 - pair[1].0).length()).collect();
    let halvings = (errors.len() - 1) as f64;
    let order = (errors[0] / errors[errors.len() - 1]).log2() / halvings;
    assert!((order - 4.0).abs() < 0.1, "order {order} from {errors:?}");
}

#[test]
fn the_cubic_between_two_attitudes_is_of_order_four() {
    let motion =
        FreeMotion::new(DVec3::new(1.0, 2.0, 2.5), DQuat::IDENTITY, DVec3::new(0.5, 0.8, -0.3)).expect("valid");
    let error = |h: f64| {
        let [before, after] =
            [1.0, 1.0 + h].map(|t| motion.at(t)).map(|state| (state.orientation, state.angular_velocity_body));
        let cubic = Between::new(before, after, h);
        [0.25, 0.5, 0.75]
            .map(|s| support::attitude_error(cubic.at(s), motion.at(1.0 + s * h).orientation))
            .into_iter()
            .fold(0.0, f64::max)
    };
    let order = (error(0.5) / error(0.5 / 32.0)).log2() / 5.0;
    assert!((order - 4.0).abs() < 0.1, "order {order}");
    assert!(error(1.0 / 16.0) < BETWEEN, "{:e}", error(1.0 / 16.0));
}

/// A body thrown upwards against v' = −g − k v² stops after atan(v√(k/g))/√(gk) at ln(1 + k v²/g)/2k, and falls at
/// √(g/k) in the end (C. Huygens; J. Bernoulli 1719).
#[test]
fn a_thrown_body_rises_stops_and_falls_as_the_formulas_say() {
    let (g, k, v) = (9.8125_f64, 0.02_f64, 60.0_f64);
    let forces = accelerations(&[Force::gravity(-DVec3::Z * g), Force::quadratic_drag(2.0 * k)], 0, 2.0);
    let mut centre = Centre::new(DVec3::ZERO, DVec3::Z * v);
    let stop = (v * (k / g).sqrt()).atan() / (g * k).sqrt();
    centre.advance(&forces, &NoAttitude, stop);
    let height = (k * v * v / g).ln_1p() / (2.0 * k);
    assert!(centre.velocity().length() < STEPPED * v, "{}", centre.velocity());
    assert!((centre.position().z - height).abs() < STEPPED * height, "{} m, not {height} m", centre.position().z);
    centre.advance(&forces, &NoAttitude, 1000.0);
    let limit = (g / k).sqrt();
    assert!((centre.velocity().z + limit).abs() < STEPPED * limit, "{} m/s", centre.velocity().z);
}

#[test]
fn forces_without_a_closed_form_leave_the_rotation_as_it_is() {
    let case = case("body_thrust_p");
    let engine = Cpu::new(Width::Lanes);
    let pinned = |scene: Scene| run(&engine, &scene.pinned(Method::Rk4, 0.01, Some(Precision::F32)));
    let (with, without) = (pinned(scene(&case, &body_thrust(&case))), pinned(scene(&case, &[])));
    for (a, b) in with.snapshots().iter().zip(without.snapshots()) {
        assert_eq!((a.orientations(), a.angular_velocities_body()), (b.orientations(), b.angular_velocities_body()));
    }
}

#[test]
fn errors_of_position_and_velocity_are_reported_as_they_are() {
    const END: f64 = 8.0;
    // The reference's own error of order 4 in steps a third as long, and its rotation's.
    const REFERENCE: f64 = 0.05;
    let (position, velocity) = (DVec3::new(1.0, 2.0, 3.0), DVec3::new(3.0, 0.0, 0.0));
    let scene = |torque: Option<Torque>, forces: &[Force]| {
        let (moments, spin) = (DVec3::splat(2.0), DVec3::new(0.0, 0.0, 3.0));
        let translation = Translation { mass: vec![1.0], position: vec![position], velocity: vec![velocity] };
        let ensemble = Ensemble::from_columns(&[moments], &[DQuat::IDENTITY], &[spin])
            .and_then(|ensemble| ensemble.with_translation(translation))
            .expect("a valid body");
        let scene = Scene::new(ensemble).until(END).pinned(Method::Rk4, 0.25, Some(Precision::F64));
        let scene = torque.into_iter().fold(scene, |scene, torque| scene.torque(torque));
        forces.iter().fold(scene, |scene, force| scene.force(force.clone()))
    };
    // v' = g − v.
    let falling = DVec3::new(0.0, 0.0, -9.81);
    let fallen = {
        let left = (-END).exp();
        (position + falling * END + (velocity - falling) * (1.0 - left), falling + (velocity - falling) * left)
    };
    // v' = −v²/2.
    let slowed = {
        let speed = velocity.x / (1.0 + 0.5 * velocity.x * END);
        (position + DVec3::X * (2.0 * (0.5 * velocity.x * END).ln_1p()), DVec3::X * speed)
    };
    // A sphere that drag slows down at the rate 0.2 has turned by 15 (1 − exp(−0.2 t)); v' is along its x axis.
    let thrust = {
        let steps = 1 << 14;
        let h = END / f64::from(steps);
        let acceleration = |t: f64| {
            let angle = 15.0 * (1.0 - (-0.2 * t).exp());
            DVec3::new(angle.cos(), angle.sin(), 0.0)
        };
        // Simpson's rule, of v and of x = ∫ (T − t) v' dt.
        (0..steps).fold((position + velocity * END, velocity), |(x, v), step| {
            let t = [0.0, 0.5, 1.0].map(|part| (f64::from(step) + part) * h);
            let weights = [h / 6.0, 4.0 * h / 6.0, h / 6.0];
            let sum = |of: &dyn Fn(f64) -> DVec3| -> DVec3 { (0..3).map(|node| of(t[node]) * weights[node]).sum() };
            (x + sum(&|t| acceleration(t) * (END - t)), v + sum(&acceleration))
        })
    };
    let drag = Some(Torque::linear_drag(0.4));
    let air = [Force::gravity(falling), Force::linear_drag(1.0)];
    let cases = [
        ("drag, without skipping", scene(None, &air).skipping(false), fallen),
        ("quadratic drag", scene(None, &[Force::quadratic_drag(0.5)]), slowed),
        ("thrust of a body that is slowed down", scene(drag, &[Force::thrust(DVec3::X)]), thrust),
    ];
    let cpu = Cpu::new(Width::Lanes);
    for (name, scene, (x, v)) in cases {
        let record = run(&cpu, &scene);
        let (end, recomputed) = (record.final_state(), record.trust().recomputed_sample);
        assert_eq!(recomputed.translating, 1, "{name}");
        let errors = [(end.positions()[0], x, recomputed.position), (end.velocities()[0], v, recomputed.velocity)];
        for (found, truth, reported) in errors {
            let error = found.distance(truth);
            assert!(error > 1e-13 && (reported.max / error - 1.0).abs() < REFERENCE, "{name}: {error:e}, {reported}");
        }
    }
    // In closed form there is none, and nothing is said of bodies that stay where they are.
    let recomputed = run(&cpu, &scene(None, &air)).trust().recomputed_sample;
    assert_eq!((recomputed.translating, recomputed.position.max, recomputed.velocity.max), (1, 0.0, 0.0));
    let still = Ensemble::from_columns(&[DVec3::ONE], &[DQuat::IDENTITY], &[DVec3::X]).expect("a valid body");
    let recomputed =
        run(&cpu, &Scene::new(still).until(END).accuracy(Accuracy::attitude(1e-6))).trust().recomputed_sample;
    assert_eq!((recomputed.bodies, recomputed.translating), (1, 0));
}
