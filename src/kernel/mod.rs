//! Kernels: what is computed of one body, or of a lane group, generic over [`crate::math::real::Real`].
//!
//! Each has a twin of the same stem under `shaders/`.

pub mod free_motion;
pub mod method;
pub mod observe;
pub mod rigid_body;
pub mod torque_kernel;
