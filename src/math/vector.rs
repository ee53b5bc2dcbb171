//! Vectors of three numbers, and values carried in two words.

use std::ops::{Add, Mul, Neg, Sub};

use crate::math::operators;
use crate::math::real::{Real, Scalar};

/// A vector of three components; the frame is in the name of the variable that holds it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vector<R> {
    /// First component.
    pub x: R,
    /// Second component.
    pub y: R,
    /// Third component.
    pub z: R,
}

impl<R: Real> Vector<R> {
    /// The vector of three components.
    #[inline(always)]
    pub fn new(x: R, y: R, z: R) -> Self {
        Self { x, y, z }
    }

    /// The null vector.
    #[inline(always)]
    pub fn zero() -> Self {
        let zero = R::splat(0.0);
        Self::new(zero, zero, zero)
    }

    /// a · b.
    #[inline(always)]
    pub fn dot(self, other: Self) -> R {
        self.z.mul_add(other.z, self.y.mul_add(other.y, self.x * other.x))
    }

    /// a · b with products not fused with sums, so that lanes and scalars give the same bits.
    #[inline(always)]
    pub(crate) fn plain_dot(self, other: Self) -> R {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    /// a × b.
    #[inline(always)]
    pub fn cross(self, other: Self) -> Self {
        Self::new(
            self.y.mul_add(other.z, -(self.z * other.y)),
            self.z.mul_add(other.x, -(self.x * other.z)),
            self.x.mul_add(other.y, -(self.y * other.x)),
        )
    }

    /// Component by component product.
    #[inline(always)]
    pub fn scaled_by(self, other: Self) -> Self {
        Self::new(self.x * other.x, self.y * other.y, self.z * other.z)
    }

    /// Component by component `self * factor + addend`.
    #[inline(always)]
    pub fn mul_add(self, factor: Self, addend: Self) -> Self {
        Self::new(
            self.x.mul_add(factor.x, addend.x),
            self.y.mul_add(factor.y, addend.y),
            self.z.mul_add(factor.z, addend.z),
        )
    }

    /// `self * factor + addend` with one factor for all components.
    #[inline(always)]
    pub fn axpy(self, factor: R, addend: Self) -> Self {
        self.mul_add(Self::new(factor, factor, factor), addend)
    }

    /// The largest magnitude of a component.
    #[inline(always)]
    pub fn largest(self) -> R {
        self.x.abs().max(self.y.abs()).max(self.z.abs())
    }

    /// Lane by lane, `if_true` where the mask is set and `if_false` elsewhere.
    #[inline(always)]
    pub fn select(mask: R::Mask, if_true: Self, if_false: Self) -> Self {
        Self::new(
            R::select(mask, if_true.x, if_false.x),
            R::select(mask, if_true.y, if_false.y),
            R::select(mask, if_true.z, if_false.z),
        )
    }
}

operators! { [R: Real] Vector<R>:
    Add::add(self, other: Self) = Self::new(self.x + other.x, self.y + other.y, self.z + other.z);
    Sub::sub(self, other: Self) = Self::new(self.x - other.x, self.y - other.y, self.z - other.z);
    Neg::neg(self) = Self::new(-self.x, -self.y, -self.z);
    Mul::mul(self, factor: R) = Self::new(self.x * factor, self.y * factor, self.z * factor);
}

/// A quantity in two words, `value + residue`, where the residue is below half an ulp of the value.
///
/// In `f64` the residue is zero and not stored: one word is enough there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwoWords<V> {
    /// The nearest number to the quantity.
    pub value: V,
    /// The remainder.
    pub residue: V,
}

/// a − b and its rounding error, exactly (D. E. Knuth, TAOCP vol. 2, section 4.2.2, theorem B).
#[inline(always)]
pub fn two_difference<R: Real>(a: R, b: R) -> (R, R) {
    let difference = a - b;
    let b_taken = a - difference;
    let a_taken = difference + b_taken;
    (difference, (a - a_taken) - (b - b_taken))
}

/// Adds `increment` to a sum carried in two words (W. Kahan, "Further remarks on reducing truncation errors",
/// Comm. ACM 8 (1965) 40).
///
/// The rounding error of the value is kept in the residue and added with the next increment. In `f64` this is the plain sum.
#[inline(always)]
pub fn accumulate<R: Real, V>(sum: TwoWords<V>, increment: V) -> TwoWords<V>
where
    V: Copy + Add<Output = V> + Sub<Output = V>,
{
    if R::Scalar::WORDS == 1 {
        return TwoWords { value: sum.value + increment, residue: sum.residue };
    }
    let corrected = increment + sum.residue;
    let value = sum.value + corrected;
    let taken = value - sum.value;
    TwoWords { value, residue: corrected - taken }
}

impl<R: Real> TwoWords<Vector<R>> {
    /// A vector in one word, as in programs that do not compensate.
    #[inline(always)]
    pub fn plain(value: Vector<R>) -> Self {
        Self { value, residue: Vector::zero() }
    }
}

impl<T: Scalar> TwoWords<T> {
    /// The number times `factor`, word by word.
    #[inline(always)]
    pub(crate) fn times<R: Real<Scalar = T>>(self, factor: R) -> TwoWords<R> {
        TwoWords { value: R::splat(self.value.to_f64()) * factor, residue: R::splat(self.residue.to_f64()) * factor }
    }
}

/// Converts a number in two words of `f64` to two words of an element type.
pub(crate) fn two_words_of<T: Scalar>(value: f64, residue: f64) -> TwoWords<T> {
    let first = T::from_f64(value);
    TwoWords { value: first, residue: T::from_f64((value - first.to_f64()) + residue) }
}

/// A number, such as a step size, in the two words of an element type.
pub(crate) fn two_words<T: Scalar>(dt: f64) -> TwoWords<T> {
    let (value, residue) = T::two_words(dt);
    TwoWords { value, residue }
}
