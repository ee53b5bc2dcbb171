//! polhode
pub mod batch;
pub mod engine;
pub mod ensemble;
pub mod error;
pub mod inertia;
mod lanes;
pub mod memory;
pub mod method;
pub mod quaternion;
pub mod real;
pub mod rigid_body;
pub mod vector;

pub use error::{Error, Result};
