//! Phases as integers of a turn: exact multiplication of a 128-bit rate by a time.
//!
//! A phase rate · t formed in floating point is wrong by half an ulp of itself, which after 10⁹ turns is 10⁻⁷ turn. Here a
//! rate is a fixed-point fraction of 128 bits and a time is an integer times a power of two, as every `f64` is; of their
//! product, modulo one turn, the 64 bits after the point are kept. Neither error nor cost grows with the time.
//!
//! Twin: `shaders/phase.wgsl`, where the same numbers are words of 32 bits; both give the same bits.

use crate::math::elementary::{Turns, power_of_two};
use crate::math::real::Scalar;

/// A time as `sign · mantissa · 2^exponent`, s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Time {
    /// Below 2⁶⁴.
    pub mantissa: u64,
    /// Power of two of the mantissa's unit.
    pub exponent: i32,
    /// Whether the time lies before the initial state.
    pub negative: bool,
}

/// Bits of the mantissa of an `f64`.
const MANTISSA_BITS: i32 = 53;

impl Time {
    /// Exactly `seconds`, which must be finite.
    pub fn from_seconds(seconds: f64) -> Self {
        let bits = seconds.to_bits();
        let (field, fraction) = ((bits >> 52) & 0x7ff, bits & ((1 << 52) - 1));
        let (mantissa, exponent) =
            if field == 0 { (fraction, -1074) } else { (fraction | (1 << 52), field as i32 - 1075) };
        Self { mantissa, exponent, negative: bits >> 63 == 1 }
    }

    /// The time as a fraction of 2^(exponent + 53) s, in (−1, 1) for a time that was an `f64`.
    #[inline(always)]
    pub(crate) fn signed_fraction(self) -> f64 {
        let fraction = self.mantissa as f64 * power_of_two(-MANTISSA_BITS);
        if self.negative { -fraction } else { fraction }
    }

    /// The time in units of 2^−`rate_exponent` s as a floating-point number, clamped to ±2^60, beyond which no motion tells one time from
    /// another.
    #[inline(always)]
    pub fn scaled<T: Scalar>(self, rate_exponent: i32) -> T {
        let exponent = self.exponent.saturating_add(MANTISSA_BITS).saturating_add(rate_exponent).clamp(-60, 60);
        T::from_f64(self.signed_fraction()) * T::from_f64(power_of_two(exponent))
    }

    /// The time of step `index` of size `dt`: exact if the product has no more than 64 bits, otherwise rounded to 64 bits. `dt` must be
    /// finite.
    pub fn of_step(index: u64, dt: f64) -> Self {
        let step = Self::from_seconds(dt);
        let product = u128::from(step.mantissa) * u128::from(index);
        let excess = (128 - product.leading_zeros()).saturating_sub(64);
        let rounded = if excess == 0 { product } else { (product + (1 << (excess - 1))) >> excess };
        // Rounding up can reach 2⁶⁴ itself.
        let carry = u32::from(rounded >> 64 != 0);
        Self {
            mantissa: (rounded >> carry) as u64,
            exponent: step.exponent + (excess + carry) as i32,
            negative: step.negative,
        }
    }
}

/// A rate of a phase: `fraction · 2^−128` turns per unit of time, and the unit as a power of two of 1/s.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rate {
    /// Size in units of 2⁻¹²⁸ turn.
    pub fraction: u128,
    /// The rate is `fraction · 2^(exponent − 128)` turns per second.
    pub exponent: i32,
    /// Whether the phase decreases with time.
    pub negative: bool,
}

/// The phase at `time` in units of 2⁻⁶⁴ turn, modulo one turn.
///
/// The product is truncated, not rounded: the error is less than 2⁻⁶⁴ turn, and |t| · 2⁻¹²⁸ of the rate's unit.
#[inline(always)]
pub fn phase_at(start: u64, rate: Rate, time: Time) -> u64 {
    let advanced = fraction_of_turn(rate.fraction, time.mantissa, i64::from(time.exponent) + i64::from(rate.exponent));
    let backward = u64::from(time.negative != rate.negative).wrapping_neg();
    start.wrapping_add((advanced ^ backward).wrapping_sub(backward))
}

/// `fraction · mantissa · 2^(exponent − 64)` modulo 2⁶⁴, rounded down.
///
/// In words of 32 bits, as in the shader, and without a branch: a loop over bodies then runs in SIMD lanes, which 64-bit multiplication
/// would prevent.
#[inline(always)]
pub fn fraction_of_turn(fraction: u128, mantissa: u64, exponent: i64) -> u64 {
    const WORD: u64 = 0xffff_ffff;
    let (low, high) = (fraction as u64, (fraction >> 64) as u64);
    let rate = [low & WORD, low >> 32, high & WORD, high >> 32];
    let (m0, m1) = (mantissa & WORD, mantissa >> 32);
    // Schoolbook multiplication; no sum exceeds (2^32 - 1)^2 + 2 (2^32 - 1) = 2^64 - 1.
    let t0 = rate[0] * m0;
    let t1 = rate[1] * m0 + (t0 >> 32);
    let t2 = rate[2] * m0 + (t1 >> 32);
    let t3 = rate[3] * m0 + (t2 >> 32);
    let u1 = rate[0] * m1 + (t1 & WORD);
    let u2 = rate[1] * m1 + (t2 & WORD) + (u1 >> 32);
    let u3 = rate[2] * m1 + (t3 & WORD) + (u2 >> 32);
    let u4 = rate[3] * m1 + (t3 >> 32) + (u3 >> 32);
    let product = [(t0 & WORD) | (u1 << 32), (u2 & WORD) | (u3 << 32), u4];
    // The 64 bits from bit `shift` upwards. There is nothing above the product's top, and below its last bit nothing is known of a turn's
    // fraction.
    let shift = 64 - exponent;
    let right = shift as u64;
    let (lower, upper) = (
        if right < 64 {
            product[0]
        } else if right < 128 {
            product[1]
        } else {
            product[2]
        },
        if right < 64 {
            product[1]
        } else if right < 128 {
            product[2]
        } else {
            0
        },
    );
    let bits = right & 63;
    let window = (lower >> bits) | ((upper << 1) << (63 - bits));
    let left = (exponent - 64) as u64;
    if right < 192 {
        window
    } else if left < 64 {
        product[0] << left
    } else {
        0
    }
}

/// A phase in units of 2⁻⁶⁴ turn as the nearest quarter turn and the rest.
#[inline(always)]
pub fn phase_turns<T: Scalar>(phase: u64) -> Turns<T> {
    let quadrant = phase.wrapping_add(1 << 61) >> 62;
    let residual = phase.wrapping_sub(quadrant << 62) as i64;
    Turns {
        quadrant: T::from_fixed_point((quadrant << 32) as i64) * T::splat(power_of_two(32)),
        residual: T::from_fixed_point(residual),
    }
}

/// A phase of `turns` (modulo one turn) given in two words, |turns| ≤ 1, in units of 2⁻⁶⁴ turn.
pub(crate) fn phase_from_turns(high: f64, low: f64) -> u64 {
    // The second word is below 2⁻⁵³.
    fixed_point::<64>(high).wrapping_add(i128::from((low * power_of_two(64)).round() as i64)) as u64
}

/// The magnitude of a rate of `turns` per unit in two words, |turns| < 1, in units of 2⁻¹²⁸ turn, and its sign.
pub(crate) fn fraction_from_turns(high: f64, low: f64) -> (u128, bool) {
    let negative = high < 0.0;
    let (high, low) = if negative { (-high, -low) } else { (high, low) };
    let size = fixed_point::<127>(high) + fixed_point::<127>(low);
    ((size.max(0) as u128) << 1, negative)
}

/// x · 2^`PLACES`, rounded towards zero, in a fraction of the time of a conversion by `as i128`; like that, it saturates, and is 0 for NaN.
#[inline(always)]
fn fixed_point<const PLACES: i32>(x: f64) -> i128 {
    let bits = x.to_bits();
    let (field, fraction) = ((bits >> 52) & 0x7ff, bits & ((1 << 52) - 1));
    let mantissa = u128::from(fraction | (1 << 52));
    // x is its mantissa times 2^(field − 1075).
    let shift = field as i32 - 1075 + PLACES;
    let size = match shift {
        ..=-53 => 0,
        -52..0 => mantissa >> -shift,
        0..=74 => mantissa << shift,
        75.. if x.is_nan() => 0,
        75.. => i128::MAX as u128,
    };
    if bits >> 63 == 1 { -(size as i128) } else { size as i128 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fixed_point_is_the_conversion_of_the_language() {
        let mut word = 1_u64;
        for _ in 0..100_000 {
            word = word.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            // From 2^-200 to below 1.
            let exponent = 823 + (word >> 32) % 200;
            let x = f64::from_bits((word & (1 << 63)) | (exponent << 52) | (word >> 12 & ((1 << 52) - 1)));
            assert_eq!(fixed_point::<127>(x), (x * power_of_two(127)) as i128, "{x:e}");
            assert_eq!(fixed_point::<64>(x), (x * power_of_two(64)) as i128, "{x:e}");
        }
        for x in [0.0, -0.0, 1e-310, 1.0, f64::NAN, f64::INFINITY, 1e300] {
            assert_eq!(fixed_point::<127>(x), (x * power_of_two(127)) as i128, "{x:e}");
            assert_eq!(fixed_point::<64>(x), (x * power_of_two(64)) as i128, "{x:e}");
        }
    }
}
