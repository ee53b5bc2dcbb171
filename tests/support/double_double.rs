//! Numbers of 32 digits, in which an order above 4 can be followed over five halvings: in f64 rounding ends it after three.
//!
//! Error-free sums and products after T. J. Dekker, Numer. Math. 18 (1971) 224, and D. E. Knuth, TAOCP vol. 2, 4.2.2.
//! Constants of the kernels stay f64 numbers, which holds errors above about 1e-17. Sines, cosines and Kepler's equation, whose polynomials
//! have the digits of f64, are those of this file.

use std::ops::{Add, Div, Mul, Neg, Sub};

use polhode::math::real::{Function, Real, Scalar};

/// An unevaluated sum hi + lo.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct DoubleDouble {
    pub hi: f64,
    pub lo: f64,
}

fn quick(a: f64, b: f64) -> DoubleDouble {
    let hi = a + b;
    DoubleDouble { hi, lo: b - (hi - a) }
}

fn sum(a: f64, b: f64) -> DoubleDouble {
    let hi = a + b;
    let b_taken = hi - a;
    DoubleDouble { hi, lo: (a - (hi - b_taken)) + (b - b_taken) }
}

impl From<f64> for DoubleDouble {
    fn from(hi: f64) -> Self {
        Self { hi, lo: 0.0 }
    }
}

impl Add for DoubleDouble {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        let high = sum(self.hi, other.hi);
        let low = sum(self.lo, other.lo);
        let first = quick(high.hi, high.lo + low.hi);
        quick(first.hi, first.lo + low.lo)
    }
}

impl Neg for DoubleDouble {
    type Output = Self;
    fn neg(self) -> Self {
        Self { hi: -self.hi, lo: -self.lo }
    }
}

impl Sub for DoubleDouble {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + (-other)
    }
}

impl Mul for DoubleDouble {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let hi = self.hi * other.hi;
        let lo = f64::mul_add(self.hi, other.hi, -hi);
        quick(hi, lo + (self.hi * other.lo + self.lo * other.hi))
    }
}

impl Div for DoubleDouble {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let first = Self::from(self.hi / other.hi);
        let rest = self - other * first;
        let second = Self::from(rest.hi / other.hi);
        let last = (rest - other * second).hi / other.hi;
        first + second + Self::from(last)
    }
}

impl Real for DoubleDouble {
    type Scalar = Self;
    type Mask = bool;
    const LANES: usize = 1;

    fn splat(x: f64) -> Self {
        Self::from(x)
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
        // One step of Newton's method from the f64 root.
        if self.hi == 0.0 {
            return self;
        }
        let root = Self::from(self.hi.sqrt());
        (root + self / root) * Self::from(0.5)
    }
    fn abs(self) -> Self {
        if self.hi < 0.0 { -self } else { self }
    }
    fn min(self, other: Self) -> Self {
        if other < self { other } else { self }
    }
    fn max(self, other: Self) -> Self {
        if self < other { other } else { self }
    }
    fn less_than(self, other: Self) -> bool {
        self < other
    }
    fn select(mask: bool, if_true: Self, if_false: Self) -> Self {
        if mask { if_true } else { if_false }
    }
    fn any(mask: bool) -> bool {
        mask
    }
    fn two_product(self, other: Self) -> (Self, Self) {
        (self * other, Self::default())
    }
    fn round(self) -> Self {
        let hi = self.hi.round_ties_even();
        // Of an integer the second word says to which side the number lies; a tie is decided by it.
        if hi == self.hi {
            return quick(hi, self.lo.round_ties_even());
        }
        let is_tie = (self.hi - hi).abs() == 0.5 && self.lo != 0.0;
        Self::from(if is_tie { self.hi + 0.5_f64.copysign(self.lo) } else { hi })
    }
    fn recorded(function: Function, arguments: &[Self]) -> Option<Self> {
        match (function, arguments) {
            (Function::Sin, &[x]) => Some(sin_cos(x).0),
            (Function::Cos, &[x]) => Some(sin_cos(x).1),
            (Function::KeplerSin, &[m, e]) => Some(sin_cos(eccentric_anomaly(m, e)).0),
            (Function::KeplerCos, &[m, e]) => Some(sin_cos(eccentric_anomaly(m, e)).1),
            _ => None,
        }
    }
    fn from_lanes(mut of_lane: impl FnMut(usize) -> Self) -> Self {
        of_lane(0)
    }
    fn outlined<O>(work: impl FnOnce() -> O) -> O {
        work()
    }
}

impl Scalar for DoubleDouble {
    const WORDS: usize = 1;
    const UNIT_ROUNDOFF: f64 = f64::UNIT_ROUNDOFF * f64::UNIT_ROUNDOFF;
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
        Self::from(x)
    }
    fn to_f64(self) -> f64 {
        self.hi + self.lo
    }
    fn from_fixed_point(x: i64) -> Self {
        let low = x & 0xffff_ffff;
        quick(f64::from_fixed_point(x - low), f64::from_fixed_point(low))
    }
}

/// Sine and cosine of a number below some tens: Taylor's series at 1/256 of it, then doublings of 1 − cos.
pub fn sin_cos(x: DoubleDouble) -> (DoubleDouble, DoubleDouble) {
    let (one, two) = (DoubleDouble::from(1.0), DoubleDouble::from(2.0));
    let small = x * DoubleDouble::from(1.0 / 256.0);
    let square = small * small;
    let (mut sin, mut versine) = (DoubleDouble::default(), DoubleDouble::default());
    let (mut odd, mut even) = (small, square * DoubleDouble::from(0.5));
    for n in 1..=14 {
        sin = sin + odd;
        versine = versine + even;
        let n = f64::from(2 * n);
        odd = -odd * square / DoubleDouble::from(n * (n + 1.0));
        even = -even * square / DoubleDouble::from((n + 1.0) * (n + 2.0));
    }
    // sin 2y = 2 sin y (1 − v), 1 − cos 2y = 2 sin² y.
    for _ in 0..8 {
        let doubled = two * sin * (one - versine);
        versine = two * sin * sin;
        sin = doubled;
    }
    (sin, one - versine)
}

/// E with E − e sin E = M, for |M| ≤ π: Newton's method in f64, then twice in 32 digits.
fn eccentric_anomaly(m: DoubleDouble, e: DoubleDouble) -> DoubleDouble {
    let mut anomaly = m.hi + 0.85 * e.hi * m.hi.signum();
    for _ in 0..50 {
        anomaly -= (anomaly - e.hi * anomaly.sin() - m.hi) / (1.0 - e.hi * anomaly.cos());
    }
    let mut anomaly = DoubleDouble::from(anomaly);
    for _ in 0..2 {
        let (sin, cos) = sin_cos(anomaly);
        anomaly = anomaly - (anomaly - e * sin - m) / (DoubleDouble::from(1.0) - e * cos);
    }
    anomaly
}
