//! Faults of a file of benchmark rows.

/// What is wrong with a file of rows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RowFault {
    /// Its columns are not those that this version writes.
    Columns,
    /// It cannot be read as comma-separated values.
    Csv(String),
    /// A body is asked for that it has no row for.
    NoBody {
        /// The body's number, from 0.
        body: usize,
        /// How many bodies there are.
        bodies: usize,
    },
    /// Bodies are to be drawn from a run that wrote no snapshots.
    NoSnapshots,
    /// It has no row that was measured on this engine.
    NoEngine {
        /// The engine's name.
        engine: String,
    },
}

impl std::fmt::Display for RowFault {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            RowFault::Columns => formatter.write_str(
                "its columns are not those of this version, whose rows cannot be appended: name another folder with --out",
            ),
            RowFault::Csv(reason) => formatter.write_str(reason),
            RowFault::NoBody { body, bodies } => {
                write!(formatter, "there is no body {body}: it has {bodies}, counted from 0")
            }
            RowFault::NoSnapshots => formatter.write_str(
                "bodies are drawn from snapshots, and there are none: set `snapshots = true` in the study",
            ),
            RowFault::NoEngine { engine } => {
                write!(formatter, "no valid row of {engine}: `polhode bench accuracy --out` this folder leaves some")
            }
        }
    }
}
