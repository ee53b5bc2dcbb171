//! `constant-body`: a torque that is constant in body axes, such as a thruster pair's.

use super::formula::{Column, Epoch, Formula, Row};
use crate::quaternion::Quaternion;
use glam::{DQuat, DVec3};

use super::{Border, Kind, Model, Needs, Parameter};
use crate::batch::BodyFrame;
use crate::error::Result;
use crate::real::Real;
use crate::vector::Vector;

/// τ = const in body axes. Several add up to one.
#[derive(Clone, Debug, PartialEq)]
pub struct ConstantBody {
    /// Torque in body axes, N m.
    pub torque_body: Parameter<DVec3>,
}

impl Model for ConstantBody {
    fn kind(&self) -> Kind {
        Kind::ConstantBody
    }

    fn validate(&self, border: &Border) -> Result<()> {
        border.finite("torque_body", &self.torque_body)
    }

    fn needs(&self) -> Needs {
        Needs::NOTHING
    }

    fn rate(&self, body: usize, middle_moment: f64) -> f64 {
        (self.torque_body.at(body).length() / middle_moment).sqrt()
    }

    fn columns(&self, body: usize, frame: &BodyFrame, _: DQuat, out: &mut [f64]) {
        let mut torque = frame.scaled_torque(frame.to_principal(self.torque_body.at(body)));
        if frame.is_linear_rotor {
            // Its axis has nothing for a torque to act upon (see `linear_rotor`).
            torque.x = 0.0;
        }
        for (column, component) in out.iter_mut().zip(torque.to_array()) {
            *column += component;
        }
    }
}

/// τ, in principal axes.
#[inline(always)]
pub fn constant_body<R: Real>(torque_principal: Vector<R>) -> Vector<R> {
    torque_principal
}

impl Formula for ConstantBody {
    const STEM: &'static str = "constant_body";
    const COLUMNS: &'static [Column] = &[Column::vector("torque_principal")];
    const MERGES: bool = true;
    const NEEDS: Needs = Needs::NOTHING;

    #[inline(always)]
    fn torque<R: Real>(row: &impl Row<R>, _: &Epoch<R>, _: Quaternion<R>, _: Vector<R>) -> Vector<R> {
        constant_body(row.vector(0))
    }
}
