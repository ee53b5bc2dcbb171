//! Models whose torque is a formula that is made for the values at hand, from a text or from a list.

use glam::DQuat;

use super::{Declaration, Kind, Model, Torque, ValidationContext, Value, Values};
use crate::bodies::BodyFrame;
use crate::error::Result;

/// A model that makes its torques of others: it has no kernel function and no columns itself.
pub(super) trait ComposedModel: Send + Sync {
    /// What it says of itself.
    fn declaration(&self) -> &Declaration;

    /// The torque with these values.
    fn made_for(&self, values: &[Value], context: &ValidationContext) -> Result<Torque>;

    /// Refuses values that are valid one by one, but not together.
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
