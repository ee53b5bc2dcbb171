//! `magnetic-dipole`: a magnet fixed in the body, in a uniform field.

use super::formula::{Column, Epoch, Formula, Row};
use std::sync::LazyLock;

use glam::{DQuat, DVec3};

use super::{Declaration, Frame, Model, Parameter, ParameterDeclaration, Torque, Value, Values};
use crate::bodies::BodyFrame;
use crate::math::quaternion::Quaternion;
use crate::math::real::Real;
use crate::math::vector::Vector;

/// τ = m × Rᵀ B (J. C. Maxwell, *A Treatise on Electricity and Magnetism*, 1873, § 390). Potential energy: −B · R m.
pub struct MagneticDipole;

static DECLARATION: LazyLock<Declaration> = LazyLock::new(|| {
    let source = "J. C. Maxwell, A Treatise on Electricity and Magnetism, 1873, § 390";
    Declaration::new("magnetic-dipole", "τ = m × Rᵀ B", source).parameters([
        ParameterDeclaration::vector("moment", "A m²", Frame::Body, "the magnetic moment m").factor(),
        ParameterDeclaration::vector("field", "T", Frame::World, "the field B").factor(),
    ])
});
const MOMENT: usize = 0;
const FIELD: usize = 1;

impl Torque {
    /// A magnetic moment in body axes (A m²) in a uniform field in world axes (T); see [`MagneticDipole`].
    pub fn magnetic_dipole(moment_body: impl Into<Parameter<DVec3>>, field_world: impl Into<Parameter<DVec3>>) -> Self {
        Self::built(&MagneticDipole, [Value::Vector(moment_body.into()), Value::Vector(field_world.into())])
    }
}

impl Model for MagneticDipole {
    declared!(MagneticDipole);

    fn rate(&self, values: Values<'_>, body: usize, middle_moment: f64) -> f64 {
        (values.vector(MOMENT).at(body).length() * values.vector(FIELD).at(body).length() / middle_moment).sqrt()
    }

    fn columns(&self, values: Values<'_>, body: usize, frame: &BodyFrame, _: DQuat, out: &mut [f64]) {
        let field = values.vector(FIELD).at(body);
        let moment = frame.to_principal(values.vector(MOMENT).at(body)) * field.length();
        out[..3].copy_from_slice(&frame.scaled_torque(moment).to_array());
        out[3..6].copy_from_slice(&field.normalize_or_zero().to_array());
    }

    fn has_potential(&self) -> bool {
        true
    }

    fn potential_energy(&self, values: Values<'_>, body: usize, orientation: DQuat) -> f64 {
        -values.vector(FIELD).at(body).dot(orientation * values.vector(MOMENT).at(body))
    }
}

/// m' × Rᵀ d, in principal axes: m' = m |B|, d the direction of the field.
#[inline(always)]
pub fn magnetic_dipole<R: Real>(
    moment_principal: Vector<R>,
    direction_world: Vector<R>,
    orientation: Quaternion<R>,
) -> Vector<R> {
    moment_principal.cross(orientation.rotate_inverse(direction_world))
}

impl Formula for MagneticDipole {
    const STEM: &'static str = "magnetic_dipole";
    const COLUMNS: &'static [Column] = &[Column::vector("moment_principal"), Column::vector("direction_world")];

    #[inline(always)]
    fn torque<R: Real>(row: &impl Row<R>, _: &Epoch<R>, q: Quaternion<R>, _: Vector<R>) -> Vector<R> {
        magnetic_dipole(row.vector(0), row.vector(3), q)
    }
}
