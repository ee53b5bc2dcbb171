//! One group of a plan under way.

mod reduction;

use std::borrow::Cow;
use std::ops::Range;
use std::time::Instant;

use glam::DVec3;

use super::OutputState;
use super::adaptive_work::GroupWork;
use super::evaluated_when_read::{EvaluatedWhenRead, FreeForm};
use super::reading::{FormStates, FramesAt, TASK, WriteState, each_in_lanes, scatter};
use super::session_rows::SessionRows;
use super::session_run::SessionRun;
use super::stepped_translation::SteppedTranslation;
use crate::bodies::blocks::cut;
use crate::bodies::user_axes::USER_BODIES;
use crate::bodies::{Blocks, BodyFrame, BodyState, Ensemble, Members, Status};
use crate::engine::batch::{Prepared, ordered_together, prepare_members, prepare_ordered};
use crate::engine::controlled::Controls;
use crate::engine::cpu::Cpu;
use crate::engine::watch::Job;
use crate::engine::{Backend, End, Observer, Progress, StepCounts};
use crate::error::Result;
use crate::kernel::free_motion::{AnyRows, scaled_body};
use crate::math::Precision;
use crate::math::Width;
use crate::math::equal_steps::Interval;
use crate::math::parallel;
use crate::plan::subset::{order_by_work, ordered_controls, start};
use crate::plan::{Group, Treatment};
use crate::record::WallTime;
use crate::scene::{Part, Scene};
use crate::torque::Torque;
use crate::torque::control::Schedule;

/// The run of one group of bodies.
pub(super) struct GroupRun<'p> {
    members: &'p Members,
    treatment: Treatment,
    /// The rows after the last of each block of bodies.
    ends: Vec<usize>,
    motion: Motion<'p>,
    rows: SessionRows,
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
    Session(SessionRun),
    EvaluatedWhenRead(EvaluatedWhenRead<'p>),
}

impl Motion<'_> {
    fn session(&self) -> Option<&SessionRun> {
        match self {
            Motion::Session(run) => Some(run),
            Motion::EvaluatedWhenRead(_) => None,
        }
    }

    fn session_mut(&mut self) -> Option<&mut SessionRun> {
        match self {
            Motion::Session(run) => Some(run),
            Motion::EvaluatedWhenRead(_) => None,
        }
    }
}

/// The seconds since an instant, which becomes the present one.
fn lap(clock: &mut Instant) -> f64 {
    let before = std::mem::replace(clock, Instant::now());
    (*clock - before).as_secs_f64()
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
        let mut clock = Instant::now();
        let (members, end) = (&group.members, scene.end());
        let torques = group.class.torques.of(scene.torques());
        let ends: Vec<usize> = blocks_of(scene).map(|block| members.rows(block).end).collect();
        let when_read =
            |motion| Motion::EvaluatedWhenRead(EvaluatedWhenRead { ensemble: scene.ensemble(), members, motion });
        let mut rows = SessionRows::new(members.len());
        let mut stepped_translation = None;
        let motion = match group.treatment {
            Treatment::RegularPrecession => when_read(FreeForm::Precession { shape: group.class.shape, span: end }),
            Treatment::ClosedForm { precision, set_up } => {
                match evaluates_on_host(engine, precision).filter(|_| once) {
                    Some(width) => when_read(FreeForm::ClosedForm { precision, set_up, width }),
                    None => {
                        let (frames, mut free) =
                            AnyRows::prepare_members(scene.ensemble(), members, precision, set_up)?;
                        free.cut_at(ends.clone());
                        wall_time.prepare += lap(&mut clock);
                        let has_precision = engine.precisions().contains(&precision);
                        let session = if has_precision {
                            engine.start_free(free)
                        } else {
                            Cpu::new(Width::Lanes).start_free(free)
                        };
                        Motion::Session(SessionRun::new(session?, frames, false))
                    }
                }
            }
            Treatment::Adaptive { method, precision, steps } => {
                let mut order = vec![0; members.len()];
                let by_work =
                    |start: usize, prepared: &[Prepared]| order_by_work(scene, members, start, prepared, &mut order);
                let cuts = cut(members.len(), ordered_together(engine.description().kind), &ends);
                let (frames, mut batch) =
                    prepare_ordered(scene.ensemble(), &torques, end, members, precision, (&cuts, by_work))?;
                let controls = ordered_controls(&torques, &mut batch, &frames, members, &order);
                wall_time.prepare += lap(&mut clock);
                let is_coupled = batch.torques().is_coupled();
                let mut session = start(engine, (method, group.is_dense), batch, steps)?;
                session.limit_attempts(group.most_attempts);
                rows = SessionRows::ordered(order, cuts);
                Motion::Session(SessionRun::new(Controls::around(controls, session, None), frames, is_coupled))
            }
            Treatment::Stepped { method, precision, longest_step, projected } => {
                let (frames, mut batch) = prepare_members(scene.ensemble(), &torques, end, members, precision)?;
                batch.cut_at(ends.clone());
                let controls = Controls::start(&torques, &mut batch, &frames, |row| members.body(row));
                wall_time.prepare += lap(&mut clock);
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
                if carried.is_some() {
                    stepped_translation = None;
                }
                let session = Controls::around(controls, session, Some(longest_step));
                Motion::Session(SessionRun::new(session, frames, carried.is_some()))
            }
        };
        if motion.session().is_some() {
            wall_time.start += lap(&mut clock);
        }
        let is_coupled = motion.session().is_some_and(|run| run.moves_centres);
        if !is_coupled && !matches!(group.treatment, Treatment::Stepped { .. }) {
            stepped_translation = SteppedTranslation::start(scene, members, false)?;
        }
        Ok(Self {
            members,
            treatment: group.treatment,
            ends,
            motion,
            rows,
            spared: 0,
            stepped_translation,
            ensemble: scene.ensemble(),
            torques: scene.torques(),
            varies: scene.torques().iter().any(Torque::changes_inertia),
            schedule: Schedule::of(&torques),
            time: 0.0,
            formed: 0.0,
        })
    }

    fn is_stepped(&self) -> bool {
        matches!(self.treatment, Treatment::Stepped { .. })
    }

    /// The equal steps of a body from `time − span` to `time`, s; those of the bodies that were left out are noted.
    fn steps_to(&mut self, time: f64, span: f64) -> u64 {
        let steps = self.treatment.steps_between(self.schedule.as_ref(), (time - span, time));
        let left_out = (self.members.len() - self.rows.count()) as u64;
        self.spared = self.spared.saturating_add(steps.saturating_mul(left_out));
        steps
    }

    /// The steps from `time − span` to `time`, s, as a job for the host's threads, which must run before anything else
    /// is done with the bodies; `None` if [`GroupRun::has_job`] is false and [`GroupRun::advance`] must be called.
    pub fn job(&mut self, time: f64, span: f64) -> Result<Option<Job<'_>>> {
        if !self.has_job() {
            return Ok(None);
        }
        self.steps_to(time, span);
        self.time = time;
        let end = End { time, steps: self.treatment.interval(span) };
        self.motion.session_mut().map_or(Ok(None), |run| run.job_to(end))
    }

    /// Whether [`GroupRun::job`] returns a job.
    pub fn has_job(&self) -> bool {
        self.stepped_translation.is_none() && self.motion.session().is_some_and(|run| run.session.has_jobs())
    }

    /// Brings the bodies from `time − span` to `time`, s, and returns the work done ([`crate::plan::Plan::work_of`]).
    /// Bodies that are not stepped are formed only if they are `wanted`.
    pub fn advance(&mut self, time: f64, span: f64, wanted: bool, observer: &mut Observer<'_>) -> Result<u64> {
        let bodies = self.rows.count() as u64;
        if self.is_stepped() {
            let (steps, interval) = (self.steps_to(time, span), self.treatment.interval(span));
            self.take_steps((time - span, interval.dt), 0..interval.steps, time, observer)?;
            return Ok(steps.saturating_mul(bodies));
        }
        self.time = time;
        let advances = wanted || self.treatment.precision_of_steps().is_some();
        let mut session = self.motion.session_mut().filter(|_| advances);
        // Centres of mass and rotations are half of it each, if there are both.
        let (mut done, parts) = (0, if session.is_some() && self.stepped_translation.is_some() { 2 } else { 1 });
        if let Some(stepped_translation) = &mut self.stepped_translation {
            stepped_translation.advance(time - span, span, &mut |progress| {
                observer(Progress { done: progress.done / parts, ..progress })
            })?;
            done = bodies;
        }
        if let Some(run) = &mut session {
            run.advance_to(End::at(time), &mut |progress| {
                observer(Progress { done: (done + progress.done) / parts, ..progress })
            })?;
        }
        Ok(bodies)
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
        let is_stepped = self.is_stepped();
        let Some(run) = self.motion.session_mut().filter(|_| is_stepped) else { return Ok(()) };
        self.time = time;
        let count = steps.end - steps.start;
        let Some(stepped_translation) =
            self.stepped_translation.as_mut().filter(|stepped_translation| stepped_translation.follows())
        else {
            if let Some(stepped_translation) = &mut self.stepped_translation {
                let begin = start + dt * steps.start as f64;
                stepped_translation.advance(begin, time - begin, observer)?;
            }
            return run.advance_to(End { time, steps: Interval { steps: count, dt } }, observer);
        };
        let (bodies, rows) = (self.rows.count() as u64, 0..self.members.len());
        let (mut begin, end) = (start + dt * steps.start as f64, start + dt * steps.end as f64);
        let total =
            self.treatment.steps_between(self.schedule.as_ref(), (begin, end)).max(count).saturating_mul(bodies);
        let mut before = 0_u64;
        // The attitude's second derivative jumps where torques change the values they hold, so that steps end there.
        while begin < end {
            let (next, Interval { steps, dt }) = match &self.schedule {
                Some(schedule) => {
                    let next = schedule.part(begin, end);
                    (next, self.treatment.interval(next - begin))
                }
                None => (end, Interval { steps: count, dt }),
            };
            for step in 0..steps {
                let now = begin + dt * (step + 1) as f64;
                run.advance_to(End { time: now, steps: Interval { steps: 1, dt } }, &mut |progress| {
                    observer(Progress { done: before.saturating_add(progress.done), total })
                })?;
                let words = run.session.read(rows.clone())?;
                let frames = &run.frames;
                let state =
                    |row: usize| frames[row].at(self.torques, self.members.body(row), now).state_of(&words, row);
                stepped_translation.follow(parallel::rows(rows.len(), parallel::OF_A_STEP, &state), now - dt, dt);
                before = before.saturating_add(bodies);
            }
            begin = next;
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
        let reached = self.motion.session().and_then(|run| run.session.reached());
        let Some((reached, own)) = reached.zip(self.rows.session_row(row)) else { return Ok(None) };
        // Moments that change are read at the group's time.
        let (time, end) = (reached[own], std::mem::replace(&mut self.time, reached[own]));
        let states = self.read_range(&(row..row + 1));
        self.time = end;
        let stopped = states?.into_iter().find(|state| state.status == Status::StepBelowLimit);
        Ok(stopped.map(|state| (time, state)))
    }

    /// The adaptive steps tried by those of its bodies that are among `bodies`.
    pub fn attempts(&mut self, bodies: &[usize]) -> Result<Vec<(usize, u64)>> {
        let counts = self.motion.session_mut().map_or(Ok(Vec::new()), |run| run.session.counts())?;
        let of_body = |&body: &usize| {
            let row = self.members.rows(body..body + 1).next()?;
            Some((body, self.rows.session_row(row).and_then(|own| counts.get(own)).map_or(0, StepCounts::attempts)))
        };
        Ok(bodies.iter().filter_map(of_body).collect())
    }

    /// Leaves out those of its bodies for which `stands` is true: they are no longer computed or read. Returns how many
    /// were left out.
    pub fn leave_out(&mut self, stands: &dyn Fn(usize) -> bool) -> Result<usize> {
        let before = self.rows.count();
        let Some(moving) = self.rows.moving(&|row| stands(self.members.body(row))) else { return Ok(0) };
        self.motion.session_mut().map_or(Ok(()), |run| run.keep(&moving))?;
        self.rows.keep(&moving);
        Ok(before - moving.len())
    }

    /// The values that sampled torques hold for its bodies, if any act.
    pub fn controls(&self) -> Option<&Controls> {
        self.motion.session()?.session.controls()
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
        let adapts = matches!(self.treatment, Treatment::Adaptive { .. });
        self.motion.session_mut().filter(|_| adapts).map(SessionRun::work).transpose()
    }

    /// Number of bodies, including those that were left out.
    pub fn body_count(&self) -> usize {
        self.members.len()
    }

    /// Whether its bodies' centres of mass are stepped here.
    pub fn has_centres(&self) -> bool {
        self.stepped_translation.is_some() || self.motion.session().is_some_and(|run| run.moves_centres)
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
        if let Some(run) = self.motion.session_mut() {
            for (row, centre) in run.centres(self.members.rows(bodies.clone()), &self.rows)? {
                centres[self.members.body(row) - bodies.start] = Some(centre);
            }
        }
        Ok(())
    }

    /// Announces that those of its bodies that are in `bodies` are read next.
    pub fn prefetch(&mut self, bodies: &Range<usize>) -> Result<()> {
        let rows = self.members.rows(bodies.clone());
        self.motion.session_mut().map_or(Ok(()), |run| run.prefetch(&rows, &self.rows))
    }

    /// Writes the states of those of its bodies that are in `bodies` to their places in `states`, and their initial
    /// states, formed in the same way, to their places in `initial`. Bodies that were left out are skipped.
    pub fn read(
        &mut self,
        bodies: &Range<usize>,
        states: &mut [OutputState],
        initial: Option<&mut [BodyState]>,
    ) -> Result<()> {
        let (clock, members) = (Instant::now(), self.members);
        match (&self.motion, initial) {
            (Motion::EvaluatedWhenRead(motion), Some(initial)) if self.rows.is_all() => {
                motion.read_both(self.time, &self.rows, bodies, states, initial);
            }
            (_, initial) => {
                self.with_states(&members.rows(bodies.clone()), &mut |rows, form| {
                    scatter(members, bodies, &rows, states, form, |place, state| {
                        *place = OutputState::moving(state, None);
                    });
                })?;
                initial.into_iter().for_each(|initial| self.read_initial(bodies, initial));
            }
        }
        if self.motion.session().is_none() {
            self.formed += clock.elapsed().as_secs_f64();
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
            Motion::EvaluatedWhenRead(motion) => {
                let frame = |row| scaled_body(ensemble, members.body(row), motion.set_up()).0;
                Box::new(move |rows, write| of_frames(rows, &frame, write))
            }
            Motion::Session(SessionRun { frames, .. }) => {
                Box::new(move |rows, write| of_frames(rows, &|row| frames[row], write))
            }
        };
        scatter(members, bodies, &members.rows(bodies.clone()), states, &*form, |place, state| *place = state);
    }

    /// The states in a range of rows.
    fn read_range(&mut self, rows: &Range<usize>) -> Result<Vec<BodyState>> {
        let mut states = Vec::with_capacity(rows.len());
        self.with_states(rows, &mut |rows, form| {
            let task = parallel::rows_of_a_task(rows.len()).next_multiple_of(USER_BODIES).min(TASK);
            let tasks = rows.clone().step_by(task).map(|first| first..rows.end.min(first + task));
            let before = states.len();
            parallel::extend_by_rows(&mut states, rows.len(), TASK, &|_| BodyState::UNKNOWN);
            let places = states[before..].chunks_mut(task);
            parallel::for_each_task(places.zip(tasks), |_, (places, rows)| {
                let mut places = places.iter_mut();
                form(rows, &mut |_, state| places.by_ref().take(1).for_each(|place| *place = state));
            });
        })?;
        Ok(states)
    }

    /// Passes the function that forms the states in a range of rows to `then`, for one piece or several in turn.
    fn with_states(&mut self, rows: &Range<usize>, then: &mut dyn FnMut(Range<usize>, &FormStates<'_>)) -> Result<()> {
        let (members, own, time) = (self.members, &self.rows, self.time);
        let now = FramesAt { members, torques: self.torques, varies: self.varies, time };
        match &mut self.motion {
            Motion::Session(run) => run.with_states(rows, own, &now, then),
            Motion::EvaluatedWhenRead(motion) => {
                then(rows.clone(), &|rows, write| motion.each(rows, own, time, write));
                Ok(())
            }
        }
    }
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
