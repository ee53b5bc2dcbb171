//! Sessions: bodies on an engine, which advance and are read.

use std::ops::{ControlFlow, Range};

use glam::DVec3;

#[cfg(doc)]
use super::adaptive_session::AdaptiveSession;
use super::controlled::{Controls, Written};
use super::reduction::{AskedOfBodies, BlockRows, Formed, Marked};
use super::watch::Job;
use crate::bodies::BodyFrame;
use crate::bodies::columns::StateWords;
use crate::error::Result;
use crate::kernel::observe::{Partial, Statistic};

/// The progress of an advance of a [`Session`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Body-steps done.
    pub done: u64,
    /// Body-steps of the whole call.
    pub total: u64,
}

/// Receives the progress and decides whether to continue.
pub type Observer<'a> = dyn FnMut(Progress) -> ControlFlow<()> + 'a;

/// Bodies on an engine. [`SteppedSession`], [`AdaptiveSession`] and [`FreeSession`] advance them.
pub trait Session: Send {
    /// Number of bodies.
    fn body_count(&self) -> usize;

    /// Whether [`SteppedSession::job`] or [`AdaptiveSession::job_to`] returns a job.
    fn has_jobs(&self) -> bool {
        false
    }

    /// The raw state of a range of bodies.
    ///
    /// # Errors
    ///
    /// [`crate::Error::Device`] where the device is lost.
    fn read(&mut self, bodies: Range<usize>) -> Result<StateWords>;

    /// The raw state of some rows.
    ///
    /// # Errors
    ///
    /// [`crate::Error::Device`] where the device is lost.
    fn read_rows(&mut self, rows: &[usize]) -> Result<StateWords>;

    /// Announces that the present state of a range of bodies is read next: an engine may copy it to the host meanwhile.
    ///
    /// # Errors
    ///
    /// [`crate::Error::Device`] where the device is lost.
    fn prefetch(&mut self, _bodies: Range<usize>) -> Result<()> {
        Ok(())
    }

    /// Positions (m) and velocities (m/s), world axes, of a range of bodies; empty if the session moves no centres of
    /// mass.
    ///
    /// # Errors
    ///
    /// [`crate::Error::Device`] where the device is lost.
    fn read_centres(&mut self, _bodies: Range<usize>) -> Result<Vec<(DVec3, DVec3)>> {
        Ok(Vec::new())
    }

    /// Prepares for [`Session::reduce`]: the statistics wanted, the frames of all places, the blocks that they belong
    /// to, and the spin rate, rad/s, above which a body is marked.
    ///
    /// # Errors
    ///
    /// [`crate::Error::TooManyBodies`] where memory does not suffice; [`crate::Error::Device`] where the device fails.
    fn watch(&mut self, statistics: &[Statistic], frames: &[BodyFrame], blocks: &BlockRows, fastest: f64)
    -> Result<()>;

    /// For each block the watched statistics of its bodies that did not fail, for the present state; extremes name
    /// places. The results of a block depend on its bodies alone.
    ///
    /// # Errors
    ///
    /// [`crate::Error::Device`] where the device is lost.
    fn reduce(&mut self) -> Result<Vec<Vec<Partial<f64>>>>;

    /// The places that the last [`Session::reduce`] marked.
    ///
    /// # Errors
    ///
    /// [`crate::Error::Device`] where the device is lost.
    fn marked(&mut self) -> Result<Marked>;

    /// Prepares for [`Session::gather`]: the quantities wanted, and the frames of all places. `false` if the session
    /// does not form them, so that the states must be read.
    ///
    /// # Errors
    ///
    /// [`crate::Error::Device`] where the device fails.
    #[doc(hidden)]
    fn watch_quantities(&mut self, _: &AskedOfBodies<'_>, _: &[BodyFrame], _: &BlockRows) -> Result<bool> {
        Ok(false)
    }

    /// The results that [`Session::watch_quantities`] asked for, for the present state, at `time`, s; extremes name
    /// places.
    ///
    /// # Errors
    ///
    /// [`crate::Error::Device`] where the device is lost.
    #[doc(hidden)]
    fn gather(&mut self, _time: f64) -> Result<Formed> {
        Ok(Formed::default())
    }

    /// Keeps only these bodies, ascending, in the session, which are then counted from 0. Their results do not change.
    /// Not for sessions that are watched ([`Session::watch`]).
    ///
    /// # Errors
    ///
    /// [`crate::Error::Device`] where the device is lost.
    fn keep(&mut self, bodies: &[usize]) -> Result<()>;

    /// Overwrites columns of parameters of some bodies, if torques act on them.
    ///
    /// # Errors
    ///
    /// [`crate::Error::Device`] where the device is lost.
    #[doc(hidden)]
    fn write_parameters(&mut self, _written: &Written) -> Result<()> {
        Ok(())
    }

    /// The values that sampled torques hold for its bodies, if any act.
    #[doc(hidden)]
    fn controls(&self) -> Option<&Controls> {
        None
    }
}

/// Bodies in equal steps.
pub trait SteppedSession: Session {
    /// Waits until the kernel is compiled, which happens in the background; [`SteppedSession::advance`] waits too.
    ///
    /// # Errors
    ///
    /// [`crate::Error::Shader`], and [`crate::Error::Device`] where the device is lost.
    fn ready(&mut self) -> Result<()> {
        Ok(())
    }

    /// Advances every body by `steps` steps of `dt` seconds.
    ///
    /// The result does not depend on how the steps are divided into calls. `observer` is called now and then; if it
    /// breaks, the call returns [`crate::Error::Interrupted`] and the session must be dropped.
    ///
    /// # Errors
    ///
    /// [`crate::Error::Setting`] where `dt` is not a positive number that the precision can hold;
    /// [`crate::Error::Device`] where the device is lost.
    fn advance(&mut self, dt: f64, steps: u64, observer: &mut Observer<'_>) -> Result<()>;

    /// The same as a job that the caller runs, beside those of other sessions, before it does anything else with this
    /// one. If the job is stopped, the session must be dropped. `None` if the work is not done on the host.
    ///
    /// # Errors
    ///
    /// As [`SteppedSession::advance`].
    fn job(&mut self, _dt: f64, _steps: u64) -> Result<Option<Job<'_>>> {
        Ok(None)
    }
}

/// Torque-free bodies at a time that the caller chooses. Before the first call of [`FreeSession::evaluate`], and from a
/// call of [`Session::keep`] to the next evaluation, they have no state.
pub trait FreeSession: Session {
    /// Brings every body to `time` seconds after its initial state, forwards or backwards.
    ///
    /// # Errors
    ///
    /// [`crate::Error::Setting`] where `time` is not finite; [`crate::Error::Device`] where the device is lost.
    fn evaluate(&mut self, time: f64) -> Result<()>;
}

/// Refuses times at which a closed form cannot be evaluated.
pub(crate) fn check_time(time: f64) -> Result<()> {
    let expected = "expected a finite time (s)";
    if time.is_finite() { Ok(()) } else { Err(crate::Error::Setting { field: "time", value: time, expected }) }
}

/// Always continues; for callers that do not watch.
pub fn unobserved(_: Progress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}
