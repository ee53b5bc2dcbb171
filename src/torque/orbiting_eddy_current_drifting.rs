//! `orbiting-eddy-current` along an orbit that drifts; described with [`super::orbiting_eddy_current`].

use super::eddy_current::eddy_current;
use super::formula::{Column, Epoch, Formula, MOST_PHASES, Row};
use super::orbiting_dipole::{DRIFTING_FIELD_NUMBERS, DRIFTING_FIELD_PHASES, DriftingDipoleField, with_drifting_field};
use crate::math::quaternion::Quaternion;
use crate::math::real::Real;
use crate::math::vector::Vector;

/// `orbiting-eddy-current` where an orbit drifts.
#[derive(Clone, Copy, Debug)]
pub struct OrbitingEddyCurrentDrifting;

impl Formula for OrbitingEddyCurrentDrifting {
    const STEM: &'static str = "orbiting_eddy_current_drifting";
    const COLUMNS: &'static [Column] = &with_drifting_field(Column::number("coefficient"));
    const PHASES: &'static [&'static str] = DRIFTING_FIELD_PHASES;
    #[inline(always)]
    fn epoch_reads(column: usize) -> bool {
        (1..1 + DRIFTING_FIELD_NUMBERS).contains(&column)
    }

    #[inline(always)]
    fn epoch<R: Real>(row: &impl Row<R>, phases: [R; MOST_PHASES]) -> Epoch<R> {
        Epoch::vector(DriftingDipoleField::of_row(row, 1).at(phases))
    }

    #[inline(always)]
    fn torque<R: Real>(row: &impl Row<R>, epoch: &Epoch<R>, q: Quaternion<R>, omega: Vector<R>) -> Vector<R> {
        eddy_current(row.number(0), epoch.vector, q, omega)
    }
}
