//! Sessions of a device, each with a standby session of the CPU.

use std::ops::{ControlFlow, Range};
use std::sync::Arc;

use glam::DVec3;

use super::Faults;
use crate::bodies::BodyFrame;
use crate::bodies::columns::StateWords;
use crate::engine::controlled::Written;
use crate::engine::reduction::{BlockRows, Marked};
use crate::engine::standby::{Reached, Standby};
use crate::engine::watch::Job;
use crate::engine::{End, Observer, Progress, Session, StepCounts};
use crate::error::Result;
use crate::kernel::method::rk8_adaptive::Controller;
use crate::kernel::observe::{Partial, Statistic};

/// A session of a device with its standby session.
pub(super) struct GuardedSession {
    /// None after a fault.
    device: Option<Box<dyn Session>>,
    standby: Box<dyn Standby>,
    faults: Arc<Faults>,
    /// The reason, if the standby session cannot continue.
    obstacle: Option<&'static str>,
}

impl GuardedSession {
    pub fn new(
        device: Box<dyn Session>,
        standby: Box<dyn Standby>,
        faults: &Arc<Faults>,
        obstacle: Option<&'static str>,
    ) -> Self {
        Self { device: Some(device), standby, faults: Arc::clone(faults), obstacle }
    }

    /// The result of some work on the device; `None` after a fault, and then the standby session has taken over.
    fn on_device<T>(&mut self, work: impl FnOnce(&mut dyn Session) -> Result<T>) -> Result<Option<T>> {
        let Some(device) = &mut self.device else { return Ok(None) };
        let done = self.faults.unless_lost(|| work(&mut **device))?;
        if done.is_none() {
            self.device = None;
            self.obstacle.map_or_else(|| self.standby.take_over(), |obstacle| Err(self.faults.error(obstacle)))?;
        }
        Ok(done)
    }
}

/// The answer of the device, or after a fault that of the standby session.
macro_rules! either {
    ($self:ident.$name:ident($($argument:expr)?)) => {
        match $self.on_device(|device| device.$name($($argument)?))? {
            Some(said) => Ok(said),
            None => $self.standby.$name($($argument)?),
        }
    };
}

/// Reports progress that never decreases, even if work starts again.
fn onwards<'a>(told: &'a mut u64, observer: &'a mut Observer<'_>) -> impl FnMut(Progress) -> ControlFlow<()> {
    move |progress| {
        *told = progress.done.max(*told);
        observer(Progress { done: *told, ..progress })
    }
}

impl Session for GuardedSession {
    fn body_count(&self) -> usize {
        self.standby.body_count()
    }

    fn ready(&mut self) -> Result<()> {
        self.on_device(|device| device.ready()).map(drop)
    }

    fn advance_to(&mut self, end: End, observer: &mut Observer<'_>) -> Result<()> {
        let (all, has_states, mut told) = (0..self.body_count(), self.standby.has_states(), 0);
        let reached = self.on_device(|device| {
            device.advance_to(end, &mut onwards(&mut told, observer))?;
            if !has_states {
                return Ok(Reached::default());
            }
            let (states, centres) = (device.read(all.clone())?, device.read_centres(all)?);
            Ok(Reached { states, centres, counts: device.counts()? })
        })?;
        match reached {
            Some(reached) => {
                self.standby.follow(&reached, end);
                Ok(())
            }
            None => self.standby.advance_to(end, &mut onwards(&mut told, observer)),
        }
    }

    fn job_to(&mut self, end: End) -> Result<Option<Job<'_>>> {
        if self.device.is_some() { Ok(None) } else { self.standby.job_to(end) }
    }

    fn has_jobs(&self) -> bool {
        self.device.is_none() && self.standby.has_jobs()
    }

    fn read(&mut self, bodies: Range<usize>) -> Result<StateWords> {
        if self.standby.has_states() { self.standby.read(bodies) } else { either!(self.read(bodies.clone())) }
    }

    fn read_rows(&mut self, rows: &[usize]) -> Result<StateWords> {
        if self.standby.has_states() { self.standby.read_rows(rows) } else { either!(self.read_rows(rows)) }
    }

    fn prefetch(&mut self, bodies: Range<usize>) -> Result<()> {
        if !self.standby.has_states() {
            self.on_device(|device| device.prefetch(bodies))?;
        }
        Ok(())
    }

    fn read_centres(&mut self, bodies: Range<usize>) -> Result<Vec<(DVec3, DVec3)>> {
        self.standby.read_centres(bodies)
    }

    fn watch(
        &mut self,
        statistics: &[Statistic],
        frames: &[BodyFrame],
        blocks: &BlockRows,
        fastest: f64,
    ) -> Result<()> {
        self.on_device(|device| device.watch(statistics, frames, blocks, fastest))?;
        self.standby.watch(statistics, frames, blocks, fastest)
    }

    fn reduce(&mut self) -> Result<Vec<Vec<Partial<f64>>>> {
        either!(self.reduce())
    }

    fn marked(&mut self) -> Result<Marked> {
        either!(self.marked())
    }

    fn keep(&mut self, bodies: &[usize]) -> Result<()> {
        self.on_device(|device| device.keep(bodies))?;
        self.standby.keep(bodies)
    }

    fn write_parameters(&mut self, written: &Written) -> Result<()> {
        self.on_device(|device| device.write_parameters(written))?;
        self.standby.write_parameters(written)
    }

    // For comparisons of engines, which concern the device itself.
    fn attempt(&mut self, end: f64, controllers: &mut [Controller<f64>]) -> Result<()> {
        match &mut self.device {
            Some(device) => device.attempt(end, controllers),
            None => self.standby.attempt(end, controllers),
        }
    }

    fn reached(&self) -> Option<Vec<f64>> {
        if self.device.is_some() { None } else { self.standby.reached() }
    }

    fn counts(&mut self) -> Result<Vec<StepCounts>> {
        self.standby.counts()
    }

    fn side_by_side(&self) -> usize {
        self.device.as_ref().map_or_else(|| self.standby.side_by_side(), |device| device.side_by_side())
    }

    fn imbalance(&mut self) -> Result<f64> {
        either!(self.imbalance())
    }
}
