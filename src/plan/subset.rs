//! Propagates a subset of a scene's bodies on the CPU.

use glam::DVec3;

use super::greatest_rate;
use crate::bodies::BodyFrame;
use crate::bodies::BodyState;
use crate::bodies::Members;
use crate::bodies::blocks::cut;
use crate::bodies::columns::StateWords;
use crate::engine::batch::AnyBatch;
use crate::engine::batch::{Prepared, ordered_together, prepare_ordered};
use crate::engine::controlled::Controls;
use crate::engine::cpu::Cpu;
use crate::engine::load_balance::order;
use crate::engine::watch::Watch;
use crate::engine::{Backend, End, EngineKind, Observer, Session, StepCounts};
use crate::error::Result;
use crate::kernel::method::Method;
use crate::math::Width;
use crate::math::parallel;
use crate::plan::Treatment;
use crate::scene::AdaptiveSteps;
use crate::scene::Scene;
use crate::torque::Torque;

/// The states of a subset of bodies at the end.
#[derive(Debug, Default)]
pub(crate) struct SubsetStates {
    /// The bodies with their states.
    pub states: Vec<(usize, BodyState)>,
    /// The step counts of each body, in the same order; empty for equal steps.
    pub counts: Vec<StepCounts>,
}

/// Who decides whether stepping goes on.
pub(crate) enum Watcher<'o, 'f> {
    /// An observer that is told of progress by a thread of its own.
    Observer(&'o mut Observer<'f>),
    /// An existing watch: the work runs on this thread and its pool, which may have other such work. If it is broken off, the states
    /// belong to no time.
    Watch(&'o Watch),
    /// The same, and bodies that make more than so many attempts at adaptive steps are given up
    /// ([`crate::bodies::Status::StepBelowLimit`]).
    Limit(&'o Watch, u64),
}

/// The states of some bodies at the last of `times`, stepped on all cores as `treatment` says, which must be [`Treatment::Stepped`] or
/// [`Treatment::Adaptive`]; other treatments give no states.
pub(crate) fn propagate_subset(
    scene: &Scene,
    times: &[f64],
    torques: &[Torque],
    members: &Members,
    treatment: &Treatment,
    watcher: Watcher<'_, '_>,
) -> Result<SubsetStates> {
    propagate_subset_through(scene, times, torques, members, (treatment, false), watcher, None)
}

/// Receives the states of a subset of bodies at one of the times, given by its index, with the values that sampled torques hold; at the
/// start, only the latter.
pub(crate) type AtTime<'a> = dyn FnMut(Option<usize>, &[(usize, BodyState)], Option<&Controls>) + 'a;

/// As [`propagate_subset`], with the states at each of the times, which steps by series may pass (`is_dense`).
pub(crate) fn propagate_subset_through(
    scene: &Scene,
    times: &[f64],
    torques: &[Torque],
    members: &Members,
    (treatment, is_dense): (&Treatment, bool),
    mut watcher: Watcher<'_, '_>,
    mut at_time: Option<&mut AtTime<'_>>,
) -> Result<SubsetStates> {
    let Some(precision) = treatment.precision_of_steps() else { return Ok(SubsetStates::default()) };
    let end = times.last().copied().unwrap_or(0.0);
    // The row of each member in the session.
    let mut rows: Vec<u32> = (0..members.len() as u32).collect();
    let adapts = matches!(treatment, Treatment::Adaptive { .. });
    let order = |start: usize, prepared: &[Prepared]| match adapts {
        true => order_by_work(scene, members, start, prepared, &mut rows),
        false => (0..prepared.len()).collect(),
    };
    let cuts = cut(members.len(), ordered_together(EngineKind::Cpu), &[]);
    let (frames, mut batch) =
        prepare_ordered(scene.ensemble(), torques, scene.end(), members, precision, (&cuts, order))?;
    let controls = ordered_controls(torques, &mut batch, &frames, members, &rows);
    let state = |(member, &row): (usize, &u32), time: f64, words: &StateWords| {
        let body = members.body(member);
        (body, frames[member].at(torques, body, time).state_of(words, row as usize))
    };
    let states_of = |time: f64, words: StateWords| -> Vec<(usize, BodyState)> {
        rows.iter().enumerate().map(|member| state(member, time, &words)).collect()
    };
    let engine = Cpu::new(Width::Lanes);
    let (mut session, longest_step) = match *treatment {
        Treatment::Stepped { method, projected: true, longest_step, .. } => {
            (engine.start_projected(batch, method)?, Some(longest_step))
        }
        Treatment::Stepped { method, longest_step, .. } => (engine.start(batch, method)?, Some(longest_step)),
        Treatment::Adaptive { method, steps, .. } => (start(&engine, (method, is_dense), batch, steps)?, None),
        Treatment::RegularPrecession | Treatment::ClosedForm { .. } => return Ok(SubsetStates::default()),
    };
    if let Watcher::Limit(_, most) = watcher {
        session.limit_attempts(most);
    }
    let mut session = Controls::around(controls, session, longest_step);
    if let Some(at_time) = &mut at_time {
        at_time(None, &[], session.controls());
    }
    let mut last = 0.0;
    for (index, &time) in times.iter().enumerate() {
        let end = End { time, steps: treatment.interval(time - last) };
        match &mut watcher {
            Watcher::Observer(observer) => session.advance_to(end, observer)?,
            Watcher::Watch(watch) | Watcher::Limit(watch, _) => {
                session.job_to(end)?.into_iter().for_each(|job| job(watch))
            }
        }
        last = time;
        if let Some(at_time) = &mut at_time {
            at_time(Some(index), &states_of(time, session.read(0..members.len())?), session.controls());
        }
    }
    let counts = session.counts()?;
    Ok(SubsetStates {
        states: states_of(end, session.read(0..members.len())?),
        counts: rows.iter().filter_map(|&row| counts.get(row as usize).copied()).collect(),
    })
}

/// The values that sampled torques hold, in the order of the batch's rows; `session_rows` has the row of each member, `frames` its frame.
pub(crate) fn ordered_controls(
    torques: &[Torque],
    batch: &mut AnyBatch,
    frames: &[BodyFrame],
    members: &Members,
    session_rows: &[u32],
) -> Option<Controls> {
    torques.iter().any(Torque::is_sampled).then_some(())?;
    let mut of_rows = vec![0; session_rows.len()];
    session_rows.iter().enumerate().for_each(|(member, &row)| of_rows[row as usize] = member);
    let frames: Vec<BodyFrame> = of_rows.iter().map(|&member| frames[member]).collect();
    Controls::start(torques, batch, &frames, |row| members.body(of_rows[row]))
}

/// Opens a session of adaptive steps by one of [`Method::ADAPTIVE`].
pub(crate) fn start(
    engine: &dyn Backend,
    (method, is_dense): (Method, bool),
    batch: AnyBatch,
    steps: AdaptiveSteps,
) -> Result<Box<dyn Session>> {
    match method {
        Method::Taylor if is_dense => engine.start_dense_taylor(batch, steps),
        Method::Taylor => engine.start_taylor(batch, steps),
        _ => engine.start_adaptive(batch, steps),
    }
}

/// The members from `start` on, ordered by their expected work, as indices into the prepared ones. Writes the row that each then has in the
/// session to `session_rows`.
pub(crate) fn order_by_work(
    scene: &Scene,
    members: &Members,
    start: usize,
    prepared: &[Prepared],
    session_rows: &mut [u32],
) -> Vec<usize> {
    // All have the same span, so the greatest rate is proportional to their work.
    let rate = |place: usize| {
        let Prepared { frame, driven_rate, initial } = &prepared[place];
        let m = DVec3::new(initial[4], initial[5], initial[6]);
        greatest_rate(scene, members.body(start + place), (frame, *driven_rate), m)
    };
    let order = order(&parallel::rows(prepared.len(), 1, &rate));
    for (session_row, &place) in order.iter().enumerate() {
        session_rows[start + place] = (start + session_row) as u32;
    }
    order
}
