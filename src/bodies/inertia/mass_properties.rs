//! Mass, centre of mass and inertia of a body, and how they change if it is moved or made heavier.

use glam::{DQuat, DVec3};

use super::InertiaTensor;
use super::principal::{PrincipalAxes, principal_axes};
use crate::error::{Error, Result};

/// The properties of a mass distribution that matter for the motion of a rigid body.
///
/// Position and axes are those of the frame in which the body was described (its *own* frame), which need not have its
/// origin at the centre of mass.
///
/// ```
/// use glam::{DQuat, DVec3};
/// use polhode::bodies::inertia::Shape;
///
/// let cone = Shape::Cone { radius: 1.0, height: 2.0 }.mass_properties(5.0)?;
/// assert_eq!(cone.centre_of_mass, DVec3::new(0.0, 0.0, 0.5));
/// // Huygens and Steiner: to the apex.
/// let about_apex = cone.inertia_about(DVec3::Z * 2.0);
/// assert!((about_apex.xx - cone.inertia.xx - 5.0 * 1.5 * 1.5).abs() < 1e-14);
/// // Twice the mass, lying on its side elsewhere; and with the offset taken off.
/// assert_eq!(cone.with_mass(10.0)?.inertia, cone.inertia * 2.0);
/// let lying = cone.placed(DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2), DVec3::X);
/// assert!((lying.inertia.yy - cone.inertia.zz).abs() < 1e-14);
/// assert_eq!(lying.centred().centre_of_mass, DVec3::ZERO);
/// # Ok::<(), polhode::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MassProperties {
    /// kg.
    pub mass: f64,
    /// m³; 0 for points, rods, plates and shells.
    pub volume: f64,
    /// m, in the body's own frame.
    pub centre_of_mass: DVec3,
    /// About the centre of mass, along the axes of the body's own frame, kg m².
    pub inertia: InertiaTensor,
}

impl MassProperties {
    /// Mass over volume, kg/m³, or `None` without a volume.
    pub fn density(&self) -> Option<f64> {
        (self.volume > 0.0).then(|| self.mass / self.volume)
    }

    /// Principal moments and axes about the centre of mass.
    pub fn principal_axes(&self) -> PrincipalAxes {
        principal_axes(&self.inertia)
    }

    /// The inertia tensor about `point` (own frame, m) by the parallel-axis theorem: I + m \[d\]×ᵀ\[d\]×, d from the
    /// centre of mass to the point (J. Steiner; C. Huygens, *Horologium oscillatorium*, 1673).
    pub fn inertia_about(&self, point: DVec3) -> InertiaTensor {
        self.inertia + InertiaTensor::of_point_mass(self.mass, point - self.centre_of_mass)
    }

    /// The body turned by `orientation` (unit quaternion) about the origin of its frame and then moved by `position` m.
    pub fn placed(&self, orientation: DQuat, position: DVec3) -> Self {
        Self {
            mass: self.mass,
            volume: self.volume,
            centre_of_mass: orientation * self.centre_of_mass + position,
            inertia: self.inertia.rotated(orientation),
        }
    }

    /// The body with its centre of mass moved to the origin.
    pub fn centred(&self) -> Self {
        Self { centre_of_mass: DVec3::ZERO, ..*self }
    }

    /// The body of the same shape with another mass, kg.
    ///
    /// # Errors
    /// [`Error::Setting`] where `mass` is not positive and finite, or the present mass is zero.
    pub fn with_mass(&self, mass: f64) -> Result<Self> {
        positive("mass", mass)?;
        positive("present mass", self.mass)?;
        Ok(Self { mass, inertia: self.inertia * (mass / self.mass), ..*self })
    }

    /// The body of the same shape with another density, kg/m³.
    ///
    /// # Errors
    /// [`Error::Setting`] where `density` is not positive and finite, or the body has no volume.
    pub fn with_density(&self, density: f64) -> Result<Self> {
        positive("density", density)?;
        positive("volume", self.volume)?;
        self.with_mass(density * self.volume)
    }
}

/// `value` if it is positive and finite.
pub(crate) fn positive(field: &'static str, value: f64) -> Result<f64> {
    if value > 0.0 && value.is_finite() {
        Ok(value)
    } else {
        Err(Error::Setting { field, value, expected: "a positive, finite number" })
    }
}

/// `value` if all its components are finite.
pub(super) fn finite(field: &'static str, value: DVec3) -> Result<DVec3> {
    match value.to_array().into_iter().find(|c| !c.is_finite()) {
        None => Ok(value),
        Some(value) => Err(Error::Setting { field, value, expected: "finite components" }),
    }
}
