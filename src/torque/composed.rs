//! Models whose torque is a formula built for the given values, from a text or from a list.

use glam::DQuat;

use super::{Declaration, Kind, Model, Torque, ValidationContext, Value, Values};
use crate::bodies::BodyFrame;
use crate::error::Result;

/// A model that builds its torques from others: it has no kernel function and no columns of its own.
pub(super) trait ComposedModel: Send + Sync {
    /// The model's declaration.
    fn declaration(&self) -> &Declaration;

    /// The torque with these values.
    fn made_for(&self, values: &[Value], context: &ValidationContext) -> Result<Torque>;

    /// Refuses values that are valid individually but not together.
    fn validate(&self, _: Values<'_>, _: &ValidationContext) -> Result<()> {
        Ok(())
    }
}

impl<M: ComposedModel> Model for M {
    fn declaration(&self) -> &Declaration {
        ComposedModel::declaration(self)
    }

    fn made_for(&self, values: &[Value], context: &ValidationContext) -> Option<Result<Torque>> {
        Some(ComposedModel::made_for(self, values, context))
    }

    fn kind(&self, _: Values<'_>) -> Kind {
        Kind::Custom
    }

    fn validate(&self, values: Values<'_>, context: &ValidationContext) -> Result<()> {
        ComposedModel::validate(self, values, context)
    }

    fn columns(&self, _: Values<'_>, _: usize, _: &BodyFrame, _: DQuat, _: &mut [f64]) {}
}
