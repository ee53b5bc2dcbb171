//! `heavy-top`: gravity on a body that turns about a fixed pivot.

use super::formula::{Column, Epoch, Formula, Row};
use glam::{DQuat, DVec3};

use super::{Border, Kind, Model, Needs, Parameter};
use crate::batch::BodyFrame;
use crate::error::Result;
use crate::quaternion::Quaternion;
use crate::real::Real;
use crate::vector::Vector;

/// τ = c × Rᵀ (M g), c from the pivot to the centre of mass (Lagrange, *Mécanique analytique*, 1788; F. Klein,
/// A. Sommerfeld, *Über die Theorie des Kreisels*, 1897, chapter IV). Potential energy: −M g · R c.
///
/// The body's inertia tensor is the one about the pivot.
#[derive(Clone, Debug, PartialEq)]
pub struct HeavyTop {
    /// M, kg, not negative.
    pub mass: Parameter<f64>,
    /// c in body axes, m.
    pub centre_body: Parameter<DVec3>,
    /// g in world axes, m/s².
    pub gravity_world: Parameter<DVec3>,
}

impl Model for HeavyTop {
    fn kind(&self) -> Kind {
        Kind::HeavyTop
    }

    fn validate(&self, border: &Border) -> Result<()> {
        border.not_negative("mass", &self.mass)?;
        border.finite("centre_body", &self.centre_body)?;
        border.finite("gravity_world", &self.gravity_world)
    }

    fn needs(&self) -> Needs {
        Needs { attitude: true, ..Needs::NOTHING }
    }

    fn rate(&self, body: usize, middle_moment: f64) -> f64 {
        (self.moment_body(body).length() / middle_moment).sqrt()
    }

    fn columns(&self, body: usize, frame: &BodyFrame, _: DQuat, out: &mut [f64]) {
        let moment = frame.scaled_torque(frame.to_principal(self.moment_body(body)));
        out[..3].copy_from_slice(&moment.to_array());
        out[3..6].copy_from_slice(&self.gravity_world.at(body).normalize_or_zero().to_array());
    }

    fn potential_energy(&self, body: usize, orientation: DQuat) -> Option<f64> {
        let centre_world = orientation * self.centre_body.at(body);
        Some(-self.mass.at(body) * self.gravity_world.at(body).dot(centre_world))
    }
}

impl HeavyTop {
    /// M |g| c in body axes, N m.
    fn moment_body(&self, body: usize) -> DVec3 {
        self.centre_body.at(body) * (self.mass.at(body) * self.gravity_world.at(body).length())
    }
}

/// c' × Rᵀ d, in principal axes: c' = M |g| c, d the direction of gravity.
#[inline(always)]
pub fn heavy_top<R: Real>(
    moment_principal: Vector<R>,
    direction_world: Vector<R>,
    orientation: Quaternion<R>,
) -> Vector<R> {
    moment_principal.cross(orientation.rotate_inverse(direction_world))
}

impl Formula for HeavyTop {
    const STEM: &'static str = "heavy_top";
    const COLUMNS: &'static [Column] = &[Column::vector("moment_principal"), Column::vector("direction_world")];
    const NEEDS: Needs = Needs { attitude: true, ..Needs::NOTHING };

    #[inline(always)]
    fn torque<R: Real>(row: &impl Row<R>, _: &Epoch<R>, q: Quaternion<R>, _: Vector<R>) -> Vector<R> {
        heavy_top(row.vector(0), row.vector(3), q)
    }
}
