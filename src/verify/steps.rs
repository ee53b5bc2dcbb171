//! Equal steps, one by one from the twin's states, and several in one call.

use super::bound::{RowBound, StepBounds, Stepped};
use super::compare::{Comparison, Field, Gap, Place, excess, first_bit_difference, gaps, is_lost};
use super::culprit::{Culprit, Retaken, Traced, traced};
use super::onset::{Onset, onset};
use super::slopes::SlopesOf;
use super::stage::{self, Evaluated, NoStage};
use super::subject::{Side, Subject, TWIN, in_one_word, start_clock};
use super::tapped::Tap;
use super::translation::Flown;
use super::{Found, Window};
use crate::bodies::columns::StateWords;
use crate::engine::batch::AnyBatch;
use crate::engine::cpu::Cpu;
use crate::engine::{Backend, End, Session, unobserved};
use crate::error::Result;
use crate::kernel::method::Method;
use crate::math::Precision;
use crate::math::clock::Clock;
use crate::math::parallel;
use crate::plan::{Interval, Plan, Treatment};

/// The kernel of a group's steps.
#[derive(Clone, Copy, Debug)]
pub(super) struct Kernel {
    pub method: Method,
    pub projected: bool,
}

impl Kernel {
    fn start(self, engine: &dyn Backend, batch: AnyBatch) -> Result<Box<dyn Session>> {
        if self.projected { engine.start_projected(batch, self.method) } else { engine.start(batch, self.method) }
    }

    /// The state of all bodies after one step.
    fn step(self, engine: &dyn Backend, batch: AnyBatch, dt: f64) -> Result<StateWords> {
        let bodies = batch.body_count();
        let mut session = self.start(engine, batch)?;
        session.advance_to(End::of_steps(dt, 1), &mut unobserved)?;
        session.read(0..bodies)
    }
}

/// One step of a group: its number from 1, its start, and its size, s.
#[derive(Clone, Copy, Debug)]
struct OneStep {
    number: u64,
    clock: Clock,
    dt: f64,
}

/// The steps of a group between output times.
struct Schedule {
    /// The intervals, with the number of steps before each.
    intervals: Vec<(u64, Clock, Interval)>,
    total: u64,
}

impl Schedule {
    fn new(plan: &Plan<'_>, treatment: &Treatment, start: Clock) -> Self {
        let (mut clock, mut total, mut intervals) = (start, 0_u64, Vec::new());
        for index in 0..plan.advance_times().len() {
            let interval = treatment.interval(plan.span_before(index));
            intervals.push((total, clock, interval));
            total = total.saturating_add(interval.steps);
            clock = clock.after(interval.dt, interval.steps);
        }
        Self { intervals, total }
    }

    /// A step by its index.
    fn step(&self, number: u64) -> OneStep {
        let index = self.intervals.partition_point(|(before, ..)| *before <= number) - 1;
        let (before, clock, Interval { dt, .. }) = self.intervals[index];
        OneStep { number: number + 1, clock: clock.after(dt, number - before), dt }
    }

    /// The steps with indices in a window, cut where their size changes: the first of each part, and how many there are.
    fn parts(&self, first: u64, end: u64) -> Vec<(OneStep, u64)> {
        let cut = |&(before, _, Interval { steps, .. }): &(u64, Clock, Interval)| {
            let (start, end) = (before.max(first), (before + steps).min(end));
            (start < end).then(|| (self.step(start), end - start))
        };
        self.intervals.iter().filter_map(cut).collect()
    }
}

/// The note for a group whose torques cannot be recorded together.
pub(super) const NO_BOUNDS: &str = "bounds: none are known, as the torques together are too long to be recorded";

/// Compares the steps of a window.
pub(super) fn compare(
    engine: &dyn Backend,
    plan: &Plan<'_>,
    subject: &Subject<'_>,
    treatment: &Treatment,
    kernel: Kernel,
    window: Window,
) -> Result<Found> {
    let schedule = Schedule::new(plan, treatment, start_clock(&subject.twin));
    let steps = window.of(schedule.total);
    let mut found = Found { steps: steps.clone(), total: schedule.total, ..Found::default() };
    if steps.is_empty() {
        return Ok(found);
    }
    let twin = Cpu::new(TWIN);
    let bounds = StepBounds::new(subject.twin.torques(), kernel.method, subject.precision, kernel.projected);
    let sides = Side::all(engine);
    let mut comparisons: Vec<Comparison> =
        sides.iter().map(|side| Comparison::new([side.name.clone(), "the scalar twin".into()], true)).collect();
    let mut reference = Comparison::new(["the scalar twin".into(), "the f64 reference".into()], false);

    let start = advanced(kernel, &twin, &subject.twin, &schedule, 0, steps.start)?;
    let mut states = start.clone();
    for number in steps.clone() {
        let step = schedule.step(number);
        let at = |batch: &AnyBatch| batch.at(&states, step.clock);
        let expected = kernel.step(&twin, at(&subject.twin), step.dt)?;
        let row_bounds = row_bounds(subject, &bounds, &step, &states, &expected);
        for (side, comparison) in sides.iter().zip(&mut comparisons) {
            let after = side.with(|engine| kernel.step(engine, at(&subject.batch), step.dt))?;
            if let Some(row) = enter_states(comparison, subject, &step, (&expected, &after), &row_bounds) {
                let traced = OneBody { subject, kernel, side, step, row, state: states.part(row..row + 1) }.traced()?;
                comparison.blame(traced, Onset::NotFound);
            }
        }
        if subject.precision != Precision::F64 {
            let after = kernel.step(&twin, subject.reference.at(&in_one_word(&states), step.clock), step.dt)?;
            enter_states(&mut reference, subject, &step, (&after, &in_one_word(&expected)), &row_bounds);
        }
        states = expected;
    }
    for (side, comparison) in sides.iter().zip(&mut comparisons) {
        compare_cuts(kernel, side, subject, &schedule, (&start, steps.clone()), comparison)?;
    }
    found.comparisons = comparisons;
    if reference.compared > 0 {
        found.comparisons.push(reference);
    }
    if !bounds.are_known() {
        found.notes.push(NO_BOUNDS.into());
    }
    if kernel.projected {
        found
            .notes
            .push("what a body conserves is formed anew for every step that is compared, from the twin's state".into());
    }
    if let Some(flown) = Flown::of(plan.scene(), subject, treatment) {
        let parts = schedule.parts(steps.start, steps.end);
        let parts: Vec<_> = parts.iter().map(|(step, count)| (step.number, step.clock, step.dt, *count)).collect();
        flown.compare(engine, kernel.method, &start, &parts, &mut found)?;
    }
    Ok(found)
}

/// The states of all bodies after the steps from index `first` to before `end`.
fn advanced(
    kernel: Kernel,
    engine: &dyn Backend,
    batch: &AnyBatch,
    schedule: &Schedule,
    first: u64,
    end: u64,
) -> Result<StateWords> {
    let bodies = batch.body_count();
    let mut session = kernel.start(engine, batch.clone())?;
    for (step, count) in schedule.parts(first, end) {
        session.advance_to(End::of_steps(step.dt, count), &mut unobserved)?;
    }
    session.read(0..bodies)
}

/// The bounds of all bodies.
fn row_bounds(
    subject: &Subject<'_>,
    bounds: &StepBounds,
    step: &OneStep,
    states: &StateWords,
    expected: &StateWords,
) -> Vec<Option<RowBound>> {
    let of = |row: usize| {
        let (start, end) = (states.combined(row), expected.combined(row));
        let ticks = step.clock.ticks();
        bounds.of(&subject.twin, &Stepped { row, ticks, dt: step.dt, start: &start, end: &end })
    };
    parallel::map(subject.len(), of)
}

/// Enters the differences between two states of all bodies; returns the first row beyond its bound.
fn enter_states(
    comparison: &mut Comparison,
    subject: &Subject<'_>,
    step: &OneStep,
    (expected, found): (&StateWords, &StateWords),
    bounds: &[Option<RowBound>],
) -> Option<usize> {
    let mut first = None;
    for (row, bound) in bounds.iter().enumerate() {
        let place = Place { body: subject.members.body(row), step: step.number, time: step.clock.seconds() };
        if enter_row(comparison, subject, place, (expected, found, row), bound.as_ref()) && first.is_none() {
            first = Some(row);
        }
    }
    first
}

/// The same for one body; returns whether it is the first beyond its bound.
pub(super) fn enter_row(
    comparison: &mut Comparison,
    subject: &Subject<'_>,
    place: Place,
    (expected, found, row): (&StateWords, &StateWords, usize),
    bound: Option<&RowBound>,
) -> bool {
    let bound = bound.filter(|bound| bound.is_finite());
    let entered = enter_state(comparison, subject.precision, place, (expected, found, row), bound);
    let counter = match (entered, bound) {
        (None, _) => &mut comparison.lost,
        (Some(_), None) => &mut comparison.undecided,
        (Some(_), Some(_)) => &mut comparison.decided,
    };
    *counter += 1;
    entered.unwrap_or(false)
}

/// The same without counting; `None` if the body is lost.
pub(super) fn enter_state(
    comparison: &mut Comparison,
    precision: Precision,
    place: Place,
    (expected, found, row): (&StateWords, &StateWords, usize),
    bound: Option<&RowBound>,
) -> Option<bool> {
    let (before, after) = (expected.combined(row), found.combined(row));
    // A quaternion of zeros is not an orientation.
    let is_none = [&before, &after].into_iter().all(|state| state[..4].iter().all(|&q| q == 0.0));
    if is_none || is_lost(&before, &after, precision) {
        return None;
    }
    let [across, along, momentum] = gaps(&before, &after);
    let [expected, found] = [expected, found].map(|states| states.status[row].code());
    let status = Gap::number(Field::Status, expected, found);
    let of = |part: fn(&RowBound) -> f64| bound.map(part);
    let entries = [
        (across, of(|bound| bound.across)),
        (along, of(|bound| bound.norm)),
        (momentum, of(|bound| bound.momentum)),
        (status, of(|_| 0.0)),
    ];
    let mut parts = false;
    for (gap, bound) in &entries {
        parts |= comparison.enter(gap, *bound, precision, place);
    }
    // Of several at once, the one furthest beyond its bound says the most.
    let beyond = entries.iter().filter_map(|(gap, bound)| Some((gap, bound, excess(gap, *bound)?)));
    if let (true, Some((gap, bound, _))) = (parts, beyond.max_by(|(.., a), (.., b)| a.total_cmp(b))) {
        comparison.part(gap, *bound, place);
    }
    Some(parts)
}

/// One body's step, to be repeated.
struct OneBody<'a> {
    subject: &'a Subject<'a>,
    kernel: Kernel,
    side: &'a Side<'a>,
    step: OneStep,
    /// Its row in the subject, and its state at the start.
    row: usize,
    state: StateWords,
}

impl OneBody<'_> {
    /// Finds which torque makes the sides part, or whether the projection does, and what in the step is at fault.
    fn traced(&self) -> Result<Traced> {
        if !self.kernel.projected {
            return traced(&self.subject.torques, self);
        }
        // A projected body has no torques.
        let unprojected =
            Self { kernel: Kernel { projected: false, ..self.kernel }, state: self.state.clone(), ..*self };
        if unprojected.compared(&[], 1.0)?.parting.is_some() {
            return traced(&[], &unprojected);
        }
        let onset = onset(0, &mut |part| self.compared(&[], part))?;
        Ok(Traced { culprit: Culprit::Projection, onset, stage: Err(NoStage::NoEvaluations) })
    }

    /// How the sides differ after a part of the step, each with its own batch.
    fn taken(&self, [own, twin]: &[AnyBatch; 2], part: f64) -> Result<(Comparison, StateWords)> {
        let Self { subject, kernel, side, step, ref state, .. } = *self;
        let dt = part * step.dt;
        let bounds = StepBounds::new(twin.torques(), kernel.method, subject.precision, kernel.projected);
        let expected = kernel.step(&Cpu::new(TWIN), twin.clone(), dt)?;
        let after = side.with(|engine| kernel.step(engine, own.clone(), dt))?;
        let (start, end) = (state.combined(0), expected.combined(0));
        let bound = bounds.of(twin, &Stepped { row: 0, ticks: step.clock.ticks(), dt, start: &start, end: &end });
        let mut comparison = Comparison::new([String::new(), String::new()], true);
        let place = Place { body: 0, step: step.number, time: 0.0 };
        enter_row(&mut comparison, subject, place, (&expected, &after, 0), bound.as_ref());
        Ok((comparison, expected))
    }
}

impl Retaken for OneBody<'_> {
    fn compared(&self, acting: &[usize], part: f64) -> Result<Comparison> {
        let alone = self.subject.alone(self.row, acting)?.map(|batch| batch.at(&self.state, self.step.clock));
        Ok(self.taken(&alone, part)?.0)
    }

    fn stage(&self, acting: &[usize], onset_from_start: Option<Onset>) -> Result<stage::Found> {
        let Self { subject, kernel, side, step, row, ref state } = *self;
        let [own, twin] = subject.driven_alone(row, acting)?.map(|batch| batch.at(state, step.clock));
        let alone = [own, twin];
        let (comparison, expected) = self.taken(&alone, 1.0)?;
        if comparison.parting.is_none() {
            return Ok(Err(NoStage::Hidden));
        }
        let ([own, twin], OneStep { dt, clock, .. }) = (&alone, step);
        let (start, end) = (state.combined(0), expected.combined(0));
        let step = Stepped { row: 0, ticks: clock.ticks(), dt, start: &start, end: &end };
        let (tap, method) = (Tap::Step { method: kernel.method, dt }, kernel.method);
        let bounds = &StepBounds::new(twin.torques(), method, subject.precision, false);
        if let Some(found) = (Evaluated { side, own, twin, tap, method, bounds, step }).stage()? {
            return Ok(found);
        }
        let (evaluations, under_torques) = (&tap.of_twin(twin), !acting.is_empty());
        let alone = subject.alone(row, acting)?;
        SlopesOf { method, under_torques, onset: onset_from_start, evaluations, twin }.first(&mut |state, elapsed| {
            let clock = if elapsed > 0.0 { clock.at(clock.seconds() + elapsed) } else { clock };
            let from = OneBody { step: OneStep { clock, ..self.step }, state: state.clone(), ..*self };
            let sides = alone.each_ref().map(|batch| batch.at(state, clock));
            onset(0, &mut |part| Ok(from.taken(&sides, part)?.0))
        })
    }
}

/// Compares all steps of the window in as few calls as possible with single steps: their bits must be equal.
fn compare_cuts(
    kernel: Kernel,
    side: &Side<'_>,
    subject: &Subject<'_>,
    schedule: &Schedule,
    (states, steps): (&StateWords, std::ops::Range<u64>),
    comparison: &mut Comparison,
) -> Result<()> {
    let first = schedule.step(steps.start);
    let batch = subject.batch.at(states, first.clock);
    let [whole, cut] = side.with(|engine| -> Result<_> {
        let bodies = batch.body_count();
        let mut session = kernel.start(engine, batch.clone())?;
        for number in steps.clone() {
            session.advance_to(End::of_steps(schedule.step(number).dt, 1), &mut unobserved)?;
        }
        Ok([advanced(kernel, engine, &batch, schedule, steps.start, steps.end)?, session.read(0..bodies)?])
    })?;
    let (row, gap) = match first_bit_difference(&cut, &whole) {
        Some(found) => found,
        None => (0, Gap::number(Field::Cuts, 0.0, 0.0)),
    };
    let place = Place { body: subject.members.body(row), step: steps.end, time: first.clock.seconds() };
    comparison.enter(&gap, Some(0.0), subject.precision, place);
    Ok(())
}
