//! `gravity-gradient` on an elliptic orbit; described with [`super::gravity_gradient`].

use super::formula::{Column, Epoch, Formula, MOST_PHASES, Row};
use super::orbit::{gradient_torque, kepler_place};
use crate::math::quaternion::Quaternion;
use crate::math::real::Real;
use crate::math::vector::Vector;

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

/// `gravity-gradient` where an orbit is eccentric.
#[derive(Clone, Copy, Debug)]
pub struct GravityGradientKepler;

impl Formula for GravityGradientKepler {
    const STEM: &'static str = "gravity_gradient_kepler";
    const COLUMNS: &'static [Column] = &[
        Column::vector("coefficients"),
        Column::vector("x_world"),
        Column::vector("y_world"),
        Column::number("factor"),
        Column::number("eccentricity"),
        Column::number("start"),
    ];
    const PHASES: &'static [&'static str] = &["phase"];
    const FOLLOWS_MOMENTS: bool = true;
    #[inline(always)]
    fn epoch_reads(column: usize) -> bool {
        (3..12).contains(&column) && column != 9
    }

    #[inline(always)]
    fn epoch<R: Real>(row: &impl Row<R>, phases: [R; MOST_PHASES]) -> Epoch<R> {
        let (vector, number) = place_and_cube(row.vector(3), row.vector(6), row.number(10), row.number(11), phases[0]);
        Epoch { vector, number }
    }

    /// 3 n² (a/r)³ u × I u.
    #[inline(always)]
    fn torque<R: Real>(row: &impl Row<R>, epoch: &Epoch<R>, q: Quaternion<R>, _: Vector<R>) -> Vector<R> {
        gradient_torque(row.vector(0) * epoch.number, epoch.vector, q)
    }
}
