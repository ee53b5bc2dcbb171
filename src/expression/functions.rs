//! Elementary functions as evaluators call them: the one place where they are connected.

use crate::real::{Function, Real, Scalar, sin_cos};
use crate::torque::orbit::eccentric_anomaly;

/// The most lanes of a number.
const MOST_LANES: usize = crate::clock::MOST_LANES;

/// A function of one argument other than sine and cosine, which are formed together.
#[inline(always)]
pub(super) fn of_one<R: Real>(function: Function, x: R) -> R {
    match function {
        Function::ArctangentRatio => arctangent_ratio(x),
        _ => lane_by_lane(x, x, |x, _| reference_of_one(function, x)),
    }
}

/// A function of two arguments other than those of Kepler's equation, which are formed together.
#[inline(always)]
pub(super) fn of_two<R: Real>(function: Function, a: R, b: R) -> R {
    lane_by_lane(a, b, |a, b| reference_of_two(function, a, b))
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

/// arctan(√x)/√x for 0 ≤ x ≤ 0.04.
#[inline(always)]
fn arctangent_ratio<R: Real>(x: R) -> R {
    let terms = R::Scalar::ARCTANGENT_TERMS;
    let coefficient = |n: u32| (if n.is_multiple_of(2) { 1.0 } else { -1.0 }) / f64::from(2 * n + 1);
    let mut sum = R::splat(coefficient(terms));
    for term in (0..terms).rev() {
        sum = sum.mul_add(x, R::splat(coefficient(term)));
    }
    sum
}

/// A function of the standard library in `f64`, rounded: what is not yet the crate's own.
#[inline(always)]
fn lane_by_lane<R: Real>(a: R, b: R, function: impl Fn(f64, f64) -> f64) -> R {
    let (mut first, mut second) = ([R::Scalar::default(); MOST_LANES], [R::Scalar::default(); MOST_LANES]);
    a.store(&mut first);
    b.store(&mut second);
    R::from_lanes(|lane| R::Scalar::from_f64(function(first[lane].to_f64(), second[lane].to_f64())))
}

fn reference_of_one(function: Function, x: f64) -> f64 {
    match function {
        Function::Tan => x.tan(),
        Function::Asin => x.asin(),
        Function::Acos => x.acos(),
        Function::Exp => x.exp(),
        Function::Ln => x.ln(),
        _ => f64::NAN,
    }
}

fn reference_of_two(function: Function, a: f64, b: f64) -> f64 {
    match function {
        Function::Atan2 => a.atan2(b),
        Function::Pow => a.powf(b),
        _ => f64::NAN,
    }
}
