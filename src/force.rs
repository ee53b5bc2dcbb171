//! Forces on the centre of mass, under which it moves in closed form.
//!
//! M dv/dt = F₀ + M g − c v. Nothing of this is stepped: positions are formed at output times, on the host.

use glam::DVec3;

use crate::error::{Error, Result};
use crate::torque::Parameter;

/// A force of a scene on every body's centre of mass. Parameters are one for the scene or one a body. Several forces
/// add up.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Force {
    /// Constant in world axes, N.
    Constant(Parameter<DVec3>),
    /// A uniform field of gravity: the acceleration in world axes, m/s².
    Gravity(Parameter<DVec3>),
    /// −c v, c in N s/m, not negative (G. G. Stokes 1851: 6πηa for a sphere of radius a in a fluid of viscosity η).
    LinearDrag(Parameter<f64>),
}

impl Force {
    /// A force that is constant in world axes, N.
    pub fn constant(force_world: impl Into<Parameter<DVec3>>) -> Self {
        Self::Constant(force_world.into())
    }

    /// A uniform field of gravity, m/s², world axes.
    pub fn gravity(acceleration_world: impl Into<Parameter<DVec3>>) -> Self {
        Self::Gravity(acceleration_world.into())
    }

    /// −c v, c in N s/m.
    pub fn linear_drag(coefficient: impl Into<Parameter<f64>>) -> Self {
        Self::LinearDrag(coefficient.into())
    }

    /// The name in study files and messages.
    pub fn name(&self) -> &'static str {
        match self {
            Force::Constant(_) => "constant",
            Force::Gravity(_) => "gravity",
            Force::LinearDrag(_) => "linear-drag",
        }
    }

    /// Whether it takes energy only.
    pub fn dissipative(&self) -> bool {
        matches!(self, Force::LinearDrag(_))
    }

    /// Whether it is zero for all bodies, so that nothing has to move.
    pub fn is_zero(&self) -> bool {
        match self {
            Force::Constant(Parameter::Shared(vector)) | Force::Gravity(Parameter::Shared(vector)) => {
                *vector == DVec3::ZERO
            }
            Force::LinearDrag(Parameter::Shared(coefficient)) => *coefficient == 0.0,
            _ => false,
        }
    }

    /// Refuses parameters that are not valid; `index` is the force's place in its scene.
    pub(crate) fn validate(&self, index: usize, body_count: usize) -> Result<()> {
        let border = crate::torque::Border { torque: index, model: self.name(), body_count };
        let named_force = |error| match error {
            Error::Torque { torque, model, body, field, value, expected } => {
                Error::Force { force: torque, model, body, field, value, expected }
            }
            other => other,
        };
        match self {
            Force::Constant(vector) | Force::Gravity(vector) => border.finite(self.name(), vector),
            Force::LinearDrag(coefficient) => border.not_negative("coefficient", coefficient),
        }
        .map_err(named_force)
    }
}

/// All forces on one body, per kilogramme.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Accelerations {
    /// F₀/M + g, world axes, m/s².
    pub constant_world: DVec3,
    /// c/M, 1/s.
    pub linear_drag: f64,
}

/// The sum of all forces on one body of this mass.
pub fn accelerations(forces: &[Force], body: usize, mass: f64) -> Accelerations {
    let mut sum = Accelerations::default();
    for force in forces {
        match force {
            Force::Constant(force) => sum.constant_world += force.at(body) / mass,
            Force::Gravity(acceleration) => sum.constant_world += acceleration.at(body),
            Force::LinearDrag(coefficient) => sum.linear_drag += coefficient.at(body) / mass,
        }
    }
    sum
}

/// Position and velocity after `time` seconds.
///
/// With b = c/M and u = e^(−bt): v = v₀ u + a (1 − u)/b, x = x₀ + v₀ (1 − u)/b + a (t − (1 − u)/b)/b. Both quotients are
/// formed so that they keep their digits as bt vanishes, where they are t and t²/2.
pub fn closed_form(forces: &Accelerations, position: DVec3, velocity: DVec3, time: f64) -> (DVec3, DVec3) {
    let phase = forces.linear_drag * time;
    let decay = (-phase).exp();
    // (1 − e^−p)/p and (p − 1 + e^−p)/p².
    let first = if phase == 0.0 { 1.0 } else { -(-phase).exp_m1() / phase };
    let second = if phase < 1.0 { second_quotient(phase) } else { (1.0 - first) / phase };
    let a = forces.constant_world;
    (position + (velocity * first + a * (second * time)) * time, velocity * decay + a * (first * time))
}

/// (p − 1 + e^−p)/p² = Σ (−p)ⁿ/(n + 2)!, for p up to 1, where the first term left out is below 1e-18.
fn second_quotient(p: f64) -> f64 {
    let mut sum = 0.0;
    for divisor in (3..=20).rev() {
        sum = (1.0 - p * sum) / f64::from(divisor);
    }
    // Horner's scheme of 1/2 (1 − p/3 (1 − p/4 (…))).
    0.5 * (1.0 - p * sum)
}
