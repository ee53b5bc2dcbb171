//! Adaptive steps, attempt by attempt: from the twin's state and controller each side tries one step, and reports whether it accepts it
//! and what the next step is.

use super::bound::{RowBound, Slopes, StepBounds, Stepped};
use super::compare::{Comparison, Field, Gap, Place};
use super::culprit::{Retaken, Traced, traced};
use super::onset::{Onset, onset};
use super::series_steps::{self, gone, series_step};
use super::slopes::{SlopesOf, first_coefficient};
use super::stage::{self, Evaluated, NoStage};
use super::steps::{NO_BOUNDS, enter_row, enter_state};
use super::subject::{Side, Subject, TWIN, in_one_word, start_clock};
use super::tapped::Tap;
use super::{Found, Window};
use crate::bodies::Status;
use crate::bodies::columns::{RATE_COLUMN, STATE_COMPONENTS, StateWords};
use crate::engine::Backend;
use crate::engine::batch::AnyBatch;
use crate::engine::cpu::Cpu;
use crate::error::Result;
use crate::kernel::method::Method;
use crate::kernel::method::rk8_adaptive::{Controller, LEAST_STEP};
use crate::math::Precision;
use crate::math::clock::Clock;
use crate::math::parallel;
use crate::math::real::Scalar;
use crate::math::vector::{TwoWords, two_words_of};
use crate::plan::Plan;
use crate::plan::subset::start;
use crate::scene::AdaptiveSteps;

/// A tolerance below the greatest possible one, 1.
const LAX_TOLERANCE: f64 = 0.5;

/// The kernel of a group's steps.
#[derive(Clone, Copy, Debug)]
pub(super) struct Kernel {
    pub method: Method,
    pub steps: AdaptiveSteps,
}

/// All bodies of a group at an attempt in the interval from the time of a clock to `end`, s.
#[derive(Clone)]
pub(super) struct Moment {
    clock: Clock,
    end: f64,
    pub states: StateWords,
    pub controllers: Vec<Controller<f64>>,
}

impl Moment {
    fn of_row(&self, row: usize) -> Self {
        Self { states: self.states.part(row..row + 1), controllers: vec![self.controllers[row]], ..*self }
    }

    /// Whether a body's interval is unfinished; for a series including the part through which its attitude has not been brought.
    fn is_under_way(&self, row: usize, method: Method) -> bool {
        let Controller { left, retried, .. } = self.controllers[row];
        let pending = method == Method::Taylor && retried > 0.0;
        (left.value > 0.0 || pending) && self.states.status[row] == Status::Valid
    }
}

impl Kernel {
    /// The same with errors that reject no attempt; Taylor series reject none anyway, and their order follows from the tolerance.
    fn that_takes_any_step(self) -> Self {
        let tolerance = if self.method == Method::Taylor { self.steps.tolerance } else { LAX_TOLERANCE };
        Self { steps: AdaptiveSteps { tolerance, ..self.steps }, ..self }
    }

    /// One attempt of every body under way.
    pub fn attempt(self, engine: &dyn Backend, batch: &AnyBatch, moment: &Moment) -> Result<Moment> {
        let mut session = start(engine, (self.method, false), batch.at(&moment.states, moment.clock), self.steps)?;
        let mut controllers = moment.controllers.clone();
        session.attempt(moment.end, &mut controllers)?;
        Ok(Moment { states: session.read(0..controllers.len())?, controllers, ..*moment })
    }
}

/// Compares the attempts of a window.
pub(super) fn compare(
    engine: &dyn Backend,
    plan: &Plan<'_>,
    subject: &Subject<'_>,
    kernel: Kernel,
    window: Window,
) -> Result<Found> {
    let wanted = window.of(u64::MAX);
    let twin = Cpu::new(TWIN);
    let bounds = StepBounds::new(subject.twin.torques(), kernel.method, subject.precision, false);
    let sides = Side::all(engine);
    let mut comparisons: Vec<Comparison> =
        sides.iter().map(|side| Comparison::new([side.name.clone(), "the scalar twin".into()], true)).collect();
    let mut reference = Comparison::new(["the scalar twin".into(), "the f64 reference".into()], false);

    let first = start_clock(&subject.twin);
    let mut moment = Moment {
        clock: first,
        end: 0.0,
        states: subject.twin.states(),
        controllers: vec![Controller::new(); subject.len()],
    };
    let mut round = 0;
    'times: for (index, &end) in plan.advance_times().iter().enumerate() {
        moment.clock = first.at(if index == 0 { 0.0 } else { plan.advance_times()[index - 1] });
        moment.end = end;
        let span = Span::of(subject, &moment);
        (moment.controllers.iter_mut().enumerate())
            .for_each(|(row, own)| *own = own.over(span.of_row(&subject.twin, row)));
        while (0..subject.len()).any(|row| moment.is_under_way(row, kernel.method)) {
            if round >= wanted.end {
                break 'times;
            }
            let expected = kernel.attempt(&twin, &subject.twin, &moment)?;
            if round >= wanted.start {
                let attempt = |side: &Side<'_>| side.with(|engine| kernel.attempt(engine, &subject.batch, &moment));
                let afters: Vec<Moment> = sides.iter().map(attempt).collect::<Result<_>>()?;
                let scatter = series_steps::scatter(kernel, &subject.twin, (&moment, &expected), &afters)?;
                let trials = trials(subject, kernel, &bounds, (&moment, &expected, &scatter), &span);
                for ((side, comparison), after) in sides.iter().zip(&mut comparisons).zip(&afters) {
                    let parted = (0..subject.len())
                        .filter(|&row| enter(comparison, subject, &trials[row], (&expected, after), row))
                        .collect::<Vec<_>>();
                    if let Some(&row) = parted.first() {
                        let moments = (&moment, &expected);
                        let body = OneBody::new(subject, kernel, side, moments, row);
                        let traced: Traced = traced(&subject.torques, &body)?;
                        let agreed = body.onset_where_states_agree(comparison);
                        comparison.blame(traced, agreed);
                    }
                }
                if subject.precision != Precision::F64 {
                    let wide = Moment { states: in_one_word(&moment.states), ..moment.clone() };
                    let after = kernel.attempt(&twin, &subject.reference, &wide)?;
                    let expected = Moment { states: in_one_word(&expected.states), ..expected.clone() };
                    for (row, trial) in trials.iter().enumerate() {
                        // If they decide alike.
                        if trial.tries && expected.controllers[row].accepted == after.controllers[row].accepted {
                            let states = (&after.states, &expected.states, row);
                            enter_row(&mut reference, subject, trial.place, states, trial.bound.as_ref());
                        }
                    }
                }
            }
            moment = expected;
            round += 1;
        }
    }
    let compared = wanted.start.min(round)..wanted.end.min(round);
    let mut found = Found { steps: compared, total: round, comparisons, ..Found::default() };
    if reference.compared > 0 {
        found.comparisons.push(reference);
    }
    if !bounds.are_known() {
        found.notes.push(NO_BOUNDS.into());
    }
    found
        .notes
        .push("attempts in one call and one by one: tests hold them equal (tests/mirror/adaptive_parity)".into());
    Ok(found)
}

/// The length of an interval, s, in the words of a precision.
struct Span {
    seconds: [f64; 2],
}

impl Span {
    fn of(subject: &Subject<'_>, moment: &Moment) -> Self {
        let (value, residue) = moment.clock.seconds_until(&moment.clock.at(moment.end));
        fn words<T: Scalar>(value: f64, residue: f64) -> [f64; 2] {
            let words = two_words_of::<T>(value, residue);
            [words.value.to_f64(), words.residue.to_f64()]
        }
        let seconds = match subject.precision {
            Precision::F32 => words::<f32>(value, residue),
            Precision::F64 => words::<f64>(value, residue),
        };
        Self { seconds }
    }

    /// The length in units of a body's own scale, which are powers of two.
    fn of_row(&self, batch: &AnyBatch, row: usize) -> TwoWords<f64> {
        let rate = batch.parameter(RATE_COLUMN, row);
        let [value, residue] = self.seconds.map(|seconds| seconds * rate);
        TwoWords { value, residue }
    }
}

/// The result of an attempt of one body on the twin, and how far another may be from it.
struct Trial {
    place: Place,
    tries: bool,
    /// The bound of the state, zero for a body that tries no step; `None` where none is known.
    bound: Option<RowBound>,
    /// Whether the decision hangs on rounding.
    is_close: bool,
    /// The least and the greatest next step.
    next: Option<[f64; 2]>,
    /// The bound of what remains of the interval.
    left: f64,
    by_series: bool,
    /// What remained of it before.
    left_before: TwoWords<f64>,
}

impl Trial {
    /// Whether one of two steps by series ends where it starts, and the other does not. Such a step starts where a discriminant vanishes to
    /// rounding, and rounding of its sign decides whether that changes at once (`engine/cpu/taylor/branch.rs`).
    fn one_ends_at_once(&self, steps: [&Controller<f64>; 2]) -> bool {
        let [one, other] = steps.map(|after| gone(&self.left_before, &after.left));
        let (shorter, longer) = (one.min(other), one.max(other));
        let at_once = (AT_ONCE * longer).max(2.0 * LEAST_STEP);
        self.by_series && self.tries && 0.0 < shorter && shorter < at_once && at_once < longer
    }
}

/// Error weights of the embedded formulas: those of order 5 add up to 4.1 in magnitude, and enter twice as the estimate is
/// homogeneous of degree one with slope at most 2 in them; a tenth of those of order 3 adds up to 1.3.
const ESTIMATE_WEIGHTS: f64 = 2.0 * 4.1 + 1.3;
/// Roundings of a slope from which the estimate is formed.
const SLOPE_ROUNDINGS: f64 = 4.0;
/// Roundings of an estimate relative to its own size, if the stages of a step that is far too long are far larger than its start: four for
/// each of 13 slopes. Observed differences are at most a thousandth of what slopes contribute (100 draws, tests/mirror/verify/attempts.rs).
const ESTIMATE_ROUNDINGS: f64 = 52.0;
/// Roundings of the roots from which steps are formed, once for each side: three square roots, a quotient and a product. Observed
/// differences reach 1.3 of them.
const STEP_ROUNDINGS: f64 = 8.0;
/// A step by series is cut to 1e-11 of itself, but to no less than the least step, if a discriminant changes its sign at its start; a shorter
/// part than this counts as that.
const AT_ONCE: f64 = 1e-9;

fn trials(
    subject: &Subject<'_>,
    kernel: Kernel,
    bounds: &StepBounds,
    moments: (&Moment, &Moment, &[f64]),
    span: &Span,
) -> Vec<Trial> {
    let of = |row: usize| trial(subject, &subject.twin, kernel, bounds, moments, (row, row), span);
    parallel::map(subject.len(), of)
}

/// The trial of one body, in row `own` of the batch and the moments, which is row `row` of the subject.
fn trial(
    subject: &Subject<'_>,
    batch: &AnyBatch,
    kernel: Kernel,
    bounds: &StepBounds,
    (moment, expected, scatter): (&Moment, &Moment, &[f64]),
    (row, own): (usize, usize),
    span: &Span,
) -> Trial {
    let (before, after) = (&moment.controllers[own], &expected.controllers[own]);
    let u = bounds.unit_roundoff();
    let rate = batch.parameter(RATE_COLUMN, own);
    let span = span.of_row(batch, own);
    let (start, end) = (moment.states.combined(own), expected.states.combined(own));
    let gone = (whole(&span) - whole(&before.left)) / rate;
    let attempts = before.accepted + before.rejected;
    let place =
        Place { body: subject.members.body(row), step: attempts as u64 + 1, time: moment.clock.seconds() + gone };
    let tries = moment.is_under_way(own, kernel.method);
    let taken = after.accepted > before.accepted;
    let none = RowBound { across: 0.0, norm: 0.0, momentum: 0.0, slopes: Slopes::default() };
    let by_series = kernel.method == Method::Taylor;
    let mut trial = Trial {
        place,
        tries,
        bound: Some(none),
        is_close: false,
        next: Some([after.step; 2]),
        left: 0.0,
        by_series,
        left_before: before.left,
    };
    if !tries {
        return trial;
    }
    let ticks = moment.clock.ticks() + (gone * moment.clock.ticks_per_second()) as u64;
    let of_step = |h: f64| {
        let step = Stepped { row: own, ticks, dt: h / rate, start: &start, end: &end };
        bounds.of(batch, &step).filter(RowBound::is_finite)
    };
    if by_series {
        let h = series_step(before, after);
        trial.bound = of_step(h);
        trial.left = series_steps::allowed(h, scatter[own]);
        return trial;
    }
    let tolerance = kernel.steps.tolerance;
    let Tried { step, h, untried, last } = Tried::of(kernel, batch, own, &start, before, &span);
    let bound = of_step(h);
    if taken {
        trial.bound = bound.map(|bound| {
            let lengthened = if untried { STEP_ROUNDINGS * u * h } else { 0.0 };
            RowBound {
                across: bound.across + bound.slopes.rate * lengthened,
                momentum: bound.momentum + bound.slopes.momentum_rate * lengthened,
                ..bound
            }
        });
    }
    // Both remainders are compared in one word, to which each is rounded.
    let rounded = f64::EPSILON * whole(&after.left);
    trial.left = if untried && taken && !last { STEP_ROUNDINGS * u * h + rounded } else { 0.0 };
    let Some(bound) = bound else {
        (trial.bound, trial.next, trial.is_close) = (None, None, true);
        return trial;
    };
    let slopes = bound.slopes;
    let momentum = slopes.momentum.max(0.1 * h * slopes.momentum_rate);
    let of_slopes = 0.5 * (slopes.rate_error + SLOPE_ROUNDINGS * u * slopes.rate)
        + (slopes.momentum_rate_error + SLOPE_ROUNDINGS * u * slopes.momentum_rate) / momentum.max(bounds.least());
    let estimate = Estimate { h, step, last, taken, retried: before.retried > 0.5 };
    let [least, most] = estimate.errors(after.step);
    let off = |error: f64| 2.0 * ESTIMATE_WEIGHTS * h * of_slopes / tolerance + ESTIMATE_ROUNDINGS * u * error;
    let (least, most) = ((least - off(least)).max(0.0), most + off(most));
    trial.is_close = least <= 1.0 && 1.0 <= most;
    let rounding = STEP_ROUNDINGS * u;
    trial.next = Some([estimate.next(most) * (1.0 - rounding), estimate.next(least) * (1.0 + rounding)]);
    trial
}

/// Both words of a number.
fn whole(words: &TwoWords<f64>) -> f64 {
    words.value + words.residue
}

/// The attempt of adaptive `rk8`, in units of the body's own scale.
struct Tried {
    /// The step that the controller wants.
    step: f64,
    /// The step that is tried.
    h: f64,
    /// Whether it is the first of all.
    untried: bool,
    /// Whether it takes all that remains of the interval.
    last: bool,
}

impl Tried {
    /// The attempt of the body in row `own` of a batch.
    fn of(
        kernel: Kernel,
        batch: &AnyBatch,
        own: usize,
        start: &[f64; STATE_COMPONENTS],
        before: &Controller<f64>,
        span: &TwoWords<f64>,
    ) -> Self {
        let untried = before.step <= 0.0;
        let omega: f64 = (0..3).map(|axis| (batch.parameter(axis, own) * start[4 + axis]).powi(2)).sum::<f64>().sqrt();
        let first = || (kernel.steps.tolerance.powf(0.125) / omega.max(1.0)).min(span.value);
        let step = if untried { first() } else { before.step };
        let last = before.left.value < step * 1.01;
        Self { step, h: if last { whole(&before.left) } else { step }, untried, last }
    }
}

/// How the next step follows from the error of an attempt, in units of the tolerance.
struct Estimate {
    h: f64,
    step: f64,
    last: bool,
    taken: bool,
    retried: bool,
}

impl Estimate {
    /// The greatest factor between steps.
    fn most(&self) -> f64 {
        if self.retried { 1.0 } else { 6.0 }
    }

    /// The step after an attempt with this error; it decreases as the error grows.
    fn next(&self, error: f64) -> f64 {
        let factor = (0.9 / error.max(1e-20).powf(0.125)).min(self.most()).max(1.0 / 3.0);
        let next = self.h * factor;
        if self.taken && self.last { next.max(self.step) } else { next }
    }

    /// The least and the greatest error that lead to a given next step.
    fn errors(&self, next: f64) -> [f64; 2] {
        const SLACK: f64 = 1e-5;
        let error = |factor: f64| (0.9 / factor).powi(8);
        let factor = next / self.h;
        if self.taken && self.last && next <= self.step * (1.0 + SLACK) {
            return [error((self.step / self.h).min(self.most())), 1.0];
        }
        if factor >= self.most() * (1.0 - SLACK) {
            [0.0, error(self.most())]
        } else if factor <= (1.0 + SLACK) / 3.0 {
            [error(1.0 / 3.0), f64::MAX]
        } else {
            [error(factor); 2]
        }
    }
}

/// Enters the differences of one body's attempt; returns whether it is the first beyond its bound.
fn enter(
    comparison: &mut Comparison,
    subject: &Subject<'_>,
    trial: &Trial,
    (expected, found): (&Moment, &Moment),
    row: usize,
) -> bool {
    let (own, other) = (&expected.controllers[row], &found.controllers[row]);
    let (place, precision) = (trial.place, subject.precision);
    let decided = |controller: &Controller<f64>| controller.accepted - 0.5 * controller.rejected;
    let (expected_decision, found_decision) = (decided(own), decided(other));
    if trial.is_close && expected_decision != found_decision {
        comparison.undecided += 1;
        return false;
    }
    let decision = Gap::number(Field::Decision, expected_decision, found_decision);
    if comparison.enter(&decision, Some(0.0), precision, place) {
        return true;
    }
    if trial.one_ends_at_once([own, other]) {
        comparison.undecided += 1;
        return false;
    }
    let left = Gap::number(Field::Left, whole(&own.left), whole(&other.left));
    let mut parts = comparison.enter(&left, Some(trial.left), precision, place);
    let mut next = Gap::number(Field::NextStep, own.step, other.step);
    let bound = trial.next.map(|[least, most]| if other.step < own.step { own.step - least } else { most - own.step });
    if !other.step.is_finite() && own.step.is_finite() {
        next.difference = f64::INFINITY;
    }
    parts |= comparison.enter(&next, bound, precision, place);
    let mut state_bound = trial.bound;
    if let (Some(bound), true) = (&mut state_bound, trial.by_series && trial.tries) {
        let pending = Gap::number(Field::NextStep, own.retried, other.retried);
        parts |= comparison.enter(&pending, Some(trial.left), precision, place);
        let longer = left.difference.max(pending.difference);
        bound.across += bound.slopes.rate * longer;
        // A quaternion that has not been brought to the end of its step is no unit quaternion.
        bound.norm += bound.slopes.rate * longer;
        bound.momentum += bound.slopes.momentum_rate * longer;
    }
    let states = (&expected.states, &found.states, row);
    if !trial.tries {
        // The state is unchanged, which says nothing about an attempt.
        return parts | enter_state(comparison, precision, place, states, state_bound.as_ref()).unwrap_or(false);
    }
    parts | enter_row(comparison, subject, place, states, state_bound.as_ref())
}

/// One body's attempt, to be repeated.
struct OneBody<'a> {
    subject: &'a Subject<'a>,
    kernel: Kernel,
    side: &'a Side<'a>,
    /// Its row in the subject.
    row: usize,
    /// The body alone before the attempt.
    moment: Moment,
    /// When the attempt starts, and the step that the twin tries, s.
    start: f64,
    step: f64,
}

impl<'a> OneBody<'a> {
    fn new(
        subject: &'a Subject<'a>,
        kernel: Kernel,
        side: &'a Side<'a>,
        (moment, expected): (&Moment, &Moment),
        row: usize,
    ) -> Self {
        let span = Span::of(subject, moment).of_row(&subject.twin, row);
        let rate = subject.twin.parameter(RATE_COLUMN, row);
        let (before, after) = (&moment.controllers[row], &expected.controllers[row]);
        let step = if kernel.method == Method::Taylor {
            series_step(before, after)
        } else {
            Tried::of(kernel, &subject.twin, row, &moment.states.combined(row), before, &span).h
        };
        let start = moment.clock.seconds() + (whole(&span) - whole(&before.left)) / rate;
        Self { subject, kernel, side, row, moment: moment.of_row(row), start, step: step / rate }
    }

    /// What is at fault if the states agree.
    fn onset_where_states_agree(&self, comparison: &Comparison) -> Onset {
        let is_decision = |field| matches!(field, Field::Decision | Field::NextStep | Field::Left);
        let decides = comparison.parting.as_ref().is_some_and(|parting| is_decision(parting.field));
        if decides { Onset::Controller } else { Onset::NotFound }
    }

    /// The moment before an attempt that starts where this one does and has a part of its step left, which it takes as a whole.
    fn shortened(&self, twin: &AnyBatch, part: f64) -> Moment {
        let clock = self.moment.clock.at(self.start);
        let end = clock.seconds() + part * self.step;
        let moment = Moment { clock, end, ..self.moment.clone() };
        let left = Span::of(self.subject, &moment).of_row(twin, 0);
        let controller = Controller { step: left.value, ..Controller::new() }.over(left);
        Moment { controllers: vec![controller], ..moment }
    }
}

/// Both sides after an attempt from the same moment.
struct Attempted {
    comparison: Comparison,
    expected: Moment,
}

impl OneBody<'_> {
    /// One attempt on each side, each with its own batch.
    fn attempted(&self, [own, twin]: &[AnyBatch; 2], kernel: Kernel, moment: &Moment) -> Result<Attempted> {
        let Self { subject, side, row, .. } = *self;
        let bounds = StepBounds::new(twin.torques(), kernel.method, subject.precision, false);
        let expected = kernel.attempt(&Cpu::new(TWIN), twin, moment)?;
        let after = side.with(|engine| kernel.attempt(engine, own, moment))?;
        let span = Span::of(subject, moment);
        let scatter = series_steps::scatter(kernel, twin, (moment, &expected), std::slice::from_ref(&after))?;
        let trial = trial(subject, twin, kernel, &bounds, (moment, &expected, &scatter), (row, 0), &span);
        let mut comparison = Comparison::new([String::new(), String::new()], true);
        enter(&mut comparison, subject, &trial, (&expected, &after), 0);
        Ok(Attempted { comparison, expected })
    }
}

impl Retaken for OneBody<'_> {
    fn compared(&self, acting: &[usize], part: f64) -> Result<Comparison> {
        let alone = self.subject.alone(self.row, acting)?;
        let (moment, kernel) = if part < 1.0 {
            (self.shortened(&alone[1], part), self.kernel.that_takes_any_step())
        } else {
            (self.moment.clone(), self.kernel)
        };
        Ok(self.attempted(&alone, kernel, &moment)?.comparison)
    }

    fn stage(&self, acting: &[usize], onset_from_start: Option<Onset>) -> Result<stage::Found> {
        let Self { subject, side, row, kernel: Kernel { method, steps }, .. } = *self;
        if method == Method::Taylor {
            return Ok(first_coefficient(onset_from_start, steps.tolerance, !acting.is_empty()));
        }
        let alone = subject.driven_alone(row, acting)?;
        // For the whole step, equally long on both sides.
        let (moment, kernel) = (self.shortened(&alone[1], 1.0), self.kernel.that_takes_any_step());
        let Attempted { comparison, expected } = self.attempted(&alone, kernel, &moment)?;
        // If decisions differ, no states are compared.
        let is_state = |field| matches!(field, Field::Orientation | Field::Norm | Field::AngularMomentum);
        let mut states = comparison.largest.iter().filter(|largest| is_state(largest.field));
        if !states.any(|largest| largest.of_bound.is_some_and(|part| part > 1.0)) {
            return Ok(Err(NoStage::StatesAgree));
        }
        let [own, twin] = &alone.map(|batch| batch.at(&moment.states, moment.clock));
        let (start, end) = (moment.states.combined(0), expected.states.combined(0));
        let step = Stepped { row: 0, ticks: moment.clock.ticks(), dt: self.step, start: &start, end: &end };
        let tap = Tap::Attempt { steps: kernel.steps, end: moment.end, controller: moment.controllers[0] };
        let bounds = &StepBounds::new(twin.torques(), method, subject.precision, false);
        if let Some(found) = (Evaluated { side, own, twin, tap, method, bounds, step }).stage()? {
            return Ok(found);
        }
        let (evaluations, under_torques) = (&tap.of_twin(twin), !acting.is_empty());
        SlopesOf { method, under_torques, onset: onset_from_start, evaluations, twin }.first(&mut |state, elapsed| {
            let moment = Moment { states: state.clone(), ..self.moment.clone() };
            let from = OneBody { moment, start: self.start + elapsed, ..*self };
            onset(self.least_halvings(), &mut |part| from.compared(acting, part))
        })
    }

    /// Only parts of the step are certain to be equally long on both sides.
    fn least_halvings(&self) -> u32 {
        1
    }
}
