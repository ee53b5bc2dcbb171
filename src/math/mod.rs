//! Numbers: the scalars and SIMD lanes that kernels are generic over, vectors, quaternions, elementary functions, exact time.
//!
//! Nothing here knows of bodies.

pub mod clock;
pub mod double_double;
pub mod elementary;
pub mod equal_steps;
pub mod kepler;
pub(crate) mod lanes;
mod moments;
pub(crate) mod parallel;
pub mod phase;
pub(crate) mod power_of_two;
mod precision;
mod quantiles;
pub mod quaternion;
pub mod real;
mod sketch;
pub mod vector;

pub use lanes::Width;
pub(crate) use moments::Moments;
pub use precision::Precision;
pub use quantiles::{Quantiles, Spread};
pub(crate) use sketch::nearest_rank;
pub use sketch::{QUANTILE_ERROR, Sketch};
