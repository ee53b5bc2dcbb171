//! Generated ensembles for comparing and measuring engines.

use glam::{DQuat, DVec3};

use super::draw::{Column, Draw};
use crate::bodies::Ensemble;
use crate::error::Result;
use crate::torque::{Orbit, Torque};

/// Simulated time of the free problem, s.
pub const FREE_SPAN: f64 = 10.0;

/// Simulated time of the separatrix problem, s.
pub const SEPARATRIX_SPAN: f64 = 100.0;

/// Free asymmetric bodies: moments I₁ = b + c, I₂ = c + a, I₃ = a + b (kg m², along the body axes, in no order) with a,
/// b, c uniform in [0.2, 1], angular velocity components standard normal (rad/s), orientation uniform on SO(3).
///
/// Every body is a function of `seed` and its index only: a smaller ensemble is the beginning of a larger one.
///
/// # Errors
///
/// [`crate::Error::TooManyBodies`] where the memory does not suffice.
pub fn free(body_count: usize, seed: u64) -> Result<Ensemble> {
    let draw = Draw::new(seed);
    Ensemble::from_fn(body_count, |body| {
        let [a, b, c] = [0, 1, 2].map(|component| 0.2 + 0.8 * draw.uniform(body, Column::Inertia, component));
        (
            DVec3::new(b + c, c + a, a + b),
            draw.rotation(body, Column::Orientation),
            draw.normal_vector(body, Column::AngularVelocity),
        )
    })
}

/// The bodies of [`free`] under a constant torque in body axes, components uniform in [−1, 1] N m, and linear drag with a
/// coefficient uniform in [0.01, 0.1] N m s.
///
/// # Errors
///
/// [`crate::Error::TooManyBodies`] where the memory does not suffice.
pub fn forced(body_count: usize, seed: u64) -> Result<(Ensemble, [Torque; 2])> {
    let ensemble = free(body_count, seed)?;
    let draw = Draw::new(seed);
    let uniform = |body, torque, component| draw.uniform(body, Column::Torque { torque, parameter: 0 }, component);
    let torque: Vec<DVec3> =
        (0..body_count).map(|body| DVec3::from_array([0, 1, 2].map(|c| 2.0 * uniform(body, 0, c) - 1.0))).collect();
    let drag: Vec<f64> = (0..body_count).map(|body| 0.01 + 0.09 * uniform(body, 1, 0)).collect();
    Ok((ensemble, [Torque::constant_body(torque), Torque::linear_drag(drag)]))
}

/// Bodies near the separatrix: moments (1, 2, 3) kg m², angular velocity 5 (ε, 1, ε) rad/s, orientation uniform on
/// SO(3), with ε from 1e-1 (first body) to 1e-6 (last body) in equal ratios.
///
/// Rotation about the intermediate axis is unstable: a body flips again and again, at times that depend on ln ε.
///
/// # Errors
///
/// [`crate::Error::TooManyBodies`] where the memory does not suffice.
pub fn separatrix(body_count: usize, seed: u64) -> Result<Ensemble> {
    let draw = Draw::new(seed);
    Ensemble::from_fn(body_count, |body| {
        let fraction = if body_count > 1 { body as f64 / (body_count - 1) as f64 } else { 0.0 };
        let epsilon = libm::exp10(-1.0 - 5.0 * fraction);
        let orientation: DQuat = draw.rotation(body, Column::Orientation);
        (DVec3::new(1.0, 2.0, 3.0), orientation, 5.0 * DVec3::new(epsilon, 1.0, epsilon))
    })
}

/// The bodies of [`free`], moments taken about a pivot, with a mass of 1 kg whose centre is up to 0.5 m from the pivot along
/// each body axis (uniform), under gravity of 9.81 m/s² against the world's z axis.
///
/// # Errors
///
/// [`crate::Error::TooManyBodies`] where the memory does not suffice.
pub fn heavy_top(body_count: usize, seed: u64) -> Result<(Ensemble, Torque)> {
    let ensemble = free(body_count, seed)?;
    let centre = uniform_vectors(body_count, seed, 2, 0.5);
    Ok((ensemble, Torque::heavy_top(1.0, centre, DVec3::new(0.0, 0.0, -9.81))))
}

/// The bodies of [`free`] on a circular orbit of 0.5 rad/s, which is half of their usual spin: they tumble.
///
/// # Errors
///
/// [`crate::Error::TooManyBodies`] where the memory does not suffice.
pub fn gravity_gradient(body_count: usize, seed: u64) -> Result<(Ensemble, Torque)> {
    Ok((free(body_count, seed)?, Torque::gravity_gradient(Orbit::circular(0.25, 1.0))))
}

/// The bodies of [`free`] under linear drag with a coefficient uniform in [0.01, 0.1] N m s.
///
/// # Errors
///
/// [`crate::Error::TooManyBodies`] where the memory does not suffice.
pub fn drag(body_count: usize, seed: u64) -> Result<(Ensemble, Torque)> {
    let (ensemble, [_, drag]) = forced(body_count, seed)?;
    Ok((ensemble, drag))
}

/// The bodies of [`free`] under a torque in body axes that oscillates at 1.5 rad/s, amplitudes of sine and cosine uniform in
/// [−1, 1] N m.
///
/// # Errors
///
/// [`crate::Error::TooManyBodies`] where the memory does not suffice.
pub fn driven(body_count: usize, seed: u64) -> Result<(Ensemble, Torque)> {
    let ensemble = free(body_count, seed)?;
    let [sine, cosine] = [3, 4].map(|torque| uniform_vectors(body_count, seed, torque, 1.0));
    Ok((ensemble, Torque::sinusoidal(sine, cosine, 1.5)))
}

/// A vector for each body, components uniform in [−`half_width`, `half_width`]; `torque` distinguishes columns.
fn uniform_vectors(body_count: usize, seed: u64, torque: u16, half_width: f64) -> Vec<DVec3> {
    let draw = Draw::new(seed);
    let component = |body, c| draw.uniform(body, Column::Torque { torque, parameter: 0 }, c);
    (0..body_count)
        .map(|body| half_width * DVec3::from_array([0, 1, 2].map(|c| 2.0 * component(body, c) - 1.0)))
        .collect()
}
