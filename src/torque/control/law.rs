//! Builder of sampled torques.

use std::ops::Range;

use glam::DVec3;

use super::{ANY_SI, Control, DELAY, EVERY, Joined};
use crate::expression::{Expression, Fault, Input, InputKind, Shape, Symbols, TextError};
use crate::torque::custom::ExpressionModel;
use crate::torque::{
    Declaration, Frame, ModelRef, Parameter, ParameterDeclaration, Parameters, Torque, Validity, Value,
};

/// The name of the time, s, of the last change.
const SINCE: &str = "since";

/// A sampled torque being built: parameters, own state, sampled values, laws of the state, and finally the torque.
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
    /// The names that formulas of samples may use, once the first formula is added.
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

/// The law by which a part of the own state changes.
#[derive(Clone, Debug, PartialEq)]
enum StateLaw {
    /// Linearly, with a rate that is held.
    Rate(Expression),
    /// From sample to sample.
    Next(Expression),
}

impl SampledLaw {
    /// A law that is sampled every `every` seconds, and whose values take effect `delay` seconds later.
    ///
    /// # Errors
    ///
    /// If the parameters have the names `every` or `delay`. The values of both are checked when a plan is made.
    pub fn new(parameters: Parameters, every: f64, delay: f64) -> Result<Self, Fault> {
        let parameters = parameters.number(EVERY, every)?.number(DELAY, delay)?;
        let parameters = parameters.valid(EVERY, "s", Validity::Positive).valid(DELAY, "s", Validity::NotNegative);
        Ok(Self { parameters, every, delay, states: Vec::new(), at_samples: None, sampled: Vec::new() })
    }

    /// The law of a model that declares `every` and `delay` among its parameters; formulas name parameters with `_` in place of `.`.
    /// `derived` are numbers that follow from the parameters.
    pub(in crate::torque) fn of_model(
        declaration: &Declaration,
        values: &[Value],
        derived: impl IntoIterator<Item = (&'static str, Parameter<f64>)>,
    ) -> Result<Self, Fault> {
        let mut parameters = Parameters::new();
        let (mut every, mut delay) = (0.0, 0.0);
        for (declared, value) in declaration.parameters.iter().zip(values) {
            let name = declared.name.replace('.', "_");
            parameters = match value {
                Value::Vector(vector) => parameters.vector(&name, vector.clone()),
                Value::Rotation(rotation) => parameters.rotation(&name, rotation.clone()),
                Value::Number(number) => {
                    match (&*name, number) {
                        (EVERY, Parameter::Shared(period)) => every = *period,
                        (DELAY, Parameter::Shared(time)) => delay = *time,
                        _ => {}
                    }
                    parameters.number(&name, number.clone())
                }
                // Sampled models declare no other shapes.
                _ => Ok(parameters),
            }?;
        }
        for (name, number) in derived {
            parameters = parameters.number(name, number)?;
        }
        Ok(Self { parameters, every, delay, states: Vec::new(), at_samples: None, sampled: Vec::new() })
    }

    /// The torque of the model with this declaration.
    pub(in crate::torque) fn torque_of(self, declaration: &Declaration, text: &str) -> Result<Torque, TextError> {
        let with_rates = self.with_rates()?;
        let torque = Expression::parse(text, with_rates.symbols(), Shape::Vector)?;
        Ok(with_rates.finished(torque, Some(declaration.clone()))?)
    }

    /// Adds a number to the own state, with its initial value.
    ///
    /// # Errors
    ///
    /// Where the name is taken, reserved or not made of letters, digits and underscores.
    pub fn number(self, name: &str, initial: impl Into<Parameter<f64>>) -> Result<Self, Fault> {
        self.state(name, Shape::Number, |parameters| parameters.number(name, initial))
    }

    /// Adds a vector to the own state, with its initial value.
    ///
    /// # Errors
    ///
    /// As [`SampledLaw::number`].
    pub fn vector(self, name: &str, initial: impl Into<Parameter<DVec3>>) -> Result<Self, Fault> {
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
    /// If the text is not such a formula, or the name is taken.
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

    /// The names that formulas of samples may use.
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

    /// Sets the rate of a part of the own state, in its unit per second: a formula of the values in effect, the own state and the body's
    /// state when values take effect.
    ///
    /// # Errors
    ///
    /// If the text is not such a formula, or there is no such state without a law.
    pub fn rate(self, state: &str, text: &str) -> Result<Self, TextError> {
        let formula = Expression::parse(text, self.symbols_of_laws(), self.shape_of(state)?)?;
        Ok(self.with_rate(state, formula)?)
    }

    /// Sets the next value of a part of the own state: a formula of the values just sampled, the own state and the body's state at a
    /// sample.
    ///
    /// # Errors
    ///
    /// As [`SampledLaw::rate`].
    pub fn next(self, state: &str, text: &str) -> Result<Self, TextError> {
        let formula = Expression::parse(text, self.symbols_of_laws(), self.shape_of(state)?)?;
        Ok(self.with_next(state, formula)?)
    }

    /// The names that formulas of rates and next values may use.
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

    /// Sets the torque: a vector in body axes, N m. Besides the names available to every torque, the formula may use the own state at the
    /// time, the values in effect, the rates in effect (`d_h`), `every`, `delay`, and `since`, the time (s) of the last
    /// sample or of the moment at which values took effect, whichever was later.
    ///
    /// # Errors
    ///
    /// If the text is not such a formula, or a part of the own state has no law.
    pub fn torque(self, text: &str) -> Result<Torque, TextError> {
        let with_rates = self.with_rates()?;
        let torque = Expression::parse(text, with_rates.symbols(), Shape::Vector)?;
        Ok(with_rates.finished(torque, None)?)
    }

    /// Adds the rates as names, once everything else is defined. Refuses own state without a law.
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

/// Adds numbers that are zero until they are first computed.
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

/// A sampled law that is complete except for the torque.
pub(crate) struct LawWithRates {
    parameters: Parameters,
    every: f64,
    delay: f64,
    states: Vec<(String, Range<usize>)>,
    sampled: Vec<(Range<usize>, Expression)>,
    next: Vec<(Range<usize>, Expression)>,
    /// For each state with a rate: its indices, those of its rate, and the rate's formula.
    rates: Vec<(Range<usize>, Range<usize>, Expression)>,
    since: usize,
}

impl LawWithRates {
    /// The names that the torque may use.
    pub fn symbols(&self) -> &Symbols {
        self.parameters.symbols()
    }

    /// The torque, of the user's own or of a model that declares the first parameters.
    pub fn finished(self, torque: Expression, declaration: Option<Declaration>) -> Result<Torque, Fault> {
        let (model, values) = self.model(torque, declaration)?;
        Ok(Torque::of_model(model, values))
    }

    /// The model of the torque, and the values of its parameters.
    pub fn model(self, torque: Expression, declaration: Option<Declaration>) -> Result<(ModelRef, Vec<Value>), Fault> {
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
        let kept = control.states.iter().map(|(name, numbers)| match numbers.len() {
            3 => ParameterDeclaration::vector(name.clone(), ANY_SI, Frame::Body, "own state"),
            _ => ParameterDeclaration::number(name.clone(), ANY_SI, "own state"),
        });
        let declaration = match declaration {
            Some(declaration) => {
                let known = declaration.parameters.len();
                declaration.parameters(own.into_iter().skip(known))
            }
            None => Declaration::new("custom", "as written", "the user's own").own_state(kept).parameters(own),
        };
        Ok((ExpressionModel::sampled(declaration, torque, control)?, values))
    }
}
