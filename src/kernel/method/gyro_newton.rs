//! `gyro_newton`: one Newton step on the implicit gyroscopic term, a baseline.
//!
//! Order 1, one evaluation a step. Conserves nothing: it damps, and a free body loses 15 % of its energy and turns its
//! angular momentum by 10 % in 1e6 steps of ω dt = 0.01. Stable at any step.
//!
//! Source: E. Catto, *Numerical Methods*, Game Developers Conference (2015), the slides on gyroscopic torque; the
//! implicit gyroscopic force of Bullet is the same. The torque is added first, then one step of Newton's method solves
//! I (ω' − ω) + h ω' × I ω' = 0 in body axes, then q ← q + ½ h q ω', q ← q/|q|. Neither state nor parameters are
//! compensated in `f32`.

use crate::kernel::method::PlainStep;
use crate::kernel::method::midpoint::Matrix;
use crate::kernel::rigid_body::{Body, State, orientation_rate};
use crate::kernel::torque_kernel::TorqueKernel;
use crate::math::quaternion::plainly_normalised;
use crate::math::real::Real;
use crate::math::vector::{TwoWords, Vector};

/// The method as a type.
#[doc(hidden)]
pub struct GyroNewton;

impl PlainStep for GyroNewton {
    #[inline(always)]
    fn step<R: Real, E: TorqueKernel<R>>(
        body: &Body<R>,
        torques: &E,
        step_index: u64,
        dt: TwoWords<R>,
        state: State<R>,
    ) -> State<R> {
        let h = dt.value;
        let one = R::splat(1.0);
        let q = state.orientation.value;
        let inverse = body.inverse_moments.value;
        let moments = Vector::new(one / inverse.x, one / inverse.y, one / inverse.z);
        let mut m = state.angular_momentum_principal.value;
        if !E::FREE {
            let omega = inverse.scaled_by(m);
            m = torques.torque(&torques.epoch(&torques.start(step_index), 0.0), body, q, omega).axpy(h, m);
        }
        let omega = inverse.scaled_by(m);
        let residual = omega.cross(m) * h;
        // I + h ([ω]× I − [I ω]×), by columns.
        let jacobian = Matrix {
            x: Vector::new(moments.x, h * (omega.z * moments.x - m.z), -(h * (omega.y * moments.x - m.y))),
            y: Vector::new(-(h * (omega.z * moments.y - m.z)), moments.y, h * (omega.x * moments.y - m.x)),
            z: Vector::new(h * (omega.y * moments.z - m.y), -(h * (omega.x * moments.z - m.x)), moments.z),
        };
        let omega = omega - jacobian.solve(residual);
        State {
            orientation: plainly_normalised(orientation_rate(q, omega).axpy(h, q)),
            angular_momentum_principal: TwoWords::<Vector<R>>::plain(moments.scaled_by(omega)),
            status: state.status,
        }
    }
}
