//! Sessions whose bodies take adaptive steps.

use super::watch::Job;
use super::{Observer, Session};
use crate::engine::batch::AnyBatch;
use crate::engine::load_balance::imbalance;
use crate::error::{Error, Result};
use crate::kernel::method::Method;
use crate::kernel::method::rk8_adaptive::Controller;
use crate::math::real::Scalar;
use crate::math::vector::TwoWords;
use crate::torque::Kind;

/// The refusal of a torque that is drawn step by step.
pub(crate) const NOISE_REFUSED: &str =
    "white noise is drawn for steps of equal length and has no adaptive ones: use a method with a step dt";

/// Refuses a batch with a torque that has no meaning between equal steps.
pub(crate) fn check_torques(batch: &AnyBatch) -> Result<()> {
    let noise = batch.torques().instances(Kind::WhiteNoise);
    if noise.count == 0 {
        return Ok(());
    }
    let torque = batch.torques().list().iter().position(|instance| instance.kind == Kind::WhiteNoise).unwrap_or(0);
    Err(Error::Torque {
        torque,
        model: "white-noise".into(),
        body: None,
        field: "draws_per_step".into(),
        value: batch.first_parameter(noise.first + 1),
        expected: NOISE_REFUSED.into(),
    })
}

/// The refusal of `taylor` in `f32`.
pub(crate) const TAYLOR_IN_F64: &str = "its series are formed in f64: use precision \"f64\", or method \"rk8\"";

/// The refusal of `taylor` on a GPU.
pub(crate) const TAYLOR_ON_CPU: &str = "its series are formed on the CPU: use engine \"cpu\", or method \"rk8\"";

/// The refusal of other methods where the centre of mass is part of the state.
pub(crate) const COUPLED: &str = "a torque names a position or velocity that has no closed form, which series alone integrate: use method \"taylor\"";

/// Refuses a batch whose centres of mass are part of the state.
pub(crate) fn check_uncoupled(batch: &AnyBatch, method: Method) -> Result<()> {
    if batch.torques().is_coupled() {
        Err(Error::MethodUnavailable { method, expected: COUPLED.into() })
    } else {
        Ok(())
    }
}

/// The refusal of `taylor` with equal steps.
pub(crate) const TAYLOR_ADAPTS: &str = "its steps are adaptive: use a tolerance instead of dt";

/// Refuses equal steps of a method whose steps are adaptive.
pub(crate) fn check_equal_steps(method: Method) -> Result<()> {
    if method == Method::Taylor { Err(taylor_unavailable(TAYLOR_ADAPTS)) } else { Ok(()) }
}

/// The refusal of `taylor`; `expected` says what would be valid.
pub(crate) fn taylor_unavailable(expected: &'static str) -> Error {
    Error::MethodUnavailable { method: Method::Taylor, expected: expected.into() }
}

/// Converts a number in two words of `f64` to two words of an element type.
pub(crate) fn two_words_of<T: Scalar>(value: f64, residue: f64) -> TwoWords<T> {
    let first = T::from_f64(value);
    TwoWords { value: first, residue: T::from_f64((value - first.to_f64()) + residue) }
}

/// Attempts of one body since its initial state.
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

/// A batch on an engine whose bodies take adaptive steps, by [`crate::kernel::method::rk8_adaptive`] or
/// [`crate::kernel::method::taylor`].
pub trait AdaptiveSession: Session {
    /// Brings every body to exactly `time` seconds after its initial state, except those that are flagged on the way,
    /// which stay where they stopped. A time that is not later than the last one is ignored. A body's result depends
    /// neither on the bodies beside it nor on how the engine cuts the work; it does depend on the times asked for, as a
    /// step ends at each of them.
    ///
    /// `observer` is told how many bodies have arrived; if it breaks, the call returns [`Error::Interrupted`] and the
    /// session must be dropped.
    ///
    /// # Errors
    ///
    /// [`Error::Setting`] where `time` is not finite; [`Error::Device`] where the device is lost.
    fn advance_to(&mut self, time: f64, observer: &mut Observer<'_>) -> Result<()>;

    /// The same as a job that the caller runs ([`super::SteppedSession::job`]); it counts the bodies that have arrived.
    ///
    /// # Errors
    ///
    /// As [`AdaptiveSession::advance_to`].
    fn job_to(&mut self, _time: f64) -> Result<Option<Job<'_>>> {
        Ok(None)
    }

    /// Makes one attempt of every body that is under way between the session's time and `end`, s. `controllers`, one
    /// for each body in units of its own scale, hold the rest of that interval and the next step, and are updated by
    /// the attempt. The session's own controllers, counts and time are of no use afterwards: this call is for comparing
    /// engines attempt by attempt ([`crate::verify`]).
    ///
    /// # Errors
    ///
    /// [`Error::Setting`] where `end` is not finite; [`Error::Device`] where the device is lost.
    ///
    /// # Panics
    ///
    /// Where there are fewer controllers than bodies.
    fn attempt(&mut self, end: f64, controllers: &mut [Controller<f64>]) -> Result<()>;

    /// The time of each body, s, shape `[body_count]`, after a call that advanced them; for a body that was flagged in
    /// it, the time at which it stopped. `None` where the controllers are not in the host's memory.
    fn reached(&self) -> Option<Vec<f64>> {
        None
    }

    /// The steps of each body so far, shape `[body_count]`.
    ///
    /// # Errors
    ///
    /// [`Error::Device`] where the device is lost.
    fn counts(&mut self) -> Result<Vec<StepCounts>>;

    /// The number of bodies that are advanced side by side and wait for the slowest of them: lanes, or a workgroup.
    fn side_by_side(&self) -> usize;

    /// Attempts including those during which bodies waited for others beside them, as a multiple of the attempts alone;
    /// 1 without attempts. It is measured if the engine renews its lists of bodies as some arrive, and otherwise
    /// follows from the counts.
    ///
    /// # Errors
    ///
    /// [`Error::Device`] where the device is lost.
    fn imbalance(&mut self) -> Result<f64> {
        let attempts: Vec<u64> = self.counts()?.iter().map(StepCounts::attempts).collect();
        Ok(imbalance(&attempts, self.side_by_side()))
    }
}
