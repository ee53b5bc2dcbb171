//! Torque-free motion in closed form.
mod elliptic;
pub mod evaluation;
mod frame;
mod rows;
mod setup;
mod solution;

pub use rows::{FreeMotionRows, WORD_COLUMNS};
pub use solution::FreeMotion;
