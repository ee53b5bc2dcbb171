//! Forces on the centre of mass.
//!
//! M dv/dt = F₀ + M g − c v − C |v| v + R F, dx/dt = v. Forces act on the translation alone, so the rotation does not depend on them, with
//! one exception: if a custom torque depends on the body's position and that has no closed form, both form one system, which is integrated
//! by Taylor series ([`crate::kernel::method::taylor`]), and the following does not apply. Under a constant force, uniform gravity and
//! linear drag, positions follow in closed form at output times ([`closed_form()`]). Under quadratic drag or a thrust fixed in the body
//! they are stepped ([`stepped`]) along the rotation: in `f64` on the host or, if thrust follows a rotation that a GPU steps, there and in
//! its precision ([`carried`]). Under a custom force ([`custom`]) they are stepped adaptively, on the host.

use std::ops::Range;

use glam::{DQuat, DVec3};

#[cfg(feature = "study")]
use crate::error::Text;
use crate::error::{Error, Result};
use crate::torque::{Parameter, ValidationContext, Validity, Value};

pub mod adaptive_translation;
pub mod carried;
mod closed_form;
pub mod custom;
pub(crate) mod moving;
pub mod quadratic_drag;
pub mod stepped;
pub mod thrust;

pub use closed_form::closed_form;
pub use custom::CustomForce;

/// A force of a scene on every body's centre of mass. Parameters are shared by all bodies or given for each. Several forces add up.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Force {
    /// Constant in world axes, N.
    Constant(Parameter<DVec3>),
    /// A uniform field of gravity: the acceleration in world axes, m/s².
    Gravity(Parameter<DVec3>),
    /// −c v, c in N s/m, not negative (G. G. Stokes 1851: 6πηa for a sphere of radius a in a fluid of viscosity η).
    LinearDrag(Parameter<f64>),
    /// −C |v| v, C in N s²/m², not negative; see [`quadratic_drag`].
    QuadraticDrag(Parameter<f64>),
    /// Fixed in body axes, N; see [`thrust`].
    Thrust(Parameter<DVec3>),
    /// A formula, N, world axes; see [`custom`].
    Custom(CustomForce),
}

impl Force {
    /// A force that is constant in world axes, N.
    pub fn constant(force_world: impl Into<Parameter<DVec3>>) -> Self {
        Self::Constant(force_world.into())
    }

    /// The same for some of the bodies, counted from 0.
    pub(crate) fn only(&self, bodies: &Range<usize>) -> Self {
        let bodies = bodies.clone();
        match self {
            Self::Constant(force) => Self::Constant(force.only(bodies)),
            Self::Gravity(acceleration) => Self::Gravity(acceleration.only(bodies)),
            Self::LinearDrag(coefficient) => Self::LinearDrag(coefficient.only(bodies)),
            Self::QuadraticDrag(coefficient) => Self::QuadraticDrag(coefficient.only(bodies)),
            Self::Thrust(force) => Self::Thrust(force.only(bodies)),
            Self::Custom(force) => {
                let values = force.values().iter().map(|value| value.only(bodies.clone())).collect();
                Self::Custom(force.with_values(values))
            }
        }
    }

    /// A uniform field of gravity, m/s², world axes.
    pub fn gravity(acceleration_world: impl Into<Parameter<DVec3>>) -> Self {
        Self::Gravity(acceleration_world.into())
    }

    /// −c v, c in N s/m.
    pub fn linear_drag(coefficient: impl Into<Parameter<f64>>) -> Self {
        Self::LinearDrag(coefficient.into())
    }

    /// −C |v| v, C in N s²/m².
    pub fn quadratic_drag(coefficient: impl Into<Parameter<f64>>) -> Self {
        Self::QuadraticDrag(coefficient.into())
    }

    /// A force that is constant in body axes, N, on the centre of mass: it gives no torque.
    pub fn thrust(force_body: impl Into<Parameter<DVec3>>) -> Self {
        Self::Thrust(force_body.into())
    }

    /// The name in study files and messages.
    pub fn name(&self) -> &'static str {
        match self {
            Force::Constant(_) => "constant",
            Force::Gravity(_) => "gravity",
            Force::LinearDrag(_) => "linear-drag",
            Force::QuadraticDrag(_) => "quadratic-drag",
            Force::Thrust(_) => "thrust",
            Force::Custom(_) => "custom",
        }
    }

    /// Its parameters with their names in studies.
    #[cfg(feature = "study")]
    pub(crate) fn parameters(&self) -> Vec<(Text, Value)> {
        let vector = |name: &'static str, value: &Parameter<DVec3>| vec![(name.into(), Value::Vector(value.clone()))];
        let number = |value: &Parameter<f64>| vec![("coefficient".into(), Value::Number(value.clone()))];
        match self {
            Force::Constant(force) | Force::Thrust(force) => vector("force", force),
            Force::Gravity(acceleration) => vector("acceleration", acceleration),
            Force::LinearDrag(coefficient) | Force::QuadraticDrag(coefficient) => number(coefficient),
            Force::Custom(force) => {
                let names = force.declarations().iter().map(|declared| declared.name.clone());
                names.zip(force.values().iter().cloned()).collect()
            }
        }
    }

    /// Whether it can only remove energy.
    pub fn dissipative(&self) -> bool {
        matches!(self, Force::LinearDrag(_) | Force::QuadraticDrag(_))
    }

    /// Whether positions under it have a closed form.
    pub(crate) fn has_closed_form(&self) -> bool {
        !matches!(self, Force::QuadraticDrag(_) | Force::Thrust(_) | Force::Custom(_)) || self.is_zero()
    }

    /// Whether it depends on the body's rotation.
    pub(crate) fn needs_attitude(&self) -> bool {
        match self {
            Force::Thrust(_) => !self.is_zero(),
            Force::Custom(force) => force.needs_attitude(),
            _ => false,
        }
    }

    /// Whether it is a custom formula.
    pub fn is_custom(&self) -> bool {
        self.as_custom().is_some()
    }

    /// The custom formula, if it is one.
    pub(crate) fn as_custom(&self) -> Option<&CustomForce> {
        match self {
            Force::Custom(force) => Some(force),
            _ => None,
        }
    }

    /// Whether it is zero for all bodies, so that it has no effect.
    pub(crate) fn is_zero(&self) -> bool {
        match self {
            Force::Constant(Parameter::Shared(vector))
            | Force::Gravity(Parameter::Shared(vector))
            | Force::Thrust(Parameter::Shared(vector)) => *vector == DVec3::ZERO,
            Force::LinearDrag(Parameter::Shared(coefficient))
            | Force::QuadraticDrag(Parameter::Shared(coefficient)) => *coefficient == 0.0,
            _ => false,
        }
    }

    /// Refuses parameters that are not valid; `index` is the force's index in its scene.
    pub(crate) fn validate(&self, index: usize, body_count: usize) -> Result<()> {
        let context = ValidationContext { torque: index, model: self.name().into(), body_count };
        let named_force = |error| match error {
            Error::Torque { torque, model, body, field, value, expected } => {
                Error::Force { force: torque, model, body, field, value, expected }
            }
            other => other,
        };
        let vector = |unit, vector: &Parameter<DVec3>| {
            context.check(&self.name().into(), unit, Validity::Finite, &Value::Vector(vector.clone()))
        };
        let coefficient = |unit, number: &Parameter<f64>| {
            context.check(&"coefficient".into(), unit, Validity::NotNegative, &Value::Number(number.clone()))
        };
        match self {
            Force::Constant(force) | Force::Thrust(force) => vector("N", force),
            Force::Gravity(acceleration) => vector("m/s²", acceleration),
            Force::LinearDrag(drag) => coefficient("N s/m", drag),
            Force::QuadraticDrag(drag) => coefficient("N s²/m²", drag),
            Force::Custom(force) => force.validate(&context),
        }
        .map_err(named_force)
    }
}

/// All forces on one body, per unit mass.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Accelerations {
    /// F₀/M + g, world axes, m/s².
    pub constant_world: DVec3,
    /// c/M, 1/s.
    pub linear_drag: f64,
    /// C/M, 1/m.
    pub quadratic_drag: f64,
    /// F/M, body axes, m/s².
    pub thrust_body: DVec3,
}

impl Accelerations {
    /// Whether [`closed_form()`] gives the motion.
    pub fn is_closed_form(&self) -> bool {
        self.quadratic_drag == 0.0 && self.thrust_body == DVec3::ZERO
    }

    /// dv/dt in world axes, m/s², of a body with this orientation (body to world) and velocity (m/s, world axes).
    pub fn at(&self, orientation: DQuat, velocity: DVec3) -> DVec3 {
        self.constant_world - velocity * self.linear_drag
            + quadratic_drag::acceleration(self.quadratic_drag, velocity)
            + thrust::acceleration(self.thrust_body, orientation)
    }
}

/// The sum of all forces on one body of this mass, except those that are [`Force::Custom`].
pub fn accelerations(forces: &[Force], body: usize, mass: f64) -> Accelerations {
    let mut sum = Accelerations::default();
    for force in forces {
        match force {
            Force::Constant(force) => sum.constant_world += force.at(body) / mass,
            Force::Gravity(acceleration) => sum.constant_world += acceleration.at(body),
            Force::LinearDrag(coefficient) => sum.linear_drag += coefficient.at(body) / mass,
            Force::QuadraticDrag(coefficient) => sum.quadratic_drag += coefficient.at(body) / mass,
            Force::Thrust(force) => sum.thrust_body += force.at(body) / mass,
            Force::Custom(_) => {}
        }
    }
    sum
}
