//! polhode
pub mod batch;
pub mod engine;
pub mod ensemble;
pub mod error;
pub mod inertia;
mod lanes;
pub mod memory;
pub mod method;
pub mod plan;
pub mod quaternion;
pub mod real;
pub mod record;
pub mod rigid_body;
pub mod run;
pub mod scene;
#[cfg(feature = "study")]
pub mod study;
pub mod toolkit;
pub mod torque;
pub mod vector;
pub mod verify;

pub use batch::Precision;
pub use ensemble::Ensemble;
pub use error::{Error, Result};
pub use method::Method;
pub use plan::Plan;
pub use record::Record;
pub use scene::{Accuracy, Outputs, Scene};
