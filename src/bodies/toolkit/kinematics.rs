//! Velocity and acceleration of the points of a moving body.

use glam::{DQuat, DVec3};

/// v(r) = ω × r + ẋ, m/s (the derivation's equation (3)): the velocity of the point at `offset` m from the centre of
/// mass, which moves with `centre_velocity`. All vectors in the same axes.
pub fn velocity_of_point(centre_velocity: DVec3, angular_velocity: DVec3, offset: DVec3) -> DVec3 {
    angular_velocity.cross(offset) + centre_velocity
}

/// a(r) = ẍ + ω̇ × r + ω × (ω × r), m/s²: the acceleration of the point at `offset` m from the centre of mass, in an
/// inertial frame (along any axes).
///
/// ```
/// use glam::DVec3;
/// use polhode::bodies::toolkit::acceleration_of_point;
///
/// // The rim of a wheel that spins up: centripetal and tangential part.
/// let a = acceleration_of_point(DVec3::ZERO, DVec3::Z * 3.0, DVec3::Z * 0.5, DVec3::X * 2.0);
/// assert_eq!(a, DVec3::new(-18.0, 1.0, 0.0));
/// ```
pub fn acceleration_of_point(
    centre_acceleration: DVec3,
    angular_velocity: DVec3,
    angular_acceleration: DVec3,
    offset: DVec3,
) -> DVec3 {
    let centripetal = angular_velocity.cross(angular_velocity.cross(offset));
    centre_acceleration + angular_acceleration.cross(offset) + centripetal
}

/// dq/dt = ½ q ω, 1/s, for an angular velocity in body axes.
pub fn orientation_rate_body(orientation: DQuat, angular_velocity_body: DVec3) -> DQuat {
    orientation * pure(0.5 * angular_velocity_body)
}

/// dq/dt = ½ ω q, 1/s, for an angular velocity in world axes.
pub fn orientation_rate_world(orientation: DQuat, angular_velocity_world: DVec3) -> DQuat {
    pure(0.5 * angular_velocity_world) * orientation
}

fn pure(v: DVec3) -> DQuat {
    DQuat::from_xyzw(v.x, v.y, v.z, 0.0)
}

/// The line about which a body turns and along which it slides at an instant (G. Mozzi 1763; M. Chasles 1830).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InstantaneousAxis {
    /// The point of the line nearest to the centre of mass, m.
    pub point: DVec3,
    /// Unit vector along the angular velocity.
    pub direction: DVec3,
    /// Rate of turning, rad/s.
    pub rate: f64,
    /// Velocity of the points on the line, along it, m/s; 0 for a pure rotation.
    pub slide: f64,
}

/// The instantaneous axis of a body whose centre of mass is at `centre` and moves with `centre_velocity`, all in the
/// same axes; `None` for a body that does not turn.
///
/// ```
/// use glam::DVec3;
/// use polhode::bodies::toolkit::instantaneous_axis;
///
/// // A wheel of radius 0.5 that rolls along x turns about the point where it touches the ground.
/// let axis = instantaneous_axis(DVec3::Y * 0.5, DVec3::X * 2.0, DVec3::Z * -4.0).unwrap();
/// assert_eq!((axis.point, axis.rate, axis.slide), (DVec3::ZERO, 4.0, 0.0));
/// ```
pub fn instantaneous_axis(centre: DVec3, centre_velocity: DVec3, angular_velocity: DVec3) -> Option<InstantaneousAxis> {
    let direction = angular_velocity.try_normalize()?;
    let rate = angular_velocity.length();
    let point = centre + direction.cross(centre_velocity) / rate;
    Some(InstantaneousAxis { point, direction, rate, slide: direction.dot(centre_velocity) })
}
