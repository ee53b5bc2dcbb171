//! `taylor`: Taylor series of the motion, with an order that follows from the tolerance and steps in time adapted to each body.
//!
//! All coefficients of (q, m) up to an order K are formed from the equations of motion themselves
//! (`src/expression/jet`), whatever torques act: q(t + h) = Σ q_k hᵏ, and m likewise. Adaptive steps only, in `f64`, on the CPU.
//!
//! ```text
//! K = ⌈−½ ln tol + 1⌉ + 3, at most 30
//! 1/h = max((‖x_K‖/tol)^(1/K), (‖x_{K−1}‖/tol)^(1/(K−1))) exp(0.7/(K − 1))
//! ```
//!
//! (À. Jorba, M. Zou, *A software package for the numerical integration of ODEs by means of high-order Taylor methods*, Experimental
//! Mathematics 14 (2005) 99, equations 11 and 13 and section 3.2.) The norm is the largest component, of m relative to |m|, so that the
//! tolerance means what it does for adaptive `rk8`: the error of a step. No step is refused.
//!
//! # Where no torque depends on the attitude
//!
//! Then m' = f(m, t) is a system of three, and q' = ½ q ω is linear with a known polynomial ω(t). Let q(t + τ) = q(t) u(τ; t), u₀ = 1,
//! u_{k+1} = ½ Σ_j u_j ω_{k−j} / (k + 1). With β₀ = 1, β_k = β_{k−1} (N − k + 1)/(2N − k + 1) and
//! S(h; t) = Σ_{k=0}^{N} β_k hᵏ u_k(t),
//!
//! ```text
//! q(t₁) S(−h; t₁) = q(t₀) S(h; t₀)
//! ```
//!
//! up to ((N!)²/((2N)! (2N + 1)!)) h^{2N+1} q^{(2N+1)}: order 2N from N coefficients at either end (the two-point formula of C. Hermite and
//! N. Obreshkov; E. Hairer, S. P. Nørsett, G. Wanner, *Solving Ordinary Differential Equations I*, 2nd ed. (1993), section II.13, equation
//! 13.13). The series at t₁ serve the next step as well. N = ⌊(K − 1)/2⌋, and h is the lesser of the step above, for m, and of that which
//! keeps this error at the tolerance. The derivative of order 2N + 1 is bounded by that of v with v' = ½ |ω| v, whose coefficients follow
//! from the norms of ω's (a majorant: Moore, chapter 11): u_N alone says nothing about a body that is spun up within the step. If a step
//! ends where a discriminant changes its sign or vanishes, there is no later series: those at t₁ are then the polynomials ω(t) of the step
//! itself, expanded there.
//!
//! # Where torques depend on directions alone
//!
//! If a torque reads vectors of the world in body axes, d = Rᵀ v, and nothing else of the attitude (a heavy top, a gravity gradient, a
//! dipole in a field), m and these vectors form a closed system: d' = d × ω, and for a vector that turns uniformly in the world a pair that
//! obeys u' = u × ω + n w, w' = w × ω − n u. The attitude follows as above. Each interval between outputs starts from the d of its own
//! attitude. This is used where it is less work ([`crate::torque`], `motion.rs`).
//!
//! # Where torques depend on the body's position
//!
//! Position and velocity of the centre of mass are states too, x' = v, v' = F/M, if a torque reads one of them and the forces leave them no
//! closed form. The norm of x is relative to the greatest of |x_j| hʲ, j = 0 … 3, so that it needs no scale and no origin: with each j the
//! step is (tol |x_j|/‖x_K‖)^(1/(K − j)), and the longest of these is taken; likewise for v. Both are summed in two words.
//!
//! # Many outputs
//!
//! If outputs are closer together than steps, as by the rates of all bodies, steps do not end at them: the series of (q, m) of a body's last
//! step is kept and evaluated at each output up to its end (dense output). The attitude is then a state of the series, as a one-sided series
//! is needed in between. Plans whose tolerance was found with steps that end at outputs keep to that. Torques that change at certain times, sampled ones and formulas with breaks, end steps as before.
//!
//! # Differences from the source
//!
//! The order is three above that of Jorba and Zou, as linear work costs an order only once. Tolerances are relative. If a discriminant
//! (which of two numbers is the lesser, or a truth value) may change its sign within a step, by the sum of its terms' magnitudes, the step is no
//! longer than that over which its own series keeps the tolerance, relative to the greatest of |x_j| hʲ, j = 0 … 2, as above, and ends where the
//! sign first changes: that is sought in four parts of the step and at the extrema between them, so that a sign that changes and changes back
//! does not go unnoticed. A step that ends so may be shorter than the limit, but of two in a row the second is not; a body of which a
//! thousand steps in a row end so, none longer than some thousand times the limit, is flagged. A square root of 0 that does not stay 0
//! has no series: the step from there is short. A power or exponential that has faded to e⁻⁶⁰ shows nothing of what comes: a step ends where it
//! passes that, or e⁶⁰, as at a discriminant, and in between h is no longer than what keeps its own series to a hundredth of itself, so that no
//! step passes a pulse of it. A body that would need a step below the limit for its tolerance, or whose coefficients
//! are not finite, is flagged ([`crate::bodies::Status::StepBelowLimit`]) and left unchanged.
//!
//! It conserves nothing exactly; the drift of energy and angular momentum is that of the error. The quaternion's norm is restored as in `rk8`.

use std::f64::consts::LN_2;

use crate::math::clock::MOST_LANES;
use crate::math::lanes::Each;
use crate::math::quaternion::Quaternion;
use crate::math::real::{Real, Scalar};
use crate::math::vector::Vector;

/// The highest order.
pub(crate) const MOST_ORDER: usize = crate::expression::jet::MOST_ORDER;

/// The least tolerance: a thousandth of the least that a study may ask for.
pub(crate) const LEAST_OF_SERIES: f64 = 2e-18;

/// The number of orders added to that of the source.
const ORDERS_ABOVE: usize = 3;

pub(crate) use crate::expression::jet::OVERFLOWING;

/// The order for a tolerance.
pub(crate) fn order_of(tolerance: f64) -> usize {
    let least = (1.0 - 0.5 * tolerance.ln()).ceil().max(2.0) as usize;
    (least + ORDERS_ABOVE).min(MOST_ORDER)
}

/// N, the order of the series by which the attitude follows from ω: with one more its error would be far below that of m.
pub(crate) fn half_order_of(order: usize) -> usize {
    (order - 1) / 2
}

/// The length of steps at an order and a tolerance. Logarithms are to the base 2, and rough: a step may be wrong by a part in 500.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct StepLength {
    /// 1/K and 1/(K − 1).
    roots: [f64; 2],
    /// Constants added to the logarithms of the two norms.
    shifts: [f64; 2],
    safety: f64,
}

impl StepLength {
    pub fn new(order: usize, tolerance: f64) -> Self {
        let order = order as f64;
        Self {
            roots: [order.recip(), (order - 1.0).recip()],
            shifts: [-tolerance.log2(); 2],
            safety: 0.7 * std::f64::consts::LOG2_E / (order - 1.0),
        }
    }

    /// log₂ 1/h from the finite norms of the coefficients of the order and of the one below.
    #[inline(always)]
    pub fn inverse_logarithm<R: Real>(&self, last: R, last_but_one: R) -> R {
        let first = (rough_logarithm(last) + R::splat(self.shifts[0])) * R::splat(self.roots[0]);
        let second = (rough_logarithm(last_but_one) + R::splat(self.shifts[1])) * R::splat(self.roots[1]);
        first.max(second) + R::splat(self.safety)
    }

    /// The same from the norms relative to a size, which may be 0: then no step is short enough, unless both are 0 too.
    #[inline(always)]
    pub fn relative<R: Real>(&self, size: R, last: R, last_but_one: R) -> R {
        let inverse = R::splat(1.0) / size.max(R::splat(1e-290));
        self.inverse_logarithm(last * inverse, last_but_one * inverse)
    }
}

/// 2⁵², from which on the bits of a number are those of an integer.
const WHOLE: f64 = 4503599627370496.0;

/// log₂ x of each lane to 0.01; −1023 for zero. Bits are handled as integers as wide as a lane, so that loops over lanes become vector
/// code.
#[inline(always)]
fn rough_logarithm<R: Real>(x: R) -> R {
    let mut lanes = [R::Scalar::default(); MOST_LANES];
    x.store(&mut lanes);
    for lane in &mut lanes[..R::LANES] {
        let bits = lane.to_f64().to_bits();
        let exponent = f64::from_bits(((bits >> 52) & 0x7ff) | WHOLE.to_bits()) - (WHOLE + 1023.0);
        let mantissa = f64::from_bits((bits & ((1 << 52) - 1)) | (1023 << 52));
        // The parabola through log₂ at 1 and 2 with the least error in between.
        let logarithm = mantissa.mul_add(mantissa.mul_add(-1.0 / 3.0, 2.0), -5.0 / 3.0);
        *lane = R::Scalar::from_f64(exponent + logarithm);
    }
    R::load(&lanes)
}

/// A step from log₂ 1/h, to a part in 500.
#[inline(always)]
pub(crate) fn step_of<R: Real>(inverse_logarithm: R) -> R {
    // The range in whose bits the whole part can be read.
    let within = inverse_logarithm.max(R::splat(-900.0)).min(R::splat(900.0));
    let mut lanes = [R::Scalar::default(); MOST_LANES];
    within.store(&mut lanes);
    for lane in &mut lanes[..R::LANES] {
        let logarithm = 1000.0 - lane.to_f64();
        let shifted = logarithm + WHOLE;
        let part = logarithm - (shifted - WHOLE);
        let power = f64::from_bits((shifted.to_bits() + 23) << 52);
        // e^(ln 2 · part) for a part of −½ to ½.
        *lane = R::Scalar::from_f64(power * part.mul_add(part.mul_add(part.mul_add(0.0555, 0.2402), LN_2), 1.0));
    }
    R::load(&lanes)
}

/// The most coefficients of [`TwoSided`].
pub(crate) const MOST_HALF_ORDER: usize = MOST_ORDER.div_ceil(2);

/// ½/(k + 1).
const HALVES: [f64; 2 * MOST_HALF_ORDER + 1] = {
    let mut halves = [0.5; 2 * MOST_HALF_ORDER + 1];
    let mut k = 1;
    while k < halves.len() {
        halves[k] = 0.5 / (k + 1) as f64;
        k += 1;
    }
    halves
};

/// The two-sided formula for the attitude.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TwoSided {
    /// N.
    pub half_order: usize,
    weights: [f64; MOST_HALF_ORDER + 1],
    /// The step length from the coefficients of order 2N + 1 and 2N of a majorant of u.
    pub length: StepLength,
}

impl TwoSided {
    pub fn new(half_order: usize, tolerance: f64) -> Self {
        let n = half_order as f64;
        let mut weights = [1.0; MOST_HALF_ORDER + 1];
        for k in 1..=half_order {
            let below = k as f64 - 1.0;
            weights[k] = weights[k - 1] * (n - below) / (2.0 * n - below);
        }
        let whole = 2 * half_order + 1;
        let factorial = |n: usize| (1..=n).map(|k| (k as f64).log2()).sum::<f64>();
        let constant = 2.0 * factorial(half_order) - factorial(2 * half_order) - tolerance.log2();
        let length = StepLength {
            roots: [(whole as f64).recip(), (whole as f64 - 1.0).recip()],
            // The terms of an exponential grow by some 2/(2N + 1) from one to the next if the step is as long as allowed.
            shifts: [constant, constant - (0.5 * whole as f64).log2()],
            safety: 0.0,
        };
        Self { half_order, weights, length }
    }

    /// The coefficients of order 2N + 1 and 2N of v with v' = ½ |ω| v, v₀ = 1, which bound those of u, from the norms of ω's first
    /// 2N + 1 coefficients. `v` has room for one more. Computed two coefficients at a time, as they read the same numbers.
    #[inline(always)]
    pub fn majorant<R: Real, const G: usize>(norms: &[Each<R, G>], v: &mut [Each<R, G>]) -> [Each<R, G>; 2] {
        v[0] = Each([R::splat(1.0); G]);
        let n = norms.len();
        let mut k = 0;
        while k + 1 < n {
            let (mut sum, mut next_sum) = (Each::<R, G>::zero(), Each::<R, G>::zero());
            let (known, norms) = (&v[..k + 1], &norms[..k + 2]);
            let mut ahead = norms[k + 1];
            for j in 0..k + 1 {
                let (v, norm) = (known[j], norms[k - j]);
                for g in 0..G {
                    sum[g] = v[g].mul_add(norm[g], sum[g]);
                    next_sum[g] = v[g].mul_add(ahead[g], next_sum[g]);
                }
                ahead = norm;
            }
            let halves = (R::splat(HALVES[k]), R::splat(HALVES[k + 1]));
            for g in 0..G {
                let own = sum[g] * halves.0;
                v[k + 1][g] = own;
                v[k + 2][g] = own.mul_add(norms[0][g], next_sum[g]) * halves.1;
            }
            k += 2;
        }
        if k < n {
            let mut sum = Each::<R, G>::zero();
            let (known, norms) = (&v[..k + 1], &norms[..k + 1]);
            for j in 0..k + 1 {
                for g in 0..G {
                    sum[g] = known[j][g].mul_add(norms[k - j][g], sum[g]);
                }
            }
            for g in 0..G {
                v[k + 1][g] = sum[g] * R::splat(HALVES[k]);
            }
        }
        [v[n], v[n.saturating_sub(1)]]
    }

    /// S(h; t) and S(−h'; t) of the series u at t.
    #[inline(always)]
    pub fn sums<R: Real, const G: usize>(
        &self,
        u: &[Each<Quaternion<R>, G>],
        forwards: &Each<R, G>,
        backwards: &Each<R, G>,
    ) -> [Each<Quaternion<R>, G>; 2] {
        let zero = R::splat(0.0);
        let mut sums = [Each([Quaternion::new(zero, zero, zero, zero); G]); 2];
        for (u, weight) in u.iter().zip(&self.weights).rev() {
            let weight = R::splat(*weight);
            for g in 0..G {
                let term = u[g] * weight;
                sums[0][g] = sums[0][g].axpy(forwards[g], term);
                sums[1][g] = sums[1][g].axpy(-backwards[g], term);
            }
        }
        sums
    }
}

/// Forms the series of u with u' = ½ u ω, u₀ = 1, from the coefficients of ω, one fewer than those of u.
#[inline(always)]
pub(crate) fn form_relative_attitude<R: Real, const G: usize>(
    omega: [&[Each<R, G>]; 3],
    u: &mut [Each<Quaternion<R>, G>],
) {
    let (zero, one) = (R::splat(0.0), R::splat(1.0));
    u[0] = Each([Quaternion::new(zero, zero, zero, one); G]);
    for k in 0..u.len() - 1 {
        let [x, y, z] = [&omega[0][..k + 1], &omega[1][..k + 1], &omega[2][..k + 1]];
        let (known, later) = u.split_at_mut(k + 1);
        // u₀ = 1.
        let mut sums = Each([known[0][0]; G]);
        for g in 0..G {
            sums[g] = Quaternion::new(x[k][g], y[k][g], z[k][g], zero);
        }
        for j in 1..k + 1 {
            for g in 0..G {
                let omega = Vector::new(x[k - j][g], y[k - j][g], z[k - j][g]);
                sums[g] = added_product(sums[g], known[j][g], omega);
            }
        }
        for g in 0..G {
            later[0][g] = sums[g] * R::splat(HALVES[k]);
        }
    }
}

/// `sum` plus Hamilton's product q (v, 0).
#[inline(always)]
fn added_product<R: Real>(sum: Quaternion<R>, q: Quaternion<R>, v: Vector<R>) -> Quaternion<R> {
    Quaternion::new(
        q.w.mul_add(v.x, q.y.mul_add(v.z, (-q.z).mul_add(v.y, sum.x))),
        q.w.mul_add(v.y, q.z.mul_add(v.x, (-q.x).mul_add(v.z, sum.y))),
        q.w.mul_add(v.z, q.x.mul_add(v.y, (-q.y).mul_add(v.x, sum.z))),
        (-q.x).mul_add(v.x, (-q.y).mul_add(v.y, (-q.z).mul_add(v.z, sum.w))),
    )
}
