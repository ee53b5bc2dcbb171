//! Torques with a sampling time and a state of their own: reaction wheels, magnetorquers, any law of a digital controller.
//!
//! A sampled torque has a period `every` and optionally a `delay`. At t_k = k · `every`, from t = 0 on, formulas of the body's state give
//! *sampled values*. These are *in effect* from t_k + `delay` until the next ones are (zero-order hold: K. J. Åström, B. Wittenmark,
//! *Computer-Controlled Systems*, 1997, section 3.2); before the first are in effect, they are zero. The torque is a formula of the values
//! in effect, the own state, and the body's state at every time. The own state is of two kinds:
//!
//! * a state with a *rate* (`d_h`): the rate is computed whenever sampled values take effect and is held as long as they do, so that the
//!   state is linear in time in between. A wheel's angular momentum is of this kind. It adds no unknown to the equations of motion, and
//!   every method keeps its order.
//! * a state with a *next value* (`next_b`): it is computed at each sample, from the values sampled then, and is constant in between. The
//!   field that a B-dot law saw last is of this kind.
//!
//! Sampled values, rates, own state and the time of the last change are additional parameters of the torque's formula, after the user's
//! own, one for each body. A session that steps bodies under such torques stops at each change, computes the new values on the host in
//! `f64` ([`crate::engine`]) and continues with changed columns: between two changes these are torques like any other, for every method on
//! every engine.

use std::ops::Range;

mod accumulation;
mod law;
mod own;
mod schedule;

pub use accumulation::Accumulation;
pub(crate) use accumulation::is_accumulation;
pub use law::SampledLaw;
pub(crate) use own::{ANY_SI, OwnNumber, OwnPart, numbers as own_numbers, parts as own_parts};
pub use schedule::Sampling;
pub(crate) use schedule::{Schedule, steps_between};

use super::custom::HostState;
use super::{ParameterDeclaration, Preset, Validity, expressed};
use crate::expression::{Expression, Fault, Graph, Input, Program, Recorder, Symbol};

/// The most changes of sampled values over a span.
pub(crate) const MOST_SAMPLES: f64 = 1e9;

/// Names of parameters that every sampled torque has.
const EVERY: &str = "every";
const DELAY: &str = "delay";

/// Formulas that are evaluated together, and the parameter numbers that receive their results.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Joined {
    formulas: Vec<(Range<usize>, Expression)>,
    pub program: Program,
}

impl Joined {
    fn new(formulas: Vec<(Range<usize>, Expression)>) -> Result<Self, Fault> {
        let (graph, outputs) = Graph::record::<Fault>(|recorder| {
            let all = formulas.iter().flat_map(|(_, formula)| formula.recorded_with(|input| recorder.input(input)));
            Ok(all.collect::<Vec<Symbol>>())
        })?;
        let program = Program::new(&graph, &outputs);
        Ok(Self { formulas, program })
    }

    /// The indices of the numbers that receive the results, in their order.
    pub fn targets(&self) -> impl Iterator<Item = usize> {
        self.formulas.iter().flat_map(|(numbers, _)| numbers.clone())
    }

    fn expressions(&self) -> impl Iterator<Item = &Expression> {
        self.formulas.iter().map(|(_, formula)| formula)
    }

    fn moved(&self, inputs: &mut impl FnMut(&Recorder, Input) -> Symbol) -> Result<Self, Fault> {
        let moved =
            |(numbers, formula): &(Range<usize>, Expression)| Ok((numbers.clone(), formula.substituted(&mut *inputs)?));
        Self::new(self.formulas.iter().map(moved).collect::<Result<_, Fault>>()?)
    }

    /// Evaluates the formulas in one state and writes the results to their places among the parameters' numbers.
    fn form(&self, numbers: &mut [f64], at: &HostState) {
        let inputs: Vec<f64> = self.program.inputs().iter().map(|&input| at.input(input, numbers)).collect();
        let found = self.program.evaluate_one(&inputs);
        self.targets().zip(found).for_each(|(target, number)| numbers[target] = number);
    }
}

/// The part of a torque that is computed at samples.
///
/// `numbers` are the numbers of the torque's parameters: the user's, `every` and `delay`, the own state, the values in effect, the rates in
/// effect, and the time of the last change.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Control {
    every: f64,
    delay: f64,
    /// The index of the first number that changes during a run.
    first: usize,
    /// The index of the time of the last change.
    pub since: usize,
    /// The parts of the own state: name, numbers.
    pub states: Vec<(String, Range<usize>)>,
    /// Sampled values.
    pub samples: Joined,
    /// Next values of the own state.
    pub next: Joined,
    /// Rates of the own state.
    pub rates: Joined,
    /// The index ranges of the states with rates, and of their rates.
    pub slopes: Vec<(Range<usize>, Range<usize>)>,
}

impl Control {
    /// Sampling period and delay.
    pub fn sampling(&self) -> Sampling {
        Sampling { every: self.every, delay: self.delay }
    }

    /// The index of the first number that changes during a run.
    pub fn first(&self) -> usize {
        self.first
    }

    /// All formulas.
    pub fn expressions(&self) -> impl Iterator<Item = &Expression> {
        self.samples.expressions().chain(self.next.expressions()).chain(self.rates.expressions())
    }

    /// The same with other inputs; parameters may have been added after its own.
    pub fn moved(&self, inputs: &mut impl FnMut(&Recorder, Input) -> Symbol) -> Result<Self, Fault> {
        let [samples, next, rates] = [self.samples.moved(inputs)?, self.next.moved(inputs)?, self.rates.moved(inputs)?];
        Ok(Self { samples, next, rates, ..self.clone() })
    }

    /// The numbers of a body once its first values are in effect, computed in the given state.
    pub fn in_effect(&self, values: &[super::Value], body: usize, at: &HostState) -> Vec<f64> {
        let mut numbers = expressed::numbers_of_body(values, body);
        self.samples.form(&mut numbers, at);
        self.rates.form(&mut numbers, at);
        numbers
    }
}

/// The parameters of every sampled model: its sampling period and delay.
pub(super) fn parameters() -> [ParameterDeclaration; 2] {
    let number = ParameterDeclaration::number;
    [
        number(EVERY, "s", "the sampling period").valid(Validity::Positive).constant(),
        number(DELAY, "s", "the time until sampled values take effect")
            .valid(Validity::NotNegative)
            .or(Preset::Number(0.0))
            .constant(),
    ]
}

/// The formula text that clamps a vector's components to ± a limit.
pub(super) fn limited(vector: &str, limit: &str) -> String {
    let component = |axis| format!("clamp({vector}.{axis}, -{limit}, {limit})");
    format!("vec({}, {}, {})", component('x'), component('y'), component('z'))
}

/// Panic message for a model's own formula, which cannot be refused.
pub(super) const SOUND: &str = "the formulas of a model are sound";
