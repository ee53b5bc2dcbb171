//! A run, output by output: advance to an output time, read, pass on, repeat.

mod finished;
mod iterator;

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::time::Instant;

use glam::DVec3;

use super::advance::advance;
use super::at_end::{AtEnd, usable_rate};
use super::failures::Failures;
use super::group_run::{GroupRun, blocks_of};
use super::observed::{Comparison, Observation};
use super::output_statistics::{self, FromStates};
use super::own_state::{of_sound, own_columns};
use super::recomputed_sample::sample_of_part;
use super::states::{centres_of, initial_states, lost_centres, read_states};
use super::translation::Centres;
use crate::bodies::{BodyState, Status};
use crate::engine::batch::ordered_together;
use crate::engine::watch::Pace;
use crate::engine::{Backend, Observer, Progress, Traffic};
use crate::error::{Error, Result};
use crate::kernel::observe::Statistic;
use crate::plan::own_state::OwnStates;
use crate::plan::{ActingTorques, Plan, Stratified};
use crate::record::{EventRecord, FellBack, Memory, OutputState, Sink, Statistics, Trust, WallTime};
pub use iterator::Output;

/// A run of a plan under way: an iterator over its output times.
///
/// ```
/// # use glam::{DQuat, DVec3};
/// use polhode::run::Run;
/// use polhode::{Engine, Ensemble, Outputs, Plan, Scene};
///
/// # let ensemble = Ensemble::from_columns(&[DVec3::new(1.0, 2.0, 2.5)], &[DQuat::IDENTITY], &[DVec3::X])?;
/// let scene = Scene::new(ensemble).until(10.0).outputs(Outputs::Every(1.0));
/// let engine = Engine::cpu();
/// let plan = Plan::new(&scene, &engine)?;
/// let mut run = Run::start(&engine, &plan)?;
/// for output in &mut run {
///     let output = output?;
///     println!("{} s: {}", output.time, output.states.orientation(0));
/// }
/// let trust = run.finish()?.1;
/// assert!(trust.failed_bodies.is_empty());
/// # Ok::<(), polhode::Error>(())
/// ```
pub struct Run<'p> {
    engine: &'p dyn Backend,
    plan: &'p Plan<'p>,
    statistics: Vec<Statistic>,
    /// Whether statistics are formed where the states are.
    reduces: bool,
    observation: Option<Observation<'p>>,
    /// Whether it is formed where the states are, except at the last output.
    gathers: bool,
    comparison: Option<Comparison<'p>>,
    own_states: OwnStates,
    group_runs: Vec<GroupRun<'p>>,
    centres: Centres<'p>,
    /// Number of outputs done.
    outputs: usize,
    /// Number of advance times reached: outputs, and checks for events between them.
    advances: usize,
    /// The work done and the total work, as progress counts them.
    done: u64,
    total: u64,
    pace: Pace,
    end: AtEnd,
    failures: Failures<'p>,
    /// The bodies that are recomputed, and their final states in the run.
    sample: Stratified,
    sampled: Vec<BodyState>,
    sampled_centres: Vec<Option<(DVec3, DVec3)>>,
    /// The stopping times, s, of those of them that an event has stopped.
    sampled_stops: BTreeMap<u32, f64>,
    /// The number of stopped bodies when some were last left out.
    left_out: usize,
    /// Bodies that are read at once.
    block: usize,
    /// The spin rate, rad/s, above which a given step is too long.
    usable_rate: f64,
    /// The torques that act on each body.
    acting: ActingTorques<'p>,
    states: Vec<OutputState>,
    initial: Vec<BodyState>,
    wall_time: WallTime,
    traffic: Traffic,
    /// Whether and where another engine has continued.
    fallback: Option<FellBack>,
    /// Whether an error has ended the run.
    has_failed: bool,
}

/// With no more bodies than this, reading them takes less time than waking a thread.
const FEW: usize = 256;

impl std::fmt::Debug for Run<'_> {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_struct("Run").field("outputs", &self.outputs).finish_non_exhaustive()
    }
}

impl<'p> Run<'p> {
    /// Prepares the bodies.
    ///
    /// # Errors
    ///
    /// [`Error::TooManyBodies`], and [`Error::DeviceInRun`] where the device is lost.
    pub fn start(engine: &'p dyn Backend, plan: &'p Plan<'p>) -> Result<Self> {
        Self::started(engine, plan).map_err(|error| located(error, plan, 0))
    }

    fn started(engine: &'p dyn Backend, plan: &'p Plan<'p>) -> Result<Self> {
        let scene = plan.scene();
        let mut wall_time = WallTime::default();
        let traffic = engine.traffic();
        // Without skipping, statistics are formed from the states that are read, as are those that engines do not
        // reduce.
        let statistics = scene.plain_statistics();
        let reduces = !statistics.is_empty() && scene.may_skip();
        let observation = Observation::new(plan)?;
        let comparison = Comparison::new(plan)?;
        let once = plan.reads_states_once();
        let group_runs = plan.groups().iter().map(|group| GroupRun::start(engine, scene, group, once, &mut wall_time));
        let mut group_runs = group_runs.collect::<Result<Vec<_>>>()?;
        let centres = Centres::start(plan);
        if reduces {
            let clock = Instant::now();
            group_runs.iter_mut().try_for_each(|group_run| group_run.watch(&statistics, usable_rate(plan)))?;
            wall_time.start += clock.elapsed().as_secs_f64();
        }
        // The last output is always read.
        let may_gather = scene.may_skip() && scene.forms_on_devices() && plan.times().len() > 1;
        let gathers = match observation.as_ref().filter(|_| may_gather) {
            Some(observation) => {
                let clock = Instant::now();
                let gathers = observation.watch(&mut group_runs)?;
                wall_time.start += clock.elapsed().as_secs_f64();
                gathers
            }
            None => false,
        };
        let mut run = Self {
            engine,
            plan,
            statistics,
            reduces,
            observation,
            gathers,
            comparison,
            own_states: OwnStates::of(scene.torques()),
            group_runs,
            centres,
            outputs: 0,
            advances: 0,
            done: 0,
            pace: Pace::default(),
            // For a body that is not stepped, each output time counts as one unit of work.
            total: plan.groups().iter().map(|group| plan.work_of(group)).fold(0, u64::saturating_add),
            end: AtEnd::default(),
            failures: Failures::new(scene.ensemble()),
            sample: sample_of_part(plan),
            sampled: Vec::new(),
            sampled_centres: Vec::new(),
            sampled_stops: BTreeMap::new(),
            left_out: 0,
            block: ordered_together(engine.description().kind),
            usable_rate: usable_rate(plan),
            acting: ActingTorques::of(plan.scene().torques()),
            states: Vec::new(),
            initial: Vec::new(),
            wall_time,
            traffic,
            fallback: None,
            has_failed: false,
        };
        run.note_fallback();
        run.observe_start();
        run.leave_out(0)?;
        Ok(run)
    }

    /// Passes the states at the start to the observation if it wants them.
    fn observe_start(&mut self) {
        let Some(observation) = self.observation.as_mut().filter(|observation| observation.wants_start()) else {
            return;
        };
        let clock = Instant::now();
        let body_count = self.plan.scene().ensemble().len();
        let own = match observation.wants_own_state() {
            true => own_columns(self.plan, &self.own_states, &self.group_runs, (0.0, None)),
            false => Vec::new(),
        };
        for start in (0..body_count).step_by(self.block) {
            initial_states(&self.group_runs, &(start..(start + self.block).min(body_count)), &mut self.initial);
            let rotations = self.initial.iter().map(|&rotation| OutputState::moving(rotation, None));
            let centres = &self.centres;
            let states: Vec<OutputState> = rotations.collect();
            observation.begin(start, (&states, &own), &|body, time| centres.of_body_at(body, time));
        }
        self.wall_time.read += clock.elapsed().as_secs_f64();
    }

    /// Leaves out the bodies that events have stopped, after the first `advances` of the advance times, unless skipping is off.
    fn leave_out(&mut self, advances: usize) -> Result<()> {
        let plan = self.plan;
        let Some(stops) = self.observation.as_ref().and_then(Observation::stops) else { return Ok(()) };
        if stops.count() == self.left_out || !plan.scene().may_skip() || advances == plan.advance_times().len() {
            return Ok(());
        }
        self.left_out = stops.count();
        for (group_run, group) in self.group_runs.iter_mut().zip(plan.groups()) {
            let left_out = group_run.leave_out(&|body| stops.stands(body))?;
            let of_body = plan.work_after(group, advances);
            self.total = self.total.saturating_sub(of_body.saturating_mul(left_out as u64));
        }
        Ok(())
    }

    /// Notes that the work continued on another engine after a fault of the device, from the last finished output or check.
    fn note_fallback(&mut self) {
        if self.fallback.is_some() {
            return;
        }
        let time = self.advances.checked_sub(1).map_or(0.0, |last| self.plan.advance_times()[last]);
        self.fallback = self.engine.fault().map(|fault| FellBack { time, fault });
    }

    /// Computes the rest, and returns the events and the trust figures of the run.
    ///
    /// # Errors
    ///
    /// [`Error::DeviceInRun`] where the device is lost.
    pub fn finish(mut self) -> Result<(Vec<EventRecord>, Trust)> {
        let mut rest = Memory::default();
        let mut go_on = |_| ControlFlow::Continue(());
        while self.outputs < self.plan.times().len() {
            self.output_into(&mut rest, &mut go_on)?;
        }
        let trust = self.finish_into(&mut rest, &mut go_on)?;
        Ok((rest.events, trust))
    }

    /// Advances to the next output time and passes on what is wanted there. After an error the run cannot continue.
    pub(super) fn output_into(&mut self, sink: &mut dyn Sink, observer: &mut Observer<'_>) -> Result<()> {
        let done = self.next_output(sink, observer).map_err(|error| located(error, self.plan, self.outputs));
        self.has_failed |= done.is_err();
        done
    }

    fn next_output(&mut self, sink: &mut dyn Sink, observer: &mut Observer<'_>) -> Result<()> {
        while !self.plan.is_output(self.advances) {
            let done = self.check(sink, observer);
            self.note_fallback();
            done?;
            self.advances += 1;
        }
        let done = self.output(sink, observer);
        self.note_fallback();
        done?;
        (self.outputs, self.advances) = (self.outputs + 1, self.advances + 1);
        Ok(())
    }

    /// Advances to the next advance time, which is no output, and seeks events if there are any.
    fn check(&mut self, sink: &mut dyn Sink, observer: &mut Observer<'_>) -> Result<()> {
        let time = self.plan.advance_times()[self.advances];
        // A replay of one body keeps its checks without its events.
        let seeks = !self.plan.scene().wanted_events().is_empty();
        self.advance(seeks, observer)?;
        if seeks {
            self.read_all((None, time), (false, false), sink, observer)?;
        }
        if self.plan.scene().stops() { self.leave_out(self.advances + 1) } else { Ok(()) }
    }

    /// Advances to the next advance time; bodies that are not stepped are formed only if they are `wanted`.
    fn advance(&mut self, wanted: bool, observer: &mut Observer<'_>) -> Result<()> {
        let (plan, index) = (self.plan, self.advances);
        let time = plan.advance_times()[index];
        if let Some(observation) = &mut self.observation {
            observation.take_controls(&self.group_runs);
        }
        let clock = Instant::now();
        let done = (&mut self.done, self.total);
        advance(&mut self.group_runs, (time, plan.span_before(index)), wanted, done, &mut self.pace, observer)?;
        self.centres.advance(time, plan.interval(index));
        self.wall_time.compute += clock.elapsed().as_secs_f64();
        if plan.is_closed_form() && observer(self.progress()).is_break() {
            return Err(Error::Interrupted { steps: 0 });
        }
        Ok(())
    }

    fn output(&mut self, sink: &mut dyn Sink, observer: &mut Observer<'_>) -> Result<()> {
        let (plan, scene) = (self.plan, self.plan.scene());
        let (index, count) = (self.outputs, plan.times().len());
        let (time, last) = (plan.times()[index], index + 1 == count);
        // Without skipping, states that nobody asked for are read too.
        let asked = sink.wants(index, count, time);
        // Whether statistics and histograms are formed where the states are.
        let reduces = self.reduces || self.gathers && !asked && !last;
        let wanted = asked
            || (self.observation.is_some() || self.comparison.is_some()) && !reduces
            || !scene.may_skip()
            || (last && !plan.leaves_states());
        self.advance(wanted || last || reduces, observer)?;
        let stops = scene.stops();
        if !stops {
            self.compare(index, time)?;
        }
        if self.reduces {
            let clock = Instant::now();
            let found = output_statistics::reduced(&mut self.group_runs, &self.statistics)?;
            self.wall_time.read += clock.elapsed().as_secs_f64();
            sink.statistics_of_blocks(index, time, &found)?;
            sink.statistics(index, &Statistics::new(time, &self.statistics, &found))?;
        }
        match &mut self.observation {
            _ if wanted => self.read_all((Some(index), time), (asked, last), sink, observer)?,
            _ if last => self.read_sample(time)?,
            Some(observation) => {
                let clock = Instant::now();
                observation.gather(&mut self.group_runs)?;
                self.wall_time.read += clock.elapsed().as_secs_f64();
                let clock = Instant::now();
                observation.finish_output(index, time, sink, observer)?;
                self.wall_time.observe += clock.elapsed().as_secs_f64();
            }
            None => {}
        }
        if stops {
            self.compare(index, time)?;
            self.leave_out(self.advances + 1)?;
        }
        Ok(())
    }

    /// Takes the values of a sample's bodies for the comparison.
    fn compare(&mut self, index: usize, time: f64) -> Result<()> {
        let Some(comparison) = &mut self.comparison else { return Ok(()) };
        let clock = Instant::now();
        let stops = self.observation.as_ref().and_then(Observation::stops);
        comparison.take(index, time, &mut self.group_runs, stops)?;
        self.wall_time.read += clock.elapsed().as_secs_f64();
        Ok(())
    }

    /// The own state of all bodies at the present output time, s, by number.
    fn own_columns(&self, time: f64) -> Vec<Vec<f64>> {
        let stops = self.observation.as_ref().and_then(Observation::stops);
        own_columns(self.plan, &self.own_states, &self.group_runs, (time, stops))
    }

    fn progress(&self) -> Progress {
        Progress { done: self.done, total: self.total }
    }

    /// Reads the states of all bodies and passes them on; without the index of an output, events are sought in them and nothing else is done.
    fn read_all(
        &mut self,
        (index, time): (Option<usize>, f64),
        (asked, last): (bool, bool),
        sink: &mut dyn Sink,
        observer: &mut Observer<'_>,
    ) -> Result<()> {
        let (progress, scene, block) = (self.progress(), self.plan.scene(), self.block);
        let body_count = scene.ensemble().len();
        if !last {
            self.failures.keep_states()?;
        }
        let from_states = if self.reduces { &[][..] } else { &self.statistics };
        let mut from_states = FromStates::new(from_states, blocks_of(scene).collect());
        let stops = scene.stops();
        let wants_own = asked || self.observation.as_ref().is_some_and(Observation::wants_own_state);
        let mut own = if wants_own { self.own_columns(time) } else { Vec::new() };
        for start in (0..body_count).step_by(block) {
            let range = start..(start + block).min(body_count);
            let clock = Instant::now();
            let mut read = || -> Result<()> {
                let initial = last.then_some(&mut self.initial);
                read_states(&mut self.group_runs, &self.centres, &range, &mut self.states, initial)?;
                if let Some(stops) = self.observation.as_ref().and_then(Observation::stops) {
                    stops.hold(start, &mut self.states);
                }
                self.failures.mark(time, start, &mut self.states);
                match &mut self.observation {
                    Some(observation) => observation.push((start, index.is_none()), time, &self.states, &own),
                    None => from_states.push(start, &self.states, |state| &state.rotation),
                }
                if last && !stops {
                    self.end.gather((scene, &self.acting, self.usable_rate), start, &self.initial, &self.states);
                }
                Ok(())
            };
            // On a thread of the pool, so that its threads need not be woken for each part; with few bodies none is.
            if range.len() <= FEW { read() } else { rayon::scope(|_| read()) }?;
            if let Some(observation) = self.observation.as_mut().filter(|_| stops) {
                let centres = &self.centres;
                let centre = |body: usize, time: f64| centres.of_body_at(body, time);
                let states = (&mut self.states[..], &mut own[..]);
                observation.stop((start, index.is_none(), time), states, &centre, &mut |_| observer(progress))?;
                self.failures.withdraw(start, &self.states);
                if last {
                    self.end.gather((scene, &self.acting, self.usable_rate), start, &self.initial, &self.states);
                }
            }
            // While these are passed on, the next are read from the device.
            let next = range.end..(range.end + block).min(body_count);
            self.group_runs.iter_mut().try_for_each(|group_run| group_run.prefetch(&next))?;
            if last {
                let of_block = |body: &&u32| range.contains(&(**body as usize));
                for &body in self.sample.bodies.iter().filter(of_block) {
                    let state = &self.states[body as usize - start];
                    self.sampled.push(state.rotation);
                    self.sampled_centres.push(state.translation);
                    self.sampled_stops.extend(state.stopped_at.map(|time| (body, time)));
                }
            }
            // Forming states as they are read counts as computing.
            let formed: f64 = self.group_runs.iter_mut().map(GroupRun::take_formed).sum();
            self.wall_time.read += clock.elapsed().as_secs_f64() - formed;
            self.wall_time.compute += formed;
            if let Some(index) = index.filter(|_| asked) {
                let clock = Instant::now();
                if !own.is_empty() {
                    sink.own_state(own.iter().map(|own| of_sound(&own[range.clone()], &self.states)).collect())?;
                }
                sink.take_bodies(index, time, start, &mut self.states)?;
                self.wall_time.write += clock.elapsed().as_secs_f64();
            }
            if observer(progress).is_break() {
                let steps = if self.plan.is_closed_form() { 0 } else { self.done / (body_count as u64).max(1) };
                return Err(Error::Interrupted { steps });
            }
        }
        self.failures.end_output(time);
        if let Some(observation) = &mut self.observation {
            let (clock, observer) = (Instant::now(), &mut |_| observer(progress));
            match index {
                Some(index) => observation.finish_output(index, time, sink, observer)?,
                None => observation.finish_check(time, observer)?,
            }
            self.wall_time.observe += clock.elapsed().as_secs_f64();
        } else if let Some(index) = index.filter(|_| !self.reduces && !self.statistics.is_empty()) {
            let found = from_states.finish();
            sink.statistics_of_blocks(index, time, &found)?;
            sink.statistics(index, &Statistics::new(time, &self.statistics, &found))?;
        }
        Ok(())
    }

    /// If states are not read, reads the final states of the sample and finds which bodies have failed.
    fn read_sample(&mut self, time: f64) -> Result<()> {
        let clock = Instant::now();
        let (scene, failures) = (self.plan.scene(), &mut self.failures);
        self.sampled = self.end.gather_sample(
            (scene, &self.acting, self.usable_rate),
            &mut self.group_runs,
            &self.sample.bodies,
            &mut |body, reason| {
                failures.push(body, reason, time);
            },
        )?;
        self.sampled_centres = centres_of(&self.sample.bodies, &mut self.group_runs, &self.centres)?;
        let body_count = scene.ensemble().len();
        for body in lost_centres(&mut self.group_runs, &self.centres, body_count, self.block)? {
            self.failures.push(body, Status::CentreNotFinite, time);
        }
        self.wall_time.read += clock.elapsed().as_secs_f64();
        Ok(())
    }

    /// Returns the trust figures of the run, after its last output.
    pub(super) fn finish_into(self, sink: &mut dyn Sink, observer: &mut Observer<'_>) -> Result<Trust> {
        let (plan, outputs) = (self.plan, self.outputs);
        self.finished(sink, observer).map_err(|error| located(error, plan, outputs))
    }
}

/// Adds the progress of the run to an error of the device.
fn located(error: Error, plan: &Plan<'_>, done: usize) -> Error {
    match error {
        Error::Device { adapter, reason } => {
            let (outputs, bodies) = (plan.times().len(), plan.scene().ensemble().len());
            Error::DeviceInRun { adapter, reason, done, outputs, bodies }
        }
        error => error,
    }
}
