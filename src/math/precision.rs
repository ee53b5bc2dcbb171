//! Which of the two arithmetics a kernel is compiled in.

/// An expression of what an enum of both precisions holds: `of_either!(AnyBatch, batch, columns => columns.body_count)`.
macro_rules! of_either {
    ($any:ident, $value:expr, $columns:ident => $expression:expr) => {
        match $value {
            $any::F32($columns) => $expression,
            $any::F64($columns) => $expression,
        }
    };
}

pub(crate) use of_either;

/// The arithmetic that bodies are integrated in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Precision {
    /// 32-bit floating point, states and parameters carried in two words.
    F32,
    /// 64-bit floating point.
    F64,
}

impl Precision {
    /// Both, narrow first.
    pub const ALL: [Precision; 2] = [Precision::F32, Precision::F64];

    /// The name in study files and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Precision::F32 => "f32",
            Precision::F64 => "f64",
        }
    }
}

impl std::fmt::Display for Precision {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(self.name())
    }
}
