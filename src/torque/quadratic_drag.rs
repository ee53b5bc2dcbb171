//! `quadratic-drag`: a torque against the angular velocity that grows with its square, the same about every axis.

use super::formula::{Column, Epoch, Formula, Row};
use crate::quaternion::Quaternion;
use glam::DQuat;

use super::{Border, Kind, Model, Needs, Parameter};
use crate::batch::BodyFrame;
use crate::error::Result;
use crate::real::Real;
use crate::vector::Vector;

/// τ = −c |ω| ω, the form at large Reynolds numbers (Newton, *Principia*, 1687, book II, section II, for a
/// translation). Several add up to one.
#[derive(Clone, Debug, PartialEq)]
pub struct QuadraticDrag {
    /// c, N m s², not negative.
    pub coefficient: Parameter<f64>,
}

impl Model for QuadraticDrag {
    fn kind(&self) -> Kind {
        Kind::QuadraticDrag
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
        out[0] += frame.scaled(self.coefficient.at(body), 1, 0);
    }
}

/// −c |ω| ω, in principal axes.
#[inline(always)]
pub fn quadratic_drag<R: Real>(coefficient: R, angular_velocity_principal: Vector<R>) -> Vector<R> {
    let speed = angular_velocity_principal.dot(angular_velocity_principal).sqrt();
    -(angular_velocity_principal * (coefficient * speed))
}

impl Formula for QuadraticDrag {
    const STEM: &'static str = "quadratic_drag";
    const COLUMNS: &'static [Column] = &[Column::number("coefficient")];
    const MERGES: bool = true;
    const NEEDS: Needs = Needs { angular_velocity: true, ..Needs::NOTHING };

    #[inline(always)]
    fn torque<R: Real>(row: &impl Row<R>, _: &Epoch<R>, _: Quaternion<R>, omega: Vector<R>) -> Vector<R> {
        quadratic_drag(row.number(0), omega)
    }
}
