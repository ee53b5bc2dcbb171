//! Exponential and logarithm of rotations, and rotation at a constant angular velocity.

use glam::{DMat3, DQuat, DVec3};

use super::cross_product::cross_product_matrix;

/// An angle below which sin x = x and cos x = 1 to rounding, and x² may underflow.
const TINY_ANGLE: f64 = 1e-9;

/// exp: the unit quaternion of the rotation by |v| rad about v/|v|, v being a rotation vector.
///
/// Accurate to rounding for all vectors up to |v| of order 1, the null vector included; for a larger |v|, its own rounding rotates the
/// result by as much. |v|² must not overflow.
///
/// ```
/// use glam::DVec3;
/// use polhode::bodies::toolkit::{exponential, logarithm};
///
/// let v = DVec3::new(0.1, -2.0, 1.0);
/// assert!((logarithm(exponential(v)) - v).length() < 1e-15);
/// ```
pub fn exponential(rotation_vector: DVec3) -> DQuat {
    let angle = rotation_vector.length();
    if angle < TINY_ANGLE {
        let u = 0.5 * rotation_vector;
        return DQuat::from_xyzw(u.x, u.y, u.z, 1.0);
    }
    let (sine, cosine) = (0.5 * angle).sin_cos();
    let u = rotation_vector * (sine / angle);
    DQuat::from_xyzw(u.x, u.y, u.z, cosine)
}

/// exp: the matrix of the rotation by |v| rad about v/|v|, by the formula of O. Rodrigues (J. Math. Pures Appl. 5
/// (1840) 380): 1 + sin θ/θ \[v\]× + (1 − cos θ)/θ² \[v\]×².
pub fn exponential_matrix(rotation_vector: DVec3) -> DMat3 {
    let angle = rotation_vector.length();
    let cross = cross_product_matrix(rotation_vector);
    if angle < TINY_ANGLE {
        return DMat3::IDENTITY + cross;
    }
    // 1 − cos θ = 2 sin²(θ/2) keeps its digits at small angles.
    let half = (0.5 * angle).sin() / (0.5 * angle);
    DMat3::IDENTITY + cross * (angle.sin() / angle) + cross * cross * (0.5 * half * half)
}

/// log: the rotation vector of a quaternion (a unit quaternion; a positive factor does not matter), of length in [0,
/// π].
///
/// Accurate near 0, where the angle comes from the vector part, and near π, where the arc cosine of the scalar part would lose half the
/// digits. At π itself both signs are right; that of the quaternion's vector part is used.
pub fn logarithm(orientation: DQuat) -> DVec3 {
    let q = if orientation.w < 0.0 { -orientation } else { orientation };
    let u = q.xyz();
    let sine = u.length();
    if sine < TINY_ANGLE * q.w {
        return u * (2.0 / q.w);
    }
    u * (2.0 * sine.atan2(q.w) / sine)
}

/// log: the rotation vector of a rotation matrix, of length in [0, π].
pub fn logarithm_matrix(rotation: DMat3) -> DVec3 {
    logarithm(DQuat::from_mat3(&rotation))
}

/// The angle of the rotation from one orientation to the other, rad, in [0, π]: the *attitude error* of this crate.
pub fn attitude_error(a: DQuat, b: DQuat) -> f64 {
    logarithm(a.conjugate() * b).length()
}

/// The orientation after `time` s of a constant angular velocity in *body* axes (rad/s): R(t) = R(0) exp(t ω_B).
///
/// ```
/// use glam::{DQuat, DVec3};
/// use polhode::bodies::toolkit::{rotated_body, rotated_world};
///
/// let start = DQuat::from_rotation_x(1.0);
/// let omega_body = DVec3::new(0.0, 0.3, 0.1);
/// // The same motion, told in world axes.
/// let omega_world = start * omega_body;
/// let (a, b) = (rotated_body(start, omega_body, 2.0), rotated_world(start, omega_world, 2.0));
/// assert!(a.angle_between(b) < 1e-7 && (a - b).length() < 1e-15);
/// ```
pub fn rotated_body(orientation: DQuat, angular_velocity_body: DVec3, time: f64) -> DQuat {
    orientation * exponential(angular_velocity_body * time)
}

/// The orientation after `time` s of a constant angular velocity in *world* axes (rad/s): R(t) = exp(t ω_W) R(0).
pub fn rotated_world(orientation: DQuat, angular_velocity_world: DVec3, time: f64) -> DQuat {
    exponential(angular_velocity_world * time) * orientation
}
