//! Sessions of bodies under sampled torques: sessions of engines that stop at each change of a held value.

use std::ops::Range;

use glam::DVec3;

use super::{Controls, Written};
use crate::bodies::BodyFrame;
use crate::bodies::columns::StateWords;
use crate::engine::checks::check_time;
use crate::engine::reduction::{AskedOfBodies, BlockRows, Formed, Marked};
use crate::engine::session::answered_by;
use crate::engine::watch::{Job, Watch, watched};
use crate::engine::{End, Observer, Progress, Session, StepCounts};
use crate::error::{Error, Result};
use crate::kernel::method::rk8_adaptive::Controller;
use crate::kernel::observe::{Partial, Statistic};
use crate::math::equal_steps::{Interval, steps_over};

/// A session whose steps end at each change.
struct Controlled {
    inner: Box<dyn Session>,
    controls: Controls,
    /// The longest equal step, s; `None` for adaptive steps.
    longest_step: Option<f64>,
    /// The time of the state, s, and the rounding error of its sum.
    time: f64,
    residue: f64,
    /// An error in a job, which cannot return it.
    error: Option<Error>,
}

impl Controls {
    /// A session of the bodies of these controls, in equal steps of at most `longest_step` s or in adaptive ones.
    pub(crate) fn around(
        controls: Option<Self>,
        inner: Box<dyn Session>,
        longest_step: Option<f64>,
    ) -> Box<dyn Session> {
        match controls {
            Some(controls) => {
                Box::new(Controlled { inner, controls, longest_step, time: 0.0, residue: 0.0, error: None })
            }
            None => inner,
        }
    }
}

impl Controlled {
    /// The time, s, at the end of an advance. That of equal steps is a compensated sum (Kahan), as over 1e7 outputs a
    /// plain one would miss samples.
    fn end_of(&mut self, End { time, steps: Interval { steps, dt } }: End) -> Result<f64> {
        if self.longest_step.is_none() {
            return check_time(time).map(|()| time);
        }
        let span = dt * steps as f64 + self.residue;
        let end = self.time + span;
        self.residue = span - (end - self.time);
        Ok(end)
    }

    /// Brings the bodies to `end`, s; `advance` brings those of the inner session to the end of a part and says whether
    /// to continue.
    fn advance_through(
        &mut self,
        end: f64,
        mut advance: impl FnMut(&mut dyn Session, End) -> Result<bool>,
    ) -> Result<()> {
        while self.time < end {
            let next = self.controls.schedule.part(self.time, end);
            let part = match self.longest_step {
                Some(longest_step) => End { time: next, steps: steps_over(next - self.time, longest_step) },
                None => End::at(next),
            };
            if !advance(&mut *self.inner, part)? {
                return Ok(());
            }
            self.time = next;
            let Self { inner, controls, .. } = self;
            let written = controls.come_to(next, || inner.read(0..inner.body_count()))?;
            written.iter().try_for_each(|written| inner.write_parameters(written))?;
        }
        Ok(())
    }

    /// The same by jobs of the inner session.
    fn work(&mut self, end: f64, watch: &Watch) {
        let adapts = self.longest_step.is_none();
        let done = self.advance_through(end, |inner, part| {
            // Bodies arrive at every change, and are counted once.
            let beside = watch.beside();
            if let Some(job) = inner.job_to(part)? {
                job(if adapts { &beside } else { watch });
            }
            Ok(watch.goes_on())
        });
        if adapts {
            watch.add(self.inner.body_count() as u64);
        }
        self.error = done.err();
    }

    fn sound(&mut self) -> Result<()> {
        self.error.take().map_or(Ok(()), Err)
    }
}

impl Session for Controlled {
    fn body_count(&self) -> usize {
        self.inner.body_count()
    }

    fn advance_to(&mut self, end: End, observer: &mut Observer<'_>) -> Result<()> {
        self.sound()?;
        let (start, end, longest_step) = (self.time, self.end_of(end)?, self.longest_step);
        let bodies = self.inner.body_count() as u64;
        let of_body = longest_step.map_or(1, |longest_step| self.controls.schedule.steps(start, end, longest_step));
        let total = of_body.saturating_mul(bodies);
        if self.inner.has_jobs() {
            // One thread watches over all parts.
            watched(|watch| self.work(end, watch), total, observer)
                .map_err(|done| Error::Interrupted { steps: longest_step.map_or(0, |_| done / bodies.max(1)) })?;
            return self.sound();
        }
        let mut before = 0_u64;
        self.advance_through(end, |inner, part| {
            inner.advance_to(part, &mut |progress| {
                let done = match longest_step {
                    Some(_) => before.saturating_add(progress.done),
                    // Bodies arrive at every change, so the report is the fraction of the interval behind them.
                    None => (total as f64 * ((part.time - start) / (end - start))) as u64,
                };
                observer(Progress { done, total })
            })?;
            before = before.saturating_add(part.steps.steps.saturating_mul(bodies));
            Ok(true)
        })
    }

    fn job_to(&mut self, end: End) -> Result<Option<Job<'_>>> {
        self.sound()?;
        if !self.inner.has_jobs() {
            return Ok(None);
        }
        let end = self.end_of(end)?;
        Ok(Some(Box::new(move |watch: &Watch| self.work(end, watch))))
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

    fn reduce(&mut self) -> Result<Vec<Vec<Partial<f64>>>> {
        self.sound()?;
        self.inner.reduce()
    }

    fn gather(&mut self, time: f64) -> Result<Formed> {
        self.sound()?;
        self.inner.gather(time)
    }

    fn keep(&mut self, bodies: &[usize]) -> Result<()> {
        self.controls.keep(bodies);
        self.inner.keep(bodies)
    }

    fn controls(&self) -> Option<&Controls> {
        Some(&self.controls)
    }

    fn counts(&mut self) -> Result<Vec<StepCounts>> {
        self.sound()?;
        self.inner.counts()
    }

    fn side_by_side(&self) -> usize {
        self.inner.side_by_side()
    }

    answered_by! {
        inner:
        fn prefetch(bodies: Range<usize>) -> Result<()>;
        fn read_centres(bodies: Range<usize>) -> Result<Vec<(DVec3, DVec3)>>;
        fn watch(statistics: &[Statistic], frames: &[BodyFrame], blocks: &BlockRows, fastest: f64) -> Result<()>;
        fn marked() -> Result<Marked>;
        fn watch_quantities(asked: &AskedOfBodies<'_>, frames: &[BodyFrame], blocks: &BlockRows) -> Result<bool>;
        fn write_parameters(written: &Written) -> Result<()>;
        fn attempt(end: f64, controllers: &mut [Controller<f64>]) -> Result<()>;
        fn imbalance() -> Result<f64>;
    }
}
