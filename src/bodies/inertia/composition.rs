//! Bodies put together from parts, and parts taken away.

use glam::{DQuat, DVec3};

use super::validation::Validity;
use super::{InertiaTensor, MassProperties};
use crate::error::InertiaDefect;
use crate::error::{Error, Result};

/// A part of a body: mass properties in the part's own frame, and where that frame is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part {
    /// Properties of the part alone, in its own frame; for a hole, those of the missing matter.
    pub properties: MassProperties,
    /// Rotates the part's axes to the body's (a unit quaternion).
    pub orientation: DQuat,
    /// Position of the part's origin, body frame, m.
    pub position: DVec3,
    /// Whether the part is subtracted.
    pub is_hole: bool,
}

impl Part {
    /// A part at the body's origin, along the body's axes.
    pub fn new(properties: MassProperties) -> Self {
        Self { properties, orientation: DQuat::IDENTITY, position: DVec3::ZERO, is_hole: false }
    }

    /// The same part, subtracted instead of added.
    pub fn as_hole(self) -> Self {
        Self { is_hole: true, ..self }
    }

    /// The same part with its origin at `position` m, body frame.
    pub fn at(self, position: DVec3) -> Self {
        Self { position, ..self }
    }

    /// The same part with its axes turned to the body's by `orientation`.
    pub fn oriented(self, orientation: DQuat) -> Self {
        Self { orientation, ..self }
    }
}

/// The deviation of |q| from 1 from which on it is a mistake rather than rounding.
const UNIT_TOLERANCE: f64 = 1e-6;

/// The body that consists of `parts`, holes taken away, in the body's frame.
///
/// The centre of mass is found first, and every part's tensor is moved there by the parallel-axis theorem. Whether
/// parts overlap, or holes lie within matter, is not checked; only the result must be a valid body.
///
/// # Errors
/// [`Error::Item`] with the number of the part whose mass is not positive, whose position is not finite or whose
/// orientation is not a unit quaternion; [`Error::Setting`] where the masses' sum is not positive;
/// [`Error::Inertia`] where the holes leave a tensor that no body has.
///
/// ```
/// use glam::DVec3;
/// use polhode::bodies::inertia::{Part, Shape, compose};
///
/// // A tube is a cylinder less its bore.
/// let outside = Shape::Cylinder { radius: 2.0, height: 1.0 }.mass_properties_of_density(1000.0)?;
/// let bore = Shape::Cylinder { radius: 1.0, height: 1.0 }.mass_properties_of_density(1000.0)?;
/// let body = compose(&[Part::new(outside), Part::new(bore).as_hole()])?;
/// let tube = Shape::Tube { inner_radius: 1.0, outer_radius: 2.0, height: 1.0 }.mass_properties_of_density(1000.0)?;
/// assert!((body.inertia - tube.inertia).norm() < 1e-15 * tube.inertia.norm());
/// # Ok::<(), polhode::Error>(())
/// ```
pub fn compose(parts: &[Part]) -> Result<MassProperties> {
    let invalid = |index, field, value, expected| Err(Error::Item { item: "part", index, field, value, expected });
    let mut placed = Vec::with_capacity(parts.len());
    for (index, part) in parts.iter().enumerate() {
        let mass = part.properties.mass;
        if !(mass > 0.0 && mass.is_finite()) {
            let expected = "positive and finite (a hole has the mass of what is missing)";
            return invalid(index, "mass", mass, expected);
        }
        let norm = part.orientation.length();
        // False for NaN.
        let is_unit = (norm - 1.0).abs() <= UNIT_TOLERANCE;
        if !is_unit {
            return invalid(index, "length of the orientation", norm, "a unit quaternion");
        }
        for (field, place) in [("position", part.position), ("centre of mass", part.properties.centre_of_mass)] {
            if let Some(value) = place.to_array().into_iter().find(|c| !c.is_finite()) {
                return invalid(index, field, value, "finite components");
            }
        }
        let sign = if part.is_hole { -1.0 } else { 1.0 };
        placed.push((sign, part.properties.placed(part.orientation.normalize(), part.position)));
    }
    let mass = super::mass_properties::positive("mass of all parts", placed.iter().map(|(s, p)| s * p.mass).sum())?;
    let volume = placed.iter().map(|(s, p)| s * p.volume).sum();
    let reference = placed[0].1.centre_of_mass;
    let weighted =
        |about: DVec3| placed.iter().map(|(s, p)| (s * p.mass / mass) * (p.centre_of_mass - about)).sum::<DVec3>();
    let first = reference + weighted(reference);
    let centre_of_mass = first + weighted(first);
    let inertia =
        placed.iter().fold(InertiaTensor::default(), |sum, (s, p)| sum + p.inertia_about(centre_of_mass) * *s);
    let body = MassProperties { mass, volume, centre_of_mass, inertia };
    match Validity::of(&inertia).defect() {
        // A composition may be a rod or a point: only what no distribution of matter has is refused here.
        None | Some(InertiaDefect::VanishingMoment { .. }) => Ok(body),
        Some(InertiaDefect::NoInertia { largest: 0.0 }) => Ok(body),
        Some(defect) => Err(Error::Inertia(defect)),
    }
}
