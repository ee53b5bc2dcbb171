//! Numbers: the scalars and SIMD lanes that kernels are generic over, vectors, quaternions, elementary functions, exact time.
//!
//! Nothing here knows of bodies.

pub mod clock;
pub mod double_double;
pub mod elementary;
pub(crate) mod lanes;
pub mod phase;
pub mod quaternion;
pub mod real;
pub mod vector;
