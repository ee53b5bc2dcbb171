//! `quadratic-drag`: a torque against the angular velocity that grows with its square, the same about every axis.

use super::formula::{Column, Epoch, Formula, Row};
use crate::math::quaternion::Quaternion;
use std::sync::LazyLock;

use glam::DQuat;

use super::{Declaration, Model, Parameter, ParameterDeclaration, Torque, Validity, Value, Values};
use crate::bodies::BodyFrame;
use crate::math::real::Real;
use crate::math::vector::Vector;

/// τ = −c |ω| ω, the form at large Reynolds numbers (Newton, *Principia*, 1687, book II, section II, for a
/// translation). Several instances merge into one.
pub struct QuadraticDrag;

static DECLARATION: LazyLock<Declaration> = LazyLock::new(|| {
    let coefficient = ParameterDeclaration::number("coefficient", "N m s²", "the coefficient c");
    Declaration::new("quadratic-drag", "τ = −c |ω| ω", "I. Newton, Principia, 1687, book II, section II")
        .dissipative()
        .parameters([coefficient.valid(Validity::NotNegative).factor()])
});
const COEFFICIENT: usize = 0;

impl Torque {
    /// τ = −c |ω| ω, c in N m s²; see [`QuadraticDrag`].
    pub fn quadratic_drag(coefficient: impl Into<Parameter<f64>>) -> Self {
        Self::built(&QuadraticDrag, [Value::Number(coefficient.into())])
    }
}

impl Model for QuadraticDrag {
    declared!(QuadraticDrag);

    fn columns(&self, values: Values<'_>, body: usize, frame: &BodyFrame, _: DQuat, out: &mut [f64]) {
        out[0] += frame.scaled(values.number(COEFFICIENT).at(body), 1, 0);
    }
}

impl Formula for QuadraticDrag {
    const STEM: &'static str = "quadratic_drag";
    const COLUMNS: &'static [Column] = &[Column::number("coefficient")];
    const MERGES: bool = true;

    /// −c |ω| ω.
    #[inline(always)]
    fn torque<R: Real>(row: &impl Row<R>, _: &Epoch<R>, _: Quaternion<R>, omega: Vector<R>) -> Vector<R> {
        let coefficient = row.number(0);
        let speed = omega.dot(omega).sqrt();
        -(omega * (coefficient * speed))
    }
}
