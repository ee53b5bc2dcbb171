//! Torque-free motion in closed form.
mod elliptic;
pub mod evaluation;
mod frame;
mod rows;
mod setup;
mod solution;

pub use evaluation::ROW_COLUMNS;
pub use rows::{AnyRows, FreeMotionRows, WORD_COLUMNS};
pub use solution::FreeMotion;
