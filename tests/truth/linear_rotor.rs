//! Linear rotors (principal moments 0, I, I) on both engines, against formulas.
//!
//! The engines integrate one as a body with the moments I, I, I, no spin about its axis and no torque about it. What that must
//! give is worked out here without tensors: the axis n moves as dn/dt = ω × n, and I dω/dt = τ − (τ · n) n with ω ⊥ n.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::{DQuat, DVec3};
use polhode::bodies::inertia::{InertiaTensor, point_masses};
use polhode::engine::batch::{AnyBatch, prepare_with};
use polhode::math::Precision;
use polhode::plan::Treatment;
use polhode::torque::Orbit;
use polhode::{Accuracy, Engine, Ensemble, Error, Method, Outputs, Plan, Record, Scene, Torque};

use crate::common;

use common::{advanced, gpu};

/// What rk4 leaves in f64 with the steps used here, some 1/100 rad each, over some ten radians.
const STEPPED: f64 = 1e-8;

/// The same in f32: rounding of the state, and of the torque's own arithmetic.
const STEPPED_F32: f64 = 5e-6;

/// Rounding of outputs in f64, relative.
const ROUNDING: f64 = 1e-14;

/// Two masses of 1.5 kg and 0.5 kg at a distance of 2 m along `direction`: reduced mass 0.375 kg, I = 1.5 kg m².
fn dumbbell(direction: DVec3) -> InertiaTensor {
    let unit = direction.normalize();
    point_masses(&[(1.5, DVec3::ZERO), (0.5, 2.0 * unit)]).expect("a body").inertia
}

const MOMENT: f64 = 1.5;

/// An axis that is none of the body's.
const AXIS: DVec3 = DVec3::new(0.6, -0.48, 0.64);

fn rotor(orientation: DQuat, omega_body: DVec3) -> Ensemble {
    let across = omega_body - AXIS * AXIS.dot(omega_body);
    Ensemble::from_columns(&[dumbbell(AXIS)], &[orientation], &[across]).expect("a linear rotor")
}

fn tilted() -> DQuat {
    DQuat::from_xyzw(0.1, -0.5, 0.3, 0.8).normalize()
}

fn engines() -> [(Engine, Precision, f64); 4] {
    [
        (Engine::cpu(), Precision::F64, STEPPED),
        (Engine::cpu(), Precision::F32, STEPPED_F32),
        (gpu(), Precision::F64, STEPPED),
        (gpu(), Precision::F32, STEPPED_F32),
    ]
}

fn stepped(engine: &Engine, scene: Scene, precision: Precision) -> Record {
    let scene = scene.skipping(false).pinned(Method::Rk4, 1.0 / 128.0, Some(precision));
    engine.run(&Plan::new(&scene, engine).expect("a plan")).expect("a run")
}

/// The axis and the angular velocity in the world at the end.
fn end_of(record: &Record, body: usize) -> (DVec3, DVec3) {
    let state = record.final_state();
    let q = state.orientation(body);
    (q * AXIS, q * state.angular_velocity_body(body))
}

#[test]
fn a_free_rotor_turns_in_its_plane_at_any_time() {
    let (orientation, omega_body) = (tilted(), DVec3::new(0.7, 0.4, -0.2));
    let ensemble = rotor(orientation, omega_body);
    let omega = orientation * ensemble.angular_velocity_body()[0];
    let axis = orientation * AXIS;
    let expected = |time: f64| {
        let (sin, cos) = (omega.length() * time).sin_cos();
        axis * cos + omega.normalize().cross(axis) * sin
    };
    // In closed form at any time, without a step.
    let engine = Engine::cpu();
    let scene = Scene::new(ensemble.clone()).until(1e4).accuracy(Accuracy::attitude(1e-6));
    let plan = Plan::new(&scene, &engine).expect("a plan");
    assert!(plan.groups().iter().all(|group| group.treatment == Treatment::RegularPrecession));
    let (found, rate) = end_of(&engine.run(&plan).expect("a run"), 0);
    // The rounding of ω is multiplied by the time.
    assert!((found - expected(1e4)).length() < 1e4 * ROUNDING, "{found} {}", expected(1e4));
    assert!((rate - omega).length() < ROUNDING * omega.length(), "{rate} {omega}");
    // Without skipping.
    for (engine, precision, bound) in engines() {
        let record = stepped(&engine, Scene::new(ensemble.clone()).until(10.0), precision);
        let (found, rate) = end_of(&record, 0);
        let name = engine.description().name;
        assert!((found - expected(10.0)).length() < bound, "{name} {precision}: {found} {}", expected(10.0));
        assert!((rate - omega).length() < bound, "{name} {precision}: {rate} {omega}");
        let drift = record.trust().drift;
        assert!(drift.kinetic_energy.max < bound && drift.angular_momentum_world.max < bound, "{drift:?}");
    }
}

/// The complete elliptic integral of the first kind, by the arithmetic-geometric mean (C. F. Gauss).
fn complete_elliptic(modulus: f64) -> f64 {
    let (mut a, mut b) = (1.0, (1.0 - modulus * modulus).sqrt());
    while (a - b) > 1e-15 * a {
        (a, b) = (0.5 * (a + b), (a * b).sqrt());
    }
    FRAC_PI_2 / a
}

/// In the plane of a circular orbit the angle θ from the vertical obeys θ'' = −3 n² sin θ cos θ, whatever I: 2θ is a pendulum.
/// From θ = 0 with θ' = √3 n k it swings to sin θ = k in K(k)/(√3 n).
#[test]
fn a_dumbbell_in_orbit_is_a_pendulum() {
    const SINE: f64 = 0.8;
    let mu = 1.0_f64;
    let orbit_rate = mu.sqrt();
    let start_rate = orbit_rate * (1.0 + 3.0_f64.sqrt() * SINE);
    // The body's axis along the world's x, where the orbit begins; the orbit is in the plane of x and y.
    let orientation = DQuat::from_rotation_arc(AXIS, DVec3::X);
    let omega_body = orientation.conjugate() * (DVec3::Z * start_rate);
    let quarter = complete_elliptic(SINE) / (3.0_f64.sqrt() * orbit_rate);
    for (engine, precision, bound) in engines() {
        for (quarters, angle, rate) in [
            (1.0, SINE.asin(), 0.0),
            (2.0, 0.0, -3.0_f64.sqrt() * SINE),
            (3.0, -SINE.asin(), 0.0),
            (4.0, 0.0, 3.0_f64.sqrt() * SINE),
        ] {
            let end = quarters * quarter;
            let ensemble = rotor(orientation, omega_body);
            let scene = Scene::new(ensemble).until(end).torque(Torque::gravity_gradient(Orbit::circular(mu, 1.0)));
            let (axis, omega) = end_of(&stepped(&engine, scene, precision), 0);
            let vertical = DQuat::from_rotation_z(orbit_rate * end) * DVec3::X;
            let found = vertical.cross(axis).z.atan2(vertical.dot(axis));
            let name = engine.description().name;
            assert!((found - angle).abs() < bound, "{name} {precision} after {quarters} quarters: {found} {angle}");
            assert!((omega.z - orbit_rate * (1.0 + rate)).abs() < 2.0 * bound, "{name} {precision}: {omega} {rate}");
            assert!(axis.z.abs() < bound && omega.truncate().length() < bound, "{name} {precision}: {axis} {omega}");
        }
    }
}

/// dn/dt = ω × n, I dω/dt = τ − (τ · n) n, by the classical Runge-Kutta method in steps of 1/4096.
fn reference(mut axis: DVec3, mut omega: DVec3, torque: impl Fn(DVec3, DVec3) -> DVec3, end: f64) -> (DVec3, DVec3) {
    let slope = |n: DVec3, w: DVec3| {
        let tau = torque(n, w);
        // ω turns with the axis, so that it stays across it: its rate in the world has no other part.
        (w.cross(n), (tau - n * n.dot(tau)) / MOMENT)
    };
    let steps = (end * 4096.0) as u32;
    let h = end / f64::from(steps);
    for _ in 0..steps {
        let (n1, w1) = slope(axis, omega);
        let (n2, w2) = slope(axis + 0.5 * h * n1, omega + 0.5 * h * w1);
        let (n3, w3) = slope(axis + 0.5 * h * n2, omega + 0.5 * h * w2);
        let (n4, w4) = slope(axis + h * n3, omega + h * w3);
        axis += h / 6.0 * (n1 + 2.0 * n2 + 2.0 * n3 + n4);
        omega += h / 6.0 * (w1 + 2.0 * w2 + 2.0 * w3 + w4);
    }
    (axis, omega)
}

#[test]
fn torques_in_the_world_act_across_the_axis_only() {
    let (push, field) = (DVec3::new(0.5, -0.3, 0.8), DVec3::new(0.2, 0.6, -0.4));
    let (orientation, omega_body) = (tilted(), DVec3::new(0.3, -0.8, 0.5));
    let ensemble = rotor(orientation, omega_body);
    let start = (orientation * AXIS, orientation * ensemble.angular_velocity_body()[0]);
    let torque = |_: DVec3, omega: DVec3| push + 0.7 * omega.cross(field).cross(field);
    let (axis, omega) = reference(start.0, start.1, torque, 6.0);
    for (engine, precision, bound) in engines() {
        let scene = Scene::new(ensemble.clone())
            .until(6.0)
            .torque(Torque::constant_world(push))
            .torque(Torque::eddy_current(0.7, field));
        let (found, rate) = end_of(&stepped(&engine, scene, precision), 0);
        let name = engine.description().name;
        assert!((found - axis).length() < bound, "{name} {precision}: {found} {axis}");
        assert!((rate - omega).length() < bound, "{name} {precision}: {rate} {omega}");
    }
}

#[test]
fn a_torque_along_the_axis_has_no_effect() {
    let ensemble = rotor(tilted(), DVec3::new(0.3, -0.8, 0.5));
    let across = AXIS.any_orthogonal_vector();
    for (engine, precision, bound) in engines() {
        let end = |torque: Torque| {
            end_of(&stepped(&engine, Scene::new(ensemble.clone()).until(4.0).torque(torque), precision), 0)
        };
        // A constant torque alone, and one beside a torque whose sum the kernel projects.
        let (plain, with) = (end(Torque::constant_body(across)), end(Torque::constant_body(across + 3.0 * AXIS)));
        assert!((plain.0 - with.0).length() + (plain.1 - with.1).length() < bound, "{plain:?} {with:?}");
        let zero = DVec3::ZERO;
        let (plain, with) =
            (end(Torque::sinusoidal(across, zero, 2.0)), end(Torque::sinusoidal(across + 3.0 * AXIS, zero, 2.0)));
        assert!((plain.0 - with.0).length() + (plain.1 - with.1).length() < bound, "{plain:?} {with:?}");
    }
}

#[test]
fn no_method_gives_a_rotor_spin() {
    // `dlm` turns about one axis after another, and its error has a part along the axis; what it keeps of spin
    // is of the order of that error, and is left out of outputs.
    const DLM: f64 = 1e-3;
    let ensemble = rotor(tilted(), DVec3::new(0.3, -0.8, 0.5));
    let torques = [Torque::constant_world(DVec3::new(0.5, -0.3, 0.8)), Torque::linear_drag(0.05)];
    for engine in [Engine::cpu(), gpu()] {
        for method in Method::ALL {
            let (_, batch) = prepare_with(&ensemble, &torques, 1.0, Precision::F64).expect("a batch");
            let words = advanced(&engine, &batch, method, 1.0 / 64.0, 64);
            let [.., x, y, z] = words.combined(0);
            let bound = if method == Method::Dlm { DLM } else { ROUNDING };
            assert!(x.abs() <= bound * y.hypot(z), "{} {method}: {x:e} of {y} {z}", engine.description().name);
        }
    }
}

#[test]
fn outputs_have_the_rotors_own_energy_and_momentum() {
    let ensemble = rotor(tilted(), DVec3::new(0.3, -0.8, 0.5));
    let (omega, tensor) = (ensemble.angular_velocity_body()[0], ensemble.inertia()[0]);
    let (frames, batch) = prepare_with(&ensemble, &[], 0.0, Precision::F64).expect("a batch");
    let AnyBatch::F64(batch) = batch else { panic!("f64") };
    let state = frames[0].body_state(batch.read(0..1).combined(0));
    let momentum = ensemble.orientation()[0] * (tensor * omega);
    assert!((state.angular_momentum_world - momentum).length() < ROUNDING * momentum.length());
    assert!((state.kinetic_energy - 0.5 * omega.dot(tensor * omega)).abs() < ROUNDING);
    assert!((state.angular_velocity_body - omega).length() < ROUNDING);
    assert!(state.angular_velocity_body.dot(AXIS).abs() < ROUNDING);
}

#[test]
fn a_rotor_leaves_its_neighbours_alone() {
    let moments = DVec3::new(1.0, 1.7, 2.4);
    let (q, omega) = (tilted(), DVec3::new(0.3, -0.8, 0.5));
    let other = (InertiaTensor::from(moments), q, omega);
    let line = (dumbbell(AXIS), q, omega - AXIS * AXIS.dot(omega));
    for (engine, precision, _) in engines() {
        let run = |bodies: &[(InertiaTensor, DQuat, DVec3)]| {
            let ensemble = Ensemble::from_fn(bodies.len(), |body| bodies[body]).expect("bodies");
            let scene = Scene::new(ensemble)
                .until(3.0)
                .outputs(Outputs::End)
                .torque(Torque::constant_world(DVec3::new(0.1, 0.2, 0.3)))
                .torque(Torque::constant_body(DVec3::new(0.3, 0.1, 0.2)));
            stepped(&engine, scene, precision)
        };
        let (together, alone) = (run(&[line, other]), run(&[other]));
        assert_eq!(together.final_state().orientation(1), alone.final_state().orientation(0));
        let rotor_alone = run(&[line]);
        assert_eq!(together.final_state().orientation(0), rotor_alone.final_state().orientation(0));
    }
}

#[test]
fn spin_about_the_axis_is_refused_and_rounding_taken_off() {
    let of_spin = |omega: DVec3| Ensemble::from_columns(&[dumbbell(AXIS)], &[DQuat::IDENTITY], &[omega]);
    let across = AXIS.any_orthonormal_vector();
    let ensemble = of_spin(across + 1e-13 * AXIS).expect("rounding");
    assert!(ensemble.angular_velocity_body()[0].dot(AXIS).abs() < 1e-15);
    assert!(of_spin(DVec3::ZERO).is_ok());
    let error = of_spin(across + 1e-6 * AXIS).expect_err("spin");
    assert!(matches!(error, Error::Body { body: 0, field: "angular velocity along the axis", .. }), "{error}");
    assert!(error.to_string().contains("a linear rotor"), "{error}");
    // One moment that vanishes beside two that differ is no body at all; no moment at all is a point.
    let of_moments = |moments: DVec3| Ensemble::from_columns(&[moments], &[DQuat::IDENTITY], &[DVec3::ZERO]);
    assert!(of_moments(DVec3::new(0.0, 1.0, 1.1)).is_err());
    assert!(of_moments(DVec3::ZERO).is_err());
}

/// Nitrogen: 1e-46 kg m² at 1e12 rad/s, a thousand turns.
#[test]
fn molecules_keep_their_digits() {
    let ensemble = Ensemble::from_columns(
        &[DVec3::new(1.4e-46, 1.4e-46, 0.0)],
        &[DQuat::IDENTITY],
        &[DVec3::new(3e12, 4e12, 0.0)],
    )
    .expect("a molecule");
    let period = TAU / 5e12;
    for (engine, precision) in [(Engine::cpu(), Precision::F32), (gpu(), Precision::F32), (gpu(), Precision::F64)] {
        let scene = Scene::new(ensemble.clone()).until(1000.25 * period).precision(Some(precision));
        let scene = scene.accuracy(Accuracy::attitude(1e-3));
        let record = engine.run(&Plan::new(&scene, &engine).expect("a plan")).expect("a run");
        let axis = record.final_state().orientation(0) * DVec3::Z;
        // A quarter of a turn about (0.6, 0.8, 0).
        assert!((axis - DVec3::new(0.8, -0.6, 0.0)).length() < 1e-9, "{axis}");
    }
}
