//! Bodies: their inertia tensors, and the table of them.

pub mod ensemble;
pub mod inertia;
pub mod memory;
pub mod toolkit;

pub use ensemble::Ensemble;
