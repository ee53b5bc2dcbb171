//! Principal moments drawn at random such that every draw is a body.

use glam::DVec3;

use super::mass_properties::finite;
use super::validation::Validity;
use crate::error::InertiaDefect;
use crate::error::{Error, Result};

/// One draw of principal moments (kg m²) around `nominal`, from three independent standard normal numbers.
///
/// A scatter of the moments themselves can break the triangle inequality. Here the three second moments
/// s₁ = ∫ρx², s₂, s₃ (I₁ = s₂ + s₃ and cyclic) are each multiplied by exp(σz − ½σ²): a log-normal factor with mean 1
/// and, for small σ = `relative_sigma`, relative deviation σ. Every draw is then a valid tensor by construction, a flat
/// plate stays flat, the mean of the moments is `nominal`, and the components stay in its order, which need
/// not be ascending.
///
/// # Errors
/// [`Error::Setting`] if `relative_sigma` is negative or not finite or a normal number is not finite;
/// [`Error::Inertia`] if no body has the moments `nominal`. A linear rotor, with one moment 0, remains one.
///
/// ```
/// use glam::DVec3;
/// use polhode::bodies::inertia::scattered_moments;
///
/// let moments = scattered_moments(DVec3::new(1.0, 2.0, 3.0), 0.5, DVec3::new(-2.0, 1.0, 3.0))?;
/// assert!(moments.x + moments.y >= moments.z * (1.0 - 1e-12));
/// # Ok::<(), polhode::Error>(())
/// ```
pub fn scattered_moments(nominal: DVec3, relative_sigma: f64, standard_normals: DVec3) -> Result<DVec3> {
    check_scatter(nominal, relative_sigma)?;
    finite("standard normal numbers", standard_normals)?;
    let factor =
        standard_normals.to_array().map(|z| (relative_sigma * z - 0.5 * relative_sigma * relative_sigma).exp());
    Ok(scaled_second_moments(nominal, DVec3::from_array(factor)))
}

/// Refuses parameters from which [`scattered_moments`] cannot draw.
pub(crate) fn check_scatter(nominal: DVec3, relative_sigma: f64) -> Result<()> {
    if !(relative_sigma >= 0.0 && relative_sigma.is_finite()) {
        let expected = "at least 0 and finite";
        return Err(Error::Setting { field: "relative_sigma", value: relative_sigma, expected });
    }
    match Validity::of(&nominal.into()).defect() {
        None | Some(InertiaDefect::VanishingMoment { .. }) => Ok(()),
        Some(defect) => Err(Error::Inertia(defect)),
    }
}

/// The moments of a body whose second moments along the axes of `nominal` are multiplied by `factors`.
pub(crate) fn scaled_second_moments(nominal: DVec3, factors: DVec3) -> DVec3 {
    let second = DVec3::splat(0.5 * nominal.element_sum()) - nominal;
    let drawn = second.max(DVec3::ZERO) * factors;
    DVec3::new(drawn.y + drawn.z, drawn.z + drawn.x, drawn.x + drawn.y)
}
