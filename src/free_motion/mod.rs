//! Torque-free motion in closed form.
mod elliptic;
pub mod evaluation;
mod frame;
mod setup;
mod solution;

pub use solution::FreeMotion;
