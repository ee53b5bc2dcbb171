//! Torques with a sampling time and a state of their own: reaction wheels, magnetorquers, any law of a digital controller.
//!
//! A sampled torque has a period `every` and, where it has one, a `delay`. At t_k = k · `every`, from t = 0 on, formulas of the body's state
//! give *sampled values*; from t_k + `delay` on these are *in effect* until the next are (zero-order hold: K. J. Åström, B. Wittenmark,
//! *Computer-Controlled Systems*, 1997, section 3.2; before the first are, they are zero). The torque is a formula of the values in effect,
//! of the own state, and of the body's state at every time. The own state is of two kinds:
//!
//! * what has a *rate* (`d_h`): the rate is formed whenever sampled values take effect and holds as long as they do, so that the state is
//!   linear in time in between. A wheel's angular momentum is of this kind. It is no further unknown of the equations of motion, and every
//!   method keeps its order.
//! * what has a *next value* (`next_b`): it is formed at each sample, from the values that were sampled then, and constant in between. The
//!   field that a B-dot law saw last is of this kind.
//!
//! Sampled values, rates, own state and the time of the last change are further parameters of the torque's formula, behind the user's own,
//! one a body. A session that steps bodies under such torques stops at each change, has them formed on the host in `f64`
//! ([`crate::engine`]) and goes on with other columns: between two changes these are torques like any other, for every method on every
//! engine.

use std::ops::Range;

use glam::DVec3;

use super::custom::{ExpressionModel, HostState};
use super::{ParameterDeclaration, Parameters, Preset, Torque, Validity, expressed};
use crate::expression::{
    Expression, Fault, Graph, Input, InputKind, Program, Recorder, Shape, Symbol, Symbols, TextError,
};
use crate::math::equal_steps::steps_over;

/// The most changes of sampled values over a span.
pub(crate) const MOST_SAMPLES: f64 = 1e9;

/// Names of parameters that every sampled torque has.
const EVERY: &str = "every";
const DELAY: &str = "delay";
/// The time, s, of the last change of what holds.
const SINCE: &str = "since";

/// A sampled torque in the making: parameters, own state, sampled values, laws of the state, and at last the torque.
///
/// ```
/// use glam::DVec3;
/// use polhode::torque::{Parameters, SampledLaw};
///
/// // Three wheels along the body's axes that brake its rotation, each with a limit of its momentum.
/// let parameters = Parameters::new().number("k", 0.2)?.number("h_max", 0.05)?;
/// let wheels = SampledLaw::new(parameters, 0.1, 0.02)?
///     .vector("h", DVec3::ZERO)?
///     .sample_vector("u", "k * angular_velocity")?
///     .rate("h", "vec(clamp(u.x, (-h_max - h.x) / every, (h_max - h.x) / every), 0, 0)")?
///     .torque("-d_h - cross(angular_velocity, h)")?;
/// assert!(wheels.is_sampled());
/// # Ok::<(), polhode::expression::TextError>(())
/// ```
#[derive(Clone, Debug)]
pub struct SampledLaw {
    parameters: Parameters,
    every: f64,
    delay: f64,
    states: Vec<OwnState>,
    /// What formulas of samples may name, once the first is there.
    at_samples: Option<Symbols>,
    sampled: Vec<(Range<usize>, Expression)>,
}

/// A part of the own state, and its numbers among the parameters'.
#[derive(Clone, Debug, PartialEq)]
struct OwnState {
    name: String,
    shape: Shape,
    numbers: Range<usize>,
    law: Option<StateLaw>,
}

/// How a part of the own state changes.
#[derive(Clone, Debug, PartialEq)]
enum StateLaw {
    /// By a rate that is held.
    Rate(Expression),
    /// From sample to sample.
    Next(Expression),
}

impl SampledLaw {
    /// A law that is sampled every so many seconds, and whose values take effect `delay` seconds later.
    ///
    /// # Errors
    ///
    /// Where the parameters have the names `every` or `delay`. What the two may be is checked when a plan is made.
    pub fn new(parameters: Parameters, every: f64, delay: f64) -> Result<Self, Fault> {
        let parameters = parameters.number(EVERY, every)?.number(DELAY, delay)?;
        let parameters = parameters.valid(EVERY, "s", Validity::Positive).valid(DELAY, "s", Validity::NotNegative);
        Ok(Self { parameters, every, delay, states: Vec::new(), at_samples: None, sampled: Vec::new() })
    }

    /// The law of a model that declares `every` and `delay` among its parameters: formulas name these with `_` for `.`. `derived` are numbers
    /// that follow from them.
    pub(super) fn of_model(
        declaration: &super::Declaration,
        values: &[super::Value],
        derived: impl IntoIterator<Item = (&'static str, super::Parameter<f64>)>,
    ) -> Result<Self, Fault> {
        let mut parameters = Parameters::new();
        let (mut every, mut delay) = (0.0, 0.0);
        for (declared, value) in declaration.parameters.iter().zip(values) {
            let name = declared.name.replace('.', "_");
            parameters = match value {
                super::Value::Vector(vector) => parameters.vector(&name, vector.clone()),
                super::Value::Rotation(rotation) => parameters.rotation(&name, rotation.clone()),
                super::Value::Number(number) => {
                    match (&*name, number) {
                        (EVERY, super::Parameter::Shared(period)) => every = *period,
                        (DELAY, super::Parameter::Shared(time)) => delay = *time,
                        _ => {}
                    }
                    parameters.number(&name, number.clone())
                }
                // Sampled models declare no others.
                _ => Ok(parameters),
            }?;
        }
        for (name, number) in derived {
            parameters = parameters.number(name, number)?;
        }
        Ok(Self { parameters, every, delay, states: Vec::new(), at_samples: None, sampled: Vec::new() })
    }

    /// The torque of the model of that declaration.
    pub(super) fn torque_of(self, declaration: &super::Declaration, text: &str) -> Result<Torque, TextError> {
        let with_rates = self.with_rates()?;
        let torque = Expression::parse(text, with_rates.symbols(), Shape::Vector)?;
        Ok(with_rates.finished(torque, Some(declaration.clone()))?)
    }

    /// Adds a number to the own state, with what it starts as.
    ///
    /// # Errors
    ///
    /// Where the name is taken, reserved or not made of letters, digits and underscores.
    pub fn number(self, name: &str, initial: impl Into<super::Parameter<f64>>) -> Result<Self, Fault> {
        self.state(name, Shape::Number, |parameters| parameters.number(name, initial))
    }

    /// Adds a vector to the own state, with what it starts as.
    ///
    /// # Errors
    ///
    /// As [`SampledLaw::number`].
    pub fn vector(self, name: &str, initial: impl Into<super::Parameter<DVec3>>) -> Result<Self, Fault> {
        self.state(name, Shape::Vector, |parameters| parameters.vector(name, initial))
    }

    fn state(
        mut self,
        name: &str,
        shape: Shape,
        add: impl FnOnce(Parameters) -> Result<Parameters, Fault>,
    ) -> Result<Self, Fault> {
        let start = self.parameters.number_count();
        self.parameters = add(self.parameters)?;
        let numbers = start..self.parameters.number_count();
        self.states.push(OwnState { name: name.to_owned(), shape, numbers, law: None });
        Ok(self)
    }

    /// Adds a sampled number: a formula of the body's state at a sample, the parameters and the own state.
    ///
    /// # Errors
    ///
    /// Where the text is no such formula, or the name is taken.
    pub fn sample_number(self, name: &str, text: &str) -> Result<Self, TextError> {
        let formula = Expression::parse(text, self.symbols_at_samples(), Shape::Number)?;
        Ok(self.sampled(name, formula)?)
    }

    /// Adds a sampled vector.
    ///
    /// # Errors
    ///
    /// As [`SampledLaw::sample_number`].
    pub fn sample_vector(self, name: &str, text: &str) -> Result<Self, TextError> {
        let formula = Expression::parse(text, self.symbols_at_samples(), Shape::Vector)?;
        Ok(self.sampled(name, formula)?)
    }

    /// What formulas of samples may name.
    pub(crate) fn symbols_at_samples(&self) -> &Symbols {
        self.at_samples.as_ref().unwrap_or(self.parameters.symbols())
    }

    /// Adds a sampled value by its formula.
    pub(crate) fn sampled(mut self, name: &str, formula: Expression) -> Result<Self, Fault> {
        self.at_samples.get_or_insert_with(|| self.parameters.symbols().clone());
        let numbers;
        (self.parameters, numbers) = with_zeros(self.parameters, name, formula.shape())?;
        self.sampled.push((numbers, formula));
        Ok(self)
    }

    /// The rate of a part of the own state, 1/s of it: a formula of the values in effect, the own state and the body's state when values
    /// take effect.
    ///
    /// # Errors
    ///
    /// Where the text is no such formula, or there is no such state without a law.
    pub fn rate(self, state: &str, text: &str) -> Result<Self, TextError> {
        let formula = Expression::parse(text, self.symbols_of_laws(), self.shape_of(state)?)?;
        Ok(self.with_rate(state, formula)?)
    }

    /// The next value of a part of the own state: a formula of the values that were sampled, the own state and the body's state at a sample.
    ///
    /// # Errors
    ///
    /// As [`SampledLaw::rate`].
    pub fn next(self, state: &str, text: &str) -> Result<Self, TextError> {
        let formula = Expression::parse(text, self.symbols_of_laws(), self.shape_of(state)?)?;
        Ok(self.with_next(state, formula)?)
    }

    /// What formulas of rates and next values may name.
    pub(crate) fn symbols_of_laws(&self) -> &Symbols {
        self.parameters.symbols()
    }

    /// The shape of a part of the own state that has no law yet.
    pub(crate) fn shape_of(&self, state: &str) -> Result<Shape, Fault> {
        let own = self.states.iter().find(|own| own.name == state);
        let own = own.ok_or_else(|| Fault::UnknownName { name: state.to_owned(), nearest: None })?;
        match own.law {
            Some(_) => Err(Fault::StateLaw { name: state.to_owned() }),
            None => Ok(own.shape),
        }
    }

    pub(crate) fn with_rate(self, state: &str, formula: Expression) -> Result<Self, Fault> {
        self.with_law(state, StateLaw::Rate(formula))
    }

    pub(crate) fn with_next(self, state: &str, formula: Expression) -> Result<Self, Fault> {
        self.with_law(state, StateLaw::Next(formula))
    }

    fn with_law(mut self, state: &str, law: StateLaw) -> Result<Self, Fault> {
        self.shape_of(state)?;
        self.states.iter_mut().filter(|own| own.name == state).for_each(|own| own.law = Some(law.clone()));
        Ok(self)
    }

    /// The torque: a vector in body axes, N m, of what every torque may name, the own state at the time, the values in effect, the rates
    /// that hold (`d_h`), `every`, `delay`, and `since`, the time (s) of the last change.
    ///
    /// # Errors
    ///
    /// Where the text is no such formula, or a part of the own state has no law.
    pub fn torque(self, text: &str) -> Result<Torque, TextError> {
        let with_rates = self.with_rates()?;
        let torque = Expression::parse(text, with_rates.symbols(), Shape::Vector)?;
        Ok(with_rates.finished(torque, None)?)
    }

    /// With the rates as further names, once everything else is there.
    ///
    /// # Errors
    ///
    /// Where a part of the own state has no law.
    pub(crate) fn with_rates(self) -> Result<LawWithRates, Fault> {
        let Self { mut parameters, every, delay, states, sampled, .. } = self;
        let mut rates = Vec::new();
        let mut next = Vec::new();
        for own in &states {
            match &own.law {
                Some(StateLaw::Rate(formula)) => {
                    let numbers;
                    (parameters, numbers) = with_zeros(parameters, &format!("d_{}", own.name), own.shape)?;
                    rates.push((own.numbers.clone(), numbers, formula.clone()));
                }
                Some(StateLaw::Next(formula)) => next.push((own.numbers.clone(), formula.clone())),
                None => return Err(Fault::StateLaw { name: own.name.clone() }),
            }
        }
        let since;
        (parameters, since) = with_zeros(parameters, SINCE, Shape::Number)?;
        let states = states.into_iter().map(|own| (own.name, own.numbers)).collect();
        Ok(LawWithRates { parameters, every, delay, states, sampled, next, rates, since: since.start })
    }
}

/// Adds numbers that are zero until they are formed.
fn with_zeros(parameters: Parameters, name: &str, shape: Shape) -> Result<(Parameters, Range<usize>), Fault> {
    let start = parameters.number_count();
    let parameters = match shape {
        Shape::Number => parameters.number(name, 0.0),
        Shape::Vector => parameters.vector(name, DVec3::ZERO),
        Shape::Quaternion => Err(Fault::Shape {
            of: format!("`{name}`"),
            found: "a rotation".to_owned(),
            needed: "a number or a vector".to_owned(),
        }),
    }?;
    let end = parameters.number_count();
    Ok((parameters, start..end))
}

/// A sampled law that lacks the torque alone.
pub(crate) struct LawWithRates {
    parameters: Parameters,
    every: f64,
    delay: f64,
    states: Vec<(String, Range<usize>)>,
    sampled: Vec<(Range<usize>, Expression)>,
    next: Vec<(Range<usize>, Expression)>,
    /// Of the state, of its rate, and the rate's formula.
    rates: Vec<(Range<usize>, Range<usize>, Expression)>,
    since: usize,
}

impl LawWithRates {
    /// What the torque may name.
    pub fn symbols(&self) -> &Symbols {
        self.parameters.symbols()
    }

    /// The torque, of the user's own or of a model that declares the first parameters.
    pub fn finished(self, torque: Expression, declaration: Option<super::Declaration>) -> Result<Torque, Fault> {
        let (model, values) = self.model(torque, declaration)?;
        Ok(Torque::of_model(model, values))
    }

    /// The model of the torque, and the values of its parameters.
    pub fn model(
        self,
        torque: Expression,
        declaration: Option<super::Declaration>,
    ) -> Result<(super::ModelRef, Vec<super::Value>), Fault> {
        let Self { parameters, every, delay, states, sampled, next, rates, since } = self;
        // A state with a rate is linear in time.
        let slope = |number: usize| {
            let own = rates.iter().find(|(state, ..)| state.contains(&number))?;
            Some(own.1.start + number - own.0.start)
        };
        let torque = torque.substituted(|recorder, input| {
            let rate = (input.kind == InputKind::Parameter).then(|| slope(usize::from(input.index))).flatten();
            let Some(rate) = rate else { return recorder.input(input) };
            let number = |number: usize| recorder.input(Input::new(InputKind::Parameter, number as u16));
            let elapsed = recorder.input(Input::new(InputKind::Time, 0)) - number(since);
            recorder.input(input) + elapsed * number(rate)
        })?;
        let first = states.first().map(|(_, numbers)| numbers.start);
        let first = first.into_iter().chain(sampled.iter().map(|(numbers, _)| numbers.start)).min().unwrap_or(since);
        let control = Control {
            every,
            delay,
            first,
            since,
            states,
            samples: Joined::new(sampled)?,
            next: Joined::new(next)?,
            slopes: rates.iter().map(|(state, rate, _)| (state.clone(), rate.clone())).collect(),
            rates: Joined::new(rates.into_iter().map(|(_, rate, formula)| (rate, formula)).collect())?,
        };
        let (own, values) = parameters.into_parts();
        let declaration = match declaration {
            Some(declaration) => {
                let known = declaration.parameters.len();
                declaration.parameters(own.into_iter().skip(known))
            }
            None => super::Declaration::new("custom", "as written", "the user's own").parameters(own),
        };
        Ok((ExpressionModel::sampled(declaration, torque, control)?, values))
    }
}

/// Formulas that are formed together, and the parameters' numbers that become what they give.
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

    /// The numbers that its results become, in their order.
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

    /// Forms its results in one state and puts them to their places among the parameters' numbers.
    fn form(&self, numbers: &mut [f64], at: &HostState) {
        let inputs: Vec<f64> = self.program.inputs().iter().map(|&input| at.input(input, numbers)).collect();
        let found = self.program.evaluate_one(&inputs);
        self.targets().zip(found).for_each(|(target, number)| numbers[target] = number);
    }
}

/// What of a torque is formed at samples.
///
/// `numbers` are the numbers of the torque's parameters: the user's, `every` and `delay`, the own state, the values in effect, the rates that
/// hold, and the time of the last change.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Control {
    every: f64,
    delay: f64,
    /// The first number that changes in a run.
    first: usize,
    /// The number of the time of the last change.
    pub since: usize,
    /// The parts of the own state: name, numbers.
    pub states: Vec<(String, Range<usize>)>,
    /// Sampled values.
    pub samples: Joined,
    /// Next values of the own state.
    pub next: Joined,
    /// Rates of the own state.
    pub rates: Joined,
    /// Numbers of the states that have rates, and of these.
    pub slopes: Vec<(Range<usize>, Range<usize>)>,
}

impl Control {
    /// The names of the numbers of the own state, in their order.
    fn names_of_numbers(&self) -> impl Iterator<Item = String> {
        self.states.iter().flat_map(|(name, numbers)| {
            let names = |part| if numbers.len() == 1 { name.clone() } else { format!("{name}_{part}") };
            ["x", "y", "z"].into_iter().take(numbers.len()).map(names).collect::<Vec<_>>()
        })
    }

    /// When it is sampled, and how long until that takes effect.
    pub fn sampling(&self) -> Sampling {
        Sampling { every: self.every, delay: self.delay }
    }

    /// The first number that changes in a run.
    pub fn first(&self) -> usize {
        self.first
    }

    /// All formulas.
    pub fn expressions(&self) -> impl Iterator<Item = &Expression> {
        self.samples.expressions().chain(self.next.expressions()).chain(self.rates.expressions())
    }

    /// With other inputs; parameters may have come behind its own.
    pub fn moved(&self, inputs: &mut impl FnMut(&Recorder, Input) -> Symbol) -> Result<Self, Fault> {
        let [samples, next, rates] = [self.samples.moved(inputs)?, self.next.moved(inputs)?, self.rates.moved(inputs)?];
        Ok(Self { samples, next, rates, ..self.clone() })
    }

    /// The numbers of a body once its first values are in effect, in some state.
    pub fn in_effect(&self, values: &[super::Value], body: usize, at: &HostState) -> Vec<f64> {
        let mut numbers = expressed::numbers_of_body(values, body);
        self.samples.form(&mut numbers, at);
        self.rates.form(&mut numbers, at);
        numbers
    }
}

/// When a torque is sampled, and how long until what was sampled takes effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampling {
    /// The period, s, above zero.
    pub every: f64,
    /// s, not negative.
    pub delay: f64,
}

impl Sampling {
    /// Every so many seconds, in effect at once.
    pub fn every(every: f64) -> Self {
        Self { every, delay: 0.0 }
    }

    /// The same, in effect so many seconds later.
    #[must_use]
    pub fn delayed(self, delay: f64) -> Self {
        Self { delay, ..self }
    }

    /// In the order of [`parameters`].
    pub(super) fn values(self) -> [super::Value; 2] {
        [self.every, self.delay].map(|seconds| super::Value::Number(seconds.into()))
    }
}

/// The parameters of a sampled model: when it is sampled.
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

/// The part of a formula that cuts a vector's components to a limit of either sign.
pub(super) fn limited(vector: &str, limit: &str) -> String {
    let component = |axis| format!("clamp({vector}.{axis}, -{limit}, {limit})");
    format!("vec({}, {}, {})", component('x'), component('y'), component('z'))
}

/// What a model's own formula cannot be refused with.
pub(super) const SOUND: &str = "the formulas of a model are sound";

/// The numbers of the own state of all torques: the torque's place, and the number's name.
pub(crate) fn own_state(torques: &[Torque]) -> impl Iterator<Item = (usize, String)> {
    let of = |(place, torque): (usize, &Torque)| {
        let names = torque.control().map(|control| control.names_of_numbers().collect::<Vec<_>>());
        names.unwrap_or_default().into_iter().map(move |name| (place, name))
    };
    torques.iter().enumerate().flat_map(of)
}

/// The times, s, at which what torques hold changes.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Schedule {
    laws: Vec<Sampling>,
}

/// Times that are apart by less than this part of a sampling period are one.
const TOGETHER: f64 = 1e-9;

impl Sampling {
    /// How many periods behind its first a time is, and by how much that may be off.
    fn periods(self, time: f64, first: f64) -> (f64, f64) {
        let periods = (time - first) / self.every;
        (periods, TOGETHER + 8.0 * f64::EPSILON * periods.abs())
    }

    /// Which sample is at `time`, where one is; the first is 0.
    pub fn sample_at(self, time: f64) -> Option<u64> {
        self.at(time, 0.0)
    }

    /// The values of which sample take effect at `time`, where they are delayed.
    pub fn effect_at(self, time: f64) -> Option<u64> {
        if self.delay > 0.0 { self.at(time, self.delay) } else { None }
    }

    fn at(self, time: f64, first: f64) -> Option<u64> {
        let (periods, tolerance) = self.periods(time, first);
        let nearest = periods.round();
        (nearest >= 0.0 && (periods - nearest).abs() <= tolerance).then_some(nearest as u64)
    }

    /// The first sample, and the first effect, behind `time`.
    fn next_after(self, time: f64) -> f64 {
        let next = |first: f64| {
            let (periods, tolerance) = self.periods(time, first);
            (periods + tolerance).floor().max(-1.0).mul_add(self.every, self.every + first)
        };
        if self.delay > 0.0 { next(0.0).min(next(self.delay)) } else { next(0.0) }
    }
}

impl Schedule {
    /// Of some torques; `None` where none is sampled.
    pub fn of(torques: &[Torque]) -> Option<Self> {
        let mut laws: Vec<Sampling> = torques.iter().filter_map(Torque::control).map(Control::sampling).collect();
        laws.sort_by(|a, b| a.every.total_cmp(&b.every).then(a.delay.total_cmp(&b.delay)));
        laws.dedup();
        (!laws.is_empty()).then_some(Self { laws })
    }

    /// The first change behind `time`.
    pub fn next_after(&self, time: f64) -> f64 {
        self.laws.iter().map(|law| law.next_after(time)).fold(f64::INFINITY, f64::min)
    }

    /// The end of the part without changes that begins at `time` and goes to `end` at the most: the next change or the end, where that is as good
    /// as one.
    pub fn part(&self, time: f64, end: f64) -> f64 {
        let next = self.next_after(time);
        let shortest = self.laws.iter().map(|law| law.every).fold(f64::INFINITY, f64::min);
        if next + TOGETHER * shortest < end { next } else { end }
    }

    /// Whether anything changes at `time`.
    pub fn changes_at(&self, time: f64) -> bool {
        self.laws.iter().any(|law| law.sample_at(time).is_some() || law.effect_at(time).is_some())
    }

    /// Changes within a span, about.
    pub fn changes_in(&self, span: f64) -> f64 {
        let of_law = |law: &Sampling| span / law.every * if law.delay > 0.0 { 2.0 } else { 1.0 };
        self.laws.iter().map(of_law).sum()
    }

    /// Equal steps of at most `longest` from `start` to `end` that end at each change.
    pub fn steps(&self, start: f64, end: f64, longest: f64) -> u64 {
        let steps = |from: f64, to: f64| steps_over(to - from, longest).steps;
        let (mut time, mut sum) = (start, 0_u64);
        // Of one law without a delay all parts but the first and the last are alike.
        if let [Sampling { every, delay: 0.0 }] = self.laws[..] {
            let first = self.part(start, end);
            let whole = ((end - first) / every - TOGETHER).floor();
            if whole > 2.0 {
                let whole = whole - 1.0;
                sum = steps(start, first).saturating_add(steps_over(every, longest).steps.saturating_mul(whole as u64));
                time = first + whole * every;
            }
        }
        while time < end {
            let next = self.part(time, end);
            sum = sum.saturating_add(steps(time, next));
            time = next;
        }
        sum
    }
}

/// The equal steps between two times, of at most `longest` seconds, where what torques hold may change in between.
pub(crate) fn steps_between(schedule: Option<&Schedule>, (start, end): (f64, f64), longest: f64) -> u64 {
    match schedule {
        Some(schedule) => schedule.steps(start, end, longest),
        None => steps_over(end - start, longest).steps,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parts(schedule: &Schedule, start: f64, end: f64) -> Vec<f64> {
        let mut times = vec![start];
        while *times.last().expect("one") < end {
            let next = schedule.part(*times.last().expect("one"), end);
            assert!(next > *times.last().expect("one"));
            times.push(next);
        }
        times
    }

    #[test]
    fn a_span_is_cut_at_samples_and_effects_and_nowhere_else() {
        let one = Schedule { laws: vec![Sampling { every: 0.1, delay: 0.0 }] };
        assert_eq!(parts(&one, 0.0, 0.25), [0.0, 0.1, 0.2, 0.25]);
        // Three times a tenth is not three tenths.
        assert_eq!(parts(&one, 0.15, 0.3), [0.15, 0.2, 0.3]);
        assert!(one.changes_at(0.3) && one.changes_at(3.0 * 0.1) && !one.changes_at(0.301));
        let delayed = Schedule { laws: vec![Sampling { every: 1.0, delay: 1.25 }] };
        assert_eq!(parts(&delayed, 0.0, 3.0), [0.0, 1.0, 1.25, 2.0, 2.25, 3.0]);
        assert_eq!(delayed.laws[0].effect_at(0.25), None);
        assert_eq!((delayed.laws[0].effect_at(2.25), delayed.laws[0].sample_at(2.25)), (Some(1), None));
        let two = Schedule { laws: vec![Sampling { every: 0.3, delay: 0.0 }, Sampling { every: 0.2, delay: 0.0 }] };
        assert_eq!(parts(&two, 0.0, 0.7).len(), 6);
    }

    #[test]
    fn steps_are_counted_as_they_are_cut() {
        let schedules = [
            Schedule { laws: vec![Sampling { every: 0.1, delay: 0.0 }] },
            Schedule { laws: vec![Sampling { every: 0.07, delay: 0.02 }] },
            Schedule { laws: vec![Sampling { every: 0.3, delay: 0.0 }, Sampling { every: 0.2, delay: 0.45 }] },
        ];
        for schedule in &schedules {
            for (start, end) in [(0.0, 10.0), (0.05, 7.33), (0.1, 0.15), (3.0, 3.0), (0.0, 0.1), (0.3, 1000.0)] {
                for longest in [0.013, 0.04, 0.1, 5.0] {
                    let cut = parts(schedule, start, end);
                    let one_by_one: u64 = cut.windows(2).map(|pair| steps_over(pair[1] - pair[0], longest).steps).sum();
                    assert_eq!(schedule.steps(start, end, longest), one_by_one, "{schedule:?} {start} {end} {longest}");
                }
            }
        }
    }

    #[test]
    fn late_samples_are_still_told_apart() {
        let law = Sampling { every: 0.1, delay: 0.0 };
        for sample in [1_u64, 999_999, 123_456_789] {
            let time = sample as f64 * 0.1;
            for time in [time.next_down(), time, time.next_up()] {
                assert_eq!(law.sample_at(time), Some(sample));
                assert_eq!(law.sample_at(law.next_after(time)), Some(sample + 1));
            }
        }
    }
}
