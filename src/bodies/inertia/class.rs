//! Classes of bodies by their principal moments, and the class without spin: linear rotors.

use glam::DVec3;

use super::mass_properties::positive;
use super::principal::PrincipalAxes;
use crate::error::InertiaDefect;
use crate::error::{Error, Result};

/// The kind of rotor that a body is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum InertiaClass {
    /// No inertia at all: a point.
    Point,
    /// I₁ = 0, I₂ = I₃: a line of mass, which has no spin about itself.
    LinearRotor,
    /// I₁ = I₂ = I₃.
    Spherical,
    /// I₁ < I₂ = I₃: elongated.
    Prolate,
    /// I₁ = I₂ < I₃: flattened.
    Oblate,
    /// Three different moments.
    Asymmetric,
}

/// The class of principal `moments` (ascending, kg m²); moments that differ by at most `relative_tolerance` of the
/// largest count as equal, and a moment of at most that as vanished.
pub fn classify(moments: DVec3, relative_tolerance: f64) -> InertiaClass {
    let bound = relative_tolerance * moments.z;
    if moments.z == 0.0 {
        InertiaClass::Point
    } else if moments.x <= bound && moments.z - moments.y <= bound {
        InertiaClass::LinearRotor
    } else {
        match (moments.y - moments.x <= bound, moments.z - moments.y <= bound) {
            (true, true) => InertiaClass::Spherical,
            (false, true) => InertiaClass::Prolate,
            (true, false) => InertiaClass::Oblate,
            (false, false) => InertiaClass::Asymmetric,
        }
    }
}

/// A body without inertia about one axis and with equal moments about all axes across: a diatomic molecule, an ideal
/// rod.
///
/// Its state is a direction and an angular velocity across it; a spin about the axis would have neither energy nor
/// momentum, and a torque about it nothing to act upon. With n the axis, ω ⊥ n and L = I ω, Euler's equations lose
/// their gyroscopic term (ω × I ω = 0):
///
/// ```text
/// I dω/dt = τ − (τ · n) n  in body axes that turn with ω,      dn/dt = ω × n
/// ```
///
/// ```
/// use glam::DVec3;
/// use polhode::bodies::inertia::{LinearRotor, Shape};
///
/// let rod = Shape::Rod { length: 2.0 }.mass_properties(3.0)?;
/// let rotor = LinearRotor::new(&rod.principal_axes(), 1e-12)?;
/// assert_eq!(rotor.moment, 1.0);
/// let omega = rotor.without_spin(DVec3::new(0.3, -0.2, 50.0));
/// assert_eq!(omega, DVec3::new(0.3, -0.2, 0.0));
/// assert_eq!(rotor.angular_acceleration_body(DVec3::new(0.0, 2.0, 9.0)), DVec3::new(0.0, 2.0, 0.0));
/// # Ok::<(), polhode::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearRotor {
    /// The moment about every axis across, kg m².
    pub moment: f64,
    /// The axis, a unit vector in body axes.
    pub axis_body: DVec3,
}

impl LinearRotor {
    /// The linear rotor that a body with these `axes` is.
    ///
    /// # Errors
    /// [`Error::Inertia`] where I₁ does not vanish or I₂ and I₃ differ, by more than `relative_tolerance` of I₃.
    pub fn new(axes: &PrincipalAxes, relative_tolerance: f64) -> Result<Self> {
        let moments = axes.moments;
        if classify(moments, relative_tolerance) != InertiaClass::LinearRotor {
            return Err(Error::Inertia(InertiaDefect::NotLinear { moments, relative_tolerance }));
        }
        let moment = positive("moment", 0.5 * moments.y + 0.5 * moments.z)?;
        Ok(Self { moment, axis_body: axes.axis_body(0) })
    }

    /// The part of an angular velocity that the rotor can have: across its axis, rad/s, body axes.
    pub fn without_spin(&self, angular_velocity_body: DVec3) -> DVec3 {
        angular_velocity_body - self.axis_body * self.axis_body.dot(angular_velocity_body)
    }

    /// dω/dt under `torque_body` (N m), rad/s²; a torque about the axis has no effect.
    pub fn angular_acceleration_body(&self, torque_body: DVec3) -> DVec3 {
        self.without_spin(torque_body) / self.moment
    }

    /// L = I ω, kg m²/s, of the part of the angular velocity across the axis.
    pub fn angular_momentum_body(&self, angular_velocity_body: DVec3) -> DVec3 {
        self.without_spin(angular_velocity_body) * self.moment
    }

    /// ½ I ω², J, of the part of the angular velocity across the axis.
    pub fn kinetic_energy(&self, angular_velocity_body: DVec3) -> f64 {
        0.5 * self.moment * self.without_spin(angular_velocity_body).length_squared()
    }
}
