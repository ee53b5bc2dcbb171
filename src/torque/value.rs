//! Values of a torque's parameters.

use std::ops::Range;
use std::sync::Arc;

use glam::{DMat3, DQuat, DVec3};

use super::Parameter;
use crate::bodies::inertia::InertiaTensor;

/// The value of a parameter, in one of the possible shapes.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Value {
    /// A number.
    Number(Parameter<f64>),
    /// Three numbers.
    Vector(Parameter<DVec3>),
    /// A rotation from body to world.
    Rotation(Parameter<DQuat>),
    /// A matrix.
    Matrix(Parameter<DMat3>),
    /// An inertia tensor.
    Tensor(Parameter<InertiaTensor>),
    /// A whole number.
    Whole(u64),
    /// The parameter values of each table of a list. Clones share it.
    List(Arc<[Vec<Value>]>),
    /// Absent: another parameter of the same choice has a value.
    Absent,
}

/// Accessors: the parameter, where the value has that shape.
impl Value {
    /// The parameter of a number.
    pub fn as_number(&self) -> Option<&Parameter<f64>> {
        if let Value::Number(number) = self { Some(number) } else { None }
    }

    /// The parameter of a vector.
    pub fn as_vector(&self) -> Option<&Parameter<DVec3>> {
        if let Value::Vector(vector) = self { Some(vector) } else { None }
    }

    /// The parameter of a rotation.
    pub(crate) fn as_rotation(&self) -> Option<&Parameter<DQuat>> {
        if let Value::Rotation(rotation) = self { Some(rotation) } else { None }
    }

    /// The parameter of a matrix.
    pub(crate) fn as_matrix(&self) -> Option<&Parameter<DMat3>> {
        if let Value::Matrix(matrix) = self { Some(matrix) } else { None }
    }

    /// The parameter of an inertia tensor.
    pub(crate) fn as_tensor(&self) -> Option<&Parameter<InertiaTensor>> {
        if let Value::Tensor(tensor) = self { Some(tensor) } else { None }
    }

    /// The value of a whole number.
    pub(crate) fn as_whole(&self) -> Option<u64> {
        if let Value::Whole(number) = self { Some(*number) } else { None }
    }

    /// The tables of a list.
    pub fn as_list(&self) -> Option<&[Vec<Value>]> {
        if let Value::List(list) = self { Some(list) } else { None }
    }

    /// The same for some of the bodies, counted from 0. Lists hold values that all bodies share.
    pub(crate) fn only(&self, bodies: Range<usize>) -> Self {
        match self {
            Value::Number(number) => Value::Number(number.only(bodies)),
            Value::Vector(vector) => Value::Vector(vector.only(bodies)),
            Value::Rotation(rotation) => Value::Rotation(rotation.only(bodies)),
            Value::Matrix(matrix) => Value::Matrix(matrix.only(bodies)),
            Value::Tensor(tensor) => Value::Tensor(tensor.only(bodies)),
            Value::Whole(_) | Value::List(_) | Value::Absent => self.clone(),
        }
    }

    /// Whether all bodies have the same value.
    pub fn is_shared(&self) -> bool {
        match self {
            Value::Number(number) => number.is_shared(),
            Value::Vector(vector) => vector.is_shared(),
            Value::Rotation(rotation) => rotation.is_shared(),
            Value::Matrix(matrix) => matrix.is_shared(),
            Value::Tensor(tensor) => tensor.is_shared(),
            Value::Whole(_) | Value::List(_) | Value::Absent => true,
        }
    }

    /// Whether it is zero for a body; an absent value is not.
    pub(crate) fn is_zero(&self, body: usize) -> bool {
        match self {
            Value::Number(number) => number.at(body) == 0.0,
            Value::Vector(vector) => vector.at(body) == DVec3::ZERO,
            Value::Matrix(matrix) => matrix.at(body) == DMat3::ZERO,
            Value::Tensor(tensor) => tensor.at(body) == InertiaTensor::default(),
            Value::Whole(number) => *number == 0,
            Value::Rotation(_) | Value::List(_) | Value::Absent => false,
        }
    }

    /// Whether it is zero for no body.
    pub(crate) fn is_nowhere_zero(&self) -> bool {
        match self {
            Value::Number(number) => number.values().iter().all(|&number| number != 0.0),
            Value::Vector(vector) => vector.values().iter().all(|&vector| vector != DVec3::ZERO),
            Value::Matrix(matrix) => matrix.values().iter().all(|&matrix| matrix != DMat3::ZERO),
            Value::Tensor(tensor) => tensor.values().iter().all(|&tensor| tensor != InertiaTensor::default()),
            Value::Whole(_) | Value::Rotation(_) | Value::List(_) | Value::Absent => !self.is_zero(0),
        }
    }
}

/// The values of a torque, which its model reads by their positions in the declaration.
///
/// A shape other than the declared one is a bug: values are made by the models' own constructors and by the reader of studies, both from
/// the declaration.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Values<'a> {
    pub values: &'a [Value],
    /// The offset of a body's index in the larger scene, if the bodies are a part of one.
    pub first_body: usize,
}

const OTHER_SHAPE: &str = "a value has the shape that its parameter declares";

impl<'a> Values<'a> {
    pub fn number(self, place: usize) -> &'a Parameter<f64> {
        self.values[place].as_number().expect(OTHER_SHAPE)
    }

    pub fn vector(self, place: usize) -> &'a Parameter<DVec3> {
        self.values[place].as_vector().expect(OTHER_SHAPE)
    }

    pub fn rotation(self, place: usize) -> &'a Parameter<DQuat> {
        self.values[place].as_rotation().expect(OTHER_SHAPE)
    }

    pub fn matrix(self, place: usize) -> &'a Parameter<DMat3> {
        self.values[place].as_matrix().expect(OTHER_SHAPE)
    }

    pub fn whole(self, place: usize) -> u64 {
        self.values[place].as_whole().expect(OTHER_SHAPE)
    }

    /// The value at `place`, or `None` if another of the same choice is given.
    pub fn given(self, place: usize) -> Option<&'a Value> {
        Some(&self.values[place]).filter(|value| **value != Value::Absent)
    }
}
