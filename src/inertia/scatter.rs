//! Principal moments drawn at random such that every draw is a body.

use glam::DVec3;

use super::mass_properties::{finite, positive};
use super::validation::{InertiaDefect, TRIANGLE_TOLERANCE};
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
/// [`Error::Setting`] where `relative_sigma` is negative or not finite, a moment is not positive or a normal number is
/// not finite, [`Error::Inertia`] where `nominal` breaks the triangle inequality.
///
/// ```
/// use glam::DVec3;
/// use polhode::inertia::scattered_moments;
///
/// let moments = scattered_moments(DVec3::new(1.0, 2.0, 3.0), 0.5, DVec3::new(-2.0, 1.0, 3.0))?;
/// assert!(moments.x + moments.y >= moments.z * (1.0 - 1e-12));
/// # Ok::<(), polhode::Error>(())
/// ```
pub fn scattered_moments(nominal: DVec3, relative_sigma: f64, standard_normals: DVec3) -> Result<DVec3> {
    if !(relative_sigma >= 0.0 && relative_sigma.is_finite()) {
        let expected = "at least 0 and finite";
        return Err(Error::Setting { field: "relative_sigma", value: relative_sigma, expected });
    }
    for moment in nominal.to_array() {
        positive("principal moment", moment)?;
    }
    finite("standard normal numbers", standard_normals)?;
    let half_trace = 0.5 * nominal.element_sum();
    let second = DVec3::splat(half_trace) - nominal;
    let excess = -2.0 * second.min_element() / nominal.max_element();
    if excess > TRIANGLE_TOLERANCE {
        let mut sorted = nominal.to_array();
        sorted.sort_by(f64::total_cmp);
        let moments = DVec3::from_array(sorted);
        return Err(Error::Inertia(InertiaDefect::TriangleInequality { moments, relative_excess: excess }));
    }
    let factor =
        standard_normals.to_array().map(|z| (relative_sigma * z - 0.5 * relative_sigma * relative_sigma).exp());
    let drawn = second.max(DVec3::ZERO) * DVec3::from_array(factor);
    Ok(DVec3::new(drawn.y + drawn.z, drawn.z + drawn.x, drawn.x + drawn.y))
}
