//! Exponential and logarithm of rotations.

use glam::{DQuat, DVec3};

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

/// The angle of the rotation from one orientation to the other, rad, in [0, π]: the *attitude error* of this crate.
pub fn attitude_error(a: DQuat, b: DQuat) -> f64 {
    logarithm(a.conjugate() * b).length()
}
