//! The one error type.

/// Why something could not be done. Every variant names what was found and what would be valid.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A value of one body is not valid.
    #[error("body {body}: {field} = {value}: {expected}")]
    Body {
        /// Index of the body, from 0.
        body: usize,
        /// Name of the field.
        field: &'static str,
        /// The value found.
        value: f64,
        /// What would be valid.
        expected: &'static str,
    },
    /// A setting is not valid.
    #[error("{field} = {value}: {expected}")]
    Setting {
        /// Name of the setting.
        field: &'static str,
        /// The value found.
        value: f64,
        /// What would be valid.
        expected: &'static str,
    },
    /// Columns that belong together differ in length.
    #[error("column {column} has {found} rows: {expected} are needed, one a body")]
    ColumnLength {
        /// Name of the column.
        column: &'static str,
        /// Rows found.
        found: usize,
        /// Rows needed.
        expected: usize,
    },
}

/// `Result` with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;
