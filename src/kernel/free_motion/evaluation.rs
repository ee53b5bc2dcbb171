//! The closed form of a torque-free body at a time, from its row of constants.
//!
//! Twin: `shaders/free_motion.wgsl`. [`crate::kernel::free_motion`] has the formulas and their sources.

use crate::math::elementary::{Turns, exp_negative, sin_cos_turns, turned_by};
use crate::math::quaternion::Quaternion;
use crate::math::real::{Real, Scalar};
use crate::math::vector::Vector;

/// Columns of the table of constants.
pub const ROW_COLUMNS: usize = 21;
/// Columns that the two series interpret differently.
pub(crate) const SHAPE_COLUMNS: usize = 13;

// Row.shape where the series in the nome converge fast (the direct series).
pub(crate) const ALPHA_REAL: usize = 0;
pub(crate) const ALPHA_IMAGINARY: usize = 3;
pub(crate) const BETA_REAL: usize = 6;
pub(crate) const BETA_IMAGINARY: usize = 9;
pub(crate) const NOME: usize = 12;
// Row.shape near the separatrix (the transformed series).
pub(crate) const COSINES: usize = 0;
pub(crate) const SINES: usize = 4;
pub(crate) const BETA_FACTOR: usize = 8;
pub(crate) const SLOPE: usize = 9;
pub(crate) const OFFSET: usize = 10;
pub(crate) const GAIN: usize = 11;
pub(crate) const TRANSFORMED_NOME: usize = 12;

/// Code in [`Row::axes`]: the axis of circulation is the third principal axis.
pub(crate) const CIRCULATES_ABOUT_THIRD: f64 = 1.0;
/// Code in [`Row::axes`]: the axis of circulation is the first principal axis.
pub(crate) const CIRCULATES_ABOUT_FIRST: f64 = 2.0;
/// Added to the code if the transformed series is used.
pub(crate) const TRANSFORMED: f64 = 4.0;

/// The constants of a body's torque-free motion, apart from its phases.
///
/// Axes are (a, 2, d): d the axis about which the motion circulates (the third or the first principal axis), a the
/// other extreme axis, 2 the middle one.
#[derive(Clone, Copy, Debug)]
pub struct Row<R> {
    /// Constants of the series; their meaning depends on which series is used.
    pub shape: [R; SHAPE_COLUMNS],
    /// Left factor of the orientation: rotates the frame in which the angular momentum is along z to the world.
    pub frame: Quaternion<R>,
    /// Factors of the components a, 2, d of the angular momentum.
    pub amplitude: Vector<R>,
    /// ±1 or ±2: circulation about the third or the first principal axis, negative if the spin about it is; plus ±4 if the transformed
    /// series is used.
    pub axes: R,
}

/// The time at which a row is evaluated.
#[derive(Clone, Copy, Debug)]
pub struct Instant<R> {
    /// v, the argument of the theta functions.
    pub polhode: Turns<R>,
    /// μ t, half the mean angle of the rotation about the angular momentum.
    pub precession: Turns<R>,
    /// The time in units of 2^−r s, for the separatrix, whose motion has no period.
    pub time: R,
}

/// The state that a row gives at a time.
#[derive(Clone, Copy, Debug)]
pub struct FreeState<R> {
    /// Principal axes to world.
    pub orientation: Quaternion<R>,
    /// m = I ω, in units of the body's own scale.
    pub angular_momentum_principal: Vector<R>,
}

/// α, β and the numerators of the theta quotients, all up to one common factor.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shape<R> {
    pub alpha: (R, R),
    pub beta: (R, R),
    pub numerators: Vector<R>,
}

impl<R: Real> Row<R> {
    /// Whether the transformed series is used.
    #[inline(always)]
    fn is_transformed(&self) -> R::Mask {
        R::splat(0.5 * (TRANSFORMED + CIRCULATES_ABOUT_FIRST)).less_than(self.axes.abs())
    }
}

/// The state at `instant`.
#[inline(always)]
pub fn evaluate<R: Real>(row: &Row<R>, instant: &Instant<R>) -> FreeState<R> {
    let transformed = row.is_transformed();
    let x = from_half_turn(instant.polhode);
    let extra = R::select(transformed, row.shape[GAIN] * x, R::splat(0.0));
    let shape = shape(row, transformed, instant.polhode, x, instant.time);
    let precession = sin_cos_turns(turned_by(instant.precession, extra));
    let (orientation, norm_squared) = in_principal_axes(row, transformed, &shape);
    let quotients = row.amplitude.scaled_by(shape.numerators) * (R::splat(1.0) / norm_squared);
    let about_first = circulates_about_first(row, transformed);
    // Twice that if the change of axes has doubled it.
    let length_squared = R::select(about_first, norm_squared + norm_squared, norm_squared);
    let unit = orientation * (R::splat(1.0) / length_squared.sqrt());
    FreeState {
        orientation: turned_about_z(row.frame, precession).product(unit),
        angular_momentum_principal: Vector::new(
            R::select(about_first, quotients.z, quotients.x),
            quotients.y,
            R::select(about_first, quotients.x, quotients.z),
        ),
    }
}

#[inline(always)]
fn circulates_about_first<R: Real>(row: &Row<R>, transformed: R::Mask) -> R::Mask {
    let code = row.axes.abs() - R::select(transformed, R::splat(TRANSFORMED), R::splat(0.0));
    R::splat(0.5 * (CIRCULATES_ABOUT_THIRD + CIRCULATES_ABOUT_FIRST)).less_than(code)
}

/// The quaternion (α, β), not normalised, from principal axes, and |α|² + |β|².
///
/// The change from principal axes to (a, 2, d) is a product by 1, i, i + k or i (i + k) from the right.
#[inline(always)]
pub(crate) fn in_principal_axes<R: Real>(row: &Row<R>, transformed: R::Mask, shape: &Shape<R>) -> (Quaternion<R>, R) {
    let q = Quaternion::new(shape.beta.0, shape.beta.1, shape.alpha.1, shape.alpha.0);
    let norm_squared = q.norm_squared();
    let reversed = row.axes.less_than(R::splat(0.0));
    let q = Quaternion::select(reversed, Quaternion::new(q.w, q.z, -q.y, -q.x), q);
    let about_first = circulates_about_first(row, transformed);
    let swapped = Quaternion::new(q.w + q.y, q.z - q.x, q.w - q.y, -(q.x + q.z));
    (Quaternion::select(about_first, swapped, q), norm_squared)
}

/// q (cos + k sin): `q` after a rotation about z.
#[inline(always)]
pub(crate) fn turned_about_z<R: Real>(q: Quaternion<R>, (sin, cos): (R, R)) -> Quaternion<R> {
    Quaternion::new(
        q.x.mul_add(cos, q.y * sin),
        q.y.mul_add(cos, -(q.x * sin)),
        q.z.mul_add(cos, q.w * sin),
        q.w.mul_add(cos, -(q.z * sin)),
    )
}

/// The distance of the angle from the nearest half turn, in turns, in [−1/4, 1/4].
#[inline(always)]
pub(crate) fn from_half_turn<R: Real>(angle: Turns<R>) -> R {
    let behind = angle.residual.less_than(R::splat(0.0));
    let quarter = R::select(behind, R::splat(0.25), R::splat(-0.25));
    R::select(is_odd_quadrant(angle), angle.residual + quarter, angle.residual)
}

#[inline(always)]
fn is_odd_quadrant<R: Real>(angle: Turns<R>) -> R::Mask {
    let distance = (angle.quadrant - R::splat(2.0)).abs();
    R::splat(0.5).less_than(distance) & distance.less_than(R::splat(1.5))
}

/// −1 if the nearest half turn is an odd one, otherwise 1.
#[inline(always)]
fn half_turn_sign<R: Real>(angle: Turns<R>) -> R {
    let behind = angle.residual.less_than(R::splat(0.0));
    let distance = (angle.quadrant - R::splat(2.0)).abs();
    let second = distance.less_than(R::splat(0.5));
    let first = angle.quadrant.less_than(R::splat(1.5)) & !behind;
    let third = R::splat(2.5).less_than(angle.quadrant) & behind;
    let odd = second | (is_odd_quadrant(angle) & (first | third));
    R::select(odd, R::splat(-1.0), R::splat(1.0))
}

#[inline(always)]
pub(crate) fn select_shape<R: Real>(mask: R::Mask, a: Shape<R>, b: Shape<R>) -> Shape<R> {
    let pick = |a: R, b: R| R::select(mask, a, b);
    Shape {
        alpha: (pick(a.alpha.0, b.alpha.0), pick(a.alpha.1, b.alpha.1)),
        beta: (pick(a.beta.0, b.beta.0), pick(a.beta.1, b.beta.1)),
        numerators: Vector::new(
            pick(a.numerators.x, b.numerators.x),
            pick(a.numerators.y, b.numerators.y),
            pick(a.numerators.z, b.numerators.z),
        ),
    }
}

/// Evaluates both series and selects, for each lane, the one of its row.
#[inline(always)]
pub(crate) fn shape<R: Real>(row: &Row<R>, transformed: R::Mask, v: Turns<R>, x: R, time: R) -> Shape<R> {
    let direct = direct_shape(row, v);
    if !R::any(transformed) {
        return direct;
    }
    let other = transformed_shape(row, transformed, x, half_turn_sign(v), time);
    select_shape(transformed, other, direct)
}

/// The theta series in powers of cos 2v.
#[inline(always)]
pub(crate) fn direct_shape<R: Real>(row: &Row<R>, v: Turns<R>) -> Shape<R> {
    let s = &row.shape;
    let (sin, cos) = sin_cos_turns(v);
    let c = (cos - sin) * (cos + sin);
    let sin_2v = (sin + sin) * cos;
    let one = R::splat(1.0);
    let quadratic = |first: usize| s[first + 2].mul_add(c, s[first + 1]).mul_add(c, s[first]);
    let alpha = (quadratic(ALPHA_REAL).mul_add(c, one), quadratic(ALPHA_IMAGINARY) * sin_2v);
    let beta = (quadratic(BETA_REAL) * sin, quadratic(BETA_IMAGINARY) * cos);
    let numerators = direct_numerators(s[NOME], c);
    Shape { alpha, beta, numerators: Vector::new(numerators.x * cos, numerators.y * sin, numerators.z) }
}

/// θ₂(v)/(2 q^¼ cos v), θ₁(v)/(2 q^¼ sin v) and θ₃(v) of nome q, where c = cos 2v.
///
/// Σ q^(n²+n) cos (2n+1)v / cos v up to n = 3, the same with alternating signs at c → −c, and 1 + 2 Σ q^(n²) cos 2nv
/// up to n = 4.
#[inline(always)]
pub(crate) fn direct_numerators<R: Real>(q: R, c: R) -> Vector<R> {
    let (one, two) = (R::splat(1.0), R::splat(2.0));
    let q2 = q * q;
    let h = unless_fourth_power_vanishes(q);
    let h2 = h * h;
    let h4 = h2 * h2;
    let q6 = h4 * h2;
    let q12 = q6 * q6;
    // Even and odd parts in c of 1 + q² (2c − 1) + q⁶ (4c² − 2c − 1) + q¹² (8c³ − 4c² − 4c + 1).
    let c2 = c * c;
    let four_c2 = R::splat(4.0) * c2;
    let even = (one - four_c2).mul_add(q12, (four_c2 - one).mul_add(q6, one - q2));
    let odd = (two * c) * (two * (c2 + c2) - two).mul_add(q12, q2 - q6);
    // c + q³ (2c² − 1) + q⁸ (4c³ − 3c) + q¹⁵ (8c⁴ − 8c² + 1).
    let cos_4v = (c2 + c2) - one;
    let cos_6v = (c + c).mul_add(cos_4v, -c);
    let cos_8v = (c + c).mul_add(cos_6v, -cos_4v);
    let q3 = h2 * h;
    let sum = (q12 * q3).mul_add(cos_8v, (h4 * h4).mul_add(cos_6v, q3.mul_add(cos_4v, c)));
    Vector::new(even + odd, even - odd, (q + q).mul_add(sum, one))
}

/// `x`, or 0 if x⁴ vanishes next to 1, so that no power of it is a subnormal number, which processors multiply a hundred times slower.
#[inline(always)]
fn unless_fourth_power_vanishes<R: Real>(x: R) -> R {
    R::select(x.less_than(R::splat(R::Scalar::FOURTH_POWER_NEGLIGIBLE)), R::splat(0.0), x)
}

/// The series after Jacobi's imaginary transformation, in powers of e^(±2y), with e^y taken out.
#[inline(always)]
pub(crate) fn transformed_shape<R: Real>(
    row: &Row<R>,
    transformed: R::Mask,
    x: R,
    half_turn_sign: R,
    time: R,
) -> Shape<R> {
    let s = &row.shape;
    let zero = R::splat(0.0);
    let nome = R::select(transformed, s[TRANSFORMED_NOME], zero);
    let periodic = zero.less_than(nome);
    let y = s[SLOPE].mul_add(R::select(periodic, x, time), s[OFFSET]);
    let backward = y.less_than(zero);
    let decay = exp_negative(R::splat(-2.0) * y.abs());
    let growth = nome / decay;
    let direction = R::select(backward, R::splat(-1.0), R::splat(1.0));
    transformed_series(row, nome, decay, growth, direction, half_turn_sign)
}

/// As [`transformed_shape`] from F = e^(−2|y|), D = Q′ e^(2|y|) and the sign of y.
#[inline(always)]
pub(crate) fn transformed_series<R: Real>(
    row: &Row<R>,
    nome: R,
    decay: R,
    growth: R,
    direction: R,
    half_turn_sign: R,
) -> Shape<R> {
    let s = &row.shape;
    let one = R::splat(1.0);
    let negligible = R::splat(R::Scalar::NEGLIGIBLE);
    let unless_negligible = |x: R| R::select(x.less_than(negligible), R::splat(0.0), x);
    let growth = unless_negligible(growth);
    let small = unless_negligible(nome * decay);
    let (d2, g2) = (growth * growth, small * small);
    let even = |first: usize, square: R| s[first + 2].mul_add(square, s[first]);
    let odd = |first: usize, base: R, square: R| base * s[first + 3].mul_add(square, s[first + 1]);
    let (cos_d, cos_d_odd) = (even(COSINES, d2), odd(COSINES, growth, d2));
    let (sin_d, sin_d_odd) = (even(SINES, d2), odd(SINES, growth, d2));
    let (cos_g, cos_g_odd) = (even(COSINES, g2), odd(COSINES, small, g2));
    let (sin_g, sin_g_odd) = (even(SINES, g2), odd(SINES, small, g2));
    let alpha = (
        decay.mul_add(cos_g + cos_g_odd, cos_d + cos_d_odd),
        direction * decay.mul_add(-(sin_g + sin_g_odd), sin_d + sin_d_odd),
    );
    let factor = s[BETA_FACTOR] * half_turn_sign;
    let beta = (
        factor * (direction * decay.mul_add(cos_g_odd - cos_g, cos_d - cos_d_odd)),
        factor * decay.mul_add(sin_g - sin_g_odd, sin_d - sin_d_odd),
    );
    // theta_4, theta_1 and theta_3 of the imaginary argument 2iy and nome Q'^2, times F.
    let n2 = nome * nome;
    let h = unless_fourth_power_vanishes(nome);
    let h2 = h * h;
    let n4 = h2 * h2;
    let n12 = (n4 * n4) * n4;
    let high = unless_fourth_power_vanishes(growth);
    let low = unless_fourth_power_vanishes(small);
    let (high2, low2) = (high * high, low * low);
    let (d4, g4) = (high2 * high2, low2 * low2);
    let second = n4 * (d4 + g4);
    // The contribution of the third term to G is below 2^-67 of the whole.
    let rest = (n12 * d4).mul_add(high2, d2 + g2);
    let decay2 = decay * decay;
    let sinh = (n4 * n4).mul_add((-decay2).mul_add(g4, d4), n2.mul_add(decay2.mul_add(g2, -d2), one - decay2));
    Shape {
        alpha,
        beta,
        numerators: Vector::new(
            half_turn_sign * decay * ((one + second) - rest),
            half_turn_sign * direction * sinh,
            decay * ((one + second) + rest),
        ),
    }
}
