//! Eddy currents and magnets in the field of a tilted dipole, against equations of motion written out in inertial axes.

use glam::{DMat3, DQuat, DVec3};
use polhode::engine::cpu::Cpu;
use polhode::math::Precision;
use polhode::math::Width;
use polhode::torque::Orbit;
use polhode::{Ensemble, Method, Outputs, Plan, Scene, Torque};

use super::{FINE, TRUNCATION, run_f64, times};

/// Where an orbit of mu = 1 is at a time, from Newton's iteration and the classical elements written out.
pub fn place_on_orbit(a: f64, e: f64, [inclination, node, pericentre, anomaly]: [f64; 4], time: f64) -> DVec3 {
    let mean = anomaly + time / (a * a * a).sqrt();
    let mut eccentric = mean;
    for _ in 0..50 {
        eccentric -= (eccentric - e * eccentric.sin() - mean) / (1.0 - e * eccentric.cos());
    }
    let ((si, ci), (sn, cn), (sp, cp)) = (inclination.sin_cos(), node.sin_cos(), pericentre.sin_cos());
    let to_pericentre = DVec3::new(cn * cp - sn * sp * ci, sn * cp + cn * sp * ci, sp * si);
    let across = DVec3::new(-cn * sp - sn * cp * ci, -sn * sp + cn * cp * ci, cp * si);
    a * (eccentric.cos() - e) * to_pericentre + a * (1.0 - e * e).sqrt() * eccentric.sin() * across
}

#[test]
fn eddy_currents_in_the_field_of_an_orbiting_dipole_damp_as_in_inertial_axes_and_only_take_energy() {
    let (a, e, angles) = (1.25, 0.3, [0.7, 1.1, -0.4, 2.0]);
    let (strength, tilt, azimuth, rotation, k) = (1.5_f64, 0.6_f64, 0.2, 0.5, 0.4);
    // The field of a dipole, (μ₀/4π) (3 r (m · r)/r⁵ − m/r³), which turns about z.
    let field = |time: f64| {
        let r = place_on_orbit(a, e, angles, time);
        let (sin, cos) = (azimuth + rotation * time).sin_cos();
        let dipole = strength * DVec3::new(tilt.sin() * cos, tilt.sin() * sin, tilt.cos());
        3.0 * r * dipole.dot(r) / r.length().powi(5) - dipole / r.length().powi(3)
    };
    let moments = DVec3::new(1.0, 2.0, 2.5);
    let orientation = DQuat::from_xyzw(0.3, -0.1, 0.2, 0.9).normalize();
    let start = DVec3::new(0.5, 0.8, -0.3);
    // State in world axes: the rotation matrix and the angular momentum L; dL/dt = k (ω × B) × B.
    let rate = |rotation: DMat3, momentum: DVec3, time: f64| {
        let omega = rotation * ((rotation.transpose() * momentum) / moments);
        let spin =
            DMat3::from_cols(omega.cross(rotation.x_axis), omega.cross(rotation.y_axis), omega.cross(rotation.z_axis));
        (spin, k * omega.cross(field(time)).cross(field(time)))
    };
    let (end, outputs) = (12.0, 24);
    let expected = integrated((DMat3::from_quat(orientation), orientation * (moments * start)), (end, outputs), rate);

    let [inclination, node, pericentre, anomaly] = angles;
    let orbit = Orbit::kepler(1.0, a, e).inclined(inclination).with_ascending_node(node);
    let orbit = orbit.with_pericentre(pericentre).with_mean_anomaly(anomaly);
    // The second body is the control, which conducts nothing.
    let torque = Torque::orbiting_eddy_current(vec![k, 0.0], orbit, strength, tilt, azimuth, rotation);
    assert!(torque.dissipative());
    let rows = [(moments, orientation, start); 2];
    let record = run_f64(&rows, std::slice::from_ref(&torque), &times(end, outputs), FINE);
    let energy = |omega: DVec3| 0.5 * omega.dot(moments * omega);
    let mut last = energy(start);
    for (snapshot, (rotation, momentum)) in record.snapshots().iter().zip(&expected) {
        let (q, omega) = (snapshot.orientation(0), snapshot.angular_velocity_body(0));
        let error = (DMat3::from_quat(q) - *rotation).to_cols_array().into_iter().fold(0.0_f64, |a, x| a.max(x.abs()));
        assert!(error < TRUNCATION, "t = {}: the attitude is off by {error:e}", snapshot.time());
        let error = (q * (moments * omega) - *momentum).length();
        assert!(error < TRUNCATION, "t = {}: the angular momentum is off by {error:e}", snapshot.time());
        assert!(energy(omega) < last, "t = {}: the energy rises from {last} to {}", snapshot.time(), energy(omega));
        last = energy(omega);
        let control = energy(snapshot.angular_velocity_body(1)) / energy(start) - 1.0;
        assert!(control.abs() < TRUNCATION, "t = {}: the control loses {control:e}", snapshot.time());
    }
    assert!(last < 0.5 * energy(start), "hardly any damping: {last} of {}", energy(start));
}

/// A rotation matrix and a vector at the ends of `outputs` equal parts of a span of `end` seconds, by the classical Runge-Kutta method in
/// 256 steps a part; `rate` gives their derivatives.
pub fn integrated(
    start: (DMat3, DVec3),
    (end, outputs): (f64, usize),
    rate: impl Fn(DMat3, DVec3, f64) -> (DMat3, DVec3),
) -> Vec<(DMat3, DVec3)> {
    const STEPS: usize = 256;
    let dt = end / (outputs * STEPS) as f64;
    let step = |(r, v): (DMat3, DVec3), step: usize| {
        let t = step as f64 * dt;
        let k1 = rate(r, v, t);
        let k2 = rate(r + k1.0 * (dt / 2.0), v + k1.1 * (dt / 2.0), t + dt / 2.0);
        let k3 = rate(r + k2.0 * (dt / 2.0), v + k2.1 * (dt / 2.0), t + dt / 2.0);
        let k4 = rate(r + k3.0 * dt, v + k3.1 * dt, t + dt);
        let sum = (k1.0 + k2.0 * 2.0 + k3.0 * 2.0 + k4.0, k1.1 + k2.1 * 2.0 + k3.1 * 2.0 + k4.1);
        (r + sum.0 * (dt / 6.0), v + sum.1 * (dt / 6.0))
    };
    let of_part = |state: &mut (DMat3, DVec3), part: usize| {
        *state = (part * STEPS..(part + 1) * STEPS).fold(*state, step);
        Some(*state)
    };
    (0..outputs).scan(start, of_part).collect()
}

/// A tilted dipole that turns with its planet, and an eccentric orbit of any orientation: the field along it as textbooks have it, after
/// B = (μ₀/4π) (3 r (m · r)/r⁵ − m/r³).
fn tilted_field(
    orbit: [f64; 2],
    angles: [f64; 4],
    [strength, tilt, azimuth, rotation]: [f64; 4],
) -> impl Fn(f64) -> DVec3 {
    move |time| {
        let r = place_on_orbit(orbit[0], orbit[1], angles, time);
        let (sin, cos) = (azimuth + rotation * time).sin_cos();
        let dipole = strength * DVec3::new(tilt.sin() * cos, tilt.sin() * sin, tilt.cos());
        3.0 * r * dipole.dot(r) / r.length().powi(5) - dipole / r.length().powi(3)
    }
}

/// A body with products of inertia in the field of [`tilted_field`], against Euler's equations for the rotation matrix, with the whole
/// tensor, by a method written out here.
#[test]
fn a_magnet_in_the_field_of_a_tilted_dipole_moves_as_eulers_equations_say() {
    let (orbit, angles, field) = ([1.25, 0.3], [0.7, 1.1, -0.4, 2.0], [1.5, 0.6, 0.2, 0.5]);
    let moment = DVec3::new(0.3, -0.2, 0.4);
    let axes = DMat3::from_quat(DQuat::from_xyzw(0.2, 0.5, -0.1, 0.8).normalize());
    let tensor = axes * DMat3::from_diagonal(DVec3::new(1.0, 2.0, 2.5)) * axes.transpose();
    let inverse = tensor.inverse();
    let (orientation, start) = (DQuat::from_xyzw(0.3, -0.1, 0.2, 0.9).normalize(), DVec3::new(0.5, 0.8, -0.3));
    let at = tilted_field(orbit, angles, field);
    let rate = |rotation: DMat3, omega: DVec3, time: f64| {
        let turning = DMat3::from_cols(
            DVec3::new(0.0, omega.z, -omega.y),
            DVec3::new(-omega.z, 0.0, omega.x),
            DVec3::new(omega.y, -omega.x, 0.0),
        );
        let torque = moment.cross(rotation.transpose() * at(time));
        (rotation * turning, inverse * (torque - omega.cross(tensor * omega)))
    };
    let (end, outputs) = (12.0, 24);
    let expected = integrated((DMat3::from_quat(orientation), start), (end, outputs), rate);

    let ensemble = Ensemble::from_columns(&[tensor], &[orientation], &[start]).expect("a valid body");
    let [inclination, node, pericentre, anomaly] = angles;
    let way = Orbit::kepler(1.0, orbit[0], orbit[1]).inclined(inclination).with_ascending_node(node);
    let way = way.with_pericentre(pericentre).with_mean_anomaly(anomaly);
    let [strength, tilt, azimuth, rotation] = field;
    let scene = Scene::new(ensemble)
        .until(end)
        .outputs(Outputs::Times(times(end, outputs)))
        .torque(Torque::orbiting_dipole(moment, way, strength, tilt, azimuth, rotation))
        .pinned(Method::Rk4, FINE, Some(Precision::F64));
    let engine = Cpu::new(Width::Lanes);
    let record = polhode::run::run(&engine, &Plan::new(&scene, &engine).expect("a valid plan")).expect("a run");
    let mut turned = 0.0_f64;
    for (snapshot, (rotation, omega)) in record.snapshots().iter().zip(&expected) {
        let error = DMat3::from_quat(snapshot.orientation(0)) - *rotation;
        let error = error.to_cols_array().into_iter().fold(0.0_f64, |a, x| a.max(x.abs()));
        assert!(error < TRUNCATION, "t = {}: the attitude is off by {error:e}", snapshot.time());
        let error = (snapshot.angular_velocity_body(0) - *omega).length();
        assert!(error < TRUNCATION, "t = {}: the angular velocity is off by {error:e}", snapshot.time());
        turned = turned.max((tensor * *omega).length() / (tensor * start).length());
    }
    assert!(turned > 1.1, "the field hardly acts: {turned}");
}
