//! The choice of method, arithmetic and step for each body, from the error asked for.

use glam::DVec3;

use super::class::{Bound, FreeBody, Shape, Verdict};
use super::driven::{ActingTorques, TorqueSet};
use super::group::Treatment;
use crate::bodies::BodyFrame;
use crate::engine::batch::frame_of;
use crate::kernel::free_motion::Aligned;
use crate::kernel::method::Method;
use crate::kernel::method::rk8_adaptive::least_tolerance;
use crate::kernel::method::taylor::LEAST_OF_SERIES;
use crate::math::Precision;
use crate::math::power_of_two::scaled_by_power_of_two;
use crate::scene::AdaptiveSteps;
use crate::scene::{Accuracy, Scene};
use crate::torque::{self, Torque};

/// What kind of steps is taken, and how long they are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scheme {
    /// A method in equal steps, whose length follows from a body's rate at the start.
    Equal(Method),
    /// One of [`Method::ADAPTIVE`] in steps that each body chooses by its own estimate of their errors.
    Adaptive(Method),
}

impl Scheme {
    /// `rk8` in adaptive steps, in either arithmetic and on every engine.
    pub(super) const ADAPTIVE_RK8: Self = Scheme::Adaptive(Method::Rk8);
    /// Taylor series, in `f64` and on the CPU.
    pub(crate) const TAYLOR: Self = Scheme::Adaptive(Method::Taylor);

    /// The integrator.
    pub fn method(self) -> Method {
        match self {
            Scheme::Equal(method) | Scheme::Adaptive(method) => method,
        }
    }

    /// The angle, rad, by which an adaptive step turns the body at a tolerance, roughly.
    pub(super) fn angle_of_attempt(self, tolerance: f64) -> f64 {
        if self == Scheme::TAYLOR { TAYLOR_ANGLE } else { ADAPTIVE_ANGLE * tolerance.powf(0.125) }
    }

    /// The least tolerance of its adaptive steps. That of series, which leave out less than rounding, is a little above that of the series which
    /// recompute a sample.
    pub(super) fn least_tolerance(self, precision: Precision) -> f64 {
        if self == Scheme::TAYLOR { 10.0 * LEAST_OF_SERIES } else { least_tolerance(precision) }
    }

    /// Whether bodies choose their steps.
    pub fn is_adaptive(self) -> bool {
        matches!(self, Scheme::Adaptive(_))
    }

    /// The name in tables and plans.
    pub fn name(self) -> &'static str {
        match self {
            Scheme::ADAPTIVE_RK8 => ADAPTIVE,
            Scheme::Equal(method) | Scheme::Adaptive(method) => method.name(),
        }
    }

    /// The scheme with this name.
    #[cfg(feature = "study")]
    pub(super) fn named(name: &str) -> Option<Self> {
        let adaptive = Method::ADAPTIVE.into_iter().map(Scheme::Adaptive);
        let mut all = Method::ALL.into_iter().map(Scheme::Equal).chain(adaptive);
        all.find(|scheme| scheme.name() == name)
    }
}

impl Treatment {
    /// What kind of steps is taken, and in which arithmetic; `None` if none are.
    pub(super) fn steps(&self) -> Option<(Scheme, Precision)> {
        match *self {
            Treatment::Stepped { method, precision, .. } => Some((Scheme::Equal(method), precision)),
            Treatment::Adaptive { method, precision, .. } => Some((Scheme::Adaptive(method), precision)),
            Treatment::RegularPrecession | Treatment::ClosedForm { .. } => None,
        }
    }
}

/// How a class is stepped where an error is asked for.
///
/// In equal steps of θ rad, a body that turns by α rad is taken to have the attitude error `coefficient` θ^order α; in adaptive steps,
/// `coefficient` times the tolerance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rule {
    /// The integrator, and whether its steps are equal.
    pub scheme: Scheme,
    /// The coefficient.
    pub coefficient: f64,
    /// No equal step turns a body further than this, rad.
    pub longest_angle: f64,
    /// The error, rad.
    pub attitude: f64,
    /// The arithmetic; `None` takes `f32` for each body for which [`floor_f32`] is below the error.
    pub precision: Option<Precision>,
}

impl Rule {
    /// The longest step, s, of a body that turns at up to `rate` rad/s over `span` s; the span itself where bodies choose their steps.
    pub fn longest_step(&self, rate: f64, span: f64) -> f64 {
        let angle = rate * span;
        let Scheme::Equal(method) = self.scheme else { return span };
        if angle <= 0.0 {
            return span;
        }
        let order = f64::from(method.order());
        let theta = (self.attitude / (self.coefficient * angle)).powf(order.recip()).min(self.longest_angle);
        (theta / rate).min(span)
    }

    /// The tolerance of adaptive steps.
    pub fn tolerance(&self, precision: Precision) -> f64 {
        (self.attitude / self.coefficient).clamp(self.scheme.least_tolerance(precision), GREATEST_TOLERANCE)
    }

    /// Whether `other` leads to the same adaptive steps in `precision`, because both tolerances are clamped to the same limit.
    pub(super) fn adapts_like(&self, other: &Rule, precision: Precision) -> bool {
        self.scheme.is_adaptive() && self.tolerance(precision) == other.tolerance(precision)
    }

    /// A rule whose tolerance in `f64` is somewhat looser.
    pub(super) fn loosened(&self) -> Self {
        Self { coefficient: self.attitude / (1.25 * self.tolerance(Precision::F64)), ..*self }
    }

    /// The treatment of bodies stepped by this rule, in steps of at most `longest_step` s.
    pub(super) fn treatment(&self, precision: Precision, longest_step: f64) -> Treatment {
        match self.scheme {
            Scheme::Equal(method) => Treatment::Stepped { method, precision, longest_step, projected: false },
            Scheme::Adaptive(method) => {
                let steps = AdaptiveSteps { tolerance: self.tolerance(precision), least_step: None };
                Treatment::Adaptive { method, precision, steps }
            }
        }
    }

    /// The expected number of steps of a body that turns by `angle` rad, for bodies whose angle is known before they are stepped.
    pub(super) fn expected_attempts(&self, precision: Precision, angle: f64) -> f64 {
        1.0 + angle / self.scheme.angle_of_attempt(self.tolerance(precision))
    }
}

/// Beyond this tolerance, the error of one step says little about the error after many.
const GREATEST_TOLERANCE: f64 = 1e-2;

/// The angle, rad, by which one step by Taylor series turns a body, at any tolerance, since the order adapts to the tolerance: 1 rad where
/// torques depend on the attitude, up to 2 where none does.
const TAYLOR_ANGLE: f64 = 1.5;

/// The angle, rad, by which an adaptive step of `rk8` would turn a body at tolerance 1, extrapolated with the eighth root; within a third
/// of what the bodies of `polhode bench accuracy` take.
const ADAPTIVE_ANGLE: f64 = 6.0;

/// The attitude error, rad, that `f32` cannot undercut for a body that turns by `angle` rad: rounding of the state and of the rates.
pub fn floor_f32(angle: f64) -> f64 {
    1e-6 + 3e-8 * angle
}

/// What a report calls the closed form in the place of a method's name.
pub(crate) const CLOSED_FORM: &str = "closed form";
/// What tables call `rk8` in adaptive steps.
pub(crate) const ADAPTIVE: &str = "rk8 adaptive";

/// The greatest attitude error, rad, of the closed form in `f32` (`tests/truth/golden_free_motion.rs`), at any time.
pub const CLOSED_FORM_F32: f64 = 9e-7;
/// The same in `f64`.
pub(super) const CLOSED_FORM_F64: f64 = 1e-14;

/// The part of the error asked for that a simpler class may use up.
pub const SKIP_SHARE: f64 = 1.0 / 16.0;

/// The least error that can be asked for where the closed form errs by `evaluated`, given that a simpler class may use up part of it.
pub(super) fn least_target(evaluated: f64) -> f64 {
    evaluated / (1.0 - SKIP_SHARE)
}

/// The bound within which a body counts as a member of a simpler class. Where no attitude is asked for, it is bounded by the least of the other
/// errors: a body that turns is never taken to be at rest.
pub fn skip_tolerance(accuracy: &Accuracy) -> Bound {
    let share = |target: Option<f64>| target.map_or(f64::INFINITY, |target| SKIP_SHARE * target);
    Bound {
        attitude: SKIP_SHARE * accuracy.attitude.unwrap_or_else(|| accuracy.strictest()),
        angular_velocity: share(accuracy.angular_velocity),
        energy: share(accuracy.energy),
    }
}

/// What a plan needs to know about one body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Classification {
    pub torques: TorqueSet,
    pub verdict: Verdict,
    /// The error of a closed form whose constants are formed in one word; [`Bound::NONE`] for a body that has no closed form, or a simpler
    /// one.
    pub set_up: Bound,
    /// The greatest rate, rad/s, that the body's step must follow; 0 if it is not stepped.
    pub rate: f64,
}

/// Classifies one body of a scene.
pub(super) fn classify(
    (scene, acting): (&Scene, &ActingTorques<'_>),
    body: usize,
    tolerance: &Bound,
) -> Classification {
    let torques = acting.on(body);
    let (ensemble, is_free) = (scene.ensemble(), torques.is_empty());
    // A body that is not stepped needs no step that follows its rate.
    if is_free
        && scene.may_skip()
        && let Some(free) = aligned(scene, body)
    {
        return classify_free(&free, tolerance, true, 0.0);
    }
    // Torques that do not act contribute no rate.
    let torques_of_units = if is_free { &[] } else { scene.torques() };
    let (frame, driven_rate) = frame_of(ensemble, torques_of_units, scene.end(), body);
    let m = frame.angular_momentum_principal(ensemble, body);
    let rate = || greatest_rate(scene, body, (&frame, driven_rate), m);
    if is_free {
        let span = span_of(scene, frame.rate_exponent);
        let free = FreeBody { moments: frame.scaled_moments, angular_momentum_principal: m, span };
        let rate = if scene.may_skip() { 0.0 } else { rate() };
        return classify_free(&free, tolerance, ensemble.inertia()[body].is_diagonal(), rate);
    }
    let verdict = Verdict { shape: Shape::Asymmetric, axis: 0, bound: Bound::default() };
    Classification { torques, verdict, set_up: Bound::NONE, rate: rate() }
}

/// The body as a free one, if no torque acts on it, its principal axes lie along its body axes and it is no linear rotor.
#[inline]
pub(super) fn aligned(scene: &Scene, body: usize) -> Option<FreeBody> {
    if scene.ensemble().is_linear_rotor(body) {
        return None;
    }
    let body = Aligned::of_body(scene.ensemble(), body)?;
    let moments = DVec3::from_array(body.moments);
    let angular_momentum_principal = moments * DVec3::from_array(body.angular_velocity);
    Some(FreeBody { moments, angular_momentum_principal, span: span_of(scene, body.rate_exponent) })
}

/// A scene's span in a body's own units.
fn span_of(scene: &Scene, rate_exponent: i32) -> f64 {
    scene.end() * scaled_by_power_of_two(1.0, rate_exponent)
}

fn classify_free(free: &FreeBody, tolerance: &Bound, is_diagonal: bool, rate: f64) -> Classification {
    let verdict = free.verdict(tolerance);
    let is_general = verdict.shape == Shape::Asymmetric;
    let set_up = if is_general { free.set_up_bound(is_diagonal) } else { Bound::NONE };
    Classification { torques: TorqueSet::default(), verdict, set_up, rate }
}

/// The greatest rate of a body of a scene, rad/s, with its frame, in units that follow from some torques.
pub(crate) fn rate_of_body(scene: &Scene, torques: &[Torque], body: usize) -> (f64, BodyFrame) {
    let (frame, driven_rate) = frame_of(scene.ensemble(), torques, scene.end(), body);
    let momentum = frame.angular_momentum_principal(scene.ensemble(), body);
    (greatest_rate(scene, body, (&frame, driven_rate), momentum), frame)
}

/// The greatest rate of a body, rad/s: that of its initial spin (`m` in the units of its frame), or the rate to which torques bring it
/// ([`frame_of`]).
pub(crate) fn greatest_rate(scene: &Scene, body: usize, (frame, driven_rate): (&BodyFrame, f64), m: DVec3) -> f64 {
    let spin = scaled_by_power_of_two((m / frame.scaled_moments).length(), frame.rate_exponent);
    let middle = scaled_by_power_of_two(frame.scaled_moments.y, frame.moment_exponent);
    let growth =
        torque::variable_inertia::spin_growth(scene.torques(), body, &scene.ensemble().inertia()[body], scene.end());
    (spin * growth).max(driven_rate).max(torque::damping_of(scene.torques(), body, middle))
}

/// The narrowest arithmetic that reaches an attitude error over an angle.
pub(super) fn narrowest(attitude: f64, angle: f64) -> Precision {
    if attitude >= floor_f32(angle) { Precision::F32 } else { Precision::F64 }
}
