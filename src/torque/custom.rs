//! `custom`: a torque that a user writes down, as text or as a closure.

use std::array;
use std::sync::Arc;

use glam::{DQuat, DVec3};

use super::control::Control;
use super::coupled::Centre;
use super::expressed::{self, Expressed, Preparations};
use super::formula::{Column, Formula, Role};
use super::orbit::{self, Orbit};
use super::registry::MODELS;
use super::{
    Declaration, Kind, Model, ModelRef, Needs, ParameterDeclaration, Torque, ValidationContext, Value, Values,
    translated,
};
use crate::bodies::Ensemble;
use crate::bodies::inertia::InertiaTensor;
use crate::error::{Error, Result};
use crate::expression::{
    Dependence, Expression, Fault, Input, InputKind, Program, Recorder, Scope, Shape, Stages, Symbol, Symbols,
    TextError,
};
use crate::math::vector::Vector;

/// Torques whose formula is data; [`super::expressed`] prepares what kernels read of them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Custom;

impl Formula for Custom {
    const STEM: &'static str = "custom";
    const COLUMNS: &'static [Column] = &[];
    const ROLE: Role = Role::Expression;
}

/// A model whose formula is an expression.
pub(crate) struct ExpressionModel {
    declaration: Declaration,
    torque: Expression,
    energy: Option<(Expression, Program)>,
    program: Program,
    prepared: Preparations,
    /// The part that is computed at samples.
    control: Option<Control>,
    /// The centre of mass that is integrated with it.
    centre: Option<Centre>,
}

/// The parameters of a custom torque and their values, added one by one.
///
/// ```
/// use polhode::torque::{Parameters, Torque};
///
/// let parameters = Parameters::new().number("k", 0.3)?.number("b", vec![0.1, 0.2])?;
/// let text = "let up = to_body(vec(0, 0, 1));\n-k * cross(up, vec(0, 0, 1)) - b * angular_velocity * norm(angular_velocity)";
/// let torque = Torque::custom(text, parameters)?;
/// assert!(torque.needs().attitude && torque.needs().angular_velocity && !torque.needs().time);
/// # Ok::<(), polhode::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Parameters {
    symbols: Symbols,
    /// The names available to energies, which depend on the attitude alone.
    energy_symbols: Symbols,
    declarations: Vec<ParameterDeclaration>,
    values: Vec<Value>,
}

impl Default for Parameters {
    fn default() -> Self {
        Self::new()
    }
}

impl Parameters {
    /// No parameters.
    pub fn new() -> Self {
        let symbols = Symbols::rotation().with_full_inertia().with_translation();
        let energy_symbols = Symbols::attitude();
        Self { symbols, energy_symbols, declarations: Vec::new(), values: Vec::new() }
    }

    /// The names that the formula of an energy may use.
    pub fn energy_symbols(&self) -> &Symbols {
        &self.energy_symbols
    }

    /// The names that a formula may use.
    pub fn symbols(&self) -> &Symbols {
        &self.symbols
    }

    /// Adds a number.
    ///
    /// # Errors
    ///
    /// Where the name is taken, reserved or not made of letters, digits and underscores.
    pub fn number(self, name: &str, value: impl Into<super::Parameter<f64>>) -> Result<Self, Fault> {
        self.with(
            ParameterDeclaration::number(name.to_owned(), "1", "a number"),
            Shape::Number,
            Value::Number(value.into()),
        )
    }

    /// Adds a vector.
    ///
    /// # Errors
    ///
    /// As [`Parameters::number`].
    pub fn vector(self, name: &str, value: impl Into<super::Parameter<DVec3>>) -> Result<Self, Fault> {
        let declaration = ParameterDeclaration::number(name.to_owned(), "1", "a vector");
        self.with(declaration.of_shape(super::Shape::Vector), Shape::Vector, Value::Vector(value.into()))
    }

    /// Adds a rotation; it is normalised.
    ///
    /// # Errors
    ///
    /// As [`Parameters::number`].
    pub fn rotation(self, name: &str, value: impl Into<super::Parameter<DQuat>>) -> Result<Self, Fault> {
        let declaration = ParameterDeclaration::rotation(name.to_owned(), "a rotation");
        self.with(declaration, Shape::Quaternion, Value::Rotation(value.into()))
    }

    /// Adds an orbit, on which `orbit_position` (m) and `orbit_velocity` (m/s) are the place and the velocity of each body at the time, in
    /// world axes, from the centre; the body's own translation, if it has one, is not read. Energies do not know them.
    ///
    /// ```
    /// use polhode::torque::{Orbit, Parameters, Torque};
    ///
    /// // Gas at rest meets a plate of 0.01 m², 0.1 m along the body's z axis from the centre of mass.
    /// let orbit = Orbit::circular(3.986004418e14, 6.778e6).inclined(0.9);
    /// let parameters = Parameters::new().number("density", 2e-12)?.orbit(orbit)?;
    /// let drag = "let v = to_body(orbit_velocity);\n-0.5 * 2.2 * 0.01 * density * norm(v) * cross(vec(0, 0, 0.1), v)";
    /// assert!(Torque::custom(drag, parameters)?.needs().time);
    /// # Ok::<(), polhode::expression::TextError>(())
    /// ```
    ///
    /// # Errors
    ///
    /// If there is an orbit already, or there are too many numbers.
    pub fn orbit(self, orbit: Orbit) -> Result<Self, Fault> {
        let is_zero = |parameter: &super::Parameter<f64>| matches!(parameter, super::Parameter::Shared(x) if *x == 0.0);
        let (is_eccentric, drifts) = (!is_zero(&orbit.eccentricity), !is_zero(&orbit.j2));
        let (elements, drift) = orbit.values();
        let declarations = orbit::parameters().into_iter().enumerate().map(|(place, declared)| {
            let declared = declared.drawn_as(place as u16);
            // Without a dot a text could name it.
            let name = if declared.name.contains('.') {
                declared.name.clone()
            } else {
                format!("orbit.{}", declared.name).into()
            };
            ParameterDeclaration { name, ..declared }
        });
        let declarations: Vec<ParameterDeclaration> = declarations.chain(orbit::drift::parameters()).collect();
        let Self { symbols, energy_symbols, declarations: mut all, mut values } = self;
        let symbols = symbols.with_orbit(is_eccentric, drifts)?;
        let energy_symbols = energy_symbols.with_unnamed(declarations.len())?;
        all.extend(declarations);
        values.extend(elements.into_iter().chain(drift));
        Ok(Self { symbols, energy_symbols, declarations: all, values })
    }

    /// Adds a parameter whose values are given later.
    #[cfg(feature = "study")]
    pub(crate) fn declared(self, name: &str, shape: Shape) -> Result<Self, Fault> {
        match shape {
            Shape::Number => self.number(name, 0.0),
            Shape::Vector => self.vector(name, DVec3::ZERO),
            Shape::Quaternion => self.rotation(name, DQuat::IDENTITY),
        }
    }

    /// The total number of numbers in them.
    pub(crate) fn number_count(&self) -> usize {
        self.symbols.parameter_count()
    }

    /// Sets the valid range and the unit of a number.
    pub(crate) fn valid(mut self, name: &str, unit: &'static str, valid: super::Validity) -> Self {
        for declared in self.declarations.iter_mut().filter(|declared| declared.name == name) {
            *declared = declared.clone().valid(valid);
            declared.unit = unit.into();
        }
        self
    }

    /// Other symbols, with these parameters added after them.
    pub(crate) fn named_in(&self, symbols: Symbols) -> Result<Symbols, Fault> {
        let shape = |value: &Value| match value {
            Value::Vector(_) => Shape::Vector,
            Value::Rotation(_) => Shape::Quaternion,
            _ => Shape::Number,
        };
        let mut parameters = self.declarations.iter().zip(&self.values);
        parameters.try_fold(symbols, |symbols, (declared, value)| symbols.parameter(&declared.name, shape(value)))
    }

    /// The parameters.
    pub(crate) fn declarations(&self) -> &[ParameterDeclaration] {
        &self.declarations
    }

    /// The parameters and their values.
    pub(crate) fn into_parts(self) -> (Vec<ParameterDeclaration>, Vec<Value>) {
        (self.declarations, self.values)
    }

    fn with(self, declaration: ParameterDeclaration, shape: Shape, value: Value) -> Result<Self, Fault> {
        let Self { symbols, energy_symbols, mut declarations, mut values } = self;
        let symbols = symbols.parameter(&declaration.name, shape)?;
        let energy_symbols = energy_symbols.parameter(&declaration.name, shape)?;
        declarations.push(declaration);
        values.push(value);
        Ok(Self { symbols, energy_symbols, declarations, values })
    }
}

impl Torque {
    /// A torque given by a text: a vector in body axes, N m, formed from `attitude`, `angular_velocity` (rad/s), `angular_momentum`,
    /// `inertia`, `time` (s), `position` (m) and `velocity` (m/s) of the centre of mass in world axes, and the parameters; the language is
    /// that of [`crate::expression`]. A [scene](crate::Scene) whose torque uses a position or velocity needs bodies that have one. If the
    /// forces leave these no closed form ([`crate::torque::force`]), the centre of mass is integrated with the rotation, which only
    /// [`taylor`](crate::kernel::method::taylor) can do.
    ///
    /// # Errors
    ///
    /// If the text is not such a formula; the error says where and why.
    pub fn custom(text: &str, parameters: Parameters) -> Result<Self, TextError> {
        let torque = Expression::parse(text, &parameters.symbols, Shape::Vector)?;
        Ok(Self::of_expression(torque, parameters)?)
    }

    /// A torque given by a closure over the same symbols.
    ///
    /// ```
    /// use polhode::torque::{Parameters, Torque};
    ///
    /// let parameters = Parameters::new().number("c", 0.1)?;
    /// let drag = Torque::recorded(parameters, |s| -(s.angular_velocity() * s.number("c")))?;
    /// assert!(!drag.needs().attitude);
    /// # Ok::<(), polhode::expression::Fault>(())
    /// ```
    ///
    /// # Errors
    ///
    /// As [`Expression::record`].
    pub fn recorded(parameters: Parameters, formula: impl FnOnce(&Scope<'_>) -> Vector<Symbol>) -> Result<Self, Fault> {
        let torque = Expression::record(&parameters.symbols, formula)?;
        Self::of_expression(torque, parameters)
    }

    /// The same torque with a potential energy, J: a number formed from the attitude and the parameters, for the energy balance in a run's
    /// report.
    ///
    /// # Errors
    ///
    /// If the text is not such a formula, the torque is not a formula itself, or the parameters are not its own.
    pub fn with_energy(self, text: &str, parameters: &Parameters) -> Result<Self, TextError> {
        let energy = Expression::parse(text, &parameters.energy_symbols, Shape::Number)?;
        let Some(model) = self.model().expression() else { return Err(Fault::EnergyOfModel.into()) };
        let own = model.declaration.parameters.iter().map(|parameter| &parameter.name).zip(self.values());
        let given = parameters.declarations.iter().map(|parameter| &parameter.name).zip(&parameters.values);
        if !given.eq(own.take(parameters.values.len())) {
            return Err(Fault::OtherParameters.into());
        }
        let (declaration, torque) = (model.declaration.clone(), model.torque.clone());
        Self::expressed_by(declaration, torque, Some(energy), self.values().to_vec()).map_err(Into::into)
    }

    fn of_expression(torque: Expression, parameters: Parameters) -> Result<Self, Fault> {
        let model = ExpressionModel::of_user(torque, None, &parameters)?;
        Ok(Self::of_model(model, parameters.values))
    }

    /// A torque made by [`ExpressionModel::of`].
    pub(crate) fn expressed_by(
        declaration: Declaration,
        torque: Expression,
        energy: Option<Expression>,
        values: Vec<Value>,
    ) -> Result<Self, Fault> {
        Ok(Self::of_model(ExpressionModel::of(declaration, torque, energy)?, values))
    }

    /// Whether it requires the centre of mass to be integrated with the rotation ([`super::coupled`]).
    pub(crate) fn is_coupled(&self) -> bool {
        self.model().expression().is_some_and(|model| model.centre.is_some())
    }

    /// Whether its formula is an expression.
    pub(crate) fn is_expressed(&self) -> bool {
        !self.model().formulas().is_empty()
    }

    /// Its formula prepared for engines, if it is an expression; see [`Model::prepared`].
    pub(crate) fn expressed(&self, axes: Option<DQuat>, varies: bool) -> Option<Arc<Expressed>> {
        self.model().prepared(axes, varies)
    }
}

impl ExpressionModel {
    /// A model of these formulas, in SI units and body axes, over [`Symbols::rotation`] with the full inertia and the declared parameters
    /// in their order.
    pub(crate) fn of(
        declaration: Declaration,
        torque: Expression,
        energy: Option<Expression>,
    ) -> Result<ModelRef, Fault> {
        Self::with_centre(declaration, torque, energy, None)
    }

    /// The same with a centre of mass, if given, that is integrated with the torque.
    fn with_centre(
        declaration: Declaration,
        torque: Expression,
        energy: Option<Expression>,
        centre: Option<Centre>,
    ) -> Result<ModelRef, Fault> {
        let acceleration = centre.as_ref().map(|centre| &centre.acceleration);
        let prepared = Preparations::new(|varies| Expressed::new(&torque, acceleration, None, varies))?;
        prepared.general().check_constants()?;
        let energy = energy.map(|energy| {
            let program = energy.program();
            (energy, program)
        });
        let program = torque.program();
        let model = Self { declaration, torque, energy, program, prepared, control: None, centre };
        Ok(ModelRef::Shared(Arc::new(model)))
    }

    /// A model with a part that is computed at samples.
    pub(super) fn sampled(declaration: Declaration, torque: Expression, control: Control) -> Result<ModelRef, Fault> {
        let prepared = Preparations::new(|varies| Expressed::new(&torque, None, None, varies))?;
        prepared.general().check_constants()?;
        if prepared.general().rates_read_from(control.first()) {
            return Err(Fault::SampledRate);
        }
        let program = torque.program();
        let (control, energy, centre) = (Some(control), None, None);
        Ok(ModelRef::Shared(Arc::new(Self { declaration, torque, energy, program, prepared, control, centre })))
    }

    /// A custom model of the user's.
    pub(crate) fn of_user(
        torque: Expression,
        energy: Option<Expression>,
        parameters: &Parameters,
    ) -> Result<ModelRef, Fault> {
        let declaration = Declaration::new("custom", "as written", "the user's own")
            .parameters(parameters.declarations.iter().cloned());
        Self::of(declaration, torque, energy)
    }

    /// The model with a torque that depends on other inputs, and with parameters added after its own.
    pub(super) fn moved(
        &self,
        mut inputs: impl FnMut(&Recorder, Input) -> Symbol,
        parameters: Vec<ParameterDeclaration>,
    ) -> Result<ModelRef, Fault> {
        if let Some(control) = &self.control {
            let (torque, control) = (self.torque.substituted(&mut inputs)?, control.moved(&mut inputs)?);
            return Self::sampled(self.declaration.clone().parameters_of_centre(parameters), torque, control);
        }
        let energy = self.energy.as_ref().map(|(energy, _)| energy.clone());
        Self::of(self.declaration.clone().parameters_of_centre(parameters), self.torque.substituted(inputs)?, energy)
    }

    /// The model with a centre of mass that is integrated with it, and with parameters added after its own.
    pub(super) fn coupled(&self, centre: Centre, parameters: Vec<ParameterDeclaration>) -> Result<ModelRef, Fault> {
        let energy = self.energy.as_ref().map(|(energy, _)| energy.clone());
        Self::with_centre(
            self.declaration.clone().parameters_of_centre(parameters),
            self.torque.clone(),
            energy,
            Some(centre),
        )
    }

    /// What the torque depends on; for the position, including the part that is computed at samples.
    pub(super) fn needs(&self) -> Needs {
        let needs = self.prepared.general().needs();
        let formed =
            self.control.iter().flat_map(Control::expressions).map(|formula| expressed::needs(formula.dependence()));
        Needs { position: needs.position || formed.into_iter().any(|needs| needs.position), ..needs }
    }

    /// The torque in stages, and the acceleration of a centre that is integrated with it, as far as they read the time; none if they depend on it through
    /// phases alone, or part of the torque is computed at samples.
    pub(super) fn stages_of_time(&self) -> Vec<Stages> {
        if !self.reads_time() {
            return Vec::new();
        }
        let of_centre = self.centre.as_ref().map(|centre| centre.acceleration.stages());
        let all = std::iter::once(self.torque.stages()).chain(of_centre);
        all.filter(|stages| !stages.epoch.outputs.is_empty()).collect()
    }

    /// Whether the torque depends on the time other than through phases, and no part of it is computed at samples.
    pub(super) fn reads_time(&self) -> bool {
        self.control.is_none() && self.prepared.general().reads_time()
    }

    /// The results of a program over the formula's own inputs.
    fn evaluated(&self, program: &Program, at: &HostState, host: &[f64]) -> Vec<f64> {
        let inputs: Vec<f64> = program.inputs().iter().map(|&input| at.input(input, host)).collect();
        program.evaluate_one(&inputs)
    }
}

/// The state at which a formula is evaluated on the host, SI units and body axes.
pub(crate) struct HostState {
    pub orientation: DQuat,
    pub angular_velocity_body: DVec3,
    /// The tensor at the start of the run, and at the time.
    pub initial: InertiaTensor,
    pub tensor: InertiaTensor,
    pub time: f64,
    /// Position and velocity of the centre of mass, m and m/s, world axes.
    pub centre: (DVec3, DVec3),
}

impl HostState {
    /// A body whose tensor is constant.
    pub(super) fn rigid(orientation: DQuat, angular_velocity_body: DVec3, tensor: InertiaTensor, time: f64) -> Self {
        let centre = (DVec3::ZERO, DVec3::ZERO);
        Self { orientation, angular_velocity_body, initial: tensor, tensor, time, centre }
    }

    pub(super) fn input(&self, input: Input, parameters: &[f64]) -> f64 {
        let index = usize::from(input.index);
        match input.kind {
            InputKind::Orientation => self.orientation.to_array()[index],
            InputKind::AngularVelocity => self.angular_velocity_body.to_array()[index],
            InputKind::AngularMomentum => (self.tensor * self.angular_velocity_body).to_array()[index],
            InputKind::Inertia => self.tensor.to_array()[index],
            InputKind::Time => self.time,
            InputKind::Position => self.centre.0.to_array()[index],
            InputKind::Velocity => self.centre.1.to_array()[index],
            InputKind::Parameter => parameters.get(index).copied().unwrap_or(0.0),
            _ => 0.0,
        }
    }

    /// What a formula reads, in words: the parts of the state that it depends on, and the parameters of a body.
    pub(super) fn described(
        &self,
        dependence: Dependence,
        declared: &[ParameterDeclaration],
        values: &[Value],
        body: usize,
    ) -> String {
        let mut read = Vec::new();
        if dependence.intersects(Dependence::TIME) {
            read.push(format!("time = {:?}", self.time));
        }
        if dependence.intersects(Dependence::ATTITUDE) {
            read.push(format!("attitude = {:?}", self.orientation.to_array()));
        }
        if dependence.intersects(Dependence::VELOCITY) {
            read.push(format!("angular_velocity = {:?}", self.angular_velocity_body.to_array()));
        }
        for (declared, value) in declared.iter().zip(values) {
            let name = &declared.name;
            match value {
                Value::Number(number) => read.push(format!("{name} = {:?}", number.at(body))),
                Value::Vector(vector) => read.push(format!("{name} = {:?}", vector.at(body).to_array())),
                Value::Rotation(rotation) => read.push(format!("{name} = {:?}", rotation.at(body).to_array())),
                _ => {}
            }
        }
        read.join(", ")
    }
}

impl Model for ExpressionModel {
    fn declaration(&self) -> &Declaration {
        &self.declaration
    }

    fn kind(&self, _: Values<'_>) -> Kind {
        Kind::Custom
    }

    fn expression(&self) -> Option<&ExpressionModel> {
        Some(self)
    }

    fn formulas(&self) -> Vec<&Expression> {
        let energy = self.energy.iter().map(|(energy, _)| energy);
        let formed = self.control.iter().flat_map(Control::expressions);
        std::iter::once(&self.torque).chain(energy).chain(formed).collect()
    }

    fn control(&self) -> Option<&Control> {
        self.control.as_ref()
    }

    fn prepared(&self, axes: Option<DQuat>, varies: bool) -> Option<Arc<Expressed>> {
        let acceleration = self.centre.as_ref().map(|centre| &centre.acceleration);
        Some(self.prepared.of(axes, varies, || Expressed::new(&self.torque, acceleration, axes, varies)))
    }

    /// Estimated from the torque on a body at rest, in some attitudes and at some times.
    fn rate(&self, values: Values<'_>, body: usize, middle_moment: f64) -> f64 {
        let parameters = expressed::numbers_of_body(values.values, body);
        let quarter = std::f64::consts::FRAC_1_SQRT_2;
        let attitudes = [
            DQuat::IDENTITY,
            DQuat::from_xyzw(quarter, 0.0, 0.0, quarter),
            DQuat::from_xyzw(0.0, quarter, 0.0, quarter),
            DQuat::from_xyzw(0.0, 0.0, quarter, quarter),
            DQuat::from_xyzw(0.5, 0.5, 0.5, 0.5),
            DQuat::from_xyzw(-0.5, 0.5, -0.5, 0.5),
        ];
        let tensor = InertiaTensor::from(DVec3::splat(middle_moment));
        let start = self.centre.as_ref().map(|centre| centre.start(&parameters));
        let states = attitudes.map(|orientation| {
            let at = HostState::rigid(orientation, DVec3::ZERO, tensor, 0.0);
            let at = HostState { centre: start.unwrap_or(at.centre), ..at };
            let formed = self.control.as_ref().map(|control| control.in_effect(values.values, body, &at));
            (at, formed)
        });
        let number =
            |input| states.each_ref().map(|(at, formed)| at.input(input, formed.as_ref().unwrap_or(&parameters)));
        let torque = self.program.evaluate_each(|_, input| number(input));
        let sizes = (0..states.len()).map(|state| DVec3::from(array::from_fn(|axis| torque[axis][state])).length());
        let greatest = sizes.filter(|size| size.is_finite()).fold(0.0, f64::max);
        (greatest / middle_moment).sqrt()
    }

    /// A torque made for the values of a model is validated by that model.
    fn validate(&self, values: Values<'_>, context: &ValidationContext) -> Result<()> {
        let made_of = MODELS.iter().find(|model| model.declaration().name == self.declaration.name);
        made_of.map_or(Ok(()), |model| {
            let own = &values.values[..model.declaration().parameters.len()];
            model.validate(Values { values: own, ..values }, context)
        })
    }

    fn validate_bodies(&self, _: Values<'_>, context: &ValidationContext, ensemble: &Ensemble) -> Result<()> {
        if self.centre.is_some() || !self.needs().position {
            return Ok(());
        }
        let (torque, model) = (context.torque, context.model.clone());
        Err(Error::TorquePair { torque, model, expected: translated::refusal(self.control.is_some(), ensemble).into() })
    }

    fn of_formula(&self, values: Values<'_>, body: usize, at: &HostState) -> Option<DVec3> {
        let torque = self.evaluated(&self.program, at, &expressed::numbers_of_body(values.values, body));
        Some(DVec3::new(torque[0], torque[1], torque[2]))
    }

    fn fault_of_formula(&self, values: Values<'_>, body: usize, at: &HostState) -> Option<String> {
        let parameters = expressed::numbers_of_body(values.values, body);
        let fault = self.torque.first_fault(|input| at.input(input, &parameters))?;
        let inputs = at.described(self.torque.dependence(), &self.declaration.parameters, values.values, body);
        Some(format!("{fault} where {inputs}"))
    }

    fn has_potential(&self) -> bool {
        self.energy.is_some()
    }

    fn potential_energy(&self, values: Values<'_>, body: usize, orientation: DQuat) -> f64 {
        let Some((_, program)) = &self.energy else { return f64::NAN };
        let tensor = InertiaTensor::default();
        let at = HostState::rigid(orientation, DVec3::ZERO, tensor, 0.0);
        self.evaluated(program, &at, &expressed::numbers_of_body(values.values, body))[0]
    }
}
