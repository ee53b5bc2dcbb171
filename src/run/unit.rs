//! One group of a plan under way.

use std::ops::Range;
use std::time::Instant;

use glam::DVec3;
use rayon::prelude::*;

use super::adaptive::{AdaptiveUnit, UnitWork};
use super::flight::Flight;
use crate::batch::{BodyFrame, BodyState, StateWords, prepare_members};
use crate::engine::cpu::{Cpu, Width};
use crate::engine::{Backend, FreeSession, Observer, Progress, Session};
use crate::error::Result;
use crate::free_motion::AnyRows;
use crate::plan::{Group, Members, Treatment};
use crate::record::WallTime;
use crate::regular_precession::RegularPrecession;
use crate::scene::Scene;

/// The bodies of one group on their way through time.
pub(super) struct Unit<'p> {
    members: &'p Members,
    motion: Motion,
    flight: Option<Flight<'p>>,
}

enum Motion {
    /// `carries`: whether the session moves the centres of mass along.
    Stepped {
        session: Box<dyn Session>,
        frames: Vec<BodyFrame>,
        treatment: Treatment,
        carries: bool,
    },
    Adaptive(AdaptiveUnit),
    ClosedForm {
        session: Box<dyn FreeSession>,
        frames: Vec<BodyFrame>,
    },
    Precession {
        bodies: Vec<RegularPrecession>,
        time: f64,
    },
}

impl<'p> Unit<'p> {
    pub fn start(engine: &dyn Backend, scene: &'p Scene, group: &'p Group, wall_time: &mut WallTime) -> Result<Self> {
        let clock = Instant::now();
        let members = &group.members;
        let mut flight = None;
        let motion = match group.treatment {
            Treatment::RegularPrecession => {
                let bytes = members.len().saturating_mul(size_of::<RegularPrecession>());
                crate::memory::require(members.len(), bytes, "the constants of regular precessions")?;
                let bodies = (0..members.len())
                    .into_par_iter()
                    .map(|row| {
                        let (body, shape) = (members.body(row), group.class.shape);
                        RegularPrecession::of_body(scene.ensemble(), body, shape, scene.end())
                    })
                    .collect();
                wall_time.prepare += clock.elapsed().as_secs_f64();
                Motion::Precession { bodies, time: 0.0 }
            }
            Treatment::ClosedForm { precision } => {
                let (frames, rows) = AnyRows::prepare_members(scene.ensemble(), members, precision)?;
                wall_time.prepare += clock.elapsed().as_secs_f64();
                let clock = Instant::now();
                let session = if engine.precisions().contains(&precision) {
                    engine.start_free(rows)?
                } else {
                    Cpu::new(Width::Lanes).start_free(rows)?
                };
                wall_time.start += clock.elapsed().as_secs_f64();
                Motion::ClosedForm { session, frames }
            }
            Treatment::Adaptive { precision, steps } => {
                Motion::Adaptive(AdaptiveUnit::start(engine, scene, group, precision, steps, wall_time)?)
            }
            Treatment::Stepped { method, precision, longest_step, projected } => {
                let torques = group.class.torques.of(scene.torques());
                let (frames, batch) = prepare_members(scene.ensemble(), &torques, scene.end(), members, precision)?;
                wall_time.prepare += clock.elapsed().as_secs_f64();
                let clock = Instant::now();
                flight = Flight::start(scene, members, true)?;
                let carried = flight
                    .as_ref()
                    .filter(|flight| flight.follows() && engine.carries_centres() && !projected)
                    .and_then(|flight| flight.carried(&frames, longest_step));
                let session = match &carried {
                    Some((centres, parts)) => engine.start_carrying(batch, method, centres, *parts)?,
                    None if projected => engine.start_projected(batch, method)?,
                    None => engine.start(batch, method)?,
                };
                wall_time.start += clock.elapsed().as_secs_f64();
                if carried.is_some() {
                    flight = None;
                }
                Motion::Stepped { session, frames, treatment: group.treatment, carries: carried.is_some() }
            }
        };
        if !matches!(motion, Motion::Stepped { .. }) {
            flight = Flight::start(scene, members, false)?;
        }
        Ok(Self { members, motion, flight })
    }

    /// Brings the bodies from `time − span` to `time`, s; gives the work done ([`crate::plan::Plan::work_of`]). What is not
    /// stepped is formed only where it is `wanted`.
    pub fn advance(&mut self, time: f64, span: f64, wanted: bool, observer: &mut Observer<'_>) -> Result<u64> {
        let bodies = self.members.len() as u64;
        if let (Motion::Stepped { session, frames, treatment, .. }, Some(flight)) = (&mut self.motion, &mut self.flight)
            && flight.follows()
        {
            let interval = treatment.interval(span);
            let (total, rows) = (interval.steps.saturating_mul(bodies), 0..self.members.len());
            for step in 0..interval.steps {
                let before = step.saturating_mul(bodies);
                session.advance(interval.dt, 1, &mut |progress| {
                    observer(Progress { done: before.saturating_add(progress.done), total })
                })?;
                flight.follow(in_users_units(&session.read(rows.clone())?, frames, &rows), interval.dt);
            }
            return Ok(total);
        }
        if let Some(flight) = &mut self.flight {
            flight.advance(time - span, span);
        }
        match &mut self.motion {
            Motion::Stepped { session, treatment, .. } => {
                let interval = treatment.interval(span);
                session.advance(interval.dt, interval.steps, observer)?;
                Ok(interval.steps.saturating_mul(bodies))
            }
            Motion::Adaptive(unit) => {
                unit.advance_to(time, observer)?;
                Ok(bodies)
            }
            Motion::ClosedForm { session, .. } => {
                if wanted {
                    session.evaluate(time)?;
                }
                Ok(bodies)
            }
            Motion::Precession { time: now, .. } => {
                *now = time;
                Ok(bodies)
            }
        }
    }

    /// Bytes that were read back from a device so far.
    pub fn bytes_read(&self) -> u64 {
        match &self.motion {
            Motion::Stepped { session, .. } => session.bytes_read(),
            Motion::ClosedForm { session, .. } => session.bytes_read(),
            Motion::Adaptive(unit) => unit.bytes_read(),
            Motion::Precession { .. } => 0,
        }
    }

    /// The adaptive steps so far, where there are any.
    pub fn adaptive_work(&mut self) -> Result<Option<UnitWork>> {
        match &mut self.motion {
            Motion::Adaptive(unit) => unit.work().map(Some),
            _ => Ok(None),
        }
    }

    /// Writes where those of its bodies that are in `bodies` are, where they are stepped there.
    pub fn read_centres(&mut self, bodies: &Range<usize>, centres: &mut [Option<(DVec3, DVec3)>]) -> Result<()> {
        if let Some(flight) = &self.flight {
            flight.read(bodies, centres);
        }
        if let Motion::Stepped { session, carries: true, .. } = &mut self.motion {
            let rows = self.members.rows(bodies.clone());
            for (row, centre) in rows.clone().zip(session.read_centres(rows)?) {
                centres[self.members.body(row) - bodies.start] = Some(centre);
            }
        }
        Ok(())
    }

    /// Writes the states of those of its bodies that are in `bodies` to their places in `states`.
    pub fn read(&mut self, bodies: Range<usize>, states: &mut [BodyState]) -> Result<()> {
        let rows = self.members.rows(bodies.clone());
        if rows.is_empty() {
            return Ok(());
        }
        let found: Vec<BodyState> = match &mut self.motion {
            Motion::Stepped { session, frames, .. } => in_users_units(&session.read(rows.clone())?, frames, &rows),
            Motion::Adaptive(unit) => unit.read(&rows)?,
            Motion::ClosedForm { session, frames } => in_users_units(&session.read(rows.clone())?, frames, &rows),
            Motion::Precession { bodies, time } => bodies[rows.clone()].par_iter().map(|body| body.at(*time)).collect(),
        };
        for (row, state) in rows.zip(found) {
            states[self.members.body(row) - bodies.start] = state;
        }
        Ok(())
    }
}

fn in_users_units(words: &StateWords, frames: &[BodyFrame], rows: &Range<usize>) -> Vec<BodyState> {
    let state = |row: usize| BodyState {
        status: words.status[row - rows.start],
        ..frames[row].body_state(words.combined(row - rows.start))
    };
    rows.clone().into_par_iter().map(state).collect()
}
