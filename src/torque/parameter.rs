//! Parameters of torques: one for the scene or one a body.

use std::sync::Arc;

use glam::{DMat3, DQuat, DVec3};

use crate::error::{Error, Result};
use crate::inertia::InertiaTensor;

/// A parameter of a torque or force: the same for all bodies, or a column with one row a body.
#[derive(Clone, Debug, PartialEq)]
pub enum Parameter<V> {
    /// The same for all bodies.
    Shared(V),
    /// One a body, shape `[body_count]`: made by `collect` or from a `Vec` or slice by `into`. Copies of the parameter share it.
    PerBody(Arc<[V]>),
}

impl<V: Copy> Parameter<V> {
    /// The value for one body.
    ///
    /// # Panics
    ///
    /// If a column has no such row; columns are checked when a plan is made.
    pub fn at(&self, body: usize) -> V {
        match self {
            Parameter::Shared(value) => *value,
            Parameter::PerBody(column) => column[body],
        }
    }

    /// Whether all bodies share one value.
    pub fn is_shared(&self) -> bool {
        matches!(self, Parameter::Shared(_))
    }
}

impl<V> From<V> for Parameter<V> {
    fn from(value: V) -> Self {
        Parameter::Shared(value)
    }
}

impl<V> From<Vec<V>> for Parameter<V> {
    fn from(column: Vec<V>) -> Self {
        Parameter::PerBody(column.into())
    }
}

impl<V: Copy> From<&[V]> for Parameter<V> {
    fn from(column: &[V]) -> Self {
        Parameter::PerBody(column.into())
    }
}

/// A value whose components are numbers.
pub(crate) trait Value: Copy {
    /// The first component that is not finite.
    fn not_finite(&self) -> Option<f64>;
}

impl Value for f64 {
    fn not_finite(&self) -> Option<f64> {
        (!self.is_finite()).then_some(*self)
    }
}

impl Value for DVec3 {
    fn not_finite(&self) -> Option<f64> {
        self.to_array().into_iter().find(|x| !x.is_finite())
    }
}

impl Value for DQuat {
    fn not_finite(&self) -> Option<f64> {
        self.to_array().into_iter().find(|x| !x.is_finite())
    }
}

impl Value for InertiaTensor {
    fn not_finite(&self) -> Option<f64> {
        self.to_array().into_iter().find(|x| !x.is_finite())
    }
}

impl Value for DMat3 {
    fn not_finite(&self) -> Option<f64> {
        self.to_cols_array().into_iter().find(|x| !x.is_finite())
    }
}

/// Where a parameter is checked: which torque of the scene it belongs to.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Border {
    /// Index of the torque in its scene, from 0.
    pub torque: usize,
    /// The model's name.
    pub model: &'static str,
    /// Bodies of the scene.
    pub body_count: usize,
}

impl Border {
    /// The error for one value; `body` is `None` where all bodies share it.
    pub fn refusal(&self, body: Option<usize>, field: &'static str, value: f64, expected: &'static str) -> Error {
        Error::Torque { torque: self.torque, model: self.model, body, field, value, expected }
    }

    /// Refuses a column that has not one row a body and the first value for which `fault` gives a number.
    fn each<V: Copy>(
        &self,
        field: &'static str,
        parameter: &Parameter<V>,
        expected: &'static str,
        fault: impl Fn(&V) -> Option<f64>,
    ) -> Result<()> {
        let found = match parameter {
            Parameter::Shared(value) => fault(value).map(|value| (None, value)),
            Parameter::PerBody(column) => {
                if column.len() != self.body_count {
                    return Err(Error::ColumnLength { column: field, found: column.len(), expected: self.body_count });
                }
                column.iter().enumerate().find_map(|(body, value)| fault(value).map(|value| (Some(body), value)))
            }
        };
        match found {
            Some((body, value)) => Err(self.refusal(body, field, value, expected)),
            None => Ok(()),
        }
    }

    /// Finite components and, in a column, one row a body.
    pub fn finite<V: Value>(&self, field: &'static str, parameter: &Parameter<V>) -> Result<()> {
        self.each(field, parameter, "finite components are needed", Value::not_finite)
    }

    /// Finite numbers that satisfy `valid`.
    pub fn number(
        &self,
        field: &'static str,
        parameter: &Parameter<f64>,
        expected: &'static str,
        valid: impl Fn(f64) -> bool,
    ) -> Result<()> {
        self.each(field, parameter, expected, |&x| (!(x.is_finite() && valid(x))).then_some(x))
    }

    /// Finite numbers that are not negative.
    pub fn not_negative(&self, field: &'static str, parameter: &Parameter<f64>) -> Result<()> {
        self.number(field, parameter, "a finite number that is not negative is needed", |x| x >= 0.0)
    }

    /// Finite numbers above zero.
    pub fn positive(&self, field: &'static str, parameter: &Parameter<f64>) -> Result<()> {
        self.number(field, parameter, "a finite number above zero is needed", |x| x > 0.0)
    }

    /// Quaternions that are finite and not zero.
    pub fn rotation(&self, field: &'static str, parameter: &Parameter<DQuat>) -> Result<()> {
        self.each(field, parameter, "a finite quaternion that is not zero is needed", |q| {
            let length = q.length_squared();
            (!(length.is_finite() && length > 0.0)).then_some(length)
        })
    }

    /// Matrices that are finite, symmetric to 1e-12 of their largest element, and have no negative eigenvalue.
    pub fn positive_semidefinite(&self, field: &'static str, parameter: &Parameter<DMat3>) -> Result<()> {
        self.finite(field, parameter)?;
        let expected = "a symmetric matrix without negative eigenvalues is needed";
        self.each(field, parameter, expected, |matrix| {
            let largest = matrix.to_cols_array().into_iter().fold(0.0_f64, |largest, x| largest.max(x.abs()));
            let skew = (*matrix - matrix.transpose()).to_cols_array().into_iter().fold(0.0_f64, |a, x| a.max(x.abs()));
            if skew > 1e-12 * largest {
                return Some(skew);
            }
            let least = crate::inertia::principal_axes(&(*matrix).into()).moments.x;
            (least < -1e-12 * largest).then_some(least)
        })
    }
}
