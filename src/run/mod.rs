//! Runs of plans: in memory, into a sink, output by output, into files, in parts and with checkpoints.

use std::ops::ControlFlow;

use crate::bodies::memory::require;
use crate::engine::{Backend, Engine, Progress};
#[cfg(doc)]
use crate::error::Error;
use crate::error::Result;
use crate::plan::Plan;
use crate::record::{Memory, OutputState, Record, Sink, Snapshot, Trust};

mod adaptive_work;
mod advance;
mod at_end;
mod balance;
#[cfg(feature = "study")]
mod checkpoint;
mod evaluated_when_read;
mod failure_causes;
mod failure_times;
mod failures;
#[cfg(feature = "study")]
mod files;
mod group_run;
#[cfg(feature = "study")]
mod initial_file;
#[cfg(feature = "study")]
mod merge;
mod observed;
#[cfg(feature = "study")]
mod outcome;
mod output_loop;
mod output_statistics;
mod own_state;
mod reading;
mod recomputed_centres;
mod recomputed_sample;
mod replay;
mod session_rows;
mod session_run;
#[cfg(feature = "study")]
mod state_tables;
mod states;
pub(crate) mod stepped_translation;
mod torque_work;
mod translation;

pub use balance::balance;
#[cfg(feature = "study")]
pub use checkpoint::{Checkpoint, LostPiece, PieceObserver};
#[cfg(feature = "study")]
pub use files::{OutputSize, run_part_to_folder, run_to_folder, write_plan};
#[cfg(feature = "study")]
pub use merge::{MergedReport, merge};
#[cfg(feature = "study")]
pub use outcome::MergedAccuracy;
pub use output_loop::{Output, Run};
pub use own_state::OwnState;
pub use replay::{How, Replay, StateError, alone, replay, replay_until};

impl Engine {
    /// Runs a plan and keeps every output in memory.
    ///
    /// # Errors
    ///
    /// As [`run_into`], which passes outputs on instead of keeping them.
    pub fn run(&self, plan: &Plan<'_>) -> Result<Record> {
        run(self, plan)
    }
}

/// Runs `plan` on `engine` and keeps every output in memory.
///
/// # Errors
///
/// As [`run_into`], and [`Error::TooManyBodies`] where all outputs together need more memory than is free.
pub fn run(engine: &dyn Backend, plan: &Plan<'_>) -> Result<Record> {
    let keeps_states = plan.scene().keeps_states();
    let ensemble = plan.scene().ensemble();
    let body_count = ensemble.len();
    if keeps_states {
        let bytes = Snapshot::bytes(ensemble.translation().is_some()).saturating_mul(plan.times().len());
        let purpose = "keeping the states of all outputs (run_into passes them on)";
        require(body_count, bytes.saturating_mul(body_count), purpose)?;
    }
    let mut memory = Memory { keeps_states, body_count, ..Memory::default() };
    let trust = run_into(engine, plan, &mut memory, &mut |_| ControlFlow::Continue(()))?;
    if keeps_states && memory.snapshots.is_empty() {
        // Without bodies no output was passed on.
        memory.snapshots.extend(plan.times().iter().map(|&time| Snapshot::with_capacity(time, 0)));
    }
    Ok(Record::new(memory, trust))
}

/// Runs `plan` on `engine` and passes every output to `sink`, some bodies at a time.
///
/// `observer` receives how much is done and of how much: of equal steps body-steps, otherwise each body counts once for each output. It may
/// break; it is then not asked again.
///
/// # Errors
///
/// [`Error::TooManyBodies`], [`Error::DeviceInRun`], [`Error::Interrupted`], and the errors of the sink.
pub fn run_into(
    engine: &dyn Backend,
    plan: &Plan<'_>,
    sink: &mut dyn Sink,
    observer: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Trust> {
    let mut run = Run::start(engine, plan)?;
    for _ in plan.times() {
        run.output_into(sink, observer)?;
    }
    run.finish_into(sink, observer)
}
