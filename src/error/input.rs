//! Faults of an input file, and where they are.

use std::path::PathBuf;

use crate::error::Text;

/// An input file that is not valid: which file, where in it, and why.
#[derive(Clone, Debug, PartialEq)]
pub struct InputError {
    /// The file.
    pub file: PathBuf,
    /// The line, from 1.
    pub line: usize,
    /// The key, with the tables that contain it (`bodies.inertia.mass`), or the column of a table of bodies.
    pub key: String,
    /// What is wrong there.
    pub fault: InputFault,
}

/// What is wrong at one place of an input file.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum InputFault {
    /// The text is not TOML, or not CSV.
    Syntax {
        /// The parser's message.
        reason: String,
    },
    /// No such key or column.
    Unknown {
        /// The known name with the nearest spelling.
        nearest: Option<String>,
        /// All known names.
        known: Vec<String>,
    },
    /// A column of a table of bodies that has no standard name, and that neither the study's torques and forces nor `bodies.carry` name.
    UnusedColumn {
        /// The standard name with the nearest spelling.
        nearest: Option<String>,
        /// All standard names.
        known: Vec<String>,
    },
    /// A required key or column is missing.
    Missing {
        /// What it would hold.
        expected: Text,
    },
    /// A value of the wrong type or out of range.
    Value {
        /// The value as written in the file.
        value: String,
        /// What would be valid.
        expected: Text,
    },
    /// A word that is not one of the possible ones.
    Choice {
        /// The word as written in the file.
        value: String,
        /// The possible word with the nearest spelling.
        nearest: Option<&'static str>,
        /// The possible words.
        choices: &'static [&'static str],
    },
    /// Text that is not a valid formula.
    Formula {
        /// The column in its line, in characters from 1.
        column: usize,
        /// What is wrong.
        reason: String,
        /// The line, with carets below the faulty part.
        picture: String,
    },
    /// Two keys exclude each other.
    Conflict {
        /// The other key.
        other: String,
    },
    /// A value is well formed but leads to an error: an open mesh, parts that form no body.
    Cause {
        /// The value as written in the file.
        value: String,
        /// The error.
        cause: Box<crate::error::Error>,
    },
    /// A row has too few or too many fields.
    RowLength {
        /// Fields found.
        found: usize,
        /// Fields of the header.
        expected: usize,
    },
    /// A body made from this key is not valid.
    Body {
        /// Index of the body, from 0.
        body: usize,
        /// Name of the field.
        field: Text,
        /// The value found.
        value: f64,
        /// What would be valid.
        expected: Text,
    },
}

impl InputFault {
    /// A name that is not among those known.
    pub(crate) fn unknown(name: &str, known: &[&str]) -> Self {
        let (nearest, known) = among(name, known);
        InputFault::Unknown { nearest, known }
    }

    /// A column that is not among the standard ones, and that nothing in the study names.
    pub(crate) fn unused_column(name: &str, known: &[&str]) -> Self {
        let (nearest, known) = among(name, known);
        InputFault::UnusedColumn { nearest, known }
    }
}

/// The known name with the nearest spelling, and all of them.
fn among(name: &str, known: &[&str]) -> (Option<String>, Vec<String>) {
    (nearest(name, known).map(str::to_owned), known.iter().map(|&name| name.to_owned()).collect())
}

/// A suggestion in brackets, or nothing.
fn suggestion(nearest: Option<&str>) -> String {
    nearest.map(|name| format!("did you mean {name}? ")).unwrap_or_default()
}

impl std::fmt::Display for InputError {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(formatter, "{}:{}: ", self.file.display(), self.line)?;
        let key = &self.key;
        match &self.fault {
            InputFault::Syntax { reason } if key.is_empty() => formatter.write_str(reason),
            InputFault::Syntax { reason } => write!(formatter, "{key}: {reason}"),
            InputFault::Unknown { nearest, known } => {
                write!(
                    formatter,
                    "{key} is not known: {}known here: {}",
                    suggestion(nearest.as_deref()),
                    known.join(", ")
                )
            }
            InputFault::UnusedColumn { nearest, known } => {
                write!(
                    formatter,
                    "{key} is no standard column, and nothing in the study names it: {}bodies.carry names columns for `initial`, \
                     {{ column = {key:?} }} reads one in a torque or force; standard: {}",
                    suggestion(nearest.as_deref()),
                    known.join(", ")
                )
            }
            InputFault::Missing { expected } => write!(formatter, "{key} is missing: {expected}"),
            InputFault::Value { value, expected } => write!(formatter, "{key} = {value}: {expected}"),
            InputFault::Choice { value, nearest, choices } => {
                write!(formatter, "{key} = {value}: {}possible: {}", suggestion(*nearest), choices.join(", "))
            }
            InputFault::Formula { column, reason, .. } => write!(formatter, "{key}: column {column}: {reason}"),
            InputFault::Conflict { other } => write!(formatter, "{key} excludes {other}: give one of them"),
            InputFault::Cause { value, cause } => write!(formatter, "{key} = {value}: {cause}"),
            InputFault::RowLength { found, expected } => {
                write!(formatter, "the row has {found} fields: expected {expected}, one a column of the header")
            }
            InputFault::Body { body, field, value, expected } => {
                write!(formatter, "{key}: body {body}: {field} = {value:?}: {expected}")
            }
        }
    }
}

impl std::error::Error for InputError {}

/// The name among `known` that differs least from `name`, if it differs by little; else the only one that has it as a word, as
/// `gravity-gradient` has `gravity`.
pub(crate) fn nearest<'k>(name: &str, known: &[&'k str]) -> Option<&'k str> {
    let distance = |candidate: &str| strsim::damerau_levenshtein(name, candidate);
    let best = known.iter().copied().min_by_key(|candidate| distance(candidate))?;
    // A third of the letters may be wrong; beyond that a suggestion confuses more than it helps.
    let is_near = distance(best) * 3 <= best.len().max(3);
    let mut with_word = known.iter().copied().filter(|known| known.split(['-', '_']).any(|word| word == name));
    let only = with_word.next().filter(|_| with_word.next().is_none());
    if is_near { Some(best) } else { only }
}
