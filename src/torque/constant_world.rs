//! `constant-world`: a torque that is constant in world axes.

use super::formula::{Column, Epoch, Formula, Row};
use glam::{DQuat, DVec3};

use super::{Border, Kind, Model, Needs, Parameter};
use crate::batch::BodyFrame;
use crate::error::Result;
use crate::quaternion::Quaternion;
use crate::real::Real;
use crate::vector::Vector;

/// τ = Rᵀ τ_world. Several add up to one. It has no potential: rotations do not commute.
#[derive(Clone, Debug, PartialEq)]
pub struct ConstantWorld {
    /// Torque in world axes, N m.
    pub torque_world: Parameter<DVec3>,
}

impl Model for ConstantWorld {
    fn kind(&self) -> Kind {
        Kind::ConstantWorld
    }

    fn validate(&self, border: &Border) -> Result<()> {
        border.finite("torque_world", &self.torque_world)
    }

    fn needs(&self) -> Needs {
        Needs { attitude: true, ..Needs::NOTHING }
    }

    fn rate(&self, body: usize, middle_moment: f64) -> f64 {
        (self.torque_world.at(body).length() / middle_moment).sqrt()
    }

    fn columns(&self, body: usize, frame: &BodyFrame, _: DQuat, out: &mut [f64]) {
        for (column, component) in out.iter_mut().zip(frame.scaled_torque(self.torque_world.at(body)).to_array()) {
            *column += component;
        }
    }
}

/// Rᵀ τ_world, in principal axes.
#[inline(always)]
pub fn constant_world<R: Real>(torque_world: Vector<R>, orientation: Quaternion<R>) -> Vector<R> {
    orientation.rotate_inverse(torque_world)
}

impl Formula for ConstantWorld {
    const STEM: &'static str = "constant_world";
    const COLUMNS: &'static [Column] = &[Column::vector("torque_world")];
    const MERGES: bool = true;
    const NEEDS: Needs = Needs { attitude: true, ..Needs::NOTHING };

    #[inline(always)]
    fn torque<R: Real>(row: &impl Row<R>, _: &Epoch<R>, q: Quaternion<R>, _: Vector<R>) -> Vector<R> {
        constant_world(row.vector(0), q)
    }
}
