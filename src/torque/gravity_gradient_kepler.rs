//! `gravity-gradient` on an elliptic orbit; described with [`super::gravity_gradient`].

use super::orbit::{gradient_torque, kepler_place};
use crate::quaternion::Quaternion;
use crate::real::Real;
use crate::vector::Vector;

/// The direction from the centre in world axes and (a/r)³, at a mean anomaly in turns; `start` is the one at t = 0.
#[inline(always)]
pub(super) fn place_and_cube<R: Real>(
    x_world: Vector<R>,
    y_world: Vector<R>,
    eccentricity: R,
    start: R,
    phase: R,
) -> (Vector<R>, R) {
    let anomaly = phase + start;
    let place = kepler_place(x_world, y_world, eccentricity, anomaly - anomaly.round());
    (place.direction_world, place.inverse_distance * place.inverse_distance * place.inverse_distance)
}

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
    let (direction_world, cube) = place_and_cube(x_world, y_world, eccentricity, start, phase);
    gradient_torque(coefficients * cube, direction_world, orientation)
}
