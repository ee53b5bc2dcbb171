//! Projection of a torque-free body's state onto what it conserves, after each step. Twin: `shaders/method/projection.wgsl`.
//!
//! With g₁ = 1/I₃ − 1/I₂ and cyclic (the coefficients of Euler's equations, dm₁/dt = g₁ m₂ m₃), a free body keeps
//!
//! ```text
//! c₁₂ = g₂ m₁² − g₁ m₂²,   c₂₃ = g₂ m₃² − g₃ m₂²,   c₁₃ = g₃ m₁² − g₁ m₃²
//! ```
//!
//! (eliminate dt from two of the equations). As I₁ ≤ I₂ ≤ I₃, g₁, g₃ ≤ 0 ≤ g₂: the first two are sums of squares; the third,
//! whose sign says on which side of the separatrix the body is, is small compared with its terms near the separatrix. Energy and |m|² are
//! combinations of these, but near the separatrix they determine the small c₁₃ only to their own rounding, and a stepper's phase is
//! lost. After each step one component of m is kept and the other two follow from the c of the start, by the pair of formulas in
//! which nothing cancels: if m₂ is the larger part of c₁₂, the kept component is m₁ or m₃, whichever c₁₃ can be added to; otherwise m₂.
//!
//! Method: projection (E. Hairer, C. Lubich, G. Wanner, *Geometric Numerical Integration*, 2nd ed. (2006), section IV.4); the choice of
//! these combinations follows from the project's own measurements. The order of the method is kept; the attitude is not changed.
//! In `f64` only: the combinations are formed on the host in double-double and rounded once ([`crate::engine::projected`]).

use crate::kernel::rigid_body::{Body, State};
use crate::math::double_double::DoubleDouble;
use crate::math::real::Real;
use crate::math::vector::{TwoWords, Vector};

/// What a free body conserves: −c₁₃ is negative where 2T I₂ > L².
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Combinations<R> {
    /// g₂ m₁² − g₁ m₂², not negative.
    pub first_second: R,
    /// g₂ m₃² − g₃ m₂², not negative.
    pub second_third: R,
    /// g₃ m₁² − g₁ m₃².
    pub first_third: R,
}

/// The combinations of a body with these inverse moments (descending) and angular momentum in principal axes.
pub fn combinations(inverse_moments: [f64; 3], m: [f64; 3]) -> Combinations<f64> {
    let word = DoubleDouble::from;
    let difference = |a: usize, b: usize| word(inverse_moments[a]) - word(inverse_moments[b]);
    let g = [difference(2, 1), difference(0, 2), difference(1, 0)];
    let squared = m.map(|m| DoubleDouble::product_of(m, m));
    let of = |a: usize, b: usize, i: usize, j: usize| (g[a] * squared[i] - g[b] * squared[j]).to_f64();
    Combinations { first_second: of(1, 0, 0, 1), second_third: of(1, 2, 2, 1), first_third: of(2, 0, 0, 2) }
}

/// The state with its angular momentum projected; components whose formula has no divisor (equal moments) stay as they are.
#[inline(always)]
pub fn projected<R: Real>(body: &Body<R>, kept: &Combinations<R>, state: State<R>) -> State<R> {
    let zero = R::splat(0.0);
    let (p, q, r) = (-body.gyroscopic.value.x, body.gyroscopic.value.y, -body.gyroscopic.value.z);
    let m = state.angular_momentum_principal.value;
    let (x2, y2, z2) = (m.x.squared(), m.y.squared(), m.z.squared());
    let (first_second, second_third, first_third) = (kept.first_second, kept.second_third, kept.first_third);

    let spins_about_middle = (R::splat(0.5) * first_second).less_than(p * y2);
    let keeps_third = first_third.less_than(zero);
    let keeps_first = spins_about_middle & !keeps_third;
    let keeps_third = spins_about_middle & keeps_third;

    let x_of_z = root(m.x, p * z2 - first_third, r);
    let x_of_y = root(m.x, first_second - p * y2, q);
    let y_of_x = root(m.y, first_second - q * x2, p);
    let y_of_z = root(m.y, second_third - q * z2, r);
    let z_of_x = root(m.z, first_third + r * x2, p);
    let z_of_y = root(m.z, second_third - r * y2, q);
    let choose = |of_first: R, of_third: R, of_second: R| {
        R::select(keeps_first, of_first, R::select(keeps_third, of_third, of_second))
    };
    let value = Vector::new(choose(m.x, x_of_z, x_of_y), choose(y_of_x, y_of_z, m.y), choose(z_of_x, m.z, z_of_y));
    let residue = state.angular_momentum_principal.residue;
    State { angular_momentum_principal: TwoWords { value, residue }, ..state }
}

/// ±√(numerator/divisor) with the sign of `old`; `old` if the divisor is zero.
#[inline(always)]
fn root<R: Real>(old: R, numerator: R, divisor: R) -> R {
    let zero = R::splat(0.0);
    let usable = zero.less_than(divisor);
    let size = (numerator.max(zero) / R::select(usable, divisor, R::splat(1.0))).sqrt();
    R::select(usable, R::select(old.less_than(zero), -size, size), old)
}
