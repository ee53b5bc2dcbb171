//! Moments of inertia that change in time: against closed forms and golden data, conservation and refusals.

use crate::common;
use crate::support;

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};
use polhode::bodies::ensemble::Translation;
use polhode::bodies::inertia::InertiaTensor;
use polhode::engine::Engine;
use polhode::engine::gpu::Patch;
use polhode::kernel::observe::Statistic;
use polhode::kernel::rigid_body::Body;
use polhode::math::Precision;
use polhode::math::vector::{TwoWords, Vector};
use polhode::plan::choice::floor_f32;
use polhode::scene::AdaptiveSteps;
use polhode::torque::Orbit;
use polhode::torque::variable_inertia::{Change, InertiaChange, Law, changed_body};
use polhode::{Accuracy, Ensemble, Error, Force, Method, Outputs, Plan, Record, Scene, Torque};
use support::attitude_error;
use support::golden::number;

/// Methods that ask for the rate at which the axes turn.
const METHODS: [Method; 3] = [Method::Rk4, Method::Rk8, Method::Cf4];

/// A rounding of each of some thousand steps in f64, u √n, magnified by the motion less than ten times.
const ROUNDING_F64: f64 = 2e-13;
/// 2⁻²⁴ (4 + 20 rad): the bound of `golden.rs` on rounding in f32 where the state is carried in two words.
const ROUNDING_F32: f64 = 1.5e-6;

fn rounding(precision: Precision) -> f64 {
    match precision {
        Precision::F32 => ROUNDING_F32,
        Precision::F64 => ROUNDING_F64,
    }
}

fn body(moments: DVec3, omega: DVec3) -> Ensemble {
    Ensemble::from_columns(&[moments], &[DQuat::IDENTITY], &[omega]).expect("a valid body")
}

fn run(engine: &Engine, scene: &Scene) -> Record {
    let plan = Plan::new(scene, engine).unwrap_or_else(|error| panic!("{error}"));
    engine.run(&plan).unwrap_or_else(|error| panic!("{error}"))
}

/// Every engine and precision that the issue of correctness is asked of.
fn platforms() -> [(&'static str, Engine, Precision); 4] {
    [
        ("CPU", Engine::cpu(), Precision::F64),
        ("CPU", Engine::cpu(), Precision::F32),
        ("GPU", common::gpu(), Precision::F64),
        ("GPU", common::gpu(), Precision::F32),
    ]
}

#[test]
fn spin_and_energy_follow_the_golden_cases_at_the_same_angular_momentum() {
    let (start, duration, end) = (0.4, 2.3, 3.0);
    let path = format!("{}/tests/golden/inertia_change.json", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path}: {error}"));
    let file: serde_json::Value = serde_json::from_str(&text).unwrap_or_else(|error| panic!("{path}: {error}"));
    let cases = file["cases"].as_array().expect("cases");
    assert_eq!(cases.len(), 3);
    for case in cases {
        let of = |field: &str| number(&case[field]);
        let (before, after) = (of("I_before"), of("I_after"));
        let (moments, changed) = (DVec3::new(before, before, before), DVec3::new(before, before, after));
        let omega = DVec3::new(0.0, 0.0, of("w_before"));
        let change = Torque::variable_inertia(InertiaChange::tensor(changed), Law::ramp(start, duration));
        for (name, engine, precision) in platforms() {
            for method in METHODS {
                let dt = if method == Method::Rk8 { 1.0 / 32.0 } else { 1.0 / 512.0 };
                let scene = Scene::new(body(moments, omega)).until(end).torque(change.clone());
                let record = run(&engine, &scene.pinned(method, dt, Some(precision)));
                let state = record.final_state();
                let spin = state.angular_velocity_body(0);
                let what = format!("{}, {name} {precision} {method}", case["name"]);
                // m stands along the axis and is not touched at all: what is left is one rounding of the start, and in f64 of
                // 1/I₁.
                let bound = 4.0 * f64::EPSILON;
                assert!((spin.z / of("w_after") - 1.0).abs() < bound, "{what}: {spin}");
                assert!((spin.x, spin.y) == (0.0, 0.0), "{what}: {spin}");
                let drift = record.trust().drift;
                assert!(drift.angular_momentum_world.max < bound, "{what}: {drift:?}");
                let gained = of("T_after") / of("T_before") - 1.0;
                let energy = 0.5 * spin.z * spin.z * after / of("T_before") - 1.0;
                assert!((energy / gained - 1.0).abs() < 2.0 * bound, "{what}: {energy:e}");
                // The angle: the rate is symmetric about no point, so it is summed here by itself.
                let turned = turned_about_axis(before, after, of("L"), (start, duration), end);
                let expected = DQuat::from_rotation_z(turned);
                let error = attitude_error(state.orientation(0), expected);
                // rk4 turns a steady rotation by (ω dt/2)⁴/120 of itself too little.
                let half_step = 0.5 * of("w_after") * dt;
                let steady = if method == Method::Rk4 { turned * half_step.powi(4) / 120.0 } else { 0.0 };
                let truncation = 2e-10 + steady;
                assert!(error < rounding(precision) * turned.max(1.0) + truncation, "{what}: {error} of {turned} rad");
            }
        }
    }
}

/// ∫ L/I dt for moments on a ramp, by Simpson's rule in steps far below the ramp's length, with the ramp as the binomial sum
/// of its definition: the chance of seven or more heads in thirteen throws.
fn turned_about_axis(before: f64, after: f64, momentum: f64, (start, duration): (f64, f64), end: f64) -> f64 {
    const CHOICES: [f64; 7] = [1716.0, 1287.0, 715.0, 286.0, 78.0, 13.0, 1.0];
    let done =
        |u: f64| -> f64 { (0..7).map(|k| CHOICES[k] * u.powi(7 + k as i32) * (1.0 - u).powi(6 - k as i32)).sum() };
    let rate = |u: f64| momentum / (before + (after - before) * done(u));
    const PARTS: usize = 4096;
    let point = |k: usize| k as f64 / PARTS as f64;
    let sum: f64 = (0..PARTS)
        .map(|k| (rate(point(k)) + 4.0 * rate(0.5 * (point(k) + point(k + 1))) + rate(point(k + 1))) / 6.0)
        .sum();
    start * rate(0.0) + duration * sum / PARTS as f64 + (end - start - duration) * rate(1.0)
}

/// An axisymmetric body whose moments oscillate, A along two axes and C along the third: the angular momentum stands in the
/// world, the axis goes about it at the rate L/A and the body about the axis at m₃ (1/C − 1/A). Over a whole period T of
/// ½ (1 − cos Ωt) each mean of 1/I is 1/√(I₀ I₁).
struct Oscillating {
    before: DVec3,
    after: DVec3,
    omega: DVec3,
    rate: f64,
}

const OSCILLATING: Oscillating = Oscillating {
    before: DVec3::new(1.0, 1.0, 1.5),
    after: DVec3::new(1.6, 1.6, 0.7),
    omega: DVec3::new(0.9, 0.0, 0.6),
    rate: 1.7,
};

impl Oscillating {
    fn scene(&self, periods: f64) -> Scene {
        let change = InertiaChange::tensor(self.after);
        let torque = Torque::variable_inertia(change, Law::oscillation(self.rate));
        Scene::new(body(self.before, self.omega)).until(periods * TAU / self.rate).torque(torque)
    }

    /// Orientation and angular velocity after whole periods.
    fn after(&self, periods: f64) -> (DQuat, DVec3) {
        let span = periods * TAU / self.rate;
        let m = self.before * self.omega;
        let mean = |axis: usize| span / (self.before[axis] * self.after[axis]).sqrt();
        let precession = DQuat::from_axis_angle(m.normalize(), m.length() * mean(0));
        let spin = DQuat::from_rotation_z(m.z * (mean(2) - mean(0)));
        (precession * spin, spin.conjugate() * m / self.before)
    }
}

/// Errors of attitude and of angular velocity after whole periods.
fn oscillating_errors(engine: &Engine, method: Method, dt: f64, precision: Precision, periods: f64) -> (f64, f64) {
    let record = run(engine, &OSCILLATING.scene(periods).pinned(method, dt, Some(precision)));
    let (orientation, omega) = OSCILLATING.after(periods);
    let state = record.final_state();
    let spin = state.angular_velocity_body(0);
    (attitude_error(state.orientation(0), orientation), (spin - omega).length() / omega.length())
}

#[test]
fn an_axisymmetric_body_with_oscillating_moments_follows_its_closed_form() {
    for (name, engine, precision) in platforms() {
        for method in METHODS {
            let dt = if method == Method::Rk8 { 1.0 / 64.0 } else { 1.0 / 1024.0 };
            let (attitude, omega) = oscillating_errors(&engine, method, dt, precision, 3.0);
            println!("{name} {precision} {method}: {attitude:.1e} rad, {omega:.1e}");
            // Of order 4 with 1e-3 rad a step, over 14 rad.
            let truncation = if method == Method::Rk8 { 0.0 } else { 2e-11 };
            let bound = rounding(precision) + truncation;
            assert!(attitude < bound && omega < bound, "{name} {precision} {method}: {attitude:e} rad, {omega:e}");
        }
    }
}

/// Tolerance of a step, and the error that some tens of such steps come to.
fn adaptive(precision: Precision) -> (AdaptiveSteps, f64) {
    let (tolerance, bound) = if precision == Precision::F64 { (1e-12, 1e-9) } else { (1e-5, 1e-3) };
    (AdaptiveSteps { tolerance, least_step: None }, bound)
}

#[test]
fn adaptive_steps_follow_the_closed_form_too() {
    for (name, engine, precision) in platforms() {
        let (steps, bound) = adaptive(precision);
        let record = run(&engine, &OSCILLATING.scene(3.0).adaptive(steps, Some(precision)));
        let (orientation, _) = OSCILLATING.after(3.0);
        let error = attitude_error(record.final_state().orientation(0), orientation);
        assert!(error < bound, "{name} {precision}: {error:e} rad");
    }
}

#[test]
fn adaptive_steps_see_a_ramp_that_equal_steps_see() {
    let change = Torque::variable_inertia(InertiaChange::factor(0.4), Law::ramp(37.3, 2.0));
    let scene = |moments| Scene::new(body(moments, DVec3::new(0.3, 0.8, 0.4))).until(50.0).torque(change.clone());
    let scene = scene(DVec3::new(1.0, 1.6, 2.2));
    let equal = run(&Engine::cpu(), &scene.clone().pinned(Method::Rk8, 1.0 / 64.0, Some(Precision::F64)));
    for (name, engine, precision) in platforms() {
        let (steps, bound) = adaptive(precision);
        let record = run(&engine, &scene.clone().adaptive(steps, Some(precision)));
        let error = attitude_error(record.final_state().orientation(0), equal.final_state().orientation(0));
        assert!(error < bound, "{name} {precision}: {error:e} rad");
    }
}

#[test]
fn angular_momentum_stays_and_energy_changes_by_the_work_of_the_change() {
    let change = Torque::variable_inertia(InertiaChange::tensor(DVec3::new(0.7, 1.1, 0.9)), Law::ramp(1.3, 6.0));
    let swing = Torque::variable_inertia(InertiaChange::factor(vec![0.5]), Law::oscillation(vec![2.1]));
    let drag = Torque::linear_drag(0.05);
    let slip = Torque::internal_dissipation(0.02);
    let push = Torque::sinusoidal(DVec3::new(0.1, -0.2, 0.05), DVec3::ZERO, 1.3);
    let scenes = [
        ("ramp", vec![change.clone()]),
        ("oscillation", vec![swing.clone()]),
        ("ramp with drag, dissipation and a push", vec![drag, change, slip, push]),
    ];
    for precision in Precision::ALL {
        for (name, torques) in &scenes {
            let scene = Scene::new(body(DVec3::new(1.0, 1.6, 2.2), DVec3::new(0.5, 0.9, -0.4)));
            let scene = torques.iter().fold(scene.until(10.0), |scene, torque| scene.torque(torque.clone()));
            let scene = scene.outputs(Outputs::Times(vec![3.7, 10.0]));
            let record = run(&Engine::cpu(), &scene.pinned(Method::Rk8, 1.0 / 64.0, Some(precision)));
            let trust = record.trust();
            println!("{precision} {name}: {}, {}", trust.balance, trust.drift.angular_momentum_world.max);
            assert_eq!(trust.balance.bodies, 1, "{name}");
            assert!(trust.balance.energy.max < rounding(precision), "{name} in {precision}: {}", trust.balance);
            assert!(trust.balance.angular_momentum_world.max < rounding(precision), "{name}: {}", trust.balance);
            assert_eq!(trust.drift.kinetic_energy_bodies, 0, "{name}: {trust}");
            assert_eq!(trust.drift.angular_momentum_bodies, usize::from(torques.len() == 1), "{name}: {trust}");
            if torques.len() == 1 {
                assert!(trust.drift.angular_momentum_world.max < rounding(precision), "{name}: {trust}");
            }
        }
    }
}

#[test]
fn statistics_without_states_take_the_moments_of_their_time() {
    let change = Torque::variable_inertia(InertiaChange::factor(0.5), Law::ramp(0.5, 2.0));
    let (moments, omega) = (DVec3::new(1.0, 1.6, 2.2), DVec3::new(0.5, 0.9, -0.4));
    let scene = Scene::new(body(moments, omega)).until(3.0).torque(change).statistics(Statistic::ALL).without_states();
    let energy = 0.5 * omega.dot(moments * omega);
    for (name, engine, precision) in platforms() {
        for scene in [
            scene.clone().pinned(Method::Rk8, 1.0 / 64.0, Some(precision)),
            scene.clone().adaptive(adaptive(precision).0, Some(precision)),
        ] {
            let record = run(&engine, &scene);
            let found = record.statistics().last().expect("the end").of(Statistic::KineticEnergy).expect("asked for");
            // The same angular momentum in the body at half the moments, wherever it has come to in it.
            let [least, most] = [2.0 * energy * 0.4, 2.0 * energy * 2.5];
            assert!((least..most).contains(&found.mean), "{name} {precision}: {}", found.mean);
            let momentum = record.statistics()[0].of(Statistic::AngularMomentum).expect("asked for").mean;
            assert!((momentum / (moments * omega).length() - 1.0).abs() < 1e-4, "{name} {precision}: {momentum}");
            // What changes the moments changes the energy, and its work is the balance's.
            let trust = record.trust();
            assert_eq!((trust.drift.kinetic_energy_bodies, trust.drift.angular_momentum_bodies), (0, 1), "{trust}");
            assert!(trust.balance.energy.max < 1e-5, "{name} {precision}: {}", trust.balance);
        }
    }
}

#[test]
fn a_thrust_turns_with_moments_that_change_on_every_engine() {
    let change = Torque::variable_inertia(InertiaChange::factor(0.5), Law::ramp(0.5, 2.0));
    let translation = Translation { mass: vec![2.0], position: vec![DVec3::ZERO], velocity: vec![DVec3::ZERO] };
    let bodies = body(DVec3::new(1.0, 1.6, 2.2), DVec3::new(0.5, 0.9, -0.4)).with_translation(translation);
    let scene = Scene::new(bodies.expect("a mass")).until(3.0).torque(change).force(Force::thrust(DVec3::X));
    let places = |dt: f64| {
        platforms().map(|(name, engine, precision)| {
            let record = run(&engine, &scene.clone().pinned(Method::Rk8, dt, Some(precision)));
            (name, precision, record.final_state().positions()[0])
        })
    };
    let truth = places(1.0 / 256.0)[0].2;
    for (name, precision, place) in places(1.0 / 64.0) {
        let error = (place - truth).length();
        // The cubic between attitudes is wrong by 1e-9 of a rad; the rate of a moment 1/64 s too early by 1e-3 of itself.
        let bound = if precision == Precision::F64 { 1e-8 } else { 1e-5 };
        assert!(error < bound, "{name} {precision}: {error:e} m");
    }
}

#[test]
fn a_balance_from_outside_takes_the_moments_at_the_end() {
    let change = Torque::variable_inertia(InertiaChange::factor(0.5), Law::ramp(0.5, 2.0));
    let scene = Scene::new(body(DVec3::new(1.0, 1.6, 2.2), DVec3::new(0.5, 0.9, -0.4))).until(3.0).torque(change);
    let scene = scene.pinned(Method::Rk8, 1.0 / 64.0, Some(Precision::F64));
    let engine = Engine::cpu();
    let plan = Plan::new(&scene, &engine).expect("a plan");
    let record = engine.run(&plan).expect("a run");
    let end = record.final_state();
    let balance = polhode::run::balance(&plan, end.orientations(), end.angular_velocities_body()).expect("a balance");
    assert!(balance.energy.max < ROUNDING_F64 && balance.angular_momentum_world.max < ROUNDING_F64, "{balance}");
}

#[test]
fn moments_before_and_after_a_ramp_are_exact_in_two_words_of_f32() {
    // Each of two residues is rounded to 2⁻²⁴ of itself.
    const TWO_WORDS: f64 = 2e-14;
    let [x, y, z] = [[0.9, 0.6], [1.3, 2.9], [1.1, 1.1000001]];
    let words = |number: f64| (number as f32, (number - f64::from(number as f32)) as f32);
    let vector = |of: &dyn Fn([f64; 2]) -> f32| Vector::new(of(x), of(y), of(z));
    let body = Body::new(TwoWords {
        value: vector(&|[before, _]| words(1.0 / before).0),
        residue: vector(&|[before, _]| words(1.0 / before).1),
    });
    let change = Change {
        kappa: vector(&|[before, after]| (before / after) as f32),
        difference: TwoWords {
            value: vector(&|[before, after]| words(1.0 / after - 1.0 / before).0),
            residue: vector(&|[before, after]| words(1.0 / after - 1.0 / before).1),
        },
    };
    let sum = |a: f32, b: f32| f64::from(a) + f64::from(b);
    for (done, end) in [(0.0, 0), (1.0, 1)] {
        let changed = changed_body(&body, &change, done).body;
        let (a, b) = (changed.inverse_moments.value, changed.inverse_moments.residue);
        for (found, moments) in [(sum(a.x, b.x), x), (sum(a.y, b.y), y), (sum(a.z, b.z), z)] {
            assert!((found * moments[end] - 1.0).abs() < TWO_WORDS, "{found:e} at {done}");
        }
        let (g, h) = (changed.gyroscopic.value, changed.gyroscopic.residue);
        for (found, [larger, smaller]) in [(sum(g.x, h.x), [z, y]), (sum(g.y, h.y), [x, z]), (sum(g.z, h.z), [y, x])] {
            let expected = 1.0 / larger[end] - 1.0 / smaller[end];
            assert!((found - expected).abs() < TWO_WORDS * (1.0 / smaller[end]), "{found:e}, {expected:e} at {done}");
        }
    }
}

#[test]
fn a_long_rotation_with_a_ramp_in_its_midst_is_as_accurate_as_a_rigid_one() {
    let (before, after, spin) = (0.9, 0.6, 0.877);
    let moments = |moment| DVec3::new(0.8, 0.8, moment);
    let change = Torque::variable_inertia(InertiaChange::tensor(moments(after)), Law::ramp(900.0, 50.0));
    let scene = Scene::new(body(moments(before), DVec3::new(0.0, 0.0, spin))).until(2000.0).torque(change);
    for (name, engine, precision) in platforms() {
        let record = run(&engine, &scene.clone().pinned(Method::Rk8, 0.125, Some(precision)));
        let turned = turned_about_axis(before, after, before * spin, (900.0, 50.0), 2000.0);
        let error = attitude_error(record.final_state().orientation(0), DQuat::from_rotation_z(turned));
        let bound = if precision == Precision::F32 { floor_f32(turned) } else { 1e-11 };
        println!("{name} {precision}: {error:.1e} rad of {turned:.0}");
        assert!(error < bound, "{name} {precision}: {error:e} rad of {turned}");
    }
}

#[test]
fn stale_moments_in_the_shader_are_caught() {
    for (from, to) in [
        ("omega = angular_velocity(changed.body, m, carried);", "omega = angular_velocity(body, m, correction);"),
        (
            "gyroscopic = gyroscopic_term(changed.body, m, carried);",
            "gyroscopic = gyroscopic_term(body, m, correction);",
        ),
    ] {
        let mut options = common::any_adapter();
        options.patches = vec![Patch { file: "torque/sum.wgsl".into(), from: from.into(), to: to.into() }];
        let (attitude, _) =
            oscillating_errors(&common::gpu_with(options), Method::Rk8, 1.0 / 64.0, Precision::F64, 3.0);
        assert!(attitude > 1e-2, "{to} passed with {attitude:e} rad");
    }
}

fn refusal(scene: &Scene) -> String {
    match Plan::new(scene, &Engine::cpu()) {
        Err(error) => error.to_string(),
        Ok(_) => panic!("passed"),
    }
}

#[test]
fn methods_that_take_a_body_for_rigid_are_refused_and_never_chosen() {
    let change = Torque::variable_inertia(InertiaChange::factor(0.5), Law::oscillation(2.0));
    let scene = Scene::new(body(DVec3::new(1.0, 1.6, 2.2), DVec3::Z)).until(10.0).torque(change);
    let following: Vec<Method> = Method::ALL.into_iter().filter(|method| !method.properties().rigid_only).collect();
    assert_eq!(following, METHODS, "METHODS has the methods that are not `rigid_only`");
    for method in Method::ALL {
        let plan = Plan::new(&scene.clone().pinned(method, 0.01, None), &Engine::cpu()).map(|_| ());
        if METHODS.contains(&method) {
            assert_eq!(plan, Ok(()), "{method}");
        } else {
            assert!(matches!(plan, Err(Error::RigidOnly { torque: 0, .. })), "{method}: {plan:?}");
        }
    }
    // A spin about a principal axis would be a plain rotation without the change.
    for skipping in [true, false] {
        let scene = scene.clone().accuracy(Accuracy::attitude(1e-6)).skipping(skipping);
        let engine = Engine::cpu();
        let plan = Plan::new(&scene, &engine).expect("a plan");
        assert!(!plan.is_closed_form());
        assert!(METHODS.contains(&plan.method()), "{}", plan.method());
        let record = engine.run(&plan).expect("a run");
        assert_eq!(record.trust().recomputed_sample.met, Some(true), "{}", record.trust());
    }
}

#[test]
fn changes_that_no_body_has_are_refused() {
    let tensor = |tensor: InertiaTensor| InertiaChange::tensor(tensor);
    let moments = |x, y, z| tensor(InertiaTensor::from_principal_moments(DVec3::new(x, y, z)));
    let ramp = || Law::ramp(1.0, 1.0);
    let tilted = InertiaTensor { xx: 1.0, yy: 1.6, zz: 2.2, xy: 0.1, xz: 0.0, yz: 0.0 };
    for (change, law, expected) in [
        (tensor(tilted), ramp(), "principal axes"),
        (moments(1.0, 1.0, 2.5), ramp(), "I1 + I2"),
        (moments(1.0, 1.0, -0.5), ramp(), "positive"),
        (moments(1.0, 1.0, 0.0), ramp(), "positive"),
        (moments(1.0, f64::NAN, 1.0), ramp(), "finite"),
        (InertiaChange::factor(0.0), ramp(), "above zero"),
        (InertiaChange::factor(vec![1.0, 2.0]), ramp(), "rows"),
        (InertiaChange::factor(0.5), Law::ramp(-1.0, 1.0), "not negative"),
        (InertiaChange::factor(0.5), Law::ramp(1.0, 0.0), "above zero"),
        (InertiaChange::factor(0.5), Law::oscillation(f64::INFINITY), "finite"),
    ] {
        let torque = Torque::variable_inertia(change, law);
        let scene = Scene::new(body(DVec3::new(1.0, 1.6, 2.2), DVec3::Z)).until(1.0).torque(torque);
        let message = refusal(&scene.pinned(Method::Rk4, 0.01, None));
        assert!(message.contains(expected) && message.lines().count() == 1, "{message}");
    }
    let change = Torque::variable_inertia(InertiaChange::factor(0.5), ramp());
    let scene = Scene::new(body(DVec3::new(1.0, 1.6, 2.2), DVec3::Z)).until(1.0);
    let message = refusal(&scene.torque(change.clone()).torque(change).pinned(Method::Rk4, 0.01, None));
    assert!(message.starts_with("torque 2 (variable-inertia)"), "{message}");
}

/// A body on a circular orbit about (0, 0, 0) of gravitational parameter 1, by the classical Runge-Kutta method on Euler's
/// equations in the body's axes, written for the test: orientation and angular velocity at `end`.
fn orbiting(initial: InertiaTensor, change: &Torque, omega: DVec3, radius: f64, end: f64) -> (DQuat, DVec3) {
    let rate = |t: f64, q: DQuat, m: DVec3| {
        let tensor = change.tensor_at(0, initial, t);
        let omega = m / DVec3::new(tensor.xx, tensor.yy, tensor.zz);
        let motion = radius.powf(-1.5);
        let u = q.inverse() * DVec3::new((motion * t).cos(), (motion * t).sin(), 0.0);
        let turn = q * DQuat::from_xyzw(omega.x, omega.y, omega.z, 0.0) * 0.5;
        (turn, m.cross(omega) + 3.0 * motion * motion * u.cross(tensor * u))
    };
    let steps = 40_000;
    let h = end / f64::from(steps);
    let (mut q, mut m) = (DQuat::IDENTITY, initial * omega);
    for step in 0..steps {
        let t = h * f64::from(step);
        let k1 = rate(t, q, m);
        let k2 = rate(t + 0.5 * h, q + k1.0 * (0.5 * h), m + k1.1 * (0.5 * h));
        let k3 = rate(t + 0.5 * h, q + k2.0 * (0.5 * h), m + k2.1 * (0.5 * h));
        let k4 = rate(t + h, q + k3.0 * h, m + k3.1 * h);
        q = (q + (k1.0 + (k2.0 + k3.0) * 2.0 + k4.0) * (h / 6.0)).normalize();
        m += (k1.1 + 2.0 * (k2.1 + k3.1) + k4.1) * (h / 6.0);
    }
    let tensor = change.tensor_at(0, initial, end);
    (q, m / DVec3::new(tensor.xx, tensor.yy, tensor.zz))
}

#[test]
fn the_gravity_gradient_takes_the_moments_of_its_time() {
    let (moments, omega, radius, end) = (DVec3::new(1.0, 1.6, 2.2), DVec3::new(0.2, -0.3, 0.5), 1.3, 12.0);
    let change = Torque::variable_inertia(InertiaChange::tensor(DVec3::new(2.0, 0.9, 1.4)), Law::ramp(1.0, 9.0));
    let (orientation, spin) = orbiting(moments.into(), &change, omega, radius, end);
    for orbit in [Orbit::circular(1.0, radius), Orbit::kepler(1.0, radius, 1e-14)] {
        for (name, engine, precision) in platforms() {
            let scene = Scene::new(body(moments, omega)).until(end).torque(Torque::gravity_gradient(orbit.clone()));
            let scene = scene.torque(change.clone());
            let record = run(&engine, &scene.pinned(Method::Rk8, 1.0 / 64.0, Some(precision)));
            let state = record.final_state();
            let error = attitude_error(state.orientation(0), orientation);
            let slower = (state.angular_velocity_body(0) - spin).length();
            println!("{name} {precision}: {error:.1e} rad, {slower:.1e} rad/s");
            // The test's own method is wrong by some 1e-12 at 3e-4 s, and the orbit by its eccentricity.
            let bound = 10.0 * rounding(precision) + 1e-10;
            assert!(error < bound && slower < bound, "{name} {precision}: {error:e} rad, {slower:e} rad/s");
        }
    }
}

#[test]
fn a_linear_rotor_stretches() {
    // Carbon monoxide, its bond a tenth longer: I grows by 1.21.
    let moments = DVec3::new(1.4e-46, 1.4e-46, 0.0);
    let omega = DVec3::new(1e12, 0.5e12, 0.0);
    let stretched = InertiaChange::tensor(moments * 1.21);
    let torque = Torque::variable_inertia(stretched, Law::ramp(1e-12, 5e-12));
    let scene = Scene::new(body(moments, omega)).until(1e-11).torque(torque).pinned(Method::Rk8, 1e-14, None);
    let spin = run(&Engine::cpu(), &scene).final_state().angular_velocity_body(0);
    assert!((spin.length() * 1.21 / omega.length() - 1.0).abs() < 1e-12, "{spin}");
    let bent =
        Torque::variable_inertia(InertiaChange::tensor(DVec3::new(1.4e-46, 1.4e-46, 1e-48)), Law::ramp(1e-12, 5e-12));
    let scene = Scene::new(body(moments, omega)).until(1e-11).torque(bent).pinned(Method::Rk8, 1e-14, None);
    assert!(refusal(&scene).contains("linear rotor"));
}
