//! Centres of mass that an engine advances with its steps of the rotation, as columns.
//!
//! The steps are those of [`super::stepped`]: in each step of the rotation, as many as drag requires. In `f32` position and
//! velocity are carried in two words, so that a position far from the origin keeps the increments of a step.

use glam::DVec3;

use super::Accelerations;
use super::quadratic_drag::rate;
use super::stepped::DRAG_ANGLE;

/// Parameter columns of the forces on a body: constant acceleration (world axes), linear drag, quadratic drag, thrust
/// (principal axes), all per unit mass, in SI units.
pub(crate) const FORCE_COLUMNS: usize = 8;

/// State columns of a centre of mass, counting each number once: position (m), velocity (m/s), world axes.
pub const CENTRE_COMPONENTS: usize = 6;

/// The most steps of a centre of mass that an engine takes in one step of the rotation.
pub(crate) const MOST_PARTS: u32 = 1024;

/// A centre of mass with the forces on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Carried {
    /// The forces, [`Accelerations::thrust_body`] in principal axes.
    pub forces: Accelerations,
    /// Position, m, world axes.
    pub position: DVec3,
    /// Velocity, m/s, world axes.
    pub velocity: DVec3,
}

impl Carried {
    pub(crate) fn parameters(&self) -> [f64; FORCE_COLUMNS] {
        let Accelerations { constant_world: a, linear_drag, quadratic_drag, thrust_body: f } = self.forces;
        [a.x, a.y, a.z, linear_drag, quadratic_drag, f.x, f.y, f.z]
    }

    pub(crate) fn state(&self) -> [f64; CENTRE_COMPONENTS] {
        let (x, v) = (self.position, self.velocity);
        [x.x, x.y, x.z, v.x, v.y, v.z]
    }

    /// The most steps in one step of the rotation of `dt` seconds, at any time: under quadratic drag a velocity does not grow
    /// beyond the greater of its initial value and that at which drag balances all driving forces.
    pub(crate) fn most_parts(&self, dt: f64) -> f64 {
        let Accelerations { constant_world, linear_drag, quadratic_drag, thrust_body } = self.forces;
        let driving = constant_world.length() + thrust_body.length();
        let settled = if quadratic_drag > 0.0 { (driving / quadratic_drag).sqrt() } else { 0.0 };
        let fastest = DVec3::X * self.velocity.length().max(settled);
        // One more, as a quotient next to a whole number is rounded.
        ((linear_drag + rate(quadratic_drag, fastest, driving)) * dt / DRAG_ANGLE).ceil() + 1.0
    }
}
