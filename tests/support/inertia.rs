//! Moments of inertia that change in time, written for scalar numbers of any width.

use glam::DVec3;
use polhode::quaternion::Quaternion;
use polhode::real::Real;
use polhode::rigid_body::{Body, Correction};
use polhode::torque::variable_inertia::{Change, changed_body, inertia_ramp, ramp_progress};
use polhode::torque::{Environment, Motion};
use polhode::vector::{TwoWords, Vector};

use super::double_double::{DoubleDouble, sin_cos};

/// The law of a change.
#[derive(Clone, Copy, Debug)]
pub enum Law {
    /// From `start` over `duration`, s.
    Ramp { start: f64, duration: f64 },
    /// To and fro at `rate`, rad/s.
    Oscillation { rate: f64 },
}

/// A body whose moments go from one triple to another, free of torques, in steps of `dt` from time 0. The law is known to 32
/// digits, so that tests of high orders see the methods alone.
#[derive(Clone, Copy, Debug)]
pub struct Changing {
    pub before: DVec3,
    pub after: DVec3,
    pub law: Law,
    pub dt: f64,
}

impl<R: Real> Environment<R> for Changing {
    /// The number of the step.
    type Start = u64;
    /// The part of the change that is done.
    type Epoch = DoubleDouble;
    const FREE: bool = false;

    fn start(&self, step: u64) -> u64 {
        step
    }

    fn epoch(&self, step: &u64, fraction: f64) -> DoubleDouble {
        let [step, fraction, dt, zero, one] = [*step as f64, fraction, self.dt, 0.0, 1.0].map(DoubleDouble::from);
        let time = (step + fraction) * dt;
        match self.law {
            Law::Ramp { start, duration } => {
                let progress = (time - DoubleDouble::from(start)) / DoubleDouble::from(duration);
                inertia_ramp(ramp_progress(progress, one, zero))
            }
            Law::Oscillation { rate } => {
                let (sin, _) = sin_cos(DoubleDouble::from(0.5 * rate) * time);
                sin * sin
            }
        }
    }

    fn torque(&self, _: &DoubleDouble, _: &Body<R>, _: Quaternion<R>, _: Vector<R>) -> Vector<R> {
        Vector::zero()
    }

    fn motion(&self, done: &DoubleDouble, body: &Body<R>, correction: &Correction<R>, m: Vector<R>) -> Motion<R> {
        let splat = |v: DVec3| v.to_array().map(R::splat);
        let ([x, y, z], [u, v, w], one) = (splat(self.before), splat(self.after), R::splat(1.0));
        let change = Change {
            kappa: Vector::new(x / u, y / v, z / w),
            difference: TwoWords {
                value: Vector::new(one / u - one / x, one / v - one / y, one / w - one / z),
                residue: Vector::zero(),
            },
        };
        let changed = changed_body(body, &change, R::splat(done.hi) + R::splat(done.lo));
        let correction = changed.body.carried_correction(body, correction, changed.ratio, m);
        Motion {
            angular_velocity: changed.body.angular_velocity(m, &correction),
            gyroscopic_term: changed.body.gyroscopic_term(m, &correction),
        }
    }
}
