//! Bodies made of point masses: molecules, clouds of samples.

use glam::DVec3;

use super::{InertiaTensor, MassProperties};
use crate::error::{Error, Result};

/// The mass properties of points, each a mass in kg and a position in m.
///
/// I = Σ m \[r\]×ᵀ\[r\]× about the centre of mass (the derivation's equation (5) with the integral a sum). The centre
/// of mass is found first and the tensor is summed about it, so that a far origin costs no digits.
///
/// # Errors
/// [`Error::Item`] with the number of the first point whose mass is negative or not finite or whose position is not
/// finite, and [`Error::Setting`] where the total mass is zero.
///
/// ```
/// use glam::DVec3;
/// use polhode::bodies::inertia::{InertiaClass, classify, point_masses};
///
/// // Carbon monoxide: a linear rotor (one moment vanishes, the other two are equal).
/// let (unit, bond) = (1.66053906892e-27, 112.8e-12);
/// let molecule = point_masses(&[(12.0 * unit, DVec3::ZERO), (15.9949146 * unit, DVec3::Z * bond)])?;
/// let moments = molecule.principal_axes().moments;
/// assert!((moments.z - 1.449e-46).abs() < 1e-49);
/// assert_eq!(classify(moments, 1e-9), InertiaClass::LinearRotor);
/// # Ok::<(), polhode::Error>(())
/// ```
pub fn point_masses(points: &[(f64, DVec3)]) -> Result<MassProperties> {
    let mut mass = 0.0;
    let invalid = |index, field, value, expected| Err(Error::Item { item: "point", index, field, value, expected });
    for (index, &(m, position)) in points.iter().enumerate() {
        if !(m >= 0.0 && m.is_finite()) {
            return invalid(index, "mass", m, "at least 0 and finite");
        }
        if let Some(value) = position.to_array().into_iter().find(|c| !c.is_finite()) {
            return invalid(index, "position", value, "finite components");
        }
        mass += m;
    }
    super::mass_properties::positive("total mass", mass)?;
    let reference = points[0].1;
    let weighted = |about: DVec3| points.iter().map(|&(m, position)| (m / mass) * (position - about)).sum::<DVec3>();
    let first = reference + weighted(reference);
    // Repeated about the result, which recovers what the first pass rounded away.
    let centre_of_mass = first + weighted(first);
    let inertia = points.iter().fold(InertiaTensor::default(), |sum, &(m, position)| {
        sum + InertiaTensor::of_point_mass(m, position - centre_of_mass)
    });
    Ok(MassProperties { mass, volume: 0.0, centre_of_mass, inertia })
}
