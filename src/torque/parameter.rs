//! Parameters of torques: shared by all bodies, or one for each.

use std::ops::Range;
use std::sync::Arc;

/// A parameter of a torque or force: the same for all bodies, or a column with one row for each body.
#[derive(Clone, Debug, PartialEq)]
pub enum Parameter<V> {
    /// The same for all bodies.
    Shared(V),
    /// One for each body, shape `[body_count]`: from a `Vec` or a slice by `into`. Clones of the parameter share it.
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

    /// The same for some of the bodies, counted from 0.
    ///
    /// # Panics
    ///
    /// If a column does not have all of these rows.
    #[must_use]
    pub fn only(&self, bodies: Range<usize>) -> Self {
        match self {
            Parameter::Shared(value) => Parameter::Shared(*value),
            Parameter::PerBody(column) => Parameter::PerBody(column[bodies].into()),
        }
    }

    /// The values that there are: one, or one for each body.
    pub(crate) fn values(&self) -> &[V] {
        match self {
            Parameter::Shared(value) => std::slice::from_ref(value),
            Parameter::PerBody(column) => column,
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
