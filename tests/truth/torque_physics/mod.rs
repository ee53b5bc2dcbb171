//! Motions under torques against closed forms and conservation.

mod dipole;
mod drift;

use std::f64::consts::TAU;

use crate::support::attitude_error;

use glam::{DMat3, DQuat, DVec3};
use polhode::engine::cpu::Cpu;
use polhode::math::Precision;
use polhode::math::Width;
use polhode::scene::AdaptiveSteps;
use polhode::torque::{Orbit, Parameters};
use polhode::{Engine, Ensemble, Error, Method, Outputs, Plan, Record, Scene, Torque};

/// rk4 with this angle a step is wrong by about 1e-10 over the spans here.
const FINE: f64 = 1.0 / 256.0;

/// What rk4 leaves at [`FINE`], with a margin.
const TRUNCATION: f64 = 2e-9;

/// One row of an ensemble.
type Row = (DVec3, DQuat, DVec3);

fn run(rows: &[Row], torques: &[Torque], times: &[f64], dt: f64, precision: Precision) -> Record {
    let ensemble = Ensemble::from_fn(rows.len(), |body| rows[body]).expect("valid bodies");
    let end = times[times.len() - 1];
    let scene = Scene::new(ensemble).until(end).outputs(Outputs::Times(times.to_vec())).pinned(
        Method::Rk4,
        dt,
        Some(precision),
    );
    let scene = torques.iter().fold(scene, |scene, torque| scene.torque(torque.clone()));
    let engine = Cpu::new(Width::Lanes);
    let plan = Plan::new(&scene, &engine).expect("a valid plan");
    polhode::run::run(&engine, &plan).expect("a run")
}

fn run_f64(rows: &[Row], torques: &[Torque], times: &[f64], dt: f64) -> Record {
    run(rows, torques, times, dt, Precision::F64)
}

/// Equally spaced times from `end`/`count` to `end`.
fn times(end: f64, count: usize) -> Vec<f64> {
    (1..=count).map(|n| end * n as f64 / count as f64).collect()
}

const GRAVITY: DVec3 = DVec3::new(0.0, 0.0, -9.8125);

/// Lagrange's top: moments about the pivot, mass, distance of the centre of mass.
const TOP: DVec3 = DVec3::new(1.0, 1.0, 0.5);
const TOP_MASS: f64 = 0.5;
const TOP_LENGTH: f64 = 0.25;

fn top_torque() -> Torque {
    Torque::heavy_top(TOP_MASS, DVec3::new(0.0, 0.0, TOP_LENGTH), GRAVITY)
}

/// M g l.
fn top_weight() -> f64 {
    TOP_MASS * TOP_LENGTH * -GRAVITY.z
}

/// The angle of a top's axis from the vertical.
fn tilt(q: DQuat) -> f64 {
    let axis = q * DVec3::Z;
    axis.truncate().length().atan2(axis.z)
}

#[test]
fn a_sleeping_top_is_stable_above_the_critical_spin_and_falls_below_it_at_the_rate_of_linear_theory() {
    // F. Klein, A. Sommerfeld: w_c = 2 √(M g l I₁) / I₃; below it a small tilt grows as cosh λt with
    // λ² = M g l/I₁ − (I₃ w/2 I₁)², above it the axis swings with the frequency of −λ².
    let critical = 2.0 * (top_weight() * TOP.x).sqrt() / TOP.z;
    let start_tilt = 1e-6;
    let start = |factor: f64| (TOP, DQuat::from_rotation_x(start_tilt), DVec3::new(0.0, 0.0, factor * critical));
    let lambda_squared = |factor: f64| {
        let half = TOP.z * factor * critical / (2.0 * TOP.x);
        top_weight() / TOP.x - half * half
    };

    let end = 20.0;
    let stable = run_f64(&[start(1.05)], &[top_torque()], &times(end, 400), FINE / critical);
    let swing = (-lambda_squared(1.05)).sqrt();
    for snapshot in stable.snapshots() {
        // In the frame that precesses at half I₃w/I₁ the tilt is a linear oscillator, started turning against the frame.
        let half = TOP.z * 1.05 * critical / (2.0 * TOP.x);
        let (sin, cos) = (swing * snapshot.time()).sin_cos();
        let expected = start_tilt * (cos * cos + (half / swing * sin).powi(2)).sqrt();
        let found = tilt(snapshot.orientation(0));
        assert!((found - expected).abs() < 1e-4 * start_tilt, "t = {}: {found:e}, {expected:e}", snapshot.time());
    }

    let unstable = run_f64(&[start(0.9)], &[top_torque()], &times(end, 40), FINE / critical);
    let growth = lambda_squared(0.9).sqrt();
    for snapshot in unstable.snapshots() {
        let half = TOP.z * 0.9 * critical / (2.0 * TOP.x);
        let (sinh, cosh) = ((growth * snapshot.time()).sinh(), (growth * snapshot.time()).cosh());
        let expected = start_tilt * (cosh * cosh + (half / growth * sinh).powi(2)).sqrt();
        let found = tilt(snapshot.orientation(0));
        // Linear theory holds while the tilt is small; its error is of the order of the tilt's square.
        if expected < 1e-2 {
            let bound = 1e-4 + expected * expected;
            assert!((found / expected - 1.0).abs() < bound, "t = {}: {found:e}, {expected:e}", snapshot.time());
        }
    }
    assert!(growth * end > 5.0, "the spin is not far enough below the critical one");
}

#[test]
fn a_heavy_symmetric_top_precesses_steadily_at_both_rates() {
    // I₁ Ω² cos θ − I₃ w Ω + M g l = 0 (Lagrange; L. D. Landau, E. M. Lifshitz, Mechanics, § 35).
    let (theta, spin) = (0.7_f64, 12.0);
    let discriminant = ((TOP.z * spin).powi(2) - 4.0 * TOP.x * theta.cos() * top_weight()).sqrt();
    for sign in [-1.0, 1.0] {
        let precession = (TOP.z * spin + sign * discriminant) / (2.0 * TOP.x * theta.cos());
        let orientation = DQuat::from_rotation_x(theta);
        let axis_world = orientation * DVec3::Z;
        // ω = Ω z + (w − Ω cos θ) e₃.
        let omega_world = DVec3::Z * precession + axis_world * (spin - precession * theta.cos());
        let row = (TOP, orientation, orientation.inverse() * omega_world);
        let record = run_f64(&[row], &[top_torque()], &times(10.0, 20), FINE / spin);
        for snapshot in record.snapshots() {
            let axis = snapshot.orientation(0) * DVec3::Z;
            let expected = DQuat::from_rotation_z(precession * snapshot.time()) * axis_world;
            let error = axis.cross(expected).length().atan2(axis.dot(expected));
            assert!(error < 1e-7, "Ω = {precession}, t = {}: the axis is off by {error:e}", snapshot.time());
        }
    }
}

#[test]
fn a_gravity_gradient_satellite_librates_at_the_frequency_of_linear_theory() {
    // P. C. Hughes, Spacecraft Attitude Dynamics, 9.2: pitch n √(3 (I_roll − I_yaw)/I_pitch).
    let (yaw, pitch, roll) = (1.0_f64, 3.0_f64, 2.5_f64);
    let orbit = Orbit::circular(4.0, 2.0);
    let n = (4.0_f64 / 8.0).sqrt();
    let frequency = n * (3.0 * (roll - yaw) / pitch).sqrt();
    let amplitude = 1e-4;
    // Body x towards the centre's far side (yaw), y along the motion (roll), z along the orbit's normal (pitch).
    let row = (DVec3::new(yaw, roll, pitch), DQuat::from_rotation_z(amplitude), DVec3::new(0.0, 0.0, n));
    let record = run_f64(&[row], &[Torque::gravity_gradient(orbit)], &times(3.0 * TAU / frequency, 60), 0.005);
    for snapshot in record.snapshots() {
        let relative = DQuat::from_rotation_z(-n * snapshot.time()) * snapshot.orientation(0);
        let relative = if relative.w < 0.0 { -relative } else { relative };
        let expected = amplitude * (frequency * snapshot.time()).cos();
        let found = 2.0 * relative.z;
        // Of a pendulum the frequency falls by a sixteenth of the amplitude's square: 1e-9 over the three periods.
        assert!((found - expected).abs() < 1e-7 * amplitude + TRUNCATION * 1e-2, "{found:e}, {expected:e}");
    }
}

#[test]
fn a_kepler_orbit_without_eccentricity_gives_the_circular_torque() {
    let row = (DVec3::new(1.0, 1.25, 1.5), DQuat::from_xyzw(0.1, 0.2, 0.3, 0.9), DVec3::new(0.3, -0.2, 0.5));
    let circular = Orbit::circular(1.0, 1.0).inclined(0.4).with_ascending_node(1.0).with_mean_anomaly(2.5);
    let mut kepler = circular.clone();
    // A column with a body that is eccentric makes all bodies go through Kepler's equation.
    kepler.eccentricity = vec![0.0, 0.5].into();
    let expected = run_f64(&[row], &[Torque::gravity_gradient(circular)], &[10.0], 0.01);
    let found = run_f64(&[row, row], &[Torque::gravity_gradient(kepler)], &[10.0], 0.01);
    let angle =
        |body: usize| attitude_error(found.final_state().orientation(body), expected.final_state().orientation(0));
    assert!(angle(0) < 1e-12, "{:e}", angle(0));
    let eccentric = angle(1);
    assert!(eccentric > 0.01, "the eccentricity has no effect: {eccentric:e}");
}

/// An orbit in any plane, from any pericentre, is the one in the world's plane with the world turned about z by the argument of the
/// pericentre, about x by the inclination and about z by the node; golden data hold that one (tests/truth/golden_forced).
#[test]
fn the_gravity_gradient_in_any_orbital_plane_is_that_in_the_worlds_turned() {
    let (inclination, node, pericentre) = (0.7, 1.1, -0.4);
    let turn = DQuat::from_rotation_z(node) * DQuat::from_rotation_x(inclination) * DQuat::from_rotation_z(pericentre);
    let (moments, spin) = (DVec3::new(1.0, 1.5, 2.25), DVec3::new(0.3, -0.2, 0.5));
    let orientation = DQuat::from_xyzw(0.1, 0.2, 0.3, 0.9).normalize();
    let outputs = times(10.0, 5);
    for eccentricity in [0.0, 0.125] {
        let plain = Orbit::kepler(1.0, 1.0, eccentricity).with_mean_anomaly(0.6);
        let tilted = plain.clone().inclined(inclination).with_ascending_node(node).with_pericentre(pericentre);
        let run = |orbit: Orbit, orientation: DQuat| {
            run_f64(&[(moments, orientation, spin)], &[Torque::gravity_gradient(orbit)], &outputs, FINE)
        };
        let (expected, found) = (run(plain.clone(), orientation), run(tilted, turn * orientation));
        for (expected, found) in expected.snapshots().iter().zip(found.snapshots()) {
            let relative = found.orientation(0).conjugate() * (turn * expected.orientation(0));
            let angle = 2.0 * relative.xyz().length();
            // Quaternions of rk4's stages are no unit ones, and what a torque makes of their length depends on the world's axes.
            assert!(angle < TRUNCATION, "e = {eccentricity}, t = {}: {angle:e}", found.time());
        }
        // The plane matters.
        let elsewhere = run(plain, turn * orientation);
        let relative = elsewhere.final_state().orientation(0).conjugate() * found.final_state().orientation(0);
        assert!(relative.xyz().length() > 0.1, "{relative}");
    }
}

#[test]
fn a_sphere_spins_down_as_each_drag_says() {
    let (moment, spin, time) = (2.0, 3.0, 5.0);
    let row = (DVec3::splat(moment), DQuat::IDENTITY, DVec3::new(0.0, 0.0, spin));
    let spin_after =
        |torque: Torque| run_f64(&[row], &[torque], &[time], 0.01).final_state().angular_velocity_body(0).z;
    let linear = spin_after(Torque::linear_drag(0.3));
    assert!((linear - spin * (-0.3 * time / moment).exp()).abs() < TRUNCATION, "{linear}");
    let matrix = spin_after(Torque::matrix_drag(DMat3::from_diagonal(DVec3::new(9.0, 1.0, 0.3))));
    assert!((matrix - linear).abs() < 1e-14, "{matrix}");
    let quadratic = spin_after(Torque::quadratic_drag(0.2));
    assert!((quadratic - spin / (1.0 + 0.2 * spin * time / moment)).abs() < TRUNCATION, "{quadratic}");
    // Across the field the spin decays, along it it stays.
    let across = spin_after(Torque::eddy_current(0.5, DVec3::new(0.8, 0.0, 0.0)));
    assert!((across - spin * (-0.5 * 0.64 * time / moment).exp()).abs() < TRUNCATION, "{across}");
    assert_eq!(spin_after(Torque::eddy_current(0.5, DVec3::new(0.0, 0.0, 0.8))), spin);
}

/// Of an axisymmetric body, dm/dt = m × ω + k m × (m × ω) leaves |m| alone and turns the nutation angle θ as dθ/dt = k |m|² (1/I₃ − 1/I₁)
/// sin θ cos θ: tan θ = tan θ₀ exp(k |m|² (1/I₃ − 1/I₁) t) in closed form.
#[test]
fn internal_dissipation_turns_the_nutation_angle_as_the_closed_form_says() {
    for (across, along, k) in [(2.0, 1.0, 0.02), (1.0, 1.6, 0.05)] {
        let moments = DVec3::new(across, across, along);
        let start = DVec3::new(0.3, 0.1, 1.1);
        let row = (moments, DQuat::from_xyzw(0.3, -0.1, 0.2, 0.9).normalize(), start);
        let (end, outputs) = (20.0, 20);
        let record = run_f64(&[row], &[Torque::internal_dissipation(k)], &times(end, outputs), FINE);
        let momentum = moments * start;
        let growth = k * momentum.length_squared() * (1.0 / along - 1.0 / across);
        let tangent = momentum.truncate().length() / momentum.z;
        for snapshot in record.snapshots() {
            let omega = snapshot.angular_velocity_body(0);
            let m = moments * omega;
            let expected = tangent * (growth * snapshot.time()).exp();
            let found = m.truncate().length() / m.z;
            assert!((found / expected - 1.0).abs() < 1e-8, "t = {}: {found}, not {expected}", snapshot.time());
            // 2 T = |m|² (sin²θ/I₁ + cos²θ/I₃), |m| being conserved.
            let cos_squared = (1.0 + expected * expected).recip();
            let inverse_moment = (1.0 - cos_squared) / across + cos_squared / along;
            let (energy, known) = (omega.dot(m), momentum.length_squared() * inverse_moment);
            assert!((energy / known - 1.0).abs() < 1e-8, "t = {}: 2 T = {energy}, not {known}", snapshot.time());
        }
        assert!((growth * end).abs() > 0.3, "hardly any nutation: {growth}");
    }
}

/// Other torques read ω = I⁻¹ m, and m itself, though the axes turn at ω + k m × ω: against a fourth-order integration of these equations.
#[test]
fn beside_internal_dissipation_torques_read_the_velocity_that_is_reported() {
    const END: f64 = 3.0;
    let (moments, start, k, c) = (DVec3::new(1.0, 2.0, 3.0), DVec3::new(0.5, 1.0, 0.2), 0.2, 0.1);
    let of_momentum = |text: &str| Torque::custom(text, Parameters::new()).expect("a formula");
    type OfMotion = fn(DVec3, DVec3) -> DVec3;
    let cases: [(&str, Torque, OfMotion); 3] = [
        ("drag", Torque::linear_drag(c), |_, omega| -0.1 * omega),
        ("its formula", of_momentum("-0.1 * angular_velocity"), |_, omega| -0.1 * omega),
        ("of m", of_momentum("-0.1 * angular_momentum"), |m, _| -0.1 * m),
    ];
    for (name, torque, formula) in cases {
        let rate = |m: DVec3| {
            let omega = m / moments;
            m.cross(omega + k * m.cross(omega)) + formula(m, omega)
        };
        let (mut m, steps) = (moments * start, 3000);
        let h = END / f64::from(steps);
        for _ in 0..steps {
            let k1 = rate(m);
            let k2 = rate(m + 0.5 * h * k1);
            let k3 = rate(m + 0.5 * h * k2);
            let k4 = rate(m + h * k3);
            m += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
        }
        let expected = m / moments;
        let body = Ensemble::from_columns(&[moments], &[DQuat::IDENTITY], &[start]).expect("a body");
        let scene = Scene::new(body).torque(Torque::internal_dissipation(k)).torque(torque).until(END);
        let steps = AdaptiveSteps { tolerance: 1e-12, least_step: None };
        let mut compared = 0;
        for engine in [Engine::cpu(), Engine::cpu_scalar(), crate::common::gpu()] {
            for scene in [
                scene.clone().pinned(Method::Rk8, 0.01, Some(Precision::F64)),
                scene.clone().pinned(Method::Cf4, 0.002, Some(Precision::F64)),
                scene.clone().adaptive(steps, Some(Precision::F64)),
                scene.clone().taylor(steps),
            ] {
                // Series are formed on the CPU.
                let Ok(plan) = Plan::new(&scene, &engine) else { continue };
                let record = engine.run(&plan).expect("a run");
                let found = record.final_state().angular_velocity_body(0);
                let error = (found - expected).length();
                assert!(error < 1e-10, "{name}, {:?}: {found}, not {expected}: {error:e}", plan.method());
                compared += 1;
            }
        }
        assert_eq!(compared, 11, "{name}");
    }
}

#[test]
fn internal_dissipation_ends_in_rotation_about_the_axis_of_greatest_moment_at_the_same_angular_momentum() {
    let moments = DVec3::new(1.0, 2.0, 2.5);
    let row = (moments, DQuat::from_xyzw(0.3, -0.1, 0.2, 0.9).normalize(), DVec3::new(2.0, 0.5, 0.1));
    let record = run_f64(&[row], &[Torque::internal_dissipation(0.05)], &times(200.0, 50), 1.0 / 512.0);
    let inertia = DMat3::from_diagonal(moments);
    let start = row.1 * (inertia * row.2);
    let mut energy = f64::INFINITY;
    for snapshot in record.snapshots() {
        let omega = snapshot.angular_velocity_body(0);
        let momentum = snapshot.orientation(0) * (inertia * omega);
        // 1e5 steps: rounding is a random walk of u √n, 5e-14; rk4's own drift is (ω dt)⁵ n/120, 1e-11 at most.
        assert!((momentum - start).length() < 1e-11 * start.length(), "t = {}: {momentum}", snapshot.time());
        let next = 0.5 * omega.dot(inertia * omega);
        assert!(next <= energy * (1.0 + 1e-13), "t = {}: the energy rises from {energy} to {next}", snapshot.time());
        energy = next;
    }
    let omega = record.final_state().angular_velocity_body(0);
    let least = start.length_squared() / (2.0 * moments.z);
    assert!((energy / least - 1.0).abs() < 1e-9, "energy {energy}, least {least}");
    assert!(omega.truncate().length() < 1e-4 * omega.z.abs(), "{omega}");
}

#[test]
fn conservative_torques_keep_kinetic_and_potential_energy_together() {
    let moments = DVec3::new(1.0, 2.0, 2.5);
    let orientation = DQuat::from_xyzw(0.3, -0.1, 0.2, 0.9).normalize();
    let row = (moments, orientation, DVec3::new(0.5, 0.8, -0.3));
    let target = DQuat::from_xyzw(0.1, 0.3, -0.2, 0.8);
    for torque in [
        Torque::heavy_top(1.5, DVec3::new(0.1, -0.2, 0.3), DVec3::new(1.0, 2.0, -3.0)),
        Torque::magnetic_dipole(DVec3::new(0.4, 0.2, -0.7), DVec3::new(0.5, 1.0, 0.2)),
        Torque::sine_spring(1.7, target),
        Torque::log_spring(0.9, target),
    ] {
        let record = run_f64(&[row], std::slice::from_ref(&torque), &times(10.0, 50), 1.0 / 256.0);
        let energy = |q: DQuat, omega: DVec3| {
            0.5 * omega.dot(moments * omega) + torque.potential_energy(0, q).expect("a potential")
        };
        let start = energy(row.1, row.2);
        for snapshot in record.snapshots() {
            let change = energy(snapshot.orientation(0), snapshot.angular_velocity_body(0)) - start;
            assert!(change.abs() < TRUNCATION, "{}, t = {}: {change:e}", torque.name(), snapshot.time());
        }
        assert!(!torque.dissipative());
    }
}

#[test]
fn a_body_at_rest_is_spun_up_alike_in_all_units() {
    // Moments of molecules and of planets: torques in proportion, over a time in proportion to √(I/τ).
    let (moment_factors, rate_factors) = ([1e-46_f64, 1.0, 1e38], [1e-9_f64, 1.0, 1e12]);
    for precision in Precision::ALL {
        let mut reference: Option<(DQuat, DVec3)> = None;
        for (moment, rate) in moment_factors.into_iter().flat_map(|m| rate_factors.map(|r| (m, r))) {
            let row = (DVec3::new(1.0, 2.0, 2.5) * moment, DQuat::IDENTITY, DVec3::ZERO);
            let torque = Torque::constant_body(DVec3::new(0.3, 0.4, -0.2) * (moment * rate * rate));
            let drag = Torque::linear_drag(0.1 * moment * rate);
            let record = run(&[row], &[torque, drag], &[8.0 / rate], 1.0 / 256.0 / rate, precision);
            let state = (record.final_state().orientation(0), record.final_state().angular_velocity_body(0) / rate);
            let (q, omega) = *reference.get_or_insert(state);
            // Numbers that are not powers of two are rounded differently in each unit.
            let bound: f64 = if precision == Precision::F32 { 3e-6 } else { 1e-13 };
            // Not by the arc cosine, which knows no angle between 0 and 2e-8.
            let between = state.0.conjugate() * q;
            let angle = 2.0 * between.xyz().length().atan2(between.w.abs());
            assert!(angle < bound, "{precision} {moment:e} {rate:e}: {angle:e}");
            assert!((state.1 - omega).length() < bound, "{precision} {moment:e} {rate:e}: {}", state.1 - omega);
            assert!(omega.length() > 0.5, "{omega}");
        }
    }
}

#[test]
fn instances_of_a_model_add_up_and_per_body_parameters_reach_their_bodies() {
    let row =
        (DVec3::new(1.0, 2.0, 2.5), DQuat::from_xyzw(0.3, -0.1, 0.2, 0.9).normalize(), DVec3::new(0.5, 0.8, -0.3));
    let state = |record: &Record, body: usize| {
        (record.final_state().orientation(body), record.final_state().angular_velocity_body(body))
    };
    let top = |mass: f64| Torque::heavy_top(mass, DVec3::new(0.1, -0.2, 0.3), DVec3::new(1.0, 2.0, -3.0));
    let single = run_f64(&[row], &[top(1.5), Torque::linear_drag(0.25)], &[5.0], 0.01);
    let halves = [top(0.5), Torque::linear_drag(0.125), top(1.0), Torque::linear_drag(0.125)];
    let two = run_f64(&[row], &halves, &[5.0], 0.01);
    let columns = [
        Torque::heavy_top(vec![0.0, 1.5, 3.0], DVec3::new(0.1, -0.2, 0.3), DVec3::new(1.0, 2.0, -3.0)),
        Torque::linear_drag(vec![1.0, 0.25, 0.0]),
    ];
    let among = run_f64(&[row, row, row], &columns, &[5.0], 0.01);
    let (q, omega) = state(&single, 0);
    for (what, (found_q, found_omega)) in [("two instances", state(&two, 0)), ("a column", state(&among, 1))] {
        assert!((found_omega - omega).length() < 1e-13, "{what}: {found_omega}, {omega}");
        assert!((found_q - q).length().min((found_q + q).length()) < 1e-13, "{what}: {found_q}, {q}");
    }
    assert!((state(&among, 0).1 - omega).length() > 0.1);
}

#[test]
fn time_is_exact_after_a_million_steps_of_a_tenth() {
    // A sphere under a torque with a period of 8 s, 80 steps. A running sum of f32 tenths is off by 958 s after a million of
    // them; the product n · dt in f32 by up to 4e-3 s.
    let row = (DVec3::splat(1.0), DQuat::IDENTITY, DVec3::ZERO);
    let rate = TAU / 8.0;
    let torque = Torque::sinusoidal(DVec3::ZERO, DVec3::new(0.0, 0.0, 1.0), rate);
    let dt = 0.1;
    let (whole, quarter) = (100_000.0, 100_002.0);
    for precision in Precision::ALL {
        let record = run(&[row], std::slice::from_ref(&torque), &[whole, quarter], dt, precision);
        let found = [0, 1].map(|output| record.snapshots()[output].angular_velocity_body(0).z);
        // ω = sin Ωt / Ω. TAU/8 in f64 puts the phase off by 1e-11 rad by then; rk4's error is (Ω dt)⁴/2880 of the
        // amplitude, 1e-8. The torques of one period are those of the next but for 1e-15, so that their roundings do not
        // average out: 6e-8 of dt each.
        let steps = whole / dt;
        let bound = if precision == Precision::F32 { steps * 6e-8 * dt } else { 1e-7 };
        assert!(found[0].abs() < bound, "{precision}: {found:?}");
        assert!((found[1] - 1.0 / rate).abs() < bound, "{precision}: {found:?}");
        // A quarter of a period after the end of the first interval the roundings so far are the same in both.
        let change = found[1] - found[0];
        let bound = if precision == Precision::F32 { 2e-6 } else { 1e-7 };
        assert!((change - 1.0 / rate).abs() < bound, "{precision}: {change}");
    }
}

/// Paths of one body each under white noise, at the end of a second of steps of 1/`steps` s.
fn noisy_paths(count: usize, steps: u16, finest: u16) -> Record {
    let row = (DVec3::new(1.0, 2.0, 2.5), DQuat::IDENTITY, DVec3::new(0.5, 0.8, -0.3));
    let noise = Torque::white_noise_of_draws(0.8, 11, finest / steps);
    run_f64(&vec![row; count], &[noise], &[1.0], 1.0 / f64::from(steps))
}

#[test]
fn white_noise_converges_strongly_with_order_one() {
    let (count, finest) = (256, 1024);
    let reference = noisy_paths(count, finest, finest);
    let mut points = Vec::new();
    for steps in [8, 16, 32, 64, 128] {
        let record = noisy_paths(count, steps, finest);
        let squares: f64 = (0..count)
            .map(|body| {
                let angle = 2.0
                    * (record.final_state().orientation(body).conjugate() * reference.final_state().orientation(body))
                        .xyz()
                        .length();
                angle * angle
            })
            .sum();
        points.push((f64::from(steps).log2(), (squares / count as f64).sqrt().log2()));
    }
    let mean = |f: &dyn Fn(&(f64, f64)) -> f64| points.iter().map(f).sum::<f64>() / points.len() as f64;
    let (x, y) = (mean(&|p| p.0), mean(&|p| p.1));
    let slope = mean(&|p| (p.0 - x) * (p.1 - y)) / mean(&|p| (p.0 - x).powi(2));
    // 256 paths: the root mean square is known to 5 %, the slope over four halvings to about 0.03.
    assert!((slope + 1.0).abs() < 0.1, "order {}, errors {points:?}", -slope);
}

#[test]
fn white_noise_has_the_variance_of_a_wiener_process_and_is_reproducible() {
    let (count, intensity, time) = (4096, 0.3, 2.0);
    // A sphere: m = σ W.
    let row = (DVec3::splat(1.0), DQuat::IDENTITY, DVec3::ZERO);
    let paths = |seed: u64, count: usize, times: &[f64]| {
        run_f64(&vec![row; count], &[Torque::white_noise(intensity, seed)], times, 1.0 / 32.0)
    };
    let record = paths(5, count, &[time]);
    let squares: f64 = (0..count).map(|body| record.final_state().angular_velocity_body(body).length_squared()).sum();
    let variance = squares / (3 * count) as f64;
    let expected = intensity * intensity * time;
    // Five standard errors, √(2/n) each.
    let error = 5.0 * (2.0 / (3 * count) as f64).sqrt();
    assert!((variance / expected - 1.0).abs() < error, "variance {variance}, {expected} expected");

    // Neither other bodies nor output times change a path; another seed does.
    let fewer = paths(5, 100, &[0.5, 1.0, time]);
    assert_eq!(fewer.final_state().angular_velocities_body(), &record.final_state().angular_velocities_body()[..100]);
    assert_ne!(
        paths(6, 1, &[time]).final_state().angular_velocity_body(0),
        record.final_state().angular_velocity_body(0)
    );
}

#[test]
fn parameters_that_are_not_valid_are_refused_with_their_place() {
    let row = (DVec3::new(1.0, 2.0, 2.5), DQuat::IDENTITY, DVec3::ZERO);
    let refusal = |torque: Torque| {
        let ensemble = Ensemble::from_fn(3, |_| row).expect("valid");
        let scene = Scene::new(ensemble).until(1.0).torque(Torque::linear_drag(0.1)).torque(torque);
        Plan::new(&scene, &Cpu::new(Width::Lanes)).expect_err("not valid")
    };
    let error = refusal(Torque::linear_drag(vec![0.1, -0.2, 0.3]));
    assert_eq!(
        error.to_string(),
        "torque 2 (linear-drag), body 1: coefficient = -0.2: expected a finite number that is not negative (N m s)"
    );
    assert!(matches!(refusal(Torque::linear_drag(vec![0.1])), Error::ColumnLength { found: 1, expected: 3, .. }));
    for torque in [
        Torque::constant_body(DVec3::new(0.0, f64::NAN, 0.0)),
        Torque::matrix_drag(DMat3::from_diagonal(DVec3::new(1.0, -1.0, 1.0))),
        Torque::matrix_drag(DMat3::from_cols(DVec3::X, DVec3::new(0.5, 1.0, 0.0), DVec3::Z)),
        Torque::gravity_gradient(Orbit::circular(1.0, -1.0)),
        Torque::gravity_gradient(Orbit::kepler(1.0, 1.0, 1.0)),
        Torque::sine_spring(1.0, DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0)),
        Torque::heavy_top(-1.0, DVec3::Z, DVec3::Z),
        Torque::white_noise_of_draws(1.0, 0, 0),
    ] {
        let name = torque.name().to_owned();
        assert!(matches!(refusal(torque), Error::Torque { torque: 1, model, .. } if model == name), "{name}");
    }
}
