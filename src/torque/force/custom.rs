//! `custom`: a force that a user writes down, as text or as a closure.
//!
//! It is a vector in world axes, N, formed from `attitude`, `angular_velocity` (rad/s, body axes), `time` (s), `position` (m) and
//! `velocity` (m/s) in world axes, `mass` (kg) and parameters; the language is that of [`crate::expression`]. Centres of mass under it are
//! stepped on the host, in `f64` and adaptive steps ([`crate::torque::force::adaptive_translation`]), whatever the engine.

use glam::{DQuat, DVec3};

use super::Force;
use crate::error::Result;
use crate::expression::{
    Dependence, Expression, Fault, Input, InputKind, Program, Scope, Scratch, Shape, Symbol, Symbols, TextError,
};
use crate::math::lanes::Each;
use crate::math::vector::Vector;
use crate::torque::{ParameterDeclaration, Parameters, ValidationContext, Validity, Value, numbers_of_body};

/// A formula and its parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct CustomForce {
    formula: Expression,
    declarations: Vec<ParameterDeclaration>,
    values: Vec<Value>,
}

/// The state of a centre of mass and of its body's rotation at one time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    /// Body to world.
    pub orientation: DQuat,
    /// rad/s.
    pub angular_velocity_body: DVec3,
    /// s.
    pub time: f64,
    /// m, world axes.
    pub position: DVec3,
    /// m/s, world axes.
    pub velocity: DVec3,
}

/// The names that the formula of a force may use, besides its parameters.
pub(crate) fn symbols(parameters: &Parameters) -> Result<Symbols, Fault> {
    parameters.named_in(Symbols::translation().parameter("mass", Shape::Number)?)
}

impl Force {
    /// A force given by a text: a vector in world axes, N, formed from `attitude`, `angular_velocity` (rad/s, body axes), `time` (s),
    /// `position` (m) and `velocity` (m/s) in world axes, `mass` (kg) and the parameters.
    ///
    /// ```
    /// use polhode::Force;
    /// use polhode::torque::Parameters;
    ///
    /// // Lift of a spinning ball (G. Magnus 1852): S ω × v.
    /// let parameters = Parameters::new().number("s", 4e-4)?;
    /// let lift = Force::custom("s * cross(to_world(angular_velocity), velocity)", parameters.clone())?;
    /// assert!(Force::custom("s * cross(to_world(angular_velocity), speed)", parameters).is_err());
    /// # Ok::<(), polhode::expression::TextError>(())
    /// ```
    ///
    /// # Errors
    ///
    /// If the text is not such a formula; the error says where and why.
    pub fn custom(text: &str, parameters: Parameters) -> Result<Self, TextError> {
        let formula = Expression::parse(text, &symbols(&parameters)?, Shape::Vector)?;
        Ok(Self::Custom(CustomForce::new(formula, parameters)))
    }

    /// A force given by a closure over the same symbols.
    ///
    /// ```
    /// use polhode::Force;
    /// use polhode::torque::Parameters;
    ///
    /// // Gravity of a sphere at the origin, GM in m³/s².
    /// let parameters = Parameters::new().number("gm", 3.986004418e14)?;
    /// let gravity = Force::recorded(parameters, |s| {
    ///     let r = s.position();
    ///     let square = r.dot(r);
    ///     -(r * (s.number("gm") * s.number("mass") / (square * polhode::math::real::Real::sqrt(square))))
    /// })?;
    /// assert!(!gravity.dissipative());
    /// # Ok::<(), polhode::expression::Fault>(())
    /// ```
    ///
    /// # Errors
    ///
    /// As [`Expression::record`].
    pub fn recorded(parameters: Parameters, formula: impl FnOnce(&Scope<'_>) -> Vector<Symbol>) -> Result<Self, Fault> {
        let formula = Expression::record(&symbols(&parameters)?, formula)?;
        Ok(Self::Custom(CustomForce::new(formula, parameters)))
    }
}

impl CustomForce {
    pub(crate) fn new(formula: Expression, parameters: Parameters) -> Self {
        let (declarations, values) = parameters.into_parts();
        let by_place = declarations.into_iter().zip(0..).map(|(declared, place)| declared.drawn_as(place));
        let declarations = by_place.collect();
        Self { formula, declarations, values }
    }

    /// The same with other values of its parameters, in their order.
    pub(crate) fn with_values(&self, values: Vec<Value>) -> Self {
        Self { values, ..self.clone() }
    }

    /// Its parameters.
    pub(crate) fn declarations(&self) -> &[ParameterDeclaration] {
        &self.declarations
    }

    /// Their values.
    pub(crate) fn values(&self) -> &[Value] {
        &self.values
    }

    /// The formula; its first parameter is the mass, and its own follow.
    pub(crate) fn formula(&self) -> &Expression {
        &self.formula
    }

    /// Whether it depends on the body's rotation.
    pub(super) fn needs_attitude(&self) -> bool {
        self.formula.dependence().intersects(Dependence::ATTITUDE | Dependence::VELOCITY)
    }

    pub(super) fn validate(&self, context: &ValidationContext) -> Result<()> {
        let mut values = self.declarations.iter().zip(&self.values);
        values.try_for_each(|(declared, value)| context.check(&declared.name, &declared.unit, Validity::Finite, value))
    }
}

/// The custom forces of a scene.
#[derive(Debug)]
pub(crate) struct CustomForces<'a> {
    forces: Vec<(&'a CustomForce, Program)>,
}

impl<'a> CustomForces<'a> {
    /// The custom forces among `forces`.
    pub fn new(forces: &'a [Force]) -> Self {
        let custom = |force: &'a Force| match force {
            Force::Custom(custom) => Some((custom, custom.formula.program())),
            _ => None,
        };
        Self { forces: forces.iter().filter_map(custom).collect() }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.forces.is_empty()
    }

    /// The operations of all of them together.
    pub fn operations(&self) -> usize {
        self.forces.iter().map(|(_, program)| program.operations()).sum()
    }

    /// Whether one depends on the body's rotation.
    pub fn need_attitude(&self) -> bool {
        self.forces.iter().any(|(force, _)| force.needs_attitude())
    }

    /// Those on one body.
    pub fn on_body(&self, body: usize, mass: f64) -> OnBody<'_> {
        let formed = self.forces.iter().map(|(force, program)| Formed::new(force, program, body, mass));
        OnBody { forces: formed.collect(), mass }
    }
}

/// The custom forces on one body, ready to be evaluated.
pub(crate) struct OnBody<'a> {
    forces: Vec<Formed<'a>>,
    mass: f64,
}

impl OnBody<'_> {
    /// Their sum per unit mass, m/s², world axes.
    pub fn acceleration(&mut self, place: &Place) -> DVec3 {
        self.forces.iter_mut().map(|force| force.at(place)).sum::<DVec3>() / self.mass
    }
}

struct Formed<'a> {
    program: &'a Program,
    scratch: Scratch<f64, 1>,
}

impl<'a> Formed<'a> {
    fn new(force: &CustomForce, program: &'a Program, body: usize, mass: f64) -> Self {
        let mut scratch = Scratch::new(program);
        let mut numbers = vec![mass];
        numbers.extend(numbers_of_body(&force.values, body));
        for (place, input) in program.inputs().iter().enumerate() {
            if input.kind == InputKind::Parameter {
                *scratch.input(place) = Each([numbers[usize::from(input.index)]]);
            }
        }
        Self { program, scratch }
    }

    fn at(&mut self, place: &Place) -> DVec3 {
        for (index, &Input { kind, index: part }) in self.program.inputs().iter().enumerate() {
            let part = usize::from(part);
            let number = match kind {
                InputKind::Orientation => place.orientation.to_array()[part],
                InputKind::AngularVelocity => place.angular_velocity_body.to_array()[part],
                InputKind::Position => place.position.to_array()[part],
                InputKind::Velocity => place.velocity.to_array()[part],
                InputKind::Time => place.time,
                // Parameters stay; there are no other inputs.
                _ => continue,
            };
            *self.scratch.input(index) = Each([number]);
        }
        let mut force = [Each([0.0]); 3];
        self.program.run(&mut self.scratch, &mut force);
        let [x, y, z] = force.map(|Each([number])| number);
        DVec3::new(x, y, z)
    }
}
