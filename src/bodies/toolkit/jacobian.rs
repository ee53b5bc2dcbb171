//! The derivative of the exponential of rotations.

use glam::{DMat3, DVec3};

use super::cross_product::cross_product_matrix;

/// The angle below which cancelling differences are replaced by their power series.
const SERIES_BELOW: f64 = 0.5;

/// The left Jacobian J of SO(3): exp(v + δ) ≈ exp(J δ) exp(v).
///
/// J = 1 + (1 − cos θ)/θ² \[v\]× + (θ − sin θ)/θ³ \[v\]×² (J. Solà, J. Deray, D. Atchuthan, "A micro Lie
/// theory for state estimation in robotics", arXiv:1812.01537, equation (145)).
/// Equivalently ω_W = J v̇ for a rotation vector that changes in time.
///
/// ```
/// use glam::DVec3;
/// use polhode::bodies::toolkit::{exponential, left_jacobian, logarithm};
///
/// let (v, step) = (DVec3::new(1.0, -0.5, 2.0), DVec3::new(1e-6, 2e-6, -1e-6));
/// let turned = exponential(v + step) * exponential(v).conjugate();
/// assert!((logarithm(turned) - left_jacobian(v) * step).length() < 1e-11);
/// ```
pub fn left_jacobian(rotation_vector: DVec3) -> DMat3 {
    jacobian(rotation_vector, 1.0)
}

/// The right Jacobian J of SO(3): exp(v + δ) ≈ exp(v) exp(J δ), the transpose of the left one; ω_B = J v̇.
pub fn right_jacobian(rotation_vector: DVec3) -> DMat3 {
    jacobian(rotation_vector, -1.0)
}

/// The inverse of the [`left_jacobian`]: 1 − ½ \[v\]× + (1 − ½θ cot ½θ)/θ² \[v\]×² (Solà, Deray and
/// Atchuthan, equation (146)).
///
/// It exists for |v| < 2π; at 2π, where full turns make v ambiguous, its elements are no longer finite.
pub fn left_jacobian_inverse(rotation_vector: DVec3) -> DMat3 {
    jacobian_inverse(rotation_vector, 1.0)
}

/// The inverse of the [`right_jacobian`], for |v| < 2π.
pub fn right_jacobian_inverse(rotation_vector: DVec3) -> DMat3 {
    jacobian_inverse(rotation_vector, -1.0)
}

fn jacobian(v: DVec3, side: f64) -> DMat3 {
    let angle = v.length();
    let square = angle * angle;
    // (1 − cos θ)/θ² = ½ (sin ½θ / ½θ)².
    let half = if angle == 0.0 { 1.0 } else { (0.5 * angle).sin() / (0.5 * angle) };
    let second = if angle < SERIES_BELOW {
        // (θ − sin θ)/θ³ = Σ (−θ²)ⁿ/(2n + 3)!; the first term left out is below 1e-17.
        polynomial(
            -square,
            &[1.0 / 6.0, 1.0 / 120.0, 1.0 / 5040.0, 1.0 / 362_880.0, 1.0 / 39_916_800.0, 1.0 / 6_227_020_800.0],
        )
    } else {
        (angle - angle.sin()) / (square * angle)
    };
    let cross = cross_product_matrix(v);
    DMat3::IDENTITY + cross * (side * 0.5 * half * half) + cross * cross * second
}

fn jacobian_inverse(v: DVec3, side: f64) -> DMat3 {
    let angle = v.length();
    let square = angle * angle;
    let second = if angle < SERIES_BELOW {
        // (1 − ½θ cot ½θ)/θ² = Σ |B₂ₙ| θ²ⁿ⁻²/(2n)!, B the Bernoulli numbers; the first term left out is below 1e-17.
        polynomial(
            square,
            &[
                1.0 / 12.0,
                1.0 / 720.0,
                1.0 / 30_240.0,
                1.0 / 1_209_600.0,
                1.0 / 47_900_160.0,
                691.0 / 1_307_674_368_000.0,
                1.0 / 74_724_249_600.0,
            ],
        )
    } else {
        (1.0 - 0.5 * angle / (0.5 * angle).tan()) / square
    };
    let cross = cross_product_matrix(v);
    DMat3::IDENTITY - cross * (side * 0.5) + cross * cross * second
}

fn polynomial(x: f64, coefficients: &[f64]) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, c| sum * x + c)
}
