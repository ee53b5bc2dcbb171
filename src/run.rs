//! The loop of a run: advance to an output time, read, hand on, repeat.

use std::ops::{ControlFlow, Range};
use std::time::Instant;

use glam::DVec3;
use rayon::prelude::*;

use crate::batch::{BodyFrame, StateWords, initial_state, prepare_with};
use crate::engine::{Backend, FreeSession, Progress, Session};
use crate::ensemble::Ensemble;
use crate::error::{Error, Result};
use crate::free_motion::AnyRows;
use crate::plan::Plan;
use crate::record::{DriftGatherer, Memory, OutputState, Record, Sink, Trust, WallTime};
use crate::scene::Scene;

/// Bodies that are read and handed on at once: some megabytes.
const READ_BLOCK: usize = 1 << 15;

/// Runs `plan` on `engine` and keeps every output in memory.
///
/// # Errors
///
/// As [`run_into`].
pub fn run(engine: &dyn Backend, plan: &Plan<'_>) -> Result<Record> {
    let mut memory = Memory::default();
    let trust = run_into(engine, plan, &mut memory, &mut |_| ControlFlow::Continue(()))?;
    if memory.snapshots.is_empty() {
        // No bodies, so nothing was handed on; the end is recorded all the same.
        memory.snapshots.push(crate::record::Snapshot::default());
    }
    Ok(Record::new(memory.snapshots, trust))
}

/// Runs `plan` on `engine` and hands every output to `sink`, some bodies at a time.
///
/// `observer` is told of the body-steps done and of all that are to be done, and may break.
///
/// # Errors
///
/// [`Error::TooManyBodies`], [`Error::Device`], [`Error::Interrupted`], and what the sink returns.
pub fn run_into(
    engine: &dyn Backend,
    plan: &Plan<'_>,
    sink: &mut dyn Sink,
    observer: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Trust> {
    let scene = plan.scene();
    let body_count = scene.ensemble().len();
    let mut wall_time = WallTime::default();

    let clock = Instant::now();
    let (frames, mut road) = Road::prepare(plan, engine, &mut wall_time)?;
    wall_time.start = clock.elapsed().as_secs_f64() - wall_time.prepare;

    // In closed form a time is a body's only work.
    let work = if plan.is_closed_form() { plan.times().len() as u64 } else { plan.steps() };
    let total = work.saturating_mul(body_count as u64);
    let mut done = 0_u64;
    let mut drift = DriftGatherer::default();
    let mut failed_bodies = Vec::new();
    let count = plan.times().len();
    for (index, &time) in plan.times().iter().enumerate() {
        let last = index + 1 == count;
        let wanted = sink.wants(index, count, time);
        let clock = Instant::now();
        let before = done;
        match &mut road {
            Road::Stepped(session) => {
                let interval = plan.interval(index);
                session.advance(interval.dt, interval.steps, &mut |progress| {
                    observer(Progress { done: before.saturating_add(progress.done), total })
                })?;
                done = done.saturating_add(interval.steps.saturating_mul(body_count as u64));
            }
            Road::ClosedForm(session) => {
                if wanted || last {
                    session.evaluate(time)?;
                }
                done = done.saturating_add(body_count as u64);
                if observer(Progress { done, total }).is_break() {
                    return Err(Error::Interrupted { steps: 0 });
                }
            }
        }
        wall_time.compute += clock.elapsed().as_secs_f64();

        if !(wanted || last) {
            continue;
        }
        for start in (0..body_count).step_by(READ_BLOCK) {
            let range = start..(start + READ_BLOCK).min(body_count);
            let clock = Instant::now();
            let states = read_states(&mut road, scene, &frames, range.clone(), time)?;
            if last {
                gather_trust(scene.ensemble(), &states, range, &mut drift, &mut failed_bodies);
            }
            wall_time.read += clock.elapsed().as_secs_f64();
            if wanted {
                let clock = Instant::now();
                sink.bodies(index, time, start, &states)?;
                wall_time.write += clock.elapsed().as_secs_f64();
            }
            if observer(Progress { done, total }).is_break() {
                let steps = if plan.is_closed_form() { 0 } else { done / (body_count as u64).max(1) };
                return Err(Error::Interrupted { steps });
            }
        }
    }
    Ok(Trust {
        engine: engine.description(),
        method: plan.method(),
        precision: plan.precision(),
        longest_step: plan.longest_step(),
        closed_form: plan.is_closed_form(),
        body_steps: if plan.is_closed_form() { 0 } else { done },
        drift: drift.finish(),
        failed_bodies,
        wall_time,
    })
}

/// How bodies come from one output time to the next.
enum Road {
    /// Step by step.
    Stepped(Box<dyn Session>),
    /// By the closed form of torque-free motion.
    ClosedForm(Box<dyn FreeSession>),
}

impl Road {
    /// Scales the bodies and opens a session; `wall_time.prepare` takes the time of the former.
    fn prepare(plan: &Plan<'_>, engine: &dyn Backend, wall_time: &mut WallTime) -> Result<(Vec<BodyFrame>, Self)> {
        let ensemble = plan.scene().ensemble();
        let clock = Instant::now();
        if plan.is_closed_form() {
            let (frames, rows) = AnyRows::prepare(ensemble, plan.precision())?;
            wall_time.prepare = clock.elapsed().as_secs_f64();
            return Ok((frames, Self::ClosedForm(engine.start_free(rows)?)));
        }
        let scene = plan.scene();
        let (frames, batch) = prepare_with(ensemble, scene.torques(), scene.end(), plan.precision())?;
        wall_time.prepare = clock.elapsed().as_secs_f64();
        Ok((frames, Self::Stepped(engine.start(batch, plan.method())?)))
    }

    fn read(&mut self, bodies: Range<usize>) -> Result<StateWords> {
        match self {
            Self::Stepped(session) => session.read(bodies),
            Self::ClosedForm(session) => session.read(bodies),
        }
    }
}

/// Some bodies in the user's axes and units.
fn read_states(
    road: &mut Road,
    scene: &Scene,
    frames: &[BodyFrame],
    bodies: Range<usize>,
    time: f64,
) -> Result<Vec<OutputState>> {
    let words = road.read(bodies.clone())?;
    Ok(bodies
        .clone()
        .into_par_iter()
        .map(|body| OutputState {
            rotation: frames[body].body_state(words.combined(body - bodies.start)),
            translation: translation_at(scene, body, time),
        })
        .collect())
}

/// x = x₀ + v₀ t + ½ (F/M) t² and v = v₀ + (F/M) t: a constant force needs no stepping.
fn translation_at(scene: &Scene, body: usize, time: f64) -> Option<(DVec3, DVec3)> {
    let translation = scene.ensemble().translation()?;
    let acceleration = scene.constant_force_world() / translation.mass[body];
    let velocity = translation.velocity[body];
    Some((translation.position[body] + (velocity + acceleration * (0.5 * time)) * time, velocity + acceleration * time))
}

/// Compares the end with the start, body by body, and lists the bodies that are no longer finite.
fn gather_trust(
    ensemble: &Ensemble,
    states: &[OutputState],
    bodies: Range<usize>,
    drift: &mut DriftGatherer,
    failed_bodies: &mut Vec<usize>,
) {
    let initial: Vec<_> = bodies.clone().into_par_iter().map(|body| initial_state(ensemble, body)).collect();
    for ((body, initial), state) in bodies.zip(&initial).zip(states) {
        let rotation = &state.rotation;
        if rotation.orientation.is_finite() && rotation.angular_velocity_body.is_finite() {
            drift.push(initial, rotation);
        } else {
            failed_bodies.push(body);
        }
    }
}
