//! Rotation of large ensembles of independent rigid bodies, on the GPU and on all cores of the CPU.
//!
//! Each body has its own inertia tensor; its rotation follows Euler's equations with their gyroscopic term
//! ([`kernel::rigid_body`]). The GPU engine runs WGSL compute shaders through wgpu, the CPU engine runs the same kernels in SIMD
//! lanes, and [`verify`] steps both side by side.
//!
//! # Five lines
//!
//! ```
//! use glam::{DQuat, DVec3};
//! use polhode::{Accuracy, Engine, Ensemble, Plan, Scene};
//!
//! # fn main() -> polhode::Result<()> {
//! let ensemble = Ensemble::from_columns(
//!     &[DVec3::new(1.0, 2.0, 2.5)],       // principal moments, kg m² (or full tensors)
//!     &[DQuat::IDENTITY],                 // body to world
//!     &[DVec3::new(0.01, 2.0, 0.0)],      // rad/s, body axes
//! )?;
//! let scene = Scene::new(ensemble).until(60.0).accuracy(Accuracy::attitude(1e-6));
//! let engine = Engine::cpu();
//! let record = engine.run(&Plan::new(&scene, &engine)?)?;
//! println!("{:?} {}", record.final_state().orientation(0), record.trust());
//! # Ok(())
//! # }
//! ```
//!
//! # How it is built
//!
//! Data flows one way, and each arrow is a plain value:
//!
//! ```text
//! study file ─▶ Ensemble ─▶ Plan ─▶ Engine (cpu | gpu) ─▶ Record ─▶ files, report
//! ```
//!
//! # Layers
//!
//! Each module uses those above it in this list and none below it; `tests/files/layers.rs` reads the sources and holds this.
//!
//! 1. `math`: scalars, SIMD lanes of them, vectors, quaternions, elementary functions and exact time; nothing of it knows of bodies.
//! 2. `error`: the one error type and its payloads. (It also names integrators and accuracies, which return no errors.)
//! 3. `bodies`: inertia tensors, the ensemble, the state of a body, and how bodies lie in columns.
//! 4. `expression`: formulas as graphs, and what follows from them: WGSL text, tiles, Taylor series.
//! 5. `kernel`: what is computed of one body or a lane group: the equations of motion, integrators, closed forms, statistics. Each
//!    kernel has a twin of the same stem under `shaders/`: `f64` is the reference, `f32` is compared with the shader, SIMD
//!    lanes of either are the fast CPU engine.
//! 6. `torque`: the models of torques and forces, each a declaration and a formula.
//! 7. `scene`: what the user asks for: bodies, torques, output times, accuracy.
//! 8. `study` (feature `study`): scenes as files.
//! 9. `engine`: batches of scaled bodies, and the sessions on the CPU or a GPU that advance them.
//! 10. `plan`: a scene resolved for an engine: what is computed how, what is skipped, and why.
//! 11. `record`: what a run leaves behind, in memory and in files.
//! 12. `run`: the loop over output times, and the trust figures.
//! 13. `verify`: an engine beside its scalar twin, step by step, over a whole scene.
//! 14. `bench` (feature `bench`): run time against error.
//! 15. `plot` (feature `plot`): pictures of benchmarks and runs.
//!
//! What a new torque, integrator, quantity or output format needs is listed in `docs/extending.md`.
//!
//! # Conventions
//!
//! * Frames are *body* (the user's own axes, origin at the centre of mass), *principal* (the body turned so that its
//!   tensor is diagonal) and *world* (inertial); a vector's name ends in its frame.
//! * An orientation is a unit quaternion that rotates body coordinates to world, x, y, z, w as `glam` writes it.
//! * SI units throughout.
//! * An attitude error is the angle of the rotation between two orientations, in [0, π].
//!
//! # What is public
//!
//! What these pages show is for users. Other items are public only for this crate's own tests and benchmarks, and may change in any release.
//!
//! # Glossary
//!
#![doc = include_str!("../docs/glossary.md")]

#[cfg(feature = "bench")]
pub mod bench;
pub mod bodies;
pub mod engine;
pub mod error;
pub mod expression;
pub mod kernel;
pub mod math;
pub mod plan;
#[cfg(feature = "plot")]
pub mod plot;
pub mod record;
pub mod run;
pub mod scene;
#[cfg(feature = "study")]
pub mod study;
pub mod torque;
pub mod verify;

/// The vectors and quaternions of this crate's interface.
pub use glam;

pub use bodies::Ensemble;
pub use engine::Engine;
pub use error::{Error, Result};
pub use kernel::method::Method;
pub use kernel::observe::Statistic;
pub use math::Precision;
pub use plan::Plan;
pub use record::Record;
pub use scene::{Accuracy, Outputs, Quantity, Scene};
pub use torque::Torque;
pub use torque::force::Force;
