//! `gravity-gradient` on an elliptic orbit; described with [`super::gravity_gradient`].

use super::orbit::{gradient_torque, kepler_place};
use crate::quaternion::Quaternion;
use crate::real::Real;
use crate::vector::Vector;

/// 3 n² (a/r)³ u × I u, in principal axes, at a mean anomaly in turns; `start` is the one at t = 0.
#[inline(always)]
pub fn gravity_gradient_kepler<R: Real>(
    coefficients: Vector<R>,
    x_world: Vector<R>,
    y_world: Vector<R>,
    eccentricity: R,
    start: R,
    phase: R,
    orientation: Quaternion<R>,
) -> Vector<R> {
    let anomaly = phase + start;
    let place = kepler_place(x_world, y_world, eccentricity, anomaly - anomaly.round());
    let cube = place.inverse_distance * place.inverse_distance * place.inverse_distance;
    gradient_torque(coefficients * cube, place.direction_world, orientation)
}
