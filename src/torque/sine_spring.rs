//! `sine-spring`: a torsion spring towards an attitude whose torque is the sine of the angle.

use super::formula::{Column, Epoch, Formula, Row};
use glam::DQuat;

use super::{Border, Kind, Model, Needs, Parameter};
use crate::batch::BodyFrame;
use crate::error::Result;
use crate::quaternion::Quaternion;
use crate::real::Real;
use crate::vector::Vector;

/// τ = −k sin θ n = −2 k s v with (v, s) = conj(q_target) q (B. Wie, P. M. Barba, J. Guid. Control Dyn. 8 (1985) 360,
/// the quaternion feedback, symmetrised so that q and −q feel the same). Smooth everywhere; potential energy k (1 − cos θ).
#[derive(Clone, Debug, PartialEq)]
pub struct SineSpring {
    /// k, N m, not negative.
    pub stiffness: Parameter<f64>,
    /// The attitude at rest: rotates body coordinates to world; normalised here.
    pub target: Parameter<DQuat>,
}

impl Model for SineSpring {
    fn kind(&self) -> Kind {
        Kind::SineSpring
    }

    fn validate(&self, border: &Border) -> Result<()> {
        border.not_negative("stiffness", &self.stiffness)?;
        border.rotation("target", &self.target)
    }

    fn needs(&self) -> Needs {
        Needs { attitude: true, ..Needs::NOTHING }
    }

    fn rate(&self, body: usize, middle_moment: f64) -> f64 {
        (self.stiffness.at(body) / middle_moment).sqrt()
    }

    fn columns(&self, body: usize, frame: &BodyFrame, _: DQuat, out: &mut [f64]) {
        out[0] = frame.scaled(self.stiffness.at(body), 1, 2);
        let target = (self.target.at(body).normalize() * frame.principal_to_body).normalize();
        out[1..5].copy_from_slice(&target.to_array());
    }

    fn potential_energy(&self, body: usize, orientation: DQuat) -> Option<f64> {
        let between = self.target.at(body).normalize().conjugate() * orientation;
        Some(2.0 * self.stiffness.at(body) * between.xyz().length_squared())
    }
}

/// −2 k s v, in principal axes.
#[inline(always)]
pub fn sine_spring<R: Real>(stiffness: R, target: Quaternion<R>, orientation: Quaternion<R>) -> Vector<R> {
    let between = target.conjugate().product(orientation);
    between.vector() * (R::splat(-2.0) * stiffness * between.w)
}

impl Formula for SineSpring {
    const STEM: &'static str = "sine_spring";
    const COLUMNS: &'static [Column] = &[Column::number("stiffness"), Column::quaternion("target")];
    const NEEDS: Needs = Needs { attitude: true, ..Needs::NOTHING };

    #[inline(always)]
    fn torque<R: Real>(row: &impl Row<R>, _: &Epoch<R>, q: Quaternion<R>, _: Vector<R>) -> Vector<R> {
        sine_spring(row.number(0), row.quaternion(1), q)
    }
}
