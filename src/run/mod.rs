//! The loop of a run: advance to an output time, read, hand on, repeat.

use std::collections::BTreeMap;
use std::ops::{ControlFlow, Range};
use std::time::{Duration, Instant};

use glam::DVec3;
use rayon::prelude::*;

use crate::bodies::BodyState;
use crate::bodies::Status;
use crate::engine::Engine;
use crate::engine::watch::{Watch, watched};
use crate::engine::{Backend, Description, EngineKind, Observer, Progress};
use crate::error::{Error, Result};
use crate::plan::errors::Errors;
use crate::plan::sampling::sample;
use crate::plan::{Plan, TorqueSet};
use crate::record::{
    BalanceGatherer, BodyDrift, Conserved, Drift, DriftGatherer, FailedBody, Memory, OutputState, Record, Sink,
    Statistics, Trust, WallTime,
};
use crate::scene::{Scene, Stepping};
use crate::torque::Torque;

pub(crate) mod adaptive_group;
mod balance;
mod evaluated_when_read;
mod failure_times;
mod failures;
#[cfg(feature = "study")]
mod files;
mod group_run;
#[cfg(feature = "study")]
mod initial_file;
#[cfg(feature = "study")]
mod merge;
mod observed;
mod output_statistics;
mod reading;
mod recomputed_centres;
mod recomputed_sample;
mod replay;
pub(crate) mod stepped_translation;
mod torque_work;
mod translation;

pub use balance::balance;
#[cfg(feature = "study")]
pub use files::{OutputSize, run_shard_to_folder, run_to_folder, write_plan};
#[cfg(feature = "study")]
pub use merge::{MergedAccuracy, MergedReport, merge};
pub use replay::{How, Replay, StateError, alone, replay};

use balance::{push_rest, total_energy_change};
use failures::Failures;
use group_run::{GroupRun, blocks_of};
use observed::{Comparison, Observation, compare_events, recomputed_observation};
use output_statistics::FromStates;
use recomputed_centres::recomputed_centres;
use recomputed_sample::{SAMPLE_SEED, recomputed, sample_size};
use translation::Centres;

/// Bodies that are read and handed on at once: on the host little enough for its cache, and from a device so many that a transfer takes
/// longer than its start.
fn read_block(engine: &Description) -> usize {
    match engine.kind {
        EngineKind::Cpu => 1 << 13,
        EngineKind::Gpu => 1 << 15,
    }
}

impl Engine {
    /// Runs a plan and keeps every output in memory.
    ///
    /// # Errors
    ///
    /// As [`run_into`], which hands outputs on instead of keeping them.
    pub fn run(&self, plan: &Plan<'_>) -> Result<Record> {
        run(self, plan)
    }
}

/// Runs `plan` on `engine` and keeps every output in memory.
///
/// # Errors
///
/// As [`run_into`].
pub fn run(engine: &dyn Backend, plan: &Plan<'_>) -> Result<Record> {
    let keeps_states = plan.scene().keeps_states();
    let body_count = plan.scene().ensemble().len();
    let mut memory = Memory { keeps_states, body_count, ..Memory::default() };
    let trust = run_into(engine, plan, &mut memory, &mut |_| ControlFlow::Continue(()))?;
    if keeps_states && memory.snapshots.is_empty() {
        // No bodies, so nothing was handed on; the end is recorded all the same.
        memory.snapshots.push(crate::record::Snapshot::default());
    }
    Ok(Record::new(memory, trust))
}

/// Runs `plan` on `engine` and hands every output to `sink`, some bodies at a time.
///
/// `observer` is told of the body-steps done and of all that are to be done, and may break.
///
/// # Errors
///
/// [`Error::TooManyBodies`], [`Error::DeviceInRun`], [`Error::Interrupted`], and what the sink returns.
pub fn run_into(
    engine: &dyn Backend,
    plan: &Plan<'_>,
    sink: &mut dyn Sink,
    observer: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Trust> {
    let mut done = 0;
    run_counted(engine, plan, sink, observer, &mut done).map_err(|error| match error {
        Error::Device { adapter, reason } => {
            let (outputs, bodies) = (plan.times().len(), plan.scene().ensemble().len());
            Error::DeviceInRun { adapter, reason, done, outputs, bodies }
        }
        error => error,
    })
}

/// As [`run_into`]; counts the outputs that are done in `outputs_done`.
fn run_counted(
    engine: &dyn Backend,
    plan: &Plan<'_>,
    sink: &mut dyn Sink,
    observer: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    outputs_done: &mut usize,
) -> Result<Trust> {
    let scene = plan.scene();
    let body_count = scene.ensemble().len();
    let mut wall_time = WallTime::default();
    let before = engine.traffic();
    // Without skipping they are formed of the states that are read, as is whatever engines do not reduce.
    let statistics = &scene.plain_statistics()[..];
    let reduces = !statistics.is_empty() && scene.may_skip();
    let mut observation = Observation::new(plan)?;
    let mut comparison = Comparison::new(plan)?;
    let once = plan.looks_once();
    let group_runs = plan.groups().iter().map(|group| GroupRun::start(engine, scene, group, once, &mut wall_time));
    let mut group_runs = group_runs.collect::<Result<Vec<_>>>()?;
    let mut centres = Centres::start(plan);
    if reduces {
        let clock = Instant::now();
        group_runs.iter_mut().try_for_each(|group_run| group_run.watch(statistics, usable_rate(scene)))?;
        wall_time.start += clock.elapsed().as_secs_f64();
    }

    // A body that is not stepped has an output time as its only work.
    let total = plan.groups().iter().map(|group| plan.work_of(group)).fold(0, u64::saturating_add);
    let mut done = 0_u64;
    let mut end = AtEnd::default();
    let mut failures = Failures::new(scene.ensemble());
    let sample = sample(body_count, sample_size(body_count), SAMPLE_SEED);
    let (mut sampled, mut sampled_centres) = (Vec::with_capacity(sample.len()), Vec::with_capacity(sample.len()));
    let count = plan.times().len();
    let block = read_block(&engine.description());
    let (mut states, mut initial) = (Vec::new(), Vec::new());
    if let Some(observation) = observation.as_mut().filter(|observation| observation.wants_start()) {
        let clock = Instant::now();
        for start in (0..body_count).step_by(block) {
            initial_states(&group_runs, &(start..(start + block).min(body_count)), &mut initial);
            let rotations = initial.iter().map(|&rotation| OutputState { rotation, translation: None });
            observation.begin(start, &rotations.collect::<Vec<_>>());
        }
        wall_time.read += clock.elapsed().as_secs_f64();
    }
    for (index, &time) in plan.times().iter().enumerate() {
        *outputs_done = index;
        let last = index + 1 == count;
        // Without skipping what nobody asked for is read too.
        let asked = sink.wants(index, count, time);
        let wanted = asked
            || observation.is_some()
            || comparison.is_some() && !reduces
            || !scene.may_skip()
            || (last && !plan.leaves_states());
        let clock = Instant::now();
        let span = plan.span_before(index);
        advance(&mut group_runs, (time, span), wanted || last || reduces, (&mut done, total), observer)?;
        centres.advance(time, plan.interval(index));
        wall_time.compute += clock.elapsed().as_secs_f64();
        if plan.is_closed_form() && observer(Progress { done, total }).is_break() {
            return Err(Error::Interrupted { steps: 0 });
        }
        if let Some(comparison) = &mut comparison {
            let clock = Instant::now();
            comparison.take(index, time, &mut group_runs)?;
            wall_time.read += clock.elapsed().as_secs_f64();
        }
        if reduces {
            let clock = Instant::now();
            let found = output_statistics::reduced(&mut group_runs, statistics)?;
            wall_time.read += clock.elapsed().as_secs_f64();
            sink.statistics_of_blocks(index, time, &found)?;
            sink.statistics(index, &Statistics::new(time, statistics, &found))?;
        }
        if !wanted {
            if last {
                let clock = Instant::now();
                sampled = end.gather_sample(scene, &mut group_runs, &sample, &mut |body, reason| {
                    failures.push(body, reason, time);
                })?;
                sampled_centres = centres_of(&sample, &mut group_runs, &centres)?;
                for body in lost_centres(&mut group_runs, &centres, body_count, block)? {
                    failures.push(body, Status::CentreNotFinite, time);
                }
                wall_time.read += clock.elapsed().as_secs_f64();
            }
            continue;
        }
        if !last {
            failures.keep_states()?;
        }
        let mut from_states = FromStates::new(if reduces { &[] } else { statistics }, blocks_of(scene).collect());
        for start in (0..body_count).step_by(block) {
            let range = start..(start + block).min(body_count);
            let clock = Instant::now();
            // Among the pool's threads, so that they need not be woken for each part of it.
            rayon::scope(|_| -> Result<()> {
                read_states(&mut group_runs, &centres, &range, &mut states, last.then_some(&mut initial))?;
                failures.mark(time, start, &mut states);
                match &mut observation {
                    Some(observation) => observation.push(start, time, &states),
                    None => from_states.push(start, &states),
                }
                if last {
                    end.gather(scene, start, &initial, &states);
                }
                Ok(())
            })?;
            // While these are handed on, the next come to the host.
            let next = range.end..(range.end + block).min(body_count);
            group_runs.iter_mut().try_for_each(|group_run| group_run.prefetch(&next))?;
            if last {
                let of_block = |body: &&u32| range.contains(&(**body as usize));
                for &body in sample.iter().filter(of_block) {
                    let state = &states[body as usize - start];
                    sampled.push(state.rotation);
                    sampled_centres.push(state.translation);
                }
            }
            // What is formed as it is read is computed all the same.
            let formed: f64 = group_runs.iter_mut().map(GroupRun::take_formed).sum();
            wall_time.read += clock.elapsed().as_secs_f64() - formed;
            wall_time.compute += formed;
            if asked {
                let clock = Instant::now();
                sink.bodies(index, time, start, &states)?;
                wall_time.write += clock.elapsed().as_secs_f64();
            }
            if observer(Progress { done, total }).is_break() {
                let steps = if plan.is_closed_form() { 0 } else { done / (body_count as u64).max(1) };
                return Err(Error::Interrupted { steps });
            }
        }
        failures.end_output(time);
        if let Some(observation) = &mut observation {
            let clock = Instant::now();
            observation.finish_output(index, time, sink, &mut |_| observer(Progress { done, total }))?;
            wall_time.observe += clock.elapsed().as_secs_f64();
        } else if !reduces && !statistics.is_empty() {
            let found = from_states.finish();
            sink.statistics_of_blocks(index, time, &found)?;
            sink.statistics(index, &Statistics::new(time, statistics, &found))?;
        }
    }
    *outputs_done = count;
    let mut works = Vec::new();
    for group_run in &mut group_runs {
        works.extend(group_run.adaptive_work()?);
    }
    let adaptive = adaptive_group::total_work(works, failures.count(Status::StepBelowLimit));
    let traffic = engine.traffic().since(before);
    let mut failures = failures.finish();
    let stopped = |failed: &&FailedBody| failed.reason == Status::StepBelowLimit;
    let stopped: Vec<usize> = failures.iter().filter(stopped).map(|failed| failed.body).collect();
    let mut attempts = BTreeMap::new();
    if !stopped.is_empty() {
        for group_run in &mut group_runs {
            attempts.extend(group_run.attempts(&stopped)?);
        }
    }
    drop(group_runs);

    let clock = Instant::now();
    let attempts = |body: usize| attempts.get(&body).copied().unwrap_or(u64::MAX);
    failure_times::find(plan, &mut failures, &attempts, &mut |_| observer(Progress { done, total }))?;
    // The drift's quantiles beside the recomputed sample, whose few bodies are not enough for all cores.
    let (mut drift, gathered) = (Drift::default(), std::mem::take(&mut end.drift));
    let recomputed = rayon::in_place_scope(|scope| {
        scope.spawn(|_| drift = gathered.finish());
        recomputed(plan, &sample, &mut |_| observer(Progress { done, total }))
    })?;
    let recomputed_centres = recomputed_centres(plan, &sample, &mut |_| observer(Progress { done, total }))?;
    let has_failed = |body: usize| failures.binary_search_by_key(&body, |failed| failed.body).is_ok();
    let mut events = observation.map(Observation::finish);
    let mut statistics = None;
    if comparison.is_some() || events.as_ref().is_some_and(|events| !events.is_empty()) {
        let compared = comparison.as_ref().map_or(&sample[..], Comparison::bodies);
        let outputs = comparison.as_ref().map_or(&[][..], Comparison::outputs);
        let report = &mut |_| observer(Progress { done, total });
        let reference = recomputed_observation(plan, compared, outputs, report)?;
        let events = events.as_deref_mut().unwrap_or_default();
        if let Some(reference) = &reference {
            compare_events(events, compared, &reference.events);
        }
        let failed = failures.len();
        statistics = comparison.map(|comparison| comparison.finish(events, reference.as_ref(), has_failed, failed));
    }
    if let Some(events) = events {
        sink.events(events)?;
    }
    let mut errors = Errors::default();
    let (mut lost, mut diverged) = (0, 0);
    for ((state, centre), reference) in sampled.iter().zip(sampled_centres).zip(&recomputed) {
        if !state.is_sound() || has_failed(reference.body) {
            lost += 1;
        } else if !reference.state.is_sound() {
            // There is nothing to compare with.
            diverged += 1;
        } else {
            errors.push(state, &reference.state);
            if let (Some(centre), Some(reference)) = (centre, recomputed_centres.get(&reference.body)) {
                errors.push_centre(centre, *reference);
            }
            push_rest(&mut end.balance, scene, reference.body, state, reference.work.as_ref());
        }
    }
    let draws = scene.torques().iter().any(Torque::is_random);
    let target = match scene.stepping() {
        Stepping::Accuracy(accuracy) => Some(accuracy),
        Stepping::Statistics(_) | Stepping::Pinned { .. } | Stepping::Adaptive { .. } => None,
    };
    let failed = failures.len() as f64 / body_count.max(1) as f64;
    let recomputed_sample = errors.into_recomputed_sample(target.as_ref(), draws, (lost, diverged), failed);
    wall_time.recomputed_sample = clock.elapsed().as_secs_f64();
    Ok(Trust {
        engine: engine.description(),
        method: plan.method(),
        precision: plan.precision(),
        longest_step: plan.longest_step(),
        parts: plan.parts(),
        body_steps: plan.body_steps() + adaptive.map_or(0, |work| work.accepted.total + work.rejected.total),
        adaptive,
        traffic,
        drift,
        balance: end.balance.finish(),
        recomputed_sample,
        statistics,
        failed_bodies: failures.iter().map(|failed| failed.body).collect(),
        failures,
        outside_usable_region: end.outside_usable_region,
        wall_time,
    })
}

/// Brings all groups from `time − span` to `time`, s: side by side those that the host's threads step, and beside these the others one by one.
/// What is not stepped is formed where it is `wanted`. `done`, of `total`, is raised by the work.
fn advance(
    group_runs: &mut [GroupRun<'_>],
    (time, span): (f64, f64),
    wanted: bool,
    (done, total): (&mut u64, u64),
    observer: &mut Observer<'_>,
) -> Result<()> {
    let bodies = group_runs.iter().map(|group_run| group_run.body_count() as u64).sum::<u64>().max(1);
    let (on_host, mut others): (Vec<_>, Vec<_>) = group_runs.iter_mut().partition(|group_run| group_run.has_job());
    let is_on_host = !on_host.is_empty();
    let mut jobs = Vec::new();
    for group_run in on_host {
        jobs.extend(group_run.job(time, span)?);
    }
    let before = *done;
    let work = |watch: &Watch| jobs.into_par_iter().for_each(|job| job(watch));
    let mut advance_others = |observer: &mut Observer<'_>| -> Result<u64> {
        others.iter_mut().try_fold(0, |sum: u64, group_run| {
            let mut report = |progress: Progress| observer(Progress { done: sum.saturating_add(progress.done), total });
            Ok(sum.saturating_add(group_run.advance(time, span, wanted, &mut report)?))
        })
    };
    if !is_on_host {
        let mut report = |progress: Progress| observer(Progress { done: before.saturating_add(progress.done), total });
        *done = before.saturating_add(advance_others(&mut report)?);
        return Ok(());
    }
    // What the threads have done is known to this one, and what the device has done, to a thread that waits for it.
    let of_others = Watch::default();
    std::thread::scope(|scope| {
        let others = scope.spawn(|| {
            advance_others(&mut |progress| {
                of_others.set(progress.done);
                if of_others.goes_on() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
            })
        });
        let mut report = |progress: Progress| {
            *done = before.saturating_add(progress.done).saturating_add(of_others.done());
            let answer = observer(Progress { done: *done, total });
            if answer.is_break() {
                of_others.stop();
            }
            answer
        };
        let mut own = 0;
        let finished = watched(work, total, &mut |progress| {
            own = progress.done;
            report(progress)
        });
        while !others.is_finished() {
            std::thread::sleep(POLL);
            let _ = report(Progress { done: own, total });
        }
        let of_others = others.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        finished.map_err(|_| Error::Interrupted { steps: *done / bodies })?;
        *done = before.saturating_add(own).saturating_add(of_others?);
        Ok(())
    })
}

/// How often this thread looks whether a device has come to the end.
const POLL: Duration = Duration::from_millis(2);

/// Some bodies in the user's axes and units, to `states`, and as they started, to `initial`. Each body is of one group, so every
/// place is written, whatever stood there; with debug assertions nothing stands there, so that one left out shows.
fn read_states(
    group_runs: &mut [GroupRun<'_>],
    centres: &Centres<'_>,
    bodies: &Range<usize>,
    states: &mut Vec<OutputState>,
    mut initial: Option<&mut Vec<BodyState>>,
) -> Result<()> {
    if cfg!(debug_assertions) {
        states.clear();
        initial.iter_mut().for_each(|initial| initial.clear());
    }
    make_room(states, bodies.len(), OutputState { rotation: BodyState::UNKNOWN, translation: None });
    if let Some(initial) = &mut initial {
        make_room(initial, bodies.len(), BodyState::UNKNOWN);
    }
    group_runs
        .iter_mut()
        .try_for_each(|group_run| group_run.read(bodies, states, initial.as_mut().map(|initial| &mut initial[..])))?;
    if centres.are_moving() {
        let places = bodies.clone().into_par_iter().zip(&mut *states);
        places.for_each(|(body, state)| state.translation = centres.of_body(body));
    }
    if group_runs.iter().any(GroupRun::has_centres) {
        for (state, centre) in states.iter_mut().zip(stepped_centres(group_runs, bodies)?) {
            state.translation = centre.or(state.translation.filter(|_| centres.are_moving()));
        }
    }
    Ok(())
}

/// The states in which some bodies start.
fn initial_states(group_runs: &[GroupRun<'_>], bodies: &Range<usize>, initial: &mut Vec<BodyState>) {
    make_room(initial, bodies.len(), BodyState::UNKNOWN);
    group_runs.iter().for_each(|group_run| group_run.read_initial(bodies, initial));
}

/// The centres of mass of some bodies, where they are stepped along the rotation.
fn stepped_centres(group_runs: &mut [GroupRun<'_>], bodies: &Range<usize>) -> Result<Vec<Option<(DVec3, DVec3)>>> {
    let mut stepped = vec![None; bodies.len()];
    group_runs.iter_mut().try_for_each(|group_run| group_run.read_centres(bodies, &mut stepped))?;
    Ok(stepped)
}

/// The centres of mass of a sample's bodies; `None` of those that do not move.
fn centres_of(
    sample: &[u32],
    group_runs: &mut [GroupRun<'_>],
    centres: &Centres<'_>,
) -> Result<Vec<Option<(DVec3, DVec3)>>> {
    let has_stepped = group_runs.iter().any(GroupRun::has_centres);
    let mut centre = |&body: &u32| -> Result<_> {
        let body = body as usize;
        let stepped = if has_stepped { stepped_centres(group_runs, &(body..body + 1))?.pop().flatten() } else { None };
        Ok(stepped.or_else(|| centres.of_body(body)))
    };
    sample.iter().map(&mut centre).collect()
}

/// The bodies whose centres of mass are not finite, looked at by `block` bodies at a time.
fn lost_centres(
    group_runs: &mut [GroupRun<'_>],
    centres: &Centres<'_>,
    body_count: usize,
    block: usize,
) -> Result<Vec<usize>> {
    let is_lost = |centre: Option<(DVec3, DVec3)>| centre.is_some_and(|(x, v)| !(x.is_finite() && v.is_finite()));
    let mut lost = Vec::new();
    if centres.are_moving() {
        lost.par_extend((0..body_count).into_par_iter().filter(|&body| is_lost(centres.of_body(body))));
    }
    if group_runs.iter().any(GroupRun::has_centres) {
        for start in (0..body_count).step_by(block) {
            let bodies = start..(start + block).min(body_count);
            let stepped = stepped_centres(group_runs, &bodies)?;
            lost.extend(bodies.zip(stepped).filter(|&(_, centre)| is_lost(centre)).map(|(body, _)| body));
        }
    }
    Ok(lost)
}

/// Brings a vector to a length. Where it grows, all cores touch the new memory first, which takes longer than to fill it.
fn make_room<T: Copy + Send + Sync>(places: &mut Vec<T>, len: usize, unknown: T) {
    places.truncate(len);
    places.par_extend((places.len()..len).into_par_iter().with_min_len(reading::TASK).map(|_| unknown));
}

/// What the end says of a run.
#[derive(Default)]
struct AtEnd {
    drift: DriftGatherer,
    balance: BalanceGatherer,
    /// Bodies that turn too far in a given step.
    outside_usable_region: usize,
}

impl AtEnd {
    /// Compares the end with the start, body by body from `first_body` on; bodies that have failed are left out.
    fn gather(&mut self, scene: &Scene, first_body: usize, initial: &[BodyState], states: &[OutputState]) {
        let usable_rate = usable_rate(scene);
        let too_fast = |state: &BodyState| state.angular_velocity_body.length() > usable_rate;
        let compared = |(task, (initial, states)): (usize, (&[BodyState], &[OutputState]))| {
            let mut found = Self::default();
            found.drift.begin_part(states.len());
            for (row, (initial, state)) in initial.iter().zip(states).enumerate() {
                let (body, state) = (first_body + task * COMPARED + row, &state.rotation);
                found.conserved(state.is_sound().then(|| Kept::of(scene, body, initial, state)));
                found.outside_usable_region += usize::from(too_fast(initial) || too_fast(state));
            }
            found
        };
        let tasks = initial.par_chunks(COMPARED).zip(states.par_chunks(COMPARED)).enumerate();
        tasks.map(compared).collect::<Vec<_>>().into_iter().for_each(|found| self.append(found));
    }

    /// Takes what was found of further bodies.
    fn append(&mut self, found: Self) {
        self.drift.append(found.drift);
        self.balance.append(found.balance);
        self.outside_usable_region += found.outside_usable_region;
    }

    /// The same where states are not read: drift and balance of a sample, whose states it gives back, and the rest from
    /// what was marked where the states are. `failed` is told of each body that has failed, and why.
    fn gather_sample(
        &mut self,
        scene: &Scene,
        group_runs: &mut [GroupRun<'_>],
        sample: &[u32],
        failed: &mut dyn FnMut(usize, Status),
    ) -> Result<Vec<BodyState>> {
        let usable_rate = usable_rate(scene);
        let mut states = Vec::with_capacity(sample.len());
        let mut faster = Vec::new();
        for group_run in &mut *group_runs {
            states.extend(group_run.read_bodies(sample)?);
            let marked = group_run.marked(usable_rate)?;
            group_run.reasons(marked.failed)?.into_iter().for_each(|(body, reason)| failed(body, reason));
            faster.extend(marked.faster);
        }
        faster.sort_unstable();
        if usable_rate.is_finite() {
            let start = |&body: &usize| scene.ensemble().angular_velocity_body()[body].length() > usable_rate;
            let at_start = (0..scene.ensemble().len()).filter(start);
            self.outside_usable_region =
                faster.len() + at_start.filter(|body| faster.binary_search(body).is_err()).count();
        }
        states.sort_unstable_by_key(|&(body, _)| body);
        for (body, state) in &states {
            let mut initial = [BodyState::UNKNOWN];
            group_runs.iter().for_each(|group_run| group_run.read_initial(&(*body..body + 1), &mut initial));
            self.conserved(state.is_sound().then(|| Kept::of(scene, *body, &initial[0], state)));
        }
        Ok(states.into_iter().map(|(_, state)| state).collect())
    }

    /// Takes how well a body kept what it keeps.
    fn conserved(&mut self, kept: Option<Kept>) {
        let Some(kept) = kept else { return };
        self.drift.push(kept.drift);
        if let Some(total_energy) = kept.total_energy {
            self.balance.push_total(total_energy);
        }
    }
}

/// Bodies that one task compares.
const COMPARED: usize = 1 << 10;

/// How well a body kept what it keeps.
struct Kept {
    drift: BodyDrift,
    /// What its energy changed by, where torques that have a potential act on it.
    total_energy: Option<f64>,
}

impl Kept {
    /// Compares two states of a body, which are numbers in every place.
    fn of(scene: &Scene, body: usize, initial: &BodyState, state: &BodyState) -> Self {
        let torques = scene.torques();
        let acting = TorqueSet::acting_on(torques, body);
        let from_outside =
            |(index, torque): (usize, &Torque)| acting.contains(index) && !torque.keeps_angular_momentum();
        let conserved = Conserved {
            kinetic_energy: acting.is_empty(),
            angular_momentum: !torques.iter().enumerate().any(from_outside),
        };
        Self {
            drift: BodyDrift::between(initial, state, conserved),
            total_energy: total_energy_change(scene, acting, body, initial, state),
        }
    }
}

/// The spin rate, rad/s, beyond which a body is outside the usable region of the method that is pinned.
fn usable_rate(scene: &Scene) -> f64 {
    match scene.stepping() {
        Stepping::Pinned { method, dt, .. } if scene.end() > 0.0 => method.properties().usable_angle / dt,
        Stepping::Pinned { .. } | Stepping::Accuracy(_) | Stepping::Statistics(_) | Stepping::Adaptive { .. } => {
            f64::INFINITY
        }
    }
}
