//! Elementary functions that kernels need beside [`crate::real::sin_cos`]: sine and cosine of a turn count, and the
//! exponential of a number that is not positive.
//!
//! Twin: `shaders/elementary.wgsl`, on `shaders/elementary_f32.wgsl` or `shaders/elementary_f64.wgsl`.

use std::f64::consts::TAU;

use crate::real::{Real, Scalar, polynomial, sin_cos_eighth};

/// An angle in turns, `quadrant / 4 + residual`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turns<R> {
    /// Nearest quarter turn: 0, 1, 2 or 3.
    pub quadrant: R,
    /// What is left, in turns, in [−1/8, 1/8].
    pub residual: R,
}

/// sin 2πx and cos 2πx of an angle in turns.
///
/// The error is at most 1 ulp of 1 (1.2e-7 in `f32`, 2.2e-16 in `f64`), absolute; at whole quarter turns the results
/// are exact. Tested in `tests/elementary.rs` over every `f32` residual and on a grid in `f64`.
#[inline(always)]
pub fn sin_cos_turns<R: Real>(angle: Turns<R>) -> (R, R) {
    let (sin, cos) = sin_cos_eighth(angle.residual * R::splat(TAU));
    let quadrant = angle.quadrant;
    let at_least_1 = R::splat(0.5).less_than(quadrant);
    let at_least_2 = R::splat(1.5).less_than(quadrant);
    let at_least_3 = R::splat(2.5).less_than(quadrant);
    let odd = (at_least_1 & !at_least_2) | at_least_3;
    let (swapped_sin, swapped_cos) = (R::select(odd, cos, sin), R::select(odd, sin, cos));
    let cos_negative = at_least_1 & !at_least_3;
    (R::select(at_least_2, -swapped_sin, swapped_sin), R::select(cos_negative, -swapped_cos, swapped_cos))
}

/// The angle increased by at most an eighth of a turn in size, reduced again.
#[inline(always)]
pub fn turned_by<R: Real>(angle: Turns<R>, turns: R) -> Turns<R> {
    let sum = angle.residual + turns;
    let quarters = (sum * R::splat(4.0)).round();
    let residual = quarters.mul_add(R::splat(-0.25), sum);
    let quadrant = angle.quadrant + quarters;
    let below = quadrant.less_than(R::splat(-0.5));
    let above = R::splat(3.5).less_than(quadrant);
    let wrap = R::select(below, R::splat(4.0), R::select(above, R::splat(-4.0), R::splat(0.0)));
    Turns { quadrant: quadrant + wrap, residual }
}

/// Least argument of [`exp`].
pub const EXP_LEAST: f64 = -44.0;

/// e^x for x ≤ 0; below [`EXP_LEAST`] the value there, 7.8e-20.
///
/// The relative error is at most 2 units of roundoff (1.2e-7 in `f32`, 2.2e-16 in `f64`).
#[inline(always)]
pub fn exp<R: Real>(x: R) -> R {
    exp_with_bits(x.max(R::splat(EXP_LEAST)), 6)
}

/// 2^n for −1022 ≤ n ≤ 1023.
#[inline(always)]
pub(crate) const fn power_of_two(n: i32) -> f64 {
    f64::from_bits(((1023 + n) as u64) << 52)
}

/// e^x for −2^`bits` ln 2 < x ≤ 0: x = r − n ln 2 with n of that many bits, Taylor's sum for e^r, and 2^−n as a
/// product of its binary digits' powers, which costs no integer arithmetic and is exact.
#[inline(always)]
pub(crate) fn exp_with_bits<R: Real>(x: R, bits: u32) -> R {
    let one = R::splat(1.0);
    let halvings = (x * R::splat(-std::f64::consts::LOG2_E)).round();
    let [high, low] = R::Scalar::LN_2;
    let reduced = halvings.mul_add(R::splat(low), halvings.mul_add(R::splat(high), x));
    let tail = polynomial(R::Scalar::EXP, reduced);
    let mut result = one + (tail * reduced).mul_add(reduced, reduced);
    let mut left = halvings;
    for bit in (0..bits).rev() {
        let weight = f64::from(1_u32 << bit);
        let set = R::splat(weight - 0.5).less_than(left);
        result = result * R::select(set, R::splat(power_of_two(-(1 << bit))), one);
        left = left - R::select(set, R::splat(weight), R::splat(0.0));
    }
    result
}
