//! Faults of a file of benchmark rows.

/// What is wrong with a file of rows.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RowFault {
    /// Its columns are not those that this version writes.
    #[error("its columns are not those of this version, whose rows cannot be appended: name another folder with --out")]
    Columns,
    /// It cannot be read as comma-separated values.
    #[error("{0}")]
    Csv(String),
    /// A body is asked for that it has no row for.
    #[error("there is no body {body}: it has {bodies}, counted from 0")]
    NoBody {
        /// The body's number, from 0.
        body: usize,
        /// How many bodies there are.
        bodies: usize,
    },
    /// Bodies are to be drawn from a run that wrote no snapshots.
    #[error("bodies are drawn from snapshots, and there are none: set `snapshots = true` in the study")]
    NoSnapshots,
    /// It has no row that was measured on this engine.
    #[error("no valid row of {engine}: `polhode bench accuracy --out` this folder leaves some")]
    NoEngine {
        /// The engine's name.
        engine: String,
    },
}
