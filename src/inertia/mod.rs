//! Mass properties: from a tensor to the principal frame.

mod principal;
mod tensor;

pub use principal::{PrincipalAxes, principal_axes};
pub use tensor::InertiaTensor;
