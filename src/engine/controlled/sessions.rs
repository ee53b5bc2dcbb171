//! Sessions of bodies under sampled torques: sessions of engines that stop at each change of a held value.

use std::ops::Range;

use glam::DVec3;

use super::{Controls, Written};
use crate::bodies::BodyFrame;
use crate::bodies::columns::StateWords;
use crate::engine::adaptive_session::{AdaptiveSession, StepCounts};
use crate::engine::reduction::{AskedOfBodies, BlockRows, Formed, Marked};
use crate::engine::watch::{Job, Watch, watched};
use crate::engine::{Observer, Progress, Session, SteppedSession, check_time};
use crate::error::{Error, Result};
use crate::kernel::method::rk8_adaptive::Controller;
use crate::kernel::observe::{Partial, Statistic};
use crate::math::equal_steps::steps_over;

/// A session whose steps end at each change.
struct Controlled<S: ?Sized> {
    inner: Box<S>,
    controls: Controls,
    /// The longest equal step, s.
    longest_step: f64,
    /// The time of the state, s, and the rounding error of its sum.
    time: f64,
    residue: f64,
    /// An error in a job, which cannot return it.
    error: Option<Error>,
}

impl Controls {
    /// A session of the bodies of these controls in equal steps of at most `longest_step` s.
    pub(crate) fn around(
        controls: Option<Self>,
        inner: Box<dyn SteppedSession>,
        longest_step: f64,
    ) -> Box<dyn SteppedSession> {
        match controls {
            Some(controls) => Box::new(Controlled::new(inner, controls, longest_step)),
            None => inner,
        }
    }

    /// The same for adaptive steps.
    pub(crate) fn around_adaptive(controls: Option<Self>, inner: Box<dyn AdaptiveSession>) -> Box<dyn AdaptiveSession> {
        match controls {
            Some(controls) => Box::new(Controlled::new(inner, controls, f64::INFINITY)),
            None => inner,
        }
    }
}

impl<S: Session + ?Sized> Controlled<S> {
    fn new(inner: Box<S>, controls: Controls, longest_step: f64) -> Self {
        Self { inner, controls, longest_step, time: 0.0, residue: 0.0, error: None }
    }

    /// Brings the bodies to `end`, s; `advance` brings those of the inner session from one time to another and says
    /// whether to continue.
    fn advance_through(&mut self, end: f64, mut advance: impl FnMut(&mut S, Range<f64>) -> Result<bool>) -> Result<()> {
        while self.time < end {
            let next = self.controls.schedule.part(self.time, end);
            if !advance(&mut self.inner, self.time..next)? {
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

impl<S: Session + ?Sized> Session for Controlled<S> {
    fn body_count(&self) -> usize {
        self.inner.body_count()
    }

    fn has_jobs(&self) -> bool {
        self.inner.has_jobs()
    }

    fn read(&mut self, bodies: Range<usize>) -> Result<StateWords> {
        self.sound()?;
        self.inner.read(bodies)
    }

    fn read_rows(&mut self, rows: &[usize]) -> Result<StateWords> {
        self.sound()?;
        self.inner.read_rows(rows)
    }

    fn prefetch(&mut self, bodies: Range<usize>) -> Result<()> {
        self.inner.prefetch(bodies)
    }

    fn read_centres(&mut self, bodies: Range<usize>) -> Result<Vec<(DVec3, DVec3)>> {
        self.inner.read_centres(bodies)
    }

    fn watch(
        &mut self,
        statistics: &[Statistic],
        frames: &[BodyFrame],
        blocks: &BlockRows,
        fastest: f64,
    ) -> Result<()> {
        self.inner.watch(statistics, frames, blocks, fastest)
    }

    fn reduce(&mut self) -> Result<Vec<Vec<Partial<f64>>>> {
        self.sound()?;
        self.inner.reduce()
    }

    fn marked(&mut self) -> Result<Marked> {
        self.inner.marked()
    }

    fn watch_quantities(
        &mut self,
        asked: &AskedOfBodies<'_>,
        frames: &[BodyFrame],
        blocks: &BlockRows,
    ) -> Result<bool> {
        self.inner.watch_quantities(asked, frames, blocks)
    }

    fn gather(&mut self, time: f64) -> Result<Formed> {
        self.sound()?;
        self.inner.gather(time)
    }

    fn keep(&mut self, bodies: &[usize]) -> Result<()> {
        self.controls.keep(bodies);
        self.inner.keep(bodies)
    }

    fn write_parameters(&mut self, written: &Written) -> Result<()> {
        self.inner.write_parameters(written)
    }

    fn controls(&self) -> Option<&Controls> {
        Some(&self.controls)
    }
}

impl Controlled<dyn SteppedSession> {
    /// The time after some steps, by a compensated sum (Kahan): over 1e7 outputs a plain sum would miss samples.
    fn end_of(&mut self, dt: f64, steps: u64) -> f64 {
        let span = dt * steps as f64 + self.residue;
        let end = self.time + span;
        self.residue = span - (end - self.time);
        end
    }
}

impl SteppedSession for Controlled<dyn SteppedSession> {
    fn ready(&mut self) -> Result<()> {
        self.inner.ready()
    }

    fn advance(&mut self, dt: f64, steps: u64, observer: &mut Observer<'_>) -> Result<()> {
        self.sound()?;
        let (bodies, span, longest_step) = (self.inner.body_count() as u64, dt * steps as f64, self.longest_step);
        let of_body = self.controls.schedule.steps(self.time, self.time + span, longest_step);
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
        self.advance_through(end, |inner, times| {
            let part = steps_over(times.end - times.start, longest_step);
            inner.advance(part.dt, part.steps, &mut |progress| {
                observer(Progress { done: before.saturating_add(progress.done), total })
            })?;
            before = before.saturating_add(part.steps.saturating_mul(bodies));
            Ok(true)
        })
    }

    fn job(&mut self, dt: f64, steps: u64) -> Result<Option<Job<'_>>> {
        self.sound()?;
        if !self.inner.has_jobs() {
            return Ok(None);
        }
        let (end, longest_step) = (self.end_of(dt, steps), self.longest_step);
        Ok(Some(Box::new(move |watch: &Watch| {
            let done = self.advance_through(end, |inner, times| {
                let part = steps_over(times.end - times.start, longest_step);
                if let Some(job) = inner.job(part.dt, part.steps)? {
                    job(watch);
                }
                Ok(watch.goes_on())
            });
            self.error = done.err();
        })))
    }
}

impl AdaptiveSession for Controlled<dyn AdaptiveSession> {
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
        self.advance_through(time, |inner, times| {
            // Bodies arrive at every change, so the report is the fraction of the interval behind them.
            let part = (times.end - start) / (time - start);
            inner.advance_to(times.end, &mut |_| observer(Progress { done: (total as f64 * part) as u64, total }))?;
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
            let done = self.advance_through(time, |inner, times| {
                // Bodies arrive at every change, and are counted once.
                let beside = watch.beside();
                if let Some(job) = inner.job_to(times.end)? {
                    job(&beside);
                }
                Ok(watch.goes_on())
            });
            watch.add(self.inner.body_count() as u64);
            self.error = done.err();
        })))
    }

    fn attempt(&mut self, end: f64, controllers: &mut [Controller<f64>]) -> Result<()> {
        self.inner.attempt(end, controllers)
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
