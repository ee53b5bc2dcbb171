//! `gravity-gradient` on an orbit that drifts; described with [`super::gravity_gradient`].

use super::formula::{Column, Epoch, Formula, MOST_PHASES, Row};
use super::orbit::drift::{DRIFTING_COLUMNS, DRIFTING_NUMBERS, DRIFTING_PHASES, DriftingOrbit};
use super::orbit::gradient_torque;
use crate::math::quaternion::Quaternion;
use crate::math::real::Real;
use crate::math::vector::Vector;

/// `gravity-gradient` where an orbit drifts, circular or not.
#[derive(Clone, Copy, Debug)]
pub struct GravityGradientDrifting;

impl Formula for GravityGradientDrifting {
    const STEM: &'static str = "gravity_gradient_drifting";
    const COLUMNS: &'static [Column] = &{
        let [sin, cos, node, pericentre, eccentricity, start] = DRIFTING_COLUMNS;
        [Column::vector("coefficients"), sin, cos, node, pericentre, eccentricity, start, Column::number("factor")]
    };
    const PHASES: &'static [&'static str] = &DRIFTING_PHASES;
    const FOLLOWS_MOMENTS: bool = true;
    #[inline(always)]
    fn epoch_reads(column: usize) -> bool {
        (3..3 + DRIFTING_NUMBERS).contains(&column)
    }

    #[inline(always)]
    fn epoch<R: Real>(row: &impl Row<R>, phases: [R; MOST_PHASES]) -> Epoch<R> {
        let (vector, number) = DriftingOrbit::of_row(row, 3).place_and_cube([phases[0], phases[1], phases[2]]);
        Epoch { vector, number }
    }

    #[inline(always)]
    fn torque<R: Real>(row: &impl Row<R>, epoch: &Epoch<R>, q: Quaternion<R>, _: Vector<R>) -> Vector<R> {
        gradient_torque(row.vector(0) * epoch.number, epoch.vector, q)
    }
}
