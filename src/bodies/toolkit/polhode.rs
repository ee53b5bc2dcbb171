//! The kind of curve that the angular velocity of a torque-free body follows.

use glam::DVec3;

use crate::bodies::inertia::InertiaTensor;

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

/// Whether ω is an eigenvector of the tensor, so that a torque-free body does not precess: [`momentum_angle`] of at
/// most `tolerance` rad. A body at rest does not precess.
pub fn is_without_precession(inertia: &InertiaTensor, angular_velocity: DVec3, tolerance: f64) -> bool {
    momentum_angle(inertia, angular_velocity) <= tolerance
}

/// The kind of polhode: the curve of ω on the inertia ellipsoid (L. Poinsot, *Théorie nouvelle de la rotation des
/// corps*, 1834).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PolhodeClass {
    /// ω = 0.
    Rest,
    /// A point: ω along a principal axis (any axis of a sphere), a steady rotation.
    Steady,
    /// A circle about the axis of symmetry.
    Circle,
    /// A closed curve around the axis of the smallest moment.
    AroundSmallest,
    /// A closed curve around the axis of the largest moment.
    AroundLargest,
    /// The curve that runs from one direction of the middle axis to the other, and never arrives.
    Separatrix,
}

/// The polhode of a torque-free motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Polhode {
    /// Its kind.
    pub class: PolhodeClass,
    /// (L² − 2 T I₂)/L²: positive around the axis of the largest moment, negative around that of the smallest, 0 on the
    /// separatrix; between (I₁ − I₂)/I₁ and (I₃ − I₂)/I₃.
    pub discriminant: f64,
}

/// The polhode of a torque-free body with principal `moments` (ascending, kg m²) and angular velocity along the
/// principal axes, rad/s.
///
/// With D = L² − 2 T I₂ = I₃(I₃ − I₂) ω₃² − I₁(I₂ − I₁) ω₁²: the motion circles about axis 3 if D > 0, about axis 1 if D < 0. Two moments
/// count as equal if they differ by at most `tolerance` of the largest; |D| counts as 0 if it is at most `tolerance` of the sum of its two
/// terms; the motion counts as steady if ω lies within `tolerance` rad of I ω.
///
/// ```
/// use glam::DVec3;
/// use polhode::bodies::toolkit::{PolhodeClass, polhode};
///
/// let moments = DVec3::new(1.0, 2.0, 3.0);
/// assert_eq!(polhode(moments, DVec3::new(0.1, 0.1, 1.0), 1e-12).class, PolhodeClass::AroundLargest);
/// assert_eq!(polhode(moments, DVec3::new(1.0, 0.1, 0.1), 1e-12).class, PolhodeClass::AroundSmallest);
/// assert_eq!(polhode(moments, DVec3::Y, 1e-12).class, PolhodeClass::Steady);
/// ```
pub fn polhode(moments: DVec3, angular_velocity_principal: DVec3, tolerance: f64) -> Polhode {
    let Some(direction) = angular_velocity_principal.try_normalize() else {
        return Polhode { class: PolhodeClass::Rest, discriminant: 0.0 };
    };
    // Only ratios matter; in units of the largest moment nothing underflows.
    let unit = moments / moments.z;
    let momentum = unit * direction;
    let around_largest = unit.z * (unit.z - unit.y) * direction.z * direction.z;
    let around_smallest = unit.x * (unit.y - unit.x) * direction.x * direction.x;
    let difference = around_largest - around_smallest;
    let class = if momentum_angle(&InertiaTensor::from_principal_moments(unit), direction) <= tolerance {
        PolhodeClass::Steady
    } else if unit.y - unit.x <= tolerance || unit.z - unit.y <= tolerance {
        PolhodeClass::Circle
    } else if difference.abs() <= tolerance * (around_largest + around_smallest) {
        PolhodeClass::Separatrix
    } else if difference > 0.0 {
        PolhodeClass::AroundLargest
    } else {
        PolhodeClass::AroundSmallest
    };
    Polhode { class, discriminant: difference / momentum.length_squared() }
}
