//! `implicit_midpoint`: the implicit midpoint rule on the rotation group, with a Cayley update.
//!
//! Order 2, symmetric, implicit: each iteration of Newton's method takes one evaluation of the torque and three more for the
//! Jacobian, with two to three iterations per step for ω dt ≲ 0.3. A torque-free body keeps energy and the angular momentum in
//! the world to rounding, at any step; |q| is kept. Stable at any step; accurate only where ω dt is small.
//!
//! ```text
//! z = m₀ + ½ dt (z × I⁻¹ z + τ(q_mid, I⁻¹ z)),   m₁ = 2 z − m₀,   q₁ = q₀ (1, ½ dt I⁻¹ z)/|·|
//! ```
//!
//! with q_mid halfway along the rotation from q₀ to q₁. Source: the midpoint rule in the Cayley chart as in D. Lewis,
//! J. C. Simo, J. Nonlinear Sci. 4 (1994) 253, algorithm of section 4 with the midpoint stage.
//!
//! Differences from the source: Newton's method with a 3 × 3 Jacobian (the gyroscopic part exact, the torque's by
//! differences) solves for the midpoint momentum, because the plain fixed-point iteration diverges for ω dt ≳ 2; a step that is
//! unsolved after [`ITERATIONS`] iterations is flagged as [`Status::NotConverged`]. Increments are added to a state in two
//! words.

use crate::bodies::Status;
use crate::bodies::status::flagged;
use crate::kernel::method::PlainStep;
use crate::kernel::method::midpoint::{cayley_increment, jacobian, newton_tolerance, scale_of};
use crate::kernel::rigid_body::{Body, State};
use crate::kernel::torque_kernel::TorqueKernel;
use crate::math::quaternion::{Quaternion, norm_correction};
use crate::math::real::Real;
use crate::math::vector::{TwoWords, Vector};

/// The most Newton iterations.
#[doc(hidden)]
pub const ITERATIONS: u32 = 32;

/// The method as a type.
#[doc(hidden)]
pub struct ImplicitMidpoint;

impl PlainStep for ImplicitMidpoint {
    #[inline(always)]
    fn step<R: Real, E: TorqueKernel<R>>(
        body: &Body<R>,
        torques: &E,
        step_index: u64,
        dt: TwoWords<R>,
        state: State<R>,
    ) -> State<R> {
        let one = R::splat(1.0);
        let half = dt.value * R::splat(0.5);
        let q = state.orientation.value;
        let m = state.angular_momentum_principal.value;
        let correction = body.correction(&state);
        let middle = torques.epoch(&torques.start(step_index), 0.5);
        // The torque at the midpoint momentum z, from which the rotation to the midpoint follows.
        let torque = |z: Vector<R>| {
            if E::FREE {
                return Vector::zero();
            }
            let omega = body.angular_velocity(z, &correction);
            torques.torque(&middle, body, halfway(q, omega * half), omega)
        };

        // The explicit half step is a good start if the step is short, and useless if it is long.
        let half_step = (body.gyroscopic_term(m, &correction) + torque(m)) * half;
        let scale = scale_of(m).max(half_step.largest());
        let tolerance = newton_tolerance::<R>() * scale;
        let short = half_step.largest().less_than(R::splat(0.25) * scale_of(m));
        let mut z = Vector::select(short, m + half_step, m);
        let mut z_torque = torque(z);
        let mut unsolved = R::splat(0.0).less_than(one);
        for _ in 0..ITERATIONS {
            let z_rate = body.gyroscopic_term(z, &correction) + z_torque;
            let residual = z_rate.axpy(half, m - z);
            let mut a = jacobian(body, half, z);
            if !E::FREE {
                let (zero, change) = (R::splat(0.0), tolerance);
                let slope = |moved: Vector<R>| (torque(moved) - z_torque) * (half / change);
                a.x = a.x - slope(z + Vector::new(change, zero, zero));
                a.y = a.y - slope(z + Vector::new(zero, change, zero));
                a.z = a.z - slope(z + Vector::new(zero, zero, change));
            }
            let step = a.solve(residual);
            z = Vector::select(unsolved, z + step, z);
            z_torque = torque(z);
            unsolved = unsolved & !step.largest().less_than(tolerance);
            if !R::any(unsolved) {
                break;
            }
        }

        let omega = body.angular_velocity(z, &correction);
        let kappa = half * half * omega.dot(omega);
        let norm = (one + kappa).sqrt();
        let lost = -(kappa / (norm * (one + norm)));
        let q_increment = cayley_increment(q, omega, dt, lost, lost) + norm_correction(q);
        let z_rate = body.gyroscopic_term(z, &correction) + z_torque;
        let m_increment = z_rate.axpy(dt.value, z_rate * dt.residue);
        let status = flagged(state.status, unsolved, Status::NotConverged);
        State { status, ..state.advanced(q_increment, m_increment) }
    }
}

/// q rotated by half of the Cayley rotation (1, c)/|·|: along q (|(1, c)| + 1, c).
#[inline(always)]
fn halfway<R: Real>(q: Quaternion<R>, c: Vector<R>) -> Quaternion<R> {
    let one = R::splat(1.0);
    let norm = (one + c.dot(c)).sqrt();
    let scalar = norm + one;
    let length = (R::splat(2.0) * norm * scalar).sqrt();
    q.product_vector(c * (one / length)) + q * (scalar / length)
}
