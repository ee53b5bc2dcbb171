//! The elementary functions of users' formulas: exponential, logarithm, power, tangent and the inverse circular functions.
//!
//! No library function is used: Vulkan's are inaccurate in `f32`, and SPIR-V has none in `f64`. The kernels are free of
//! branches and of bit operations, so that one text serves scalars, lanes and the shader. Products and quotients that
//! must be known beyond one word are formed from halves of the mantissa (T. J. Dekker, Numer. Math. 18 (1971) 224), whose
//! products are exact whether or not `mul_add` is fused.
//!
//! Errors are in ulps of the result: distances between neighbouring numbers there. `tests/truth/elementary.rs` checks every
//! bound, fused and unfused. *Measured* is the largest error over every `f32` argument of a function of one number (reference:
//! the library's `f64`) and over 10⁷ (`f64`), 2·10⁶ (`f32`) or 10⁵ (either, fused) random ones (reference: 32 digits).
//! If a result is subnormal, its error may be one more distance between subnormals.
//!
//! # Infinities and NaN
//!
//! On the CPU an argument outside a function's domain gives NaN, as does NaN. A shader writes the same bits, but a driver may assume that
//! there are no such numbers: a kernel must not test for them, and the host detects them by their bits. Devices may also take subnormal
//! arguments for zero. The sign of a zero argument is ignored, and that of a zero result is not specified.
//!
//! Twin: `shaders/functions.wgsl`, on `shaders/functions_f32.wgsl` or `shaders/functions_f64.wgsl`.

use std::f64::consts::{FRAC_2_PI, LOG2_E, SQRT_2};

use super::power_of_two;
use crate::math::real::{Function, Real, Scalar, polynomial, sin_cos_eighth};

/// A number as `high + low`.
#[derive(Clone, Copy)]
struct Words<R> {
    high: R,
    low: R,
}

/// From `from` on, a function is expanded about `point`, where its value is `high + low`.
struct Expansion {
    from: f64,
    point: f64,
    high: f64,
    low: f64,
}

/// The constants of a precision that the functions need beside [`Scalar`].
struct Numbers {
    /// 2^s + 1, s being half the bits of a mantissa, rounded up: [`upper_half`].
    splitter: f64,
    /// The largest finite number.
    largest: f64,
    /// Where eˣ is the least normal number, rounded up, and the largest number, rounded down.
    exp_range: [f64; 2],
    /// The exponents of the powers of two into which an exponent is resolved; their sum is the largest exponent.
    exponent_digits: &'static [i32],
    /// The exponent that brings a number below 1 above 1, and the additional one for a subnormal number.
    raised_by: [i32; 2],
    /// ln on [√½, √2]; the grid of the first word is such that its sum with a multiple of the first word of ln 2 is exact.
    logarithm: &'static [Expansion; 6],
    /// 1/(2n + 1) from the highest n down to 1.
    artanh: &'static [f64],
    /// arctan on [0, 1].
    arctangent: &'static [Expansion; 4],
    /// (−1)ⁿ/(2n + 1) from the highest n down to 1.
    arctangent_series: &'static [f64],
    /// π/2 in words that, except the last, have trailing zeros, so that products with whole numbers are exact within the range
    /// of `sin_cos`.
    half_pi: [f64; 4],
    /// π/2 and π in two words.
    quarter_turn: [f64; 2],
    half_turn: [f64; 2],
    /// 1 and 4 ulp.
    largest_sine: f64,
    /// Beyond ± this exponent every power of a number other than 1 is out of range.
    largest_exponent: f64,
    /// Coordinates of `far` or more are multiplied by `reduction`, and those below `near` by `enlargement`; what is below
    /// `nothing` after that was zero.
    far: f64,
    reduction: f64,
    near: f64,
    enlargement: f64,
    nothing: f64,
}

static F32: Numbers = Numbers {
    splitter: 4097.0,
    largest: f32::MAX as f64,
    exp_range: [-87.33654022216797, 88.72283172607422],
    exponent_digits: &[64, 32, 16, 8, 4, 2, 1, 1],
    raised_by: [126, 23],
    logarithm: &[
        Expansion { from: 0.0, point: 0.75, high: -0.287689208984375, low: 7.136532531148987e-06 },
        Expansion { from: 0.8125, point: 0.875, high: -0.1335296630859375, low: -1.72953855326341e-06 },
        Expansion { from: 0.9375, point: 1.0, high: 0.0, low: 0.0 },
        Expansion { from: 1.0625, point: 1.125, high: 0.1177825927734375, low: 4.428829356584174e-07 },
        Expansion { from: 1.1875, point: 1.25, high: 0.22314453125, low: -9.799357485462679e-07 },
        Expansion { from: 1.3125, point: 1.375, high: 0.318450927734375, low: 2.8033841772412416e-06 },
    ],
    artanh: &[1.0 / 7.0, 1.0 / 5.0, 1.0 / 3.0],
    arctangent: &[
        Expansion { from: 0.0, point: 0.0, high: 0.0, low: 0.0 },
        Expansion { from: 0.13, point: 0.25, high: 0.244978666305542, low: -3.1786777654474463e-09 },
        Expansion { from: 0.36, point: 0.5, high: 0.46364760398864746, low: 5.01215868808913e-09 },
        Expansion { from: 0.72, point: 1.0, high: 0.7853981852531433, low: -2.1855694143368964e-08 },
    ],
    arctangent_series: &[1.0 / 9.0, -1.0 / 7.0, 1.0 / 5.0, -1.0 / 3.0],
    half_pi: [1.5706787109375, 0.00011761486530303955, 9.920313459588215e-10, 6.223371969669989e-14],
    quarter_turn: [1.5707963705062866, -4.371138828673793e-08],
    half_turn: [3.1415927410125732, -8.742277657347586e-08],
    largest_sine: 1.000000476837158203125,
    largest_exponent: power_of_two(40),
    far: power_of_two(100),
    reduction: power_of_two(-30),
    near: power_of_two(-90),
    enlargement: power_of_two(60),
    nothing: power_of_two(-100),
};

static F64: Numbers = Numbers {
    splitter: 134_217_729.0,
    largest: f64::MAX,
    exp_range: [-708.3964185322641, 709.782712893384],
    exponent_digits: &[512, 256, 128, 64, 32, 16, 8, 4, 2, 1, 1],
    raised_by: [1022, 52],
    logarithm: &[
        Expansion { from: 0.0, point: 0.75, high: -0.2876820724513891, low: -3.918237769963822e-13 },
        Expansion { from: 0.8125, point: 0.875, high: -0.13353139262471814, low: 1.9551393909415374e-13 },
        Expansion { from: 0.9375, point: 1.0, high: 0.0, low: 0.0 },
        Expansion { from: 1.0625, point: 1.125, high: 0.11778303565643, low: -4.654729747598445e-14 },
        Expansion { from: 1.1875, point: 1.25, high: 0.22314355131402408, low: 1.856757095979601e-13 },
        Expansion { from: 1.3125, point: 1.375, high: 0.3184537311180975, low: 4.3712191957429144e-13 },
    ],
    artanh: &[1.0 / 13.0, 1.0 / 11.0, 1.0 / 9.0, 1.0 / 7.0, 1.0 / 5.0, 1.0 / 3.0],
    arctangent: &[
        Expansion { from: 0.0, point: 0.0, high: 0.0, low: 0.0 },
        Expansion { from: 0.13, point: 0.25, high: 0.24497866312686414, low: 1.0698755618734451e-17 },
        Expansion { from: 0.36, point: 0.5, high: 0.4636476090008061, low: 2.2698777452961687e-17 },
        Expansion { from: 0.72, point: 1.0, high: std::f64::consts::FRAC_PI_4, low: 3.061616997868383e-17 },
    ],
    arctangent_series: &[
        1.0 / 21.0,
        -1.0 / 19.0,
        1.0 / 17.0,
        -1.0 / 15.0,
        1.0 / 13.0,
        -1.0 / 11.0,
        1.0 / 9.0,
        -1.0 / 7.0,
        1.0 / 5.0,
        -1.0 / 3.0,
    ],
    half_pi: [1.5707963267341256, 6.077100506303966e-11, 2.0222662487111665e-21, 8.4784276603689e-32],
    quarter_turn: [std::f64::consts::FRAC_PI_2, 6.123233995736766e-17],
    half_turn: [std::f64::consts::PI, 1.2246467991473532e-16],
    largest_sine: 1.0 + 4.0 * f64::EPSILON,
    largest_exponent: power_of_two(70),
    far: power_of_two(900),
    reduction: power_of_two(-60),
    near: power_of_two(-800),
    enlargement: power_of_two(200),
    nothing: power_of_two(-880),
};

/// The numbers of a type's precision; the branch is on a constant.
#[inline(always)]
fn numbers<R: Real>() -> &'static Numbers {
    if R::Scalar::UNIT_ROUNDOFF < F32_OR_F64 { &F64 } else { &F32 }
}

/// Between the units of roundoff of the two precisions.
const F32_OR_F64: f64 = 1e-12;

/// eˣ. Above ln of the largest number, infinity; below ln of the least normal number, 0.
///
/// The error is at most 1.5 ulp (measured: 1.07).
#[inline(always)]
pub fn exp<R: Real>(x: R) -> R {
    if let Some(node) = R::recorded(Function::Exp, &[x]) {
        return node;
    }
    exp_of_words(x, R::splat(0.0))
}

/// ln x for x > 0; ln ∞ = ∞. NaN for zero and for negative numbers.
///
/// The error is at most 1 ulp (measured: 0.51), near x = 1 too.
#[inline(always)]
pub fn ln<R: Real>(x: R) -> R {
    if let Some(node) = R::recorded(Function::Ln, &[x]) {
        return node;
    }
    let logarithm = logarithm(x);
    let result = R::select(R::splat(numbers::<R>().largest).less_than(x), x, logarithm.high + logarithm.low);
    R::select(R::splat(0.0).less_than(x), result, R::splat(f64::NAN))
}

/// xʸ = e^(y ln x) for x ≥ 0; NaN for negative x (whole powers of these are products). x⁰ = 1 for every x, 0ʸ = 0 for y > 0 and
/// ∞ for y < 0, and the reciprocals of these for x = ∞. Results that leave the range of normal numbers are those of [`exp`].
///
/// The error is at most 2 ulp (measured: 1.51). The logarithm and its product by y are carried in two words: a relative
/// error of theirs counts |y ln x| times, which may be 700.
#[inline(always)]
pub fn pow<R: Real>(x: R, y: R) -> R {
    if let Some(node) = R::recorded(Function::Pow, &[x, y]) {
        return node;
    }
    let (zero, one) = (R::splat(0.0), R::splat(1.0));
    let limit = R::splat(numbers::<R>().largest_exponent);
    let exponent = R::select(y.less_than(-limit), -limit, R::select(limit.less_than(y), limit, y));
    let logarithm = logarithm(x);
    let exponent_half = upper_half(exponent);
    let logarithm_half = upper_half(logarithm.high);
    let rest = (logarithm.high - logarithm_half) + logarithm.low;
    let product = exponent_half * logarithm_half;
    let product_rest = exponent * rest + (exponent - exponent_half) * logarithm_half;
    let sum = quick_sum(product, product_rest);
    let power = exp_of_words(sum.high, sum.low);

    let (y_positive, y_negative) = (zero.less_than(y), y.less_than(zero));
    let x_infinite = R::splat(numbers::<R>().largest).less_than(x);
    // NaN is neither positive nor negative, nor below one.
    let x_zero = !zero.less_than(x) & !x.less_than(zero) & x.less_than(one);
    let y_zero = !y_positive & !y_negative & y.less_than(one);
    let infinite = (x_infinite & y_positive) | (x_zero & y_negative);
    let vanishing = (x_infinite & y_negative) | (x_zero & y_positive);
    let in_domain = R::select(x.less_than(zero), R::splat(f64::NAN), power);
    let bounded = R::select(infinite, R::splat(f64::INFINITY), R::select(vanishing, zero, in_domain));
    R::select(y_zero, one, bounded)
}

/// tan x for |x| ≤ 2¹⁰ (`f32`) or 2²⁰ (`f64`), the range of [`crate::math::real::sin_cos`]; beyond it the error grows.
///
/// The error is at most 3 ulp (measured: 2.91), near the zeros and the poles too.
#[inline(always)]
pub fn tan<R: Real>(x: R) -> R {
    if let Some(node) = R::recorded(Function::Tan, &[x]) {
        return node;
    }
    let [first, second, third, last] = numbers::<R>().half_pi;
    let turns = (x * R::splat(FRAC_2_PI)).round();
    // The products with the first three words are exact, and so is the first difference.
    let near = turns.mul_add(R::splat(-first), x);
    let nearer = exact_sum(near, turns * R::splat(-second));
    let nearest = exact_sum(nearer.high, turns * R::splat(-third));
    let rest = turns.mul_add(R::splat(-last), nearer.low + nearest.low);
    let reduced = quick_sum(nearest.high, rest);
    let (sin, cos) = sin_cos_eighth(reduced.high);
    let (sin_low, cos_low) = (reduced.low * cos, -(reduced.low * sin));

    let odd = R::splat(0.5).less_than((turns - R::splat(2.0) * (turns * R::splat(0.5)).round()).abs());
    let numerator = Words { high: R::select(odd, -cos, sin), low: R::select(odd, -cos_low, sin_low) };
    let denominator = Words { high: R::select(odd, sin, cos), low: R::select(odd, sin_low, cos_low) };
    let tangent = quotient(numerator, denominator);
    tangent.high + tangent.low
}

/// arcsin x, in [−π/2, π/2]. An argument up to 4 ulp beyond ±1, as rounding may cause, counts as ±1; beyond that, NaN.
///
/// The error is at most 1.5 ulp (measured: 0.87).
#[inline(always)]
pub fn asin<R: Real>(x: R) -> R {
    if let Some(node) = R::recorded(Function::Asin, &[x]) {
        return node;
    }
    let one = R::splat(1.0);
    let sine = x.abs();
    let cosine = complement(sine);
    // The tangent of half the angle is sin/(1 + cos).
    let denominator = quick_sum(one, cosine.high);
    let denominator = Words { high: denominator.high, low: denominator.low + cosine.low };
    let half = arctangent(Words { high: R::select(one.less_than(sine), one, sine), low: R::splat(0.0) }, denominator);
    let angle = R::splat(2.0) * (half.high + half.low);
    let signed = R::select(x.less_than(R::splat(0.0)), -angle, angle);
    R::select(R::splat(numbers::<R>().largest_sine).less_than(sine), R::splat(f64::NAN), signed)
}

/// arccos x, in [0, π]. An argument up to 4 ulp beyond ±1, as rounding may cause, counts as ±1; beyond that, NaN.
///
/// The error is at most 1.5 ulp (measured: 1.07), near x = 1 too.
#[inline(always)]
pub fn acos<R: Real>(x: R) -> R {
    if let Some(node) = R::recorded(Function::Acos, &[x]) {
        return node;
    }
    let (zero, one, two) = (R::splat(0.0), R::splat(1.0), R::splat(2.0));
    let [straight, straight_low] = numbers::<R>().half_turn;
    let cosine = x.abs();
    let sine = complement(cosine);
    // The tangent of half the angle of |x|.
    let half = arctangent(sine, quick_sum(one, R::select(one.less_than(cosine), one, cosine)));
    let negative = x.less_than(zero);
    let (high, low) = (two * half.high, two * half.low);
    let angle = quick_sum(R::select(negative, R::splat(straight), zero), R::select(negative, -high, high));
    let rest = R::select(negative, R::splat(straight_low) - low, low);
    let result = angle.high + (angle.low + rest);
    R::select(R::splat(numbers::<R>().largest_sine).less_than(cosine), R::splat(f64::NAN), result)
}

/// The angle of the point (x, y) from the x axis, in [−π, π]: 0 for (0, 0); π on the negative x axis, whatever the sign of the zero y. An
/// infinite coordinate counts as the largest finite number.
///
/// The error is at most 1 ulp (measured: 0.52).
#[inline(always)]
pub fn atan2<R: Real>(y: R, x: R) -> R {
    if let Some(node) = R::recorded(Function::Atan2, &[y, x]) {
        return node;
    }
    let zero = R::splat(0.0);
    let numbers = numbers::<R>();
    let largest = R::splat(numbers.largest);
    let (size_x, size_y) = (x.abs(), y.abs());
    let size_x = R::select(largest.less_than(size_x), largest, size_x);
    let size_y = R::select(largest.less_than(size_y), largest, size_y);
    let steep = size_x.less_than(size_y);
    let shorter = R::select(steep, size_x, size_y);
    let longer = R::select(steep, size_y, size_x);
    // Halves of a mantissa then neither overflow nor vanish.
    let scale = R::select(
        longer.less_than(R::splat(numbers.near)),
        R::splat(numbers.enlargement),
        R::select(longer.less_than(R::splat(numbers.far)), R::splat(1.0), R::splat(numbers.reduction)),
    );
    let longer = longer * scale;
    let longer = R::select(longer.less_than(R::splat(numbers.nothing)), R::splat(1.0), longer);
    let angle = arctangent(Words { high: shorter * scale, low: zero }, Words { high: longer, low: zero });

    let left = x.less_than(zero);
    let backwards = (steep & !left) | (!steep & left);
    let [quarter, quarter_low] = numbers.quarter_turn;
    let [straight, straight_low] = numbers.half_turn;
    let axis = R::select(steep, R::splat(quarter), R::select(left, R::splat(straight), zero));
    let axis_low = R::select(steep, R::splat(quarter_low), R::select(left, R::splat(straight_low), zero));
    let sum = quick_sum(axis, R::select(backwards, -angle.high, angle.high));
    let rest = axis_low + R::select(backwards, -angle.low, angle.low);
    let result = sum.high + (sum.low + rest);
    R::select(y.less_than(zero), -result, result)
}

/// arctan(√x2)/√x2 for 0 ≤ x2 ≤ 0.04, by the series of the arctangent.
///
/// The error is at most 1 ulp (measured: 0.68).
#[inline(always)]
pub fn arctangent_ratio<R: Real>(x2: R) -> R {
    if let Some(node) = R::recorded(Function::ArctangentRatio, &[x2]) {
        return node;
    }
    polynomial(numbers::<R>().arctangent_series, x2).mul_add(x2, R::splat(1.0))
}

/// `x` with the lower half of its mantissa cleared: products of such numbers are exact (G. W. Veltkamp 1968; Dekker 1971).
#[inline(always)]
fn upper_half<R: Real>(x: R) -> R {
    let scaled = x * R::splat(numbers::<R>().splitter);
    scaled - (scaled - x)
}

/// a + b and its rounding error, exactly, where |a| ≥ |b| or a = 0 (Dekker 1971).
#[inline(always)]
fn quick_sum<R: Real>(a: R, b: R) -> Words<R> {
    let sum = a + b;
    Words { high: sum, low: b - (sum - a) }
}

/// a + b and its rounding error, exactly (Knuth, TAOCP vol. 2, 4.2.2, theorem B).
#[inline(always)]
fn exact_sum<R: Real>(a: R, b: R) -> Words<R> {
    let sum = a + b;
    let b_taken = sum - a;
    let a_taken = sum - b_taken;
    Words { high: sum, low: (a - a_taken) + (b - b_taken) }
}

/// n/d to about one and a half words, with `high` half a mantissa long, even if the device's division is off by a few ulp.
#[inline(always)]
fn quotient<R: Real>(n: Words<R>, d: Words<R>) -> Words<R> {
    let high = upper_half(n.high / d.high);
    let half = upper_half(d.high);
    // The product and the difference are exact.
    let rest = n.high - high * half;
    let residual = (rest - high * ((d.high - half) + d.low)) + n.low;
    Words { high, low: residual / d.high }
}

/// value · 2ⁿ for a whole number n.
///
/// The factors for the digits of |n| are applied to the value one by one, so that no intermediate result overflows or vanishes
/// unless the last one does.
#[inline(always)]
fn scaled<R: Real>(value: R, n: R) -> R {
    let (zero, one) = (R::splat(0.0), R::splat(1.0));
    let negative = n.less_than(zero);
    let mut digits = n.abs();
    let mut value = value;
    for &weight in numbers::<R>().exponent_digits {
        let set = R::splat(f64::from(weight) - 0.5).less_than(digits);
        let power = R::select(negative, R::splat(power_of_two(-weight)), R::splat(power_of_two(weight)));
        value = value * R::select(set, power, one);
        digits = digits - R::select(set, R::splat(f64::from(weight)), zero);
    }
    value
}

/// e^(high + low), as 2ⁿ eʳ with |r| ≤ ln(2)/2, and Taylor's sum for eʳ.
#[inline(always)]
fn exp_of_words<R: Real>(high: R, low: R) -> R {
    let one = R::splat(1.0);
    let [least, most] = numbers::<R>().exp_range;
    let [ln_2, ln_2_low] = R::Scalar::LN_2;
    let below = high.less_than(R::splat(least));
    let above = R::splat(most).less_than(high);
    let bounded = R::select(below, R::splat(least), R::select(above, R::splat(most), high));
    let n = (bounded * R::splat(LOG2_E)).round();
    // Exact: the first word of ln 2 has trailing zeros, and neither number is more than twice the other (Sterbenz 1974).
    let rest = n.mul_add(R::splat(-ln_2), bounded);
    let reduced = rest + n.mul_add(R::splat(-ln_2_low), low);
    let tail = polynomial(R::Scalar::EXP, reduced);
    let power = one + (tail * reduced).mul_add(reduced, reduced);
    let result = scaled(power, n);
    R::select(below, R::splat(0.0), R::select(above, R::splat(f64::INFINITY), result))
}

/// ln x for 0 < x < ∞ to about one and a half words.
///
/// x = 2ᵉ m with m in [√½, √2], and m is compared with the nearest of six points c: ln(m/c) = 2 artanh z with z = (m − c)/(m + c), |z| ≤
/// 0.043. The terms of z³ and beyond are so small that one word is enough for them; the quotient z itself is known to more.
#[inline(always)]
fn logarithm<R: Real>(x: R) -> Words<R> {
    let (zero, one, two) = (R::splat(0.0), R::splat(1.0), R::splat(2.0));
    let half = R::splat(0.5);
    let numbers = numbers::<R>();
    let [ln_2, ln_2_low] = R::Scalar::LN_2;

    let mut mantissa = x;
    let mut exponent = zero;
    for raised in numbers.raised_by {
        let small = mantissa.less_than(one);
        mantissa = mantissa * R::select(small, R::splat(power_of_two(raised)), one);
        exponent = exponent - R::select(small, R::splat(f64::from(raised)), zero);
    }
    for &weight in numbers.exponent_digits {
        let set = !mantissa.less_than(R::splat(power_of_two(weight)));
        mantissa = mantissa * R::select(set, R::splat(power_of_two(-weight)), one);
        exponent = exponent + R::select(set, R::splat(f64::from(weight)), zero);
    }
    let large = R::splat(SQRT_2).less_than(mantissa);
    mantissa = mantissa * R::select(large, half, one);
    exponent = exponent + R::select(large, one, zero);

    let (mut point, mut value, mut value_low) = (zero, zero, zero);
    for expansion in numbers.logarithm {
        let beyond = R::splat(expansion.from).less_than(mantissa);
        point = R::select(beyond, R::splat(expansion.point), point);
        value = R::select(beyond, R::splat(expansion.high), value);
        value_low = R::select(beyond, R::splat(expansion.low), value_low);
    }
    // The difference is exact.
    let difference = Words { high: two * (mantissa - point), low: zero };
    let ratio = quotient(difference, quick_sum(point, mantissa));
    let twice = ratio.high + ratio.low;
    let z = half * twice;
    let z2 = z.squared();
    let tail = twice * (z2 * polynomial(numbers.artanh, z2));

    // Both products are exact, and so is the first sum.
    let whole = exponent.mul_add(R::splat(ln_2), value);
    let whole_low = exponent.mul_add(R::splat(ln_2_low), value_low);
    let sum = quick_sum(whole, ratio.high);
    quick_sum(sum.high, sum.low + (whole_low + (ratio.low + tail)))
}

/// √(1 − x²) for 0 ≤ x ≤ 1, and 0 for x > 1.
#[inline(always)]
fn complement<R: Real>(x: R) -> Words<R> {
    let (zero, one) = (R::splat(0.0), R::splat(1.0));
    let difference = one - x;
    let square = R::select(difference.less_than(zero), zero, difference * (one + x));
    let root = square.sqrt();
    // One Newton step, for devices whose root has an error above its rounding.
    let half = upper_half(root);
    let rest = root - half;
    let residual = ((square - half * half) - (half + half) * rest) - rest * rest;
    let divisor = R::select(zero.less_than(root), root + root, one);
    Words { high: root, low: residual / divisor }
}

/// arctan(n/d) for 0 ≤ n ≤ d to about one and a half words.
///
/// It is expanded about the nearest of four tangents c that are powers of two or 0, by
/// arctan(n/d) = arctan c + arctan((n − c d)/(d + c n)), so that the difference is exact and the argument of the series at
/// most 0.164.
#[inline(always)]
fn arctangent<R: Real>(n: Words<R>, d: Words<R>) -> Words<R> {
    let zero = R::splat(0.0);
    let (mut point, mut value, mut value_low) = (zero, zero, zero);
    for expansion in numbers::<R>().arctangent {
        let beyond = (d.high * R::splat(expansion.from)).less_than(n.high);
        point = R::select(beyond, R::splat(expansion.point), point);
        value = R::select(beyond, R::splat(expansion.high), value);
        value_low = R::select(beyond, R::splat(expansion.low), value_low);
    }
    let difference = Words { high: n.high - point * d.high, low: n.low - point * d.low };
    let sum = quick_sum(d.high, point * n.high);
    let sum = Words { high: sum.high, low: sum.low + (d.low + point * n.low) };
    let ratio = quotient(difference, sum);
    let t = ratio.high + ratio.low;
    let t2 = t.squared();
    let tail = t * (t2 * polynomial(numbers::<R>().arctangent_series, t2));
    let angle = quick_sum(value, ratio.high);
    Words { high: angle.high, low: angle.low + (value_low + (ratio.low + tail)) }
}
