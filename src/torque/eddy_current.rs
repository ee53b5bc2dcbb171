//! `eddy-current`: damping of a conducting body that turns in a uniform magnetic field.

use super::formula::{Column, Epoch, Formula, Row};
use glam::{DQuat, DVec3};

use super::{Border, Kind, Model, Needs, Parameter};
use crate::batch::BodyFrame;
use crate::error::Result;
use crate::quaternion::Quaternion;
use crate::real::Real;
use crate::vector::Vector;

/// τ = k (ω × B) × B, which takes only the part of ω across the field (G. L. Smith, *A theoretical study of the torques
/// induced by a magnetic field on rotating cylinders and spheres*, NASA TR R-129, 1962; a conducting sphere of
/// conductivity σ and radius a has k = 2πσa⁵/15).
#[derive(Clone, Debug, PartialEq)]
pub struct EddyCurrent {
    /// k, N m s/T², not negative.
    pub coefficient: Parameter<f64>,
    /// B in world axes, T.
    pub field_world: Parameter<DVec3>,
}

impl Model for EddyCurrent {
    fn kind(&self) -> Kind {
        Kind::EddyCurrent
    }

    fn validate(&self, border: &Border) -> Result<()> {
        border.not_negative("coefficient", &self.coefficient)?;
        border.finite("field_world", &self.field_world)
    }

    fn needs(&self) -> Needs {
        Needs { attitude: true, angular_velocity: true, ..Needs::NOTHING }
    }

    fn dissipative(&self) -> bool {
        true
    }

    fn rate(&self, _: usize, _: f64) -> f64 {
        0.0
    }

    fn columns(&self, body: usize, frame: &BodyFrame, _: DQuat, out: &mut [f64]) {
        let field = self.field_world.at(body);
        out[0] = frame.scaled(self.coefficient.at(body) * field.length_squared(), 1, 1);
        out[1..4].copy_from_slice(&field.normalize_or_zero().to_array());
    }
}

/// k' (ω × d) × d with d the field's direction in principal axes, k' = k |B|².
#[inline(always)]
pub fn eddy_current<R: Real>(
    coefficient: R,
    direction_world: Vector<R>,
    orientation: Quaternion<R>,
    angular_velocity_principal: Vector<R>,
) -> Vector<R> {
    let direction = orientation.rotate_inverse(direction_world);
    angular_velocity_principal.cross(direction).cross(direction) * coefficient
}

impl Formula for EddyCurrent {
    const STEM: &'static str = "eddy_current";
    const COLUMNS: &'static [Column] = &[Column::number("coefficient"), Column::vector("direction_world")];
    const NEEDS: Needs = Needs { attitude: true, angular_velocity: true, ..Needs::NOTHING };

    #[inline(always)]
    fn torque<R: Real>(row: &impl Row<R>, _: &Epoch<R>, q: Quaternion<R>, omega: Vector<R>) -> Vector<R> {
        eddy_current(row.number(0), row.vector(1), q, omega)
    }
}
