//! Formulas as users write them.
//!
//! A text is any number of definitions and then one formula:
//!
//! ```text
//! # a spring towards the vertical, with drag
//! let up = to_body(vec(0, 0, 1));
//! -k * cross(up, vec(0, 0, 1)) - b * angular_velocity * norm(angular_velocity)
//! ```
//!
//! Values are numbers, vectors, rotations and truth values. There are no loops and no recursion, and only the inputs and
//! parameters of [`Symbols`] are read.

use std::fmt;

use super::fault::Fault;
use super::graph::{Graph, Node};
use super::parser::Parser;
use super::symbols::{Scope, Shape, Symbols};

/// The longest text, bytes.
pub const LONGEST_TEXT: usize = 65_536;
/// The most nested levels of parentheses, calls and signs.
pub const MOST_LEVELS: usize = 200;

/// A part of a text, bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Span {
    pub(super) start: usize,
    pub(super) length: usize,
}

/// A text that is not a formula: where, and why.
#[derive(Clone, Debug, PartialEq)]
pub struct TextError {
    /// The line, from 1.
    pub line: usize,
    /// The column, characters from 1.
    pub column: usize,
    /// How many characters are faulty, at least 1.
    pub length: usize,
    /// What is wrong.
    pub fault: Fault,
    /// The line of the text.
    source: String,
}

impl TextError {
    pub(super) fn new(text: &str, span: Span, fault: Fault) -> Self {
        let start = span.start.min(text.len());
        let before = &text[..start];
        let line_start = before.rfind('\n').map_or(0, |end| end + 1);
        let source = text[line_start..].lines().next().unwrap_or_default();
        let column = 1 + text[line_start..start].chars().count();
        let meant = &text[start..(start + span.length).min(text.len())];
        let length = meant.lines().next().unwrap_or_default().chars().count().max(1);
        Self { line: 1 + before.matches('\n').count(), column, length, fault, source: source.to_owned() }
    }

    /// The line of the user's text, with carets below the faulty part. A long line is cut.
    pub fn picture(&self) -> String {
        /// Number of characters shown before the faulty part, and in all.
        const BEFORE: usize = 60;
        const ALL: usize = 120;
        let skipped = (self.column - 1).saturating_sub(BEFORE);
        let shown: String = self.source.chars().skip(skipped).take(ALL).collect();
        let gap: String = shown
            .chars()
            .take(self.column - 1 - skipped)
            .map(|character| if character == '\t' { '\t' } else { ' ' })
            .collect();
        let room = ALL.saturating_sub(self.column - 1 - skipped).max(1);
        format!("{shown}\n{gap}{}", "^".repeat(self.length.min(room)))
    }
}

impl fmt::Display for TextError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "line {}, column {}: {}", self.line, self.column, self.fault)
    }
}

impl std::error::Error for TextError {}

impl From<TextError> for crate::Error {
    fn from(error: TextError) -> Self {
        Self::Formula(error.to_string().into())
    }
}

/// For a formula as a whole: at its start.
impl From<Fault> for TextError {
    fn from(fault: Fault) -> Self {
        Self { line: 1, column: 1, length: 1, fault, source: String::new() }
    }
}

/// An error with its position, before it is known in which text.
pub(super) struct Placed {
    pub(super) fault: Fault,
    pub(super) span: Span,
}

impl From<Fault> for Placed {
    fn from(fault: Fault) -> Self {
        Self { fault, span: Span { start: 0, length: 1 } }
    }
}

/// The graph that a text describes, and its results.
pub(super) fn recorded(text: &str, symbols: &Symbols, wanted: Shape) -> Result<(Graph, Vec<Node>), TextError> {
    let result = if text.len() > LONGEST_TEXT {
        Err(Fault::TooLong { length: text.len(), limit: LONGEST_TEXT }.into())
    } else {
        Graph::record(|recorder| Parser::new(text, Scope::new(symbols, recorder))?.formula(wanted))
    };
    result.map_err(|Placed { fault, span }| TextError::new(text, span, fault))
}
