//! `orbiting-dipole`: a magnet fixed in the body, in the field of a planet's tilted dipole, along an orbit.

use std::ops::Range;

use super::formula::{Column, Epoch, Formula, MOST_PHASES, Row};
use super::magnetic_dipole::magnetic_dipole;
use glam::{DQuat, DVec3};

use super::gravity_gradient_kepler::place_and_cube;
use super::{Border, Kind, Model, Needs, Orbit, Parameter};
use crate::batch::BodyFrame;
use crate::error::Result;
use crate::quaternion::Quaternion;
use crate::real::{Real, sin_cos};
use crate::vector::Vector;

/// τ = m × Rᵀ B with B = b/r³ (3 (d · r̂) r̂ − d), d the direction of the planet's dipole, which turns about the world's
/// z axis (J. R. Wertz, *Spacecraft Attitude Determination and Control*, 1978, equation H-16).
#[derive(Clone, Debug, PartialEq)]
pub struct OrbitingDipole {
    /// m in body axes, A m².
    pub moment_body: Parameter<DVec3>,
    /// The orbit about the planet.
    pub orbit: Orbit,
    /// b = μ₀/4π times the planet's dipole moment, T m³; the Earth's is 7.8e15 T m³ with a tilt of π less 0.17 rad.
    pub strength: Parameter<f64>,
    /// Angle of the dipole from the world's z axis, rad.
    pub tilt: Parameter<f64>,
    /// Azimuth of the dipole at t = 0, from the world's x axis, rad.
    pub azimuth: Parameter<f64>,
    /// Rate of the planet's rotation about the world's z axis, rad/s.
    pub rotation: Parameter<f64>,
}

impl Model for OrbitingDipole {
    fn kind(&self) -> Kind {
        Kind::OrbitingDipole
    }

    fn validate(&self, border: &Border) -> Result<()> {
        border.finite("moment_body", &self.moment_body)?;
        self.orbit.validate(border)?;
        border.finite("strength", &self.strength)?;
        border.finite("tilt", &self.tilt)?;
        border.finite("azimuth", &self.azimuth)?;
        border.finite("rotation", &self.rotation)
    }

    fn needs(&self) -> Needs {
        Needs { attitude: true, time: true, ..Needs::NOTHING }
    }

    fn rate(&self, body: usize, middle_moment: f64) -> f64 {
        let nearest = 1.0 - self.orbit.eccentricity.at(body);
        let field = 2.0 * self.field_scale(body).abs() / (nearest * nearest * nearest);
        (self.moment_body.at(body).length() * field / middle_moment).sqrt()
    }

    fn columns(&self, body: usize, frame: &BodyFrame, _: DQuat, out: &mut [f64]) {
        let moment = frame.to_principal(self.moment_body.at(body)) * self.field_scale(body);
        let (x, y) = self.orbit.axes(body);
        let (sin, cos) = self.tilt.at(body).sin_cos();
        let azimuth = self.azimuth.at(body) / std::f64::consts::TAU;
        out[..3].copy_from_slice(&frame.scaled_torque(moment).to_array());
        out[3..6].copy_from_slice(&x.to_array());
        out[6..9].copy_from_slice(&y.to_array());
        out[9] = self.orbit.eccentricity.at(body);
        out[10] = self.orbit.anomaly_turns(body);
        out[11] = sin;
        out[12] = cos;
        out[13] = azimuth - azimuth.round();
    }

    fn phase_rates(&self, body: usize) -> [(f64, f64); 2] {
        [self.orbit.mean_motion(body), (self.rotation.at(body), 0.0)]
    }

    fn phase_rates_are_shared(&self) -> bool {
        self.orbit.rate_is_shared() && self.rotation.is_shared()
    }
}

impl OrbitingDipole {
    /// b/a³, T.
    fn field_scale(&self, body: usize) -> f64 {
        let a = self.orbit.semi_major_axis.at(body);
        self.strength.at(body) / a / a / a
    }
}

/// What the field is made of, besides the phases.
#[derive(Clone, Copy, Debug)]
pub struct DipoleField<R> {
    /// Towards the pericentre, world axes.
    pub x_world: Vector<R>,
    /// At right angles to it in the direction of motion, world axes.
    pub y_world: Vector<R>,
    /// Of the orbit.
    pub eccentricity: R,
    /// Mean anomaly at t = 0, turns.
    pub start: R,
    /// Sine of the dipole's angle from the z axis.
    pub sin_tilt: R,
    /// Cosine of it.
    pub cos_tilt: R,
    /// The dipole's azimuth at t = 0, turns.
    pub azimuth: R,
}

impl<R: Real> DipoleField<R> {
    /// Of an instance's columns.
    #[inline(always)]
    pub(super) fn of_row(column: impl Fn(usize) -> R) -> Self {
        Self {
            x_world: Vector::new(column(3), column(4), column(5)),
            y_world: Vector::new(column(6), column(7), column(8)),
            eccentricity: column(9),
            start: column(10),
            sin_tilt: column(11),
            cos_tilt: column(12),
            azimuth: column(13),
        }
    }

    /// (a/r)³ (3 (d · r̂) r̂ − d), in world axes; both phases in turns.
    #[inline(always)]
    pub(super) fn at(&self, orbit_phase: R, rotation_phase: R) -> Vector<R> {
        let (r, cube) = place_and_cube(self.x_world, self.y_world, self.eccentricity, self.start, orbit_phase);
        let azimuth = rotation_phase + self.azimuth;
        let (sin, cos) = sin_cos((azimuth - azimuth.round()) * R::splat(std::f64::consts::TAU));
        let dipole = Vector::new(self.sin_tilt * cos, self.sin_tilt * sin, self.cos_tilt);
        (r.axpy(R::splat(3.0) * dipole.dot(r), -dipole)) * cube
    }
}

/// m' × Rᵀ (a/r)³ (3 (d · r̂) r̂ − d), in principal axes, m' = m b/a³; both phases in turns.
#[inline(always)]
pub fn orbiting_dipole<R: Real>(
    moment_principal: Vector<R>,
    field: &DipoleField<R>,
    orbit_phase: R,
    rotation_phase: R,
    orientation: Quaternion<R>,
) -> Vector<R> {
    moment_principal.cross(orientation.rotate_inverse(field.at(orbit_phase, rotation_phase)))
}

impl Formula for OrbitingDipole {
    const STEM: &'static str = "orbiting_dipole";
    const COLUMNS: &'static [Column] = &[
        Column::vector("moment_principal"),
        Column::vector("x_world"),
        Column::vector("y_world"),
        Column::number("eccentricity"),
        Column::number("start"),
        Column::number("sin_tilt"),
        Column::number("cos_tilt"),
        Column::number("azimuth"),
    ];
    const PHASES: &'static [&'static str] = &["orbit_phase", "rotation_phase"];
    const NEEDS: Needs = Needs { attitude: true, time: true, ..Needs::NOTHING };
    const EPOCH_COLUMNS: Range<usize> = 3..14;

    #[inline(always)]
    fn epoch<R: Real>(row: &impl Row<R>, phases: [R; MOST_PHASES]) -> Epoch<R> {
        Epoch::vector(DipoleField::of_row(|column| row.number(column)).at(phases[0], phases[1]))
    }

    #[inline(always)]
    fn torque<R: Real>(row: &impl Row<R>, epoch: &Epoch<R>, q: Quaternion<R>, _: Vector<R>) -> Vector<R> {
        magnetic_dipole(row.vector(0), epoch.vector, q)
    }
}
