//! Bodies on orbits that drift about an oblate centre, against equations of motion written out in inertial axes.

use glam::{DMat3, DQuat, DVec3};
use polhode::math::Precision;
use polhode::scene::AdaptiveSteps;
use polhode::torque::Orbit;
use polhode::{Engine, Ensemble, Plan, Scene, Torque};

use super::dipole::{integrated, place_on_orbit};
use super::{FINE, TRUNCATION, run_f64, times};

const MOMENTS: DVec3 = DVec3::new(1.0, 2.0, 2.5);
const START: DVec3 = DVec3::new(0.5, 0.8, -0.3);
const J2: f64 = 0.4;
const RADIUS: f64 = 1.0;
const AXIS: f64 = 1.25;
const SPAN: f64 = 12.0;
const OUTPUTS: usize = 24;

/// Eccentricity, inclination and whether the orbit drifts: each body has its own rates.
const BODIES: [(f64, f64, f64); 3] = [(0.3, 0.7, J2), (0.0, 2.0, J2), (0.3, 0.7, 0.0)];
const NODE: f64 = 1.1;
const PERICENTRE: f64 = -0.4;
const ANOMALY: f64 = 2.0;

/// Where a body is, with the rates of D. A. Vallado, *Fundamentals of Astrodynamics and Applications*, section 9.6, as they stand there.
fn place((e, inclination, j2): (f64, f64, f64), time: f64) -> DVec3 {
    let (n, p) = (AXIS.powf(-1.5), AXIS * (1.0 - e * e));
    let (sin, cos) = inclination.sin_cos();
    let node = -3.0 * n * RADIUS * RADIUS * j2 / (2.0 * p * p) * cos;
    let pericentre = 3.0 * n * RADIUS * RADIUS * j2 / (4.0 * p * p) * (4.0 - 5.0 * sin * sin);
    let anomaly = -3.0 * n * RADIUS * RADIUS * j2 * (1.0 - e * e).sqrt() / (4.0 * p * p) * (3.0 * sin * sin - 2.0);
    let angles = [inclination, NODE + node * time, PERICENTRE + pericentre * time, ANOMALY + anomaly * time];
    place_on_orbit(AXIS, e, angles, time)
}

fn orbit() -> Orbit {
    let column = |of: fn(&(f64, f64, f64)) -> f64| BODIES.iter().map(of).collect::<Vec<f64>>();
    Orbit::kepler(1.0, AXIS, column(|body| body.0))
        .inclined(column(|body| body.1))
        .with_ascending_node(NODE)
        .with_pericentre(PERICENTRE)
        .with_mean_anomaly(ANOMALY)
        .with_j2(column(|body| body.2), RADIUS)
}

fn orientation() -> DQuat {
    DQuat::from_xyzw(0.3, -0.1, 0.2, 0.9).normalize()
}

/// A body's attitude and angular momentum in world axes under `torque` (rotation, angular velocity, place, all in world axes).
fn in_world_axes(
    place: impl Fn(f64) -> DVec3,
    torque: impl Fn(DMat3, DVec3, DVec3, f64) -> DVec3,
) -> Vec<(DMat3, DVec3)> {
    let rate = |rotation: DMat3, momentum: DVec3, time: f64| {
        let omega = rotation * ((rotation.transpose() * momentum) / MOMENTS);
        let turning =
            DMat3::from_cols(omega.cross(rotation.x_axis), omega.cross(rotation.y_axis), omega.cross(rotation.z_axis));
        (turning, torque(rotation, omega, place(time), time))
    };
    let start = (DMat3::from_quat(orientation()), orientation() * (MOMENTS * START));
    integrated(start, (SPAN, OUTPUTS), rate)
}

/// A run of all bodies must be where the same written out is, and the first body, whose orbit drifts, not where the last is.
fn compare(torque: &Torque, written_out: impl Fn(DMat3, DVec3, DVec3, f64) -> DVec3 + Copy) {
    let rows = [(MOMENTS, orientation(), START); BODIES.len()];
    let record = run_f64(&rows, std::slice::from_ref(torque), &times(SPAN, OUTPUTS), FINE);
    let expected = BODIES.map(|body| in_world_axes(|time| place(body, time), written_out));
    for (number, expected) in expected.iter().enumerate() {
        for (snapshot, (rotation, momentum)) in record.snapshots().iter().zip(expected) {
            let (q, omega) = (snapshot.orientation(number), snapshot.angular_velocity_body(number));
            let error =
                (DMat3::from_quat(q) - *rotation).to_cols_array().into_iter().fold(0.0_f64, |a, x| a.max(x.abs()));
            let context = format!("{}, body {number}, t = {}", torque.name(), snapshot.time());
            assert!(error < TRUNCATION, "{context}: the attitude is off by {error:e}");
            let error = (q * (MOMENTS * omega) - *momentum).length();
            assert!(error < TRUNCATION, "{context}: the angular momentum is off by {error:e}");
        }
    }
    let drifting = expected[0][OUTPUTS - 1].1;
    assert!((drifting - expected[2][OUTPUTS - 1].1).length() > 0.01, "{}: the drift hardly acts", torque.name());
}

#[test]
fn a_gravity_gradient_follows_an_orbit_that_drifts() {
    compare(&Torque::gravity_gradient(orbit()), |rotation, _, r, _| {
        let tensor = rotation * DMat3::from_diagonal(MOMENTS) * rotation.transpose();
        3.0 / r.length().powi(5) * r.cross(tensor * r)
    });
}

/// Eccentricities and inclinations differ and J₂ does not: the rates of phases are each body's own all the same.
#[test]
fn each_inclination_has_a_drift_of_its_own() {
    let drifting = Orbit { j2: J2.into(), ..orbit() };
    let rows = [(MOMENTS, orientation(), START); BODIES.len()];
    let record = run_f64(&rows, &[Torque::gravity_gradient(drifting)], &times(SPAN, OUTPUTS), FINE);
    for (number, (e, inclination, _)) in BODIES.into_iter().enumerate() {
        let torque = |rotation: DMat3, _, r: DVec3, _| {
            let tensor = rotation * DMat3::from_diagonal(MOMENTS) * rotation.transpose();
            3.0 / r.length().powi(5) * r.cross(tensor * r)
        };
        let expected = in_world_axes(|time| place((e, inclination, J2), time), torque)[OUTPUTS - 1].0;
        let error = DMat3::from_quat(record.final_state().orientation(number)) - expected;
        let error = error.to_cols_array().into_iter().fold(0.0_f64, |a, x| a.max(x.abs()));
        assert!(error < TRUNCATION, "body {number}: {error:e}");
    }
}

/// (μ₀/4π) (3 r (m · r)/r⁵ − m/r³) of a dipole that turns with its planet.
fn field(r: DVec3, time: f64) -> DVec3 {
    let (strength, tilt, azimuth, rotation) = (1.5, 0.6_f64, 0.2, 0.5);
    let (sin, cos) = (azimuth + rotation * time).sin_cos();
    let dipole = strength * DVec3::new(tilt.sin() * cos, tilt.sin() * sin, tilt.cos());
    3.0 * r * dipole.dot(r) / r.length().powi(5) - dipole / r.length().powi(3)
}

#[test]
fn a_magnet_and_eddy_currents_follow_an_orbit_that_drifts() {
    let moment = DVec3::new(0.3, -0.2, 0.4);
    compare(&Torque::orbiting_dipole(moment, orbit(), 1.5, 0.6, 0.2, 0.5), |rotation, _, r, time| {
        (rotation * moment).cross(field(r, time))
    });
    compare(&Torque::orbiting_eddy_current(0.4, orbit(), 1.5, 0.6, 0.2, 0.5), |_, omega, r, time| {
        0.4 * omega.cross(field(r, time)).cross(field(r, time))
    });
}

/// Series and adaptive steps of `rk8`, which have evaluators of their own.
#[test]
fn series_and_adaptive_steps_follow_an_orbit_that_drifts() {
    let rows = [(MOMENTS, orientation(), START); BODIES.len()];
    let ensemble = Ensemble::from_fn(BODIES.len(), |body| rows[body]).expect("valid bodies");
    let scene = Scene::new(ensemble).until(SPAN).torque(Torque::gravity_gradient(orbit()));
    let steps = AdaptiveSteps { tolerance: 1e-13, least_step: None };
    let expected = BODIES.map(|body| {
        let torque = |rotation: DMat3, _, r: DVec3, _| {
            let tensor = rotation * DMat3::from_diagonal(MOMENTS) * rotation.transpose();
            3.0 / r.length().powi(5) * r.cross(tensor * r)
        };
        in_world_axes(|time| place(body, time), torque)[OUTPUTS - 1].0
    });
    let engine = Engine::cpu();
    for scene in [scene.clone().taylor(steps), scene.adaptive(steps, Some(Precision::F64))] {
        let record = engine.run(&Plan::new(&scene, &engine).expect("a plan")).expect("a run");
        for (body, expected) in expected.iter().enumerate() {
            let error = DMat3::from_quat(record.final_state().orientation(body)) - *expected;
            let error = error.to_cols_array().into_iter().fold(0.0_f64, |a, x| a.max(x.abs()));
            assert!(error < TRUNCATION, "{}, body {body}: {error:e}", scene.stepping());
        }
    }
}
