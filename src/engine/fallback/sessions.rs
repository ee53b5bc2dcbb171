//! Sessions of a device, each with one of the CPU that stands by.

use std::ops::Range;
use std::sync::Arc;

use glam::DVec3;

use super::Faults;
use crate::bodies::BodyFrame;
use crate::bodies::columns::StateWords;
use crate::engine::adaptive_session::{AdaptiveSession, StepCounts};
use crate::engine::controlled::Written;
use crate::engine::reduction::{BlockRows, Marked, Reduce};
use crate::engine::standby::{AdaptiveStandby, Standby};
use crate::engine::watch::Job;
use crate::engine::{FreeSession, Observer, Progress, Session};
use crate::error::Result;
use crate::kernel::method::rk8_adaptive::Controller;
use crate::kernel::observe::{Partial, Statistic};

/// Equal steps.
pub(super) struct GuardedSession {
    /// None after a fault.
    device: Option<Box<dyn Session>>,
    /// In the states that the device has come to.
    standby: Box<dyn Standby>,
    faults: Arc<Faults>,
    /// Why it cannot go on, where it cannot.
    obstacle: Option<&'static str>,
}

/// Adaptive steps.
pub(super) struct GuardedAdaptiveSession {
    device: Option<Box<dyn AdaptiveSession>>,
    standby: Box<dyn AdaptiveStandby>,
    faults: Arc<Faults>,
}

/// Closed forms, of which a time says everything.
pub(super) struct GuardedFreeSession {
    device: Option<Box<dyn FreeSession>>,
    standby: Box<dyn FreeSession>,
    faults: Arc<Faults>,
    /// The time that the bodies are at, s, once they have a state.
    time: Option<f64>,
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

    /// There is nothing to be brought on: the session that stands by is where the device was.
    fn left(&mut self) -> Result<()> {
        self.obstacle.map_or(Ok(()), |obstacle| Err(self.faults.error(obstacle)))
    }
}

impl GuardedAdaptiveSession {
    pub fn new(device: Box<dyn AdaptiveSession>, standby: Box<dyn AdaptiveStandby>, faults: &Arc<Faults>) -> Self {
        Self { device: Some(device), standby, faults: Arc::clone(faults) }
    }

    /// As of equal steps.
    fn left(&mut self) -> Result<()> {
        Ok(())
    }
}

impl GuardedFreeSession {
    pub fn new(device: Box<dyn FreeSession>, standby: Box<dyn FreeSession>, faults: &Arc<Faults>) -> Self {
        Self { device: Some(device), standby, faults: Arc::clone(faults), time: None }
    }

    /// Brings the session that stands by to where the device was.
    fn left(&mut self) -> Result<()> {
        self.time.map_or(Ok(()), |time| self.standby.evaluate(time))
    }
}

/// What the device makes of some work; nothing after a fault, and then the session that stands by is where the device was.
macro_rules! on_device {
    ($self:ident, $device:ident => $work:expr) => {{
        match &mut $self.device {
            None => None,
            Some($device) => {
                let faults = Arc::clone(&$self.faults);
                let done = faults.unless_lost(|| $work)?;
                if done.is_none() {
                    $self.device = None;
                    $self.left()?;
                }
                done
            }
        }
    }};
}

/// Tells of progress that does not go back where work is begun again.
fn onwards<'a>(told: &'a mut u64, observer: &'a mut Observer<'_>) -> impl FnMut(Progress) -> std::ops::ControlFlow<()> {
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
        let _: Option<()> = on_device!(self, device => device.ready());
        Ok(())
    }

    fn advance(&mut self, dt: f64, steps: u64, observer: &mut Observer<'_>) -> Result<()> {
        let (all, mut told) = (0..self.body_count(), 0);
        let done = on_device!(self, device => {
            device.advance(dt, steps, &mut onwards(&mut told, observer))?;
            Ok((device.read(all.clone())?, device.read_centres(all)?))
        });
        match done {
            Some((states, centres)) => {
                self.standby.follow(&states, &centres, (dt, steps));
                Ok(())
            }
            None => self.standby.advance(dt, steps, &mut onwards(&mut told, observer)),
        }
    }

    fn job(&mut self, dt: f64, steps: u64) -> Result<Option<Job<'_>>> {
        if self.device.is_some() { Ok(None) } else { self.standby.job(dt, steps) }
    }

    fn has_jobs(&self) -> bool {
        self.device.is_none() && self.standby.has_jobs()
    }

    // The states are on the host already.
    fn read(&mut self, bodies: Range<usize>) -> Result<StateWords> {
        self.standby.read(bodies)
    }

    fn read_centres(&mut self, bodies: Range<usize>) -> Result<Vec<(DVec3, DVec3)>> {
        self.standby.read_centres(bodies)
    }

    fn keep(&mut self, bodies: &[usize]) -> Result<()> {
        let _: Option<()> = on_device!(self, device => device.keep(bodies));
        self.standby.keep(bodies)
    }

    fn write_parameters(&mut self, written: &Written) -> Result<()> {
        let _: Option<()> = on_device!(self, device => device.write_parameters(written));
        self.standby.write_parameters(written)
    }
}

impl AdaptiveSession for GuardedAdaptiveSession {
    fn body_count(&self) -> usize {
        self.standby.body_count()
    }

    fn advance_to(&mut self, time: f64, observer: &mut Observer<'_>) -> Result<()> {
        let (all, mut told) = (0..self.body_count(), 0);
        let done = on_device!(self, device => {
            device.advance_to(time, &mut onwards(&mut told, observer))?;
            Ok((device.read(all)?, device.counts()?))
        });
        match done {
            Some((states, counts)) => {
                self.standby.follow(&states, &counts, time);
                Ok(())
            }
            None => self.standby.advance_to(time, &mut onwards(&mut told, observer)),
        }
    }

    fn job_to(&mut self, time: f64) -> Result<Option<Job<'_>>> {
        if self.device.is_some() { Ok(None) } else { self.standby.job_to(time) }
    }

    fn has_jobs(&self) -> bool {
        self.device.is_none() && self.standby.has_jobs()
    }

    // For comparisons of engines, which are of the device itself.
    fn attempt(&mut self, end: f64, controllers: &mut [Controller<f64>]) -> Result<()> {
        match &mut self.device {
            Some(device) => device.attempt(end, controllers),
            None => self.standby.attempt(end, controllers),
        }
    }

    fn read(&mut self, bodies: Range<usize>) -> Result<StateWords> {
        self.standby.read(bodies)
    }

    fn keep(&mut self, bodies: &[usize]) -> Result<()> {
        let _: Option<()> = on_device!(self, device => device.keep(bodies));
        self.standby.keep(bodies)
    }

    fn write_parameters(&mut self, written: &Written) -> Result<()> {
        let _: Option<()> = on_device!(self, device => device.write_parameters(written));
        self.standby.write_parameters(written)
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
        let of_device = on_device!(self, device => device.imbalance());
        of_device.map_or_else(|| self.standby.imbalance(), Ok)
    }
}

impl FreeSession for GuardedFreeSession {
    fn body_count(&self) -> usize {
        self.standby.body_count()
    }

    fn evaluate(&mut self, time: f64) -> Result<()> {
        self.time = None;
        if on_device!(self, device => device.evaluate(time)).is_none() {
            self.standby.evaluate(time)?;
        }
        self.time = Some(time);
        Ok(())
    }

    fn read(&mut self, bodies: Range<usize>) -> Result<StateWords> {
        let of_device = on_device!(self, device => device.read(bodies.clone()));
        of_device.map_or_else(|| self.standby.read(bodies), Ok)
    }

    fn keep(&mut self, bodies: &[usize]) -> Result<()> {
        self.time = None;
        let _: Option<()> = on_device!(self, device => device.keep(bodies));
        self.standby.keep(bodies)
    }
}

macro_rules! reduces_guarded {
    ($session:ident, $(prefetches $device:ident)?) => {
        impl Reduce for $session {
            fn watch(
                &mut self,
                statistics: &[Statistic],
                frames: &[BodyFrame],
                blocks: &BlockRows,
                fastest: f64,
            ) -> Result<()> {
                let _: Option<()> = on_device!(self, device => device.watch(statistics, frames, blocks, fastest));
                self.standby.watch(statistics, frames, blocks, fastest)
            }

            fn reduce(&mut self) -> Result<Vec<Vec<Partial<f64>>>> {
                let of_device = on_device!(self, device => device.reduce());
                of_device.map_or_else(|| self.standby.reduce(), Ok)
            }

            fn marked(&mut self) -> Result<Marked> {
                let of_device = on_device!(self, device => device.marked());
                of_device.map_or_else(|| self.standby.marked(), Ok)
            }

            $(fn prefetch(&mut self, bodies: Range<usize>) -> Result<()> {
                let _: Option<()> = on_device!(self, $device => $device.prefetch(bodies));
                Ok(())
            })?

            fn read_rows(&mut self, rows: &[usize]) -> Result<StateWords> {
                reduces_guarded!(@rows self rows $($device)?)
            }
        }
    };
    (@rows $self:ident $rows:ident) => { $self.standby.read_rows($rows) };
    (@rows $self:ident $rows:ident $device:ident) => {{
        let of_device = on_device!($self, $device => $device.read_rows($rows));
        of_device.map_or_else(|| $self.standby.read_rows($rows), Ok)
    }};
}

reduces_guarded!(GuardedSession,);
reduces_guarded!(GuardedAdaptiveSession,);
reduces_guarded!(GuardedFreeSession, prefetches device);
