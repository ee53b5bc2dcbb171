//! The free flow of the splittings: the preprocessed discrete Moser-Veselov step of order 6.
//!
//! J. Moser, A. P. Veselov, Comm. Math. Phys. 139 (1991) 217, give a discrete free body that keeps energy and angular
//! momentum exactly, and follows the true orbits at a speed that is wrong by O(h²). E. Hairer, G. Vilmart, J. Phys. A 39 (2006)
//! 13225, change the moments of inertia so that the discrete body with the changed moments
//! follows the true body with the given ones, here up to h⁶:
//!
//! ```text
//! 1/Jᵢ = (1 + σ)/Iᵢ + δ,   σ = σ₁ h² + σ₂ h⁴,   δ = δ₁ h² + δ₂ h⁴
//! σ₁ = (p/6D) C − (r/3) H               δ₁ = −(1/3D) C + (p/6D) H
//! σ₂ = (S/D − r)/(30D) C² + (1 − X)/(30D) C H + (3p/D + 2R)/60 H²
//! δ₂ = −p/(60D²) C² + (r/(10D) − S/(60D²)) C H − (9 + X)/(60D) H²
//! ```
//!
//! with C = ½ |m|², H = ½ m · ω, D = I₁ I₂ I₃, p = Σ I, r = Σ 1/I, S = Σ I², R = Σ 1/I², X = Σ_{i≠j} Iᵢ/Iⱼ. C and H are
//! invariants, so that the changed moments of a torque-free body are formed once.
//!
//! Differences from the source: the step is written in the midpoint momentum z, for which only 1/Jᵢ and the differences 1/Jₖ − 1/Jⱼ = (1 +
//! σ)(1/Iₖ − 1/Iⱼ) are needed (see [`super::midpoint`]): no moments, and no cancellation for nearly equal moments. It is solved by Newton's
//! method instead of fixed-point iteration, and increments are added to a state in two words.
//!
//! Limits: |h ω| < 1, and all 1/Jᵢ > 0; both are flagged as [`Status::StepTooLong`].

use crate::bodies::Status;
use crate::bodies::status::flagged;
use crate::kernel::method::midpoint::{cayley_increment, solve_discrete};
use crate::kernel::rigid_body::{Body, Invariants, State};
use crate::math::quaternion::norm_correction;
use crate::math::real::Real;
use crate::math::vector::{TwoWords, Vector, accumulate};

/// The coefficients of σ and δ that depend on the moments alone.
#[derive(Clone, Copy, Debug)]
pub struct Modification<R> {
    scale_c: R,
    scale_h: R,
    scale_cc: R,
    scale_ch: R,
    scale_hh: R,
    shift_c: R,
    shift_h: R,
    shift_cc: R,
    shift_ch: R,
    shift_hh: R,
}

impl<R: Real> Modification<R> {
    /// The coefficients for a body.
    #[inline(always)]
    pub fn new(body: &Body<R>) -> Self {
        let one = R::splat(1.0);
        let by = |x: f64| R::splat(1.0 / x);
        let b = body.inverse_moments.value;
        let moments = Vector::new(one / b.x, one / b.y, one / b.z);
        let sum = moments.x + moments.y + moments.z;
        let inverse_sum = b.x + b.y + b.z;
        let squares = moments.dot(moments);
        let inverse_squares = b.dot(b);
        let inverse_product = b.x * b.y * b.z;
        // Σ_{i≠j} Iᵢ/Iⱼ is the product of the sums less the three terms with i = j.
        let ratios = sum * inverse_sum - R::splat(3.0);
        Self {
            scale_c: sum * inverse_product * by(6.0),
            scale_h: -(inverse_sum * by(3.0)),
            scale_cc: (squares * inverse_product - inverse_sum) * inverse_product * by(30.0),
            scale_ch: (one - ratios) * inverse_product * by(30.0),
            scale_hh: (R::splat(3.0) * sum * inverse_product + R::splat(2.0) * inverse_squares) * by(60.0),
            shift_c: -(inverse_product * by(3.0)),
            shift_h: sum * inverse_product * by(6.0),
            shift_cc: -(sum * inverse_product * inverse_product * by(60.0)),
            shift_ch: (R::splat(6.0) * inverse_sum - squares * inverse_product) * inverse_product * by(60.0),
            shift_hh: -((R::splat(9.0) + ratios) * inverse_product * by(60.0)),
        }
    }

    /// The body with the moments changed for steps of h at these invariants.
    #[inline(always)]
    pub fn modified(&self, body: &Body<R>, h: R, invariants: &Invariants<R>) -> Body<R> {
        let c = h * h * (invariants.angular_momentum_squared * R::splat(0.5));
        let e = h * h * invariants.kinetic_energy;
        let scale_quadratic = self.scale_cc.mul_add(c * c, self.scale_ch.mul_add(c * e, self.scale_hh * (e * e)));
        let scale = self.scale_c.mul_add(c, self.scale_h.mul_add(e, scale_quadratic));
        let shift_quadratic = self.shift_cc.mul_add(c * c, self.shift_ch.mul_add(c * e, self.shift_hh * (e * e)));
        let shift = self.shift_c.mul_add(c, self.shift_h.mul_add(e, shift_quadratic));
        let shifts = Vector::new(shift, shift, shift);
        Body {
            inverse_moments: accumulate::<R, _>(body.inverse_moments, body.inverse_moments.value.axpy(scale, shifts)),
            gyroscopic: accumulate::<R, _>(body.gyroscopic, body.gyroscopic.value * scale),
        }
    }

    /// The body with the moments changed for steps of h from `state`.
    #[inline(always)]
    pub fn modified_at(&self, body: &Body<R>, h: R, state: &State<R>) -> Body<R> {
        let m = state.angular_momentum_principal.value;
        let invariants = Invariants { angular_momentum_squared: m.dot(m), kinetic_energy: body.kinetic_energy(m) };
        self.modified(body, h, &invariants)
    }
}

/// The free flow over h, where `modified` is the body with the moments changed for h.
#[inline(always)]
pub fn drift<R: Real>(modified: &Body<R>, h: TwoWords<R>, state: State<R>) -> State<R> {
    let one = R::splat(1.0);
    let correction = modified.correction(&state);
    let solved = solve_discrete(modified, &correction, h.value, state.angular_momentum_principal.value);

    // √α − 1 and 1/√α − 1 from α − 1, without cancellation.
    let norm = (one + solved.excess).sqrt();
    let part = solved.excess / (norm * (one + norm));
    let q = state.orientation.value;
    let q_increment = cayley_increment(q, solved.angular_velocity, h, part * norm, -part) + norm_correction(q);
    let g = solved.gyroscopic_term;
    let m_increment = g.axpy(h.value, g * solved.excess.mul_add(h.value, h.residue));

    let least =
        modified.inverse_moments.value.x.min(modified.inverse_moments.value.y.min(modified.inverse_moments.value.z));
    let too_long = solved.beyond | !R::splat(0.0).less_than(least);
    let status = flagged(state.status, too_long, Status::StepTooLong);
    let status = flagged(status, solved.unsolved, Status::NotConverged);
    State { status, ..state.advanced(q_increment, m_increment) }
}
