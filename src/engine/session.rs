//! Sessions: bodies on an engine, which advance and are read.

use std::ops::{ControlFlow, Range};

use glam::DVec3;

use super::controlled::{Controls, Written};
use super::reduction::{AskedOfBodies, BlockRows, Formed, Marked};
use super::watch::Job;
use crate::bodies::BodyFrame;
use crate::bodies::columns::StateWords;
use crate::error::Result;
use crate::kernel::method::rk8_adaptive::Controller;
use crate::kernel::observe::{Partial, Statistic};
use crate::math::equal_steps::Interval;

/// The progress of an advance of a [`Session`]: body-steps, or with adaptive steps bodies that have arrived.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Done so far.
    pub done: u64,
    /// Of the whole call.
    pub total: u64,
}

/// Receives the progress and decides whether to continue.
pub type Observer<'a> = dyn FnMut(Progress) -> ControlFlow<()> + 'a;

/// The end of an advance of a [`Session`]: the time, and the equal steps that lead there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct End {
    /// Seconds after the initial state. Sessions of equal steps do not read it.
    pub time: f64,
    /// The steps from the session's present state. Other sessions do not read them.
    pub steps: Interval,
}

impl End {
    /// The end of an advance to `time`, s, without equal steps.
    pub fn at(time: f64) -> Self {
        Self { time, steps: Interval { steps: 0, dt: f64::NAN } }
    }

    /// The end of `steps` equal steps of `dt` seconds.
    pub fn of_steps(dt: f64, steps: u64) -> Self {
        Self { time: f64::NAN, steps: Interval { steps, dt } }
    }
}

/// Steps of one body since its initial state, if it takes adaptive ones.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StepCounts {
    /// Steps taken.
    pub accepted: u64,
    /// Steps tried again with a smaller size.
    pub rejected: u64,
}

impl StepCounts {
    /// Accepted and rejected steps together: the cost of a body.
    pub fn attempts(&self) -> u64 {
        self.accepted + self.rejected
    }
}

/// Bodies on an engine, in equal steps, in adaptive steps, or by closed forms. Any function that can fail gives [`crate::Error::Device`] where
/// the device is lost.
pub trait Session: Send {
    /// Number of bodies.
    fn body_count(&self) -> usize;

    /// Waits until the kernel is compiled, which happens in the background; [`Session::advance_to`] waits too. [`crate::Error::Shader`]
    /// where it cannot be.
    fn ready(&mut self) -> Result<()> {
        Ok(())
    }

    /// Brings every body to `end`.
    ///
    /// Equal steps are those that `end` gives; the result does not depend on how they are divided into calls.
    ///
    /// Adaptive steps end at exactly the time, except for bodies that are flagged on the way, which stay where they
    /// stopped. A time that is not later than the last one is ignored. A body's result depends neither on the bodies
    /// beside it nor on how the engine cuts the work; it does depend on the times asked for, as a step ends at each of
    /// them.
    ///
    /// Closed forms are evaluated at the time, forwards or backwards, and `observer` is not called. Before the first
    /// call, and from a call of [`Session::keep`] to the next one, their bodies have no state.
    ///
    /// `observer` is called now and then; if it breaks, the call returns [`crate::Error::Interrupted`] and the session
    /// must be dropped.
    ///
    /// # Errors
    ///
    /// [`crate::Error::Setting`] where equal steps have a `dt` that is not a positive number that the precision can
    /// hold, or other sessions a time that is not finite; [`crate::Error::Device`] where the device is lost.
    fn advance_to(&mut self, end: End, observer: &mut Observer<'_>) -> Result<()>;

    /// The same as a job that the caller runs, beside those of other sessions, before it does anything else with this
    /// one. If the job is stopped, the session must be dropped. `None` if the work is not done on the host.
    fn job_to(&mut self, _end: End) -> Result<Option<Job<'_>>> {
        Ok(None)
    }

    /// Gives bodies up that make more than `most` attempts at adaptive steps, some thousand attempts later at most, as if their steps were below
    /// the limit ([`crate::bodies::Status::StepBelowLimit`]). Only the CPU engine does so.
    fn limit_attempts(&mut self, _most: u64) {}

    /// Whether [`Session::job_to`] returns a job.
    fn has_jobs(&self) -> bool {
        false
    }

    /// The raw state of a range of bodies.
    fn read(&mut self, bodies: Range<usize>) -> Result<StateWords>;

    /// The raw state of some rows.
    fn read_rows(&mut self, rows: &[usize]) -> Result<StateWords>;

    /// Announces that the present state of a range of bodies is read next: an engine may copy it to the host meanwhile.
    fn prefetch(&mut self, _bodies: Range<usize>) -> Result<()> {
        Ok(())
    }

    /// Positions (m) and velocities (m/s), world axes, of a range of bodies; empty if the session moves no centres of
    /// mass.
    fn read_centres(&mut self, _bodies: Range<usize>) -> Result<Vec<(DVec3, DVec3)>> {
        Ok(Vec::new())
    }

    /// Prepares for [`Session::reduce`]: the statistics wanted, the frames of all places, the blocks that they belong to, and the spin
    /// rate, rad/s, above which a body is marked. [`crate::Error::TooManyBodies`] where memory does not suffice.
    fn watch(&mut self, statistics: &[Statistic], frames: &[BodyFrame], blocks: &BlockRows, fastest: f64)
    -> Result<()>;

    /// For each block the watched statistics of its bodies that did not fail, for the present state; extremes name
    /// places. The results of a block depend on its bodies alone.
    fn reduce(&mut self) -> Result<Vec<Vec<Partial<f64>>>>;

    /// The places that the last [`Session::reduce`] marked.
    fn marked(&mut self) -> Result<Marked>;

    /// Prepares for [`Session::gather`]: the quantities wanted, and the frames of all places. `false` if the session
    /// does not form them, so that the states must be read.
    #[doc(hidden)]
    fn watch_quantities(&mut self, _: &AskedOfBodies<'_>, _: &[BodyFrame], _: &BlockRows) -> Result<bool> {
        Ok(false)
    }

    /// The results that [`Session::watch_quantities`] asked for, for the present state, at `time`, s; extremes name
    /// places.
    #[doc(hidden)]
    fn gather(&mut self, _time: f64) -> Result<Formed> {
        Ok(Formed::default())
    }

    /// Keeps only these bodies, ascending, in the session, which are then counted from 0. Their results do not change.
    /// Not for sessions that are watched ([`Session::watch`]).
    fn keep(&mut self, bodies: &[usize]) -> Result<()>;

    /// Overwrites columns of parameters of some bodies, if torques act on them.
    #[doc(hidden)]
    fn write_parameters(&mut self, _written: &Written) -> Result<()> {
        Ok(())
    }

    /// The values that sampled torques hold for its bodies, if any act.
    #[doc(hidden)]
    fn controls(&self) -> Option<&Controls> {
        None
    }

    /// Makes one attempt of an adaptive step of every body that is under way between the session's time and `end`, s. `controllers`, one
    /// for each body in units of its own scale, hold the rest of that interval and the next step, and are updated by the attempt. The
    /// session's own controllers, counts and time are of no use afterwards: this call is for comparing engines attempt by attempt
    /// ([`crate::verify`]). Without adaptive steps it has no effect. [`crate::Error::Setting`] where `end` is not finite.
    ///
    /// # Panics
    ///
    /// Where there are fewer controllers than bodies.
    #[doc(hidden)]
    fn attempt(&mut self, _end: f64, _controllers: &mut [Controller<f64>]) -> Result<()> {
        Ok(())
    }

    /// The time of each body in adaptive steps, s, shape `[body_count]`, after a call that advanced them; for a body
    /// that was flagged in it, the time at which it stopped. `None` where the controllers are not in the host's memory,
    /// and under sampled torques: their intervals have parts, and each part sets anew what is left of it.
    fn reached(&self) -> Option<Vec<f64>> {
        None
    }

    /// The adaptive steps of each body so far, shape `[body_count]`; empty if the session takes none.
    fn counts(&mut self) -> Result<Vec<StepCounts>> {
        Ok(Vec::new())
    }

    /// The number of bodies that are advanced side by side and wait for the slowest of them: lanes, or a workgroup. 1
    /// without adaptive steps.
    fn side_by_side(&self) -> usize {
        1
    }

    /// Attempts including those during which bodies waited for others beside them, as a multiple of the attempts alone;
    /// 1 without attempts. It is measured if the engine renews its lists of bodies as some arrive, and otherwise
    /// follows from the counts.
    fn imbalance(&mut self) -> Result<f64> {
        Ok(1.0)
    }
}

/// Methods of a session that another one answers, which is in this field.
macro_rules! answered_by {
    ($session:ident: $(fn $name:ident($($argument:ident: $type:ty),*) -> $answer:ty;)*) => {
        $(fn $name(&mut self, $($argument: $type),*) -> $answer {
            self.$session.$name($($argument),*)
        })*
    };
}
pub(super) use answered_by;

/// Always continues; for callers that do not watch.
pub fn unobserved(_: Progress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}
