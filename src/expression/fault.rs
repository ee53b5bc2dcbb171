//! Errors in formulas.

use super::graph::MOST_NODES;

/// An error in a formula, from whatever source.
///
/// For a formula read from text the position is known as well ([`super::TextError`]).
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Fault {
    /// More than [`MOST_NODES`] different operations.
    #[error("the formula has more than {MOST_NODES} different operations")]
    TooManyNodes,
    /// The parameters have more numbers than [`super::MOST_PARAMETERS`].
    #[error("the parameters have more than {} numbers", super::MOST_PARAMETERS)]
    TooManyParameters,
    /// Operations on constants give infinity or NaN.
    #[error("this constant is not a finite number")]
    NotFinite,
    /// Division by a constant that is zero.
    #[error("division by zero")]
    DivisionByZero,
    /// An eccentricity changes in time, where Taylor series are needed.
    #[error("Kepler's equation has a series here for an eccentricity that is constant in time only")]
    VaryingEccentricity,
    /// The rate of a sine or cosine of time depends on a value that is sampled during the run.
    #[error(
        "the rate of a sine or cosine of time follows from a sampled value or an own state; such rates are constant"
    )]
    SampledRate,
    /// A part of the own state has no law, or more than one.
    #[error("`{name}` needs one law: `d_{name}`, its rate, or `next_{name}`, its value after a sample")]
    StateLaw {
        /// The state.
        name: String,
    },
    /// A constant that shaders cannot express.
    #[error("the constant {value:e} is beyond 3.4e38, the range of f32: it must be a parameter")]
    ConstantOutOfRange {
        /// The constant.
        value: f64,
    },
    /// A recording was begun inside another one of the same thread.
    #[error("a formula is being recorded already on this thread")]
    Nested,
    /// A symbol was used outside of the recording that it belongs to.
    #[error("a symbol was used outside of the recording that it belongs to")]
    ForeignSymbol,
    /// An unknown name.
    #[error("unknown name `{name}`{}", suggestion(.nearest.as_ref()))]
    UnknownName {
        /// The name as written.
        name: String,
        /// The known name with the nearest spelling.
        nearest: Option<String>,
    },
    /// A vector, rotation or tensor has no such component.
    #[error("no component `{name}`; there are {known}")]
    UnknownComponent {
        /// The name as written.
        name: String,
        /// The components that exist.
        known: &'static str,
    },
    /// An input that is not available here.
    #[error("`{name}` is not known where this formula is used")]
    NotOffered {
        /// Its name.
        name: String,
    },
    /// An energy for a torque that is not a formula: those of the library have their own.
    #[error("only a torque that is a formula takes an energy of one's own")]
    EnergyOfModel,
    /// An energy with other parameters than those of its torque.
    #[error("expected the parameters of the torque, with the same names and values")]
    OtherParameters,
    /// A name that is defined twice.
    #[error("`{name}` is defined twice")]
    DuplicateName {
        /// The name.
        name: String,
    },
    /// A name that already has a meaning.
    #[error("`{name}` has a meaning already; choose another name")]
    ReservedName {
        /// The name.
        name: String,
    },
    /// A name that is used in its own definition or before it.
    #[error("`{name}` is used before it is defined")]
    UsedBeforeDefinition {
        /// The name.
        name: String,
    },
    /// A name that is not made of letters, digits and underscores.
    #[error("`{name}` is not a name: letters, digits and _ are, a letter first")]
    InvalidName {
        /// The name.
        name: String,
    },
    /// A value of the wrong shape.
    #[error("{of}: found {found}, needed {needed}")]
    Shape {
        /// The operator or function whose operand or argument it is.
        of: String,
        /// What was found.
        found: String,
        /// What is needed.
        needed: String,
    },
    /// A function was given too few or too many arguments.
    #[error("`{function}` takes {needed} argument{}, not {found}", if *.needed == 1 { "" } else { "s" })]
    ArgumentCount {
        /// The function.
        function: String,
        /// How many were given.
        found: usize,
        /// How many it takes.
        needed: usize,
    },
    /// The text is not a formula.
    #[error("found {found}, needed {needed}")]
    Syntax {
        /// What was found.
        found: String,
        /// What is needed there.
        needed: String,
    },
    /// An exponent after `^` that is not a small whole number.
    #[error("expected a whole number from -16 to 16 after `^`; otherwise use `pow(x, y)`, for x ≥ 0")]
    Exponent,
    /// Parentheses, calls or signs nested too deeply.
    #[error("nested more than {limit} levels deep")]
    TooDeep {
        /// The largest depth.
        limit: usize,
    },
    /// A text that is too long.
    #[error("the text has {length} bytes, more than the {limit} that are allowed")]
    TooLong {
        /// Its length, bytes.
        length: usize,
        /// The largest length, bytes.
        limit: usize,
    },
}

/// A suggestion after a semicolon, or nothing.
fn suggestion(nearest: Option<&String>) -> String {
    nearest.map(|name| format!("; nearest: `{name}`")).unwrap_or_default()
}

impl From<Fault> for crate::Error {
    fn from(fault: Fault) -> Self {
        Self::Formula(fault.to_string().into())
    }
}

/// The name among `known` that differs least from `name`, if it differs by little.
pub(super) fn nearest<'a>(name: &str, known: impl Iterator<Item = &'a str>) -> Option<String> {
    let (distance, best) = known.map(|candidate| (edit_distance(name, candidate), candidate)).min()?;
    // A third of the letters may be wrong; beyond that a suggestion confuses more than it helps.
    (distance * 3 <= best.chars().count().max(3)).then(|| best.to_owned())
}

/// Insertions, deletions, replacements and swaps of neighbours between two words (optimal string alignment).
fn edit_distance(a: &str, b: &str) -> usize {
    let (a, b): (Vec<char>, Vec<char>) = (a.chars().collect(), b.chars().collect());
    let mut rows = vec![vec![0; b.len() + 1]; a.len() + 1];
    for i in 0..=a.len() {
        for j in 0..=b.len() {
            rows[i][j] = if i == 0 || j == 0 {
                i + j
            } else {
                let replaced = rows[i - 1][j - 1] + usize::from(a[i - 1] != b[j - 1]);
                let best = replaced.min(rows[i - 1][j] + 1).min(rows[i][j - 1] + 1);
                let swapped = i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1];
                if swapped { best.min(rows[i - 2][j - 2] + 1) } else { best }
            };
        }
    }
    rows[a.len()][b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_suggested_only_if_it_is_near() {
        assert_eq!(nearest("omga", ["omega", "time"].into_iter()), Some("omega".to_owned()));
        assert_eq!(nearest("tiem", ["omega", "time"].into_iter()), Some("time".to_owned()));
        assert_eq!(nearest("x", ["omega", "time"].into_iter()), None);
        assert_eq!(nearest("x", std::iter::empty()), None);
    }
}
