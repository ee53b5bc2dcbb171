//! `constant-world`: a torque that is constant in world axes.

use super::formula::{Column, Epoch, Formula, Row};
use std::sync::LazyLock;

use glam::{DQuat, DVec3};

use super::{Declaration, Frame, Model, Parameter, ParameterDeclaration, Torque, Value, Values};
use crate::bodies::BodyFrame;
use crate::math::quaternion::Quaternion;
use crate::math::real::Real;
use crate::math::vector::Vector;

/// τ = Rᵀ τ_world. Several instances merge into one. It has no potential: rotations do not commute.
pub struct ConstantWorld;

static DECLARATION: LazyLock<Declaration> = LazyLock::new(|| {
    Declaration::new("constant-world", "τ = Rᵀ τ_world, constant in world axes", "by definition")
        .parameters([ParameterDeclaration::vector("torque", "N m", Frame::World, "the torque").factor()])
});
const TORQUE: usize = 0;

impl Torque {
    /// τ constant in world axes (N m); see [`ConstantWorld`].
    pub fn constant_world(torque_world: impl Into<Parameter<DVec3>>) -> Self {
        Self::built(&ConstantWorld, [Value::Vector(torque_world.into())])
    }
}

impl Model for ConstantWorld {
    declared!(ConstantWorld);

    fn rate(&self, values: Values<'_>, body: usize, middle_moment: f64) -> f64 {
        (values.vector(TORQUE).at(body).length() / middle_moment).sqrt()
    }

    fn columns(&self, values: Values<'_>, body: usize, frame: &BodyFrame, _: DQuat, out: &mut [f64]) {
        let torque = frame.scaled_torque(values.vector(TORQUE).at(body));
        for (column, component) in out.iter_mut().zip(torque.to_array()) {
            *column += component;
        }
    }
}

impl Formula for ConstantWorld {
    const STEM: &'static str = "constant_world";
    const COLUMNS: &'static [Column] = &[Column::vector("torque_world")];
    const MERGES: bool = true;

    /// Rᵀ τ_world.
    #[inline(always)]
    fn torque<R: Real>(row: &impl Row<R>, _: &Epoch<R>, q: Quaternion<R>, _: Vector<R>) -> Vector<R> {
        q.rotate_inverse(row.vector(0))
    }
}
