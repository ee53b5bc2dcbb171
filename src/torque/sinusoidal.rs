//! `sinusoidal`: a torque in body axes that oscillates in time.

use std::ops::Range;

use super::formula::{Column, Epoch, Formula, MOST_PHASES, Row};
use crate::quaternion::Quaternion;
use glam::{DQuat, DVec3};

use super::{Border, Kind, Model, Needs, Parameter};
use crate::batch::BodyFrame;
use crate::error::Result;
use crate::real::{Real, sin_cos};
use crate::vector::Vector;

/// τ = τ_sin sin Ωt + τ_cos cos Ωt in body axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Sinusoidal {
    /// τ_sin in body axes, N m.
    pub sine_body: Parameter<DVec3>,
    /// τ_cos in body axes, N m.
    pub cosine_body: Parameter<DVec3>,
    /// Ω, rad/s.
    pub rate: Parameter<f64>,
}

impl Model for Sinusoidal {
    fn kind(&self) -> Kind {
        Kind::Sinusoidal
    }

    fn validate(&self, border: &Border) -> Result<()> {
        border.finite("sine_body", &self.sine_body)?;
        border.finite("cosine_body", &self.cosine_body)?;
        border.finite("rate", &self.rate)
    }

    fn needs(&self) -> Needs {
        Needs { time: true, ..Needs::NOTHING }
    }

    fn rate(&self, body: usize, middle_moment: f64) -> f64 {
        let amplitude = self.sine_body.at(body).length() + self.cosine_body.at(body).length();
        (amplitude / middle_moment).sqrt()
    }

    fn columns(&self, body: usize, frame: &BodyFrame, _: DQuat, out: &mut [f64]) {
        let sine = frame.scaled_torque(frame.to_principal(self.sine_body.at(body)));
        let cosine = frame.scaled_torque(frame.to_principal(self.cosine_body.at(body)));
        out[..3].copy_from_slice(&sine.to_array());
        out[3..6].copy_from_slice(&cosine.to_array());
    }

    fn phase_rates(&self, body: usize) -> [(f64, f64); 2] {
        [(self.rate.at(body), 0.0), (0.0, 0.0)]
    }

    fn phase_rates_are_shared(&self) -> bool {
        self.rate.is_shared()
    }
}

/// τ_sin sin 2πx + τ_cos cos 2πx, in principal axes; x is the phase in turns.
#[inline(always)]
pub fn sinusoidal<R: Real>(sine: Vector<R>, cosine: Vector<R>, phase: R) -> Vector<R> {
    let (s, c) = sin_cos(phase * R::splat(std::f64::consts::TAU));
    sine.axpy(s, cosine * c)
}

impl Formula for Sinusoidal {
    const STEM: &'static str = "sinusoidal";
    const COLUMNS: &'static [Column] = &[Column::vector("sine"), Column::vector("cosine")];
    const PHASES: &'static [&'static str] = &["phase"];
    const NEEDS: Needs = Needs { time: true, ..Needs::NOTHING };
    const EPOCH_COLUMNS: Range<usize> = 0..6;

    #[inline(always)]
    fn epoch<R: Real>(row: &impl Row<R>, phases: [R; MOST_PHASES]) -> Epoch<R> {
        Epoch::vector(sinusoidal(row.vector(0), row.vector(3), phases[0]))
    }

    #[inline(always)]
    fn torque<R: Real>(_: &impl Row<R>, epoch: &Epoch<R>, _: Quaternion<R>, _: Vector<R>) -> Vector<R> {
        epoch.vector
    }
}
