//! Finds the evaluation of a step in which two sides part: the evaluations of both are compared in their order, first the inputs and then
//! the results ([`super::tapped`]).
//!
//! The first result that differs while its inputs agree identifies a term: the torque, or the motion of the body. The first input that
//! differs, while all results before it agree, identifies how it is formed: the weights of a stage, or its time. If all agree, the use
//! of the results is at fault. The bounds are those from which the bound of the step is formed ([`super::bound`]), so that one of the three
//! holds.
//!
//! If an engine shows no evaluations, short steps reveal the slope ([`super::slopes`]).

use super::bound::{EvaluationBounds, StepBounds, Stepped};
use super::subject::Side;
use super::tapped::Tap;
use crate::bodies::columns::STATE_COMPONENTS;
use crate::engine::batch::AnyBatch;
use crate::engine::tap::Evaluations;
use crate::error::Result;
use crate::kernel::method::Method;

/// The first part of an evaluation that differs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Term {
    /// The time at which it takes place, since the start of the step.
    Time,
    /// The orientation at which it takes place.
    Orientation,
    /// The angular momentum at which it takes place.
    AngularMomentum,
    /// The angular velocity at which the torque is evaluated, if the method computes it itself.
    AngularVelocity,
    /// The rate at which the body's axes turn, at the same angular momentum.
    Turning,
    /// The gyroscopic term, at the same angular momentum.
    GyroscopicTerm,
    /// The torque, at the same time since the start of the step, orientation and angular velocity.
    Torque,
    /// dq/dt, at the same orientation and angular velocity.
    OrientationRate,
    /// No part of any evaluation: the use of the results.
    Increment,
    /// No slope with which a step starts: the weights of the stages, their times, or slopes of stages with which no step starts.
    Weights,
}

impl Term {
    /// The name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Term::Time => "time",
            Term::Orientation => "orientation",
            Term::AngularMomentum => "angular momentum",
            Term::AngularVelocity => "angular velocity asked for",
            Term::Turning => "angular velocity",
            Term::GyroscopicTerm => "gyroscopic term",
            Term::Torque => "torque",
            Term::OrientationRate => "rate of the orientation",
            Term::Increment => "increment",
            Term::Weights => "weights",
        }
    }
}

/// The evidence for the evaluation in which two sides part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shown {
    /// The evaluations of both sides themselves.
    Evaluations,
    /// How differences fall in short steps from the states and times of the twin's evaluations, for an engine that shows none of its own.
    ShortSteps,
    /// How the difference falls with the step: with the power of the first coefficient of a series that differs.
    Series,
}

/// Why no evaluation is named.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoStage {
    /// None was sought, as the difference does not belong to a step.
    NotSought,
    /// The part at fault evaluates nothing.
    NoEvaluations,
    /// Differences do not fall with the step, so no slope is at fault.
    NoSlope,
    /// The states of both sides agree.
    StatesAgree,
    /// Roundings hide the difference, or no bound is known.
    Hidden,
}

impl NoStage {
    /// The description in words; empty if none was sought.
    pub fn in_words(self) -> &'static str {
        match self {
            NoStage::NotSought => "",
            NoStage::NoEvaluations => "no stage is named: a free flow and a projection evaluate no slopes",
            NoStage::NoSlope => {
                "no stage is named: no slope is at fault, which would make the difference fall with the step"
            }
            NoStage::StatesAgree => "no stage is named: the states agree, and what is decided follows from all stages",
            NoStage::Hidden => {
                "no stage is named: roundings hide the difference in single evaluations, or their bounds are not known"
            }
        }
    }
}

/// The evaluation in which two sides part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stage {
    /// Its number in the step, from 1; for [`Term::Increment`] that of the last.
    pub number: usize,
    /// Evaluations that were compared.
    pub of: usize,
    /// Whether each is a stage of a Runge-Kutta method; otherwise an evaluation of the torque.
    pub is_stage: bool,
    /// What differs.
    pub term: Term,
    /// The evidence.
    pub shown: Shown,
}

impl Stage {
    /// The description in words.
    pub fn in_words(self) -> String {
        match self.shown {
            Shown::Evaluations => self.of_evaluations(),
            Shown::ShortSteps => self.of_short_steps(),
            Shown::Series => {
                let Self { number, of, .. } = self;
                format!(
                    "the coefficient of order {number} of its series of order {of} is the first to differ: of {}",
                    self.slope()
                )
            }
        }
    }

    /// The quantity whose slope it is.
    fn slope(self) -> &'static str {
        match self.term {
            Term::Torque => "the angular momentum, by the torque",
            Term::GyroscopicTerm => "the angular momentum, by the gyroscopic term",
            _ => "the orientation, by the rate at which the axes turn",
        }
    }

    fn of_short_steps(self) -> String {
        let Self { number, of, is_stage, term, .. } = self;
        let name = if is_stage { "stage" } else { "evaluation of the torque" };
        let how = "in short steps from the states and times of the twin's";
        if term == Term::Weights {
            return format!(
                "the slopes of its {of} {name}s agree {how}: it is their weights, or their times and states"
            );
        }
        format!("{name} {number} of {of} is the first whose slope differs, {how}: that of {}", self.slope())
    }

    fn of_evaluations(self) -> String {
        let Self { number, of, is_stage, term, .. } = self;
        let (name, weights) = if is_stage {
            (format!("stage {number} of {of}"), "the weights of the slopes before it")
        } else {
            (format!("evaluation {number} of {of} of the torque"), "what the method does before it")
        };
        let asked = |what: &str, formed: &str| format!("{name} is the first to differ: {what}; it is {formed}");
        let answered = |what: &str, at: &str| format!("{name} is the first to differ: {what}, at the same {at}");
        match term {
            Term::Time => asked("the time at which it takes place", "the fraction of the step, or its size"),
            Term::Orientation => asked("the orientation at which it takes place", weights),
            Term::AngularMomentum => asked("the angular momentum at which it takes place", weights),
            Term::AngularVelocity => asked("the angular velocity at which it takes place", weights),
            Term::Turning => answered("the angular velocity", "angular momentum"),
            Term::GyroscopicTerm => answered("the gyroscopic term", "angular momentum"),
            Term::Torque => answered("the torque", "time in the step, orientation and angular velocity"),
            Term::OrientationRate => answered("the rate of the orientation", "orientation and angular velocity"),
            Term::Increment if is_stage => {
                format!("its {of} stages agree: it is the weights of the increment, or how that is carried over")
            }
            Term::Increment if of == 1 => "the torque agrees: it is what the method does with it".to_owned(),
            Term::Increment | Term::Weights => {
                format!("its first {of} evaluations of the torque agree: it is what the method does after them")
            }
        }
    }
}

/// The evaluations of `implicit_midpoint` before its iteration, which magnifies roundings.
const BEFORE_ITERATION: usize = 2;

/// How many of the evaluations are compared.
pub(super) fn compared_of(method: Method, made: usize) -> usize {
    if method == Method::ImplicitMidpoint { made.min(BEFORE_ITERATION) } else { made }
}

/// One body's step on either side, and the torques acting.
pub(super) struct Evaluated<'a> {
    pub side: &'a Side<'a>,
    pub own: &'a AnyBatch,
    pub twin: &'a AnyBatch,
    pub tap: Tap,
    pub method: Method,
    pub bounds: &'a StepBounds,
    pub step: Stepped<'a>,
}

impl Evaluated<'_> {
    /// The place in the step where the sides part, which they do; `None` if the engine shows no evaluations.
    pub fn stage(&self) -> Result<Option<Found>> {
        let expected = self.tap.of_twin(self.twin);
        let Some(found) = self.tap.of_side(self.side, self.own, &expected)? else { return Ok(None) };
        let states = states_of(&expected);
        let Some(bounds) = self.bounds.of_evaluations(self.twin, &self.step, &states) else {
            return Ok(Some(Err(NoStage::Hidden)));
        };
        let of = compared_of(self.method, expected.torques.len());
        if of == 0 {
            return Ok(Some(Err(NoStage::NoEvaluations)));
        }
        let is_stage = !expected.motions.is_empty();
        let stage = |number, term| Ok(Some(Ok(Stage { number, of, is_stage, term, shown: Shown::Evaluations })));
        for index in 0..of.min(found.torques.len()) {
            if let Some(term) = term(&expected, &found, index, &bounds) {
                return stage(index + 1, term);
            }
        }
        // Sides that evaluate different numbers of times part elsewhere.
        if found.torques.len() >= of { stage(of, Term::Increment) } else { Ok(Some(Err(NoStage::Hidden))) }
    }
}

/// The evaluation in which two sides part, or why none is named.
pub(super) type Found = std::result::Result<Stage, NoStage>;

/// The states at which evaluations take place and the times since the start of the step, s, if all of a state is known.
fn states_of(evaluations: &Evaluations) -> Vec<([f64; STATE_COMPONENTS], f64)> {
    let calls = evaluations.motions.iter().zip(&evaluations.torques);
    let state = |([x, y, z, w], [a, b, c]): ([f64; 4], [f64; 3])| [x, y, z, w, a, b, c];
    calls.map(|(motion, torque)| (state((torque.orientation, motion.angular_momentum)), torque.elapsed)).collect()
}

/// The largest difference of a component, infinite if one is NaN.
fn apart<const N: usize>(expected: [f64; N], found: [f64; N]) -> f64 {
    let off = expected.iter().zip(&found).map(|(a, b)| (a - b).abs());
    off.fold(0.0, |most, off| if off.is_finite() { off.max(most) } else { f64::INFINITY })
}

/// The part that differs in the evaluation with this index.
fn term(expected: &Evaluations, found: &Evaluations, index: usize, bounds: &EvaluationBounds) -> Option<Term> {
    let motions = expected.motions.get(index).zip(found.motions.get(index));
    let torques = expected.torques.get(index).zip(found.torques.get(index));
    let rates = expected.orientation_rates.get(index).zip(found.orientation_rates.get(index));
    let mut asked = Vec::new();
    if let Some((expected, found)) = torques {
        asked.push((Term::Time, apart([expected.elapsed], [found.elapsed]), bounds.time));
        asked.push((Term::Orientation, apart(expected.orientation, found.orientation), bounds.orientation));
    }
    if let Some((expected, found)) = motions {
        let off = apart(expected.angular_momentum, found.angular_momentum);
        asked.push((Term::AngularMomentum, off, bounds.angular_momentum));
    }
    let part = |(_, off, bound): &(Term, f64, f64)| off / bound;
    let farthest = asked.into_iter().max_by(|a, b| part(a).total_cmp(&part(b)));
    let mut answered = Vec::from_iter(farthest);
    if let Some((expected, found)) = motions {
        let omega = apart(expected.angular_velocity, found.angular_velocity);
        answered.push((Term::Turning, omega, bounds.angular_velocity));
        let gyroscopic = apart(expected.gyroscopic_term, found.gyroscopic_term);
        answered.push((Term::GyroscopicTerm, gyroscopic, bounds.angular_momentum_rate));
    }
    if let Some((expected, found)) = torques {
        let omega = apart(expected.angular_velocity, found.angular_velocity);
        answered.push((Term::AngularVelocity, omega, bounds.angular_velocity));
        answered.push((Term::Torque, apart(expected.torque, found.torque), bounds.angular_momentum_rate));
    }
    if let Some((expected, found)) = rates {
        answered.push((Term::OrientationRate, apart(*expected, *found), bounds.orientation_rate));
    }
    answered.into_iter().find(|(_, off, bound)| off > bound).map(|(term, ..)| term)
}
