//! One group of a plan under way.

mod reduction;

use std::borrow::Cow;
use std::ops::{ControlFlow, Range};
use std::time::Instant;

use glam::DVec3;

use super::OutputState;
use super::reading::{FormStates, FramesAt, TASK, WriteState, each_in_lanes, scatter};
use crate::bodies::Blocks;
use crate::bodies::Ensemble;
use crate::bodies::Members;
use crate::bodies::Status;
use crate::bodies::columns::StateWords;
use crate::bodies::{BodyFrame, BodyState};
use crate::engine::batch::prepare_members;
use crate::engine::controlled::Controls;
use crate::engine::cpu::Cpu;
use crate::engine::watch::{Job, Watch};
use crate::engine::{Backend, FreeSession, Observer, Progress, Session, SteppedSession};
use crate::error::{Error, Result};
use crate::kernel::free_motion::{AnyRows, scaled_body};
use crate::math::Precision;
use crate::math::Width;
use crate::math::parallel;
use crate::plan::{Group, Treatment};
use crate::record::WallTime;
use crate::run::adaptive_group::{AdaptiveGroupRun, GroupWork};
use crate::run::evaluated_when_read::{EvaluatedWhenRead, FreeForm};
use crate::run::kept::Kept;
use crate::run::stepped_translation::SteppedTranslation;
use crate::scene::{Part, Scene};
use crate::torque::Torque;
use crate::torque::control::Schedule;

/// The run of one group of bodies.
pub(super) struct GroupRun<'p> {
    members: &'p Members,
    /// The rows after the last of each block of bodies.
    ends: Vec<usize>,
    motion: Motion<'p>,
    /// The rows that its session still has; a group in adaptive steps keeps its own.
    kept: Kept,
    /// Equal steps saved because bodies were left out.
    spared: u64,
    stepped_translation: Option<SteppedTranslation<'p>>,
    ensemble: &'p Ensemble,
    torques: &'p [Torque],
    /// Whether moments of inertia change in time.
    varies: bool,
    /// The times at which sampled torques change their values, if any act.
    schedule: Option<Schedule>,
    /// The time of the last state, s.
    time: f64,
    /// Wall time for forming bodies as they were read, s, since it was last taken.
    formed: f64,
}

enum Motion<'p> {
    /// `carries`: whether the session moves the centres of mass.
    Stepped {
        session: Box<dyn SteppedSession>,
        frames: Vec<BodyFrame>,
        treatment: Treatment,
        carries: bool,
    },
    Adaptive(AdaptiveGroupRun),
    ClosedForm {
        session: Box<dyn FreeSession>,
        frames: Vec<BodyFrame>,
    },
    /// The same for bodies that are read once.
    EvaluatedWhenRead(EvaluatedWhenRead<'p>),
}

impl Motion<'_> {
    /// Whether centres of mass are part of the state.
    fn is_coupled(&self) -> bool {
        matches!(self, Motion::Adaptive(group_run) if group_run.is_coupled())
    }

    /// The engine's session, if there is one.
    fn session(&self) -> Option<&dyn Session> {
        match self {
            Motion::Stepped { session, .. } => Some(&**session),
            Motion::ClosedForm { session, .. } => Some(&**session),
            Motion::Adaptive(group_run) => Some(group_run.session()),
            Motion::EvaluatedWhenRead(_) => None,
        }
    }

    /// The frames of the group's rows; empty if they are not kept.
    fn frames(&self) -> &[BodyFrame] {
        match self {
            Motion::Stepped { frames, .. } | Motion::ClosedForm { frames, .. } => frames,
            Motion::Adaptive(group_run) => group_run.frames(),
            Motion::EvaluatedWhenRead(_) => &[],
        }
    }

    /// The engine's session, if there is one, and the frames of the group's rows.
    fn session_mut(&mut self) -> Option<(&mut dyn Session, &[BodyFrame])> {
        match self {
            Motion::Stepped { session, frames, .. } => Some((&mut **session, frames)),
            Motion::ClosedForm { session, frames } => Some((&mut **session, frames)),
            Motion::Adaptive(group_run) => Some(group_run.session_mut()),
            Motion::EvaluatedWhenRead(_) => None,
        }
    }
}

impl<'p> GroupRun<'p> {
    /// Prepares the bodies. `once`: all states are wanted, at one time only.
    pub fn start(
        engine: &dyn Backend,
        scene: &'p Scene,
        group: &'p Group,
        once: bool,
        wall_time: &mut WallTime,
    ) -> Result<Self> {
        let clock = Instant::now();
        let members = &group.members;
        let ends: Vec<usize> = blocks_of(scene).map(|block| members.rows(block).end).collect();
        let mut stepped_translation = None;
        let motion = match group.treatment {
            Treatment::RegularPrecession => Motion::EvaluatedWhenRead(EvaluatedWhenRead {
                ensemble: scene.ensemble(),
                members,
                motion: FreeForm::Precession { shape: group.class.shape, span: scene.end() },
            }),
            Treatment::ClosedForm { precision, set_up } => {
                match evaluates_on_host(engine, precision).filter(|_| once) {
                    Some(width) => Motion::EvaluatedWhenRead(EvaluatedWhenRead {
                        ensemble: scene.ensemble(),
                        members,
                        motion: FreeForm::ClosedForm { precision, set_up, width },
                    }),
                    None => {
                        let (frames, mut rows) =
                            AnyRows::prepare_members(scene.ensemble(), members, precision, set_up)?;
                        rows.cut_at(ends.clone());
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
                }
            }
            Treatment::Adaptive { method, precision, steps } => {
                let method = (method, precision);
                Motion::Adaptive(AdaptiveGroupRun::start(engine, scene, group, method, (steps, &ends), wall_time)?)
            }
            Treatment::Stepped { method, precision, longest_step, projected } => {
                let torques = group.class.torques.of(scene.torques());
                let (frames, mut batch) = prepare_members(scene.ensemble(), &torques, scene.end(), members, precision)?;
                batch.cut_at(ends.clone());
                let controls = Controls::start(&torques, &mut batch, &frames, |row| members.body(row));
                wall_time.prepare += clock.elapsed().as_secs_f64();
                let clock = Instant::now();
                stepped_translation = SteppedTranslation::start(scene, members, true)?;
                let carried = stepped_translation
                    .as_ref()
                    .filter(|stepped_translation| {
                        stepped_translation.follows() && engine.carries_centres() && !projected
                    })
                    .and_then(|stepped_translation| stepped_translation.carried(&frames, longest_step));
                let session = match &carried {
                    Some((centres, parts)) => engine.start_carrying(batch, method, centres, *parts)?,
                    None if projected => engine.start_projected(batch, method)?,
                    None => engine.start(batch, method)?,
                };
                let session = Controls::around(controls, session, longest_step);
                wall_time.start += clock.elapsed().as_secs_f64();
                if carried.is_some() {
                    stepped_translation = None;
                }
                Motion::Stepped { session, frames, treatment: group.treatment, carries: carried.is_some() }
            }
        };
        if !motion.is_coupled() && !matches!(motion, Motion::Stepped { .. }) {
            stepped_translation = SteppedTranslation::start(scene, members, false)?;
        }
        let varies = scene.torques().iter().any(Torque::changes_inertia);
        let (ensemble, torques) = (scene.ensemble(), scene.torques());
        let schedule = Schedule::of(&group.class.torques.of(torques));
        Ok(Self {
            schedule,
            members,
            ends,
            motion,
            kept: Kept::default(),
            spared: 0,
            stepped_translation,
            ensemble,
            torques,
            varies,
            time: 0.0,
            formed: 0.0,
        })
    }

    /// The steps from `time − span` to `time`, s, as a job for the host's threads, which must run before anything else
    /// is done with the bodies; `None` if there is no such job and [`GroupRun::advance`] must be called.
    pub fn job(&mut self, time: f64, span: f64) -> Result<Option<Job<'_>>> {
        if self.stepped_translation.is_some() {
            return Ok(None);
        }
        let left_out = (self.members.len() - self.kept.count(self.members.len())) as u64;
        let job = match &mut self.motion {
            Motion::Stepped { session, treatment, .. } => {
                let interval = treatment.interval(span);
                let steps = treatment.steps_between(self.schedule.as_ref(), (time - span, time));
                self.spared = self.spared.saturating_add(steps.saturating_mul(left_out));
                session.job(interval.dt, interval.steps)?
            }
            Motion::Adaptive(group_run) => group_run.job_to(time)?,
            Motion::ClosedForm { .. } | Motion::EvaluatedWhenRead(_) => None,
        };
        if job.is_some() {
            self.time = time;
        }
        Ok(job)
    }

    /// Whether [`GroupRun::job`] returns a job.
    pub fn has_job(&self) -> bool {
        self.stepped_translation.is_none() && self.motion.session().is_some_and(Session::has_jobs)
    }

    /// Brings the bodies from `time − span` to `time`, s, and returns the work done ([`crate::plan::Plan::work_of`]).
    /// Bodies that are not stepped are formed only if they are `wanted`.
    pub fn advance(&mut self, time: f64, span: f64, wanted: bool, observer: &mut Observer<'_>) -> Result<u64> {
        let bodies = match &self.motion {
            Motion::Adaptive(group_run) => group_run.body_count(),
            _ => self.kept.count(self.members.len()),
        } as u64;
        if let Motion::Stepped { treatment, .. } = &self.motion {
            let interval = treatment.interval(span);
            let left_out = self.members.len() as u64 - bodies;
            let steps = treatment.steps_between(self.schedule.as_ref(), (time - span, time));
            self.spared = self.spared.saturating_add(steps.saturating_mul(left_out));
            self.take_steps((time - span, interval.dt), 0..interval.steps, time, observer)?;
            return Ok(steps.saturating_mul(bodies));
        }
        self.time = time;
        if let Some(stepped_translation) = &mut self.stepped_translation {
            stepped_translation.advance(time - span, span, observer)?;
        }
        match &mut self.motion {
            Motion::Stepped { .. } => Ok(0),
            Motion::Adaptive(group_run) => {
                group_run.advance_to(time, observer)?;
                Ok(bodies)
            }
            Motion::ClosedForm { session, .. } => {
                if wanted {
                    session.evaluate(time)?;
                }
                Ok(bodies)
            }
            Motion::EvaluatedWhenRead(_) => Ok(bodies),
        }
    }

    /// Takes some of the equal steps of `dt` seconds that begin at `start`, s, after all steps before them; `time`, s,
    /// is the time of the bodies then. Has no effect on groups without equal steps.
    pub fn take_steps(
        &mut self,
        (start, dt): (f64, f64),
        steps: Range<u64>,
        time: f64,
        observer: &mut Observer<'_>,
    ) -> Result<()> {
        let Motion::Stepped { session, frames, .. } = &mut self.motion else { return Ok(()) };
        self.time = time;
        let (bodies, count) = (self.kept.count(self.members.len()) as u64, steps.end - steps.start);
        let Some(stepped_translation) =
            self.stepped_translation.as_mut().filter(|stepped_translation| stepped_translation.follows())
        else {
            if let Some(stepped_translation) = &mut self.stepped_translation {
                let begin = start + dt * steps.start as f64;
                stepped_translation.advance(begin, time - begin, observer)?;
            }
            return advance(&mut **session, dt, count, bodies, observer);
        };
        let (total, rows) = (count.saturating_mul(bodies), 0..self.members.len());
        for step in steps.clone() {
            let before = (step - steps.start).saturating_mul(bodies);
            advance(&mut **session, dt, 1, bodies, &mut |progress| {
                observer(Progress { done: before.saturating_add(progress.done), total })
            })?;
            let now = start + dt * (step + 1) as f64;
            let words = session.read(rows.clone())?;
            let state = |row: usize| frames[row].at(self.torques, self.members.body(row), now).state_of(&words, row);
            stepped_translation.follow(parallel::rows(rows.len(), parallel::OF_A_STEP, &state), now - dt, dt);
        }
        Ok(())
    }

    /// The states of all its bodies, with their centres of mass; `centre` gives those that are not stepped here.
    pub fn output_states(&mut self, centre: &dyn Fn(usize) -> Option<(DVec3, DVec3)>) -> Result<Vec<OutputState>> {
        let rotations = self.read_range(&(0..self.members.len()))?;
        let has_centres = self.has_centres();
        let state = |(row, rotation): (usize, BodyState)| {
            let body = self.members.body(row);
            let mut own = [None];
            if has_centres {
                self.read_centres(&(body..body + 1), &mut own)?;
            }
            Ok(OutputState::moving(rotation, own[0].or_else(|| centre(body))))
        };
        rotations.into_iter().enumerate().map(state).collect()
    }

    /// The time, s, and the state in which a limit of adaptive steps stopped the body in a row, if that was in the last
    /// interval and the engine can tell.
    pub fn stopped(&mut self, row: usize) -> Result<Option<(f64, BodyState)>> {
        let Motion::Adaptive(group_run) = &self.motion else { return Ok(None) };
        let Some(time) = group_run.reached(row) else { return Ok(None) };
        // Moments that change are read at the group's time.
        let end = std::mem::replace(&mut self.time, time);
        let states = self.read_range(&(row..row + 1));
        self.time = end;
        let stopped = states?.into_iter().find(|state| state.status == Status::StepBelowLimit);
        Ok(stopped.map(|state| (time, state)))
    }

    /// The adaptive steps tried by those of its bodies that are among `bodies`.
    pub fn attempts(&mut self, bodies: &[usize]) -> Result<Vec<(usize, u64)>> {
        let Motion::Adaptive(group_run) = &mut self.motion else { return Ok(Vec::new()) };
        let row = |&body: &usize| self.members.rows(body..body + 1).next();
        let rows: Vec<usize> = bodies.iter().filter_map(row).collect();
        let attempts = group_run.attempts(&rows)?;
        Ok(rows.into_iter().map(|row| self.members.body(row)).zip(attempts).collect())
    }

    /// Leaves out those of its bodies for which `stands` is true: they are no longer computed or read. Returns how many
    /// were left out.
    pub fn leave_out(&mut self, stands: &dyn Fn(usize) -> bool) -> Result<usize> {
        let members = self.members;
        let stands = |row: usize| stands(members.body(row));
        if let Motion::Adaptive(group_run) = &mut self.motion {
            return group_run.leave_out(&stands);
        }
        let before = self.kept.count(members.len());
        let Some(moving) = self.kept.next(members.len(), stands) else { return Ok(0) };
        if let Some((session, _)) = self.motion.session_mut() {
            session.keep(&moving)?;
        }
        self.kept.keep(&moving);
        Ok(before - moving.len())
    }

    /// The values that sampled torques hold for its bodies, if any act.
    pub fn controls(&self) -> Option<&Controls> {
        self.motion.session()?.controls()
    }

    /// Equal steps saved because bodies were left out.
    pub fn spared(&self) -> u64 {
        self.spared
    }

    /// The wall time, s, for forming bodies as they were read, since the last call.
    pub fn take_formed(&mut self) -> f64 {
        std::mem::take(&mut self.formed)
    }

    /// The adaptive steps so far, if there are any.
    pub fn adaptive_work(&mut self) -> Result<Option<GroupWork>> {
        match &mut self.motion {
            Motion::Adaptive(group_run) => group_run.work().map(Some),
            _ => Ok(None),
        }
    }

    /// Number of bodies, including those that were left out.
    pub fn body_count(&self) -> usize {
        self.members.len()
    }

    /// Whether its bodies' centres of mass are stepped here.
    pub fn has_centres(&self) -> bool {
        let is_carried = matches!(self.motion, Motion::Stepped { carries: true, .. });
        self.stepped_translation.is_some() || is_carried || self.motion.is_coupled()
    }

    /// The centres of mass of its bodies, if the host steps them.
    pub fn own_centres(&self) -> Vec<(usize, (DVec3, DVec3))> {
        self.stepped_translation.iter().flat_map(SteppedTranslation::centres).collect()
    }

    /// Writes the centres of mass of those of its bodies that are in `bodies`, if they are stepped here.
    pub fn read_centres(&mut self, bodies: &Range<usize>, centres: &mut [Option<(DVec3, DVec3)>]) -> Result<()> {
        if let Some(stepped_translation) = &self.stepped_translation {
            stepped_translation.read(bodies, centres);
        }
        if let Motion::Stepped { session, carries: true, .. } = &mut self.motion {
            let rows = self.members.rows(bodies.clone());
            for (row, centre) in rows.clone().zip(session.read_centres(rows)?) {
                centres[self.members.body(row) - bodies.start] = Some(centre);
            }
        }
        if let Motion::Adaptive(group_run) = &mut self.motion
            && group_run.is_coupled()
        {
            for row in self.members.rows(bodies.clone()) {
                centres[self.members.body(row) - bodies.start] = group_run.centre(row)?;
            }
        }
        Ok(())
    }

    /// Announces that those of its bodies that are in `bodies` are read next.
    pub fn prefetch(&mut self, bodies: &Range<usize>) -> Result<()> {
        let rows = self.members.rows(bodies.clone());
        if let Motion::Adaptive(group_run) = &mut self.motion {
            return group_run.prefetch(rows);
        }
        let session = self.motion.session_mut();
        session.map_or(Ok(()), |(session, _)| session.prefetch(self.kept.session_rows(&rows)))
    }

    /// Writes the states of those of its bodies that are in `bodies` to their places in `states`, and their initial
    /// states, formed in the same way, to their places in `initial`. Bodies that were left out are skipped.
    pub fn read(
        &mut self,
        bodies: &Range<usize>,
        states: &mut [OutputState],
        initial: Option<&mut [BodyState]>,
    ) -> Result<()> {
        if let Motion::EvaluatedWhenRead(once) = &self.motion {
            let clock = Instant::now();
            if self.kept.is_all() {
                once.read(self.time, bodies, states, initial);
            } else {
                once.read_kept(self.time, &self.kept, bodies, states);
                initial.into_iter().for_each(|initial| self.read_initial(bodies, initial));
            }
            self.formed += clock.elapsed().as_secs_f64();
            return Ok(());
        }
        let members = self.members;
        self.with_states(&members.rows(bodies.clone()), &mut |rows, form| {
            scatter(members, bodies, &rows, states, form, |place, state| {
                *place = OutputState::moving(state, None);
            });
        })?;
        if let Some(initial) = initial {
            self.read_initial(bodies, initial);
        }
        Ok(())
    }

    /// Writes the initial states of those of its bodies that are in `bodies` to their places in `states`, formed in the
    /// same way as later ones.
    pub fn read_initial(&self, bodies: &Range<usize>, states: &mut [BodyState]) {
        let (members, ensemble) = (self.members, self.ensemble);
        let of_frames = |rows: Range<usize>, frame: &dyn Fn(usize) -> BodyFrame, write: &mut WriteState<'_>| {
            let start = |row: usize| {
                let body = members.body(row);
                let (q, omega) = (ensemble.orientation()[body], ensemble.angular_velocity_body()[body]);
                (Cow::Owned(frame(row)), [q.x, q.y, q.z, q.w, omega.x, omega.y, omega.z], Status::Valid)
            };
            each_in_lanes(rows, true, start, write);
        };
        let form: Box<FormStates<'_>> = match &self.motion {
            Motion::EvaluatedWhenRead(once) => {
                let frame = |row| scaled_body(ensemble, members.body(row), once.set_up()).0;
                Box::new(move |rows, write| of_frames(rows, &frame, write))
            }
            motion => {
                let frames = motion.frames();
                Box::new(move |rows, write| of_frames(rows, &|row| frames[row], write))
            }
        };
        scatter(members, bodies, &members.rows(bodies.clone()), states, &*form, |place, state| *place = state);
    }

    /// The states in a range of rows.
    fn read_range(&mut self, rows: &Range<usize>) -> Result<Vec<BodyState>> {
        let mut states = Vec::with_capacity(rows.len());
        self.with_states(rows, &mut |rows, form| {
            let tasks = rows.clone().step_by(TASK).map(|first| first..rows.end.min(first + TASK));
            let before = states.len();
            parallel::extend_by_rows(&mut states, rows.len(), TASK, &|_| BodyState::UNKNOWN);
            let places = states[before..].chunks_mut(TASK);
            parallel::for_each_task(places.zip(tasks), |_, (places, rows)| {
                let mut places = places.iter_mut();
                form(rows, &mut |_, state| places.by_ref().take(1).for_each(|place| *place = state));
            });
        })?;
        Ok(states)
    }

    /// Passes the function that forms the states in a range of rows to `then`, for one piece or several in turn.
    fn with_states(&mut self, rows: &Range<usize>, then: &mut dyn FnMut(Range<usize>, &FormStates<'_>)) -> Result<()> {
        if rows.is_empty() {
            return Ok(());
        }
        let time = self.time;
        let now = FramesAt { members: self.members, torques: self.torques, varies: self.varies, time };
        let (kept, own) = (&self.kept, self.kept.session_rows(rows));
        let mut of_words = |words: StateWords, frames: &[BodyFrame]| {
            let scaled = |session_row: usize| {
                let (row, place) = (kept.row(session_row), session_row - own.start);
                (now.frame(&frames[row], row), words.combined(place), words.status[place])
            };
            then(rows.clone(), &|rows, write| {
                let write: &mut WriteState<'_> = &mut |session_row, state| write(kept.row(session_row), state);
                each_in_lanes(kept.session_rows(&rows), false, scaled, write);
            });
        };
        match &mut self.motion {
            Motion::Stepped { session, frames, .. } => of_words(session.read(own.clone())?, frames),
            Motion::ClosedForm { session, frames } => of_words(session.read(own.clone())?, frames),
            Motion::Adaptive(group_run) => group_run.with_states(rows, &now, then)?,
            Motion::EvaluatedWhenRead(once) => {
                let states = once.states(rows, time);
                then(rows.clone(), &|own, write| own.for_each(|row| write(row, states[row - rows.start])));
            }
        }
        Ok(())
    }
}

/// Takes equal steps of some bodies. A few bodies are stepped without a watching thread.
fn advance(
    session: &mut dyn SteppedSession,
    dt: f64,
    steps: u64,
    bodies: u64,
    observer: &mut Observer<'_>,
) -> Result<()> {
    /// Body-steps that take less time than starting a thread.
    const FEW: u64 = 1 << 8;
    let total = steps.saturating_mul(bodies);
    if total <= FEW
        && let Some(job) = session.job(dt, steps)?
    {
        job(&Watch::default());
        return match observer(Progress { done: total, total }) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(Error::Interrupted { steps }),
        };
    }
    session.advance(dt, steps, observer)
}

/// The width in which a run on `engine` evaluates closed forms in `precision` on the host, if it does.
fn evaluates_on_host(engine: &dyn Backend, precision: Precision) -> Option<Width> {
    if engine.precisions().contains(&precision) { engine.evaluates_on_host() } else { Some(Width::Lanes) }
}

/// The blocks of a scene's bodies, or the parts of blocks that it has, by the scene's own indices.
pub(super) fn blocks_of(scene: &Scene) -> impl Iterator<Item = Range<usize>> + Clone + use<> {
    let Part { first_body, of } = scene.part();
    let blocks = Blocks::of(of).within(&(first_body..first_body + scene.ensemble().len()));
    blocks.map(move |block| block.start - first_body..block.end - first_body)
}
