//! `rk8` with steps in time adapted to each body by its own embedded error estimate.
//!
//! The step and its error estimate are DOP853's (see [`super::rk8`] for the source): with e₅ and e₃ the differences of the
//! step to the embedded formulas of order 5 and 3, weighted by the tolerance,
//!
//! ```text
//! err = h |e₅|² / √((|e₅|² + 0.01 |e₃|²) n),   h ← h · min(6, max(⅓, 0.9 err^(−1/8)))
//! ```
//!
//! (E. Hairer, S. P. Nørsett, G. Wanner, *Solving Ordinary Differential Equations I*, 2nd ed. (1993), section II.10,
//! equation 10.17, and the program's controller with β = 0.) A step with err ≤ 1 is accepted; otherwise it is tried again.
//!
//! Everything is done by masks, lane by lane: a lane's steps depend only on its own body, and a lane that has reached the end of
//! the interval waits unchanged. Bodies should therefore be ordered by expected work ([`crate::engine::load_balance`]), so that
//! neighbours finish together.
//!
//! Order 8, twelve evaluations per attempt, explicit. Like `rk8` it conserves nothing exactly: the drift of energy and angular momentum is
//! that of the error. The tolerance keeps steps far inside the limit of stability, ω h < 6.
//!
//! Differences from the source: instead of the time, the remainder of the interval is carried, in two words and by exact subtractions, and
//! the last step takes all of it, so that the end is hit exactly. The error of the angular momentum is measured relative to its magnitude
//! before or after the step, whichever is greater, so that a body may start from rest. A body that would need a step below the limit is
//! flagged ([`Status::StepBelowLimit`]) and left unchanged. In `f32` the estimate itself has a rounding error of about 1e-6 of a step's
//! increment, in `f64` of 2e-15: [`least_tolerance`].
//!
//! Twin: `shaders/method/rk8_adaptive.wgsl`.

use crate::bodies::Status;
use crate::bodies::status::flagged;
use crate::kernel::method::rk8::{ERROR_WEIGHTS_5, Slopes, WEIGHTS, WEIGHTS_3, advanced, slopes, weighted};
use crate::kernel::method::slope::Slope;
use crate::kernel::rigid_body::{Body, State};
use crate::kernel::torque_kernel::{Conserving, Free, TorqueKernel};
use crate::math::Precision;
use crate::math::real::{Real, finite_or};
use crate::math::vector::{TwoWords, Vector, two_difference};

/// A torque kernel that can be evaluated at any time, not only at fractions of equal steps.
#[doc(hidden)]
pub trait Timed<R: Real>: TorqueKernel<R> {
    /// The start of a step `time` after the start of the interval, in units of the body's own scale, lane by lane. It
    /// is valid until the next one is formed.
    fn start_at(&self, time: TwoWords<R>) -> Self::Start;

    /// What depends only on time, `elapsed` after the start of the step, in the same units.
    fn epoch_after(&self, start: &Self::Start, elapsed: R) -> Self::Epoch;
}

impl<R: Real> Timed<R> for Free {
    #[inline(always)]
    fn start_at(&self, _: TwoWords<R>) {}

    #[inline(always)]
    fn epoch_after(&self, (): &(), _: R) {}
}

/// Makes it a torque kernel like any other where kernels are selected.
impl<R: Real> Timed<R> for Conserving<R> {
    #[inline(always)]
    fn start_at(&self, _: TwoWords<R>) {}

    #[inline(always)]
    fn epoch_after(&self, (): &(), _: R) {}
}

/// The least tolerance that an arithmetic can distinguish from its own rounding.
#[doc(hidden)]
pub const fn least_tolerance(precision: Precision) -> f64 {
    match precision {
        Precision::F32 => 1e-6,
        Precision::F64 => 2e-15,
    }
}

/// The default least step, in units of the body's own scale: a body that turns by a radian in a unit would take 10⁹ such steps for it.
#[doc(hidden)]
pub const LEAST_STEP: f64 = 1.0 / 1_073_741_824.0;

/// Tolerance and least step.
#[derive(Clone, Copy, Debug, PartialEq)]
#[doc(hidden)]
pub struct Limits<R> {
    /// Error of one step: of the quaternion's components, and of the angular momentum's relative to its magnitude.
    pub tolerance: R,
    /// A body that needs a step below this is flagged; in units of its own scale, above zero.
    pub least_step: R,
}

/// The progress of a body in its interval, and the state of its step controller.
#[derive(Clone, Copy, Debug, PartialEq)]
#[doc(hidden)]
pub struct Controller<R> {
    /// The step to try next, in units of the body's own scale; 0 until one has been tried.
    pub step: R,
    /// The rest of the interval, in the same units; 0 at its end.
    pub left: TwoWords<R>,
    /// 1 if the last attempt was rejected, otherwise 0.
    pub retried: R,
    /// Steps taken.
    pub accepted: R,
    /// Steps that were rejected and tried again with a smaller size.
    pub rejected: R,
}

impl<R: Real> Controller<R> {
    /// The controller before the first step.
    #[inline(always)]
    pub fn new() -> Self {
        let zero = R::splat(0.0);
        Self {
            step: zero,
            left: TwoWords { value: zero, residue: zero },
            retried: zero,
            accepted: zero,
            rejected: zero,
        }
    }

    /// The controller at the start of an interval of `span`.
    #[inline(always)]
    #[must_use]
    pub fn over(self, span: TwoWords<R>) -> Self {
        Self { left: span, ..self }
    }

    /// Set where the interval is not finished.
    #[inline(always)]
    pub fn under_way(&self, state: &State<R>) -> R::Mask {
        R::splat(0.0).less_than(self.left.value) & state.status.less_than(R::splat(0.5))
    }
}

impl<R: Real> Default for Controller<R> {
    fn default() -> Self {
        Self::new()
    }
}

/// Advances `state` towards the end of an interval of `span` (in units of the body's own scale), of which
/// [`Controller::left`] remains, by at most `attempts` attempts. The result does not depend on how attempts are divided into
/// calls.
#[inline(always)]
#[doc(hidden)]
pub fn advance<R: Real, E: Timed<R>>(
    body: &Body<R>,
    torques: &E,
    span: TwoWords<R>,
    limits: &Limits<R>,
    attempts: u32,
    controller: Controller<R>,
    state: State<R>,
) -> (State<R>, Controller<R>) {
    let (mut state, mut controller) = (state, controller);
    for _ in 0..attempts {
        if !R::any(controller.under_way(&state)) {
            break;
        }
        (state, controller) = attempt(body, torques, span, limits, controller, state);
    }
    (state, controller)
}

/// Tries one step; a lane with nothing left to do does not change.
#[inline(always)]
#[doc(hidden)]
pub fn attempt<R: Real, E: Timed<R>>(
    body: &Body<R>,
    torques: &E,
    span: TwoWords<R>,
    limits: &Limits<R>,
    controller: Controller<R>,
    state: State<R>,
) -> (State<R>, Controller<R>) {
    let trial = Trial::new(body, span, limits, &controller, &state);
    let (start, h) = (torques.start_at(trial.gone), trial.h.value);
    let tried = slopes(
        body,
        #[inline(always)]
        |fraction| torques.epoch_after(&start, h * R::splat(fraction)),
        torques,
        h,
        &state,
    );
    trial.concluded(&tried, limits, controller, state)
}

/// An attempt before its slopes are known.
#[derive(Clone, Copy)]
pub(crate) struct Trial<R: Real> {
    /// The step that is tried.
    pub h: TwoWords<R>,
    /// The part of the interval that is done.
    pub gone: TwoWords<R>,
    /// The step that the controller wanted.
    step: R,
    trying: R::Mask,
    /// Set where the step ends with the interval.
    last: R::Mask,
}

impl<R: Real> Trial<R> {
    /// The next attempt of a controller.
    #[inline(always)]
    pub fn new(
        body: &Body<R>,
        span: TwoWords<R>,
        limits: &Limits<R>,
        controller: &Controller<R>,
        state: &State<R>,
    ) -> Self {
        let zero = R::splat(0.0);
        let untried = !zero.less_than(controller.step);
        let step = if R::any(untried) {
            R::select(untried, first_step(body, span.value, limits.tolerance, state), controller.step)
        } else {
            controller.step
        };
        let left = controller.left;
        // A last step that would leave almost nothing takes the rest as well.
        let last = left.value.less_than(step * R::splat(1.01));
        let h = TwoWords { value: R::select(last, left.value, step), residue: R::select(last, left.residue, zero) };
        let (gone, gone_residue) = two_difference(span.value, left.value);
        let gone = TwoWords { value: gone, residue: gone_residue + (span.residue - left.residue) };
        Self { h, gone, step, trying: controller.under_way(state), last }
    }

    /// The outcome of the attempt with these slopes.
    #[inline(always)]
    pub fn concluded(
        &self,
        tried: &impl Slopes<R>,
        limits: &Limits<R>,
        controller: Controller<R>,
        state: State<R>,
    ) -> (State<R>, Controller<R>) {
        let (zero, one) = (R::splat(0.0), R::splat(1.0));
        let Self { h, step, trying, last, .. } = *self;
        let left = controller.left;
        let next_state = advanced(tried, h, state);
        // NaN means that the step was far too long.
        let error = estimated_error(tried, h.value, limits.tolerance, &state, &next_state);
        let error = finite_or(error, R::splat(1e30));
        let taken = trying & error.less_than(one);
        let refused = trying & !taken;

        let (value, lost) = two_difference(left.value, h.value);
        let rest = renormalised(value, lost + (left.residue - h.residue));

        let eighth_root = error.max(R::splat(1e-20)).sqrt().sqrt().sqrt();
        let factor = (R::splat(0.9) / eighth_root).min(R::splat(6.0)).max(R::splat(1.0 / 3.0));
        // A step does not grow right after a rejection, and one that the end cut short says nothing about the next.
        let factor = R::select(R::splat(0.5).less_than(controller.retried), factor.min(one), factor);
        let next = h.value * factor;
        let next = R::select(taken & last, next.max(step), next);
        // A short first step, or a short last one, is no sign of difficulty.
        let shrunk = refused | (taken & !last & factor.less_than(one));
        let too_small = shrunk & next.less_than(limits.least_step);

        let mut state = State::select(taken, next_state, state);
        state.status = flagged(state.status, too_small, Status::StepBelowLimit);
        let controller = Controller {
            step: R::select(trying, next, controller.step),
            left: TwoWords {
                value: R::select(taken, rest.value, left.value),
                residue: R::select(taken, rest.residue, left.residue),
            },
            retried: R::select(trying, R::select(refused, one, zero), controller.retried),
            accepted: R::select(taken, controller.accepted + one, controller.accepted),
            rejected: R::select(refused, controller.rejected + one, controller.rejected),
        };
        (state, controller)
    }
}

/// The two words a + b of a sum, for |a| ≥ |b| (T. J. Dekker, Numer. Math. 18 (1971) 224, equation 4.14).
#[inline(always)]
pub(crate) fn renormalised<R: Real>(a: R, b: R) -> TwoWords<R> {
    let value = a + b;
    TwoWords { value, residue: b - (value - a) }
}

/// The first step: the angle whose eighth power is the tolerance, at the present rate or, if that is less, at one radian per unit of the
/// body's own scale; at most the whole span.
#[inline(always)]
fn first_step<R: Real>(body: &Body<R>, span: R, tolerance: R, state: &State<R>) -> R {
    let omega = body.inverse_moments.value.scaled_by(state.angular_momentum_principal.value);
    let rate = omega.dot(omega).sqrt().max(R::splat(1.0));
    (tolerance.sqrt().sqrt().sqrt() / rate).min(span)
}

/// e3's weights: bⱼ less those of the embedded formula of order 3.
pub(crate) const ERROR_WEIGHTS_3: [f64; WEIGHTS.len()] = {
    let mut weights = WEIGHTS;
    weights[0] -= WEIGHTS_3[0];
    weights[8] -= WEIGHTS_3[1];
    weights[11] -= WEIGHTS_3[2];
    weights
};

/// DOP853's estimate of a step's error, in units of the tolerance.
#[inline(always)]
fn estimated_error<R: Real>(slopes: &impl Slopes<R>, h: R, tolerance: R, state: &State<R>, next_state: &State<R>) -> R {
    // Both sets of weights add up to 0, so that the first slope does not contribute to the sums of differences.
    let fifth = weighted(slopes, 0.0, &ERROR_WEIGHTS_5[1..]);
    let third = weighted(slopes, 0.0, &ERROR_WEIGHTS_3[1..]);
    let m = state.angular_momentum_principal.value;
    let m_next = next_state.angular_momentum_principal.value;
    let m_squared = m.dot(m).max(m_next.dot(m_next)).max(R::splat(1e-30));
    let inverse = R::splat(1.0) / tolerance;
    let (e5, e3) = (squared(&fifth, m_squared, inverse), squared(&third, m_squared, inverse));
    let sum = e3.mul_add(R::splat(0.01), e5).max(R::splat(1e-30));
    h.abs() * e5 / (sum * R::splat(7.0)).sqrt()
}

/// The square of a slope, with the angular momentum's part relative to m, in units of the tolerance.
#[inline(always)]
fn squared<R: Real>(slope: &Slope<R>, m_squared: R, inverse_tolerance: R) -> R {
    let (q, m): (_, Vector<R>) = (slope.q * inverse_tolerance, slope.m * inverse_tolerance);
    q.norm_squared() + m.dot(m) / m_squared
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::lanes::{LaneScalar, LaneTask};
    use crate::math::quaternion::Quaternion;
    use crate::math::vector::Vector;

    /// Advances bodies of these spins about a tilted axis and gives (qx, steps taken) of each, in lanes.
    struct InLanes<'a>(&'a [f64]);

    impl LaneTask<f64> for InLanes<'_> {
        type Output = Vec<(u64, u64)>;

        #[inline(always)]
        fn run<R: Real<Scalar = f64>>(self) -> Self::Output {
            let mut results = Vec::new();
            let (zero, one) = (R::splat(0.0), R::splat(1.0));
            let body =
                Body::new(TwoWords { value: Vector::new(one, R::splat(0.6), R::splat(0.45)), residue: Vector::zero() });
            for spins in self.0.chunks(R::LANES) {
                let mut padded = spins.to_vec();
                padded.resize(R::LANES, 0.0);
                let spin = R::load(&padded);
                let none = Quaternion::new(zero, zero, zero, zero);
                let state = State {
                    orientation: TwoWords { value: Quaternion::new(zero, zero, zero, one), residue: none },
                    angular_momentum_principal: TwoWords {
                        value: Vector::new(spin, spin * R::splat(0.7), spin * R::splat(-0.3)),
                        residue: Vector::zero(),
                    },
                    status: zero,
                };
                let limits = Limits { tolerance: R::splat(1e-9), least_step: R::splat(1e-6) };
                let span = TwoWords { value: R::splat(5.0), residue: zero };
                let controller = Controller::new().over(span);
                let (state, controller) = advance(&body, &Free, span, &limits, u32::MAX, controller, state);
                let mut columns = [vec![0.0; R::LANES], vec![0.0; R::LANES]];
                state.orientation.value.x.store(&mut columns[0]);
                controller.accepted.store(&mut columns[1]);
                results.extend((0..spins.len()).map(|lane| (columns[0][lane].to_bits(), columns[1][lane] as u64)));
            }
            results
        }
    }

    #[test]
    fn a_lane_does_not_depend_on_its_neighbours() {
        let spins: Vec<f64> = (0..37).map(|body| 0.3 + 0.21 * f64::from((body * 17) % 37)).collect();
        let together = f64::dispatch(InLanes(&spins));
        for (body, &spin) in spins.iter().enumerate() {
            let alone = f64::dispatch(InLanes(&[spin]));
            assert_eq!(alone[0], together[body], "body {body}");
        }
        let steps: Vec<u64> = together.iter().map(|result| result.1).collect();
        assert!(steps.iter().max() > steps.iter().min(), "{steps:?}");
    }
}
