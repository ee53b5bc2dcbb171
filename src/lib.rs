//! polhode
pub mod error;
mod lanes;
pub mod method;
pub mod quaternion;
pub mod real;
pub mod rigid_body;
pub mod vector;
