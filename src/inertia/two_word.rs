//! Arithmetic on numbers in two words, as far as the refinement of principal axes needs it.

use std::ops::{Add, Mul, Neg, Sub};

/// The number `high + low`, with |low| at most half an ulp of high: about 106 bits.
///
/// Sum, product, quotient and root after Y. Hida, X. S. Li, D. H. Bailey, "Algorithms for quad-double precision
/// floating point arithmetic", ARITH-15 (2001); relative errors below 2⁻¹⁰².
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TwoWord {
    pub high: f64,
    pub low: f64,
}

impl TwoWord {
    pub const ZERO: Self = Self { high: 0.0, low: 0.0 };
    pub const ONE: Self = Self { high: 1.0, low: 0.0 };

    pub fn abs(self) -> Self {
        if self.high < 0.0 { -self } else { self }
    }

    /// The product by a power of two, exact.
    pub fn times_power_of_two(self, factor: f64) -> Self {
        Self { high: self.high * factor, low: self.low * factor }
    }

    pub fn divided_by(self, divisor: Self) -> Self {
        let first = self.high / divisor.high;
        let rest = self - divisor * Self::from(first);
        let second = rest.high / divisor.high;
        let rest = rest - divisor * Self::from(second);
        let (high, low) = quick_two_sum(first, second);
        Self { high, low } + Self::from(rest.high / divisor.high)
    }

    pub fn square_root(self) -> Self {
        if self.high <= 0.0 {
            return Self::ZERO;
        }
        // A. H. Karp, P. Markstein, ACM Trans. Math. Softw. 23 (1997) 561.
        let first = self.high.sqrt();
        let rest = self - Self::from(first) * Self::from(first);
        let (high, low) = quick_two_sum(first, rest.high / (2.0 * first));
        Self { high, low }
    }
}

impl From<f64> for TwoWord {
    fn from(high: f64) -> Self {
        Self { high, low: 0.0 }
    }
}

impl Neg for TwoWord {
    type Output = Self;
    fn neg(self) -> Self {
        Self { high: -self.high, low: -self.low }
    }
}

impl Add for TwoWord {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        let (sum, error) = two_sum(self.high, other.high);
        let (low_sum, low_error) = two_sum(self.low, other.low);
        let (sum, error) = quick_two_sum(sum, error + low_sum);
        let (high, low) = quick_two_sum(sum, error + low_error);
        Self { high, low }
    }
}

impl Sub for TwoWord {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for TwoWord {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let product = self.high * other.high;
        let error = self.high.mul_add(other.high, -product);
        let (high, low) = quick_two_sum(product, error + (self.high * other.low + self.low * other.high));
        Self { high, low }
    }
}

/// a + b and its rounding error (D. E. Knuth, TAOCP vol. 2, section 4.2.2, theorem B).
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let b_taken = sum - a;
    (sum, (a - (sum - b_taken)) + (b - b_taken))
}

/// a + b and its rounding error for |a| ≥ |b| (T. J. Dekker, Numer. Math. 18 (1971) 224).
fn quick_two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    (sum, b - (sum - a))
}
