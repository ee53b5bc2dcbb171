//! `magnetic-dipole`: a magnet fixed in the body, in a uniform field.

use super::formula::{Column, Epoch, Formula, Row};
use glam::{DQuat, DVec3};

use super::{Border, Kind, Model, Needs, Parameter};
use crate::batch::BodyFrame;
use crate::error::Result;
use crate::quaternion::Quaternion;
use crate::real::Real;
use crate::vector::Vector;

/// τ = m × Rᵀ B (J. C. Maxwell, *A Treatise on Electricity and Magnetism*, 1873, § 390). Potential energy: −B · R m.
#[derive(Clone, Debug, PartialEq)]
pub struct MagneticDipole {
    /// m in body axes, A m².
    pub moment_body: Parameter<DVec3>,
    /// B in world axes, T.
    pub field_world: Parameter<DVec3>,
}

impl Model for MagneticDipole {
    fn kind(&self) -> Kind {
        Kind::MagneticDipole
    }

    fn validate(&self, border: &Border) -> Result<()> {
        border.finite("moment_body", &self.moment_body)?;
        border.finite("field_world", &self.field_world)
    }

    fn needs(&self) -> Needs {
        Needs { attitude: true, ..Needs::NOTHING }
    }

    fn rate(&self, body: usize, middle_moment: f64) -> f64 {
        (self.moment_body.at(body).length() * self.field_world.at(body).length() / middle_moment).sqrt()
    }

    fn columns(&self, body: usize, frame: &BodyFrame, _: DQuat, out: &mut [f64]) {
        let field = self.field_world.at(body);
        let moment = frame.to_principal(self.moment_body.at(body)) * field.length();
        out[..3].copy_from_slice(&frame.scaled_torque(moment).to_array());
        out[3..6].copy_from_slice(&field.normalize_or_zero().to_array());
    }

    fn potential_energy(&self, body: usize, orientation: DQuat) -> Option<f64> {
        Some(-self.field_world.at(body).dot(orientation * self.moment_body.at(body)))
    }
}

/// m' × Rᵀ d, in principal axes: m' = m |B|, d the direction of the field.
#[inline(always)]
pub fn magnetic_dipole<R: Real>(
    moment_principal: Vector<R>,
    direction_world: Vector<R>,
    orientation: Quaternion<R>,
) -> Vector<R> {
    moment_principal.cross(orientation.rotate_inverse(direction_world))
}

impl Formula for MagneticDipole {
    const STEM: &'static str = "magnetic_dipole";
    const COLUMNS: &'static [Column] = &[Column::vector("moment_principal"), Column::vector("direction_world")];
    const NEEDS: Needs = Needs { attitude: true, ..Needs::NOTHING };

    #[inline(always)]
    fn torque<R: Real>(row: &impl Row<R>, _: &Epoch<R>, q: Quaternion<R>, _: Vector<R>) -> Vector<R> {
        magnetic_dipole(row.vector(0), row.vector(3), q)
    }
}
