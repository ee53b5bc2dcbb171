//! Torque-free motion in closed form: the state at any time, at a cost that does not depend on it.
//!
//! [`FreeMotion`] is the motion of one body; [`FreeMotionRows`] that of many, as a table of constants that the CPU's lanes and the GPU's
//! threads evaluate alike. If a state is wanted at one time only, the constants are not kept (`formed.rs`).
//!
//! # Formulas
//!
//! Let I_a, I_2, I_d be the principal moments, 2 the middle axis, d the extreme axis about which the motion circulates
//! and a the other one; s = +1 where I_d is the greatest and −1 where it is the least. The regime follows from
//! L² − 2 T I₂ = I₃ (I₃ − I₂) ω₃² − I₁ (I₂ − I₁) ω₁², which is positive around the third axis, negative around the first
//! and zero on the separatrix. With f = (I_d − I_2)/(I_d − I_a) and g = (I_2 − I_a)/(I_d − I_a), both in [0, 1],
//!
//! ```text
//! ω_a = A_a cn u   ω_2 = s A_2 sn u   ω_d = A_d dn u          u = λ t + u₀
//! A_a² = ω_a² + (I_2/I_a) f ω_2²      A_d² = ω_d² + (I_2/I_d) g ω_2²      A_2² = A_a² I_a/(I_2 f)
//! λ = A_d √((I_d − I_2)(I_d − I_a)/(I_a I_2))
//! k² = I_a (I_2 − I_a) A_a² / (I_d (I_d − I_2) A_d²)     k′² = |L² − 2 T I₂| / (I_d |I_d − I_2| A_d²)
//! ```
//!
//! (Euler's equations in Jacobi's functions: C. G. J. Jacobi, *Gesammelte Werke* 2 (1882) 289; E. T. Whittaker,
//! *Analytical Dynamics*, section 69.) k′² is formed from the difference, never as 1 − k², or all digits are lost near the
//! separatrix.
//!
//! In a frame whose z axis is the angular momentum the orientation is a quotient of theta functions, here as the
//! quaternion (w, x, y, z) with α = w + iz and β = x + iy (F. Klein, A. Sommerfeld, *Theorie des Kreisels* (1897–1910),
//! chapter VI). One phase rate μ serves both components, and one argument v = π u/(2K):
//!
//! ```text
//! α = e^(iμt) θ₄(v − i s b; Q)      β = B e^(iμt) θ₁(v − i s b; Q)      Q = e^(−2πK′/K),   ν = dv/dt = πλ/(2K)
//! |α|² + |β|² = const · θ₄(v; q),   q = √Q
//! L_a ∝ cos v Σ q^(n²+n) cos (2n+1)v / cos v …, that is θ₂(v; q)/θ₄(v; q), L_2 ∝ θ₁/θ₄, L_d ∝ θ₃/θ₄
//! ```
//!
//! so that normalisation removes every denominator and the components of the angular momentum keep their relative
//! accuracy also in bodies like thin rods, where ω_a = L_a/I_a would magnify an absolute error. The imaginary shift b = ½ π F(φ_b, k′)/K
//! depends on the moments alone through sin² φ_b = I_a (I_d − I_2)/(I_2 (I_d − I_a)).
//!
//! The rate is found without any series. From the logarithmic derivative of θ₄ at the imaginary argument, Jacobi's imaginary
//! transformation and one descending Landen step, the algebraic terms collapse to L/I_2 and
//!
//! ```text
//! 2μ = L/I_2 − s [λ Z(φ_b, k′) + ν F(φ_b, k′)/K′]
//! ```
//!
//! with Jacobi's zeta function Z = E(φ) − (E/K) F(φ). F/K′, Z and K′ come from one chain of arithmetic-geometric means,
//! K and u₀ from a second (M. Abramowitz, I. A. Stegun, *Handbook*, 17.6). The mean rate of precession about the angular
//! momentum is 2μ + sν. At the separatrix, 2μ = L/I_2 exactly.
//!
//! For K′/K < 0.6 (q > 0.15) the functions are evaluated after Jacobi's imaginary transformation, with T = 2K′/K,
//! Q′ = e^(−π/T), v = mπ + x, y = x/T:
//!
//! ```text
//! α = e^(iμt + i s x F/(2K′)) Σ Q′^(n²+n) [cos c_n cosh(2n+1)y − i s sin c_n sinh(2n+1)y]
//! β = B (−1)^m e^(…) Σ (−1)^n Q′^(n²+n) [cos c_n sinh(2n+1)y − i s sin c_n cosh(2n+1)y],    c_n = (2n+1) π F/(4K′)
//! ```
//!
//! Four terms of either form are enough on its side. On the separatrix Q′ = 0 and y = (λt + u₀)/2: the same formulas
//! give sech and tanh. Symmetric bodies have k = Q = 0, and the formulas are plain trigonometry; nothing in them is
//! singular as two moments approach each other.
//!
//! # Accuracy
//!
//! The set-up is in double-double arithmetic ([`SetUp::TwoWords`]) and phases are integers of a turn ([`crate::math::phase`]), so the error does
//! not grow with time. Against the golden data (`tests/truth/golden_free_motion.rs`), which reach 1000 s, and 1e9 s for generic bodies, the
//! attitude error is at most 2e-15 rad in `f64` and 9e-7 rad in `f32`.
//!
//! The motion itself may magnify errors of its *input*: on the separatrix by e^(λt). The set-up resolves
//! L² − 2TI₂ to 2⁻⁹⁸ of its two terms, and moments to 2⁻⁹⁶ of the middle one; smaller differences count as zero. A spin whose distance from
//! the middle axis is below 1e-35 of it is taken to be on the separatrix, and so has one flip, before or after, rather than many.

mod elliptic;
pub(crate) mod evaluation;
mod formed;
mod frame;
mod number;
mod precession;
mod rows;
mod setup;
mod solution;

pub use evaluation::ROW_COLUMNS;
pub(crate) use formed::{FORMED_BODIES, Formed, FormedBlock};
pub(crate) use frame::{Aligned, scaled_body};
pub(crate) use precession::{PrecessionBlock, Rotations};
pub use rows::{AnyRows, FreeMotionRows, WORD_COLUMNS};
pub use setup::SetUp;
pub use solution::{FreeMotion, Polhode};
