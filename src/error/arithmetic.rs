//! Faults of an adapter's arithmetic.

/// Why an adapter cannot be used in a precision.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ArithmeticFault {
    /// Sums or products of normal numbers are not correctly rounded.
    #[error("its sums or products are not correctly rounded")]
    Rounding,
    /// The rounding error of a sum comes out wrong in spite of the barrier, so that no state can be carried in two
    /// words.
    #[error("its compiler re-associates sums, so that their rounding errors are lost")]
    TwoSum,
}
