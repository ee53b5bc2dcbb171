//! x
mod principal;
mod refined;
mod tensor;
mod two_word;
pub use principal::{PrincipalAxes, principal_axes};
pub use refined::{RefinedPrincipalAxes, principal_axes_refined};
pub use tensor::InertiaTensor;
