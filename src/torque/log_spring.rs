//! `log-spring`: a torsion spring towards an attitude whose torque is the angle itself.

use super::formula::{Column, Epoch, Formula, Row};
use std::sync::LazyLock;

use glam::DQuat;

use super::{Declaration, Model, Parameter, ParameterDeclaration, Torque, Validity, Value, Values};
use crate::bodies::BodyFrame;
use crate::math::elementary::functions::arctangent_ratio;
use crate::math::quaternion::Quaternion;
use crate::math::real::Real;
use crate::math::vector::Vector;

/// τ = −k θ n, with (n sin θ/2, cos θ/2) = conj(q_target) q and θ in [0, π] (F. Bullo, R. M. Murray, *Proportional
/// derivative control on the Euclidean group*, ECC 1995, the logarithm on SO(3)). Potential energy ½ k θ².
///
/// At θ = π the torque jumps from one side to the other; a motion through that point is not smooth, and every integrator drops to
/// order 1 there.
pub struct LogSpring;

static DECLARATION: LazyLock<Declaration> = LazyLock::new(|| {
    let stiffness = ParameterDeclaration::number("stiffness", "N m", "the stiffness k");
    Declaration::new(
        "log-spring",
        "τ = −k θ n",
        "F. Bullo, R. M. Murray, Proportional derivative control on the Euclidean group, ECC 1995",
    )
    .parameters([
        stiffness.valid(Validity::NotNegative).factor(),
        ParameterDeclaration::rotation("target", "the attitude at rest"),
    ])
});
const STIFFNESS: usize = 0;
const TARGET: usize = 1;

impl Torque {
    /// τ = −k θ n towards an attitude (body to world, normalised here), k in N m; see [`LogSpring`].
    pub fn log_spring(stiffness: impl Into<Parameter<f64>>, target: impl Into<Parameter<DQuat>>) -> Self {
        Self::built(&LogSpring, [Value::Number(stiffness.into()), Value::Rotation(target.into())])
    }
}

impl Model for LogSpring {
    declared!(LogSpring);

    fn rate(&self, values: Values<'_>, body: usize, middle_moment: f64) -> f64 {
        (std::f64::consts::PI * values.number(STIFFNESS).at(body) / middle_moment).sqrt()
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
        let angle = 2.0 * between.xyz().length().atan2(between.w.abs());
        0.5 * values.number(STIFFNESS).at(body) * angle * angle
    }
}

/// θ n = `angle_ratio` · v for the rotation (v, s), with the sign of s.
///
/// θ = 2 atan(|v|/|s|). The tangent is halved twice, a/(1 + √(1 + a²)), which brings it below tan π/8 · ½ = 0.199 and
/// leaves |v| as a factor, so that nothing is divided by a vanishing |v|; then atan x = x Σ (−x²)ⁿ/(2n + 1), whose first
/// term left out is below 2⁻²⁶ (`f32`) or 2⁻⁵⁵ (`f64`) of the result.
#[inline(always)]
pub(crate) fn angle_ratio<R: Real>(between: Quaternion<R>) -> R {
    let one = R::splat(1.0);
    let v2 = between.vector().dot(between.vector());
    // Halved once: |v| / (|q| + |s|), the tangent of θ/4, at most 1.
    let norm = between.norm_squared().sqrt();
    let divisor = norm + between.w.abs();
    let quarter_squared = v2 / (divisor * divisor);
    // Twice: the tangent of θ/8, at most 0.415; three times: of θ/16, at most 0.199.
    let eighth_divisor = one + (one + quarter_squared).sqrt();
    let eighth_squared = quarter_squared / (eighth_divisor * eighth_divisor);
    let sixteenth_divisor = one + (one + eighth_squared).sqrt();
    let x2 = eighth_squared / (sixteenth_divisor * sixteenth_divisor);
    let ratio = R::splat(16.0) * arctangent_ratio(x2) / (divisor * eighth_divisor * sixteenth_divisor);
    R::select(between.w.less_than(R::splat(0.0)), -ratio, ratio)
}

impl Formula for LogSpring {
    const STEM: &'static str = "log_spring";
    const COLUMNS: &'static [Column] = &[Column::number("stiffness"), Column::quaternion("target_orientation")];

    /// −k θ n.
    #[inline(always)]
    fn torque<R: Real>(row: &impl Row<R>, _: &Epoch<R>, q: Quaternion<R>, _: Vector<R>) -> Vector<R> {
        let (stiffness, target) = (row.number(0), row.quaternion(1));
        let between = target.conjugate().product(q);
        between.vector() * (-(stiffness * angle_ratio(between)))
    }
}
