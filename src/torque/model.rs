//! Torques as a scene holds them, and what a model does with their values.

use std::fmt;
use std::ops::Range;
use std::sync::Arc;

use glam::{DQuat, DVec3};

use super::custom::HostState;
use super::expressed::Expressed;
use super::formula::Rates;
use super::{Declaration, Kind, ParameterDeclaration, Text, ValidationContext, Value, Values};
use crate::bodies::BodyFrame;
use crate::bodies::Ensemble;
use crate::bodies::inertia::InertiaTensor;
use crate::error::Result;
use crate::expression::Expression;

/// A torque of a scene: a model and the values of its parameters, each shared by all bodies or a column with one row for each body
/// ([`super::Parameter`]). Each model's constructor is in the model's own file.
///
/// ```
/// use glam::DVec3;
/// use polhode::torque::{Orbit, Torque};
///
/// let drag = Torque::linear_drag(1e-3);
/// let thrusters = Torque::constant_body(vec![DVec3::X, DVec3::Y]);
/// let gradient = Torque::gravity_gradient(Orbit::circular(3.986004418e14, 7.0e6).inclined(0.9));
/// assert_eq!(gradient.name(), "gravity-gradient");
/// assert_eq!(gradient.parameter("orbit.inclination").and_then(|value| value.as_number()), Some(&0.9.into()));
/// assert!(drag.dissipative() && !thrusters.dissipative());
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Torque {
    model: ModelRef,
    values: Vec<Value>,
    /// The offset of a body's index in the larger scene, if the bodies are a part of one.
    first_body: usize,
}

/// A model that is built in, or one made at run time.
#[derive(Clone)]
pub(crate) enum ModelRef {
    Built(&'static dyn Model),
    Shared(Arc<dyn Model>),
}

impl std::ops::Deref for ModelRef {
    type Target = dyn Model;

    fn deref(&self) -> &Self::Target {
        match self {
            ModelRef::Built(model) => *model,
            ModelRef::Shared(model) => &**model,
        }
    }
}

impl PartialEq for ModelRef {
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (ModelRef::Built(model), ModelRef::Built(other)) => model.declaration().name == other.declaration().name,
            (ModelRef::Shared(model), ModelRef::Shared(other)) => {
                let formulas = model.formulas();
                Arc::ptr_eq(model, other)
                    || (!formulas.is_empty()
                        && model.declaration() == other.declaration()
                        && formulas == other.formulas())
            }
            _ => false,
        }
    }
}

impl fmt::Debug for ModelRef {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.declaration().name)?;
        // A formula distinguishes one torque from another; the fingerprints of plans include this text.
        self.formulas().into_iter().try_for_each(|formula| write!(formatter, " {formula:?}"))
    }
}

/// What a torque depends on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Needs {
    /// The orientation.
    pub attitude: bool,
    /// The angular velocity (or the angular momentum).
    pub angular_velocity: bool,
    /// The time.
    pub time: bool,
    /// The position of the centre of mass.
    pub position: bool,
}

impl Needs {
    /// Nothing: constant in body axes.
    pub(crate) const NOTHING: Self = Self { attitude: false, angular_velocity: false, time: false, position: false };
    /// The orientation alone.
    pub const ATTITUDE: Self = Self { attitude: true, ..Self::NOTHING };
    /// The angular velocity alone.
    pub const ANGULAR_VELOCITY: Self = Self { angular_velocity: true, ..Self::NOTHING };
    /// The time alone.
    pub const TIME: Self = Self { time: true, ..Self::NOTHING };

    /// The union of both.
    #[must_use]
    pub const fn or(self, other: Self) -> Self {
        Self {
            attitude: self.attitude || other.attitude,
            angular_velocity: self.angular_velocity || other.angular_velocity,
            time: self.time || other.time,
            position: self.position || other.position,
        }
    }
}

/// A model of a torque: its declaration, and what does not follow from it.
pub(crate) trait Model: Send + Sync {
    /// The model's declaration.
    fn declaration(&self) -> &Declaration;

    /// The torque with these values, if a model with a formula of its own is made for them; `None` if torques are of this model itself.
    fn made_for(&self, _: &[Value], _: &ValidationContext) -> Option<Result<Torque>> {
        None
    }

    /// The kind, which determines its columns and its kernel function.
    fn kind(&self, values: Values<'_>) -> Kind;

    /// Refuses values that are valid individually but not together.
    fn validate(&self, _: Values<'_>, _: &ValidationContext) -> Result<()> {
        Ok(())
    }

    /// Refuses values that are valid, but not for these bodies.
    fn validate_bodies(&self, _: Values<'_>, _: &ValidationContext, _: &Ensemble) -> Result<()> {
        Ok(())
    }

    /// Whether it affects a body in any state.
    fn acts_on(&self, values: Values<'_>, body: usize) -> bool {
        let factors =
            self.declaration().parameters.iter().zip(values.values).filter(|(parameter, _)| parameter.is_factor);
        factors.into_iter().all(|(_, value)| !value.is_zero(body))
    }

    /// Whether it affects each body; `false` where that must be asked for one by one.
    fn acts_on_all(&self, values: Values<'_>) -> bool {
        let parameters = self.declaration().parameters.iter().zip(values.values);
        parameters.into_iter().all(|(parameter, value)| !parameter.is_factor || value.is_nowhere_zero())
    }

    /// The rate (rad/s) to which it brings a body with this middle moment (kg m²) from rest within about a radian; 0 if it has no effect on
    /// a body at rest. The body's units follow from it.
    fn rate(&self, _: Values<'_>, _body: usize, _middle_moment: f64) -> f64 {
        0.0
    }

    /// The rate (1/s) at which it slows down a body with this middle moment (kg m²): explicit steps that do not follow it are
    /// unstable.
    fn damping(&self, _: Values<'_>, _body: usize, _middle_moment: f64) -> f64 {
        0.0
    }

    /// Adds the body's parameters to its columns (zero before, or those of another instance if the kind merges instances), in principal
    /// axes and the body's own units. The orientation rotates principal coordinates to world at t = 0. [`Kind::Custom`] has no columns of
    /// its own.
    fn columns(&self, values: Values<'_>, _body: usize, _: &BodyFrame, _orientation: DQuat, _out: &mut [f64]) {
        assert_eq!(self.kind(values), Kind::Custom, "a model whose kind has columns fills them");
    }

    /// Rates of its phases in two words, rad/s; as many as [`Kind::phases`] says.
    fn phase_rates(&self, _: Values<'_>, _body: usize) -> Rates {
        Rates::default()
    }

    /// Whether the rate of a phase depends on a parameter, given the values of the others.
    fn sets_phase_rate(&self, _: Values<'_>, parameter: &ParameterDeclaration) -> bool {
        parameter.sets_phase_rate
    }

    /// Whether the torque has a potential that does not depend on time.
    fn has_potential(&self) -> bool {
        false
    }

    /// The potential energy (J) of a body at an orientation (body to world). It is asked for only where [`Model::has_potential`].
    fn potential_energy(&self, _: Values<'_>, _body: usize, _orientation: DQuat) -> f64 {
        f64::NAN
    }

    /// The rate that it adds to I⁻¹ m, at which the body's axes turn, rad/s, body axes.
    fn slip(&self, _: Values<'_>, _body: usize, _momentum_body: DVec3, _angular_velocity_body: DVec3) -> DVec3 {
        DVec3::ZERO
    }

    /// How it changes moments of inertia, if it does.
    fn inertia_change(&self) -> Option<&dyn InertiaModel> {
        None
    }

    /// The expression model, if its formula is an expression.
    fn expression(&self) -> Option<&super::custom::ExpressionModel> {
        None
    }

    /// The part that is computed at samples, if there is one.
    fn control(&self) -> Option<&super::control::Control> {
        None
    }

    /// The torque (N m, body axes) by its formula, if this is data; otherwise `None`.
    fn of_formula(&self, _: Values<'_>, _body: usize, _: &HostState) -> Option<DVec3> {
        None
    }

    /// Which operation of its formula (if this is data) gives no finite number, and for which inputs; `None` if all is well.
    fn fault_of_formula(&self, _: Values<'_>, _body: usize, _: &HostState) -> Option<String> {
        None
    }

    /// The formulas that distinguish it from other models of its name.
    fn formulas(&self) -> Vec<&Expression> {
        Vec::new()
    }

    /// Its formula prepared for engines, if it is data; `axes` rotates principal to body axes if all bodies share them, and
    /// `varies` says whether moments change in time.
    fn prepared(&self, _axes: Option<DQuat>, _varies: bool) -> Option<Arc<Expressed>> {
        None
    }
}

/// A model under which moments of inertia change in time.
pub(crate) trait InertiaModel {
    /// The tensor (kg m², body axes) at `time` (s) of a body whose own is `initial`.
    fn tensor_at(&self, values: Values<'_>, body: usize, initial: InertiaTensor, time: f64) -> InertiaTensor;

    /// The moments at `time` (s) in units of the body's own scale and along its principal axes.
    fn scaled_moments_at(&self, values: Values<'_>, body: usize, frame: &BodyFrame, time: f64) -> DVec3;

    /// The factor by which a body can turn faster about one of its axes at the same angular momentum within a span, s; at least 1.
    fn spin_growth(&self, values: Values<'_>, body: usize, initial: &InertiaTensor, span: f64) -> f64;
}

impl Torque {
    /// A torque of a built-in model, with its values in the order of their declarations.
    pub(crate) fn built(model: &'static dyn Model, values: impl Into<Vec<Value>>) -> Self {
        Self::of_model(ModelRef::Built(model), values.into())
    }

    /// A torque of any model, with its values in the order of their declarations.
    pub(crate) fn of_model(model: ModelRef, values: Vec<Value>) -> Self {
        Self { model, values, first_body: 0 }
    }

    /// Sets the index in the larger scene of the body called 0.
    pub(crate) fn count_from(&mut self, first_body: usize) {
        self.first_body = first_body;
    }

    /// The same for some of the bodies, counted from 0.
    pub(crate) fn only(&self, bodies: &Range<usize>) -> Self {
        let values = self.values.iter().map(|value| value.only(bodies.clone())).collect();
        Self { values, ..self.clone() }
    }

    fn own_values(&self) -> Values<'_> {
        Values { values: &self.values, first_body: self.first_body }
    }

    /// The model, and the values passed to its functions.
    pub(crate) fn parts(&self) -> (&dyn Model, Values<'_>) {
        (&*self.model, self.own_values())
    }

    pub(super) fn model(&self) -> &dyn Model {
        &*self.model
    }

    /// The model; printed, it gives the model's name and, for a custom model, its formula.
    #[cfg(feature = "study")]
    pub(crate) fn model_ref(&self) -> &ModelRef {
        &self.model
    }

    pub(crate) fn values(&self) -> &[Value] {
        &self.values
    }

    /// The model's declaration.
    pub fn declaration(&self) -> &Declaration {
        self.model.declaration()
    }

    /// The model's name in study files and reports.
    pub fn name(&self) -> &str {
        &self.declaration().name
    }

    /// The name, owned.
    pub(crate) fn owned_name(&self) -> Text {
        self.declaration().name.clone()
    }

    /// The value of a parameter by its declared name ([`super::ParameterDeclaration::name`]); `None` if the model has no such parameter, or
    /// if another of the same choice is given.
    pub fn parameter(&self, name: &str) -> Option<&Value> {
        self.declaration().position(name).and_then(|place| self.own_values().given(place))
    }

    /// The part that is computed at samples, if there is one.
    pub(crate) fn control(&self) -> Option<&super::control::Control> {
        self.model.control()
    }

    /// Whether a part of it is sampled and held in between ([`super::SampledLaw`]).
    pub fn is_sampled(&self) -> bool {
        self.control().is_some()
    }

    /// What it depends on.
    pub fn needs(&self) -> Needs {
        match self.model.expression() {
            Some(model) => model.needs(),
            None => self.kind().needs(),
        }
    }

    /// Whether bodies under it turn at I⁻¹ m with their initial moments. If they do not, they can be followed only by methods
    /// that use the rate at which their axes turn ([`crate::kernel::method::Properties::rigid_only`]).
    pub fn leaves_rigid(&self) -> bool {
        self.declaration().leaves_rigid
    }

    /// Whether bodies under it keep their angular momentum in world axes: what makes them not rigid is internal, and everything
    /// else is an external torque.
    pub fn keeps_angular_momentum(&self) -> bool {
        !self.leaves_rigid()
    }

    /// Whether moments of inertia change in time.
    pub(crate) fn changes_inertia(&self) -> bool {
        self.model.inertia_change().is_some()
    }

    /// Whether it is random: drawn anew for each step, so that other steps have other draws.
    pub fn is_random(&self) -> bool {
        self.declaration().is_random
    }

    /// Whether it can only remove energy from a body.
    pub fn dissipative(&self) -> bool {
        self.declaration().is_dissipative
    }

    /// Whether it affects a body in any state.
    pub(crate) fn acts_on(&self, body: usize) -> bool {
        self.model.acts_on(self.own_values(), body)
    }

    /// Whether it affects each body in any state; `false` where that must be asked for one by one.
    pub(crate) fn acts_on_all(&self) -> bool {
        self.model.acts_on_all(self.own_values())
    }

    /// Whether it has a potential that does not depend on time.
    pub fn has_potential(&self) -> bool {
        self.model.has_potential()
    }

    /// The potential energy (J) of a body at an orientation (body to world), if the torque has one that does not depend on time.
    pub fn potential_energy(&self, body: usize, orientation: DQuat) -> Option<f64> {
        self.model.has_potential().then(|| self.model.potential_energy(self.own_values(), body, orientation))
    }

    /// The rate that it adds to I⁻¹ m, at which the body's axes turn, rad/s, body axes.
    pub(crate) fn slip(&self, body: usize, momentum_body: DVec3, angular_velocity_body: DVec3) -> DVec3 {
        self.model.slip(self.own_values(), body, momentum_body, angular_velocity_body)
    }

    /// The tensor (kg m², body axes) at `time` (s) of a body whose own is `initial`; it differs only under torques that change moments of
    /// inertia, such as [`super::variable_inertia`].
    pub fn tensor_at(&self, body: usize, initial: InertiaTensor, time: f64) -> InertiaTensor {
        let change = self.model.inertia_change();
        change.map_or(initial, |change| change.tensor_at(self.own_values(), body, initial, time))
    }

    /// See [`Model::of_formula`].
    pub(crate) fn of_formula(&self, body: usize, at: &HostState) -> Option<DVec3> {
        self.model.of_formula(self.own_values(), body, at)
    }

    /// See [`Model::fault_of_formula`].
    pub(crate) fn fault_of_formula(&self, body: usize, at: &HostState) -> Option<String> {
        self.model.fault_of_formula(self.own_values(), body, at)
    }

    /// How it changes moments of inertia, and with which values, if it does.
    pub(super) fn inertia_change(&self) -> Option<(&dyn InertiaModel, Values<'_>)> {
        self.model.inertia_change().map(|change| (change, self.own_values()))
    }

    /// The kind, which determines its columns and its kernel function.
    pub(crate) fn kind(&self) -> Kind {
        self.model.kind(self.own_values())
    }

    /// Whether all bodies have the same phases.
    pub(super) fn phase_rates_are_shared(&self) -> bool {
        let mut parameters = self.declaration().parameters.iter().zip(&self.values);
        let sets_rate = |parameter| self.model.sets_phase_rate(self.own_values(), parameter);
        parameters.all(|(parameter, value)| value.is_shared() || !sets_rate(parameter))
    }

    /// Whether all bodies have the same values of what is not a factor of the torque.
    pub(super) fn geometry_is_shared(&self) -> bool {
        let mut parameters = self.declaration().parameters.iter().zip(&self.values);
        parameters.all(|(parameter, value)| value.is_shared() || parameter.is_factor)
    }

    /// Whether all bodies have the same values.
    pub(super) fn values_are_shared(&self) -> bool {
        self.values.iter().all(Value::is_shared)
    }

    /// Refuses parameters that are not valid; `index` is the torque's index in its scene.
    pub(crate) fn validate(&self, index: usize, ensemble: &Ensemble) -> Result<()> {
        let context = ValidationContext { torque: index, model: self.owned_name(), body_count: ensemble.len() };
        for (parameter, value) in self.declaration().parameters.iter().zip(&self.values) {
            context.check(&parameter.name, &parameter.unit, parameter.valid, value)?;
        }
        let (model, values) = self.parts();
        model.validate(values, &context)?;
        model.validate_bodies(values, &context, ensemble)
    }
}
