//! Translation under forces that depend on velocity or attitude, in steps.
//!
//! The classical Runge-Kutta method of order 4 on (x, v), with the attitude at the start, the middle and the end of each
//! step: as the rotation does not depend on the translation, it is known beforehand. For a torque-free body it is exact
//! ([`crate::kernel::free_motion`]). For a stepped body it is interpolated between its states before and after a step by the cubic
//! that has their orientations and rates of change ½ q ω (C. Hermite, J. reine angew. Math. 84 (1878) 70), whose error
//! is of order 4 in that step.
//!
//! Steps are as long as the velocity's own rate and the attitude's allow ([`DRAG_ANGLE`], [`TURN`]). Position and velocity
//! are summed in two words (Kahan), so that a million steps cost no digits. Twin, of steps along a stepped rotation:
//! `shaders/force/stepped.wgsl`.

use glam::{DQuat, DVec3};

use super::{Accelerations, quadratic_drag};
use crate::kernel::free_motion::FreeMotion;

/// The greatest product of step and rate at which drag changes the velocity: the error of order 4 is then below 1e-9 of the velocity while
/// it changes by its own size.
pub const DRAG_ANGLE: f64 = 1.0 / 64.0;

/// The greatest angle (rad) by which a body turns in a step: the error of order 4 is then below (1/32)⁴/2880 = 4e-10 of the thrust's
/// acceleration.
pub const TURN: f64 = 1.0 / 32.0;

/// A centre of mass that is being stepped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Centre {
    position: DVec3,
    position_residue: DVec3,
    velocity: DVec3,
    velocity_residue: DVec3,
    /// The next step of adaptive stepping ([`crate::torque::force::adaptive_translation`]), s; 0 before the first.
    pub(super) next_step: f64,
}

/// Orientations (body to world) over a span of time, at fractions of it from 0 to 1.
pub trait Attitude {
    /// The orientation at a fraction of the span.
    fn at(&self, fraction: f64) -> DQuat;

    /// The greatest part of the span in which the body turns by no more than [`TURN`]; one if the attitude does not matter.
    fn longest(&self) -> f64;

    /// The angular velocity at a fraction of the span, rad/s, body axes.
    fn angular_velocity_at(&self, fraction: f64) -> DVec3;
}

/// An attitude for forces that do not depend on it.
pub struct NoAttitude;

impl Attitude for NoAttitude {
    fn at(&self, _: f64) -> DQuat {
        DQuat::IDENTITY
    }

    fn longest(&self) -> f64 {
        1.0
    }

    fn angular_velocity_at(&self, _: f64) -> DVec3 {
        DVec3::ZERO
    }
}

/// The attitude of a torque-free body, from `start` (s) over `span`.
pub struct Free<'a> {
    /// Its motion.
    pub motion: &'a FreeMotion,
    /// The greatest rate (rad/s) at which it can turn.
    pub rate: f64,
    /// Start of the span, s.
    pub start: f64,
    /// The span, s.
    pub span: f64,
}

impl Attitude for Free<'_> {
    fn at(&self, fraction: f64) -> DQuat {
        self.motion.at(self.start + fraction * self.span).orientation
    }

    fn longest(&self) -> f64 {
        TURN / (self.rate * self.span)
    }

    fn angular_velocity_at(&self, fraction: f64) -> DVec3 {
        self.motion.at(self.start + fraction * self.span).angular_velocity_body
    }
}

/// The cubic between the states before and after one step of a rotation.
pub struct Between {
    start: DQuat,
    start_rate: DQuat,
    end: DQuat,
    end_rate: DQuat,
    span: f64,
}

impl Between {
    /// The cubic over a step of `span` seconds between two orientations (body to world), each with the angular velocity
    /// (rad/s, body axes) at which the body turns there.
    pub fn new((start, start_omega): (DQuat, DVec3), (end, end_omega): (DQuat, DVec3), span: f64) -> Self {
        let rate = |q: DQuat, omega: DVec3| q.mul_quat(DQuat::from_xyzw(omega.x, omega.y, omega.z, 0.0)) * (0.5 * span);
        // Both signs are the same orientation; take the nearer one.
        let end = if start.dot(end) < 0.0 { -end } else { end };
        Self { start, start_rate: rate(start, start_omega), end, end_rate: rate(end, end_omega), span }
    }
}

impl Attitude for Between {
    fn at(&self, s: f64) -> DQuat {
        let r = 1.0 - s;
        let (start, end) = (r * r * (1.0 + 2.0 * s), s * s * (1.0 + 2.0 * r));
        let sum = self.start * start + self.end * end + self.start_rate * (s * r * r) + self.end_rate * (-s * s * r);
        sum.normalize()
    }

    fn longest(&self) -> f64 {
        1.0
    }

    /// 2 q* dq/dt of the cubic.
    fn angular_velocity_at(&self, s: f64) -> DVec3 {
        let r = 1.0 - s;
        let rise = 6.0 * s * r;
        let rate = (self.end - self.start) * rise
            + self.start_rate * (r * (r - 2.0 * s))
            + self.end_rate * (s * (s - 2.0 * r));
        let turning = self.at(s).conjugate().mul_quat(rate);
        DVec3::new(turning.x, turning.y, turning.z) * (2.0 / self.span)
    }
}

impl Centre {
    /// A centre of mass at a position (m) and velocity (m/s), world axes.
    pub fn new(position: DVec3, velocity: DVec3) -> Self {
        Self { position, position_residue: DVec3::ZERO, velocity, velocity_residue: DVec3::ZERO, next_step: 0.0 }
    }

    /// Position, m, world axes.
    pub fn position(&self) -> DVec3 {
        self.position
    }

    /// Velocity, m/s, world axes.
    pub fn velocity(&self) -> DVec3 {
        self.velocity
    }

    /// Advances by `span` seconds while the body turns as `attitude` says.
    pub fn advance(&mut self, forces: &Accelerations, attitude: &impl Attitude, span: f64) {
        self.advance_in_steps_shorter_by(1.0, forces, attitude, span);
    }

    /// As [`Centre::advance`], in steps shortened by a factor.
    pub(crate) fn advance_in_steps_shorter_by(
        &mut self,
        factor: f64,
        forces: &Accelerations,
        attitude: &impl Attitude,
        span: f64,
    ) {
        let driving = driving(forces);
        let mut fraction = 0.0;
        // A velocity that is NaN ends the loop after its step, as every comparison with it is false.
        while fraction < 1.0 {
            let longest = self.longest(forces, driving, attitude, span) / factor;
            // As many equal steps as would reach the end, so that no sliver is left.
            let left = 1.0 - fraction;
            let steps = (left / longest).ceil();
            let next = fraction + left / steps;
            // If the rate is too great, a fraction cannot express the step.
            let end = if steps > 1.0 && next > fraction { next } else { 1.0 };
            self.step(forces, [fraction, 0.5 * (fraction + end), end].map(|s| attitude.at(s)), (end - fraction) * span);
            fraction = end;
        }
    }

    /// How many steps that takes if drag stays as it is.
    pub(crate) fn steps_ahead(&self, factor: f64, forces: &Accelerations, attitude: &impl Attitude, span: f64) -> f64 {
        (factor / self.longest(forces, driving(forces), attitude, span)).ceil()
    }

    /// The greatest part of a span that a step may take.
    fn longest(&self, forces: &Accelerations, driving: f64, attitude: &impl Attitude, span: f64) -> f64 {
        let rate = forces.linear_drag + quadratic_drag::rate(forces.quadratic_drag, self.velocity, driving);
        attitude.longest().min(DRAG_ANGLE / (rate * span))
    }

    /// One step of `h` seconds; the attitudes are those at its start, middle and end.
    fn step(&mut self, forces: &Accelerations, [start, middle, end]: [DQuat; 3], h: f64) {
        let v = self.velocity;
        let k1 = forces.at(start, v);
        let k2 = forces.at(middle, v + k1 * (0.5 * h));
        let k3 = forces.at(middle, v + k2 * (0.5 * h));
        let k4 = forces.at(end, v + k3 * h);
        let path = v * h + (self.velocity_residue * h + (k1 + k2 + k3) * (h * h / 6.0));
        self.accumulate(path, (k1 + (k2 + k3) * 2.0 + k4) * (h / 6.0));
    }

    /// Adds to position and velocity, in two words.
    pub(super) fn accumulate(&mut self, path: DVec3, change: DVec3) {
        accumulate(&mut self.position, &mut self.position_residue, path);
        accumulate(&mut self.velocity, &mut self.velocity_residue, change);
    }

    /// Marks it as lost.
    pub(super) fn give_up(&mut self) {
        (self.position, self.velocity) = (DVec3::NAN, DVec3::NAN);
    }
}

/// The acceleration, m/s², that drag does not oppose at rest.
fn driving(forces: &Accelerations) -> f64 {
    forces.constant_world.length() + forces.thrust_body.length()
}

/// Kahan's sum, as [`crate::math::vector::accumulate`] in `f32`.
fn accumulate(sum: &mut DVec3, residue: &mut DVec3, increment: DVec3) {
    let corrected = increment + *residue;
    let next = *sum + corrected;
    *residue = corrected - (next - *sum);
    *sum = next;
}
