//! Quantities given by the user's own formulas.

use std::sync::Arc;

use super::Quantity;
use crate::expression::orbit::OrbitSymbols;
use crate::expression::{Expression, Input, InputKind, Shape, Symbol, Symbols, TextError};
use crate::math::vector::Vector;
use crate::torque::Torque;
use crate::torque::control::{self, OwnNumber, OwnPart};

/// What a formula may read of the start of a body's motion.
const AT_START: [(&str, Shape); 2] =
    [("initial_attitude", Shape::Quaternion), ("initial_angular_velocity", Shape::Vector)];
/// How many numbers these are.
const NUMBERS_AT_START: usize = 7;

/// A quantity given by a formula.
#[derive(Clone, Debug, PartialEq)]
pub struct FormulaQuantity {
    pub(super) name: String,
    pub(super) unit: String,
    expression: Expression,
    /// The numbers of own state that its parameters are, after those of [`AT_START`].
    own: Vec<OwnNumber>,
    /// The indices of those that it reads.
    read: Vec<usize>,
}

impl FormulaQuantity {
    /// The numbers of own state that it depends on.
    pub(super) fn own_numbers(&self) -> impl Iterator<Item = &OwnNumber> {
        self.read.iter().map(|&parameter| &self.own[parameter])
    }

    /// Its value, recorded from the angular momentum in body axes, the numbers at the start, own state and other inputs.
    pub(super) fn recorded(
        &self,
        momentum_body: Vector<Symbol>,
        at_start: impl Fn(usize) -> Symbol,
        own: impl Fn(&OwnNumber) -> Symbol,
        other: impl Fn(Input) -> Symbol,
    ) -> Symbol {
        let input = |input: Input| match input.kind {
            InputKind::AngularMomentum => {
                [momentum_body.x, momentum_body.y, momentum_body.z][usize::from(input.index) % 3]
            }
            InputKind::Parameter => match usize::from(input.index) {
                index @ 0..NUMBERS_AT_START => at_start(index),
                index => own(&self.own[index - NUMBERS_AT_START]),
            },
            _ => other(input),
        };
        self.expression.recorded_with(input)[0]
    }
}

impl Quantity {
    /// A formula of the user's own: a number formed from `attitude`, `angular_velocity` (rad/s) and `angular_momentum` in body axes,
    /// `inertia` and `time` (s), and from the start of the body's motion: `initial_attitude` and `initial_angular_velocity` (rad/s, along the
    /// body's axes at the start). The language is that of [`crate::expression`].
    ///
    /// ```
    /// use polhode::Quantity;
    ///
    /// let text = "acos(clamp(dot(to_world(vec(0, 0, 1)), vec(0, 0, 1)), -1, 1))";
    /// let tilt = Quantity::formula("tilt", "rad", text)?;
    /// assert_eq!((tilt.name(), tilt.unit()), ("tilt", "rad"));
    /// # Ok::<(), polhode::expression::TextError>(())
    /// ```
    ///
    /// # Errors
    ///
    /// If the text is not such a formula; the error says where and why.
    pub fn formula(name: &str, unit: &str, text: &str) -> Result<Self, TextError> {
        Self::formula_with((&[], None), name, unit, text)
    }

    /// As [`Quantity::formula`], with access to the own state of a scene's torques: `torque1_h` is the `h` of the first torque, a number or
    /// a vector in the units of its law.
    ///
    /// ```
    /// # use glam::{DQuat, DVec3};
    /// # use polhode::torque::reaction_wheels::Wheels;
    /// # use polhode::torque::{Sampling, Torque};
    /// use polhode::Quantity;
    ///
    /// # let wheels = Wheels { torque_limit: 1e-3.into(), momentum_limit: 0.02.into(), momentum: DVec3::ZERO.into() };
    /// let torques = [Torque::reaction_wheels(2e-3, 8e-3, DQuat::IDENTITY, wheels, Sampling::every(0.5))];
    /// let all = Quantity::formula_of(&torques, "wheels", "kg m²/s", "norm(torque1_h)")?;
    /// assert_eq!(all.name(), "wheels");
    /// # Ok::<(), polhode::expression::TextError>(())
    /// ```
    pub fn formula_of(torques: &[Torque], name: &str, unit: &str, text: &str) -> Result<Self, TextError> {
        Self::formula_with((&control::own_parts(torques.iter().map(Torque::declaration)), None), name, unit, text)
    }

    /// As [`Quantity::formula_of`], with access to these parts of own state, and to the place on an orbit that all bodies share.
    pub(crate) fn formula_with(
        (parts, orbit): (&[OwnPart], Option<OrbitSymbols>),
        name: &str,
        unit: &str,
        text: &str,
    ) -> Result<Self, TextError> {
        let rotation = Symbols::rotation().with_full_inertia().with_constant_orbit(orbit);
        let of_start = AT_START.into_iter().map(|(name, shape)| (name.to_owned(), shape));
        let mut parameters = of_start.chain(parts.iter().map(|part| (part.label(), part.shape())));
        let symbols = parameters.try_fold(rotation, |symbols, (name, shape)| symbols.parameter(&name, shape))?;
        let expression = Expression::parse(text, &symbols, Shape::Number)?;
        let program = expression.program();
        let parameters = program.inputs().iter().filter(|input| input.kind == InputKind::Parameter);
        Ok(Self::Formula(Arc::new(FormulaQuantity {
            name: name.to_owned(),
            unit: unit.to_owned(),
            read: parameters.filter_map(|input| usize::from(input.index).checked_sub(NUMBERS_AT_START)).collect(),
            own: parts.iter().flat_map(OwnPart::numbers).collect(),
            expression,
        })))
    }
}
