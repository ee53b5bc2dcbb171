//! From a body's moments and initial state to its row of constants and its two rates.

use crate::kernel::free_motion::elliptic::{INVERSE_TAU, landen};
use crate::kernel::free_motion::evaluation::{
    ALPHA_IMAGINARY, ALPHA_REAL, BETA_FACTOR, BETA_IMAGINARY, BETA_REAL, CIRCULATES_ABOUT_FIRST,
    CIRCULATES_ABOUT_THIRD, COSINES, GAIN, NOME, OFFSET, Row, SHAPE_COLUMNS, SINES, SLOPE, Shape, TRANSFORMED,
    TRANSFORMED_NOME, direct_shape, from_half_turn, in_principal_axes, select_shape, shape, transformed_series,
    turned_about_z,
};
use crate::kernel::free_motion::number::Number;
use crate::math::double_double::DoubleDouble;
use crate::math::elementary::{Turns, exp_with_bits, power_of_two, sin_cos_turns, turned_by};
use crate::math::quaternion::Quaternion;
use crate::math::real::{Real, sin_cos_eighth};
use crate::math::vector::Vector;

/// The arithmetic in which the constants of a closed form are computed, whatever it is evaluated in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum SetUp {
    /// In `f64`: phases are wrong by some roundings of the angle turned, more where the regime is hard to tell
    /// ([`crate::plan::class::FreeBody::set_up_bound`]).
    OneWord,
    /// In double-double arithmetic, so that errors do not grow with time.
    TwoWords,
}

/// A body as input of the set-up, scaled: the middle moment and the largest component of the angular velocity are in [1, 2).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Initial<R> {
    /// I₁ ≤ I₂ ≤ I₃.
    pub moments: [DoubleDouble<R>; 3],
    /// ω along the principal axes.
    pub angular_velocity: [DoubleDouble<R>; 3],
    /// Principal axes to world, a unit quaternion.
    pub orientation: Quaternion<R>,
}

impl<R: Real> Initial<R> {
    /// The angular momentum along the principal axes.
    #[inline(always)]
    pub fn angular_momentum(&self) -> [DoubleDouble<R>; 3] {
        let ([i1, i2, i3], [w1, w2, w3]) = (self.moments, self.angular_velocity);
        [i1 * w1, i2 * w2, i3 * w3]
    }
}

/// The results of the set-up.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Constants<R: Real> {
    /// The row, except for bodies on the separatrix.
    pub row: Row<R>,
    /// Rate of v, turns per unit of time.
    pub polhode_rate: DoubleDouble<R>,
    /// Rate of μ t, turns per unit of time.
    pub precession_rate: DoubleDouble<R>,
    /// v at the start, turns.
    pub polhode_start: DoubleDouble<R>,
    /// Set where the body is on the separatrix.
    pub separatrix: R::Mask,
    /// The constants of the motion in the theory's terms.
    pub theory: Theory<R>,
}

/// The elements of the motion; the names are those of [`crate::kernel::free_motion`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Theory<R> {
    /// k².
    pub modulus_squared: R,
    /// k′².
    pub complement_squared: R,
    /// λ.
    pub lambda: R,
    /// |L|.
    pub angular_momentum: R,
    pub moments: Vector<R>,
    /// Amplitudes of ω about a, 2 and d.
    pub amplitudes: Vector<R>,
    /// ω about a, 2 and d at the start.
    pub angular_velocity: Vector<R>,
    /// The angle φ_b as bracket F(φ_b, k′)/K′ in [0, 1].
    pub bracket: R,
    /// +1 if the motion circulates about the third axis, −1 if about the first.
    pub sense: R,
    /// Signs of the axes 2 and d.
    pub signs: (R, R),
    /// Nonzero where the spin is about the middle axis, so that there is no polhode motion.
    pub steady: R,
}

/// K′/K below which the transformed series is used: the nome is 0.15 there.
pub(crate) const SWITCH: f64 = 0.6;
/// Differences of moments below this, in units of the middle one, count as zero: the set-up does not resolve them.
const EQUAL_MOMENTS: f64 = power_of_two(-96);
/// D below this part of its terms counts as zero: the set-up does not resolve it.
const SEPARATRIX: f64 = power_of_two(-98);
/// k′² below this counts as zero: the exponentials of the transformed series would leave the range of `f32`.
const LEAST_COMPLEMENT: f64 = power_of_two(-236);
/// k² below this counts as zero.
const LEAST_MODULUS: f64 = power_of_two(-200);

/// Coefficients below this part of the leading one count as zero: they change nothing in `f64`, and their products would be subnormal
/// numbers in `f32`.
const VANISHING: f64 = power_of_two(-60);

#[inline(always)]
fn is_zero<R: Real>(x: R) -> R::Mask {
    !R::splat(0.0).less_than(x.abs())
}

#[inline(always)]
fn where_set<R: Real>(mask: R::Mask) -> R {
    R::select(mask, R::splat(1.0), R::splat(0.0))
}

/// The set-up in the arithmetic of `N`, except for the row of a body on the separatrix ([`separatrix_row`]).
#[inline(always)]
pub(crate) fn set_up<R: Real, N: Number<R>>(initial: &Initial<R>) -> Constants<R> {
    let zero = R::splat(0.0);
    let one = R::splat(1.0);
    let n_zero = N::splat(0.0, 0.0);
    let n_one = N::splat(1.0, 0.0);
    let [i1, i2, i3] = initial.moments.map(N::of);
    let [w1, w2, w3] = initial.angular_velocity.map(N::of);

    // Step 1: the regime. D = L² − 2T I₂ as a difference of two squares.
    let clean = |difference: N| {
        let equal = difference.rounded().less_than(R::splat(EQUAL_MOMENTS));
        N::select(equal, n_zero, difference)
    };
    let (i21, i32) = (clean(i2 - i1), clean(i3 - i2));
    let i31 = i21 + i32;
    let third = i3 * i32 * w3.squared();
    let first = i1 * i21 * w1.squared();
    let discriminant = third - first;
    let (oblate, prolate) = (is_zero(i21.rounded()), is_zero(i32.rounded()));
    let sphere = oblate & prolate;
    let about_third = (!discriminant.rounded().less_than(zero) & !prolate) | oblate;
    let pick = |a: N, b: N| N::select(about_third, a, b);
    let (ia, id) = (pick(i1, i3), pick(i3, i1));
    let (wa, wd) = (pick(w1, w3), pick(w3, w1));
    // |I_d − I₂|, |I₂ − I_a|, |I_d − I_a|, so that f = fd/range and g = ga/range.
    let (d2, a2) = (pick(i32, i21), pick(i21, i32));
    let f_part = N::select(sphere, n_one, d2);
    let range = N::select(sphere, n_one, i31);
    let sense = R::select(about_third, one, -one);

    // Step 2: a right-handed frame (a, 2, d) in which the spin about d is not negative.
    let reversed = wd.rounded().less_than(zero);
    let sign_d = R::select(reversed, -one, one);
    let sign_2 = sign_d * sense;
    let wd = wd.abs();
    let w2 = w2.times_power_of_two(sign_2);

    // Step 3: amplitudes, moduli and lambda.
    let f = f_part / range;
    let g = a2 / range;
    let i2_over_ia = i2 / ia;
    let squared_a = wa.squared() + i2_over_ia * f * w2.squared();
    let squared_d = wd.squared() + i2 / id * g * w2.squared();
    let amplitude_a = squared_a.sqrt();
    let amplitude_d = squared_d.sqrt();
    let ratio = (ia / (i2 * f)).sqrt();
    let amplitude_2 = amplitude_a * ratio;
    let square_scale = id * f_part * squared_d;
    let square_scale = N::select(is_zero(square_scale.rounded()), n_one, square_scale);
    let modulus_squared = ia * a2 * squared_a / square_scale;
    let symmetric = is_zero(a2.rounded());
    let circular = symmetric | modulus_squared.rounded().less_than(R::splat(LEAST_MODULUS));
    let modulus_squared = N::select(circular, n_zero, modulus_squared);
    let complement_squared = N::select(circular, n_one, discriminant.abs() / square_scale);
    let steady = is_zero(wa.rounded()) & is_zero(wd.rounded()) & !symmetric;
    let separatrix = (!(R::splat(SEPARATRIX) * (third.rounded() + first.rounded()))
        .less_than(discriminant.rounded().abs())
        | complement_squared.rounded().less_than(R::splat(LEAST_COMPLEMENT)))
        & !circular
        & !steady;
    let lambda = amplitude_d * (d2 * i31 / (ia * i2)).sqrt();
    let momentum_squared = (i1 * w1).squared() + (i2 * w2).squared() + (i3 * w3).squared();
    let momentum = momentum_squared.sqrt();

    // Step 4: periods and the argument at the start.
    let plain = circular | separatrix | steady;
    let complement = N::select(plain, n_one, complement_squared).sqrt();
    let modulus = N::select(plain, n_one, modulus_squared).sqrt();
    let spin_2 = w2.times_power_of_two(sense);
    let far = N::splat(1e100, 0.0);
    let size_2 = spin_2.abs();
    let cotangent = wa.abs() * ratio / N::select(is_zero(size_2.rounded()), n_one, size_2);
    let too_far = is_zero(size_2.rounded()) | far.rounded().less_than(cotangent.rounded());
    let start = landen(complement, N::select(too_far, far, cotangent), false);
    let argument = N::select(is_zero(size_2.rounded()), n_zero, start.argument);
    let argument = N::select(wa.rounded().less_than(zero), N::splat(0.5, 0.0) - argument, argument);
    let argument = N::select(spin_2.rounded().less_than(zero), -argument, argument);
    let polhode_start = N::select(steady, N::splat(0.25, 0.0), argument);

    // Step 5: the moments' angle, and mu by Heuman's lambda function.
    let cotangent = (id * a2 / (ia * f_part)).sqrt();
    let dual = landen(modulus, cotangent, true);
    let sine = (ia * f_part / (i2 * range)).sqrt();
    let bracket = dual.argument.scaled(4.0);
    let bracket = N::select(circular, N::select(symmetric, n_one, n_zero), bracket);
    let zeta = N::select(circular, N::select(symmetric, n_zero, sine), dual.zeta);
    let moving = N::select(separatrix | steady, n_zero, lambda * start.mean);
    let inverse_tau = N::splat(INVERSE_TAU.0, INVERSE_TAU.1);
    let drift = lambda * zeta + moving * bracket;
    let drift = drift.times_power_of_two(sense);
    let drift = N::select(steady, n_zero, drift);
    let precession_rate = (momentum / i2 - drift).scaled(0.5) * inverse_tau;
    let polhode_rate = moving * inverse_tau;

    // Step 6: the shape, in one word.
    let ratio_of_periods = start.mean.rounded() / dual.mean.rounded();
    let transformed = ratio_of_periods.less_than(R::splat(SWITCH)) & !plain;
    let direct = direct_constants(ratio_of_periods, bracket.rounded(), sense, circular, steady);
    let ia_aa = (ia * amplitude_a).rounded();
    let id_ad = (id * amplitude_d).rounded();
    let i2_a2 = (i2 * amplitude_2).rounded();
    let length = (momentum.rounded() + id_ad).max(R::splat(power_of_two(-1000)));
    let unit = Row {
        shape: direct,
        frame: Quaternion::new(zero, zero, zero, one),
        amplitude: Vector::new(zero, zero, zero),
        axes: one,
    };
    let half = direct_shape(&unit, Turns { quadrant: one, residual: zero });
    let length_2 = momentum.rounded() + id_ad * complement.rounded();
    let factor = sense * (i2_a2 / length_2.max(R::splat(power_of_two(-1000)))) * (half.alpha.0 / half.beta.0);
    let factor = R::select(steady, R::select((w2.rounded() * sign_2).less_than(zero), -one, one), factor);
    let mut row = unit;
    for column in BETA_REAL..BETA_IMAGINARY + 3 {
        row.shape[column] = row.shape[column] * factor;
    }
    let nothing = Turns { quadrant: zero, residual: zero };
    let mut at_0 = direct_shape(&row, nothing);
    let mut at_half = direct_shape(&row, Turns { quadrant: one, residual: zero });

    if R::any(transformed) {
        let mut other = unit;
        other.shape = transformed_constants(ratio_of_periods, bracket.rounded(), sense);
        let nome = other.shape[TRANSFORMED_NOME];
        let before = transformed_series(&other, nome, one, nome, one, one);
        other.shape[BETA_FACTOR] = -(ia_aa / length) * (before.alpha.0 / before.beta.1);
        let other_at_0 = transformed_series(&other, nome, one, nome, one, one);
        let other_at_half = transformed_series(&other, nome, nome, one, one, one);
        for column in 0..SHAPE_COLUMNS {
            row.shape[column] = R::select(transformed, other.shape[column], row.shape[column]);
        }
        at_0 = select_shape(transformed, other_at_0, at_0);
        at_half = select_shape(transformed, other_at_half, at_half);
    }
    let norm_0 = norm_squared(&at_0);
    let norm_half = norm_squared(&at_half);
    row.amplitude = Vector::new(
        ia_aa * (norm_0 / at_0.numerators.x),
        sign_2 * sense * i2_a2 * (norm_half / at_half.numerators.y),
        sign_d * id_ad * (norm_0 / at_0.numerators.z),
    );
    // About the middle axis |alpha| = |beta| = 1.
    let steady_2 = (i2 * w2).rounded() * sign_2 * R::splat(2.0);
    row.amplitude.x = R::select(steady, zero, row.amplitude.x);
    row.amplitude.y = R::select(steady, steady_2, row.amplitude.y);
    row.amplitude.z = R::select(steady, zero, row.amplitude.z);
    let code = R::select(about_third | steady, R::splat(CIRCULATES_ABOUT_THIRD), R::splat(CIRCULATES_ABOUT_FIRST))
        + R::select(transformed, R::splat(TRANSFORMED), zero);
    row.axes = R::select(steady, one, code * sign_d);

    // Step 8: the frame in which L is along z, from the row's own value at t = 0.
    row.frame =
        frame_at_start(&row, transformed, start_turns(polhode_start.to_double_double()), zero, initial.orientation);

    Constants {
        row,
        polhode_rate: polhode_rate.to_double_double(),
        precession_rate: precession_rate.to_double_double(),
        polhode_start: polhode_start.to_double_double(),
        separatrix,
        theory: Theory {
            modulus_squared: modulus_squared.rounded(),
            complement_squared: complement_squared.rounded(),
            lambda: lambda.rounded(),
            angular_momentum: momentum.rounded(),
            moments: Vector::new(ia.rounded(), i2.rounded(), id.rounded()),
            amplitudes: Vector::new(amplitude_a.rounded(), amplitude_2.rounded(), amplitude_d.rounded()),
            angular_velocity: Vector::new(wa.rounded(), w2.rounded(), wd.rounded()),
            bracket: bracket.rounded(),
            sense,
            signs: (sign_2, sign_d),
            steady: where_set(steady),
        },
    }
}

/// The frame's quaternion for which the row gives `orientation` at zero precession.
#[inline(always)]
fn frame_at_start<R: Real>(
    row: &Row<R>,
    transformed: R::Mask,
    start: Turns<R>,
    time: R,
    orientation: Quaternion<R>,
) -> Quaternion<R> {
    let zero = R::splat(0.0);
    let nothing = Turns { quadrant: zero, residual: zero };
    let x = from_half_turn(start);
    let extra = R::select(transformed, row.shape[GAIN] * x, zero);
    let shape = shape(row, transformed, start, x, time);
    let (q, _) = in_principal_axes(row, transformed, &shape);
    let unit = q * (R::splat(1.0) / q.norm_squared().sqrt());
    let turned =
        turned_about_z(Quaternion::new(zero, zero, zero, R::splat(1.0)), sin_cos_turns(turned_by(nothing, extra)))
            .product(unit);
    orientation.product(turned.conjugate())
}

/// The start of v as a reduced angle.
#[inline(always)]
pub(crate) fn start_turns<R: Real>(turns: DoubleDouble<R>) -> Turns<R> {
    let quarters = (turns.high * R::splat(4.0)).round();
    let residual = quarters.mul_add(R::splat(-0.25), turns.high) + turns.low;
    let below = quarters.less_than(R::splat(-0.5));
    Turns { quadrant: R::select(below, quarters + R::splat(4.0), quarters), residual }
}

#[inline(always)]
fn norm_squared<R: Real>(shape: &Shape<R>) -> R {
    Quaternion::new(shape.beta.0, shape.beta.1, shape.alpha.1, shape.alpha.0).norm_squared()
}

/// e^x for −700 < x ≤ 0, and e^−700 below.
#[inline(always)]
fn exp_wide<R: Real>(x: R) -> R {
    exp_with_bits(x.max(R::splat(-700.0)), 10)
}

/// 1 − e^x for x ≤ 0, to full relative accuracy also near 0.
#[inline(always)]
fn one_minus_exp<R: Real>(x: R) -> R {
    // Taylor's sum for small x, up to x^9/10!: 2^-53 of the result for |x| <= 1/8.
    let mut sum = R::splat(1.0 / 3_628_800.0);
    for denominator in [362_880.0, 40_320.0, 5040.0, 720.0, 120.0, 24.0, 6.0, 2.0, 1.0_f64] {
        sum = sum.mul_add(x, R::splat(1.0 / denominator));
    }
    let near = R::splat(-0.125).less_than(x);
    R::select(near, -(sum * x), R::splat(1.0) - exp_wide(x))
}

/// The direct series in powers of cos 2v, with alpha scaled to begin with 1 and beta not yet scaled.
#[inline(always)]
fn direct_constants<R: Real>(
    ratio_of_periods: R,
    bracket: R,
    sense: R,
    circular: R::Mask,
    steady: R::Mask,
) -> [R; SHAPE_COLUMNS] {
    use std::f64::consts::{PI, TAU};
    let zero = R::splat(0.0);
    let one = R::splat(1.0);
    // e^(−2b), Q e^(2b) and Q with b = (pi/2) (K'/K) bracket, Q = e^(−2 pi K'/K).
    let twice_b = R::splat(PI) * ratio_of_periods * bracket;
    let e = exp_wide(-twice_b);
    let one_minus_e = one_minus_exp(-twice_b);
    let p = exp_wide(twice_b - R::splat(TAU) * ratio_of_periods);
    let nome = exp_wide(R::splat(-PI) * ratio_of_periods);
    let none = circular | steady;
    let e = R::select(none, zero, e);
    let one_minus_e = R::select(none, one, one_minus_e);
    let p = R::select(none, zero, p);
    let nome = R::select(none, zero, nome);
    let q = p * e;
    let q2 = q * q;
    let q4 = q2 * q2;
    let (qe, p2) = (q * e, p * p);
    let qe2 = qe * qe;
    // (-1)^n (e1 +- e2), e1 = Q^(n^2) e^(2nb), e2 = Q^(n^2) e^(-2nb).
    let (c1, s1) = (-(p + qe), -(p - qe));
    let (c2, s2) = (q2 * (p2 + qe2), q2 * (p2 - qe2));
    let q6 = q4 * q2;
    let (c3, s3) = (-(q6 * p.mul_add(p2, qe * qe2)), -(q6 * p.mul_add(p2, -(qe * qe2))));
    // (-1)^n (f1 +- f2), f1 = Q^(n(n+1)) e^(2nb), f2 = Q^(n(n+1)) e^(-(2n+2)b).
    let (b0, d0) = (one + e, one_minus_e);
    let (f1, f2) = (q * p, q2 * (e * e));
    let (b1, d1) = (-(f1 + f2), -(f1 - f2));
    let (g1, g2) = (q4 * p2, q6 * (e * e * e));
    let (b2, d2) = (g1 + g2, g1 - g2);
    let (two, three, four) = (R::splat(2.0), R::splat(3.0), R::splat(4.0));
    let scale = one / (one - c2);
    let turn = sense * scale;
    let mut shape = [zero; SHAPE_COLUMNS];
    // 1 + C1 cos 2v + C2 cos 4v + C3 cos 6v and the sines over sin 2v.
    shape[ALPHA_REAL] = scale * (c1 - three * c3);
    shape[ALPHA_REAL + 1] = scale * (two * c2);
    shape[ALPHA_REAL + 2] = scale * (four * c3);
    shape[ALPHA_IMAGINARY] = turn * (s1 - s3);
    shape[ALPHA_IMAGINARY + 1] = turn * (two * s2);
    shape[ALPHA_IMAGINARY + 2] = turn * (four * s3);
    // Sines of odd multiples over sin v, cosines over cos v.
    shape[BETA_REAL] = b0 + (b1 - b2);
    shape[BETA_REAL + 1] = two * (b1 + b2);
    shape[BETA_REAL + 2] = four * b2;
    shape[BETA_IMAGINARY] = -(sense * (d0 - (d1 + d2)));
    shape[BETA_IMAGINARY + 1] = -(sense * (two * (d1 - d2)));
    shape[BETA_IMAGINARY + 2] = -(sense * (four * d2));
    shape[NOME] = nome;
    for column in [ALPHA_REAL, ALPHA_IMAGINARY, BETA_REAL + 1, BETA_IMAGINARY + 1] {
        let last = if column <= ALPHA_IMAGINARY { column + 3 } else { column + 2 };
        for coefficient in &mut shape[column..last] {
            *coefficient = R::select(coefficient.abs().less_than(R::splat(VANISHING)), zero, *coefficient);
        }
    }
    shape
}

/// The transformed series, beta not yet scaled.
#[inline(always)]
fn transformed_constants<R: Real>(ratio_of_periods: R, bracket: R, sense: R) -> [R; SHAPE_COLUMNS] {
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};
    let zero = R::splat(0.0);
    let inverse = R::splat(1.0) / ratio_of_periods;
    let nome = exp_wide(R::splat(-FRAC_PI_2) * inverse);
    let (sin, cos) = sin_cos_eighth(R::splat(FRAC_PI_4) * bracket);
    let (sin_2, cos_2) = ((sin + sin) * cos, (cos - sin) * (cos + sin));
    let next = |(s, c): (R, R)| (s.mul_add(cos_2, c * sin_2), c.mul_add(cos_2, -(s * sin_2)));
    let mut shape = [zero; SHAPE_COLUMNS];
    let nome_2 = nome * nome;
    let nome_4 = nome_2 * nome_2;
    let mut angle = (sin, cos);
    for (n, factor) in [R::splat(1.0), nome, nome_4, nome_4 * nome_4 * nome].into_iter().enumerate() {
        let factor = R::select(factor.less_than(R::splat(VANISHING)), zero, factor);
        shape[COSINES + n] = factor * angle.1;
        shape[SINES + n] = -(sense * (factor * angle.0));
        angle = next(angle);
    }
    // y = x/T for x in turns, T = 2 K'/K; the phase s x F(phi_b)/(2 K') is that of x times half the bracket.
    shape[SLOPE] = R::splat(PI) * inverse;
    shape[OFFSET] = zero;
    shape[BETA_FACTOR] = R::splat(1.0);
    shape[GAIN] = R::splat(0.5) * (sense * bracket);
    shape[TRANSFORMED_NOME] = nome;
    shape
}

/// The row of a body on the separatrix, whose argument runs from −∞ to ∞ once: cn → sech, sn → tanh, dn → sech.
///
/// One body at a time, as it is rare. `polhode_start` becomes 0 or half a turn, for the sign of ω_a.
pub(crate) fn separatrix_row(constants: &mut Constants<f64>, orientation: Quaternion<f64>) {
    let theory = &constants.theory;
    let (w_a, w_2, w_d) = (theory.angular_velocity.x, theory.angular_velocity.y, theory.angular_velocity.z);
    let (a_a, a_2, a_d) = (theory.amplitudes.x, theory.amplitudes.y, theory.amplitudes.z);
    let sense = theory.sense;
    let back = w_a < 0.0;
    // cn and dn agree on the separatrix; if rounding has made one of them vanish, the other is used.
    let cn = (w_a.abs() / a_a).max(w_d / a_d);
    let sn = sense * w_2 / a_2 * if back { -1.0 } else { 1.0 };
    let moments = theory.moments;
    let momenta = Vector::new(moments.x * a_a, moments.y * a_2, moments.z * a_d);
    let mut row = constants.row;
    row.shape = [0.0; SHAPE_COLUMNS];
    let (sin, cos) = sin_cos_eighth(std::f64::consts::FRAC_PI_4 * theory.bracket);
    row.shape[COSINES] = cos;
    row.shape[SINES] = -sense * sin;
    row.shape[SLOPE] = 0.5 * theory.lambda;
    row.shape[OFFSET] = 0.5 * (sn / cn).asinh();
    row.shape[BETA_FACTOR] = 1.0;
    let before = transformed_series(&row, 0.0, 1.0, 0.0, 1.0, 1.0);
    row.shape[BETA_FACTOR] = -(momenta.x / (theory.angular_momentum + momenta.z)) * (before.alpha.0 / before.beta.1);
    let at_0 = transformed_series(&row, 0.0, 1.0, 0.0, 1.0, 1.0);
    let at_half = transformed_series(&row, 0.0, 0.0, 0.0, 1.0, 1.0);
    let (norm_0, norm_half) = (norm_squared(&at_0), norm_squared(&at_half));
    row.amplitude = Vector::new(
        momenta.x * (norm_0 / at_0.numerators.x),
        theory.signs.0 * sense * momenta.y * (norm_half / at_half.numerators.y),
        theory.signs.1 * momenta.z * (norm_0 / at_0.numerators.z),
    );
    let code = if sense > 0.0 { CIRCULATES_ABOUT_THIRD } else { CIRCULATES_ABOUT_FIRST };
    row.axes = theory.signs.1 * (code + TRANSFORMED);
    constants.polhode_start = DoubleDouble::from(if back { 0.5 } else { 0.0 });
    row.frame = frame_at_start(&row, true, start_turns(constants.polhode_start), 0.0, orientation);
    constants.row = row;
}
