//! The quantities that have statistics formed on the engine.

use crate::bodies::{BodyFrame, BodyState};

/// A quantity of a body that has statistics over the ensemble.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum Statistic {
    /// Rotational kinetic energy, J.
    KineticEnergy,
    /// Magnitude of the angular velocity, rad/s.
    SpinRate,
    /// Magnitude of the angular momentum, kg m²/s.
    AngularMomentum,
}

impl Statistic {
    /// All quantities.
    pub const ALL: [Self; 3] = [Self::KineticEnergy, Self::SpinRate, Self::AngularMomentum];

    /// The name in study files and tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::KineticEnergy => "kinetic_energy",
            Self::SpinRate => "spin_rate",
            Self::AngularMomentum => "angular_momentum",
        }
    }

    /// The unit.
    pub fn unit(self) -> &'static str {
        match self {
            Self::KineticEnergy => "J",
            Self::SpinRate => "rad/s",
            Self::AngularMomentum => "kg m²/s",
        }
    }

    /// The quantity of one body, in SI units.
    pub fn of(self, state: &BodyState) -> f64 {
        match self {
            Self::KineticEnergy => state.kinetic_energy,
            Self::SpinRate => state.angular_velocity_body.length(),
            Self::AngularMomentum => state.angular_momentum_world.length(),
        }
    }

    /// The number that identifies it in the kernels.
    pub(crate) fn code(self) -> u32 {
        self as u32
    }

    /// The power of the angular momentum to which it is proportional.
    pub(crate) fn degree(self) -> i32 {
        if self == Self::KineticEnergy { 2 } else { 1 }
    }

    /// The exponent of two of its unit in a body's own scale.
    pub(crate) fn exponent(self, frame: &BodyFrame) -> i32 {
        match self {
            Self::KineticEnergy => frame.moment_exponent + 2 * frame.rate_exponent,
            Self::SpinRate => frame.rate_exponent,
            Self::AngularMomentum => frame.moment_exponent + frame.rate_exponent,
        }
    }
}

impl std::fmt::Display for Statistic {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(self.name())
    }
}
