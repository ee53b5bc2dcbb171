//! Some bodies of a scene by themselves, on the CPU.

use crate::batch::{BodyState, StateWords, prepare_members};
use crate::engine::adaptive::StepCounts;
use crate::engine::cpu::{Cpu, Width};
use crate::engine::watch::{Job, Watch};
use crate::engine::{Backend, Observer};
use crate::error::Result;
use crate::plan::{Members, Treatment};
use crate::scene::Scene;
use crate::torque::Torque;

/// Some bodies at the end.
#[derive(Debug, Default)]
pub(crate) struct Alone {
    /// The bodies with their states.
    pub states: Vec<(usize, BodyState)>,
    /// The steps of each body, in the same order; none where steps are equal.
    pub counts: Vec<StepCounts>,
}

/// Some bodies after the last of `times`, stepped on all cores as `treatment` says, which must be [`Treatment::Stepped`] or
/// [`Treatment::Adaptive`]; other treatments give none. Without an observer the work is this thread's and that of its pool, which may
/// have other such work to do.
pub(crate) fn states_at_end(
    scene: &Scene,
    times: &[f64],
    torques: &[Torque],
    members: &Members,
    treatment: &Treatment,
    mut observer: Option<&mut Observer<'_>>,
) -> Result<Alone> {
    let Some(precision) = treatment.precision_of_steps() else { return Ok(Alone::default()) };
    let (frames, batch) = prepare_members(scene.ensemble(), torques, scene.end(), members, precision)?;
    let end = times.last().copied().unwrap_or(0.0);
    let state = |row: usize, words: &StateWords| {
        frames[row].at(torques, members.body(row), end).body_state(words.combined(row))
    };
    let states_of = |words: StateWords| (0..members.len()).map(|row| (members.body(row), state(row, &words))).collect();
    let (method, projected) = match *treatment {
        Treatment::Stepped { method, projected, .. } => (method, projected),
        Treatment::Adaptive { steps, .. } => {
            let mut session = Cpu::new(Width::Lanes).start_adaptive(batch, steps)?;
            for &time in times {
                match &mut observer {
                    Some(observer) => session.advance_to(time, observer)?,
                    None => finish(session.job_to(time)?),
                }
            }
            let states = states_of(session.read(0..members.len())?);
            return Ok(Alone { states, counts: session.counts()? });
        }
        Treatment::RegularPrecession | Treatment::ClosedForm { .. } => return Ok(Alone::default()),
    };
    let engine = Cpu::new(Width::Lanes);
    let mut session = if projected { engine.start_projected(batch, method)? } else { engine.start(batch, method)? };
    let mut last = 0.0;
    for &time in times {
        let interval = treatment.interval(time - last);
        match &mut observer {
            Some(observer) => session.advance(interval.dt, interval.steps, observer)?,
            None => finish(session.job(interval.dt, interval.steps)?),
        }
        last = time;
    }
    Ok(Alone { states: states_of(session.read(0..members.len())?), counts: Vec::new() })
}

/// Does what a session of the processor's has to do.
fn finish(job: Option<Job<'_>>) {
    if let Some(job) = job {
        job(&Watch::default());
    }
}
