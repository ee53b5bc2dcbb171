//! `eddy-current`: damping of a conducting body that turns in a uniform magnetic field.

use super::formula::{Column, Epoch, Formula, Row};
use std::sync::LazyLock;

use glam::{DQuat, DVec3};

use super::{Declaration, Frame, Model, Parameter, ParameterDeclaration, Torque, Validity, Value, Values};
use crate::bodies::BodyFrame;
use crate::math::quaternion::Quaternion;
use crate::math::real::Real;
use crate::math::vector::Vector;

/// τ = k (ω × B) × B, which damps only the part of ω across the field (G. L. Smith, *A theoretical study of the torques induced by a
/// magnetic field on rotating cylinders and spheres*, NASA TR R-129, 1962; a conducting sphere of conductivity σ and radius a has k =
/// 2πσa⁵/15).
pub struct EddyCurrent;

static DECLARATION: LazyLock<Declaration> = LazyLock::new(|| {
    let coefficient = ParameterDeclaration::number("coefficient", "N m s/T²", "the coefficient k");
    Declaration::new("eddy-current", "τ = k (ω × B) × B", "G. L. Smith, NASA TR R-129, 1962").dissipative().parameters(
        [
            coefficient.valid(Validity::NotNegative).factor(),
            ParameterDeclaration::vector("field", "T", Frame::World, "the field B").factor(),
        ],
    )
});
const COEFFICIENT: usize = 0;
const FIELD: usize = 1;

impl Torque {
    /// τ = k (ω × B) × B, k in N m s/T², B in world axes (T); see [`EddyCurrent`].
    pub fn eddy_current(coefficient: impl Into<Parameter<f64>>, field_world: impl Into<Parameter<DVec3>>) -> Self {
        Self::built(&EddyCurrent, [Value::Number(coefficient.into()), Value::Vector(field_world.into())])
    }
}

impl Model for EddyCurrent {
    declared!(EddyCurrent);

    fn damping(&self, values: Values<'_>, body: usize, middle_moment: f64) -> f64 {
        values.number(COEFFICIENT).at(body) * values.vector(FIELD).at(body).length_squared() / middle_moment
    }

    fn columns(&self, values: Values<'_>, body: usize, frame: &BodyFrame, _: DQuat, out: &mut [f64]) {
        let field = values.vector(FIELD).at(body);
        out[0] = frame.scaled(values.number(COEFFICIENT).at(body) * field.length_squared(), 1, 1);
        out[1..4].copy_from_slice(&field.normalize_or_zero().to_array());
    }
}

/// k' (ω × d) × d with d the field's direction in principal axes, k' = k |B|².
#[inline(always)]
pub fn eddy_current<R: Real>(
    coefficient: R,
    direction_world: Vector<R>,
    orientation: Quaternion<R>,
    angular_velocity_principal: Vector<R>,
) -> Vector<R> {
    let direction = orientation.rotate_inverse(direction_world);
    angular_velocity_principal.cross(direction).cross(direction) * coefficient
}

impl Formula for EddyCurrent {
    const STEM: &'static str = "eddy_current";
    const COLUMNS: &'static [Column] = &[Column::number("coefficient"), Column::vector("direction_world")];

    #[inline(always)]
    fn torque<R: Real>(row: &impl Row<R>, _: &Epoch<R>, q: Quaternion<R>, omega: Vector<R>) -> Vector<R> {
        eddy_current(row.number(0), row.vector(1), q, omega)
    }
}
