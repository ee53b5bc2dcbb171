//! Kernels: what is computed of one body, or of a lane group, generic over [`crate::math::real::Real`].
//!
//! Each has a twin of the same stem under `shaders/`.

pub mod free_motion;
pub mod method;
#[doc(hidden)]
pub mod observe;
pub mod rigid_body;
#[doc(hidden)]
pub mod torque_kernel;
