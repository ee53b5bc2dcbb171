//! The Newton-Euler equations, forwards (forces to accelerations) and backwards.

use glam::{DQuat, DVec3};

use crate::bodies::inertia::{InertiaTensor, MassProperties};

/// dω/dt = I⁻¹ (τ − ω × I ω), rad/s², everything in body axes.
///
/// Without torque this is the derivation's equation (9) with the sign corrected: **ω̇ = −I⁻¹ (ω × I ω)**. Equation
/// (8), ω × I ω + I ω̇ = τ, leaves no other; with the sign as printed in (9), the angular momentum in the world would
/// not be conserved.
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

/// dω/dt in world axes, rad/s², of a body with the tensor `inertia_body` in its own axes: I_W⁻¹ (τ − ω × I_W ω), I_W
/// = R I Rᵀ.
///
/// It is the body-axes result rotated to the world, R ω̇_B: the derivative of ω is the same vector in both frames, as ω × ω = 0.
pub fn angular_acceleration_world(
    inertia_body: &InertiaTensor,
    orientation: DQuat,
    angular_velocity_world: DVec3,
    torque_world: DVec3,
) -> DVec3 {
    // Solved in body axes, where the tensor has not been rounded by a rotation.
    let to_body = orientation.conjugate();
    orientation * angular_acceleration_body(inertia_body, to_body * angular_velocity_world, to_body * torque_world)
}

/// ω × I ω, N m, the gyroscopic term; tensor and angular velocity in the same axes.
pub fn gyroscopic_term(inertia: &InertiaTensor, angular_velocity: DVec3) -> DVec3 {
    angular_velocity.cross(*inertia * angular_velocity)
}

/// τ = ω × I ω + I ω̇, N m: the torque about the centre of mass required for a given motion (the derivation's equation (8)), all in the
/// same axes. In world axes this is the rate of the angular momentum: the generalized force of rotation, equation (6).
pub fn torque_of_motion(inertia: &InertiaTensor, angular_velocity: DVec3, angular_acceleration: DVec3) -> DVec3 {
    gyroscopic_term(inertia, angular_velocity) + *inertia * angular_acceleration
}

/// F = m a, N: the force required for a given motion of the centre of mass (the derivation's equation (7)).
pub fn force_of_motion(mass: f64, acceleration: DVec3) -> DVec3 {
    acceleration * mass
}

/// Force and torque upon a body.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wrench {
    /// N.
    pub force: DVec3,
    /// About the centre of mass, N m.
    pub torque: DVec3,
}

impl Wrench {
    /// The wrench of a force (N) that acts at `offset` m from the centre of mass.
    pub fn of_force_at(force: DVec3, offset: DVec3) -> Self {
        Self { force, torque: offset.cross(force) }
    }
}

impl std::ops::Add for Wrench {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self { force: self.force + other.force, torque: self.torque + other.torque }
    }
}

/// Rates of velocity and angular velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accelerations {
    /// Acceleration of the centre of mass, m/s², in an inertial frame, along the axes of the equation used.
    pub linear: DVec3,
    /// rad/s².
    pub angular: DVec3,
}

/// The right-hand side of the Newton-Euler equations with all vectors along the body's axes.
///
/// `linear` is the acceleration of the centre of mass relative to an inertial frame, F/m, in components along the body axes; the rate of
/// the velocity's components along body axes is `linear` less ω × v.
pub fn newton_euler_body(body: &MassProperties, angular_velocity_body: DVec3, wrench_body: Wrench) -> Accelerations {
    Accelerations {
        linear: wrench_body.force / body.mass,
        angular: angular_acceleration_body(&body.inertia, angular_velocity_body, wrench_body.torque),
    }
}

/// The right-hand side of the Newton-Euler equations with all vectors in world axes; the tensor of `body` is in body
/// axes.
///
/// ```
/// use glam::{DQuat, DVec3};
/// use polhode::bodies::inertia::Shape;
/// use polhode::bodies::toolkit::{Wrench, newton_euler_world};
///
/// let rod = Shape::Box { edges: DVec3::new(1.0, 0.1, 0.1) }.mass_properties(2.0)?;
/// // A push at the end of a resting rod: it moves as if pushed in the middle, and turns.
/// let push = Wrench::of_force_at(DVec3::Y * 3.0, DVec3::X * 0.5);
/// let rates = newton_euler_world(&rod, DQuat::IDENTITY, DVec3::ZERO, push);
/// assert_eq!(rates.linear, DVec3::Y * 1.5);
/// assert!((rates.angular.z - 1.5 / rod.inertia.zz).abs() < 1e-15);
/// # Ok::<(), polhode::Error>(())
/// ```
pub fn newton_euler_world(
    body: &MassProperties,
    orientation: DQuat,
    angular_velocity_world: DVec3,
    wrench_world: Wrench,
) -> Accelerations {
    Accelerations {
        linear: wrench_world.force / body.mass,
        angular: angular_acceleration_world(&body.inertia, orientation, angular_velocity_world, wrench_world.torque),
    }
}
