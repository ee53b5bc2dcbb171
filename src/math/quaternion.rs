//! Unit quaternions that rotate body (or principal) coordinates to world.

use std::ops::{Add, Mul, Sub};

use crate::math::operators;
use crate::math::real::{Real, sin_cos};
use crate::math::vector::{TwoWords, Vector};

/// The quaternion x i + y j + z k + w (Hamilton's product, scalar part last as in `glam`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quaternion<R> {
    /// Coefficient of i.
    pub x: R,
    /// Coefficient of j.
    pub y: R,
    /// Coefficient of k.
    pub z: R,
    /// Scalar part.
    pub w: R,
}

impl<R: Real> Quaternion<R> {
    /// The quaternion of four components.
    #[inline(always)]
    pub fn new(x: R, y: R, z: R, w: R) -> Self {
        Self { x, y, z, w }
    }

    /// The sum of the squares of the components.
    #[inline(always)]
    pub fn norm_squared(self) -> R {
        self.w.mul_add(self.w, self.z.mul_add(self.z, self.y.mul_add(self.y, self.x * self.x)))
    }

    /// Hamilton's product `self other`: the rotation `other`, then the rotation `self`.
    #[inline(always)]
    pub fn product(self, other: Self) -> Self {
        let (a, b) = (self, other);
        Self::new(
            a.w.mul_add(b.x, a.x.mul_add(b.w, a.y.mul_add(b.z, -(a.z * b.y)))),
            a.w.mul_add(b.y, a.y.mul_add(b.w, a.z.mul_add(b.x, -(a.x * b.z)))),
            a.w.mul_add(b.z, a.z.mul_add(b.w, a.x.mul_add(b.y, -(a.y * b.x)))),
            a.w.mul_add(b.w, -(a.x.mul_add(b.x, a.y.mul_add(b.y, a.z * b.z)))),
        )
    }

    /// Hamilton's product `self (v, 0)` by a pure vector.
    #[inline(always)]
    pub fn product_vector(self, v: Vector<R>) -> Self {
        Self::new(
            self.w.mul_add(v.x, self.y.mul_add(v.z, -(self.z * v.y))),
            self.w.mul_add(v.y, self.z.mul_add(v.x, -(self.x * v.z))),
            self.w.mul_add(v.z, self.x.mul_add(v.y, -(self.y * v.x))),
            -(self.x.mul_add(v.x, self.y.mul_add(v.y, self.z * v.z))),
        )
    }

    /// The inverse rotation, for a unit quaternion.
    #[inline(always)]
    pub fn conjugate(self) -> Self {
        Self::new(-self.x, -self.y, -self.z, self.w)
    }

    /// Vector part.
    #[inline(always)]
    pub fn vector(self) -> Vector<R> {
        Vector::new(self.x, self.y, self.z)
    }

    /// Body (or principal) coordinates to world: v + 2w (u × v) + 2 u × (u × v), u the vector part.
    #[inline(always)]
    pub fn rotate(self, v: Vector<R>) -> Vector<R> {
        let u = self.vector();
        let twice_cross = u.cross(v) * R::splat(2.0);
        v + twice_cross * self.w + u.cross(twice_cross)
    }

    /// World coordinates to body (or principal).
    #[inline(always)]
    pub fn rotate_inverse(self, v: Vector<R>) -> Vector<R> {
        self.conjugate().rotate(v)
    }

    /// Lane by lane, `if_true` where the mask is set and `if_false` elsewhere.
    #[inline(always)]
    pub fn select(mask: R::Mask, if_true: Self, if_false: Self) -> Self {
        Self::new(
            R::select(mask, if_true.x, if_false.x),
            R::select(mask, if_true.y, if_false.y),
            R::select(mask, if_true.z, if_false.z),
            R::select(mask, if_true.w, if_false.w),
        )
    }

    /// `self * factor + addend`, component by component.
    #[inline(always)]
    pub fn axpy(self, factor: R, addend: Self) -> Self {
        Self::new(
            self.x.mul_add(factor, addend.x),
            self.y.mul_add(factor, addend.y),
            self.z.mul_add(factor, addend.z),
            self.w.mul_add(factor, addend.w),
        )
    }
}

operators! { [R: Real] Quaternion<R>:
    Add::add(self, other: Self) = Self::new(self.x + other.x, self.y + other.y, self.z + other.z, self.w + other.w);
    Sub::sub(self, other: Self) = Self::new(self.x - other.x, self.y - other.y, self.z - other.z, self.w - other.w);
    Mul::mul(self, factor: R) = Self::new(self.x * factor, self.y * factor, self.z * factor, self.w * factor);
}

/// The increment that brings a quaternion near the unit sphere back onto it: ½ (1 − |q|²) q.
///
/// One step of Newton's iteration for q/|q|, in the form that is added to a compensated state; the error left is
/// ⅜ (1 − |q|²)².
#[inline(always)]
pub fn norm_correction<R: Real>(q: Quaternion<R>) -> Quaternion<R> {
    norm_correction_of_step(q, q)
}

/// The correction of a step from q to `next`, as q is not quite a unit quaternion: ½ (1 − |q|²) `next`.
///
/// To first order the step is then that from q/|q|, as rates are proportional to q. A correction along q itself, from which `next` has
/// turned away by an angle of ½θ, would turn the attitude back by ½ (1 − |q|²) sin ½θ: ten times the error of a Runge-Kutta method in long
/// steps.
#[inline(always)]
pub fn norm_correction_of_step<R: Real>(q: Quaternion<R>, next: Quaternion<R>) -> Quaternion<R> {
    next * (R::splat(0.5) * (R::splat(1.0) - q.norm_squared()))
}

/// The quaternion of the rotation vector θ (an angle times an axis) less 1: (sin ½θ · axis, cos ½θ − 1).
///
/// Formed from the sine of a quarter of the angle alone, so that the small number cos ½θ − 1 keeps its digits. The
/// range is that of [`sin_cos`] for |θ|/4.
#[inline(always)]
pub fn exponential_less_one<R: Real>(rotation_vector: Vector<R>) -> Quaternion<R> {
    // If the angle vanishes, sin ½θ / θ is formed at a tiny angle instead, and is ½.
    let angle = rotation_vector.dot(rotation_vector).max(R::splat(1e-36)).sqrt();
    let (sin, cos) = sin_cos(angle * R::splat(0.25));
    let v = rotation_vector * (R::splat(2.0) * sin * cos / angle);
    Quaternion::new(v.x, v.y, v.z, R::splat(-2.0) * sin * sin)
}

/// q/|q| in one word, as in programs that do not compensate.
#[inline(always)]
pub fn plainly_normalised<R: Real>(q: Quaternion<R>) -> TwoWords<Quaternion<R>> {
    let zero = R::splat(0.0);
    let value = q * (R::splat(1.0) / q.norm_squared().sqrt());
    TwoWords { value, residue: Quaternion::new(zero, zero, zero, zero) }
}
