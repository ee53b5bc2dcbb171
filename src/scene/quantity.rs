//! Derived quantities of a body: what statistics, histograms and events are formed of.

use std::fmt;
use std::sync::Arc;

use glam::DVec3;

use crate::bodies::toolkit::EulerSequence;
use crate::error::{Error, Result};
use crate::expression::{Expression, Program, Shape, Symbols, TextError};
use crate::kernel::observe::Statistic;

/// A number that follows from a body's state at one time.
///
/// With ω the angular velocity, L the angular momentum, T the rotational kinetic energy and I₁ ≤ I₂ ≤ I₃ the principal moments at that
/// time:
///
/// | quantity | formula | unit | range |
/// | --- | --- | --- | --- |
/// | [`KineticEnergy`](Self::KineticEnergy) | T = ½ ω·L | J | ≥ 0 |
/// | [`SpinRate`](Self::SpinRate) | \|ω\| | rad/s | ≥ 0 |
/// | [`AngularMomentum`](Self::AngularMomentum) | \|L\| | kg m²/s | ≥ 0 |
/// | [`AngularMomentumWorld`](Self::AngularMomentumWorld) | a component of L in world axes | kg m²/s | |
/// | [`AngularVelocityBody`](Self::AngularVelocityBody) | a component of ω in body axes | rad/s | |
/// | [`Nutation`](Self::Nutation) | the angle between ω and L | rad | [0, π/2] |
/// | [`DynamicInertia`](Self::DynamicInertia) | I_d = L²/2T | kg m² | [I₁, I₃] |
/// | [`SeparatrixDistance`](Self::SeparatrixDistance) | (I_d − I₂)/(I₃ − I₂) where I_d ≥ I₂, else (I_d − I₂)/(I₂ − I₁) | 1 | [−1, 1] |
/// | [`Yaw`](Self::Yaw), [`Pitch`](Self::Pitch), [`Roll`](Self::Roll) | turns about z, then the new y, then the new x | rad | (−π, π], pitch [−π/2, π/2] |
/// | [`PotentialEnergy`](Self::PotentialEnergy) | the sum over the torques that have a potential | J | |
/// | [`TotalEnergy`](Self::TotalEnergy) | T + the potential energy | J | |
/// | [`EulerAngle`](Self::EulerAngle) | an angle of any sequence ([`EulerSequence`]) | rad | as there |
/// | [`AxisAngle`](Self::AxisAngle) | the angle between a body axis and a direction of the world | rad | [0, π] |
/// | [`Formula`](Self::Formula) | the user's own | as given | |
///
/// A body at rest has no nutation, dynamic inertia or distance: these are NaN then, and so is any quantity of a body that has failed. Bodies
/// without a number are left out of statistics. The dynamic inertia and the distance are those of N. H. Samarasinha and M. F. A'Hearn
/// (*Icarus* 93 (1991) 194): −1 is rotation about the least axis, 0 the separatrix, 1 rotation about the greatest axis. Euler angles jump
/// by a turn at the ends of their ranges.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Quantity {
    /// Rotational kinetic energy, J.
    KineticEnergy,
    /// Magnitude of the angular velocity, rad/s.
    SpinRate,
    /// Magnitude of the angular momentum, kg m²/s.
    AngularMomentum,
    /// A component of the angular momentum in world axes, kg m²/s: 0, 1 or 2.
    AngularMomentumWorld(usize),
    /// A component of the angular velocity in body axes, rad/s: 0, 1 or 2.
    AngularVelocityBody(usize),
    /// The angle between angular velocity and angular momentum, rad.
    Nutation,
    /// L²/2T, kg m².
    DynamicInertia,
    /// How far the motion is from the separatrix: −1 to 1.
    SeparatrixDistance,
    /// The turn about z, rad.
    Yaw,
    /// The turn about the new y, rad.
    Pitch,
    /// The turn about the new x, rad.
    Roll,
    /// The potential energy of the torques that have one, J.
    PotentialEnergy,
    /// Kinetic and potential energy, J.
    TotalEnergy,
    /// An angle of a sequence of turns.
    EulerAngle {
        /// What it is called in tables.
        name: Arc<str>,
        /// The sequence.
        sequence: EulerSequence,
        /// Which of its angles: 0, 1 or 2.
        index: usize,
    },
    /// The angle between a body axis and a direction of the world: a pointing error.
    AxisAngle {
        /// What it is called in tables.
        name: Arc<str>,
        /// In body axes; a unit vector.
        axis_body: DVec3,
        /// In world axes; a unit vector.
        direction_world: DVec3,
    },
    /// A formula of the user's own.
    Formula(Arc<FormulaQuantity>),
}

/// A quantity by a formula.
#[derive(Clone, Debug, PartialEq)]
pub struct FormulaQuantity {
    name: String,
    unit: String,
    expression: Expression,
    program: Program,
}

impl FormulaQuantity {
    /// The formula as instructions.
    pub(crate) fn program(&self) -> &Program {
        &self.program
    }
}

impl Quantity {
    /// Those without parameters of their own, in the order of the table above.
    pub const NAMED: &'static [Self] = &[
        Self::KineticEnergy,
        Self::SpinRate,
        Self::AngularMomentum,
        Self::AngularMomentumWorld(0),
        Self::AngularMomentumWorld(1),
        Self::AngularMomentumWorld(2),
        Self::AngularVelocityBody(0),
        Self::AngularVelocityBody(1),
        Self::AngularVelocityBody(2),
        Self::Nutation,
        Self::DynamicInertia,
        Self::SeparatrixDistance,
        Self::Yaw,
        Self::Pitch,
        Self::Roll,
        Self::PotentialEnergy,
        Self::TotalEnergy,
    ];

    /// The angle between a body axis and a direction of the world, rad; both of any length above zero.
    ///
    /// # Errors
    ///
    /// [`Error::Setting`] where a vector has no direction.
    pub fn axis_angle(name: &str, axis_body: DVec3, direction_world: DVec3) -> Result<Self> {
        let unit = |field: &'static str, vector: DVec3| {
            // By the largest component first, so that no square leaves the range of numbers.
            let scaled = vector / vector.abs().max_element();
            let expected = "expected a vector that is finite and not zero";
            scaled.try_normalize().ok_or(Error::Setting { field, value: vector.length(), expected })
        };
        let (axis_body, direction_world) = (unit("axis", axis_body)?, unit("direction", direction_world)?);
        Ok(Self::AxisAngle { name: name.into(), axis_body, direction_world })
    }

    /// A formula of the user's own: a number of `attitude`, `angular_velocity` (rad/s) and `angular_momentum` in body axes, `inertia` and
    /// `time` (s); the language is that of [`crate::expression`].
    ///
    /// ```
    /// use polhode::Quantity;
    ///
    /// let text = "acos(clamp(dot(to_world(vec(0, 0, 1)), vec(0, 0, 1)), -1, 1))";
    /// let tilt = Quantity::formula("tilt", "rad", text)?;
    /// assert_eq!((tilt.name(), tilt.unit()), ("tilt", "rad"));
    /// # Ok::<(), polhode::expression::TextError>(())
    /// ```
    ///
    /// # Errors
    ///
    /// Where the text is no such formula: the error says where and why.
    pub fn formula(name: &str, unit: &str, text: &str) -> std::result::Result<Self, TextError> {
        let symbols = Symbols::rotation().with_full_inertia();
        let expression = Expression::parse(text, &symbols, Shape::Number)?;
        let program = expression.program();
        let (name, unit) = (name.to_owned(), unit.to_owned());
        Ok(Self::Formula(Arc::new(FormulaQuantity { name, unit, expression, program })))
    }

    /// The name in study files and tables.
    pub fn name(&self) -> &str {
        match self {
            Self::KineticEnergy => Statistic::KineticEnergy.name(),
            Self::SpinRate => Statistic::SpinRate.name(),
            Self::AngularMomentum => Statistic::AngularMomentum.name(),
            Self::AngularMomentumWorld(axis) => {
                ["angular_momentum_x", "angular_momentum_y", "angular_momentum_z"][*axis % 3]
            }
            Self::AngularVelocityBody(axis) => {
                ["angular_velocity_x", "angular_velocity_y", "angular_velocity_z"][*axis % 3]
            }
            Self::Nutation => "nutation",
            Self::DynamicInertia => "dynamic_inertia",
            Self::SeparatrixDistance => "separatrix_distance",
            Self::Yaw => "yaw",
            Self::Pitch => "pitch",
            Self::Roll => "roll",
            Self::PotentialEnergy => "potential_energy",
            Self::TotalEnergy => "total_energy",
            Self::EulerAngle { name, .. } | Self::AxisAngle { name, .. } => name,
            Self::Formula(formula) => &formula.name,
        }
    }

    /// The unit.
    pub fn unit(&self) -> &str {
        match self {
            Self::KineticEnergy | Self::PotentialEnergy | Self::TotalEnergy => "J",
            Self::SpinRate | Self::AngularVelocityBody(_) => "rad/s",
            Self::AngularMomentum | Self::AngularMomentumWorld(_) => "kg m²/s",
            Self::DynamicInertia => "kg m²",
            Self::SeparatrixDistance => "1",
            Self::Nutation | Self::Yaw | Self::Pitch | Self::Roll => "rad",
            Self::EulerAngle { .. } | Self::AxisAngle { .. } => "rad",
            Self::Formula(formula) => &formula.unit,
        }
    }

    /// The statistic that engines form where the states are, where it is one of those.
    pub(crate) fn statistic(&self) -> Option<Statistic> {
        match self {
            Self::KineticEnergy => Some(Statistic::KineticEnergy),
            Self::SpinRate => Some(Statistic::SpinRate),
            Self::AngularMomentum => Some(Statistic::AngularMomentum),
            _ => None,
        }
    }
}

impl From<Statistic> for Quantity {
    fn from(statistic: Statistic) -> Self {
        match statistic {
            Statistic::KineticEnergy => Self::KineticEnergy,
            Statistic::SpinRate => Self::SpinRate,
            Statistic::AngularMomentum => Self::AngularMomentum,
        }
    }
}

impl From<&Statistic> for Quantity {
    fn from(statistic: &Statistic) -> Self {
        (*statistic).into()
    }
}

impl From<&Quantity> for Quantity {
    fn from(quantity: &Quantity) -> Self {
        quantity.clone()
    }
}

impl fmt::Display for Quantity {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn names_are_unique() {
        let names: BTreeSet<&str> = Quantity::NAMED.iter().map(Quantity::name).collect();
        assert_eq!(names.len(), Quantity::NAMED.len());
    }

    #[test]
    fn an_axis_without_direction_is_refused() {
        for vector in [DVec3::ZERO, DVec3::NAN, DVec3::new(f64::INFINITY, 0.0, 0.0)] {
            assert!(Quantity::axis_angle("a", vector, DVec3::X).is_err(), "{vector}");
            assert!(Quantity::axis_angle("a", DVec3::X, vector).is_err(), "{vector}");
        }
        let Ok(Quantity::AxisAngle { axis_body, .. }) = Quantity::axis_angle("a", DVec3::splat(1e200), DVec3::X) else {
            panic!("a long vector has a direction");
        };
        assert!((axis_body.length() - 1.0).abs() < 1e-15);
    }
}
