//! The strategies for solving a problem, and one timed repeat of each.

use std::ops::ControlFlow;
use std::time::Instant;

use super::problem::Problem;
use super::timing::{Repeats, Timing, repeat};
use super::warm::Warm;
use crate::bodies::blocks::cut;
use crate::bodies::columns::StateWords;
use crate::bodies::{BodyFrame, BodyState, Members};
use crate::engine::StepCounts;
use crate::engine::batch::{Prepared, ordered_together, prepare_ordered, prepare_with};
use crate::engine::{Backend, End, Engine, EngineKind, Session, unobserved};
use crate::error::Result;
use crate::kernel::free_motion::AnyRows;
use crate::kernel::method::Method;
use crate::math::Precision;
use crate::plan::Plan;
use crate::plan::subset::order_by_work;
use crate::record::{OutputState, Sink};
use crate::scene::{Accuracy, AdaptiveSteps};

/// How a problem is solved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Strategy {
    /// In equal steps over the span.
    Stepped {
        /// The integrator.
        method: Method,
        /// The arithmetic.
        precision: Precision,
        /// Number of steps.
        steps: u64,
    },
    /// In adaptive steps.
    Adaptive {
        /// The integrator.
        method: Method,
        /// The arithmetic.
        precision: Precision,
        /// The tolerance of a step.
        tolerance: f64,
    },
    /// By the closed form of torque-free motion.
    ClosedForm {
        /// The arithmetic.
        precision: Precision,
    },
    /// As the library chooses for an attitude error asked for.
    Asked {
        /// The attitude error in the 99th percentile, rad.
        tolerance: f64,
    },
}

impl Strategy {
    /// The name of the method, `closed form`, or `chosen`.
    pub fn method(&self) -> &'static str {
        match self {
            Strategy::Stepped { method, .. } => method.name(),
            Strategy::Adaptive { method: Method::Rk8, .. } => crate::plan::ADAPTIVE,
            Strategy::Adaptive { method, .. } => method.name(),
            Strategy::ClosedForm { .. } => crate::plan::CLOSED_FORM,
            Strategy::Asked { .. } => "chosen",
        }
    }

    /// The name of the arithmetic, or `chosen`.
    pub fn precision(&self) -> &'static str {
        match self {
            Strategy::Stepped { precision, .. }
            | Strategy::Adaptive { precision, .. }
            | Strategy::ClosedForm { precision } => precision.name(),
            Strategy::Asked { .. } => "chosen",
        }
    }
}

/// One repeat of a case.
#[derive(Debug, Default)]
pub(super) struct Sample {
    /// Principal axes, scaling, columns, constants, s.
    pub prepare: f64,
    /// Upload and shader compilation, s.
    pub start: f64,
    /// Integration or evaluation, s.
    pub compute: f64,
    /// Steps of all bodies together.
    pub body_steps: u64,
    /// The states at the end.
    pub states: Vec<BodyState>,
}

/// The first of several repeats, and the wall times of all of them.
pub(super) fn timed(repeats: Repeats, mut work: impl FnMut() -> Result<Sample>) -> Result<(Sample, Timing)> {
    let mut first: Option<Sample> = None;
    let compute = repeat(repeats, || {
        let sample = work()?;
        let seconds = sample.compute;
        first.get_or_insert(sample);
        Ok(seconds)
    })?;
    Ok((first.unwrap_or_default(), compute))
}

/// The first of several repeats, with the time to choose method and step (s; 0 if they are given) and the wall times of all repeats.
pub(super) fn repeated(
    repeats: Repeats,
    engine: &Engine,
    problem: &Problem,
    strategy: Strategy,
    warm: &mut Warm,
) -> Result<(f64, Sample, Timing)> {
    let mut planning = 0.0;
    let (sample, compute) = match strategy {
        Strategy::Stepped { method, precision, steps } => {
            timed(repeats, || stepped(engine, problem, method, precision, steps, warm))?
        }
        Strategy::Adaptive { method, precision, tolerance } => {
            let steps = AdaptiveSteps { tolerance, least_step: None };
            let scene = match method {
                Method::Taylor => problem.scene().taylor(steps),
                _ => problem.scene().adaptive(steps, Some(precision)),
            };
            let plan = Plan::new(&scene, engine)?;
            timed(repeats, || planned(engine, &plan, warm))?
        }
        Strategy::ClosedForm { precision } => timed(repeats, || closed_form(engine, problem, precision, warm))?,
        Strategy::Asked { tolerance } => {
            let scene = problem.scene().accuracy(Accuracy::attitude(tolerance));
            let clock = Instant::now();
            let plan = Plan::new(&scene, engine)?;
            planning = clock.elapsed().as_secs_f64();
            timed(repeats, || planned(engine, &plan, warm))?
        }
    };
    Ok((planning, sample, compute))
}

/// One repeat in equal steps.
pub(super) fn stepped(
    engine: &Engine,
    problem: &Problem,
    method: Method,
    precision: Precision,
    steps: u64,
    warm: &mut Warm,
) -> Result<Sample> {
    let dt = problem.span / steps as f64;
    let clock = Instant::now();
    let (frames, batch) = prepare_with(&problem.ensemble, &problem.torques, problem.span, precision)?;
    let prepare = clock.elapsed().as_secs_f64();
    let clock = Instant::now();
    let mut session = engine.start(batch, method)?;
    let start = clock.elapsed().as_secs_f64();
    // One step that is not timed, so that shaders are compiled and threads awake; results do not depend on how steps are divided into
    // calls.
    session.advance_to(End::of_steps(dt, 1), &mut unobserved)?;
    warm.up()?;
    let clock = Instant::now();
    session.advance_to(End::of_steps(dt, steps - 1), &mut unobserved)?;
    let compute = clock.elapsed().as_secs_f64() * steps as f64 / (steps - 1) as f64;
    let states = states(&frames, &session.read(0..frames.len())?);
    Ok(Sample { prepare, start, compute, body_steps: steps * frames.len() as u64, states })
}

/// Evaluations that are timed together on a GPU: its ceiling, copies, is timed so too ([`super::ceiling`]). The wait for one evaluation of a
/// million bodies takes longer than the evaluation.
const EVALUATIONS: u32 = 64;

/// One repeat in closed form.
pub(super) fn closed_form(engine: &Engine, problem: &Problem, precision: Precision, warm: &mut Warm) -> Result<Sample> {
    let clock = Instant::now();
    let (frames, rows) = AnyRows::prepare(&problem.ensemble, precision)?;
    let prepare = clock.elapsed().as_secs_f64();
    let clock = Instant::now();
    let mut session = engine.start_free(rows)?;
    let start = clock.elapsed().as_secs_f64();
    // One evaluation that is not timed, for the same reason.
    session.advance_to(End::at(0.5 * problem.span), &mut unobserved)?;
    session.read(0..1)?;
    warm.up()?;
    let description = engine.description();
    let is_real = description.kind == EngineKind::Gpu && !description.software;
    let evaluations = if is_real { EVALUATIONS } else { 1 };
    let clock = Instant::now();
    for evaluation in 1..=evaluations {
        session.advance_to(End::at(problem.span * f64::from(evaluation) / f64::from(evaluations)), &mut unobserved)?;
    }
    // The engine need not have waited for them.
    session.read(0..1)?;
    let compute = clock.elapsed().as_secs_f64() / f64::from(evaluations);
    let states = states(&frames, &session.read(0..frames.len())?);
    Ok(Sample { prepare, start, compute, body_steps: 0, states })
}

/// The part of the span that adaptive steps take before they are timed.
const UNTIMED: f64 = 1.0 / 16.0;

/// One repeat of `rk8` in adaptive steps, with all bodies in one session and ordered by their work as in a run.
pub(super) fn adaptive(
    engine: &Engine,
    problem: &Problem,
    precision: Precision,
    tolerance: f64,
    warm: &mut Warm,
) -> Result<(Sample, f64)> {
    let clock = Instant::now();
    let scene = problem.scene();
    let members = Members::All(problem.ensemble.len());
    let mut session_rows = vec![0; members.len()];
    let by_work =
        |start: usize, prepared: &[Prepared]| order_by_work(&scene, &members, start, prepared, &mut session_rows);
    let cuts = cut(members.len(), ordered_together(engine.description().kind), &[]);
    let ordered = (&cuts[..], by_work);
    let (frames, batch) =
        prepare_ordered(&problem.ensemble, &problem.torques, problem.span, &members, precision, ordered)?;
    let prepare = clock.elapsed().as_secs_f64();
    let clock = Instant::now();
    let mut session = engine.start_adaptive(batch, AdaptiveSteps { tolerance, least_step: None })?;
    let start = clock.elapsed().as_secs_f64();
    // Shaders are compiled then, first steps are found, and the engine knows how many attempts fit into a submission.
    session.advance_to(End::at(UNTIMED * problem.span), &mut unobserved)?;
    let attempts =
        |session: &mut dyn Session| -> Result<u64> { Ok(session.counts()?.iter().map(StepCounts::attempts).sum()) };
    let before = attempts(&mut *session)?;
    warm.up()?;
    let clock = Instant::now();
    session.advance_to(End::at(problem.span), &mut unobserved)?;
    let compute = clock.elapsed().as_secs_f64();
    let body_steps = attempts(&mut *session)? - before;
    let imbalance = session.imbalance()?;
    let words = session.read(0..frames.len())?;
    let states = frames.iter().zip(session_rows).map(|(frame, row)| frame.state_of(&words, row as usize)).collect();
    Ok((Sample { prepare, start, compute, body_steps, states }, imbalance))
}

/// One repeat of a plan.
pub(super) fn planned(engine: &Engine, plan: &Plan<'_>, warm: &mut Warm) -> Result<Sample> {
    warm.up()?;
    let mut reader = Reader::default();
    let trust = crate::run::run_into(engine, plan, &mut reader, &mut |_| ControlFlow::Continue(()))?;
    let time = trust.wall_time;
    let sample = Sample { prepare: time.prepare, start: time.start, compute: time.compute, ..Sample::default() };
    Ok(Sample { body_steps: trust.body_steps, states: reader.states, ..sample })
}

/// Reads every output, or only the last, and keeps the final states.
#[derive(Debug, Default)]
pub(super) struct Reader {
    pub every: bool,
    pub last: bool,
    pub states: Vec<BodyState>,
}

impl Sink for Reader {
    fn wants(&mut self, index: usize, count: usize, _: f64) -> bool {
        self.last = index + 1 == count;
        self.every || self.last
    }

    fn bodies(&mut self, _: usize, _: f64, _: usize, states: &[OutputState]) -> Result<()> {
        if self.last {
            self.states.extend(states.iter().map(|state| state.rotation));
        }
        Ok(())
    }
}

fn states(frames: &[BodyFrame], words: &StateWords) -> Vec<BodyState> {
    frames.iter().enumerate().map(|(body, frame)| frame.state_of(words, body)).collect()
}
