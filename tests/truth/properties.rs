//! Properties over random scenes, with shrinking; what once failed is kept in `proptest-regressions/`.

use crate::common;

use std::ops::Range;

use glam::{DQuat, DVec3};
use polhode::kernel::free_motion::FreeMotion;
use polhode::study::Scalar as Distribution;
use polhode::study::draw::{Column, Draw};
use polhode::torque::{Orbit, Torque};
use polhode::verify::{Options, verify};
use polhode::{Accuracy, Engine, Ensemble, Method, Outputs, Plan, Precision, Record, Scene};
use proptest::prelude::*;

/// Principal moments as b + c, c + a, a + b: valid whatever a, b, c > 0 are.
fn moments() -> impl Strategy<Value = DVec3> {
    let part = || 0.05..1.0_f64;
    (part(), part(), part()).prop_map(|(a, b, c)| DVec3::new(b + c, c + a, a + b))
}

fn vector(range: Range<f64>) -> impl Strategy<Value = DVec3> {
    [range.clone(), range.clone(), range].prop_map(DVec3::from_array)
}

fn orientation() -> impl Strategy<Value = DQuat> {
    [-1.0..1.0_f64, -1.0..1.0, -1.0..1.0, -1.0..1.0]
        .prop_filter("a quaternion of some length", |q| q.iter().map(|x| x * x).sum::<f64>() > 0.01)
        .prop_map(|q| DQuat::from_array(q).normalize())
}

type Row = (DVec3, DQuat, DVec3);

fn row() -> impl Strategy<Value = Row> {
    (moments(), orientation(), vector(-2.0..2.0))
}

/// Torques of about a newton metre: such that depend on the attitude, on the time, on the angular velocity.
fn torque() -> impl Strategy<Value = Torque> {
    prop_oneof![
        vector(-1.0..1.0).prop_map(Torque::constant_body),
        vector(-1.0..1.0).prop_map(Torque::constant_world),
        (0.0..0.3_f64).prop_map(Torque::linear_drag),
        (0.0..0.3_f64).prop_map(Torque::quadratic_drag),
        (vector(-1.0..1.0), vector(-1.0..1.0), -3.0..3.0_f64)
            .prop_map(|(sine, cosine, rate)| Torque::sinusoidal(sine, cosine, rate)),
        (0.0..0.9_f64, -1.0..1.0_f64)
            .prop_map(|(e, i)| Torque::gravity_gradient(Orbit::kepler(1.0, 1.5, e).inclined(i))),
        (vector(-0.5..0.5), vector(-2.0..2.0)).prop_map(|(c, g)| Torque::heavy_top(1.0, c, g)),
        (0.0..1.0_f64, orientation()).prop_map(|(k, target)| Torque::sine_spring(k, target)),
    ]
}

/// The methods that users take, without those that are there for comparison.
fn method() -> impl Strategy<Value = Method> {
    let methods: Vec<_> = Method::ALL.into_iter().filter(|method| !method.properties().baseline).collect();
    proptest::sample::select(methods)
}

fn precision() -> impl Strategy<Value = Precision> {
    proptest::sample::select(Precision::ALL.to_vec())
}

fn scene(rows: &[Row], torques: &[Torque], end: f64) -> Scene {
    let scene = Scene::new(Ensemble::from_fn(rows.len(), |body| rows[body]).expect("valid bodies")).until(end);
    torques.iter().fold(scene, |scene, torque| scene.torque(torque.clone()))
}

fn run(scene: &Scene) -> Record {
    let engine = Engine::cpu();
    engine.run(&Plan::new(scene, &engine).expect("a plan")).expect("a run")
}

/// Body 0 at the end of steps of `dt`.
fn stepped(row: Row, torques: &[Torque], method: Method, precision: Precision, dt: f64, end: f64) -> (DQuat, DVec3) {
    let record = run(&scene(&[row], torques, end).pinned(method, dt, Some(precision)));
    (record.final_state().orientation(0), record.final_state().angular_velocity_body(0))
}

fn angle(a: DQuat, b: DQuat) -> f64 {
    let between = a.conjugate() * b;
    2.0 * between.xyz().length().atan2(between.w.abs())
}

/// One rounding.
fn unit(precision: Precision) -> f64 {
    // In f32 the state has two words, of which about 2⁻⁴⁴ survives a step; the increments are rounded to 24 bits each.
    if precision == Precision::F64 { 1.1e-16 } else { 6e-8 }
}

/// What `steps` steps of size ω dt ≤ `angle` leave of roundings: each step rounds the state (in f32 the increment) some
/// twenty times, in whatever direction, and an early rounding of the angular velocity turns the body ever after.
fn rounding(precision: Precision, steps: f64, angle: f64) -> f64 {
    let each = if precision == Precision::F64 { unit(precision) } else { unit(precision) * angle.max(0.01) };
    20.0 * each * steps.sqrt() * (1.0 + steps * angle)
}

/// How many scenes a property is tried on: `PROPTEST_CASES` if set, as for a night's run, else `usual`.
fn cases(usual: u32) -> u32 {
    std::env::var("PROPTEST_CASES").ok().and_then(|cases| cases.parse().ok()).unwrap_or(usual)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: cases(48), ..ProptestConfig::default() })]

    #[test]
    fn valid_bodies_of_any_scale_never_give_what_is_no_number(
        (parts, q, direction) in row(),
        moment in -46.0..38.0_f64,
        spin in -9.0..15.0_f64,
        precision in precision(),
        method in method(),
        free in any::<bool>(),
    ) {
        let inertia = parts * 10_f64.powf(moment);
        let omega = direction * 10_f64.powf(spin);
        let rate = omega.length().max(1e-9);
        let scene = scene(&[(inertia, q, omega)], &[], 20.0 / rate);
        let scene = if free {
            scene.accuracy(Accuracy::attitude(1e-4)).precision(Some(precision))
        } else {
            scene.pinned(method, 0.05 / rate, Some(precision))
        };
        let record = run(&scene);
        prop_assert!(record.trust().failed_bodies.is_empty());
        let state = record.final_state();
        prop_assert!(state.orientation(0).is_finite() && state.angular_velocity_body(0).is_finite());
        prop_assert!((state.orientation(0).length() - 1.0).abs() < 1e-15);
    }

    #[test]
    fn a_driven_body_stays_a_number(
        row in row(),
        torques in proptest::collection::vec(torque(), 1..4),
        precision in precision(),
        method in method(),
    ) {
        let (q, omega) = stepped(row, &torques, method, precision, 0.02, 4.0);
        prop_assert!(q.is_finite() && omega.is_finite());
    }

    #[test]
    fn the_closed_form_keeps_energy_and_angular_momentum_at_any_time((inertia, q, omega) in row(), time in -1e6..1e6_f64) {
        let motion = FreeMotion::new(inertia, q, omega).expect("valid");
        let (start, state) = (motion.at(0.0), motion.at(time));
        let momentum = (state.angular_momentum_world - start.angular_momentum_world).length();
        // Some tens of roundings of 1.1e-16, times the ratio of the moments, at most 40, by which a rounding of the
        // direction of m changes the energy.
        let ratio = inertia.max_element() / inertia.min_element();
        prop_assert!(momentum <= 5e-15 * start.angular_momentum_world.length());
        prop_assert!((state.kinetic_energy - start.kinetic_energy).abs() <= 5e-15 * ratio * start.kinetic_energy);
    }

    #[test]
    fn splittings_keep_the_invariants_of_free_bodies_to_rounding((inertia, q, omega) in row(), precision in precision()) {
        let record = run(&scene(&[(inertia, q, omega)], &[], 20.0).pinned(Method::Splitting4, 0.02, Some(precision)));
        let drift = &record.trust().drift;
        let bound = rounding(precision, 1000.0, 0.0);
        prop_assert!(drift.kinetic_energy.max <= bound, "{:e}", drift.kinetic_energy.max);
        prop_assert!(drift.angular_momentum_world.max <= bound, "{:e}", drift.angular_momentum_world.max);
    }

    #[test]
    fn time_reversed_a_symmetric_method_returns(
        row in row(),
        top in (vector(-0.5..0.5), vector(-2.0..2.0)),
        precision in precision(),
        method in proptest::sample::select(vec![
            Method::Splitting2, Method::Splitting4, Method::Splitting6, Method::ImplicitMidpoint, Method::Dlm,
        ]),
    ) {
        // A torque of the attitude alone lets the motion run back when the spin is turned round.
        let torques = [Torque::heavy_top(1.0, top.0, top.1)];
        let (dt, end) = (0.02, 2.0);
        let (q, omega) = stepped(row, &torques, method, precision, dt, end);
        let (q, omega) = stepped((row.0, q, -omega), &torques, method, precision, dt, end);
        // Both runs round; a rounding grows with the torque's own stretching, e^(rate t) with a rate of 3/s at most.
        let bound = 30.0 * rounding(precision, 2.0 * end / dt, 0.05);
        prop_assert!(angle(q, row.1) <= bound, "{method}: {:e}, {bound:e} allowed", angle(q, row.1));
        prop_assert!((omega + row.2).length() <= bound * 10.0, "{method}: {omega} after {}", row.2);
    }

    #[test]
    fn turning_the_world_turns_the_result(row in row(), turn in orientation(), method in method(), precision in precision()) {
        let (q, omega) = stepped(row, &[], method, precision, 0.02, 2.0);
        let (turned, same) = stepped((row.0, turn * row.1, row.2), &[], method, precision, 0.02, 2.0);
        let bound = rounding(precision, 100.0, 0.05);
        prop_assert!(angle(turn * q, turned) <= bound, "{method}: {:e}", angle(turn * q, turned));
        prop_assert!((omega - same).length() <= bound * 4.0);
    }

    #[test]
    fn the_order_of_the_axes_does_not_matter(
        (inertia, q, omega) in row(), torque in vector(-1.0..1.0), method in method(), precision in precision(),
    ) {
        // x y z -> y z x is a rotation of the body's axes.
        let permuted = |v: DVec3| DVec3::new(v.y, v.z, v.x);
        let axes = DQuat::from_mat3(&glam::DMat3::from_cols(DVec3::Z, DVec3::X, DVec3::Y));
        let (one, omega_one) =
            stepped((inertia, q, omega), &[Torque::constant_body(torque)], method, precision, 0.02, 2.0);
        let (other, omega_other) = stepped(
            (permuted(inertia), q * axes.conjugate(), permuted(omega)),
            &[Torque::constant_body(permuted(torque))],
            method,
            precision,
            0.02,
            2.0,
        );
        let bound = rounding(precision, 100.0, 0.1) * 4.0;
        prop_assert!(angle(one, other * axes) <= bound, "{method}: {:e}", angle(one, other * axes));
        prop_assert!((permuted(omega_one) - omega_other).length() <= bound * 4.0);
    }

    #[test]
    fn units_do_not_matter(
        (inertia, q, omega) in row(),
        torque in vector(-1.0..1.0),
        mass in 1e-20..1e20_f64,
        time in 1e-6..1e6_f64,
        method in method(),
        precision in precision(),
    ) {
        let (one, omega_one) =
            stepped((inertia, q, omega), &[Torque::constant_body(torque)], method, precision, 0.02, 2.0);
        let scaled = Torque::constant_body(torque * (mass / (time * time)));
        let (other, omega_other) =
            stepped((inertia * mass, q, omega / time), &[scaled], method, precision, 0.02 * time, 2.0 * time);
        let bound = rounding(precision, 100.0, 0.1) * 4.0;
        prop_assert!(angle(one, other) <= bound, "{method}: {:e}", angle(one, other));
        prop_assert!((omega_one - omega_other * time).length() <= bound * 4.0);
    }

    #[test]
    fn a_span_cut_in_two_ends_where_the_whole_does(
        row in row(), torques in proptest::collection::vec(torque(), 0..3), method in method(), precision in precision(),
    ) {
        // An output in the middle ends an interval there; steps are of one size on both sides.
        let whole = scene(&[row], &torques, 3.0).pinned(method, 0.03125, Some(precision));
        let cut = whole.clone().outputs(Outputs::Times(vec![1.25, 3.0]));
        let (whole, cut) = (run(&whole), run(&cut));
        prop_assert_eq!(whole.final_state().orientation(0), cut.final_state().orientation(0));
        prop_assert_eq!(whole.final_state().angular_velocity_body(0), cut.final_state().angular_velocity_body(0));
    }

    #[test]
    fn a_plan_for_an_accuracy_and_steps_agree(row in row(), exponent in -9..-3_i32) {
        let target = 10_f64.powi(exponent);
        let planned = run(&scene(&[row], &[], 5.0).accuracy(Accuracy::attitude(target)));
        let (q, _) = stepped(row, &[], Method::Rk8, Precision::F64, 0.01, 5.0);
        // The steps' own error is 1e-13: 500 of (ω dt)⁹, ω dt ≤ 0.04.
        prop_assert!(angle(planned.final_state().orientation(0), q) <= target);
    }
}

proptest! {
    // Each case opens a device.
    #![proptest_config(ProptestConfig { cases: cases(6), ..ProptestConfig::default() })]

    #[test]
    fn both_engines_agree_on_random_ensembles(rows in proptest::collection::vec(row(), 1..80), precision in precision()) {
        let ensemble = Ensemble::from_fn(rows.len(), |body| rows[body]).expect("valid bodies");
        for method in [Method::Rk4, Method::Dlm] {
            let scene = Scene::new(ensemble.clone()).until(1.0).pinned(method, 1.0 / 64.0, Some(precision)).skipping(false);
            let report = verify(&common::gpu(), &scene, &Options::default()).expect("both engines run");
            prop_assert!(report.agrees(), "{method}: {report}");
        }
    }
}

/// Mean and standard deviation.
fn moments_of(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    (mean, (values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / count).sqrt())
}

/// Means and deviations of 200,000 draws are within six of their own standard errors of what the definitions say.
#[test]
fn every_distribution_has_its_mean_and_deviation() {
    const COUNT: usize = 200_000;
    let draw = Draw::new(11);
    let error = (COUNT as f64).sqrt().recip();
    let check = |what: &str, values: &[f64], mean: f64, deviation: f64, kurtosis: f64| {
        let found = moments_of(values);
        assert!((found.0 - mean).abs() < 6.0 * deviation * error, "{what}: mean {}, not {mean}", found.0);
        // The standard error of a deviation is that of the squares over two: σ √(κ − 1)/(2 √n), κ the kurtosis.
        let of_deviation = 0.5 * (kurtosis - 1.0).sqrt() * deviation * error;
        let apart = (found.1 - deviation).abs();
        assert!(apart < 6.0 * of_deviation, "{what}: deviation {}, not {deviation}", found.1);
    };
    let numbers =
        |of: Distribution| -> Vec<f64> { (0..COUNT).map(|body| of.sample(draw, body, Column::Mass, 0)).collect() };
    assert!(numbers(Distribution::Constant(3.5)).iter().all(|&x| x == 3.5));
    check("uniform", &numbers(Distribution::Uniform { low: -1.0, high: 5.0 }), 2.0, 3.0_f64.sqrt(), 1.8);
    check("normal", &numbers(Distribution::Normal { mean: -4.0, sigma: 0.7 }), -4.0, 0.7, 3.0);
    let logarithms: Vec<f64> =
        numbers(Distribution::LogNormal { median: 2.5, sigma: 0.4 }).iter().map(|x| x.ln()).collect();
    check("logarithm of log-normal", &logarithms, 2.5_f64.ln(), 0.4, 3.0);

    // Directions: each component is uniform on (−1, 1); rotations: each component of the quaternion has mean 0 and square ¼, of
    // kurtosis 2, and a rotated axis is a direction.
    let directions: Vec<DVec3> = (0..COUNT).map(|body| draw.direction(body, Column::Position)).collect();
    let rotations: Vec<DQuat> = (0..COUNT).map(|body| draw.rotation(body, Column::Orientation)).collect();
    let turned: Vec<DVec3> = rotations.iter().map(|q| *q * DVec3::new(0.6, 0.0, 0.8)).collect();
    for axis in 0..3 {
        let third = 3.0_f64.sqrt().recip();
        for (what, vectors) in [("direction", &directions), ("turned axis", &turned)] {
            let components: Vec<f64> = vectors.iter().map(|v| v.to_array()[axis]).collect();
            check(what, &components, 0.0, third, 1.8);
            // Of different components the product has mean 0 and variance 1/15.
            let next = |v: &DVec3| v.to_array()[(axis + 1) % 3];
            let products: Vec<f64> = vectors.iter().map(|v| v.to_array()[axis] * next(v)).collect();
            assert!(moments_of(&products).0.abs() < 6.0 * 15.0_f64.sqrt().recip() * error, "{what}: products");
        }
    }
    for component in 0..4 {
        let components: Vec<f64> = rotations.iter().map(|q| q.to_array()[component]).collect();
        check("quaternion", &components, 0.0, 0.5, 2.0);
    }
    let vectors: Vec<DVec3> = (0..COUNT).map(|body| draw.normal_vector(body, Column::Velocity)).collect();
    for axis in 0..3 {
        check("normal vector", &vectors.iter().map(|v| v.to_array()[axis]).collect::<Vec<_>>(), 0.0, 1.0, 3.0);
    }
}
