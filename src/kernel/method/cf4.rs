//! `cf4`: the commutator-free Lie-group method of order 4.
//!
//! Order 4, four evaluations and five rotations per step, explicit. The attitude stays on the rotation group; nothing else is conserved
//! exactly, and the drift of energy and angular momentum is that of `rk4`. Stable and accurate where `rk4` is; for slow bodies its attitude
//! error is ten times smaller.
//!
//! Source: E. Celledoni, A. Marthinsen, B. Owren, Future Gener. Comput. Syst. 19 (2003) 341, section 3, the method with
//! four stages, whose last update is made of two exponentials:
//!
//! ```text
//! Q₂ = q e^{h k₁/2}, Q₃ = q e^{h k₂/2}, Q₄ = Q₂ e^{h (k₃ − k₁/2)}
//! q₁ = q e^{h (3k₁ + 2k₂ + 2k₃ − k₄)/12} e^{h (−k₁ + 2k₂ + 2k₃ + 3k₄)/12}
//! ```
//!
//! with kᵢ the body angular velocity at stage i, while m follows the classical Runge-Kutta method of order 4.
//!
//! Differences from the source: exponentials are formed less 1, the increments are added to a state carried in two words,
//! and ½ (1 − |q|²) q is added to the increment of the quaternion.

use crate::kernel::method::PlainStep;
use crate::kernel::method::slope::{Turn, sixth_of, turn};
use crate::kernel::rigid_body::{Body, State};
use crate::kernel::torque_kernel::TorqueKernel;
use crate::math::quaternion::{Quaternion, exponential_less_one, norm_correction};
use crate::math::real::Real;
use crate::math::vector::{TwoWords, Vector};

/// The method as a type.
#[doc(hidden)]
pub struct Cf4;

/// q e^θ.
#[inline(always)]
pub(crate) fn rotated<R: Real>(q: Quaternion<R>, rotation_vector: Vector<R>) -> Quaternion<R> {
    q + q.product(exponential_less_one(rotation_vector))
}

impl PlainStep for Cf4 {
    #[inline(always)]
    fn step<R: Real, E: TorqueKernel<R>>(
        body: &Body<R>,
        torques: &E,
        step_index: u64,
        dt: TwoWords<R>,
        state: State<R>,
    ) -> State<R> {
        let half = dt.value * R::splat(0.5);
        let q = state.orientation.value;
        let m = state.angular_momentum_principal.value;
        let correction = body.correction(&state);
        let step = torques.start(step_index);
        let start = torques.epoch(&step, 0.0);
        let middle = torques.epoch(&step, 0.5);
        let end = torques.epoch(&step, 1.0);

        let k1 = turn(body, torques, &start, &correction, q, m);
        let q2 = if E::FREE { q } else { rotated(q, k1.omega * half) };
        let k2 = turn(body, torques, &middle, &correction, q2, k1.m.axpy(half, m));
        let q3 = if E::FREE { q } else { rotated(q, k2.omega * half) };
        let k3 = turn(body, torques, &middle, &correction, q3, k2.m.axpy(half, m));
        let q4 = if E::FREE { q } else { rotated(q2, k3.omega * dt.value - k1.omega * half) };
        let k4 = turn(body, torques, &end, &correction, q4, k3.m.axpy(dt.value, m));
        advanced([k1, k2, k3, k4], dt, state)
    }
}

/// The state after a step of dt with these rates.
#[inline(always)]
pub(crate) fn advanced<R: Real>(rates: [Turn<R>; 4], dt: TwoWords<R>, state: State<R>) -> State<R> {
    let [Turn { omega: k1, m: m1 }, Turn { omega: k2, m: m2 }, Turn { omega: k3, m: m3 }, Turn { omega: k4, m: m4 }] =
        rates;
    let sixth = sixth_of(dt);
    let q = state.orientation.value;
    let (two, three) = (R::splat(2.0), R::splat(3.0));
    let twelfth = sixth.value * R::splat(0.5);
    let middles = (k2 + k3) * two;
    let tail = k2 * (sixth.residue * R::splat(0.5));
    let first = (k1.axpy(three, middles) - k4).axpy(twelfth, tail);
    let second = (k4.axpy(three, middles) - k1).axpy(twelfth, tail);
    let (a, b) = (exponential_less_one(first), exponential_less_one(second));
    // (1 + a)(1 + b) − 1.
    let q_increment = q.product(a.product(b) + (a + b)) + norm_correction(q);
    let m_sum = (m2 + m3).axpy(two, m1 + m4);
    let m_increment = m_sum.axpy(sixth.value, m2 * sixth.residue);

    state.advanced(q_increment, m_increment)
}
