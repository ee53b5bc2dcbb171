//! `clamped_euler`: an explicit step of the gyroscopic term after which |m| is restored, a baseline.
//!
//! Order 1, one evaluation per step, explicit. A free body keeps |m| to rounding; its energy is not kept, and the angular
//! momentum in the world turns. Stable at any step, as |m| cannot grow.
//!
//! Source: the gyroscopic force of Jolt (`MotionProperties::ApplyGyroscopicForceInternal`), which Rapier and Avian share: m ←
//! m + h m × ω, rescaled to its former length, then the torque, then q ← q e^{h ω} with the new ω. Neither state nor
//! parameters are compensated in `f32`.

use crate::kernel::method::PlainStep;
use crate::kernel::rigid_body::{Body, State};
use crate::kernel::torque_kernel::TorqueKernel;
use crate::math::quaternion::{exponential_less_one, plainly_normalised};
use crate::math::real::Real;
use crate::math::vector::{TwoWords, Vector};

/// The method as a type.
#[doc(hidden)]
pub struct ClampedEuler;

impl PlainStep for ClampedEuler {
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
        let inverse = body.inverse_moments.value;
        let m = state.angular_momentum_principal.value;
        let omega = inverse.scaled_by(m);
        let turned = m.cross(omega).axpy(h, m);
        // A body at rest stays at rest: its ratio is formed of two equal tiny numbers.
        let tiny = R::splat(1e-36);
        let mut m = turned * ((m.dot(m) + tiny) / (turned.dot(turned) + tiny)).sqrt();
        if !E::FREE {
            m = torques.torque(&torques.epoch(&torques.start(step_index), 0.0), body, q, omega).axpy(h, m);
        }
        let omega = inverse.scaled_by(m);
        State {
            orientation: plainly_normalised(q + q.product(exponential_less_one(omega * h))),
            angular_momentum_principal: TwoWords::<Vector<R>>::plain(m),
            status: state.status,
        }
    }
}
