//! `sine-spring`: a torsion spring towards an attitude whose torque is the sine of the angle.

use super::formula::{Column, Epoch, Formula, Row};
use std::sync::LazyLock;

use glam::DQuat;

use super::{Declaration, Model, Parameter, ParameterDeclaration, Torque, Validity, Value, Values};
use crate::bodies::BodyFrame;
use crate::math::quaternion::Quaternion;
use crate::math::real::Real;
use crate::math::vector::Vector;

/// τ = −k sin θ n = −2 k s v with (v, s) = conj(q_target) q (B. Wie, P. M. Barba, J. Guid. Control Dyn. 8 (1985) 360,
/// the quaternion feedback, symmetrised so that q and −q give the same torque). Smooth everywhere; potential energy k (1 − cos θ).
pub struct SineSpring;

static DECLARATION: LazyLock<Declaration> = LazyLock::new(|| {
    let stiffness = ParameterDeclaration::number("stiffness", "N m", "the stiffness k");
    Declaration::new("sine-spring", "τ = −k sin θ n", "B. Wie, P. M. Barba, J. Guid. Control Dyn. 8 (1985) 360")
        .parameters([
            stiffness.valid(Validity::NotNegative).factor(),
            ParameterDeclaration::rotation("target", "the attitude at rest"),
        ])
});
const STIFFNESS: usize = 0;
const TARGET: usize = 1;

impl Torque {
    /// τ = −k sin θ n towards an attitude (body to world, normalised here), k in N m; see [`SineSpring`].
    pub fn sine_spring(stiffness: impl Into<Parameter<f64>>, target: impl Into<Parameter<DQuat>>) -> Self {
        Self::built(&SineSpring, [Value::Number(stiffness.into()), Value::Rotation(target.into())])
    }
}

impl Model for SineSpring {
    declared!(SineSpring);

    fn rate(&self, values: Values<'_>, body: usize, middle_moment: f64) -> f64 {
        (values.number(STIFFNESS).at(body) / middle_moment).sqrt()
    }

    fn columns(&self, values: Values<'_>, body: usize, frame: &BodyFrame, _: DQuat, out: &mut [f64]) {
        out[0] = frame.scaled(values.number(STIFFNESS).at(body), 1, 2);
        let target = (values.rotation(TARGET).at(body).normalize() * frame.principal_to_body).normalize();
        out[1..5].copy_from_slice(&target.to_array());
    }

    fn has_potential(&self) -> bool {
        true
    }

    fn potential_energy(&self, values: Values<'_>, body: usize, orientation: DQuat) -> f64 {
        let between = values.rotation(TARGET).at(body).normalize().conjugate() * orientation;
        2.0 * values.number(STIFFNESS).at(body) * between.xyz().length_squared()
    }
}

impl Formula for SineSpring {
    const STEM: &'static str = "sine_spring";
    const COLUMNS: &'static [Column] = &[Column::number("stiffness"), Column::quaternion("target_orientation")];

    /// −2 k s v.
    #[inline(always)]
    fn torque<R: Real>(row: &impl Row<R>, _: &Epoch<R>, q: Quaternion<R>, _: Vector<R>) -> Vector<R> {
        let (stiffness, target) = (row.number(0), row.quaternion(1));
        let between = target.conjugate().product(q);
        between.vector() * (R::splat(-2.0) * stiffness * between.w)
    }
}
