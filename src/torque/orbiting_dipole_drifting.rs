//! `orbiting-dipole` along an orbit that drifts; described with [`super::orbiting_dipole`].

use super::formula::{Column, Epoch, Formula, MOST_PHASES, Row};
use super::magnetic_dipole::magnetic_dipole;
use super::orbiting_dipole::{DRIFTING_FIELD_NUMBERS, DRIFTING_FIELD_PHASES, DriftingDipoleField, with_drifting_field};
use crate::math::quaternion::Quaternion;
use crate::math::real::Real;
use crate::math::vector::Vector;

/// `orbiting-dipole` where an orbit drifts.
#[derive(Clone, Copy, Debug)]
pub struct OrbitingDipoleDrifting;

impl Formula for OrbitingDipoleDrifting {
    const STEM: &'static str = "orbiting_dipole_drifting";
    const COLUMNS: &'static [Column] = &with_drifting_field(Column::vector("moment_principal"));
    const PHASES: &'static [&'static str] = DRIFTING_FIELD_PHASES;
    #[inline(always)]
    fn epoch_reads(column: usize) -> bool {
        (3..3 + DRIFTING_FIELD_NUMBERS).contains(&column)
    }

    #[inline(always)]
    fn epoch<R: Real>(row: &impl Row<R>, phases: [R; MOST_PHASES]) -> Epoch<R> {
        Epoch::vector(DriftingDipoleField::of_row(row, 3).at(phases))
    }

    #[inline(always)]
    fn torque<R: Real>(row: &impl Row<R>, epoch: &Epoch<R>, q: Quaternion<R>, _: Vector<R>) -> Vector<R> {
        magnetic_dipole(row.vector(0), epoch.vector, q)
    }
}
