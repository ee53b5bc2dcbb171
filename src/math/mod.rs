//! Numbers: the scalars and SIMD lanes that kernels are generic over, vectors, quaternions, elementary functions, exact time.
//!
//! Nothing here knows of bodies.

#[doc(hidden)]
pub mod clock;
#[doc(hidden)]
pub mod double_double;
#[doc(hidden)]
pub mod elementary;
#[doc(hidden)]
pub mod equal_steps;
#[doc(hidden)]
pub mod kepler;
pub(crate) mod lanes;
mod moments;
mod operators;
pub(crate) mod parallel;
#[doc(hidden)]
pub mod phase;
pub(crate) mod power_of_two;
mod precision;
mod quantiles;
#[doc(hidden)]
pub mod quaternion;
#[doc(hidden)]
pub mod real;
mod sketch;
#[doc(hidden)]
pub mod vector;

pub use lanes::Width;
pub(crate) use moments::{Moments, MomentsTree};
pub(crate) use operators::operators;
pub use precision::Precision;
pub(crate) use precision::of_either;
pub use quantiles::{Quantiles, Spread};
pub(crate) use sketch::FEW;
pub use sketch::{QUANTILE_ERROR, Sketch};
