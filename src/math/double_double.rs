//! Numbers carried as an unevaluated sum of two `f64`, for set-up arithmetic.
//!
//! The rates of a torque-free body are multiplied by arbitrarily long times, so they need more digits than `f64` has. Everything is
//! generic over [`Real`], so that a set-up runs in SIMD lanes; for this reason the crate `twofloat`, which is accurate but
//! scalar, is not used.
//!
//! Sources: M. Joldes, J.-M. Muller, V. Popescu, "Tight and rigorous error bounds for basic building blocks of
//! double-word arithmetic", ACM Trans. Math. Softw. 44 (2017) 15res: algorithms 6 (sum), 12 (product) and 17
//! (quotient); the square root is one Newton step from the rounded root (A. H. Karp, P. Markstein, ibid. 23 (1997)
//! 561). With u = 2⁻⁵³ the relative errors are at most 3u², 5u², 15u² and 4u².

use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::math::operators;
use crate::math::real::{Real, Scalar};

/// `high + low`, |low| at most half an ulp of `high`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DoubleDouble<R = f64> {
    /// The number rounded to nearest.
    pub high: R,
    /// The remainder.
    pub low: R,
}

/// a + b and its rounding error, exactly (Knuth, TAOCP vol. 2, 4.2.2, theorem B).
#[inline(always)]
fn two_sum<R: Real>(a: R, b: R) -> (R, R) {
    let sum = a + b;
    let b_taken = sum - a;
    let a_taken = sum - b_taken;
    (sum, (a - a_taken) + (b - b_taken))
}

/// As [`two_sum`] where |a| ≥ |b| or a = 0 (T. J. Dekker, Numer. Math. 18 (1971) 224).
#[inline(always)]
fn quick_two_sum<R: Real>(a: R, b: R) -> (R, R) {
    let sum = a + b;
    (sum, b - (sum - a))
}

impl<R: Real> DoubleDouble<R>
where
    R::Scalar: Scalar,
{
    /// The number `high + low` of two words that do not overlap.
    #[inline(always)]
    pub fn new(high: R, low: R) -> Self {
        Self { high, low }
    }

    /// All lanes equal to the sum of two `f64` words that do not overlap.
    #[inline(always)]
    pub fn splat(high: f64, low: f64) -> Self {
        Self { high: R::splat(high), low: R::splat(low) }
    }

    /// A number of one word.
    #[inline(always)]
    pub(crate) fn from_word(word: R) -> Self {
        Self { high: word, low: R::splat(0.0) }
    }

    /// a · b of two words, exactly.
    #[inline(always)]
    pub fn product_of(a: R, b: R) -> Self {
        let (high, low) = a.two_product(b);
        Self { high, low }
    }

    /// a + b of two words, exactly.
    #[inline(always)]
    pub fn sum_of(a: R, b: R) -> Self {
        let (high, low) = two_sum(a, b);
        Self { high, low }
    }

    /// Product by a power of two, exactly.
    #[inline(always)]
    pub fn scaled(self, power_of_two: f64) -> Self {
        let factor = R::splat(power_of_two);
        Self { high: self.high * factor, low: self.low * factor }
    }

    /// Product by one word, relative error at most 2u² (algorithm 9).
    #[inline(always)]
    pub(crate) fn times_word(self, word: R) -> Self {
        let (high, low) = self.high.two_product(word);
        let (high, low) = quick_two_sum(high, self.low.mul_add(word, low));
        Self { high, low }
    }

    /// self².
    #[inline(always)]
    pub fn squared(self) -> Self {
        let (high, low) = self.high.two_product(self.high);
        let (high, low) = quick_two_sum(high, (self.high + self.high).mul_add(self.low, low));
        Self { high, low }
    }

    /// Square root of a number that is not negative; 0 for 0.
    #[inline(always)]
    pub fn sqrt(self) -> Self {
        let root = self.high.sqrt();
        let (square, square_low) = root.two_product(root);
        let remainder = ((self.high - square) - square_low) + self.low;
        let correction = remainder * (R::splat(0.5) / root);
        let zero = !R::splat(0.0).less_than(root);
        let (high, low) = quick_two_sum(root, R::select(zero, R::splat(0.0), correction));
        Self { high, low }
    }

    /// Absolute value.
    #[inline(always)]
    pub fn abs(self) -> Self {
        let negative = self.high.less_than(R::splat(0.0));
        Self::select(negative, -self, self)
    }

    /// Lane by lane, `if_true` where the mask is set and `if_false` elsewhere.
    #[inline(always)]
    pub fn select(mask: R::Mask, if_true: Self, if_false: Self) -> Self {
        Self { high: R::select(mask, if_true.high, if_false.high), low: R::select(mask, if_true.low, if_false.low) }
    }
}

impl DoubleDouble {
    /// The nearest `f64`.
    pub fn to_f64(self) -> f64 {
        self.high + self.low
    }
}

impl From<f64> for DoubleDouble {
    fn from(x: f64) -> Self {
        Self { high: x, low: 0.0 }
    }
}

operators! { [R: Real] DoubleDouble<R>:
    Neg::neg(self) = Self { high: -self.high, low: -self.low };
    Add::add(self, other: Self) = {
        let (high, high_low) = two_sum(self.high, other.high);
        let (low, low_low) = two_sum(self.low, other.low);
        let (high, rest) = quick_two_sum(high, high_low + low);
        let (high, low) = quick_two_sum(high, low_low + rest);
        Self { high, low }
    };
    Sub::sub(self, other: Self) = self + -other;
    Mul::mul(self, other: Self) = {
        let (high, high_low) = self.high.two_product(other.high);
        let cross = self.high.mul_add(other.low, self.low * other.high);
        let (high, low) = quick_two_sum(high, high_low + cross);
        Self { high, low }
    };
    Div::div(self, other: Self) = {
        let inverse = R::splat(1.0) / other.high;
        let quotient = self.high * inverse;
        let taken = other.times_word(quotient);
        let remainder = (self.high - taken.high) + (self.low - taken.low);
        let (high, low) = quick_two_sum(quotient, remainder * inverse);
        Self { high, low }
    };
}
