//! Steps that each body chooses.

use crate::error::{Error, Result};
use crate::kernel::method::rk8_adaptive::{LEAST_STEP, Limits, least_tolerance};
use crate::kernel::method::taylor::LEAST_OF_SERIES;
use crate::math::Precision;
use crate::math::real::Real;

/// What is required of adaptive steps.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "study", derive(serde::Serialize, serde::Deserialize))]
pub struct AdaptiveSteps {
    /// Error of one step: of the quaternion's components, and of the angular momentum's relative to its magnitude; at
    /// least [`least_tolerance`] of the arithmetic, below 1.
    pub tolerance: f64,
    /// A body that would need a shorter step, s, is flagged and left as it stands; a step of `taylor` that ends where a torque's formula
    /// decides otherwise may be shorter. `None`:
    /// [`LEAST_STEP`] in units of the body's own time, about the time of a radian.
    pub least_step: Option<f64>,
}

/// An interval of this part of the time at its end lies between neighbouring numbers, about: a torque may jump in it.
const AT_ONCE: f64 = 4.0 * f64::EPSILON;
/// A tolerance that every step meets.
const ANY: f64 = 1e30;

impl AdaptiveSteps {
    /// What is required of the steps of an interval that lasts `span` s up to `end` s. Where a torque jumps between two neighbouring numbers, one step
    /// goes from one to the other: it is as short as can be, and taken as it comes out. On a body at rest its error would be as great as all
    /// that it has gained.
    pub(crate) fn over(self, span: f64, end: f64) -> Self {
        if span <= AT_ONCE * end { Self { tolerance: ANY, ..self } } else { self }
    }

    /// Tolerance and least step in the units of a body with this reference rate.
    #[inline(always)]
    pub(crate) fn limits<R: Real>(&self, rate: R) -> Limits<R> {
        let least_step = match self.least_step {
            Some(seconds) => R::splat(seconds) * rate,
            None => R::splat(LEAST_STEP),
        };
        Limits { tolerance: R::splat(self.tolerance), least_step }
    }

    /// Refuses values that are out of range in an arithmetic.
    ///
    /// # Errors
    ///
    /// [`Error::Setting`] for a tolerance below [`least_tolerance`] or of 1 and above, and for a least step that is not
    /// finite and above zero.
    pub fn check(&self, precision: Precision) -> Result<()> {
        self.check_from(least_tolerance(precision), precision)
    }

    /// As [`AdaptiveSteps::check`] for series, of which finer ones than any that are asked for show the errors of these: what they leave out is below
    /// rounding down to [`LEAST_OF_SERIES`].
    pub(crate) fn check_series(&self) -> Result<()> {
        self.check_from(LEAST_OF_SERIES, Precision::F64)
    }

    fn check_from(&self, least: f64, precision: Precision) -> Result<()> {
        let wrong = |field, value, expected| Err(Error::Setting { field, value, expected });
        if !(self.tolerance > 0.0 && self.tolerance < 1.0) {
            return wrong("tolerance", self.tolerance, "expected a number above 0 and below 1");
        }
        if self.tolerance < least {
            let expected = match precision {
                Precision::F32 => "rounding in f32 hides smaller errors than 1e-6: use 1e-6 or more, or precision f64",
                Precision::F64 => "rounding in f64 hides smaller errors than 2e-15: use 2e-15 or more",
            };
            return wrong("tolerance", self.tolerance, expected);
        }
        match self.least_step {
            Some(step) if !(step.is_finite() && step > 0.0) => {
                wrong("least_step", step, "expected a finite step above zero (s)")
            }
            _ => Ok(()),
        }
    }
}
