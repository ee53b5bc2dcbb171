//! Whether a tensor can be that of a rigid body, how far it is from one, and the repair of measured tensors.

use glam::DVec3;

use super::InertiaTensor;
use super::principal::{PrincipalAxes, principal_axes};
use crate::error::InertiaDefect;
use crate::error::TRIANGLE_TOLERANCE;
use crate::error::{Error, Result};

/// Relative size below which a principal moment counts as vanished rather than small. A tensor's elements do not
/// determine its least moment any better than a few units of 2⁻⁵³ of the largest.
pub const VANISHING_MOMENT: f64 = 1e-14;

/// How far a tensor is from valid.
///
/// ```
/// use glam::DVec3;
/// use polhode::bodies::inertia::{InertiaTensor, Validity};
///
/// let measured = InertiaTensor::from_principal_moments(DVec3::new(1.0, 2.0, 3.03));
/// let validity = Validity::of(&measured);
/// assert!(validity.defect().is_some());
/// assert!((validity.relative_excess - 0.03 / 3.03).abs() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Validity {
    /// Principal moments and axes; NaN where an element is not finite.
    pub axes: PrincipalAxes,
    /// I₁/I₃; must be positive.
    pub least_over_largest: f64,
    /// (I₃ − I₁ − I₂)/I₃: at most [`TRIANGLE_TOLERANCE`] for a valid tensor, 0 for a flat plate, −1 for a sphere.
    pub relative_excess: f64,
    not_finite: Option<(&'static str, f64)>,
}

impl Validity {
    /// Examines `tensor`.
    pub fn of(tensor: &InertiaTensor) -> Self {
        let names = ["ixx", "iyy", "izz", "ixy", "ixz", "iyz"];
        let not_finite = names.into_iter().zip(tensor.to_array()).find(|(_, value)| !value.is_finite());
        let axes = principal_axes(tensor);
        let [smallest, middle, largest] = axes.moments.to_array();
        Self {
            axes,
            least_over_largest: smallest / largest,
            relative_excess: ((largest - middle) - smallest) / largest,
            not_finite,
        }
    }

    /// The most serious defect of the tensor, if any; none where it is that of a rigid body that can spin about every axis.
    pub fn defect(&self) -> Option<InertiaDefect> {
        if let Some((element, value)) = self.not_finite {
            return Some(InertiaDefect::NotFinite { element, value });
        }
        let moments = self.axes.moments;
        if moments.z <= 0.0 || moments.z.is_nan() {
            return Some(InertiaDefect::NoInertia { largest: moments.z });
        }
        let relative = self.least_over_largest;
        if relative < -VANISHING_MOMENT {
            return Some(InertiaDefect::NegativeMoment { moment: moments.x, relative });
        }
        if self.relative_excess > TRIANGLE_TOLERANCE {
            return Some(InertiaDefect::TriangleInequality { moments, relative_excess: self.relative_excess });
        }
        (relative <= VANISHING_MOMENT).then_some(InertiaDefect::VanishingMoment { moment: moments.x, relative })
    }
}

/// What [`repair_triangle_inequality`] did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Repair {
    /// The repaired tensor.
    pub tensor: InertiaTensor,
    /// Principal moments before, ascending, kg m².
    pub moments_before: DVec3,
    /// Principal moments after, ascending, kg m².
    pub moments_after: DVec3,
    /// |change of the tensor| / |tensor| in the Frobenius norm; 0 if no repair was needed.
    pub relative_change: f64,
}

/// The nearest tensor to a measured one (in the Frobenius norm) that fulfils the triangle inequality.
///
/// Measured tensors of flat bodies break I₁ + I₂ ≥ I₃ by the errors of their moments. With e = I₃ − I₁ − I₂ > 0 the nearest tensor of the
/// set has the same axes and the moments I₁ + e/3, I₂ + e/3, I₃ − e/3 (projection onto the plane I₁ + I₂ = I₃). A repair is made only on
/// request, and the result says what has changed. A valid tensor is returned unchanged.
///
/// # Errors
/// [`Error::Inertia`] if the tensor has another defect, or would change by more than `largest_relative_change`:
/// then it is wrong rather than imprecise.
///
/// ```
/// use glam::DVec3;
/// use polhode::bodies::inertia::{InertiaTensor, repair_triangle_inequality};
///
/// let measured = InertiaTensor::from_principal_moments(DVec3::new(1.0, 2.0, 3.03));
/// let repair = repair_triangle_inequality(&measured, 0.01)?;
/// assert!((repair.moments_after - DVec3::new(1.01, 2.01, 3.02)).abs().max_element() < 1e-14);
/// assert!(repair_triangle_inequality(&measured, 0.001).is_err());
/// # Ok::<(), polhode::Error>(())
/// ```
pub fn repair_triangle_inequality(tensor: &InertiaTensor, largest_relative_change: f64) -> Result<Repair> {
    let validity = Validity::of(tensor);
    let moments_before = validity.axes.moments;
    match validity.defect() {
        None => Ok(Repair { tensor: *tensor, moments_before, moments_after: moments_before, relative_change: 0.0 }),
        Some(defect @ InertiaDefect::TriangleInequality { .. }) => {
            let third = ((moments_before.z - moments_before.y) - moments_before.x) / 3.0;
            let moments_after = moments_before + DVec3::new(third, third, -third);
            let relative_change = third * 3.0_f64.sqrt() / moments_before.length();
            // Only the change is rotated into body axes, so that the rest of the tensor keeps its digits.
            let change = InertiaTensor::from_principal_moments(DVec3::new(third, third, -third))
                .rotated(validity.axes.principal_to_body);
            if relative_change <= largest_relative_change && moments_after.x > 0.0 {
                Ok(Repair { tensor: *tensor + change, moments_before, moments_after, relative_change })
            } else {
                Err(Error::Inertia(defect))
            }
        }
        Some(defect) => Err(Error::Inertia(defect)),
    }
}
