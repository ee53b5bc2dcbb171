//! Validation of parameter values, once, when a plan is made.

use glam::{DMat3, DQuat, DVec3};

use super::{Parameter, Shape, Text, Validity, Value};
use crate::bodies::inertia::InertiaTensor;
use crate::error::{Error, Result};

/// The torque of the scene that is being validated.
#[derive(Clone, Debug)]
pub(crate) struct ValidationContext {
    /// Index of the torque in its scene, from 0.
    pub torque: usize,
    /// The model's name.
    pub model: Text,
    /// Bodies of the scene.
    pub body_count: usize,
}

impl ValidationContext {
    /// The error for one value; `body` is `None` if all bodies share it.
    pub fn refusal(&self, body: Option<usize>, field: impl Into<Text>, value: f64, expected: impl Into<Text>) -> Error {
        let (field, expected) = (field.into(), expected.into());
        Error::Torque { torque: self.torque, model: self.model.clone(), body, field, value, expected }
    }

    /// Refuses a column that does not have one row for each body, and the first value that is not valid.
    pub fn check(&self, field: &Text, unit: &str, valid: Validity, value: &Value) -> Result<()> {
        let found = match value {
            Value::Number(number) => self.first(field, number, |x| valid.fault([*x])),
            Value::Vector(vector) => self.first(field, vector, |v: &DVec3| valid.vector_fault(v)),
            Value::Rotation(rotation) => self.first(field, rotation, rotation_fault),
            Value::Matrix(matrix) => self.first(field, matrix, |m: &DMat3| valid.matrix_fault(m)),
            Value::Tensor(tensor) => self.first(field, tensor, |i: &InertiaTensor| valid.fault(i.to_array())),
            Value::Whole(number) => Ok(valid.fault([*number as f64]).map(|value| (None, value))),
            Value::List(list) => Ok(valid.fault([list.len() as f64]).map(|value| (None, value))),
            Value::Absent => Ok(None),
        }?;
        let shape = match value {
            Value::Number(_) => Shape::Number,
            Value::Whole(_) => Shape::Whole,
            _ => Shape::Vector,
        };
        match found {
            Some((body, number)) => Err(self.refusal(body, field.clone(), number, valid.expected(shape, unit))),
            None => Ok(()),
        }
    }

    /// The first faulty number that `fault` finds, and its body in a column.
    fn first<V: Copy>(
        &self,
        field: &Text,
        parameter: &Parameter<V>,
        fault: impl Fn(&V) -> Option<f64>,
    ) -> Result<Option<(Option<usize>, f64)>> {
        match parameter {
            Parameter::Shared(value) => Ok(fault(value).map(|value| (None, value))),
            Parameter::PerBody(column) if column.len() != self.body_count => {
                Err(Error::ColumnLength { column: field.clone(), found: column.len(), expected: self.body_count })
            }
            Parameter::PerBody(column) => {
                let faults = column.iter().enumerate();
                Ok(faults.filter_map(|(body, value)| Some((Some(body), fault(value)?))).next())
            }
        }
    }
}

impl Validity {
    /// The first component that is not valid.
    fn fault<const N: usize>(&self, components: [f64; N]) -> Option<f64> {
        components.into_iter().find(|x| !self.holds(*x))
    }

    /// The faulty number of a vector: a component, or its length if the square of that is out of range.
    fn vector_fault(&self, vector: &DVec3) -> Option<f64> {
        let has_length = *self != Validity::NotZero || vector.length_squared().is_normal();
        let largest = vector.abs().max_element();
        let length = || if largest > 0.0 { largest * (*vector / largest).length() } else { 0.0 };
        self.fault(vector.to_array()).or_else(|| (!has_length).then(length))
    }

    /// The faulty number of a matrix: an element, its deviation from symmetry, or an eigenvalue.
    fn matrix_fault(&self, matrix: &DMat3) -> Option<f64> {
        let fault = self.fault(matrix.to_cols_array());
        if fault.is_some() || *self != Validity::PositiveSemidefinite {
            return fault;
        }
        let largest_of = |matrix: DMat3| matrix.to_cols_array().into_iter().fold(0.0_f64, |a, x| a.max(x.abs()));
        let (largest, skew) = (largest_of(*matrix), largest_of(*matrix - matrix.transpose()));
        if skew > 1e-12 * largest {
            return Some(skew);
        }
        let least = crate::bodies::inertia::principal_axes(&(*matrix).into()).moments.x;
        (least < -1e-12 * largest).then_some(least)
    }
}

/// The squared length of a quaternion that is not a rotation.
fn rotation_fault(rotation: &DQuat) -> Option<f64> {
    let length = rotation.length_squared();
    (!(length.is_finite() && length > 0.0)).then_some(length)
}
