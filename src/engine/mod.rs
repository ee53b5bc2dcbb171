//! Engines: what integrates a batch of bodies.
//!
//! An [`Engine`] opens a [`Session`] on a batch; the session advances all bodies by whole steps and gives back their
//! raw state. Both engines hold the same columns and run the same kernels, so a session of one can be compared with a
//! session of the other step by step ([`crate::verify`]).

use std::ops::{ControlFlow, Range};

use crate::batch::{AnyBatch, Precision, StateWords};
use crate::error::Result;
use crate::method::Method;

pub mod cpu;

/// Whether an engine computes on a GPU or on the processor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EngineKind {
    /// Compute shaders through wgpu.
    Gpu,
    /// SIMD lanes on all cores.
    Cpu,
}

/// What an engine says of itself, for reports.
#[derive(Clone, Debug, PartialEq)]
pub struct Description {
    /// GPU or CPU.
    pub kind: EngineKind,
    /// The adapter's or the processor's instruction set and cores, in words.
    pub name: String,
    /// Driver and its version; empty on the CPU.
    pub driver: String,
    /// Whether a software adapter plays the GPU.
    pub software: bool,
}

/// What carries an engine out: one implementation for the CPU, one for wgpu.
pub trait Backend: Send + Sync {
    /// What it is.
    fn description(&self) -> Description;

    /// Precisions that it can compute in.
    fn precisions(&self) -> &[Precision];

    /// Takes a batch and stands ready to advance it by `method`.
    ///
    /// # Errors
    ///
    /// [`crate::Error::PrecisionUnavailable`], [`crate::Error::TooManyBodies`], [`crate::Error::Device`]; nothing
    /// is left allocated then.
    fn start(&self, batch: AnyBatch, method: Method) -> Result<Box<dyn Session>>;
}

/// How far an [`Session::advance`] has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Body-steps done.
    pub done: u64,
    /// Body-steps of the whole call.
    pub total: u64,
}

/// Is told of progress and says whether to go on.
pub type Observer<'a> = dyn FnMut(Progress) -> ControlFlow<()> + 'a;

/// A batch on an engine.
pub trait Session {
    /// Number of bodies.
    fn body_count(&self) -> usize;

    /// Advances every body by `steps` steps of `dt` seconds.
    ///
    /// The result does not depend on how a number of steps is cut into calls. `observer` is called now and then; where
    /// it breaks, the call returns [`crate::Error::Interrupted`] and the session must be dropped.
    ///
    /// # Errors
    ///
    /// [`crate::Error::Setting`] where `dt` is not a positive number that the precision can hold;
    /// [`crate::Error::Device`] where the device is lost.
    fn advance(&mut self, dt: f64, steps: u64, observer: &mut Observer<'_>) -> Result<()>;

    /// The raw state of a range of bodies.
    ///
    /// # Errors
    ///
    /// [`crate::Error::Device`] where the device is lost.
    fn read(&mut self, bodies: Range<usize>) -> Result<StateWords>;
}

/// Goes on whatever happens; for callers that do not watch.
pub fn unobserved(_: Progress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// The step sizes that a precision can carry in two words without subnormal numbers.
pub(crate) fn check_step(dt: f64, precision: Precision) -> Result<()> {
    let (least, greatest, expected) = match precision {
        Precision::F32 => (1e-30, 1e30, "a step of 1e-30 to 1e30 s is needed in f32"),
        Precision::F64 => (f64::MIN_POSITIVE, f64::MAX, "a finite step above zero is needed (s)"),
    };
    if dt >= least && dt <= greatest { Ok(()) } else { Err(crate::Error::Setting { field: "dt", value: dt, expected }) }
}
