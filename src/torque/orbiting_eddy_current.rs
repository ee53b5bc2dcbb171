//! `orbiting-eddy-current`: damping of a conducting body that turns in the field of a planet's tilted dipole, along an orbit.

use std::sync::LazyLock;

use glam::DQuat;

use super::eddy_current::eddy_current;
use super::formula::{Column, Epoch, Formula, MOST_PHASES, Rates, Row};
use super::orbit::{self, ELEMENTS, elements};
use super::orbiting_dipole::{
    DipoleField, FIELD_NUMBERS, FIELD_PHASES, field_columns, field_parameters, field_phase_rates, field_scale,
    field_values, with_field,
};
use super::{
    Declaration, Kind, Model, Orbit, Parameter, ParameterDeclaration, Torque, ValidationContext, Validity, Value,
    Values,
};
use crate::bodies::BodyFrame;
use crate::error::Result;
use crate::math::quaternion::Quaternion;
use crate::math::real::Real;
use crate::math::vector::Vector;

/// τ = k (ω × B) × B as in [`super::eddy_current`], with the field B of [`super::orbiting_dipole`] (N. Praly et al., *Study on
/// the eddy current damping of the spin dynamics of space debris from the Ariane launcher upper stages*, Acta Astronautica
/// 76 (2012) 145).
///
/// The currents are driven by the rate of change of the field in body axes, Rᵀ dB/dt − ω × B. Its first part, the field's own rate of
/// change dB/dt in world axes, is neglected: it is of the order of the orbit's rate times B. The torque therefore holds for bodies that
/// turn much faster than they orbit, and does not show that the field drags slow ones along.
pub struct OrbitingEddyCurrent;

static DECLARATION: LazyLock<Declaration> = LazyLock::new(|| {
    let coefficient = ParameterDeclaration::number("coefficient", "N m s/T²", "the coefficient k");
    let source = "N. Praly et al., Acta Astronautica 76 (2012) 145";
    Declaration::new("orbiting-eddy-current", "τ = k (ω × B) × B, B = b/r³ (3 (d · r̂) r̂ − d)", source)
        .dissipative()
        .parameters(orbit::parameters())
        .parameters([coefficient.valid(Validity::NotNegative).factor()])
        .parameters(field_parameters())
        .parameters(orbit::drift::parameters())
});
const COEFFICIENT: usize = ELEMENTS;

impl Torque {
    /// Eddy currents with the coefficient k (N m s/T²) in a planet's dipole field along an orbit: strength [T m³], tilt and
    /// azimuth of the dipole (rad), rate of the planet's rotation (rad/s); see [`OrbitingEddyCurrent`].
    pub fn orbiting_eddy_current(
        coefficient: impl Into<Parameter<f64>>,
        orbit: Orbit,
        strength: impl Into<Parameter<f64>>,
        tilt: impl Into<Parameter<f64>>,
        azimuth: impl Into<Parameter<f64>>,
        rotation: impl Into<Parameter<f64>>,
    ) -> Self {
        let field = [strength.into(), tilt.into(), azimuth.into(), rotation.into()];
        Self::built(&OrbitingEddyCurrent, field_values(orbit, Value::Number(coefficient.into()), field))
    }
}

impl Model for OrbitingEddyCurrent {
    declared!();

    fn kind(&self, values: Values<'_>) -> Kind {
        if orbit::drift::is_drifting(values) { Kind::OrbitingEddyCurrentDrifting } else { Kind::OrbitingEddyCurrent }
    }

    fn validate(&self, values: Values<'_>, context: &ValidationContext) -> Result<()> {
        orbit::validate(values, context)
    }

    fn columns(&self, values: Values<'_>, body: usize, frame: &BodyFrame, _: DQuat, out: &mut [f64]) {
        let field = field_scale(values, body, &elements(values, body));
        out[0] = frame.scaled(values.number(COEFFICIENT).at(body) * field * field, 1, 1);
        // The table has determined which of the two kinds it is.
        let drifts = out.len() == Kind::OrbitingEddyCurrentDrifting.columns();
        field_columns(values, body, drifts, &mut out[1..]);
    }

    fn phase_rates(&self, values: Values<'_>, body: usize) -> Rates {
        field_phase_rates(values, body)
    }

    fn sets_phase_rate(&self, values: Values<'_>, parameter: &ParameterDeclaration) -> bool {
        orbit::drift::sets_phase_rate(values, parameter)
    }
}

impl Formula for OrbitingEddyCurrent {
    const STEM: &'static str = "orbiting_eddy_current";
    const COLUMNS: &'static [Column] = &with_field(Column::number("coefficient"));
    const PHASES: &'static [&'static str] = FIELD_PHASES;
    #[inline(always)]
    fn epoch_reads(column: usize) -> bool {
        (1..1 + FIELD_NUMBERS).contains(&column)
    }

    #[inline(always)]
    fn epoch<R: Real>(row: &impl Row<R>, phases: [R; MOST_PHASES]) -> Epoch<R> {
        Epoch::vector(DipoleField::of_row(row, 1).at(phases[0], phases[1]))
    }

    #[inline(always)]
    fn torque<R: Real>(row: &impl Row<R>, epoch: &Epoch<R>, q: Quaternion<R>, omega: Vector<R>) -> Vector<R> {
        eddy_current(row.number(0), epoch.vector, q, omega)
    }
}
