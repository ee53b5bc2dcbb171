//! Defects of an inertia tensor.

use glam::DVec3;

use super::Error;

/// How far I₁ + I₂ may fall below I₃, relative to I₃, before a tensor is refused: the effect of rounding on a flat plate.
pub const TRIANGLE_TOLERANCE: f64 = 1e-12;

/// Why a tensor is not that of a rigid body that can spin about every axis.
///
/// All tensors are judged by this one rule, that of [`crate::bodies::inertia::Validity`], wherever they come from: ensembles, study files
/// and tables.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum InertiaDefect {
    /// An element is infinite or not a number.
    #[error("{element} = {value}: expected a finite number")]
    NotFinite {
        /// Name of the element: ixx, iyy, izz, ixy, ixz or iyz.
        element: &'static str,
        /// Its value.
        value: f64,
    },
    /// The largest moment is not positive: there is no inertia at all.
    #[error("largest principal moment = {largest} kg m²: expected a positive number")]
    NoInertia {
        /// The largest principal moment, kg m².
        largest: f64,
    },
    /// A principal moment is negative beyond rounding.
    #[error(
        "least principal moment = {moment} kg m² ({relative:e} of the largest): all must be positive; off-diagonal \
         elements are −∫ρxy, and with the opposite sign the moments can come out negative"
    )]
    NegativeMoment {
        /// The least principal moment, kg m².
        moment: f64,
        /// Its ratio to the largest.
        relative: f64,
    },
    /// A principal moment is zero to rounding while the triangle inequality holds, so that the other two are equal: a linear
    /// rotor, which has no spin about its axis. An [`crate::Ensemble`] accepts it as a linear rotor.
    #[error(
        "least principal moment = {moment} kg m² ({relative:e} of the largest): zero to rounding, as for a linear rotor, \
         which cannot spin about its axis"
    )]
    VanishingMoment {
        /// The least principal moment, kg m².
        moment: f64,
        /// Its ratio to the largest.
        relative: f64,
    },
    /// I₁ + I₂ is less than I₃, which no distribution of positive mass has.
    #[error(
        "principal moments {}, {}, {} kg m²: the largest exceeds the sum of the others by {relative_excess:e} of itself; \
         at most {TRIANGLE_TOLERANCE:e} is rounding",
        .moments.x, .moments.y, .moments.z
    )]
    TriangleInequality {
        /// Principal moments, ascending, kg m².
        moments: DVec3,
        /// (I₃ − I₁ − I₂)/I₃.
        relative_excess: f64,
    },
}

impl InertiaDefect {
    /// The error for the body of an ensemble that has this defect.
    pub(crate) fn of_body(&self, body: usize) -> Error {
        let (field, value, expected) = match *self {
            Self::NotFinite { element, value } => (element, value, "expected a finite number"),
            Self::NoInertia { largest } => {
                ("the greatest principal moment of inertia", largest, "expected a positive number (kg m²)")
            }
            Self::NegativeMoment { moment, .. } | Self::VanishingMoment { moment, .. } => {
                ("the least principal moment of inertia", moment, "expected a positive definite tensor (kg m²)")
            }
            Self::TriangleInequality { moments, .. } => (
                "I1 + I2 - I3",
                moments.x + moments.y - moments.z,
                "no mass distribution has this tensor: I1 + I2 >= I3 is needed (principal moments, kg m²)",
            ),
        };
        Error::Body { body, field, value, expected }
    }
}
