//! Scaling by powers of two, which changes no digit.

use glam::DVec3;

/// x · 2^n, exact if the result is a normal number.
#[inline]
pub(crate) fn scaled_by_power_of_two(x: f64, n: i32) -> f64 {
    let [first, second] = power_of_two_factors(n);
    x * first * second
}

/// [`scaled_by_power_of_two`] of each component.
#[inline]
pub(crate) fn vector_scaled_by_power_of_two(v: DVec3, n: i32) -> DVec3 {
    let [first, second] = power_of_two_factors(n);
    v * first * second
}

/// Two numbers whose product is 2^n, as a single one may be out of range.
#[inline]
pub(crate) fn power_of_two_factors(n: i32) -> [f64; 2] {
    let power = |n: i32| f64::from_bits(((1023 + n) as u64) << 52);
    let half = (n / 2).clamp(-1000, 1000);
    [power(half), power((n - half).clamp(-1000, 1000))]
}

/// ⌊log₂ x⌋ for x > 0, 0 for x = 0.
#[inline]
pub(crate) fn binary_exponent(x: f64) -> i32 {
    if x == 0.0 {
        return 0;
    }
    let exponent = |x: f64| ((x.to_bits() >> 52) & 0x7ff) as i32 - 1023;
    if x >= f64::MIN_POSITIVE { exponent(x) } else { exponent(scaled_by_power_of_two(x, 200)) - 200 }
}
