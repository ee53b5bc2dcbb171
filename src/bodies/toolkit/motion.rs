//! Energy, momentum and the Newton-Euler equations of rotation. Tensor and vectors are in the same axes.

use glam::DVec3;

use crate::bodies::inertia::InertiaTensor;

/// K_ω = ½ ωᵀ I ω, J (the derivation's equation (5)).
pub fn rotational_kinetic_energy(inertia: &InertiaTensor, angular_velocity: DVec3) -> f64 {
    0.5 * angular_velocity.dot(*inertia * angular_velocity)
}

/// ∂K_ω/∂ω = I ω, kg m²/s, about the centre of mass.
///
/// When a free body changes its shape, this is conserved, and the energy is not. (The derivation says that the Earth slows "to maintain its
/// kinetic energy" when a reservoir is filled. If the energy were kept, the day would lengthen by half as much.)
pub fn angular_momentum(inertia: &InertiaTensor, angular_velocity: DVec3) -> DVec3 {
    *inertia * angular_velocity
}

/// The angle between ω and I ω, rad, in [0, π/2]. It is 0 exactly if ω is an eigenvector of the tensor, and only then does the torque-free
/// body not precess.
///
/// ```
/// use glam::DVec3;
/// use polhode::bodies::inertia::InertiaTensor;
/// use polhode::bodies::toolkit::momentum_angle;
///
/// let inertia = InertiaTensor::from_principal_moments(DVec3::new(1.0, 2.0, 3.0));
/// assert_eq!(momentum_angle(&inertia, DVec3::Y * 7.0), 0.0);
/// assert!((momentum_angle(&inertia, DVec3::new(1e-9, 7.0, 0.0)) - 0.5e-9 / 7.0).abs() < 1e-24);
/// ```
pub fn momentum_angle(inertia: &InertiaTensor, angular_velocity: DVec3) -> f64 {
    let Some(direction) = angular_velocity.try_normalize() else {
        return 0.0;
    };
    let momentum = *inertia * direction;
    direction.cross(momentum).length().atan2(direction.dot(momentum))
}

/// dω/dt = I⁻¹ (τ − ω × I ω), rad/s², in body axes.
///
/// Without torque this is the derivation's equation (9) with the sign corrected: **ω̇ = −I⁻¹ (ω × I ω)**. Equation
/// (8), ω × I ω + I ω̇ = τ, leaves no other; with the sign as printed in (9), the angular momentum in the world would
/// not be conserved. The same holds along world axes with the tensor along them, as ω × ω = 0.
///
/// ```
/// use glam::DVec3;
/// use polhode::bodies::inertia::InertiaTensor;
/// use polhode::bodies::toolkit::{angular_acceleration_body, torque_of_motion};
///
/// let inertia = InertiaTensor::from_principal_moments(DVec3::new(1.0, 2.0, 3.0));
/// let omega = DVec3::new(1.0, 1.0, 1.0);
/// // Euler's equations: (I₂ − I₃)/I₁, (I₃ − I₁)/I₂, (I₁ − I₂)/I₃.
/// let rate = angular_acceleration_body(&inertia, omega, DVec3::ZERO);
/// assert_eq!(rate, DVec3::new(-1.0, 1.0, -1.0 / 3.0));
/// assert!(torque_of_motion(&inertia, omega, rate).length() < 1e-15);
/// ```
pub fn angular_acceleration_body(
    inertia_body: &InertiaTensor,
    angular_velocity_body: DVec3,
    torque_body: DVec3,
) -> DVec3 {
    inertia_body.solve(torque_body - gyroscopic_term(inertia_body, angular_velocity_body))
}

/// ω × I ω, N m.
fn gyroscopic_term(inertia: &InertiaTensor, angular_velocity: DVec3) -> DVec3 {
    angular_velocity.cross(*inertia * angular_velocity)
}

/// τ = ω × I ω + I ω̇, N m: the torque about the centre of mass required for a given motion (the derivation's equation (8)). In world axes
/// this is the rate of the angular momentum: the generalized force of rotation, equation (6).
pub fn torque_of_motion(inertia: &InertiaTensor, angular_velocity: DVec3, angular_acceleration: DVec3) -> DVec3 {
    gyroscopic_term(inertia, angular_velocity) + *inertia * angular_acceleration
}
