//! The midpoint equation of the free body, which the implicit midpoint rule and the discrete Moser-Veselov step share.
//!
//! With z = ½ (m₀ + m₁), ω = I⁻¹ z and the gyroscopic term G(z) = z × ω, one step of length h is
//!
//! ```text
//! z = m₀ + ½ α h G(z),   m₁ = m₀ + α h G(z),   q₁ = q₀ (1, ½ α h ω)/|·|
//! ```
//!
//! with α = 1 for the midpoint rule and α = 1 + |½ α h ω|² for Moser and Veselov's discrete body. m₁ differs from m₀ by a vector
//! perpendicular to z and to ω, so that |m|² and m · ω are kept for any h. The rotation of q is the Cayley transform that carries m₀ to m₁,
//! so that the angular momentum in the world is kept too.

use crate::kernel::rigid_body::{Body, Correction};
use crate::math::quaternion::Quaternion;
use crate::math::real::{Real, Scalar};
use crate::math::vector::{TwoWords, Vector};

/// Three columns of a 3 × 3 matrix.
#[derive(Clone, Copy, Debug)]
pub struct Matrix<R> {
    /// First column.
    pub x: Vector<R>,
    /// Second column.
    pub y: Vector<R>,
    /// Third column.
    pub z: Vector<R>,
}

impl<R: Real> Matrix<R> {
    /// The solution of A x = b by Cramer's rule; A must not be singular.
    #[inline(always)]
    pub fn solve(&self, b: Vector<R>) -> Vector<R> {
        let yz = self.y.cross(self.z);
        let inverse_determinant = R::splat(1.0) / self.x.dot(yz);
        let bz = b.cross(self.z);
        let yb = self.y.cross(b);
        Vector::new(b.dot(yz), self.x.dot(bz), self.x.dot(yb)) * inverse_determinant
    }
}

/// 1 − factor ∂G/∂z, the Jacobian of z − factor G(z).
#[inline(always)]
pub fn jacobian<R: Real>(body: &Body<R>, factor: R, z: Vector<R>) -> Matrix<R> {
    let one = R::splat(1.0);
    let g = body.gyroscopic.value * (-factor);
    Matrix {
        x: Vector::new(one, g.y * z.z, g.z * z.y),
        y: Vector::new(g.x * z.z, one, g.z * z.x),
        z: Vector::new(g.x * z.y, g.y * z.x, one),
    }
}

/// The relative size of a correction that Newton's method may omit: the next correction is its square, which is below one rounding.
#[inline(always)]
pub fn newton_tolerance<R: Real>() -> R {
    R::splat(if R::Scalar::WORDS == 1 { 1.0 / 134_217_728.0 } else { 1.0 / 4096.0 })
}

/// A length that is nonzero even for a body at rest, by which corrections are measured.
#[inline(always)]
pub fn scale_of<R: Real>(m: Vector<R>) -> R {
    m.largest().max(R::splat(1e-30))
}

/// The quantities of one step of the discrete free body.
#[derive(Clone, Copy)]
pub struct Discrete<R: Real> {
    /// G(z).
    pub gyroscopic_term: Vector<R>,
    /// I⁻¹ z.
    pub angular_velocity: Vector<R>,
    /// α − 1.
    pub excess: R,
    /// Set where Newton's method did not converge.
    pub unsolved: R::Mask,
    /// Set where |h ω| is greater than 1 and no α exists.
    pub beyond: R::Mask,
}

/// Newton iterations of [`solve_discrete`]; three are enough for |h ω| up to 0.5.
pub const DISCRETE_ITERATIONS: u32 = 12;

/// Solves z = m + ½ α h G(z), α = 1 + |½ α h ω|² by Newton's method.
///
/// α is eliminated: with κ = |½ h ω|², α = 2/(1 + r), r = √(1 − 4κ), which exists for |h ω| ≤ 1. Two fixed-point iterations give the start,
/// wrong by O(h³).
#[inline(always)]
pub fn solve_discrete<R: Real>(body: &Body<R>, correction: &Correction<R>, h: R, m: Vector<R>) -> Discrete<R> {
    let half = h * R::splat(0.5);
    let (one, two, four) = (R::splat(1.0), R::splat(2.0), R::splat(4.0));
    let least = R::splat(1.0 / 4096.0);
    let tolerance = newton_tolerance::<R>() * scale_of(m);

    let mut z = body.gyroscopic_term(m, correction).axpy(half, m);
    z = body.gyroscopic_term(z, correction).axpy(half, m);
    let mut unsolved = R::splat(0.0).less_than(one);
    for _ in 0..DISCRETE_ITERATIONS {
        let omega = body.angular_velocity(z, correction);
        let g = body.gyroscopic_term(z, correction);
        let kappa = half * half * omega.dot(omega);
        let root = (one - four * kappa).max(least).sqrt();
        let alpha = two / (one + root);
        let factor = alpha * half;
        let residual = g.axpy(factor, m - z);
        // ∂α/∂z = (α²/r) ∂κ/∂z, and ∂κ/∂z = ½ h² I⁻¹ ω.
        let slope = body.inverse_moments.value.scaled_by(omega) * (two * half * half * half * alpha * alpha / root);
        let mut a = jacobian(body, factor, z);
        a.x = a.x - g * slope.x;
        a.y = a.y - g * slope.y;
        a.z = a.z - g * slope.z;
        let step = a.solve(residual);
        z = Vector::select(unsolved, z + step, z);
        unsolved = unsolved & !step.largest().less_than(tolerance);
        if !R::any(unsolved) {
            break;
        }
    }
    let omega = body.angular_velocity(z, correction);
    let kappa = half * half * omega.dot(omega);
    let root = (one - four * kappa).max(least).sqrt();
    let sum = one + root;
    Discrete {
        gyroscopic_term: body.gyroscopic_term(z, correction),
        angular_velocity: omega,
        // α − 1 = (1 − r)/(1 + r) with 1 − r = 4κ/(1 + r), which does not cancel.
        excess: four * kappa / (sum * sum),
        unsolved,
        beyond: one.less_than(four * kappa),
    }
}

/// The increment of q by a Cayley rotation: its vector part is ½ h ω (1 + `vector_excess`), its scalar part 1 + `scalar_excess`.
#[inline(always)]
pub fn cayley_increment<R: Real>(
    q: Quaternion<R>,
    angular_velocity: Vector<R>,
    h: TwoWords<R>,
    vector_excess: R,
    scalar_excess: R,
) -> Quaternion<R> {
    let half = h.value * R::splat(0.5);
    let rest = vector_excess.mul_add(half, h.residue * R::splat(0.5));
    let v = angular_velocity.axpy(half, angular_velocity * rest);
    q.product_vector(v) + q * scalar_excess
}
