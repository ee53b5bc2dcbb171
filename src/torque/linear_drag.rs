//! `linear-drag`: a torque against the angular velocity and in proportion to it, the same about every axis.

use super::formula::{Column, Epoch, Formula, Row};
use crate::quaternion::Quaternion;
use glam::DQuat;

use super::{Border, Kind, Model, Needs, Parameter};
use crate::batch::BodyFrame;
use crate::error::Result;
use crate::real::Real;
use crate::vector::Vector;

/// τ = −c ω (a slowly turning sphere of radius a in a fluid of viscosity η has c = 8πηa³: G. Kirchhoff, *Mechanik*, 1876,
/// lecture 26). Several add up to one.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearDrag {
    /// c, N m s, not negative.
    pub coefficient: Parameter<f64>,
}

impl Model for LinearDrag {
    fn kind(&self) -> Kind {
        Kind::LinearDrag
    }

    fn validate(&self, border: &Border) -> Result<()> {
        border.not_negative("coefficient", &self.coefficient)
    }

    fn needs(&self) -> Needs {
        Needs { angular_velocity: true, ..Needs::NOTHING }
    }

    fn dissipative(&self) -> bool {
        true
    }

    fn rate(&self, _: usize, _: f64) -> f64 {
        0.0
    }

    fn columns(&self, body: usize, frame: &BodyFrame, _: DQuat, out: &mut [f64]) {
        out[0] += frame.scaled(self.coefficient.at(body), 1, 1);
    }
}

/// −c ω, in principal axes.
#[inline(always)]
pub fn linear_drag<R: Real>(coefficient: R, angular_velocity_principal: Vector<R>) -> Vector<R> {
    -(angular_velocity_principal * coefficient)
}

impl Formula for LinearDrag {
    const STEM: &'static str = "linear_drag";
    const COLUMNS: &'static [Column] = &[Column::number("coefficient")];
    const MERGES: bool = true;
    const NEEDS: Needs = Needs { angular_velocity: true, ..Needs::NOTHING };

    #[inline(always)]
    fn torque<R: Real>(row: &impl Row<R>, _: &Epoch<R>, _: Quaternion<R>, omega: Vector<R>) -> Vector<R> {
        linear_drag(row.number(0), omega)
    }
}
