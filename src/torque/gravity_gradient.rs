//! `gravity-gradient` on a circular orbit: the difference of gravity over the body.

use std::ops::Range;

use super::formula::{Column, Epoch, Formula, MOST_PHASES, Row};
use glam::DQuat;

use super::orbit::{circular_place, gradient_torque};
use super::{Border, Kind, Model, Needs, Orbit};
use crate::batch::BodyFrame;
use crate::error::Result;
use crate::quaternion::Quaternion;
use crate::real::Real;
use crate::vector::Vector;

/// τ = 3 μ/r³ u × I u, u = Rᵀ r̂ (J. d'Alembert 1749; P. C. Hughes, *Spacecraft Attitude Dynamics*, 1986, equation
/// 8.1.14), on a circular orbit or, where the orbit is eccentric, on an ellipse.
#[derive(Clone, Debug, PartialEq)]
pub struct GravityGradient {
    /// The orbit.
    pub orbit: Orbit,
}

impl Model for GravityGradient {
    fn kind(&self) -> Kind {
        if self.orbit.is_circular() { Kind::GravityGradient } else { Kind::GravityGradientKepler }
    }

    fn validate(&self, border: &Border) -> Result<()> {
        self.orbit.validate(border)
    }

    fn needs(&self) -> Needs {
        Needs { attitude: true, time: true, ..Needs::NOTHING }
    }

    fn rate(&self, body: usize, _: f64) -> f64 {
        3.0_f64.sqrt() * self.orbit.greatest_rate(body)
    }

    fn columns(&self, body: usize, frame: &BodyFrame, _: DQuat, out: &mut [f64]) {
        let (rate, _) = self.orbit.mean_motion(body);
        let scaled_rate = frame.scaled(rate, 0, 1);
        let i = frame.tensor_moments();
        let factor = 3.0 * scaled_rate * scaled_rate;
        let coefficients = [factor * (i.z - i.y), factor * (i.x - i.z), factor * (i.y - i.x)];
        let circular = self.orbit.is_circular();
        let (x, y) = if circular { self.orbit.axes_at_start(body) } else { self.orbit.axes(body) };
        out[..3].copy_from_slice(&coefficients);
        out[3..6].copy_from_slice(&x.to_array());
        out[6..9].copy_from_slice(&y.to_array());
        out[9] = factor;
        if !circular {
            out[10] = self.orbit.eccentricity.at(body);
            out[11] = self.orbit.anomaly_turns(body);
        }
    }

    fn phase_rates(&self, body: usize) -> [(f64, f64); 2] {
        [self.orbit.mean_motion(body), (0.0, 0.0)]
    }

    fn phase_rates_are_shared(&self) -> bool {
        self.orbit.rate_is_shared()
    }
}

/// 3 n² u × I u, in principal axes, at a phase in turns; the coefficients hold 3 n² and the differences of the moments.
#[inline(always)]
pub fn gravity_gradient<R: Real>(
    coefficients: Vector<R>,
    x_world: Vector<R>,
    y_world: Vector<R>,
    phase: R,
    orientation: Quaternion<R>,
) -> Vector<R> {
    gradient_torque(coefficients, circular_place(x_world, y_world, phase), orientation)
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
    const NEEDS: Needs = Needs { attitude: true, time: true, ..Needs::NOTHING };
    const FOLLOWS_MOMENTS: bool = true;
    const EPOCH_COLUMNS: Range<usize> = 3..9;

    #[inline(always)]
    fn epoch<R: Real>(row: &impl Row<R>, phases: [R; MOST_PHASES]) -> Epoch<R> {
        Epoch::vector(circular_place(row.vector(3), row.vector(6), phases[0]))
    }

    #[inline(always)]
    fn torque<R: Real>(row: &impl Row<R>, epoch: &Epoch<R>, q: Quaternion<R>, _: Vector<R>) -> Vector<R> {
        gradient_torque(row.vector(0), epoch.vector, q)
    }
}
