//! `explicit_euler`: Euler's explicit method on (q, m), a baseline.
//!
//! Order 1, one evaluation a step, explicit. Conserves nothing: the energy of a free body grows without bound, by a factor
//! of 1e3 or more in 1e6 steps of ω dt = 0.01. Unstable at any step.
//!
//! Source: L. Euler, *Institutiones calculi integralis* I (1768), § 650, as used by the simplest game engines, with
//! q ← q/|q| after each step. Neither state nor parameters are compensated in `f32`.

use crate::kernel::method::PlainStep;
use crate::kernel::rigid_body::{Body, State, orientation_rate};
use crate::kernel::torque_kernel::TorqueKernel;
use crate::math::quaternion::plainly_normalised;
use crate::math::real::Real;
use crate::math::vector::{TwoWords, Vector};

/// The method as a type.
#[doc(hidden)]
pub struct ExplicitEuler;

impl PlainStep for ExplicitEuler {
    #[inline(always)]
    fn step<R: Real, E: TorqueKernel<R>>(
        body: &Body<R>,
        torques: &E,
        step_index: u64,
        dt: TwoWords<R>,
        state: State<R>,
    ) -> State<R> {
        let h = dt.value;
        let q = state.orientation.value;
        let m = state.angular_momentum_principal.value;
        let omega = body.inverse_moments.value.scaled_by(m);
        let mut m_rate = m.cross(omega);
        if !E::FREE {
            m_rate = m_rate + torques.torque(&torques.epoch(&torques.start(step_index), 0.0), body, q, omega);
        }
        State {
            orientation: plainly_normalised(orientation_rate(q, omega).axpy(h, q)),
            angular_momentum_principal: TwoWords::<Vector<R>>::plain(m_rate.axpy(h, m)),
            status: state.status,
        }
    }
}
