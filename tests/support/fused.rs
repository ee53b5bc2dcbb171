//! Scalars that fuse `mul_add`, as SIMD lanes do.

use std::ops::{Add, Div, Mul, Neg, Sub};

use polhode::math::real::Real;

macro_rules! fused {
    ($name:ident, $scalar:ident) => {
        /// The scalar with one rounding in `mul_add`.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct $name(pub $scalar);

        fused!(operators $name: Add add +, Sub sub -, Mul mul *, Div div /);

        impl Neg for $name {
            type Output = Self;
            fn neg(self) -> Self {
                Self(-self.0)
            }
        }

        impl Real for $name {
            type Scalar = $scalar;
            type Mask = bool;
            const LANES: usize = 1;

            fn splat(x: f64) -> Self {
                Self(<$scalar>::splat(x))
            }
            fn from_lanes(mut lane: impl FnMut(usize) -> $scalar) -> Self {
                Self(lane(0))
            }
            fn load(column: &[$scalar]) -> Self {
                Self(column[0])
            }
            fn store(self, column: &mut [$scalar]) {
                column[0] = self.0;
            }
            fn mul_add(self, factor: Self, addend: Self) -> Self {
                Self(<$scalar>::mul_add(self.0, factor.0, addend.0))
            }
            fn sqrt(self) -> Self {
                Self(<$scalar>::sqrt(self.0))
            }
            fn abs(self) -> Self {
                Self(<$scalar>::abs(self.0))
            }
            fn min(self, other: Self) -> Self {
                Self(Real::min(self.0, other.0))
            }
            fn max(self, other: Self) -> Self {
                Self(Real::max(self.0, other.0))
            }
            fn less_than(self, other: Self) -> bool {
                self.0 < other.0
            }
            fn select(mask: bool, if_true: Self, if_false: Self) -> Self {
                if mask { if_true } else { if_false }
            }
            fn any(mask: bool) -> bool {
                mask
            }
            fn two_product(self, other: Self) -> (Self, Self) {
                let (product, rest) = self.0.two_product(other.0);
                (Self(product), Self(rest))
            }
            fn outlined<O>(work: impl FnOnce() -> O) -> O {
                work()
            }
        }
    };
    (operators $name:ident: $($operator:ident $method:ident $sign:tt),*) => {
        $(impl $operator for $name {
            type Output = Self;
            fn $method(self, other: Self) -> Self {
                Self(self.0 $sign other.0)
            }
        })*
    };
}

fused!(FusedF32, f32);
fused!(FusedF64, f64);
