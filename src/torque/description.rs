//! Torques as a scene describes them.

use glam::{DMat3, DQuat, DVec3};

use super::constant_body::ConstantBody;
use super::constant_world::ConstantWorld;
use super::eddy_current::EddyCurrent;
use super::gravity_gradient::GravityGradient;
use super::heavy_top::HeavyTop;
use super::internal_dissipation::InternalDissipation;
use super::linear_drag::LinearDrag;
use super::log_spring::LogSpring;
use super::magnetic_dipole::MagneticDipole;
use super::matrix_drag::MatrixDrag;
use super::orbiting_dipole::OrbitingDipole;
use super::quadratic_drag::QuadraticDrag;
use super::sine_spring::SineSpring;
use super::sinusoidal::Sinusoidal;
use super::variable_inertia::{InertiaChange, Law, VariableInertia};
use super::white_noise::WhiteNoise;
use super::{Border, Kind, Orbit, Parameter};
use crate::batch::BodyFrame;
use crate::ensemble::Ensemble;
use crate::error::Result;

/// A torque of a scene. Every parameter is one for the scene or a column with one row a body ([`Parameter`]).
///
/// ```
/// use glam::DVec3;
/// use polhode::torque::{Orbit, Torque};
///
/// let drag = Torque::linear_drag(1e-3);
/// let thrusters = Torque::constant_body(vec![DVec3::X, DVec3::Y]);
/// let gradient = Torque::gravity_gradient(Orbit::circular(3.986004418e14, 7.0e6).inclined(0.9));
/// assert_eq!(gradient.name(), "gravity-gradient");
/// assert!(drag.dissipative() && !thrusters.dissipative());
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Torque {
    /// Constant in body axes.
    ConstantBody(ConstantBody),
    /// Constant in world axes.
    ConstantWorld(ConstantWorld),
    /// −c ω.
    LinearDrag(LinearDrag),
    /// −C ω.
    MatrixDrag(MatrixDrag),
    /// −c |ω| ω.
    QuadraticDrag(QuadraticDrag),
    /// Oscillating in body axes.
    Sinusoidal(Sinusoidal),
    /// Gravity gradient along an orbit.
    GravityGradient(GravityGradient),
    /// Gravity about a fixed pivot.
    HeavyTop(HeavyTop),
    /// A magnet in a uniform field.
    MagneticDipole(MagneticDipole),
    /// A magnet in a planet's dipole field along an orbit.
    OrbitingDipole(OrbitingDipole),
    /// Eddy-current damping in a uniform field.
    EddyCurrent(EddyCurrent),
    /// −k sin θ n towards an attitude.
    SineSpring(SineSpring),
    /// −k θ n towards an attitude.
    LogSpring(LogSpring),
    /// Loss of energy at constant angular momentum.
    InternalDissipation(InternalDissipation),
    /// A random torque without memory.
    WhiteNoise(WhiteNoise),
    /// Moments of inertia that change in time.
    VariableInertia(VariableInertia),
}

/// What a torque depends on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Needs {
    /// The orientation.
    pub attitude: bool,
    /// The angular velocity (or the angular momentum).
    pub angular_velocity: bool,
    /// The time.
    pub time: bool,
    /// The position of the centre of mass.
    pub position: bool,
}

impl Needs {
    /// Nothing: constant in body axes.
    pub const NOTHING: Self = Self { attitude: false, angular_velocity: false, time: false, position: false };

    /// What either depends on.
    #[must_use]
    pub fn or(self, other: Self) -> Self {
        Self {
            attitude: self.attitude || other.attitude,
            angular_velocity: self.angular_velocity || other.angular_velocity,
            time: self.time || other.time,
            position: self.position || other.position,
        }
    }
}

/// What every model's description says of itself.
pub(crate) trait Model {
    /// Which columns and which kernel function it has.
    fn kind(&self) -> Kind;

    /// Refuses parameters that are not valid.
    fn validate(&self, border: &Border) -> Result<()>;

    /// Refuses parameters that are valid, but not of these bodies.
    fn validate_bodies(&self, _: &Border, _: &Ensemble) -> Result<()> {
        Ok(())
    }

    /// What it depends on.
    fn needs(&self) -> Needs;

    /// Whether it can only take energy.
    fn dissipative(&self) -> bool {
        false
    }

    /// The rate (rad/s) to which it brings a body with this middle moment (kg m²) within about a radian, from rest; 0 where it
    /// does nothing to a body at rest. The body's units follow from it.
    fn rate(&self, body: usize, middle_moment: f64) -> f64;

    /// Adds the body's parameters to its columns (zero before, or another instance's where the kind merges instances):
    /// principal axes, the body's own units. `orientation` rotates principal coordinates to world at t = 0.
    fn columns(&self, body: usize, frame: &BodyFrame, orientation: DQuat, out: &mut [f64]);

    /// Rates of its phases in two words, rad/s; as many as [`Kind::phases`] says.
    fn phase_rates(&self, _: usize) -> [(f64, f64); 2] {
        [(0.0, 0.0); 2]
    }

    /// Whether all bodies have the same phases.
    fn phase_rates_are_shared(&self) -> bool {
        true
    }

    /// The potential energy (J) of a body at an orientation (body to world), where its torque has one that does not depend
    /// on time.
    fn potential_energy(&self, _: usize, _: DQuat) -> Option<f64> {
        None
    }
}

impl Torque {
    /// τ constant in body axes (N m); see [`ConstantBody`].
    pub fn constant_body(torque_body: impl Into<Parameter<DVec3>>) -> Self {
        Self::ConstantBody(ConstantBody { torque_body: torque_body.into() })
    }

    /// τ constant in world axes (N m); see [`ConstantWorld`].
    pub fn constant_world(torque_world: impl Into<Parameter<DVec3>>) -> Self {
        Self::ConstantWorld(ConstantWorld { torque_world: torque_world.into() })
    }

    /// τ = −c ω, c in N m s; see [`LinearDrag`].
    pub fn linear_drag(coefficient: impl Into<Parameter<f64>>) -> Self {
        Self::LinearDrag(LinearDrag { coefficient: coefficient.into() })
    }

    /// τ = −C ω, C in N m s, body axes; see [`MatrixDrag`].
    pub fn matrix_drag(matrix_body: impl Into<Parameter<DMat3>>) -> Self {
        Self::MatrixDrag(MatrixDrag { matrix_body: matrix_body.into() })
    }

    /// τ = −c |ω| ω, c in N m s²; see [`QuadraticDrag`].
    pub fn quadratic_drag(coefficient: impl Into<Parameter<f64>>) -> Self {
        Self::QuadraticDrag(QuadraticDrag { coefficient: coefficient.into() })
    }

    /// τ = τ_sin sin Ωt + τ_cos cos Ωt in body axes (N m), Ω in rad/s; see [`Sinusoidal`].
    pub fn sinusoidal(
        sine_body: impl Into<Parameter<DVec3>>,
        cosine_body: impl Into<Parameter<DVec3>>,
        rate: impl Into<Parameter<f64>>,
    ) -> Self {
        Self::Sinusoidal(Sinusoidal { sine_body: sine_body.into(), cosine_body: cosine_body.into(), rate: rate.into() })
    }

    /// Gravity gradient on a circular or elliptic orbit; see [`GravityGradient`].
    pub fn gravity_gradient(orbit: Orbit) -> Self {
        Self::GravityGradient(GravityGradient { orbit })
    }

    /// Gravity about a fixed pivot: mass (kg), centre of mass from the pivot in body axes (m), gravity in world axes
    /// [m/s²]; see [`HeavyTop`].
    pub fn heavy_top(
        mass: impl Into<Parameter<f64>>,
        centre_body: impl Into<Parameter<DVec3>>,
        gravity_world: impl Into<Parameter<DVec3>>,
    ) -> Self {
        Self::HeavyTop(HeavyTop {
            mass: mass.into(),
            centre_body: centre_body.into(),
            gravity_world: gravity_world.into(),
        })
    }

    /// A magnetic moment in body axes (A m²) in a uniform field in world axes (T); see [`MagneticDipole`].
    pub fn magnetic_dipole(moment_body: impl Into<Parameter<DVec3>>, field_world: impl Into<Parameter<DVec3>>) -> Self {
        Self::MagneticDipole(MagneticDipole { moment_body: moment_body.into(), field_world: field_world.into() })
    }

    /// A magnetic moment in body axes (A m²) in a planet's dipole field along an orbit: strength [T m³], tilt and azimuth
    /// of the dipole (rad), rate of the planet's rotation (rad/s); see [`OrbitingDipole`].
    pub fn orbiting_dipole(
        moment_body: impl Into<Parameter<DVec3>>,
        orbit: Orbit,
        strength: impl Into<Parameter<f64>>,
        tilt: impl Into<Parameter<f64>>,
        azimuth: impl Into<Parameter<f64>>,
        rotation: impl Into<Parameter<f64>>,
    ) -> Self {
        Self::OrbitingDipole(OrbitingDipole {
            moment_body: moment_body.into(),
            orbit,
            strength: strength.into(),
            tilt: tilt.into(),
            azimuth: azimuth.into(),
            rotation: rotation.into(),
        })
    }

    /// τ = k (ω × B) × B, k in N m s/T², B in world axes (T); see [`EddyCurrent`].
    pub fn eddy_current(coefficient: impl Into<Parameter<f64>>, field_world: impl Into<Parameter<DVec3>>) -> Self {
        Self::EddyCurrent(EddyCurrent { coefficient: coefficient.into(), field_world: field_world.into() })
    }

    /// τ = −k sin θ n towards an attitude (body to world), k in N m; see [`SineSpring`].
    pub fn sine_spring(stiffness: impl Into<Parameter<f64>>, target: impl Into<Parameter<DQuat>>) -> Self {
        Self::SineSpring(SineSpring { stiffness: stiffness.into(), target: target.into() })
    }

    /// τ = −k θ n towards an attitude (body to world), k in N m; see [`LogSpring`].
    pub fn log_spring(stiffness: impl Into<Parameter<f64>>, target: impl Into<Parameter<DQuat>>) -> Self {
        Self::LogSpring(LogSpring { stiffness: stiffness.into(), target: target.into() })
    }

    /// Loss of energy at constant angular momentum, coefficient in s/(kg m²); see [`InternalDissipation`].
    pub fn internal_dissipation(coefficient: impl Into<Parameter<f64>>) -> Self {
        Self::InternalDissipation(InternalDissipation { coefficient: coefficient.into() })
    }

    /// A random torque of intensity σ [N m √s] on the path that `seed` selects; see [`WhiteNoise`].
    pub fn white_noise(intensity: impl Into<Parameter<f64>>, seed: u64) -> Self {
        Self::WhiteNoise(WhiteNoise { intensity: intensity.into(), seed, draws_per_step: 1 })
    }

    /// Moments of inertia that change in time by a law, at an angular momentum that does not; see [`VariableInertia`].
    pub fn variable_inertia(change: InertiaChange, law: Law) -> Self {
        Self::VariableInertia(VariableInertia { change, law })
    }

    pub(crate) fn model(&self) -> &dyn Model {
        match self {
            Torque::ConstantBody(model) => model,
            Torque::ConstantWorld(model) => model,
            Torque::LinearDrag(model) => model,
            Torque::MatrixDrag(model) => model,
            Torque::QuadraticDrag(model) => model,
            Torque::Sinusoidal(model) => model,
            Torque::GravityGradient(model) => model,
            Torque::HeavyTop(model) => model,
            Torque::MagneticDipole(model) => model,
            Torque::OrbitingDipole(model) => model,
            Torque::EddyCurrent(model) => model,
            Torque::SineSpring(model) => model,
            Torque::LogSpring(model) => model,
            Torque::InternalDissipation(model) => model,
            Torque::WhiteNoise(model) => model,
            Torque::VariableInertia(model) => model,
        }
    }

    /// The model's name in study files and reports.
    pub fn name(&self) -> &'static str {
        match self {
            Torque::ConstantBody(_) => "constant-body",
            Torque::ConstantWorld(_) => "constant-world",
            Torque::LinearDrag(_) => "linear-drag",
            Torque::MatrixDrag(_) => "matrix-drag",
            Torque::QuadraticDrag(_) => "quadratic-drag",
            Torque::Sinusoidal(_) => "sinusoidal",
            Torque::GravityGradient(_) => "gravity-gradient",
            Torque::HeavyTop(_) => "heavy-top",
            Torque::MagneticDipole(_) => "magnetic-dipole",
            Torque::OrbitingDipole(_) => "orbiting-dipole",
            Torque::EddyCurrent(_) => "eddy-current",
            Torque::SineSpring(_) => "sine-spring",
            Torque::LogSpring(_) => "log-spring",
            Torque::InternalDissipation(_) => "internal-dissipation",
            Torque::WhiteNoise(_) => "white-noise",
            Torque::VariableInertia(_) => "variable-inertia",
        }
    }

    /// What it depends on.
    pub fn needs(&self) -> Needs {
        self.model().needs()
    }

    /// Whether bodies under it turn at I⁻¹ m with the moments that they start with. Where they do not, only methods follow
    /// them that ask for the rate at which their axes turn ([`crate::method::Properties::rigid_only`]).
    pub fn leaves_rigid(&self) -> bool {
        !matches!(self, Torque::InternalDissipation(_) | Torque::VariableInertia(_))
    }

    /// Whether it is random: drawn for each step, so that other steps have other draws.
    pub fn is_random(&self) -> bool {
        matches!(self, Torque::WhiteNoise(_))
    }

    /// Whether it can only take energy from a body.
    pub fn dissipative(&self) -> bool {
        self.model().dissipative()
    }

    /// The potential energy (J) of a body at an orientation (body to world), where the torque has one that does not
    /// depend on time.
    pub fn potential_energy(&self, body: usize, orientation: DQuat) -> Option<f64> {
        self.model().potential_energy(body, orientation)
    }

    /// Refuses parameters that are not valid; `index` is the torque's place in its scene.
    pub(crate) fn validate(&self, index: usize, ensemble: &Ensemble) -> Result<()> {
        let border = Border { torque: index, model: self.name(), body_count: ensemble.len() };
        self.model().validate(&border)?;
        self.model().validate_bodies(&border, ensemble)
    }
}
