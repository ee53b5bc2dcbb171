//! How a body's centre of mass moves over a span of time in steps, and how many it takes.

use glam::DVec3;

use super::Accelerations;
use super::adaptive_translation::{MOST_ATTEMPTS, Reached, TOLERANCE};
use super::custom::{CustomForces, Place};
use super::stepped::{Attitude, Centre, Free, NoAttitude, TURN};
use crate::bodies::Ensemble;
use crate::bodies::frame::initial_state;
use crate::bodies::inertia::principal_axes;
use crate::kernel::free_motion::FreeMotion;

/// Evaluations of the forces in a step of order 4, and in an attempt at an adaptive one.
pub(crate) const OF_STEP: f64 = 4.0;
pub(crate) const OF_ATTEMPT: f64 = 12.0;

/// Moves centres of mass over a span of time.
pub(crate) struct Moving<'a> {
    pub custom: &'a CustomForces<'a>,
    pub ensemble: &'a Ensemble,
    /// The factor by which steps are shorter than necessary.
    pub shorter: f64,
    /// s.
    pub start: f64,
    pub span: f64,
}

impl Moving<'_> {
    /// Moves the centre of mass of a body under these and the custom forces while it turns as `attitude` says.
    pub fn advance(&self, centre: &mut Centre, of: (usize, &Accelerations), attitude: &impl Attitude) {
        if self.custom.is_empty() {
            centre.advance_in_steps_shorter_by(self.shorter, of.1, attitude, self.span);
        } else if self.attempted(centre, of, attitude, MOST_ATTEMPTS).time < self.span {
            centre.give_up();
        }
    }

    /// The same for a body that no torque acts on: it turns by its closed form, if a force depends on that.
    pub fn advance_alone(&self, centre: &mut Centre, (body, forces): (usize, &Accelerations)) {
        match self.free_motion(body, forces) {
            Some((motion, rate)) => {
                let free = Free { motion: &motion, rate, start: self.start, span: self.span };
                self.advance(centre, (body, forces), &free);
            }
            None => self.advance(centre, (body, forces), &NoAttitude),
        }
    }

    /// How often the forces on such a body are evaluated over the span, as the first `most` attempts let expect.
    pub fn expected_evaluations(&self, centre: &Centre, (body, forces): (usize, &Accelerations), most: u32) -> f64 {
        match self.free_motion(body, forces) {
            Some((motion, rate)) => {
                let free = Free { motion: &motion, rate, start: self.start, span: self.span };
                self.evaluations_along(centre, (body, forces), &free, most)
            }
            None => self.evaluations_along(centre, (body, forces), &NoAttitude, most),
        }
    }

    fn evaluations_along(
        &self,
        centre: &Centre,
        of: (usize, &Accelerations),
        attitude: &impl Attitude,
        most: u32,
    ) -> f64 {
        if self.custom.is_empty() {
            return OF_STEP * centre.steps_ahead(self.shorter, of.1, attitude, self.span);
        }
        let mut centre = *centre;
        let Reached { attempts, time } = self.attempted(&mut centre, of, attitude, most);
        // The first steps find how long the others may be. If none is accepted, the body fails.
        let others = if centre.next_step > 0.0 { (self.span - time) / centre.next_step } else { 0.0 };
        OF_ATTEMPT * (f64::from(attempts) + others)
    }

    /// The closed form of a body's rotation with the greatest rate (rad/s) at which it turns, if a force depends on that.
    fn free_motion(&self, body: usize, forces: &Accelerations) -> Option<(FreeMotion, f64)> {
        if forces.thrust_body == DVec3::ZERO && !self.custom.need_attitude() {
            return None;
        }
        let least = principal_axes(&self.ensemble.inertia()[body]).moments.x;
        // 2T ≥ I₁ ω².
        let rate = (2.0 * initial_state(self.ensemble, body).kinetic_energy / least).sqrt();
        Some((FreeMotion::of_body(self.ensemble, body), rate))
    }

    /// Moves a centre of mass under custom forces by up to `most` attempts.
    fn attempted(
        &self,
        centre: &mut Centre,
        (body, forces): (usize, &Accelerations),
        attitude: &impl Attitude,
        most: u32,
    ) -> Reached {
        let &Self { custom, shorter, start, span, .. } = self;
        let mass = self.ensemble.translation().map_or(f64::NAN, |translation| translation.mass[body]);
        let mut own = custom.on_body(body, mass);
        let turns = custom.need_attitude();
        let acceleration = |elapsed: f64, position: DVec3, velocity: DVec3| {
            let fraction = elapsed / span;
            let orientation = attitude.at(fraction);
            let angular_velocity_body = if turns { attitude.angular_velocity_at(fraction) } else { DVec3::ZERO };
            let place = Place { orientation, angular_velocity_body, time: start + elapsed, position, velocity };
            forces.at(orientation, velocity) + own.acceleration(&place)
        };
        // The first step follows the rate of the rotation; the error decides the following ones.
        let first = span * (attitude.longest() / TURN).min(1.0);
        centre.advance_adaptively(acceleration, (span, first), TOLERANCE / shorter.powi(5), most)
    }
}
