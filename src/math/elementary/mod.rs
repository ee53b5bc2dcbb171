//! Elementary functions that kernels need beside [`crate::math::real::sin_cos`]: sine and cosine of a turn count, and the
//! exponential of a number that is not positive. The functions that a user's formula may name are in [`functions`].
//!
//! Twin: `shaders/elementary.wgsl`, on `shaders/elementary_f32.wgsl` or `shaders/elementary_f64.wgsl`.

pub mod functions;

use std::f64::consts::TAU;

use crate::math::real::{Real, Scalar, polynomial, sin_cos_eighth};

/// An angle in turns, `quadrant / 4 + residual`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turns<R> {
    /// Nearest quarter turn: 0, 1, 2 or 3.
    pub quadrant: R,
    /// The rest, in turns, in [−1/8, 1/8].
    pub residual: R,
}

/// sin 2πx and cos 2πx of an angle in turns.
///
/// The error is at most 1.25e-7 in `f32` and 2.2e-16 in `f64`, absolute; at whole quarter turns the results are exact.
/// Tested in `tests/truth/elementary.rs` over every `f32` residual that a phase can have, and on a grid in `f64`.
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

/// The angle plus `turns`, at most an eighth of a turn in magnitude, reduced again.
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

/// Least argument of [`exp_negative`].
pub const EXP_LEAST: f64 = -86.0;

/// e^x for x ≤ 0; below [`EXP_LEAST`] the value there, 4.5e-38, which is still a normal number in `f32`.
///
/// The relative error is at most 2 units of roundoff (1.2e-7 in `f32`, 2.2e-16 in `f64`).
#[inline(always)]
pub fn exp_negative<R: Real>(x: R) -> R {
    exp_with_bits(x.max(R::splat(EXP_LEAST)), 7)
}

/// 2^n for −1022 ≤ n ≤ 1023.
#[inline(always)]
pub(crate) const fn power_of_two(n: i32) -> f64 {
    f64::from_bits(((1023 + n) as u64) << 52)
}

/// e^x for −2^`bits` ln 2 < x ≤ 0, as 2^−n e^r with |r| ≤ ln(2)/2, and Taylor's sum for e^r.
///
/// n is found digit by digit. Each subtraction of a multiple of ln 2 is exact (P. H. Sterbenz 1974: neither number is more than twice the
/// other). A compiler that re-associates products with sums, as those of graphics drivers do, finds no product here, and 2^−n is a product
/// of its digits' powers, which needs no integer arithmetic.
#[inline(always)]
pub(crate) fn exp_with_bits<R: Real>(x: R, bits: u32) -> R {
    let one = R::splat(1.0);
    let mut x = Reduction { high: x, low: R::splat(0.0), power: one };
    for bit in (0..bits).rev() {
        x = halved(x, f64::from(1_u32 << bit), power_of_two(-(1 << bit)));
    }
    let reduced = x.high + x.low;
    let tail = polynomial(R::Scalar::EXP, reduced);
    (one + (tail * reduced).mul_add(reduced, reduced)) * x.power
}

/// A number as `high + low` + log(`power`).
#[derive(Clone, Copy)]
struct Reduction<R> {
    high: R,
    low: R,
    power: R,
}

/// One binary digit of n: where `high` is below (1/2 − `weight`) ln 2, `weight` halvings are taken out of it.
#[inline(always)]
fn halved<R: Real>(x: Reduction<R>, weight: f64, power: f64) -> Reduction<R> {
    let [high, low] = R::Scalar::LN_2;
    let zero = R::splat(0.0);
    let set = x.high.less_than(R::splat((0.5 - weight) * high));
    Reduction {
        high: x.high + R::select(set, R::splat(weight * high), zero),
        low: x.low + R::select(set, R::splat(weight * low), zero),
        power: x.power * R::select(set, R::splat(power), R::splat(1.0)),
    }
}
