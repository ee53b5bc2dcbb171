//! `sinusoidal`: a torque in body axes that oscillates in time.

use super::formula::{Column, Epoch, Formula, MOST_PHASES, Rates, Row, rates};
use crate::math::quaternion::Quaternion;
use glam::{DQuat, DVec3};
use std::sync::LazyLock;

use super::{Declaration, Frame, Model, Parameter, ParameterDeclaration, Preset, Torque, Value, Values};
use crate::bodies::BodyFrame;
use crate::math::real::{Real, sin_cos};
use crate::math::vector::Vector;

/// τ = τ_sin sin Ωt + τ_cos cos Ωt in body axes.
pub struct Sinusoidal;

static DECLARATION: LazyLock<Declaration> = LazyLock::new(|| {
    let amplitude = |name, about| ParameterDeclaration::vector(name, "N m", Frame::Body, about).or(Preset::Number(0.0));
    Declaration::new("sinusoidal", "τ = τ_sin sin Ωt + τ_cos cos Ωt in body axes", "by definition").parameters([
        amplitude("sine", "the amplitude τ_sin"),
        amplitude("cosine", "the amplitude τ_cos"),
        ParameterDeclaration::number("rate", "rad/s", "the angular frequency Ω").phase_rate(),
    ])
});
const SINE: usize = 0;
const COSINE: usize = 1;
const RATE: usize = 2;

impl Torque {
    /// τ = τ_sin sin Ωt + τ_cos cos Ωt in body axes (N m), Ω in rad/s; see [`Sinusoidal`].
    pub fn sinusoidal(
        sine_body: impl Into<Parameter<DVec3>>,
        cosine_body: impl Into<Parameter<DVec3>>,
        rate: impl Into<Parameter<f64>>,
    ) -> Self {
        let (sine, cosine) = (Value::Vector(sine_body.into()), Value::Vector(cosine_body.into()));
        Self::built(&Sinusoidal, [sine, cosine, Value::Number(rate.into())])
    }
}

impl Model for Sinusoidal {
    declared!(Sinusoidal);

    fn acts_on(&self, values: Values<'_>, body: usize) -> bool {
        [SINE, COSINE].iter().any(|&amplitude| values.vector(amplitude).at(body) != DVec3::ZERO)
    }

    fn acts_on_all(&self, values: Values<'_>) -> bool {
        [SINE, COSINE].iter().any(|&amplitude| values.values[amplitude].is_nowhere_zero())
    }

    fn rate(&self, values: Values<'_>, body: usize, middle_moment: f64) -> f64 {
        let amplitude = values.vector(SINE).at(body).length() + values.vector(COSINE).at(body).length();
        (amplitude / middle_moment).sqrt()
    }

    fn columns(&self, values: Values<'_>, body: usize, frame: &BodyFrame, _: DQuat, out: &mut [f64]) {
        let scaled = |amplitude| frame.scaled_torque(frame.to_principal(values.vector(amplitude).at(body)));
        out[..3].copy_from_slice(&scaled(SINE).to_array());
        out[3..6].copy_from_slice(&scaled(COSINE).to_array());
    }

    fn phase_rates(&self, values: Values<'_>, body: usize) -> Rates {
        rates([(values.number(RATE).at(body), 0.0)])
    }
}

impl Formula for Sinusoidal {
    const STEM: &'static str = "sinusoidal";
    const COLUMNS: &'static [Column] = &[Column::vector("sine"), Column::vector("cosine")];
    const PHASES: &'static [&'static str] = &["phase"];
    #[inline(always)]
    fn epoch_reads(column: usize) -> bool {
        (0..6).contains(&column)
    }

    /// τ_sin sin 2πx + τ_cos cos 2πx; x is the phase in turns.
    #[inline(always)]
    fn epoch<R: Real>(row: &impl Row<R>, phases: [R; MOST_PHASES]) -> Epoch<R> {
        let (sine, cosine) = (row.vector(0), row.vector(3));
        let (s, c) = sin_cos(phases[0] * R::splat(std::f64::consts::TAU));
        Epoch::vector(sine.axpy(s, cosine * c))
    }

    #[inline(always)]
    fn torque<R: Real>(_: &impl Row<R>, epoch: &Epoch<R>, _: Quaternion<R>, _: Vector<R>) -> Vector<R> {
        epoch.vector
    }
}
