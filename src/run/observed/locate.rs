//! Finds the time at which a body's quantity passes its level between two outputs.
//!
//! Bodies without torques follow their closed form. The others take steps of `rk8` in `f64` from their states at the
//! first output, at the tolerance [`TOLERANCE`]. If a step passes the level, it is repeated up to the points at which
//! [`Bracket`] looks for the root. All bodies do so side by side.
//!
//! A quantity of the own state of a sampled torque is linear in time between two changes of the torque's values and may
//! jump at a change: a level within the jump is passed at the change.

mod free;

use std::collections::BTreeMap;
use std::ops::Range;

use super::bracket::Bracket;
use super::evaluator::Evaluator;
use super::events::Start;
use crate::bodies::columns::STATE_COMPONENTS;
use crate::bodies::frame::unit_product;
use crate::bodies::{BodyFrame, BodyState, Members};
use crate::engine::controlled::{Controls, Written};
use crate::engine::cpu::Trials;
use crate::engine::{Observer, Progress};
use crate::error::{Error, Result};
use crate::math::parallel;
use crate::math::power_of_two::vector_scaled_by_power_of_two;
use crate::plan::own_state::OwnStates;
use crate::plan::{Group, Plan, TorqueSet, Treatment};
use crate::record::EventTime;
use crate::scene::{Condition, Scene};
use crate::torque::Torque;

/// The tolerance of a step of the search.
const TOLERANCE: f64 = 1e-13;

/// The tolerance of the times, as a fraction of the scene's span.
const TIME_TOLERANCE: f64 = 1e-12;

/// A quantity touches its level if it is as near as this part of it.
const TOUCH: f64 = 1e-11;

/// Parts of an interval without a passage in which a quantity is formed at least, so that it shows whether it comes near its level.
const PARTS: f64 = 4.0;

/// The angle, rad, of a first step.
const FIRST_ANGLE: f64 = 0.1;

/// Passages that are searched side by side.
const TOGETHER: usize = 1 << 15;

/// For at most this many bodies the calling thread alone forms the quantities.
const FEW: usize = 64;

/// Attempts for what may have gone unnoticed: steps of smooth motions take some five a radian.
const ATTEMPTS_PER_RADIAN: f64 = 8.0;
const LEAST_ATTEMPTS: f64 = 32.0;

/// The most attempts of a search; a body that needs more gets the time of the output.
const MOST_ATTEMPTS: u64 = 100_000;

/// A body that has met the condition of an event between two outputs.
#[derive(Clone, Debug)]
pub(super) struct Passage {
    pub event: usize,
    /// The body's place among those watched.
    pub row: usize,
    pub body: usize,
    pub start: Start,
    /// The outputs, s.
    pub span: Range<f64>,
    /// The event is the passage with this number, counted from here.
    pub left: u32,
    pub end: BodyState,
    /// The own state of the torques there, if it is read.
    pub end_own: Vec<f64>,
    /// Whether the body starts beyond the level, as far as that is known.
    pub side: Option<bool>,
    /// Whether the condition is met from the first output to the second, so that a run follows the body here. If not, it may pass the level
    /// and come back.
    pub is_followed: bool,
    /// Whether the body starts on the level, so that a run follows it to see which way it leaves.
    pub starts_on_level: bool,
    /// Whether the body has failed by the second output, so that a run follows it to see whether it has the event before.
    pub fails: bool,
    /// Set by a search: whether the quantity may have passed its level between two points at which it was formed.
    pub unseen: Unseen,
}

/// Where a search cannot tell whether a quantity has passed its level and come back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Unseen {
    None,
    /// In the last step, unless the quantity comes nearer to the level from there.
    AtEnd,
    /// In a step before.
    Within,
}

/// The result of a search.
pub(super) enum Located {
    /// The event occurred here, with this own state of the torques, if it is read.
    At { time: f64, known_to: EventTime, state: BodyState, own: Vec<f64> },
    /// The condition was met this many times, which is not enough.
    Counted(u32),
}

impl Passage {
    /// Whether a run follows the body here, and not only a sample.
    pub fn is_of_run(&self) -> bool {
        self.is_followed || self.starts_on_level || self.fails
    }

    /// The result if the whole span was searched and the condition was met `met` times.
    fn searched(&self, met: u32) -> Located {
        match self.is_followed {
            false => Located::Counted(met),
            // Rounding may put the passage after the end.
            true => self.at_end(met.max(1), EventTime::Located),
        }
    }

    /// The longest part of the span, s, between two points at which the quantity is formed.
    fn longest(&self) -> f64 {
        if self.is_of_run() { f64::INFINITY } else { (self.span.end - self.span.start) / PARTS }
    }

    /// The attempts after which a search for what has gone unnoticed ends.
    fn attempts(&self) -> f64 {
        let angle = self.end.angular_velocity_body.length() * (self.span.end - self.span.start);
        ATTEMPTS_PER_RADIAN.mul_add(angle, LEAST_ATTEMPTS)
    }

    /// The result if the search was given up after the condition was met `met` times.
    fn given_up(&self, met: u32) -> Located {
        match self.is_followed {
            false => Located::Counted(met),
            true => self.at_end(met + 1, EventTime::Output),
        }
    }

    /// The excess at the start, on the side on which the body is known to be if it has no value there, or if no run follows it: rounding may
    /// put a passage at an output on either side of it. A body that starts on the level is as one without a value.
    fn at_start(&self, condition: Condition, excess: f64) -> f64 {
        if self.side.is_none() && condition.side_at_start(excess).is_none() {
            return f64::NAN;
        }
        if self.side.is_none() || self.is_followed && !excess.is_nan() {
            return excess;
        }
        let is_right = |excess: f64| condition.side(excess) == self.side;
        let of_side = [excess, 0.0, f64::MIN_POSITIVE, -f64::MIN_POSITIVE];
        of_side.into_iter().find(|&excess| is_right(excess)).unwrap_or(excess)
    }

    /// Whether an excess says nothing of the side of the body: it has no value, or touches the level to within rounding where no run has seen
    /// it on the other side.
    fn is_undecided(&self, condition: Condition, excess: f64) -> bool {
        excess.is_nan() || !self.is_followed && excess.abs() <= TOUCH * condition.level().abs()
    }

    /// The result if the condition was met `met` times, the last of them at the end.
    fn at_end(&self, met: u32, known_to: EventTime) -> Located {
        match met >= self.left {
            true => Located::At { time: self.span.end, known_to, state: self.end, own: self.end_own.clone() },
            false => Located::Counted(met),
        }
    }
}

/// How a body moves between two outputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Motion {
    /// In closed form from the start.
    ClosedForm,
    /// Without torques, from the first output on.
    Free,
    /// Under torques.
    Driven(TorqueSet),
    /// Under a random torque, or one that depends on the body's position.
    Unknown,
}

/// Finds the times of events.
pub(super) struct Locator<'p> {
    scene: &'p Scene,
    groups: &'p [Group],
    motions: Vec<Motion>,
    own_states: OwnStates,
    /// The values that sampled torques held for each group's bodies at the first output.
    controls: Vec<Option<Controls>>,
}

impl<'p> Locator<'p> {
    pub fn new(plan: &'p Plan<'p>) -> Self {
        let (scene, groups) = (plan.scene(), plan.groups());
        // States between outputs would follow from other draws, or from positions that no state has.
        let is_unknown = |torque: &Torque| torque.is_random() || torque.is_coupled();
        // The rotation alone is followed: a torque that carries the centre of mass has no part in it.
        let stated = scene.stated_torques();
        let motion = |group: &Group| {
            let acting = |&index: &usize| group.class.torques.contains(index);
            let set = TorqueSet::of_indices((0..stated.len()).filter(acting));
            match group.treatment {
                Treatment::ClosedForm { .. } | Treatment::RegularPrecession => Motion::ClosedForm,
                _ if set.is_empty() => Motion::Free,
                _ if set.of(stated).iter().any(is_unknown) => Motion::Unknown,
                _ => Motion::Driven(set),
            }
        };
        let own_states = OwnStates::of(scene.torques());
        Self { scene, groups, motions: groups.iter().map(motion).collect(), own_states, controls: Vec::new() }
    }

    /// How far apart, s, two events may be found that occur at one time.
    pub fn alike(&self) -> f64 {
        2.0 * TIME_TOLERANCE * self.scene.end()
    }

    /// Takes the values that sampled torques hold for the bodies at an output, from which the next searches begin.
    pub fn take_controls(&mut self, controls: Vec<Option<Controls>>) {
        self.controls = controls;
    }

    /// The values that sampled torques held for a body at the first output.
    fn controls_of(&self, body: usize) -> Option<Controls> {
        let controls = |controls: &Controls| controls.row_of(body).map(|row| controls.of_row(row));
        self.controls.iter().flatten().find_map(controls)
    }

    /// Whether the motion of a body between two outputs can be followed.
    pub fn follows(&self, body: usize) -> bool {
        self.motion(body) != Motion::Unknown
    }

    fn motion(&self, body: usize) -> Motion {
        let is_own = |group: &Group| !group.members.rows(body..body + 1).is_empty();
        self.groups.iter().position(is_own).map_or(Motion::Free, |group| self.motions[group])
    }

    /// Searches for passages and returns the results, in any order; `quantities` has the index of each event's
    /// quantity.
    pub fn located(
        &self,
        passages: Vec<Passage>,
        quantities: &[usize],
        evaluator: &Evaluator<'_>,
        observer: &mut Observer<'_>,
    ) -> Result<Vec<(Passage, Located)>> {
        let mut by_motion: BTreeMap<Motion, Vec<Passage>> = BTreeMap::new();
        for passage in passages {
            by_motion.entry(self.motion(passage.body)).or_default().push(passage);
        }
        let mut all = Vec::new();
        for (motion, mut passages) in by_motion {
            let set = if let Motion::Driven(set) = motion { set } else { TorqueSet::default() };
            let search = Search { scene: self.scene, quantities, evaluator, locator: self, set };
            match motion {
                Motion::Unknown => all.extend(passages.into_iter().map(|passage| {
                    let located = passage.given_up(0);
                    (passage, located)
                })),
                Motion::ClosedForm | Motion::Free => {
                    let located = |passage: Passage| {
                        let located = search.free(&passage, motion == Motion::ClosedForm);
                        (passage, located)
                    };
                    match passages.len() {
                        ..=FEW => all.extend(passages.into_iter().map(located)),
                        _ => all.extend(parallel::map_tasks(passages, |_, passage| located(passage))),
                    }
                }
                Motion::Driven(set) => {
                    passages.sort_by_key(|passage| passage.body);
                    let torques = set.of(self.scene.torques());
                    while !passages.is_empty() {
                        let some = passages.split_off(passages.len().saturating_sub(TOGETHER));
                        all.extend(search.driven(some, &torques, observer)?);
                    }
                }
            }
        }
        Ok(all)
    }
}

struct Search<'a> {
    locator: &'a Locator<'a>,
    scene: &'a Scene,
    quantities: &'a [usize],
    evaluator: &'a Evaluator<'a>,
    /// The torques that act.
    set: TorqueSet,
}

impl Search<'_> {
    fn condition(&self, passage: &Passage) -> Condition {
        self.scene.wanted_events()[passage.event].condition()
    }

    /// The excess of the quantity over the level; `controls` are the values that sampled torques hold for the body.
    fn excess(&self, passage: &Passage, time: f64, state: &BodyState, controls: Option<&Controls>) -> f64 {
        let own = if self.evaluator.reads_own_state() { self.own(passage, time, controls) } else { Vec::new() };
        let value = self.evaluator.value(self.quantities[passage.event], passage.body, time, (state, &own));
        value - self.condition(passage).level()
    }

    /// The own state of the torques on a body.
    fn own(&self, passage: &Passage, time: f64, controls: Option<&Controls>) -> Vec<f64> {
        self.locator.own_states.of_all((self.set, controls), time).of(passage.body).to_vec()
    }

    fn time_tolerance(&self, end: f64) -> f64 {
        (TIME_TOLERANCE * self.scene.end()).max(2.0 * (end.next_up() - end))
    }

    /// Searches for bodies under torques.
    fn driven(
        &self,
        mut passages: Vec<Passage>,
        torques: &[Torque],
        observer: &mut Observer<'_>,
    ) -> Result<Vec<(Passage, Located)>> {
        // Of the bodies of a sample some are followed for a part of the time between two outputs only.
        let ends = passages.iter().map(|passage| passage.span.end);
        let Some(first) = passages.first() else { return Ok(Vec::new()) };
        let span = first.span.start..ends.fold(first.span.end, f64::max);
        let members = Members::Some(passages.iter().map(|passage| passage.body as u32).collect());
        let (scene, is_sampled) = (self.scene, torques.iter().any(Torque::is_sampled));
        let mut trials = Trials::new(scene.ensemble(), torques, scene.end(), &members, span, TOLERANCE)?;
        let mut walks: Vec<Walk> = Vec::with_capacity(passages.len());
        for (row, passage) in passages.iter().enumerate() {
            let before = if is_sampled { self.locator.controls_of(passage.body) } else { None };
            let controls = before.and_then(|before| trials.controls(row, before));
            let mut walk = Walk::new(self, passage, trials.frame(row), (torques, controls));
            trials.set_state(row, &walk.state);
            match &walk.controls {
                Some(controls) => trials.hold(row, controls.columns()),
                // The torques on it are not known.
                None if is_sampled => walk.located = Some(passage.given_up(0)),
                None => {}
            }
            walks.push(walk);
        }
        let total = walks.len() as u64;
        for attempt in 0..MOST_ATTEMPTS {
            let mut under_way = 0_u64;
            for (row, (walk, passage)) in walks.iter_mut().zip(&mut passages).enumerate() {
                // Stiff damping takes many steps a radian: what they have covered is what has been searched.
                let is_short = !passage.is_followed && !passage.fails;
                if walk.located.is_none() && is_short && passage.attempts() <= attempt as f64 {
                    passage.span.end = walk.time;
                    walk.located = Some(passage.given_up(walk.met));
                }
                match walk.next_step(self, passage, self.time_tolerance(passage.span.end)) {
                    Some(step) => {
                        trials.set_step(row, walk.time, step);
                        under_way += 1;
                    }
                    None => trials.rest(row),
                }
            }
            if under_way == 0 {
                break;
            }
            if observer(Progress { done: total - under_way, total }).is_break() {
                return Err(Error::Interrupted { steps: 0 });
            }
            trials.attempt()?;
            let tried = |(row, (walk, passage)): (usize, (&Walk, &Passage))| {
                let time = walk.tried.filter(|_| walk.located.is_none())?;
                let frame = trials.frame(row).at(torques, passage.body, time);
                let state = frame.body_state(trials.state(row));
                Some((self.excess(passage, time, &state, walk.controls.as_ref()), state))
            };
            let points: Vec<Option<(f64, BodyState)>> = match walks.len() {
                ..=FEW => walks.iter().zip(&passages).enumerate().map(tried).collect(),
                _ => parallel::rows(walks.len(), FEW, &|row| tried((row, (&walks[row], &passages[row])))),
            };
            for (row, ((walk, passage), point)) in walks.iter_mut().zip(&passages).zip(points).enumerate() {
                let Some(point) = point else { continue };
                if walk.take(self.condition(passage), passage, trials.outcome(row), trials.state(row), point) {
                    trials.set_state(row, &walk.state);
                    continue;
                }
                if let Some(written) = walk.changed() {
                    trials.hold(row, written);
                    if self.evaluator.reads_own_state() {
                        let state = trials.frame(row).at(torques, passage.body, walk.time).body_state(walk.state);
                        walk.jump(self, passage, state);
                    }
                }
                walk.arrive(passage);
            }
        }
        let located = |(passage, walk): (Passage, Walk)| {
            let located = walk.located.unwrap_or_else(|| passage.given_up(walk.met));
            (Passage { unseen: walk.unseen, ..passage }, located)
        };
        Ok(passages.into_iter().zip(walks).map(located).collect())
    }
}

/// Whether a change of the distance from a level, or one that is not known, may lead to it.
pub(super) fn may_come_nearer(change: f64) -> bool {
    change < 0.0 || change.is_nan()
}

/// By how many times its change between two points a quantity may change before the next, there and back.
const MOST_CHANGE: f64 = 3.0;

/// Whether a quantity with these distances from its level at two points, both on the same side, may pass it in between and come back: if it changes no
/// more than it does there or did before.
pub(super) fn may_pass((last, now): (f64, f64), change: f64) -> bool {
    last.abs() + now.abs() < MOST_CHANGE * change
}

/// The search for a body under torques between two outputs.
struct Walk {
    /// The time reached, s, and the scaled state and the excess there.
    time: f64,
    state: [f64; STATE_COMPONENTS],
    excess: f64,
    /// The longest step that is tried, s.
    step: f64,
    /// The end of the step being tried.
    tried: Option<f64>,
    /// The bracket around the event, and the state at its end.
    bracket: Option<(Bracket, BodyState)>,
    met: u32,
    /// The last change of the distance from the level, negative if it has come nearer, and what was not seen so far.
    change: f64,
    unseen: Unseen,
    located: Option<Located>,
    /// The values that sampled torques hold for it.
    controls: Option<Controls>,
}

impl Walk {
    fn new(
        search: &Search<'_>,
        passage: &Passage,
        frame: &BodyFrame,
        (torques, controls): (&[Torque], Option<Controls>),
    ) -> Self {
        let Start { orientation, angular_momentum_world } = passage.start;
        let momentum = frame.to_principal(orientation.conjugate() * angular_momentum_world);
        let mut m = vector_scaled_by_power_of_two(momentum, -(frame.moment_exponent + frame.rate_exponent));
        if frame.is_linear_rotor {
            m.x = 0.0;
        }
        let q = unit_product(orientation, frame.principal_to_body);
        let state = [q.x, q.y, q.z, q.w, m.x, m.y, m.z];
        let time = passage.span.start;
        let start = frame.at(torques, passage.body, time).body_state(state);
        let spin = start.angular_velocity_body.length().max(passage.end.angular_velocity_body.length());
        Self {
            time,
            state,
            excess: passage
                .at_start(search.condition(passage), search.excess(passage, time, &start, controls.as_ref())),
            step: if spin > 0.0 { FIRST_ANGLE / spin } else { f64::INFINITY },
            tried: None,
            bracket: None,
            met: 0,
            change: f64::NAN,
            unseen: Unseen::None,
            located: None,
            controls,
        }
    }

    /// The values that sampled torques hold from here on, if they change here.
    fn changed(&mut self) -> Option<Vec<Written>> {
        let (time, state) = (self.time, self.state);
        let controls = self.controls.as_mut().filter(|controls| time >= controls.next_change())?;
        Some(controls.change(time, &|frame, _| frame.body_state(state)))
    }

    /// Takes the quantity after a change of the sampled torques' values, with the body in `state`.
    fn jump(&mut self, search: &Search<'_>, passage: &Passage, state: BodyState) {
        let (condition, time) = (search.condition(passage), self.time);
        let excess = search.excess(passage, time, &state, self.controls.as_ref());
        let excess = if passage.is_undecided(condition, excess) { self.excess } else { excess };
        if condition.is_met_between(condition.side(self.excess), condition.side(excess)) {
            self.met += 1;
            if self.met == passage.left {
                let own = search.own(passage, time, self.controls.as_ref());
                self.located = Some(Located::At { time, known_to: EventTime::Located, state, own });
            }
        }
        self.excess = excess;
    }

    /// Ends the search at the later output.
    fn arrive(&mut self, passage: &Passage) {
        if self.located.is_none() && self.bracket.is_none() && self.time >= passage.span.end {
            self.located = Some(passage.searched(self.met));
        }
    }

    /// The step to try next, s; `None` once the time is known.
    fn next_step(&mut self, search: &Search<'_>, passage: &Passage, tolerance: f64) -> Option<f64> {
        if self.located.is_some() {
            return None;
        }
        let end = match &mut self.bracket {
            None => {
                let change = self.controls.as_ref().map_or(f64::INFINITY, Controls::next_change);
                passage.span.end.min(change)
            }
            Some((bracket, state)) => match bracket.next(tolerance) {
                Some(next) => next,
                None => {
                    let (time, state) = (bracket.end.0, *state);
                    let own = search.own(passage, time, self.controls.as_ref());
                    self.located = Some(Located::At { time, known_to: EventTime::Located, state, own });
                    return None;
                }
            },
        };
        // Steps become shorter and shorter on the way to a failure.
        let is_stuck = passage.fails && self.bracket.is_none() && self.step <= tolerance;
        if is_stuck || self.time + self.step == self.time && end > self.time {
            self.located = Some(passage.given_up(self.met));
            return None;
        }
        let longest = if self.bracket.is_some() { f64::INFINITY } else { passage.longest() };
        let step = self.step.min(longest).min(end - self.time);
        self.tried = Some(if step < end - self.time { self.time + step } else { end });
        Some(step)
    }

    /// Takes the result of an attempt; returns whether the body must go back to its state before.
    fn take(
        &mut self,
        condition: Condition,
        passage: &Passage,
        outcome: Option<(bool, f64)>,
        state: [f64; STATE_COMPONENTS],
        (excess, at): (f64, BodyState),
    ) -> bool {
        let (Some(time), Some((is_taken, next))) = (self.tried, outcome) else {
            self.located = Some(passage.given_up(self.met));
            return false;
        };
        if !is_taken {
            self.step = next;
            return false;
        }
        // Without a value the side does not change.
        let is_undecided =
            if self.bracket.is_some() { excess.is_nan() } else { passage.is_undecided(condition, excess) };
        let excess = if is_undecided { self.excess } else { excess };
        let (before, now) = (condition.side(self.excess), condition.side(excess));
        if let Some((bracket, end)) = &mut self.bracket {
            // Without a value before, what has the side of the later end is past.
            let is_past = if self.excess.is_nan() { now == condition.side(bracket.end.1) } else { before != now };
            bracket.take(time, excess, is_past);
            if is_past {
                *end = at;
                return true;
            }
        } else {
            self.step = next;
            let change =
                if before == now { excess.abs() - self.excess.abs() } else { -(excess.abs() + self.excess.abs()) };
            if self.unseen == Unseen::AtEnd {
                self.unseen = if change < 0.0 { Unseen::None } else { Unseen::Within };
            }
            let may_turn = before == now && may_come_nearer(self.change);
            let most = self.change.abs().max(change.abs());
            if self.unseen == Unseen::None && may_turn && may_pass((self.excess, excess), most) {
                self.unseen = Unseen::AtEnd;
            }
            self.change = change;
            if condition.is_met_between(before, now) {
                self.met += 1;
                if self.met == passage.left {
                    self.bracket = Some((Bracket::new((self.time, self.excess), (time, excess)), at));
                    return true;
                }
            }
        }
        (self.time, self.state, self.excess) = (time, state, excess);
        false
    }
}
