//! From an error asked for to method, arithmetic and step, body by body.

use super::class::{Bound, FreeBody, Shape, Verdict};
use super::driven::TorqueSet;
use crate::batch::{Precision, prepare_body};
use crate::method::Method;
use crate::scene::{Accuracy, Scene};
use crate::torque;

/// How a class is stepped where an error is asked for: the attitude error of a body that turns by an angle α in steps that
/// turn it by θ is taken as `coefficient` θ^order α.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rule {
    /// The integrator.
    pub method: Method,
    /// The coefficient.
    pub coefficient: f64,
    /// No step turns a body further than this, rad.
    pub longest_angle: f64,
    /// The error, rad.
    pub attitude: f64,
    /// The arithmetic; `None` takes `f32` for each body for which [`floor_f32`] is below the error.
    pub precision: Option<Precision>,
}

impl Rule {
    /// The longest step, s, of a body that turns at up to `rate` rad/s over `span` s.
    pub fn longest_step(&self, rate: f64, span: f64) -> f64 {
        let angle = rate * span;
        if angle <= 0.0 {
            return span;
        }
        let order = f64::from(self.method.order());
        let theta = (self.attitude / (self.coefficient * angle)).powf(order.recip()).min(self.longest_angle);
        (theta / rate).min(span)
    }
}

/// What `f32` cannot undercut for a body that turns by `angle` rad: rounding of the state, and of the rates.
pub fn floor_f32(angle: f64) -> f64 {
    1e-6 + 3e-8 * angle
}

/// The greatest attitude error, rad, of the closed form in `f32` (`tests/golden_free_motion.rs`), at any time.
pub const CLOSED_FORM_F32: f64 = 1e-6;

/// The part of an error asked for that a simpler class may take up.
pub const SKIP_SHARE: f64 = 1.0 / 16.0;

/// The tolerance of the classes.
pub fn skip_tolerance(accuracy: &Accuracy) -> Bound {
    let share = |target: Option<f64>| target.map_or(f64::INFINITY, |target| SKIP_SHARE * target);
    Bound {
        attitude: share(accuracy.attitude),
        angular_velocity: share(accuracy.angular_velocity),
        energy: share(accuracy.energy),
    }
}

/// What a plan wants to know of one body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Look {
    pub torques: TorqueSet,
    pub verdict: Verdict,
    /// The greatest rate, rad/s, that its step must follow.
    pub rate: f64,
}

/// Looks at one body of a scene.
pub(super) fn look_at(scene: &Scene, body: usize, tolerance: &Bound) -> Look {
    let torques = TorqueSet::acting_on(scene.torques(), body);
    let (frame, state) = prepare_body(scene.ensemble(), scene.torques(), body);
    let unit = crate::batch::scaled_by_power_of_two(1.0, frame.rate_exponent);
    let m = glam::DVec3::new(state[4], state[5], state[6]);
    let free = FreeBody { moments: frame.scaled_moments, angular_momentum_principal: m, span: scene.end() * unit };
    let spin = (m / frame.scaled_moments).length() * unit;
    if torques.is_empty() {
        return Look { torques, verdict: free.verdict(tolerance), rate: spin };
    }
    let middle = crate::batch::scaled_by_power_of_two(frame.scaled_moments.y, frame.moment_exponent);
    let growth = torque::variable_inertia::spin_growth(scene.torques(), body, &scene.ensemble().inertia()[body]);
    let rate = (spin * growth).max(torque::rate_of(scene.torques(), body, middle));
    let verdict = Verdict { shape: Shape::Asymmetric, axis: 0, bound: Bound::default() };
    Look { torques, verdict, rate }
}

/// The narrowest arithmetic that reaches an attitude error over an angle.
pub(super) fn narrowest(attitude: f64, angle: f64) -> Precision {
    if attitude >= floor_f32(angle) { Precision::F32 } else { Precision::F64 }
}
