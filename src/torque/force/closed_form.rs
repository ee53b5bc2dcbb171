//! Motion under a constant acceleration and linear drag, at any time.

use glam::DVec3;

use super::Accelerations;

/// Position and velocity after `time` seconds.
///
/// For forces with [`Accelerations::is_closed_form`]. With b = c/M and u = e^(−bt): v = v₀ u + a (1 − u)/b, x = x₀ + v₀ (1 − u)/b + a (t −
/// (1 − u)/b)/b.
/// Both quotients are formed so that they keep their digits as bt vanishes, where they are t and t²/2.
pub fn closed_form(forces: &Accelerations, position: DVec3, velocity: DVec3, time: f64) -> (DVec3, DVec3) {
    let phase = forces.linear_drag * time;
    let decay = (-phase).exp();
    // (1 − e^−p)/p and (p − 1 + e^−p)/p².
    let first = if phase == 0.0 { 1.0 } else { -(-phase).exp_m1() / phase };
    let second = if phase < 1.0 { second_quotient(phase) } else { (1.0 - first) / phase };
    let a = forces.constant_world;
    (position + (velocity * first + a * (second * time)) * time, velocity * decay + a * (first * time))
}

/// (p − 1 + e^−p)/p² = Σ (−p)ⁿ/(n + 2)!, for p up to 1, where the first term left out is below 1e-18.
fn second_quotient(p: f64) -> f64 {
    let mut sum = 0.0;
    for divisor in (3..=20).rev() {
        sum = (1.0 - p * sum) / f64::from(divisor);
    }
    // Horner's scheme of 1/2 (1 − p/3 (1 − p/4 (…))).
    0.5 * (1.0 - p * sum)
}
