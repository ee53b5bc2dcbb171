//! Elliptic integrals by the arithmetic-geometric mean.

use crate::kernel::free_motion::number::Number;
use crate::math::real::Real;

/// 1/(2π).
pub(super) const INVERSE_TAU: (f64, f64) = (0.15915494309189535, -9.839338337591243e-18);

/// atan(j/8) for j = 0 to 8, rad, in two words.
const ATAN_EIGHTHS: [(f64, f64); 9] = [
    (0.0, 0.0),
    (0.12435499454676144, -3.1253241424539383e-18),
    (0.24497866312686414, 1.0698755618734451e-17),
    (0.35877067027057225, -2.4623815582638635e-17),
    (0.4636476090008061, 2.2698777452961687e-17),
    (0.5585993153435624, -5.4556305485916264e-18),
    (0.6435011087932844, 1.5834785051444286e-17),
    (0.7188299996216245, -2.1478388444456983e-17),
    (std::f64::consts::FRAC_PI_4, 3.061616997868383e-17),
];

/// (−1)^k/(2k+1) in two words, for the terms of atan t / t that need two, |t| ≤ 1/16.
const ATAN_SERIES: [(f64, f64); 6] = [
    (1.0, 0.0),
    (-0.3333333333333333, -1.850371707708594e-17),
    (0.2, -1.1102230246251566e-17),
    (-0.14285714285714285, -7.93016446160826e-18),
    (0.1111111111111111, 6.1679056923619804e-18),
    (-0.09090909090909091, -2.523234146875356e-18),
];

/// The further terms, whose sum is below 2⁻⁵¹ of the whole; the first one left out is below 2⁻¹⁰⁸.
const ATAN_TAIL: [f64; 7] = [1.0 / 13.0, -1.0 / 15.0, 1.0 / 17.0, -1.0 / 19.0, 1.0 / 21.0, -1.0 / 23.0, 1.0 / 25.0];

/// The angle of the point (x, y) with y > 0 from the x axis, in turns, in (0, 1/2); relative error some 2⁻¹⁰⁰.
///
/// The angle between the nearer axis and the point is reduced by the nearest of atan(j/8), which costs one division
/// (atan a − atan b = atan((a − b)/(1 + ab))), and Gregory's series does the rest.
#[inline(always)]
pub(crate) fn angle_turns<R: Real, N: Number<R>>(y: N, x: N) -> N {
    let size = x.abs();
    let steep = size.rounded().less_than(y.rounded());
    let near = N::select(steep, size, y);
    let far = N::select(steep, y, size);
    let eighths = (R::splat(8.0) * (near.rounded() / far.rounded())).round();
    let tangent = eighths * R::splat(0.125);
    let t = (near - far.times_word(tangent)) / (far + near.times_word(tangent));
    let mut base = N::splat(0.0, 0.0);
    for (j, &(high, low)) in ATAN_EIGHTHS.iter().enumerate().skip(1) {
        let reached = R::splat(j as f64 - 0.5).less_than(eighths);
        base = N::select(reached, N::splat(high, low), base);
    }
    let t2 = t.squared();
    let mut tail = R::splat(ATAN_TAIL[ATAN_TAIL.len() - 1]);
    for &coefficient in ATAN_TAIL.iter().rev().skip(1) {
        tail = tail.mul_add(t2.rounded(), R::splat(coefficient));
    }
    let mut sum = N::from_word(tail);
    for &(high, low) in ATAN_SERIES.iter().rev() {
        sum = sum * t2 + N::splat(high, low);
    }
    let angle = (base + sum * t) * N::splat(INVERSE_TAU.0, INVERSE_TAU.1);
    let from_x_axis = N::select(steep, N::splat(0.25, 0.0) - angle, angle);
    let left = x.rounded().less_than(R::splat(0.0));
    N::select(left, N::splat(0.5, 0.0) - from_x_axis, from_x_axis)
}

/// The results of one descending chain of Landen transformations for the modulus whose complement it starts from.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Landen<N> {
    /// The arithmetic-geometric mean of 1 and the complementary modulus: K = π / (2 · mean).
    pub mean: N,
    /// F(φ)/(4K) of the angle φ in the first quadrant: the argument in turns of the theta functions.
    pub argument: N,
    /// Jacobi's zeta function Z(φ) = E(φ) − (E/K) F(φ).
    pub zeta: N,
}

/// The most steps of a chain from a complementary modulus above 2⁻¹²⁰ until it converges: 7 to bring the ratio below 2, 6 to square 2⁻² to
/// 2⁻¹⁰⁶.
const MOST_STEPS: usize = 16;
/// Cotangents of smaller magnitude are set to this; the argument changes by as much.
const LEAST_COTANGENT: f64 = 1e-100;

/// The chain that starts from complementary modulus `complement` in (0, 1] and the angle φ with cot φ = `cotangent` ≥ 0.
///
/// tan(φ′ − φ) = (b/a) tan φ (J. Landen 1775; M. Abramowitz, I. A. Stegun, *Handbook of Mathematical Functions*, 17.6.8 to 17.6.10) in the
/// form y′ = (y − ab/y)/2 for y = a cot φ, where no tangent overflows; the quadrant of φ is tracked by the sign of y. Z = Σ ½ (a − b) sin
/// φ′. Lanes that have converged do not change, so that a result does not depend on its neighbours.
#[inline(always)]
pub(crate) fn landen<R: Real, N: Number<R>>(complement: N, cotangent: N, with_zeta: bool) -> Landen<N> {
    let zero = R::splat(0.0);
    let least = N::splat(LEAST_COTANGENT, 0.0);
    let (mut a, mut b) = (N::splat(1.0, 0.0), complement);
    let mut y = N::select(cotangent.rounded().less_than(least.rounded()), least, cotangent);
    let mut half_turns = zero;
    let mut weight = R::splat(1.0);
    let mut zeta = N::splat(0.0, 0.0);
    let mut active = zero.less_than(weight);
    for _ in 0..MOST_STEPS {
        let product = a * b;
        let negative = y.rounded().less_than(zero);
        let mean = (a + b).scaled(0.5);
        let half_difference = (a - b).scaled(0.5);
        let next = (y - product / y).scaled(0.5);
        let tiny = next.rounded().abs().less_than(least.rounded());
        let next = N::select(tiny, least, next);
        if with_zeta {
            let sine = mean / (mean.squared() + next.squared()).sqrt();
            let term = half_difference * sine;
            let term = N::select(negative, -term, term);
            zeta = N::select(active, zeta + term, zeta);
        }
        let doubled = half_turns + half_turns + R::select(negative, R::splat(1.0), zero);
        half_turns = R::select(active, doubled, half_turns);
        weight = R::select(active, weight * R::splat(0.5), weight);
        y = N::select(active, next, y);
        let root = product.sqrt();
        // A step that starts from a smaller half difference is the last: it leaves the square of it.
        let more = (mean.rounded() * R::splat(N::SQUARE_NEGLIGIBLE)).less_than(half_difference.rounded());
        a = N::select(active, mean, a);
        b = N::select(active, root, b);
        active = active & more;
        if !R::any(active) {
            break;
        }
    }
    let angle = angle_turns(a, y) + N::from_word(half_turns * R::splat(0.5));
    Landen { mean: a, argument: angle.times_power_of_two(weight), zeta }
}
