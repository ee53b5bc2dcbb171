//! The loop of a run: advance to an output time, read, hand on, repeat.

use std::ops::{ControlFlow, Range};
use std::time::Instant;

use glam::DVec3;
use rayon::prelude::*;

use crate::batch::{BodyFrame, initial_state, prepare_with};
use crate::engine::{Backend, Progress, Session};
use crate::ensemble::Ensemble;
use crate::error::{Error, Result};
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
    let (frames, batch) = prepare_with(scene.ensemble(), scene.torques(), scene.end(), plan.precision())?;
    wall_time.prepare = clock.elapsed().as_secs_f64();

    let clock = Instant::now();
    let mut session = engine.start(batch, plan.method())?;
    wall_time.start = clock.elapsed().as_secs_f64();

    let total = plan.steps().saturating_mul(body_count as u64);
    let mut done = 0_u64;
    let mut drift = DriftGatherer::default();
    let mut failed_bodies = Vec::new();
    let count = plan.times().len();
    for (index, &time) in plan.times().iter().enumerate() {
        let interval = plan.interval(index);
        let clock = Instant::now();
        let before = done;
        session.advance(interval.dt, interval.steps, &mut |progress| {
            observer(Progress { done: before.saturating_add(progress.done), total })
        })?;
        done = done.saturating_add(interval.steps.saturating_mul(body_count as u64));
        wall_time.compute += clock.elapsed().as_secs_f64();

        let last = index + 1 == count;
        let wanted = sink.wants(index, count, time);
        if !(wanted || last) {
            continue;
        }
        for start in (0..body_count).step_by(READ_BLOCK) {
            let range = start..(start + READ_BLOCK).min(body_count);
            let clock = Instant::now();
            let states = read_states(session.as_mut(), scene, &frames, range.clone(), time)?;
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
                return Err(Error::Interrupted { steps: done / (body_count as u64).max(1) });
            }
        }
    }
    Ok(Trust {
        engine: engine.description(),
        method: plan.method(),
        precision: plan.precision(),
        longest_step: plan.longest_step(),
        body_steps: done,
        drift: drift.finish(),
        failed_bodies,
        wall_time,
    })
}

/// Some bodies in the user's axes and units.
fn read_states(
    session: &mut dyn Session,
    scene: &Scene,
    frames: &[BodyFrame],
    bodies: Range<usize>,
    time: f64,
) -> Result<Vec<OutputState>> {
    let words = session.read(bodies.clone())?;
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
