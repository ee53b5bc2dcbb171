//! `gravity-gradient` on a circular orbit: the variation of gravity over the body.

use super::formula::{Column, Epoch, Formula, MOST_PHASES, Rates, Row, rates};
use glam::DQuat;
use std::sync::LazyLock;

use super::orbit::{self, circular_place, elements, gradient_torque};
use super::{Declaration, Kind, Model, Orbit, ParameterDeclaration, Torque, ValidationContext, Values};
use crate::bodies::BodyFrame;
use crate::error::Result;
use crate::math::quaternion::Quaternion;
use crate::math::real::Real;
use crate::math::vector::Vector;

/// τ = 3 μ/r³ u × I u, u = Rᵀ r̂ (J. d'Alembert 1749; P. C. Hughes, *Spacecraft Attitude Dynamics*, 1986, equation
/// 8.1.14), on a circular orbit or, where the orbit is eccentric, on an ellipse, either of which may drift.
pub struct GravityGradient;

static DECLARATION: LazyLock<Declaration> = LazyLock::new(|| {
    let source = "P. C. Hughes, Spacecraft Attitude Dynamics, 1986, equation 8.1.14";
    Declaration::new("gravity-gradient", "τ = 3 μ/r³ u × I u, u = Rᵀ r̂", source)
        .parameters(orbit::parameters())
        .parameters(orbit::drift::parameters())
});

impl Torque {
    /// Gravity gradient on a circular or elliptic orbit; see [`GravityGradient`].
    pub fn gravity_gradient(orbit: Orbit) -> Self {
        let (elements, drift) = orbit.values();
        Self::built(&GravityGradient, [&elements[..], &drift[..]].concat())
    }
}

impl Model for GravityGradient {
    declared!();

    fn kind(&self, values: Values<'_>) -> Kind {
        match orbit::is_circular(values) {
            _ if orbit::drift::is_drifting(values) => Kind::GravityGradientDrifting,
            true => Kind::GravityGradient,
            false => Kind::GravityGradientKepler,
        }
    }

    fn validate(&self, values: Values<'_>, context: &ValidationContext) -> Result<()> {
        orbit::validate(values, context)
    }

    fn rate(&self, values: Values<'_>, body: usize, _: f64) -> f64 {
        3.0_f64.sqrt() * elements(values, body).greatest_rate()
    }

    fn columns(&self, values: Values<'_>, body: usize, frame: &BodyFrame, _: DQuat, out: &mut [f64]) {
        let orbit = elements(values, body);
        let (rate, _) = orbit.mean_motion();
        let scaled_rate = frame.scaled(rate, 0, 1);
        let i = frame.tensor_moments();
        let factor = 3.0 * scaled_rate * scaled_rate;
        let coefficients = [factor * (i.z - i.y), factor * (i.x - i.z), factor * (i.y - i.x)];
        out[..3].copy_from_slice(&coefficients);
        out[9] = factor;
        // The table has determined which of the three kinds it is.
        if out.len() == Kind::GravityGradientDrifting.columns() {
            orbit.drifting_columns(&mut out[3..]);
            return;
        }
        let circular = out.len() == Kind::GravityGradient.columns();
        let (x, y) = if circular { orbit.axes_at_start() } else { orbit.axes() };
        out[3..6].copy_from_slice(&x.to_array());
        out[6..9].copy_from_slice(&y.to_array());
        if !circular {
            out[10] = orbit.eccentricity;
            out[11] = orbit.anomaly_turns();
        }
    }

    fn phase_rates(&self, values: Values<'_>, body: usize) -> Rates {
        rates(elements(values, body).rates())
    }

    fn sets_phase_rate(&self, values: Values<'_>, parameter: &ParameterDeclaration) -> bool {
        orbit::drift::sets_phase_rate(values, parameter)
    }
}

impl Formula for GravityGradient {
    const STEM: &'static str = "gravity_gradient";
    const COLUMNS: &'static [Column] = &[
        Column::vector("coefficients"),
        Column::vector("x_world"),
        Column::vector("y_world"),
        Column::number("factor"),
    ];
    const PHASES: &'static [&'static str] = &["phase"];
    const FOLLOWS_MOMENTS: bool = true;
    #[inline(always)]
    fn epoch_reads(column: usize) -> bool {
        (3..9).contains(&column)
    }

    #[inline(always)]
    fn epoch<R: Real>(row: &impl Row<R>, phases: [R; MOST_PHASES]) -> Epoch<R> {
        Epoch::vector(circular_place(row.vector(3), row.vector(6), phases[0]))
    }

    /// 3 n² u × I u; the coefficients hold 3 n² and the differences of the moments.
    #[inline(always)]
    fn torque<R: Real>(row: &impl Row<R>, epoch: &Epoch<R>, q: Quaternion<R>, _: Vector<R>) -> Vector<R> {
        gradient_torque(row.vector(0), epoch.vector, q)
    }
}
