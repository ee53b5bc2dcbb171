//! `rk8` with steps that fit each body in time, by its own embedded error estimate.
//!
//! The step and its error estimate are DOP853's (see [`super::rk8`] for the source): with e₅ and e₃ the differences of the
//! step to the embedded formulas of order 5 and 3, weighted by the tolerance,
//!
//! ```text
//! err = h |e₅|² / √((|e₅|² + 0.01 |e₃|²) n),   h ← h · min(6, max(⅓, 0.9 err^(−1/8)))
//! ```
//!
//! (E. Hairer, S. P. Nørsett, G. Wanner, *Solving Ordinary Differential Equations I*, 2nd ed. (1993), section II.10,
//! equation 10.17, and the program's controller with β = 0.) A step with err ≤ 1 is taken, any other is tried again.
//!
//! Everything is per lane, by masks: a lane's steps depend on its own body alone, and a lane that has come to the end of
//! the interval waits unchanged. Bodies are therefore to be ordered by expected work ([`super::work`]), so that those
//! side by side finish together.
//!
//! Differences from the source: what is left of the interval, not the time, is carried, in two words and by exact
//! subtractions, and the last step takes all of it, so that the end is hit exactly; a step that would fall below the
//! limit flags the body ([`Status::StepBelowLimit`]) and ends its integration. In `f32` the estimate itself has a
//! rounding error of about 1e-6 of a step's increment: tolerances below 1e-6 are asked for in vain there, and flagged.

use crate::method::rk8::{ERROR_WEIGHTS_5, Slopes, WEIGHTS, WEIGHTS_3, advanced, slopes, weighted};
use crate::method::slope::Slope;
use crate::method::{Status, flagged};
use crate::real::Real;
use crate::rigid_body::{Body, State};
use crate::torque::{Environment, Free};
use crate::vector::{TwoWords, two_difference};

/// An environment that knows its state at any time, not only at fractions of equal steps.
pub trait Timed<R: Real>: Environment<R> {
    /// What depends on time alone, `time` after the start of the interval, in units of the body's own scale.
    fn epoch_at(&self, time: TwoWords<R>) -> Self::Epoch;
}

impl<R: Real> Timed<R> for Free {
    #[inline(always)]
    fn epoch_at(&self, _: TwoWords<R>) {}
}

/// What is asked of the steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits<R> {
    /// Error of one step: of the quaternion's components, and of the angular momentum's relative to its magnitude.
    pub tolerance: R,
    /// Steps below this flag the body, in units of its own scale; above zero.
    pub least_step: R,
}

/// What the controller carries from one interval to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Controller<R> {
    /// The step to try next, in units of the body's own scale; 0 until one has been tried.
    pub step: R,
    /// Steps taken.
    pub accepted: R,
    /// Steps tried again with a smaller size.
    pub rejected: R,
}

impl<R: Real> Controller<R> {
    /// Before the first step.
    #[inline(always)]
    pub fn new() -> Self {
        let zero = R::splat(0.0);
        Self { step: zero, accepted: zero, rejected: zero }
    }
}

impl<R: Real> Default for Controller<R> {
    fn default() -> Self {
        Self::new()
    }
}

/// Advances `state` over `span` (above zero, in units of the body's own scale), whatever number of steps that takes.
#[inline(always)]
pub fn advance<R: Real, E: Timed<R>>(
    body: &Body<R>,
    environment: &E,
    span: TwoWords<R>,
    limits: &Limits<R>,
    controller: Controller<R>,
    state: State<R>,
) -> (State<R>, Controller<R>) {
    let (zero, one) = (R::splat(0.0), R::splat(1.0));
    let mut state = state;
    let mut controller = controller;
    let untried = !zero.less_than(controller.step);
    controller.step = R::select(untried, first_step(body, span.value, limits.tolerance, &state), controller.step);
    let mut left = span;
    let mut retried = one.less_than(zero);
    let mut active = zero.less_than(left.value) & state.status.less_than(R::splat(0.5));
    while R::any(active) {
        // A last step that would leave almost nothing takes the rest as well.
        let last = left.value.less_than(controller.step * R::splat(1.01));
        let h = TwoWords {
            value: R::select(last, left.value, controller.step),
            residue: R::select(last, left.residue, zero),
        };
        let (gone, gone_residue) = two_difference(span.value, left.value);
        let elapsed = |fraction: f64| TwoWords {
            value: h.value.mul_add(R::splat(fraction), gone),
            residue: gone_residue + (span.residue - left.residue),
        };
        let tried = slopes(body, |fraction| environment.epoch_at(elapsed(fraction)), environment, h.value, &state);
        let error = estimated_error(&tried, h.value, limits.tolerance, &state);
        let taken = active & error.less_than(one);
        let refused = active & !taken;

        state = State::select(taken, advanced(&tried, h, state), state);
        let (value, lost) = two_difference(left.value, h.value);
        let rest = lost + (left.residue - h.residue);
        let (value, rest) = renormalised(value, rest);
        left = TwoWords { value: R::select(taken, value, left.value), residue: R::select(taken, rest, left.residue) };
        controller.accepted = R::select(taken, controller.accepted + one, controller.accepted);
        controller.rejected = R::select(refused, controller.rejected + one, controller.rejected);

        let eighth_root = error.max(R::splat(1e-20)).sqrt().sqrt().sqrt();
        let factor = (R::splat(0.9) / eighth_root).min(R::splat(6.0)).max(R::splat(1.0 / 3.0));
        // Not a number: the step was far too long.
        let factor = R::select(error.less_than(R::splat(1e30)), factor, R::splat(1.0 / 3.0));
        // A step does not grow right after a refusal, and the one that the end cut short says nothing about the next.
        let factor = R::select(retried, factor.min(one), factor);
        let next = h.value * factor;
        let next = R::select(taken & last, next.max(controller.step), next);
        controller.step = R::select(active, next, controller.step);
        retried = refused;

        let too_small = refused & controller.step.less_than(limits.least_step);
        state.status = flagged(state.status, too_small, Status::StepBelowLimit);
        active = active & !too_small & zero.less_than(left.value);
    }
    (state, controller)
}

/// a + b as a rounded sum and what it loses, for |a| ≥ |b| (T. J. Dekker, Numer. Math. 18 (1971) 224, equation 4.14).
#[inline(always)]
fn renormalised<R: Real>(a: R, b: R) -> (R, R) {
    let sum = a + b;
    (sum, b - (sum - a))
}

/// A step to begin with: the angle whose eighth power is the tolerance, at the present rate, or the whole span.
#[inline(always)]
fn first_step<R: Real>(body: &Body<R>, span: R, tolerance: R, state: &State<R>) -> R {
    let omega = body.inverse_moments.value.scaled_by(state.angular_momentum_principal.value);
    let rate = omega.dot(omega).sqrt().max(R::splat(1e-30));
    (tolerance.sqrt().sqrt().sqrt() / rate).min(span)
}

/// DOP853's estimate of a step's error, in units of the tolerance.
#[inline(always)]
fn estimated_error<R: Real>(slopes: &Slopes<R>, h: R, tolerance: R, state: &State<R>) -> R {
    let mut third = WEIGHTS;
    third[0] -= WEIGHTS_3[0];
    third[8] -= WEIGHTS_3[1];
    third[11] -= WEIGHTS_3[2];
    // Both sets of weights add up to 0, so that the first slope itself has no part in the sums of differences.
    let fifth = weighted(&slopes.first, 0.0, &slopes.differences, &ERROR_WEIGHTS_5[1..]);
    let third = weighted(&slopes.first, 0.0, &slopes.differences, &third[1..]);
    let m = state.angular_momentum_principal.value;
    let m_squared = m.dot(m).max(R::splat(1e-30));
    let squared = |slope: &Slope<R>| slope.q.norm_squared() + slope.m.dot(slope.m) / m_squared;
    let inverse = R::splat(1.0) / (tolerance * tolerance);
    let (e5, e3) = (squared(&fifth) * inverse, squared(&third) * inverse);
    let sum = e3.mul_add(R::splat(0.01), e5).max(R::splat(1e-30));
    h.abs() * e5 / (sum * R::splat(7.0)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::{LaneScalar, LaneTask};
    use crate::quaternion::Quaternion;
    use crate::vector::Vector;

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
                let (state, controller) = advance(&body, &Free, span, &limits, Controller::new(), state);
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
