//! `internal-dissipation`: loss of energy inside the body, which keeps its angular momentum.

use super::formula::{Column, Epoch, Formula, Role, Row};
use crate::quaternion::Quaternion;
use glam::DQuat;

use super::{Border, Kind, Model, Needs, Parameter};
use crate::batch::BodyFrame;
use crate::error::Result;
use crate::real::Real;
use crate::vector::Vector;

/// dm/dt = m × ω + k m × (m × ω): the double-bracket form (A. M. Bloch, P. S. Krishnaprasad, J. E. Marsden,
/// T. S. Ratiu, *The Euler-Poincaré equations and double bracket dissipation*, Comm. Math. Phys. 175 (1996) 1,
/// section 5).
///
/// The energy falls at the rate k |m × ω|² until the body turns about its axis of greatest moment, while |m| stays. It is
/// not a torque, which would turn the angular momentum in the world: the body's axes turn with I⁻¹m + k m × ω instead of
/// I⁻¹m, so that dm/dt is m × that rate and the angular momentum in the world stays as a vector. The velocity
/// that is reported is I⁻¹m.
#[derive(Clone, Debug, PartialEq)]
pub struct InternalDissipation {
    /// k, s/(kg m²), not negative.
    pub coefficient: Parameter<f64>,
}

impl Model for InternalDissipation {
    fn kind(&self) -> Kind {
        Kind::InternalDissipation
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
        out[0] += frame.scaled(self.coefficient.at(body), -1, -1);
    }
}

/// k m × ω, which is added to the rate at which the body's axes turn, in principal axes.
#[inline(always)]
pub fn internal_dissipation<R: Real>(coefficient: R, m: Vector<R>, angular_velocity_principal: Vector<R>) -> Vector<R> {
    m.cross(angular_velocity_principal) * coefficient
}

impl Formula for InternalDissipation {
    const STEM: &'static str = "internal_dissipation";
    const COLUMNS: &'static [Column] = &[Column::number("coefficient")];
    const MERGES: bool = true;
    const ROLE: Role = Role::Slip;
    const NEEDS: Needs = Needs { angular_velocity: true, ..Needs::NOTHING };

    #[inline(always)]
    fn torque<R: Real>(_: &impl Row<R>, _: &Epoch<R>, _: Quaternion<R>, _: Vector<R>) -> Vector<R> {
        Vector::zero()
    }
}
