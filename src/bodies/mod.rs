//! Bodies: their inertia tensors, the table of them, their state and how they lie in columns.

pub(crate) mod blocks;
#[doc(hidden)]
pub mod columns;
pub mod ensemble;
pub(crate) mod frame;
pub mod inertia;
mod members;
pub mod memory;
#[cfg(feature = "study")]
pub(crate) mod state_columns;
pub mod status;
pub mod toolkit;
pub(crate) mod user_axes;

pub use blocks::Blocks;
pub use ensemble::Ensemble;
pub use frame::{BodyFrame, BodyState};
pub use members::Members;
#[cfg(feature = "study")]
pub use state_columns::{ROTATION_COLUMNS, TRANSLATION_COLUMNS};
pub use status::Status;
