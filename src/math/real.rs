//! The one number type that the kernels are written in, and its scalar instantiations.
//!
//! Every kernel is generic over [`Real`]. `f64` is the reference, `f32` is compared step by step with the shader, and
//! the lanes of `lanes.rs` are the fast CPU engine. The WGSL twins are `shaders/real_f32.wgsl` and
//! `shaders/real_f64.wgsl`.

use std::fmt::Debug;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

use super::Precision;

/// A floating-point number, or several of them side by side (SIMD lanes), on which a kernel computes.
///
/// Kernels decide by masks and [`Real::select`] rather than by branches, so that one text serves scalars, lanes and
/// the shader.
pub trait Real:
    Copy
    + Debug
    + Send
    + Sync
    + 'static
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// The element of a lane, as columns store it.
    type Scalar: Scalar;
    /// The result of a comparison, one truth value a lane.
    type Mask: Copy + BitAnd<Output = Self::Mask> + BitOr<Output = Self::Mask> + Not<Output = Self::Mask>;

    /// Number of bodies that one value holds.
    const LANES: usize;

    /// All lanes equal to `x`, rounded to the nearest representable number.
    fn splat(x: f64) -> Self;
    /// The number whose lane `i` is `lane(i)`.
    fn from_lanes(lane: impl FnMut(usize) -> Self::Scalar) -> Self;
    /// Reads the first [`Real::LANES`] elements of `column`.
    fn load(column: &[Self::Scalar]) -> Self;
    /// Writes the lanes to the first [`Real::LANES`] elements of `column`.
    fn store(self, column: &mut [Self::Scalar]);

    /// `self * factor + addend`: one rounding in the SIMD lanes, two in the scalar types (so that the scalar `f32`
    /// twin can match an adapter without fused multiply-add to the bit).
    fn mul_add(self, factor: Self, addend: Self) -> Self;
    /// Correctly rounded square root.
    fn sqrt(self) -> Self;
    /// Absolute value.
    fn abs(self) -> Self;
    /// The lesser of two numbers; unspecified if one is not a number.
    fn min(self, other: Self) -> Self;
    /// The greater of two numbers; unspecified if one is not a number.
    fn max(self, other: Self) -> Self;
    /// `self < other`, lane by lane.
    fn less_than(self, other: Self) -> Self::Mask;
    /// Lane by lane, `if_true` where the mask is set and `if_false` elsewhere.
    fn select(mask: Self::Mask, if_true: Self, if_false: Self) -> Self;
    /// Whether the mask is set in any lane.
    fn any(mask: Self::Mask) -> bool;
    /// `self * other` and its rounding error, exactly (if the latter is a normal number), by a fused multiply-add in every instantiation. A
    /// kernel with a twin in a shader must not use it.
    fn two_product(self, other: Self) -> (Self, Self);

    /// Runs `work` as a separate function that is compiled for the same instruction set.
    ///
    /// Kernels are inlined into their loops as a whole. Long pieces that are called from many places in a step go through here; otherwise
    /// every integrator's code would grow by a copy at each of its stages.
    fn outlined<O>(work: impl FnOnce() -> O) -> O;

    /// Records an elementary function as one operation, for a type that records expressions instead of computing; numbers return `None`,
    /// and the function's polynomials are evaluated.
    #[inline(always)]
    fn recorded(_: Function, _: &[Self]) -> Option<Self> {
        None
    }

    /// The nearest integer, ties to even.
    ///
    /// Exact for |x| < 2²² (`f32`) or 2⁵¹ (`f64`): adding and subtracting 1.5 · 2^(mantissa bits) rounds at the unit.
    #[inline(always)]
    fn round(self) -> Self {
        let shift = Self::splat(Self::Scalar::ROUND_SHIFT);
        (self + shift) - shift
    }

    /// `self²`.
    #[inline(always)]
    fn squared(self) -> Self {
        self * self
    }
}

/// An elementary function that an expression keeps as one operation ([`Real::recorded`]).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Function {
    /// sin x.
    Sin,
    /// cos x.
    Cos,
    /// tan x.
    Tan,
    /// arcsin x.
    Asin,
    /// arccos x.
    Acos,
    /// The angle of the point (x, y) from the x axis; arguments y, x.
    Atan2,
    /// eˣ.
    Exp,
    /// ln x.
    Ln,
    /// xʸ.
    Pow,
    /// sin E of Kepler's equation E − e sin E = M; arguments M, e.
    KeplerSin,
    /// cos E of the same.
    KeplerCos,
    /// arctan(√x)/√x for 0 ≤ x ≤ 0.04.
    ArctangentRatio,
}

/// Does work by [`Real::outlined`] of a number type. All that it calls must be `#[inline(always)]`, as the closure is here; otherwise it is
/// compiled for the least processor, and each operation on lanes in it becomes a call. Only a closure in an argument's place can be forced
/// inline.
macro_rules! outlined {
    ($number:ty, $work:expr) => {
        <$number as $crate::math::real::Real>::outlined(
            #[inline(always)]
            || $work,
        )
    };
}

pub(crate) use outlined;

/// The element type of a column: `f32` or `f64`.
///
/// # What differs between the precisions
///
/// In `f32` rounding of the state, not truncation, limits accuracy. A state is therefore carried in two words, value
/// and residue, and so are the step size and the moments; in `f64` one word is enough. The polynomials of
/// [`sin_cos`] differ in length.
pub trait Scalar: Real<Scalar = Self, Mask = bool> + PartialOrd + Default + bytemuck::Pod {
    /// Words that a state and a parameter are carried in: 2 for `f32`, 1 for `f64`.
    const WORDS: usize;
    /// What it is called where bodies are integrated in it.
    const PRECISION: Precision = if Self::WORDS == 2 { Precision::F32 } else { Precision::F64 };
    /// Half the distance from 1 to the next number: the largest relative error of one rounding.
    const UNIT_ROUNDOFF: f64;
    /// 1.5 · 2^(mantissa bits), for [`Real::round`].
    const ROUND_SHIFT: f64;
    /// Coefficients of x³, x⁵, … of sin x on |x| ≤ π/4, highest first, without the leading x.
    const SIN: &'static [f64];
    /// Coefficients of x⁴, x⁶, … of cos x on |x| ≤ π/4, highest first, without the leading 1 − x²/2.
    const COS: &'static [f64];
    /// The last n of Σ (−x²)ⁿ/(2n + 1) that is summed for an arctangent of |x| ≤ 0.199.
    const ARCTANGENT_TERMS: u32;
    /// The last n of Σ z²ⁿ/(2n + 1) that is summed for a logarithm, |z| ≤ 0.172.
    const ARTANH_TERMS: u32;
    /// π/2 in words, each with trailing zeros, so that a product by a small integer is exact.
    const HALF_PI: &'static [f64];
    /// A number that vanishes next to 1.
    const NEGLIGIBLE: f64;
    /// A number whose fourth power vanishes next to 1.
    const FOURTH_POWER_NEGLIGIBLE: f64;
    /// 1/n! from the highest n down to 2, for [`crate::math::elementary::exp_negative`].
    const EXP: &'static [f64];
    /// ln 2 in two words, the first with trailing zeros, so that a product by a small integer is exact.
    const LN_2: [f64; 2];

    /// The nearest number to `x`.
    fn from_f64(x: f64) -> Self;
    /// `x` · 2⁻⁶⁴: rounded from all bits in `f64`, from the upper 32 in `f32`.
    fn from_fixed_point(x: i64) -> Self;
    /// The same number in `f64`, exactly.
    fn to_f64(self) -> f64;
    /// The two words of `x`: the nearest number, and the rest (0 if one word is carried).
    #[inline(always)]
    fn two_words(x: f64) -> (Self, Self) {
        let value = Self::from_f64(x);
        (value, Self::from_f64(x - value.to_f64()))
    }
}

macro_rules! impl_real_for_scalar {
    ($scalar:ident) => {
        impl Real for $scalar {
            type Scalar = $scalar;
            type Mask = bool;
            const LANES: usize = 1;

            #[inline(always)]
            fn splat(x: f64) -> Self {
                x as $scalar
            }
            #[inline(always)]
            fn from_lanes(mut lane: impl FnMut(usize) -> $scalar) -> Self {
                lane(0)
            }
            #[inline(always)]
            fn load(column: &[$scalar]) -> Self {
                column[0]
            }
            #[inline(always)]
            fn store(self, column: &mut [$scalar]) {
                column[0] = self;
            }
            #[inline(always)]
            fn mul_add(self, factor: Self, addend: Self) -> Self {
                self * factor + addend
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                <$scalar>::sqrt(self)
            }
            #[inline(always)]
            fn abs(self) -> Self {
                <$scalar>::abs(self)
            }
            #[inline(always)]
            fn min(self, other: Self) -> Self {
                if other < self { other } else { self }
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                if self < other { other } else { self }
            }
            #[inline(always)]
            fn less_than(self, other: Self) -> bool {
                self < other
            }
            #[inline(always)]
            fn select(mask: bool, if_true: Self, if_false: Self) -> Self {
                if mask { if_true } else { if_false }
            }
            #[inline(always)]
            fn any(mask: bool) -> bool {
                mask
            }
            #[inline(always)]
            fn two_product(self, other: Self) -> (Self, Self) {
                let product = self * other;
                (product, <$scalar>::mul_add(self, other, -product))
            }
            #[inline(never)]
            fn outlined<O>(work: impl FnOnce() -> O) -> O {
                work()
            }
        }
    };
}

impl_real_for_scalar!(f32);
impl_real_for_scalar!(f64);

// Sine and cosine polynomials: S. Moshier, Cephes Mathematical Library 2.8, sinf.c and sin.c (1992). The minimax
// error is below 2^-27 (f32) and 2^-56 (f64) of the result on |x| <= pi/4; tests/truth/sin_cos.rs measures the total.
impl Scalar for f32 {
    const WORDS: usize = 2;
    const UNIT_ROUNDOFF: f64 = 1.0 / 16_777_216.0;
    const ROUND_SHIFT: f64 = 12_582_912.0;
    const SIN: &'static [f64] = &[-1.9515295891e-4, 8.3321608736e-3, -1.6666654611e-1];
    const COS: &'static [f64] = &[2.443315711809948e-5, -1.388731625493765e-3, 4.166664568298827e-2];
    const ARCTANGENT_TERMS: u32 = 4;
    const ARTANH_TERMS: u32 = 4;
    const HALF_PI: &'static [f64] = &[1.5703125, 4.837512969970703125e-4, 7.549789954892e-8];
    const NEGLIGIBLE: f64 = 1.0 / 2_147_483_648.0;
    const FOURTH_POWER_NEGLIGIBLE: f64 = 1.0 / 256.0;
    // The first term left out is below 2^-27 of the result on |x| <= ln(2)/2.
    const EXP: &'static [f64] = &[1.0 / 5040.0, 1.0 / 720.0, 1.0 / 120.0, 1.0 / 24.0, 1.0 / 6.0, 0.5];
    const LN_2: [f64; 2] = [0.693359375, -2.121944400546905827679e-4];

    #[inline(always)]
    fn from_f64(x: f64) -> f32 {
        x as f32
    }
    #[inline(always)]
    fn from_fixed_point(x: i64) -> f32 {
        (x >> 32) as i32 as f32 * (1.0 / 4_294_967_296.0)
    }
    #[inline(always)]
    fn to_f64(self) -> f64 {
        f64::from(self)
    }
}

impl Scalar for f64 {
    const WORDS: usize = 1;
    const UNIT_ROUNDOFF: f64 = 1.0 / 9_007_199_254_740_992.0;
    const ROUND_SHIFT: f64 = 6_755_399_441_055_744.0;
    const SIN: &'static [f64] = &[
        1.58962301576546568060e-10,
        -2.50507477628578072866e-8,
        2.75573136213857245213e-6,
        -1.98412698295895385996e-4,
        8.33333333332211858878e-3,
        -1.66666666666666307295e-1,
    ];
    const COS: &'static [f64] = &[
        -1.13585365213876817300e-11,
        2.08757008419747316778e-9,
        -2.75573141792967388112e-7,
        2.48015872888517045348e-5,
        -1.38888888888730564116e-3,
        4.16666666666665929218e-2,
    ];
    const ARCTANGENT_TERMS: u32 = 10;
    const ARTANH_TERMS: u32 = 9;
    // Cody and Waite words of 33, 33 and 53 bits, as in fdlibm's e_rem_pio2.c (Sun Microsystems, 1993).
    const HALF_PI: &'static [f64] =
        &[1.57079632673412561417e+00, 6.07710050630396597660e-11, 2.02226624879595063154e-21];
    const NEGLIGIBLE: f64 = 1.0 / 1_152_921_504_606_846_976.0;
    const FOURTH_POWER_NEGLIGIBLE: f64 = 1.0 / 16_384.0;
    // The first term left out is below 2^-57 of the result on |x| <= ln(2)/2.
    const EXP: &'static [f64] = &[
        1.0 / 6_227_020_800.0,
        1.0 / 479_001_600.0,
        1.0 / 39_916_800.0,
        1.0 / 3_628_800.0,
        1.0 / 362_880.0,
        1.0 / 40_320.0,
        1.0 / 5040.0,
        1.0 / 720.0,
        1.0 / 120.0,
        1.0 / 24.0,
        1.0 / 6.0,
        0.5,
    ];
    // Words of 33 and 53 bits, as in fdlibm's e_exp.c (Sun Microsystems, 1993).
    const LN_2: [f64; 2] = [6.93147180369123816490e-01, 1.90821492927058770002e-10];

    #[inline(always)]
    fn from_f64(x: f64) -> f64 {
        x
    }
    #[inline(always)]
    fn from_fixed_point(x: i64) -> f64 {
        x as f64 * (1.0 / 18_446_744_073_709_551_616.0)
    }
    #[inline(always)]
    fn to_f64(self) -> f64 {
        self
    }
}

/// `x`, or `otherwise` where it is infinite or not a number. Twin: `finite_or` in `shaders/real_f32.wgsl` and `real_f64.wgsl`.
#[inline(always)]
pub fn finite_or<R: Real>(x: R, otherwise: R) -> R {
    R::select(x.abs().less_than(R::splat(f64::INFINITY)), x, otherwise)
}

/// sin x and cos x for |x| ≤ 2¹⁰ (`f32`) or 2²⁰ (`f64`).
///
/// The error is at most 1 ulp of 1 in `f32` (1.2e-7) and in `f64` (2.2e-16), absolute. Outside the range the
/// reduction by multiples of π/2 is no longer exact and the error grows in proportion to x.
///
/// No library function is used: Vulkan allows `sin` and `cos` an absolute error of 2⁻¹¹, and SPIR-V has none in `f64`.
#[inline(always)]
pub fn sin_cos<R: Real>(x: R) -> (R, R) {
    if let (Some(sin), Some(cos)) = (R::recorded(Function::Sin, &[x]), R::recorded(Function::Cos, &[x])) {
        return (sin, cos);
    }
    let turns = (x * R::splat(std::f64::consts::FRAC_2_PI)).round();
    let mut reduced = x;
    for word in R::Scalar::HALF_PI {
        reduced = turns.mul_add(R::splat(-word), reduced);
    }
    let (sin, cos) = sin_cos_eighth(reduced);

    // Quadrant, as -2, -1, 0, 1 or 2.
    let quadrant = turns - R::splat(4.0) * (turns * R::splat(0.25)).round();
    let half = R::splat(0.5);
    let odd = half.less_than(quadrant.abs()) & quadrant.abs().less_than(R::splat(1.5));
    let opposite = R::splat(1.5).less_than(quadrant.abs());
    let (swapped_sin, swapped_cos) = (R::select(odd, cos, sin), R::select(odd, sin, cos));
    let sin_negative = opposite | quadrant.less_than(-half);
    let cos_negative = opposite | (odd & half.less_than(quadrant));
    (R::select(sin_negative, -swapped_sin, swapped_sin), R::select(cos_negative, -swapped_cos, swapped_cos))
}

/// sin x and cos x for |x| ≤ π/4, where no reduction is needed.
#[inline(always)]
pub fn sin_cos_eighth<R: Real>(x: R) -> (R, R) {
    let x2 = x.squared();
    let sin = (polynomial(R::Scalar::SIN, x2) * x2).mul_add(x, x);
    let cos = (polynomial(R::Scalar::COS, x2) * x2).mul_add(x2, R::splat(1.0) - R::splat(0.5) * x2);
    (sin, cos)
}

/// Horner's scheme, highest coefficient first.
#[inline(always)]
pub(crate) fn polynomial<R: Real>(coefficients: &[f64], x: R) -> R {
    let mut sum = R::splat(coefficients[0]);
    for &coefficient in &coefficients[1..] {
        sum = sum.mul_add(x, R::splat(coefficient));
    }
    sum
}
