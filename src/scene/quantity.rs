//! Derived quantities of a body, from which statistics, histograms and events are formed.

mod formula;
mod own_state;
mod torque_energy;

use std::fmt;
use std::sync::Arc;

use glam::DVec3;

pub use formula::FormulaQuantity;
pub use own_state::OwnStateQuantity;
pub use torque_energy::TorqueEnergyQuantity;

use crate::bodies::toolkit::EulerSequence;
use crate::error::{Error, Result};
use crate::expression::{Fault, Graph, Input, InputKind, Node, Recorder, Scope, Shape, Symbol, Symbols};
use crate::kernel::observe::Statistic;
use crate::math::elementary::functions::atan2;
use crate::math::quaternion::Quaternion;
use crate::math::real::Real;
use crate::math::vector::Vector;
use crate::torque::control::OwnNumber;

/// A number that follows from a body's state at one time. What a new one needs: `docs/extending.md`.
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
/// | [`Latitude`](Self::Latitude) | the angle of L above the equator of a principal axis, the plane across it | rad | [−π/2, π/2] |
/// | [`Yaw`](Self::Yaw), [`Pitch`](Self::Pitch), [`Roll`](Self::Roll) | turns about z, then the new y, then the new x | rad | (−π, π], pitch [−π/2, π/2] |
/// | [`PotentialEnergy`](Self::PotentialEnergy) | the sum over the torques that have a potential | J | |
/// | [`TotalEnergy`](Self::TotalEnergy) | T + the potential energy | J | |
/// | [`TorqueEnergy`](Self::TorqueEnergy) | the potential energy of one torque | J | |
/// | [`EulerAngle`](Self::EulerAngle) | an angle of any sequence ([`EulerSequence`]) | rad | as there |
/// | [`AxisAngle`](Self::AxisAngle) | the angle between a body axis and a direction of the world | rad | [0, π] |
/// | [`OwnState`](Self::OwnState) | a number of the own state of a sampled torque | of the law | |
/// | [`Formula`](Self::Formula) | the user's own | as given | |
///
/// A body at rest has no dynamic inertia and no distance: both are then NaN, as is any quantity of a body that has failed. Bodies
/// without a finite number are left out of statistics, which count the others ([`crate::record::Summary::count`]). The dynamic inertia and the distance are those of N. H. Samarasinha and M. F. A'Hearn
/// (*Icarus* 93 (1991) 194): −1 is rotation about the least axis, 0 the separatrix, 1 rotation about the greatest axis. Principal axes point
/// as those of [`principal_axes`](crate::bodies::inertia::principal_axes) do, and the latitude of a body at rest is 0. Euler angles jump by a
/// turn at the ends of their ranges.
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
    /// The distance of the motion from the separatrix: −1 to 1.
    SeparatrixDistance,
    /// The latitude, rad, of the angular momentum above the equator of the least (0), middle (1) or greatest (2) principal axis.
    Latitude(usize),
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
        /// Its name in tables.
        name: Arc<str>,
        /// The sequence.
        sequence: EulerSequence,
        /// The index of the angle: 0, 1 or 2.
        index: usize,
    },
    /// The angle between a body axis and a direction of the world: a pointing error.
    AxisAngle {
        /// Its name in tables.
        name: Arc<str>,
        /// In body axes; a unit vector.
        axis_body: DVec3,
        /// In world axes; a unit vector.
        direction_world: DVec3,
    },
    /// The potential energy of one torque, J ([`Quantity::potential_energy_of`]).
    TorqueEnergy(Arc<TorqueEnergyQuantity>),
    /// A number of the own state of a sampled torque ([`Quantity::own_state`]).
    OwnState(Arc<OwnStateQuantity>),
    /// A formula of the user's own.
    Formula(Arc<FormulaQuantity>),
}

impl Quantity {
    /// The quantities without parameters, in the order of the table above.
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
        Self::Latitude(0),
        Self::Latitude(1),
        Self::Latitude(2),
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
            // Divided by the largest component first, so that no square overflows or underflows.
            let scaled = vector / vector.abs().max_element();
            let expected = "expected a vector that is finite and not zero";
            scaled.try_normalize().ok_or(Error::Setting { field, value: vector.length(), expected })
        };
        let (axis_body, direction_world) = (unit("axis", axis_body)?, unit("direction", direction_world)?);
        Ok(Self::AxisAngle { name: name.into(), axis_body, direction_world })
    }

    /// Refuses what no constructor makes: a component that no vector has, an axis that is no direction.
    pub(crate) fn check(&self) -> Result<()> {
        let wrong = |field, value, expected| Err(Error::Setting { field, value, expected });
        match self {
            Self::AngularMomentumWorld(index)
            | Self::AngularVelocityBody(index)
            | Self::Latitude(index)
            | Self::EulerAngle { index, .. }
                if *index > 2 =>
            {
                wrong("quantity.index", *index as f64, "expected 0, 1 or 2")
            }
            Self::AxisAngle { axis_body, direction_world, .. } => {
                let lengths = [axis_body, direction_world].map(|vector| vector.length());
                let other = lengths.into_iter().find(|length| length.is_nan() || (length - 1.0).abs() > 1e-9);
                other.map_or(Ok(()), |length| wrong("quantity.axis", length, "expected unit vectors"))
            }
            _ => Ok(()),
        }
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
            Self::Latitude(axis) => ["latitude_least", "latitude_middle", "latitude_greatest"][*axis % 3],
            Self::Yaw => "yaw",
            Self::Pitch => "pitch",
            Self::Roll => "roll",
            Self::PotentialEnergy => "potential_energy",
            Self::TotalEnergy => "total_energy",
            Self::EulerAngle { name, .. } | Self::AxisAngle { name, .. } => name,
            Self::TorqueEnergy(energy) => energy.label(),
            Self::OwnState(own) => own.label(),
            Self::Formula(formula) => &formula.name,
        }
    }

    /// The unit.
    pub fn unit(&self) -> &str {
        match self {
            Self::KineticEnergy | Self::PotentialEnergy | Self::TotalEnergy | Self::TorqueEnergy(_) => "J",
            Self::SpinRate | Self::AngularVelocityBody(_) => "rad/s",
            Self::AngularMomentum | Self::AngularMomentumWorld(_) => "kg m²/s",
            Self::DynamicInertia => "kg m²",
            Self::SeparatrixDistance => "1",
            Self::Nutation | Self::Latitude(_) | Self::Yaw | Self::Pitch | Self::Roll => "rad",
            Self::EulerAngle { .. } | Self::AxisAngle { .. } => "rad",
            Self::OwnState(own) => own.unit(),
            Self::Formula(formula) => &formula.unit,
        }
    }

    /// Whether a body that has not failed may have no finite value: formulas of the user's own, [`Self::DynamicInertia`] and
    /// [`Self::SeparatrixDistance`]. Tables of statistics count the bodies that have one.
    pub fn may_be_undefined(&self) -> bool {
        matches!(self, Self::DynamicInertia | Self::SeparatrixDistance | Self::Formula(_))
    }

    /// Several quantities as one formula, in which common terms are formed once. Too many operations are refused.
    pub(crate) fn expression(quantities: &[Self]) -> Result<(Graph, Vec<Node>)> {
        Self::recorded_together(quantities).map_err(|_| Error::Setting {
            field: "quantities",
            value: quantities.len() as f64,
            expected: "expected formulas of at most 10000 operations together",
        })
    }

    fn recorded_together(quantities: &[Self]) -> std::result::Result<(Graph, Vec<Node>), Fault> {
        let mut symbols = Symbols::rotation().with_full_inertia();
        for parameter in PARAMETERS {
            symbols = symbols.parameter(parameter, Shape::Number)?;
        }
        for number in Self::own_numbers(quantities) {
            symbols = symbols.parameter(&number.label(), Shape::Number)?;
        }
        for energy in Self::torque_energies(quantities) {
            symbols = symbols.parameter(energy.label(), Shape::Number)?;
        }
        Graph::record(|recorder| {
            let scope = Scope::new(&symbols, recorder);
            Ok(quantities.iter().map(|quantity| quantity.recorded(&scope, recorder)).collect())
        })
    }

    /// The formula.
    fn recorded(&self, scope: &Scope<'_>, recorder: &Recorder) -> Symbol {
        let omega = || scope.angular_velocity();
        let number = |name: &str| scope.number(name);
        // In world axes, as states hold it.
        let momentum = || {
            let [x, y, z] = MOMENTUM.map(number);
            Vector::new(x, y, z)
        };
        let euler = |sequence: EulerSequence, index: usize| sequence.angles_of(scope.attitude())[index % 3];
        let component = |vector: Vector<Symbol>, axis: &usize| [vector.x, vector.y, vector.z][axis % 3];
        let length = |vector: Vector<Symbol>| vector.dot(vector).sqrt();
        let dynamic_inertia = || {
            let length = length(momentum());
            // In this order, as the square of a molecule's momentum is far smaller than its energy.
            length / (Symbol::splat(2.0) * number(KINETIC_ENERGY)) * length
        };
        match self {
            Self::KineticEnergy => number(KINETIC_ENERGY),
            Self::SpinRate => length(omega()),
            Self::AngularMomentum => length(momentum()),
            Self::AngularMomentumWorld(axis) => component(momentum(), axis),
            Self::AngularVelocityBody(axis) => component(omega(), axis),
            Self::Nutation => angle_between(scope.to_world(omega()), momentum()),
            Self::DynamicInertia => dynamic_inertia(),
            Self::SeparatrixDistance => {
                let moments = MOMENTS.map(number);
                separatrix_distance(moments, dynamic_inertia())
            }
            Self::Latitude(axis) => {
                let [x, y, z, w] = PRINCIPAL_TO_BODY.map(number);
                latitude(Quaternion::new(x, y, z, w).rotate_inverse(scope.to_body(momentum())), *axis)
            }
            Self::Yaw => euler(EulerSequence::YAW_PITCH_ROLL, 0),
            Self::Pitch => euler(EulerSequence::YAW_PITCH_ROLL, 1),
            Self::Roll => euler(EulerSequence::YAW_PITCH_ROLL, 2),
            Self::EulerAngle { sequence, index, .. } => euler(*sequence, *index),
            Self::AxisAngle { axis_body, direction_world, .. } => {
                let constant = |v: &DVec3| Vector::new(Symbol::splat(v.x), Symbol::splat(v.y), Symbol::splat(v.z));
                angle_between(scope.to_world(constant(axis_body)), constant(direction_world))
            }
            Self::PotentialEnergy => number(POTENTIAL_ENERGY),
            Self::TotalEnergy => number(KINETIC_ENERGY) + number(POTENTIAL_ENERGY),
            Self::TorqueEnergy(energy) => number(energy.label()),
            Self::OwnState(own) => number(own.label()),
            Self::Formula(formula) => {
                let of_start = |index: usize| number(INITIAL[index]);
                let of_law = |own: &OwnNumber| number(&own.label());
                formula.recorded(scope.to_body(momentum()), of_start, of_law, |input| recorder.input(input))
            }
        }
    }

    /// The statistic that engines can form of it, if there is one.
    pub(crate) fn statistic(&self) -> Option<Statistic> {
        match self {
            Self::KineticEnergy => Some(Statistic::KineticEnergy),
            Self::SpinRate => Some(Statistic::SpinRate),
            Self::AngularMomentum => Some(Statistic::AngularMomentum),
            _ => None,
        }
    }
}

/// What the formulas of quantities read beside attitude, angular velocity, inertia and time, in SI units: the angular momentum in world
/// axes, the kinetic energy, the principal moments, ascending, the potential energy of the torques that have one, the rotation from
/// principal to body axes, and the attitude and the angular velocity in body axes at the start. Numbers of own state follow
/// ([`Quantity::own_numbers`]), and the potential energies of single torques.
pub(crate) const PARAMETERS: [&str; 19] = {
    let ([a, b, c], [d, e, f], [x, y, z, w]) = (MOMENTUM, MOMENTS, PRINCIPAL_TO_BODY);
    let [i, j, k, l, m, n, o] = INITIAL;
    [a, b, c, KINETIC_ENERGY, d, e, f, POTENTIAL_ENERGY, x, y, z, w, i, j, k, l, m, n, o]
};

const MOMENTUM: [&str; 3] = ["momentum_world_x", "momentum_world_y", "momentum_world_z"];
const KINETIC_ENERGY: &str = "kinetic_energy";
const MOMENTS: [&str; 3] = ["least_moment", "middle_moment", "greatest_moment"];
const POTENTIAL_ENERGY: &str = "potential_energy";
const PRINCIPAL_TO_BODY: [&str; 4] =
    ["principal_to_body_x", "principal_to_body_y", "principal_to_body_z", "principal_to_body_w"];
const INITIAL: [&str; 7] = [
    "initial_attitude_x",
    "initial_attitude_y",
    "initial_attitude_z",
    "initial_attitude_w",
    "initial_angular_velocity_x",
    "initial_angular_velocity_y",
    "initial_angular_velocity_z",
];

/// Whether a formula reads this from the state of a body or from the time, not from what does not change.
pub(crate) fn is_of_state(input: Input) -> bool {
    match input.kind {
        InputKind::Orientation | InputKind::AngularVelocity | InputKind::Time => true,
        // In the order of `PARAMETERS`.
        InputKind::Parameter => input.index < 4,
        _ => false,
    }
}

/// Whether a formula reads this from the principal moments or axes.
pub(super) fn is_of_axes(input: Input) -> bool {
    input.kind == InputKind::Parameter && matches!(input.index, 4..=6 | 8..=11)
}

/// The angle between two vectors, rad, accurate for small angles too.
fn angle_between<R: Real>(a: Vector<R>, b: Vector<R>) -> R {
    let across = a.cross(b);
    atan2(across.dot(across).sqrt(), a.dot(b))
}

/// The angle, rad, between a vector and the plane across an axis of coordinates, positive on the axis' side; accurate near the plane and near
/// the axis.
fn latitude<R: Real>(vector: Vector<R>, axis: usize) -> R {
    let components = [vector.x, vector.y, vector.z];
    let [a, b] = [1, 2].map(|step| components[(axis + step) % 3]);
    atan2(components[axis % 3], a.mul_add(a, b * b).sqrt())
}

/// The distance from the separatrix, −1 to 1 ([`Quantity::SeparatrixDistance`]).
fn separatrix_distance<R: Real>([least, middle, greatest]: [R; 3], dynamic_inertia: R) -> R {
    let (zero, one) = (R::splat(0.0), R::splat(1.0));
    let excess = dynamic_inertia - middle;
    let room = R::select(excess.less_than(zero), middle - least, greatest - middle);
    // If the moments are equal to rounding, the distance would be rounding alone.
    let has_room = zero.less_than(room);
    let distance = excess / R::select(has_room, room, one);
    let distance = R::select(has_room, distance, distance * zero);
    let distance = R::select(one.less_than(distance), one, distance);
    R::select(distance.less_than(-one), -one, distance)
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
    fn latitudes_are_right_at_rest_at_the_poles_and_at_the_equator() {
        let of = |x: f64, y: f64, z: f64| [0, 1, 2].map(|axis| latitude(Vector::new(x, y, z), axis));
        assert_eq!(of(0.0, 0.0, 0.0), [0.0; 3]);
        assert_eq!(of(0.0, -3.0, 0.0), [0.0, -std::f64::consts::FRAC_PI_2, 0.0]);
        let [x, y, z] = of(1.0, 1e-20, -1e-20);
        assert!((x - std::f64::consts::FRAC_PI_2).abs() < 1e-15, "{x}");
        assert!((y - 1e-20).abs() < 1e-35 && (z + 1e-20).abs() < 1e-35, "{y:e}, {z:e}");
    }

    #[test]
    fn small_angles_are_kept() {
        let angle = angle_between(Vector::new(3.0, 0.0, 0.0), Vector::new(1e-20, 1e-32, 0.0));
        assert!((angle - 1e-12).abs() < 1e-27, "{angle:e}");
        let opposite: f64 = angle_between(Vector::new(1.0, 0.0, 0.0), Vector::new(-1.0, 0.0, 0.0));
        assert!((opposite - std::f64::consts::PI).abs() < 1e-15);
    }

    #[test]
    fn the_distance_from_the_separatrix_ends_at_the_axes() {
        let found = [1.0, 1.5, 2.0, 3.0, 4.0].map(|inertia| separatrix_distance([1.0, 2.0, 4.0], inertia));
        assert_eq!(found, [-1.0, -0.5, 0.0, 0.5, 1.0]);
        assert_eq!(separatrix_distance([1.0; 3], 1.0), 0.0);
        assert!(separatrix_distance([1.0, 2.0, 4.0], f64::NAN).is_nan());
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
