//! An engine whose work continues on the CPU after a fault of its device.
//!
//! Each session of the device has a session of the CPU with the same columns beside it. After each call that moves the
//! bodies their states are copied to the host. If the device fails during a call, the CPU repeats the call from the
//! states before it, at the same time and step: phases, draws of noise and the values of sampled torques are those of
//! the device's own next step. The caller sees no difference, and no output is delivered or counted twice. One fault
//! ends all work on the device.

mod centres;
mod sessions;

use std::sync::{Arc, Mutex, PoisonError};

use super::batch::AnyBatch;
use super::cpu::Cpu;
use super::standby::Standby;
use super::{Backend, Description, Session};
use crate::bodies::memory;
use crate::error::{Error, Result};
use crate::kernel::free_motion::AnyRows;
use crate::kernel::method::Method;
use crate::math::{Precision, Width};
use crate::scene::AdaptiveSteps;
use crate::torque::force::carried::Carried;
use centres::WithCentres;
use sessions::GuardedSession;

/// What happens to a run whose device is lost, hangs, has no memory left or fails otherwise.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Fallback {
    /// It ends with an error.
    #[default]
    None,
    /// It continues on the CPU.
    Cpu,
}

/// A fault of a device, after which the work continued on another engine ([`super::Engine::with_fallback`]).
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "study", derive(serde::Serialize))]
#[non_exhaustive]
pub struct DeviceFault {
    /// Name of the adapter.
    pub adapter: String,
    /// What went wrong, in words.
    pub reason: String,
    /// The engine that continued, in words.
    pub engine: String,
}

/// The first fault of an engine's device; later ones are its consequences.
#[derive(Debug, Default)]
struct Faults(Mutex<Option<DeviceFault>>);

impl Faults {
    fn first(&self) -> Option<DeviceFault> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn is_lost(&self) -> bool {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).is_some()
    }

    /// The error of a run that cannot continue.
    fn error(&self, obstacle: &str) -> Error {
        let (adapter, reason) = self.first().map(|fault| (fault.adapter, fault.reason)).unwrap_or_default();
        Error::Device { adapter, reason: format!("{reason}; {obstacle}") }
    }

    /// Notes an error that is a fault of the device; returns any other.
    fn note(&self, error: Error) -> Result<()> {
        let (adapter, reason) = match error {
            Error::Device { adapter, reason } => (adapter, reason),
            Error::DeviceMemory { adapter, needed, .. } => (adapter, format!("no {needed} bytes free")),
            error => return Err(error),
        };
        let engine = Cpu::new(Width::Lanes).description().name;
        let mut first = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        first.get_or_insert(DeviceFault { adapter, reason, engine });
        Ok(())
    }

    /// The result of some work on the device; `None` if it fails or has failed before.
    fn unless_lost<T>(&self, work: impl FnOnce() -> Result<T>) -> Result<Option<T>> {
        if self.is_lost() {
            return Ok(None);
        }
        match work() {
            Ok(done) => Ok(Some(done)),
            Err(error) => self.note(error).map(|()| None),
        }
    }
}

/// An engine with the CPU standing by for what runs in shaders.
pub(super) struct Guarded {
    inner: Arc<dyn Backend>,
    cpu: Cpu,
    faults: Arc<Faults>,
}

impl Guarded {
    pub fn new(inner: Arc<dyn Backend>) -> Self {
        Self { inner, cpu: Cpu::new(Width::Lanes), faults: Arc::default() }
    }

    /// A copy of a batch's columns for the host.
    fn copy(batch: &AnyBatch) -> Result<AnyBatch> {
        memory::require(
            batch.body_count(),
            batch.bytes(),
            "what the CPU keeps to go on with after a fault of the device",
        )?;
        Ok(batch.clone())
    }

    /// A session on the device, made by `start`, with `standby` beside it; `obstacle` is the reason if that one cannot
    /// continue.
    fn guarded(
        &self,
        standby: Box<dyn Standby>,
        obstacle: Option<&'static str>,
        start: impl FnOnce() -> Result<Box<dyn Session>>,
    ) -> Result<Box<dyn Session>> {
        match (self.faults.unless_lost(start)?, obstacle) {
            (Some(device), _) => Ok(Box::new(GuardedSession::new(device, standby, &self.faults, obstacle))),
            (None, None) => Ok(standby),
            (None, Some(obstacle)) => Err(self.faults.error(obstacle)),
        }
    }
}

/// The reason why the CPU does not carry the centres of mass of bodies whose axes do not turn at I⁻¹ m: only the
/// device's kernel knows their rate.
const NOT_RIGID: &str =
    "the run cannot go on on the CPU, as the device moved centres of mass along bodies that are not rigid";

/// Series, which no device forms, and tapped steps, which compare engines, have no standby.
impl Backend for Guarded {
    fn inner(&self) -> Option<&dyn Backend> {
        Some(&*self.inner)
    }

    fn description(&self) -> Description {
        self.inner.description()
    }

    fn precisions(&self) -> &[Precision] {
        self.inner.precisions()
    }

    fn fault(&self) -> Option<DeviceFault> {
        self.faults.first()
    }

    fn start(&self, batch: AnyBatch, method: Method) -> Result<Box<dyn Session>> {
        if !self.inner.runs_shaders(batch.precision()) {
            return self.inner.start(batch, method);
        }
        let standby = self.cpu.stand_by(Self::copy(&batch)?, method)?;
        self.guarded(standby, None, || self.inner.start(batch, method))
    }

    fn start_projected(&self, batch: AnyBatch, method: Method) -> Result<Box<dyn Session>> {
        if !self.inner.runs_shaders(Precision::F64) {
            return self.inner.start_projected(batch, method);
        }
        let standby = self.cpu.stand_by_projected(Self::copy(&batch)?, method)?;
        self.guarded(standby, None, || self.inner.start_projected(batch, method))
    }

    fn start_carrying(
        &self,
        batch: AnyBatch,
        method: Method,
        centres: &[Carried],
        parts: u32,
    ) -> Result<Box<dyn Session>> {
        if !self.inner.runs_shaders(batch.precision()) {
            return self.inner.start_carrying(batch, method, centres, parts);
        }
        let obstacle = (!batch.torques().is_rigid()).then_some(NOT_RIGID);
        let standby = WithCentres::new(self.cpu.stand_by(Self::copy(&batch)?, method)?, &batch, centres);
        self.guarded(Box::new(standby), obstacle, || self.inner.start_carrying(batch, method, centres, parts))
    }

    fn start_free(&self, rows: AnyRows) -> Result<Box<dyn Session>> {
        if !self.inner.runs_shaders(rows.precision()) {
            return self.inner.start_free(rows);
        }
        let standby = self.cpu.stand_by_free(rows.clone());
        self.guarded(standby, None, || self.inner.start_free(rows))
    }

    fn start_adaptive(&self, batch: AnyBatch, steps: AdaptiveSteps) -> Result<Box<dyn Session>> {
        if !self.inner.runs_shaders(batch.precision()) {
            return self.inner.start_adaptive(batch, steps);
        }
        let standby = self.cpu.stand_by_adaptive(Self::copy(&batch)?, steps)?;
        self.guarded(standby, None, || self.inner.start_adaptive(batch, steps))
    }
}
