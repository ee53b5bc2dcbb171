//! Sessions of bodies under sampled torques: sessions of engines, which are stopped at each change of what is held.

use std::ops::Range;

use super::{Controls, Written};
use crate::bodies::columns::StateWords;
use crate::engine::adaptive_session::{AdaptiveSession, StepCounts};
use crate::engine::reduction::reduces_within;
use crate::engine::watch::{Job, Watch, watched};
use crate::engine::{Observer, Progress, Session, check_time};
use crate::error::{Error, Result};
use crate::kernel::method::rk8_adaptive::Controller;
use crate::math::equal_steps::steps_over;

/// Equal steps under sampled torques: a call takes steps of `longest_step` at most, which end at each change.
struct ControlledSession {
    inner: Box<dyn Session>,
    controls: Controls,
    longest_step: f64,
    /// The time that the state stands at, s, and what its sum has lost.
    time: f64,
    residue: f64,
    /// What went wrong where nobody could be told.
    error: Option<Error>,
}

/// Steps of the bodies' own under sampled torques, which end at each change.
struct ControlledAdaptiveSession {
    inner: Box<dyn AdaptiveSession>,
    controls: Controls,
    time: f64,
    error: Option<Error>,
}

impl Controls {
    /// A session of bodies that these are of.
    pub(crate) fn around(controls: Option<Self>, inner: Box<dyn Session>, longest_step: f64) -> Box<dyn Session> {
        match controls {
            Some(controls) => {
                Box::new(ControlledSession { inner, controls, longest_step, time: 0.0, residue: 0.0, error: None })
            }
            None => inner,
        }
    }

    /// The same of adaptive steps.
    pub(crate) fn around_adaptive(controls: Option<Self>, inner: Box<dyn AdaptiveSession>) -> Box<dyn AdaptiveSession> {
        match controls {
            Some(controls) => Box::new(ControlledAdaptiveSession { inner, controls, time: 0.0, error: None }),
            None => inner,
        }
    }
}

impl ControlledSession {
    /// The time after some steps: the sum of all of them (Kahan), as over 1e7 outputs a plain one would miss samples.
    fn end_of(&mut self, dt: f64, steps: u64) -> f64 {
        let span = dt * steps as f64 + self.residue;
        let end = self.time + span;
        self.residue = span - (end - self.time);
        end
    }

    /// Brings the bodies to `end`, s; `steps` takes equal steps of the inner session and says whether to go on.
    fn advance_through(
        &mut self,
        end: f64,
        mut steps: impl FnMut(&mut dyn Session, f64, u64) -> Result<bool>,
    ) -> Result<()> {
        while self.time < end {
            let next = self.controls.schedule.part(self.time, end);
            let part = steps_over(next - self.time, self.longest_step);
            if !steps(&mut *self.inner, part.dt, part.steps)? {
                return Ok(());
            }
            self.time = next;
            let Self { inner, controls, .. } = self;
            let written = controls.come_to(next, || inner.read(0..inner.body_count()))?;
            written.iter().try_for_each(|written| inner.write_parameters(written))?;
        }
        Ok(())
    }

    fn sound(&mut self) -> Result<()> {
        self.error.take().map_or(Ok(()), Err)
    }
}

impl Session for ControlledSession {
    fn body_count(&self) -> usize {
        self.inner.body_count()
    }

    fn ready(&mut self) -> Result<()> {
        self.inner.ready()
    }

    fn advance(&mut self, dt: f64, steps: u64, observer: &mut Observer<'_>) -> Result<()> {
        self.sound()?;
        let (bodies, span) = (self.inner.body_count() as u64, dt * steps as f64);
        let of_body = self.controls.schedule.steps(self.time, self.time + span, self.longest_step);
        let total = of_body.saturating_mul(bodies);
        if self.inner.has_jobs() {
            // One thread watches over all parts.
            let job = self.job(dt, steps)?;
            let work = |watch: &Watch| job.into_iter().for_each(|job| job(watch));
            watched(work, total, observer).map_err(|done| Error::Interrupted { steps: done / bodies.max(1) })?;
            return self.sound();
        }
        let end = self.end_of(dt, steps);
        let mut before = 0_u64;
        self.advance_through(end, |inner, dt, steps| {
            inner.advance(dt, steps, &mut |progress| {
                observer(Progress { done: before.saturating_add(progress.done), total })
            })?;
            before = before.saturating_add(steps.saturating_mul(bodies));
            Ok(true)
        })
    }

    fn job(&mut self, dt: f64, steps: u64) -> Result<Option<Job<'_>>> {
        self.sound()?;
        if !self.inner.has_jobs() {
            return Ok(None);
        }
        let end = self.end_of(dt, steps);
        Ok(Some(Box::new(move |watch: &Watch| {
            let done = self.advance_through(end, |inner, dt, steps| {
                if let Some(job) = inner.job(dt, steps)? {
                    job(watch);
                }
                Ok(watch.goes_on())
            });
            self.error = done.err();
        })))
    }

    fn has_jobs(&self) -> bool {
        self.inner.has_jobs()
    }

    fn read(&mut self, bodies: Range<usize>) -> Result<StateWords> {
        self.sound()?;
        self.inner.read(bodies)
    }

    fn write_parameters(&mut self, written: &Written) -> Result<()> {
        self.inner.write_parameters(written)
    }

    fn controls(&self) -> Option<&Controls> {
        Some(&self.controls)
    }

    fn keep(&mut self, bodies: &[usize]) -> Result<()> {
        self.controls.keep(bodies);
        self.inner.keep(bodies)
    }

    fn read_centres(&mut self, bodies: Range<usize>) -> Result<Vec<(glam::DVec3, glam::DVec3)>> {
        self.inner.read_centres(bodies)
    }
}

impl ControlledAdaptiveSession {
    /// Brings the bodies to `end`, s; `steps` brings those of the inner session to a time and says whether to go on.
    fn advance_through(
        &mut self,
        end: f64,
        mut steps: impl FnMut(&mut dyn AdaptiveSession, f64) -> Result<bool>,
    ) -> Result<()> {
        while self.time < end {
            let next = self.controls.schedule.part(self.time, end);
            if !steps(&mut *self.inner, next)? {
                return Ok(());
            }
            self.time = next;
            let Self { inner, controls, .. } = self;
            let written = controls.come_to(next, || inner.read(0..inner.body_count()))?;
            written.iter().try_for_each(|written| inner.write_parameters(written))?;
        }
        Ok(())
    }

    fn sound(&mut self) -> Result<()> {
        self.error.take().map_or(Ok(()), Err)
    }
}

impl AdaptiveSession for ControlledAdaptiveSession {
    fn body_count(&self) -> usize {
        self.inner.body_count()
    }

    fn advance_to(&mut self, time: f64, observer: &mut Observer<'_>) -> Result<()> {
        self.sound()?;
        check_time(time)?;
        let (start, total) = (self.time, self.inner.body_count() as u64);
        if self.inner.has_jobs() {
            let job = self.job_to(time)?;
            let work = |watch: &Watch| job.into_iter().for_each(|job| job(watch));
            watched(work, total, observer).map_err(|_| Error::Interrupted { steps: 0 })?;
            return self.sound();
        }
        self.advance_through(time, |inner, next| {
            // Bodies arrive at every change; told is how much of the way lies behind them.
            let part = (next - start) / (time - start);
            inner.advance_to(next, &mut |_| observer(Progress { done: (total as f64 * part) as u64, total }))?;
            Ok(true)
        })
    }

    fn job_to(&mut self, time: f64) -> Result<Option<Job<'_>>> {
        self.sound()?;
        check_time(time)?;
        if !self.inner.has_jobs() {
            return Ok(None);
        }
        Ok(Some(Box::new(move |watch: &Watch| {
            let done = self.advance_through(time, |inner, next| {
                // Bodies arrive at every change, and are counted once.
                let beside = watch.beside();
                if let Some(job) = inner.job_to(next)? {
                    job(&beside);
                }
                Ok(watch.goes_on())
            });
            watch.add(self.inner.body_count() as u64);
            self.error = done.err();
        })))
    }

    fn has_jobs(&self) -> bool {
        self.inner.has_jobs()
    }

    fn attempt(&mut self, end: f64, controllers: &mut [Controller<f64>]) -> Result<()> {
        self.inner.attempt(end, controllers)
    }

    fn read(&mut self, bodies: Range<usize>) -> Result<StateWords> {
        self.sound()?;
        self.inner.read(bodies)
    }

    fn write_parameters(&mut self, written: &Written) -> Result<()> {
        self.inner.write_parameters(written)
    }

    fn controls(&self) -> Option<&Controls> {
        Some(&self.controls)
    }

    fn read_centres(&mut self, bodies: Range<usize>) -> Result<Vec<(glam::DVec3, glam::DVec3)>> {
        self.inner.read_centres(bodies)
    }

    fn keep(&mut self, bodies: &[usize]) -> Result<()> {
        self.controls.keep(bodies);
        self.inner.keep(bodies)
    }

    fn counts(&mut self) -> Result<Vec<StepCounts>> {
        self.sound()?;
        self.inner.counts()
    }

    fn side_by_side(&self) -> usize {
        self.inner.side_by_side()
    }

    fn imbalance(&mut self) -> Result<f64> {
        self.inner.imbalance()
    }
}

reduces_within!(ControlledSession, inner, sound);
reduces_within!(ControlledAdaptiveSession, inner, sound);
