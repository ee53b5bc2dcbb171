//! The arithmetic in which a closed form is set up.
//!
//! Rates are multiplied by arbitrarily long times, so they need more digits than `f64` has ([`DoubleDouble`]); if the time is known and
//! short enough, one word suffices ([`Single`]).

use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::math::double_double::DoubleDouble;
use crate::math::elementary::power_of_two;
use crate::math::operators;
use crate::math::real::Real;

/// A number of a set-up, in one word or two.
pub(crate) trait Number<R: Real>:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// A number whose square vanishes next to 1.
    const SQUARE_NEGLIGIBLE: f64;

    /// A number of two words, to the precision of this arithmetic.
    fn of(number: DoubleDouble<R>) -> Self;

    /// The number in two words.
    fn to_double_double(self) -> DoubleDouble<R>;

    /// The number rounded to one word.
    fn rounded(self) -> R;

    /// Product by one word.
    fn times_word(self, word: R) -> Self;

    /// Product by 1, −1 or another power of two in each lane, exactly.
    fn times_power_of_two(self, factor: R) -> Self;

    /// self².
    fn squared(self) -> Self;

    /// Square root of a number that is not negative; 0 for 0.
    fn sqrt(self) -> Self;

    /// Lane by lane, `if_true` where the mask is set and `if_false` elsewhere.
    fn select(mask: R::Mask, if_true: Self, if_false: Self) -> Self;

    /// All lanes equal to the sum of two words that do not overlap.
    #[inline(always)]
    fn splat(high: f64, low: f64) -> Self {
        Self::of(DoubleDouble::splat(high, low))
    }

    /// A number of one word.
    #[inline(always)]
    fn from_word(word: R) -> Self {
        Self::of(DoubleDouble::from_word(word))
    }

    /// Product by a power of two, exactly.
    #[inline(always)]
    fn scaled(self, power_of_two: f64) -> Self {
        self.times_power_of_two(R::splat(power_of_two))
    }

    /// Absolute value.
    #[inline(always)]
    fn abs(self) -> Self {
        let negative = self.rounded().less_than(R::splat(0.0));
        Self::select(negative, -self, self)
    }
}

impl<R: Real> Number<R> for DoubleDouble<R> {
    const SQUARE_NEGLIGIBLE: f64 = power_of_two(-53);

    #[inline(always)]
    fn of(number: DoubleDouble<R>) -> Self {
        number
    }

    #[inline(always)]
    fn to_double_double(self) -> DoubleDouble<R> {
        self
    }

    #[inline(always)]
    fn rounded(self) -> R {
        self.high
    }

    #[inline(always)]
    fn times_word(self, word: R) -> Self {
        DoubleDouble::times_word(self, word)
    }

    #[inline(always)]
    fn times_power_of_two(self, factor: R) -> Self {
        Self { high: self.high * factor, low: self.low * factor }
    }

    #[inline(always)]
    fn squared(self) -> Self {
        DoubleDouble::squared(self)
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        DoubleDouble::sqrt(self)
    }

    #[inline(always)]
    fn select(mask: R::Mask, if_true: Self, if_false: Self) -> Self {
        DoubleDouble::select(mask, if_true, if_false)
    }
}

/// A number of one word.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Single<R>(R);

impl<R: Real> Number<R> for Single<R> {
    const SQUARE_NEGLIGIBLE: f64 = power_of_two(-27);

    #[inline(always)]
    fn of(number: DoubleDouble<R>) -> Self {
        Self(number.high)
    }

    #[inline(always)]
    fn to_double_double(self) -> DoubleDouble<R> {
        DoubleDouble::from_word(self.0)
    }

    #[inline(always)]
    fn rounded(self) -> R {
        self.0
    }

    #[inline(always)]
    fn times_word(self, word: R) -> Self {
        Self(self.0 * word)
    }

    #[inline(always)]
    fn times_power_of_two(self, factor: R) -> Self {
        Self(self.0 * factor)
    }

    #[inline(always)]
    fn squared(self) -> Self {
        Self(self.0 * self.0)
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.sqrt())
    }

    #[inline(always)]
    fn select(mask: R::Mask, if_true: Self, if_false: Self) -> Self {
        Self(R::select(mask, if_true.0, if_false.0))
    }
}

operators! { [R: Real] Single<R>:
    Neg::neg(self) = Self(-self.0);
    Add::add(self, other: Self) = Self(self.0 + other.0);
    Sub::sub(self, other: Self) = Self(self.0 - other.0);
    Mul::mul(self, other: Self) = Self(self.0 * other.0);
    Div::div(self, other: Self) = Self(self.0 / other.0);
}
