//! Euler's equations of a rigid body in its principal axes.
//!
//! # Equations
//!
//! The state is the orientation q (principal axes to world) and the angular momentum m = I ω in principal axes:
//!
//! ```text
//! dm/dt = m × ω + τ            (Euler 1752; equivalently I dω/dt = τ − ω × I ω)
//! dq/dt = ½ q ω                (Hamilton's product, ω as a pure vector)
//! ```
//!
//! "A Complete Derivation of the Newton-Euler Equations", from which this project starts, has a slip of sign in its
//! equation (9): without torque, dω/dt = −I⁻¹ (ω × I ω). The sign here is the correct one, and
//! `tests/truth/conservation.rs` pins it: with the other sign the angular momentum in the world turns.
//!
//! Component by component, (m × ω)₁ = m₂ m₃ (1/I₃ − 1/I₂) and cyclic. The three differences are formed once, in two
//! words, so that nearly equal moments cost no accuracy.

use crate::math::quaternion::Quaternion;
use crate::math::real::{Real, Scalar};
use crate::math::vector::{TwoWords, Vector, accumulate, two_difference};

/// What stays constant while a body is integrated.
#[derive(Clone, Copy, Debug)]
#[doc(hidden)]
pub struct Body<R> {
    /// 1/I₁, 1/I₂, 1/I₃ in units of the body's own scale.
    pub inverse_moments: TwoWords<Vector<R>>,
    /// 1/I₃ − 1/I₂, 1/I₁ − 1/I₃, 1/I₂ − 1/I₁: the coefficients of the gyroscopic term.
    pub gyroscopic: TwoWords<Vector<R>>,
}

/// The state that is integrated.
#[derive(Clone, Copy, Debug)]
#[doc(hidden)]
pub struct State<R> {
    /// Principal axes to world.
    pub orientation: TwoWords<Quaternion<R>>,
    /// m = I ω, in units of the body's own scale.
    pub angular_momentum_principal: TwoWords<Vector<R>>,
    /// The number of a [`crate::bodies::Status`]: 0 until a step fails on this body, then that of the first failure.
    pub status: R,
}

impl<R: Real> State<R> {
    /// The state with these increments added to q and m.
    #[inline(always)]
    pub(crate) fn advanced(self, q_increment: Quaternion<R>, m_increment: Vector<R>) -> Self {
        Self {
            orientation: accumulate::<R, _>(self.orientation, q_increment),
            angular_momentum_principal: accumulate::<R, _>(self.angular_momentum_principal, m_increment),
            status: self.status,
        }
    }

    /// Lane by lane, `if_true` where the mask is set and `if_false` elsewhere.
    #[inline(always)]
    pub fn select(mask: R::Mask, if_true: Self, if_false: Self) -> Self {
        let (a, b) = (if_true, if_false);
        Self {
            orientation: TwoWords {
                value: Quaternion::select(mask, a.orientation.value, b.orientation.value),
                residue: Quaternion::select(mask, a.orientation.residue, b.orientation.residue),
            },
            angular_momentum_principal: TwoWords {
                value: Vector::select(mask, a.angular_momentum_principal.value, b.angular_momentum_principal.value),
                residue: Vector::select(
                    mask,
                    a.angular_momentum_principal.residue,
                    b.angular_momentum_principal.residue,
                ),
            },
            status: R::select(mask, a.status, b.status),
        }
    }
}

/// What a torque-free body conserves, from its initial state, in units of the body's own scale.
///
/// Formed once on the host rather than in each dispatch, so that the result does not depend on where a run is cut.
#[derive(Clone, Copy, Debug)]
#[doc(hidden)]
pub struct Invariants<R> {
    /// |m|².
    pub angular_momentum_squared: R,
    /// ½ m · ω.
    pub kinetic_energy: R,
}

/// The contribution of the second words of parameters and state to the rates, formed once per step.
///
/// Without it, a rounded 1/I alone costs 3e-8 of the angle; formed at every stage it would cost a third more work. As the corrections
/// change by a factor 1 + O(ω dt) within a step, their error is O(ω dt) · 3e-8 and not systematic.
#[derive(Clone, Copy, Debug)]
#[doc(hidden)]
pub struct Correction<R> {
    angular_velocity: Vector<R>,
    gyroscopic_term: Vector<R>,
}

impl<R: Real> Correction<R> {
    /// The correction where one word is carried: zero.
    #[inline(always)]
    pub(crate) fn none() -> Self {
        Self { angular_velocity: Vector::zero(), gyroscopic_term: Vector::zero() }
    }
}

impl<R: Real> Body<R> {
    /// The constants of a body from its inverse moments.
    #[inline(always)]
    pub fn new(inverse_moments: TwoWords<Vector<R>>) -> Self {
        let (a, b) = (inverse_moments.value, inverse_moments.residue);
        let (x, x_residue) = two_difference(a.z, a.y);
        let (y, y_residue) = two_difference(a.x, a.z);
        let (z, z_residue) = two_difference(a.y, a.x);
        let residue = if R::Scalar::WORDS == 1 {
            Vector::zero()
        } else {
            Vector::new(x_residue + (b.z - b.y), y_residue + (b.x - b.z), z_residue + (b.y - b.x))
        };
        Self { inverse_moments, gyroscopic: TwoWords { value: Vector::new(x, y, z), residue } }
    }

    /// The second words' part of the rates at `state`.
    #[inline(always)]
    pub fn correction(&self, state: &State<R>) -> Correction<R> {
        if R::Scalar::WORDS == 1 {
            return Correction::none();
        }
        let m = state.angular_momentum_principal;
        Correction {
            angular_velocity: self
                .inverse_moments
                .value
                .mul_add(m.residue, self.inverse_moments.residue.scaled_by(m.value)),
            gyroscopic_term: self.gyroscopic.residue.scaled_by(pair_products(m.value)),
        }
    }

    /// The correction for `self`, a body whose 1/I is `ratio` times that of `start`, from the correction for `start` at about the
    /// same angular momentum m. It includes the residue of m.
    #[inline(always)]
    pub fn carried_correction(
        &self,
        start: &Body<R>,
        correction: &Correction<R>,
        ratio: Vector<R>,
        m: Vector<R>,
    ) -> Correction<R> {
        if R::Scalar::WORDS == 1 {
            return *correction;
        }
        let of_m = correction.angular_velocity - start.inverse_moments.residue.scaled_by(m);
        Correction {
            angular_velocity: ratio.mul_add(of_m, self.inverse_moments.residue.scaled_by(m)),
            gyroscopic_term: self.gyroscopic.residue.scaled_by(pair_products(m)),
        }
    }

    /// ω = I⁻¹ m.
    #[inline(always)]
    pub fn angular_velocity(&self, m: Vector<R>, correction: &Correction<R>) -> Vector<R> {
        self.inverse_moments.value.mul_add(m, correction.angular_velocity)
    }

    /// m × ω, with the products of the components of m formed before the differences of 1/I enter.
    #[inline(always)]
    pub fn gyroscopic_term(&self, m: Vector<R>, correction: &Correction<R>) -> Vector<R> {
        self.gyroscopic.value.mul_add(pair_products(m), correction.gyroscopic_term)
    }

    /// ½ m · ω.
    #[inline(always)]
    pub fn kinetic_energy(&self, m: Vector<R>) -> R {
        R::splat(0.5) * m.dot(self.inverse_moments.value.scaled_by(m))
    }
}

/// (m₂ m₃, m₃ m₁, m₁ m₂).
#[inline(always)]
fn pair_products<R: Real>(m: Vector<R>) -> Vector<R> {
    Vector::new(m.y * m.z, m.z * m.x, m.x * m.y)
}

/// dq/dt = ½ q ω.
#[inline(always)]
#[doc(hidden)]
pub fn orientation_rate<R: Real>(q: Quaternion<R>, angular_velocity: Vector<R>) -> Quaternion<R> {
    q.product_vector(angular_velocity * R::splat(0.5))
}

/// L = R m, the angular momentum in world axes.
#[inline(always)]
#[doc(hidden)]
pub fn angular_momentum_world<R: Real>(q: Quaternion<R>, m: Vector<R>) -> Vector<R> {
    q.rotate(m)
}
