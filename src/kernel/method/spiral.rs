//! `spiral`: two rotations a step by ω and its rate, with a third-order angular velocity, a baseline.
//!
//! Three evaluations a step, explicit. The angular velocity is of order 3 for a torque that is constant over the step; the
//! attitude is of **order 2 without torque or with drag, and of order 1 under a torque that depends on the attitude or on
//! time**, because the torque is taken at the start of the step. Conserves nothing exactly; |q| is kept. Accurate where
//! ω dt is small; the angular velocity is stable for ω dt ≲ 1.7.
//!
//! Source: C. A. del Valle, V. Angeles, J. F. Gonzalez, S. Luding, *SPIRAL: An efficient algorithm for the integration
//! of the equation of rotational motion*, Comput. Phys. Commun. 297 (2024) 109077, the non-leapfrog form:
//!
//! ```text
//! q₁ = q e^{h ω/2} e^{h² ω̇/4} (as quaternions)
//! k₁ = h f(ω), k₂ = h f(ω + k₁), k₃ = h f(ω + (k₁ + k₂)/4), ω₁ = ω + (k₁ + k₂ + 4 k₃)/6
//! ```
//!
//! with f Euler's equations at the torque of the start (its dependence on ω included). Neither state nor parameters are
//! compensated in `f32`.

use crate::kernel::method::PlainStep;
use crate::kernel::rigid_body::{Body, State};
use crate::kernel::torque_kernel::TorqueKernel;
use crate::math::quaternion::{exponential_less_one, plainly_normalised};
use crate::math::real::Real;
use crate::math::vector::{TwoWords, Vector};

/// The method as a type.
#[doc(hidden)]
pub struct Spiral;

impl PlainStep for Spiral {
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
        let start = torques.epoch(&torques.start(step_index), 0.0);
        // In m rather than ω: I is constant in body axes, so that the stages are the same.
        let rate = |m: Vector<R>| {
            let omega = inverse.scaled_by(m);
            let mut rate = m.cross(omega);
            if !E::FREE {
                rate = rate + torques.torque(&start, body, q, omega);
            }
            rate
        };
        let m1 = rate(m);
        let m2 = rate(m1.axpy(h, m));
        let m3 = rate((m1 + m2).axpy(h * R::splat(0.25), m));

        let omega = inverse.scaled_by(m);
        let acceleration = inverse.scaled_by(m1);
        let once = q + q.product(exponential_less_one(omega * h));
        let twice = once + once.product(exponential_less_one(acceleration * (h * h * R::splat(0.5))));
        State {
            orientation: plainly_normalised(twice),
            angular_momentum_principal: TwoWords::<Vector<R>>::plain(
                m3.axpy(R::splat(4.0), m1 + m2).axpy(h * R::splat(1.0 / 6.0), m),
            ),
            status: state.status,
        }
    }
}
