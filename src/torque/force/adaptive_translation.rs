//! Translation in adaptive steps, under forces of which only values are known.
//!
//! Dormand and Prince's Runge-Kutta method of order 8 with its embedded formulas of orders 5 and 3 on (x, v), with the controller of DOP853
//! (E. Hairer, S. P. Nørsett, G. Wanner, *Solving Ordinary Differential Equations I*, 2nd ed. (1993), section II.5 and appendix); the
//! coefficients are those of [`crate::kernel::method::rk8`]. The error of a step is measured relative to the size of position and velocity,
//! and to the increments of the step, so that neither units nor the position of the origin matter. Differences from the source: that
//! measure; no stabilised control; increments are added in two words.

use glam::DVec3;

use super::stepped::Centre;
use crate::kernel::method::rk8::{ERROR_WEIGHTS_5, STAGE_WEIGHTS, STAGES, TIMES, WEIGHTS};
use crate::kernel::method::rk8_adaptive::ERROR_WEIGHTS_3;

/// The error of a step, relative to position and velocity.
pub const TOLERANCE: f64 = 1e-12;

/// The most attempts of one body between two output times; one that needs more is given up, and its velocity becomes NaN.
pub(crate) const MOST_ATTEMPTS: u32 = 10_000_000;

/// The part of a span below which no step is tried: a body whose step of that length is rejected is given up too.
const LEAST_PART: f64 = 1e-15;

/// The least factor between one step and the next.
const LEAST_FACTOR: f64 = 0.2;

/// What steps have reached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Reached {
    pub attempts: u32,
    /// Since the start, s: the whole span, unless the attempts did not suffice or a step was too short.
    pub time: f64,
}

/// Position and velocity, or their rates.
#[derive(Clone, Copy, Debug)]
struct Pair {
    x: DVec3,
    v: DVec3,
}

/// Σ wⱼ kⱼ.
fn weighted(weights: &[f64], slopes: &[Pair]) -> Pair {
    let zero = Pair { x: DVec3::ZERO, v: DVec3::ZERO };
    let terms = weights.iter().zip(slopes).filter(|(weight, _)| **weight != 0.0);
    terms.fold(zero, |sum, (&weight, slope)| Pair { x: sum.x + slope.x * weight, v: sum.v + slope.v * weight })
}

impl Centre {
    /// Advances by up to `span` seconds and `most` attempts under an acceleration (m/s², world axes), a function of the time since the start (s),
    /// position and velocity. The first step is at most `longest`.
    pub(crate) fn advance_adaptively(
        &mut self,
        mut acceleration: impl FnMut(f64, DVec3, DVec3) -> DVec3,
        (span, longest): (f64, f64),
        tolerance: f64,
        most: u32,
    ) -> Reached {
        // An output at the start, or a body that is lost.
        if span == 0.0 || self.velocity().is_nan() {
            return Reached { attempts: 0, time: span };
        }
        let mut done = 0.0;
        let mut next = if self.next_step > 0.0 { self.next_step } else { longest };
        for attempts in 1..=most {
            let left = span - done;
            // As many equal steps as would reach the end, so that no sliver is left.
            let h = if next < left { left / (left / next).ceil() } else { left };
            let (increment, error) = attempt(self, &mut acceleration, done, h, tolerance);
            let is_last = h >= left;
            let factor = (0.9 * error.powf(-0.125)).clamp(LEAST_FACTOR, 6.0);
            // Where a force begins to act on a centre at rest, the error of a step is as great as all that it has gained, however short it is.
            let begins = || LEAST_FACTOR * h < LEAST_PART * span && increment.v.length() >= self.velocity().length();
            if error <= 1.0 || (error.is_finite() && begins()) {
                self.accumulate(increment.x, increment.v);
                done += h;
                // A step that was cut at the end says little about the next one.
                self.next_step = if is_last { next.max(h * factor) } else { h * factor };
                if is_last {
                    return Reached { attempts, time: span };
                }
                next = self.next_step;
            } else {
                // NaN is rejected too.
                next = h * if factor < 1.0 { factor } else { LEAST_FACTOR };
                if next < LEAST_PART * span {
                    return Reached { attempts, time: done };
                }
            }
        }
        Reached { attempts: most, time: done }
    }
}

/// One step: its increment, and its error in units of the tolerance.
fn attempt(
    centre: &Centre,
    acceleration: &mut impl FnMut(f64, DVec3, DVec3) -> DVec3,
    start: f64,
    h: f64,
    tolerance: f64,
) -> (Pair, f64) {
    let (x, v) = (centre.position(), centre.velocity());
    let mut slopes = [Pair { x: v, v: DVec3::ZERO }; STAGES];
    slopes[0].v = acceleration(start, x, v);
    for stage in 1..STAGES {
        let sum = weighted(&STAGE_WEIGHTS[stage - 1][..stage], &slopes);
        let (position, velocity) = (x + sum.x * h, v + sum.v * h);
        slopes[stage] = Pair { x: velocity, v: acceleration(start + TIMES[stage] * h, position, velocity) };
    }
    let rate = weighted(&WEIGHTS, &slopes);
    let (fifth, third) = (weighted(&ERROR_WEIGHTS_5, &slopes), weighted(&ERROR_WEIGHTS_3, &slopes));
    let increment = Pair { x: rate.x * h, v: rate.v * h };
    let size =
        |value: DVec3, increment: DVec3| value.length().max((value + increment).length()).max(increment.length());
    let (size_x, size_v) = (size(x, increment.x), size(v, increment.v));
    // A body at rest in a place where no force acts has no error.
    let squared = |error: DVec3, size: f64| {
        let length = error.length();
        if length == 0.0 { 0.0 } else { (length / (tolerance * size)).powi(2) }
    };
    let of = |error: Pair| squared(error.x * h, size_x) + squared(error.v * h, size_v);
    let (e5, e3) = (of(fifth), of(third));
    let sum = e5 + 0.01 * e3;
    let error = if sum == 0.0 { 0.0 } else { e5 / (2.0 * sum).sqrt() };
    (increment, error)
}
