//! `quadratic-drag`: a force against the velocity, proportional to its square. Twin:
//! `shaders/force/quadratic_drag.wgsl`.

use glam::DVec3;

/// −k |v| v, m/s², with k = C/M in 1/m (I. Newton, *Principia*, book II, section II; for a body of area A in a fluid of
/// density ρ, C = ½ ρ A c_d).
pub fn acceleration(coefficient: f64, velocity: DVec3) -> DVec3 {
    velocity * (-coefficient * velocity.length())
}

/// The rate (1/s) at which the velocity responds: 2 k |v|, or √(k a), at which it settles if an acceleration a drives it.
pub fn rate(coefficient: f64, velocity: DVec3, driving: f64) -> f64 {
    2.0 * coefficient * velocity.length() + (coefficient * driving).sqrt()
}
