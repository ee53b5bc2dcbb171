//! `constant-body`: a torque that is constant in body axes, such as that of a pair of thrusters.

use super::formula::{Column, Epoch, Formula, Row};
use crate::math::quaternion::Quaternion;
use std::sync::LazyLock;

use glam::{DQuat, DVec3};

use super::{Declaration, Frame, Model, Parameter, ParameterDeclaration, Torque, Value, Values};
use crate::bodies::BodyFrame;
use crate::math::real::Real;
use crate::math::vector::Vector;

/// τ = const in body axes. Several instances merge into one.
pub struct ConstantBody;

static DECLARATION: LazyLock<Declaration> = LazyLock::new(|| {
    Declaration::new("constant-body", "τ = const in body axes", "J. M. Longuski, Acta Astronautica 25 (1991) 131")
        .parameters([ParameterDeclaration::vector("torque", "N m", Frame::Body, "the torque").factor()])
});
const TORQUE: usize = 0;

impl Torque {
    /// τ constant in body axes (N m); see [`ConstantBody`].
    pub fn constant_body(torque_body: impl Into<Parameter<DVec3>>) -> Self {
        Self::built(&ConstantBody, [Value::Vector(torque_body.into())])
    }
}

impl Model for ConstantBody {
    declared!(ConstantBody);

    fn rate(&self, values: Values<'_>, body: usize, middle_moment: f64) -> f64 {
        (values.vector(TORQUE).at(body).length() / middle_moment).sqrt()
    }

    fn columns(&self, values: Values<'_>, body: usize, frame: &BodyFrame, _: DQuat, out: &mut [f64]) {
        let mut torque = frame.scaled_torque(frame.to_principal(values.vector(TORQUE).at(body)));
        if frame.is_linear_rotor {
            // A torque about the axis of a linear rotor has no effect (see `linear_rotor`).
            torque.x = 0.0;
        }
        for (column, component) in out.iter_mut().zip(torque.to_array()) {
            *column += component;
        }
    }
}

impl Formula for ConstantBody {
    const STEM: &'static str = "constant_body";
    const COLUMNS: &'static [Column] = &[Column::vector("torque_principal")];
    const MERGES: bool = true;

    #[inline(always)]
    fn torque<R: Real>(row: &impl Row<R>, _: &Epoch<R>, _: Quaternion<R>, _: Vector<R>) -> Vector<R> {
        row.vector(0)
    }
}
