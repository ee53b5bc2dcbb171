//! `rk4`: the classical Runge-Kutta method on (q, m), with the quaternion's norm restored.
//!
//! Order 4, four evaluations per step, explicit. It conserves nothing exactly; the drift of energy and angular momentum is of order dt⁵ per
//! step. Stable on a steady rotation for ω dt < 2√2, ω being the fastest frequency present; accurate for ω dt up to about 0.3.
//!
//! Source: W. Kutta, Z. Math. Phys. 46 (1901) 435, his first formula of order 4; the coefficients are those of
//! E. Hairer, S. P. Nørsett, G. Wanner, *Solving Ordinary Differential Equations I*, 2nd ed. (1993), table II.1.2.
//!
//! Differences from the source: the increments are added to a state carried in two words, and the quaternion's norm is restored
//! as if the step had started from q/|q|, by the increment ½ (1 − |q|²) q′ with the q′ that it leads to.

use crate::kernel::method::PlainStep;
use crate::kernel::method::slope::{Slope, rates, sixth_of};
use crate::kernel::rigid_body::{Body, State};
use crate::kernel::torque_kernel::TorqueKernel;
use crate::math::quaternion::norm_correction_of_step;
use crate::math::real::Real;
use crate::math::vector::TwoWords;

/// The method as a type.
#[doc(hidden)]
pub struct Rk4;

impl PlainStep for Rk4 {
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

        let k1 = rates(body, torques, &start, &correction, q, m);
        let k2 = rates(body, torques, &middle, &correction, k1.q.axpy(half, q), k1.m.axpy(half, m));
        let k3 = rates(body, torques, &middle, &correction, k2.q.axpy(half, q), k2.m.axpy(half, m));
        let k4 = rates(body, torques, &end, &correction, k3.q.axpy(dt.value, q), k3.m.axpy(dt.value, m));

        advanced([k1, k2, k3, k4], dt, state)
    }
}

/// The state after a step of dt with these slopes.
#[inline(always)]
pub(crate) fn advanced<R: Real>([k1, k2, k3, k4]: [Slope<R>; 4], dt: TwoWords<R>, state: State<R>) -> State<R> {
    let sixth = sixth_of(dt);
    let q = state.orientation.value;
    let two = R::splat(2.0);
    let q_sum = (k2.q + k3.q).axpy(two, k1.q + k4.q);
    let m_sum = (k2.m + k3.m).axpy(two, k1.m + k4.m);
    let restoring = norm_correction_of_step(q, q_sum.axpy(sixth.value, q));
    let q_increment = q_sum.axpy(sixth.value, k2.q.axpy(sixth.residue, restoring));
    let m_increment = m_sum.axpy(sixth.value, k2.m * sixth.residue);

    state.advanced(q_increment, m_increment)
}
