//! Elementary functions as evaluators call them: the one place that maps [`Function`] to its implementation.

use crate::math::elementary::functions::{acos, arctangent_ratio, asin, atan2, exp, ln, pow, tan};
use crate::math::kepler::eccentric_anomaly;
use crate::math::real::{Function, Real, sin_cos};

/// A function of one argument other than sine and cosine, which are computed together.
#[inline(always)]
pub(super) fn of_one<R: Real>(function: Function, x: R) -> R {
    match function {
        Function::Tan => tan(x),
        Function::Asin => asin(x),
        Function::Acos => acos(x),
        Function::Exp => exp(x),
        Function::Ln => ln(x),
        Function::ArctangentRatio => arctangent_ratio(x),
        // These have two arguments or are computed in pairs.
        Function::Sin | Function::Cos | Function::Atan2 | Function::Pow | Function::KeplerSin | Function::KeplerCos => {
            R::splat(f64::NAN)
        }
    }
}

/// A function of two arguments other than those of Kepler's equation, which are computed together.
#[inline(always)]
pub(super) fn of_two<R: Real>(function: Function, a: R, b: R) -> R {
    match function {
        Function::Atan2 => atan2(a, b),
        Function::Pow => pow(a, b),
        _ => R::splat(f64::NAN),
    }
}

/// Any function of one argument, of a constant.
pub(super) fn of_constant(function: Function, x: f64) -> f64 {
    match function {
        Function::Sin => sin_cos(x).0,
        Function::Cos => sin_cos(x).1,
        _ => of_one(function, x),
    }
}

/// Any function of two arguments, of constants.
pub(super) fn of_constants(function: Function, a: f64, b: f64) -> f64 {
    match function {
        Function::KeplerSin => kepler(a, b).0,
        Function::KeplerCos => kepler(a, b).1,
        _ => of_two(function, a, b),
    }
}

/// sin E and cos E of Kepler's equation E − e sin E = M.
#[inline(always)]
pub(super) fn kepler<R: Real>(mean_anomaly: R, eccentricity: R) -> (R, R) {
    let (_, sin, cos) = eccentric_anomaly(mean_anomaly, eccentricity);
    (sin, cos)
}
