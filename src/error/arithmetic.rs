//! Faults of an adapter's arithmetic.

/// Why an adapter cannot be used in a precision.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ArithmeticFault {
    /// Sums or products of normal numbers are not correctly rounded.
    Rounding,
    /// The rounding error of a sum comes out wrong in spite of the barrier, so that no state can be carried in two
    /// words.
    TwoSum,
}

impl std::fmt::Display for ArithmeticFault {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(match self {
            ArithmeticFault::Rounding => "its sums or products are not correctly rounded",
            ArithmeticFault::TwoSum => "its compiler re-associates sums, so that their rounding errors are lost",
        })
    }
}
