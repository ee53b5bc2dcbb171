//! The sizes of what a kernel adds up: its text on numbers whose differences are sums, which roundings of its results are measured by.

use std::ops::{Add, Div, Mul, Neg, Sub};

use polhode::math::real::{Real, Scalar};

/// The sum of the absolute values of what a number is a sum of. A kernel of sums and products gives that of its results from
/// that of its arguments; argument reductions and decisions have no meaning in it.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(transparent)]
pub struct Size(pub f64);

impl Add for Size {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self(self.0 + other.0)
    }
}

#[allow(clippy::suspicious_arithmetic_impl, reason = "the terms of a difference add up as those of a sum")]
impl Sub for Size {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self(self.0 + other.0)
    }
}

impl Mul for Size {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self(self.0 * other.0)
    }
}

impl Div for Size {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        Self(self.0 / other.0)
    }
}

impl Neg for Size {
    type Output = Self;
    fn neg(self) -> Self {
        self
    }
}

impl Real for Size {
    type Scalar = Self;
    type Mask = bool;
    const LANES: usize = 1;

    fn splat(x: f64) -> Self {
        Self(x.abs())
    }
    fn from_lanes(mut lane: impl FnMut(usize) -> Self) -> Self {
        lane(0)
    }
    fn load(column: &[Self]) -> Self {
        column[0]
    }
    fn store(self, column: &mut [Self]) {
        column[0] = self;
    }
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        self * factor + addend
    }
    fn sqrt(self) -> Self {
        Self(self.0.sqrt())
    }
    fn abs(self) -> Self {
        self
    }
    fn min(self, other: Self) -> Self {
        Self(self.0.max(other.0))
    }
    fn max(self, other: Self) -> Self {
        Self(self.0.max(other.0))
    }
    fn less_than(self, other: Self) -> bool {
        self < other
    }
    fn select(_: bool, if_true: Self, if_false: Self) -> Self {
        if_true.max(if_false)
    }
    fn any(mask: bool) -> bool {
        mask
    }
    fn two_product(self, other: Self) -> (Self, Self) {
        (self * other, self * other)
    }
    fn outlined<O>(work: impl FnOnce() -> O) -> O {
        work()
    }
}

impl Scalar for Size {
    const WORDS: usize = 1;
    const UNIT_ROUNDOFF: f64 = f64::UNIT_ROUNDOFF;
    const ROUND_SHIFT: f64 = f64::ROUND_SHIFT;
    const SIN: &'static [f64] = f64::SIN;
    const COS: &'static [f64] = f64::COS;
    const HALF_PI: &'static [f64] = f64::HALF_PI;
    const NEGLIGIBLE: f64 = f64::NEGLIGIBLE;
    const FOURTH_POWER_NEGLIGIBLE: f64 = f64::FOURTH_POWER_NEGLIGIBLE;
    const EXP: &'static [f64] = f64::EXP;
    const LN_2: [f64; 2] = f64::LN_2;
    const ARCTANGENT_TERMS: u32 = f64::ARCTANGENT_TERMS;
    const ARTANH_TERMS: u32 = f64::ARTANH_TERMS;

    fn from_f64(x: f64) -> Self {
        Self(x.abs())
    }
    fn to_f64(self) -> f64 {
        self.0
    }
    fn from_fixed_point(x: i64) -> Self {
        Self(f64::from_fixed_point(x).abs())
    }
}
