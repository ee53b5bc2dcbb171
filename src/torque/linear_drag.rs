//! `linear-drag`: a torque opposite and proportional to the angular velocity, the same about every axis.

use super::formula::{Column, Epoch, Formula, Row};
use crate::math::quaternion::Quaternion;
use std::sync::LazyLock;

use glam::DQuat;

use super::{Declaration, Model, Parameter, ParameterDeclaration, Torque, Validity, Value, Values};
use crate::bodies::BodyFrame;
use crate::math::real::Real;
use crate::math::vector::Vector;

/// τ = −c ω (a slowly turning sphere of radius a in a fluid of viscosity η has c = 8πηa³: G. Kirchhoff, *Mechanik*, 1876,
/// lecture 26). Several instances merge into one.
pub struct LinearDrag;

static DECLARATION: LazyLock<Declaration> = LazyLock::new(|| {
    let coefficient = ParameterDeclaration::number("coefficient", "N m s", "the coefficient c");
    Declaration::new("linear-drag", "τ = −c ω", "G. Kirchhoff, Mechanik, 1876, lecture 26")
        .alias("viscous")
        .dissipative()
        .parameters([coefficient.valid(Validity::NotNegative).factor()])
});
const COEFFICIENT: usize = 0;

impl Torque {
    /// τ = −c ω, c in N m s; see [`LinearDrag`].
    pub fn linear_drag(coefficient: impl Into<Parameter<f64>>) -> Self {
        Self::built(&LinearDrag, [Value::Number(coefficient.into())])
    }
}

impl Model for LinearDrag {
    declared!(LinearDrag);

    fn damping(&self, values: Values<'_>, body: usize, middle_moment: f64) -> f64 {
        values.number(COEFFICIENT).at(body) / middle_moment
    }

    fn columns(&self, values: Values<'_>, body: usize, frame: &BodyFrame, _: DQuat, out: &mut [f64]) {
        out[0] += frame.scaled(values.number(COEFFICIENT).at(body), 1, 1);
    }
}

impl Formula for LinearDrag {
    const STEM: &'static str = "linear_drag";
    const COLUMNS: &'static [Column] = &[Column::number("coefficient")];
    const MERGES: bool = true;

    /// −c ω.
    #[inline(always)]
    fn torque<R: Real>(row: &impl Row<R>, _: &Epoch<R>, _: Quaternion<R>, omega: Vector<R>) -> Vector<R> {
        -(omega * row.number(0))
    }
}
