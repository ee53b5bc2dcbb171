//! Kinetic energy, and momentum, which is its gradient.

use glam::DVec3;

use crate::bodies::inertia::{InertiaTensor, MassProperties};

/// K_v = ½ m vᵀv, J.
pub fn linear_kinetic_energy(mass: f64, velocity: DVec3) -> f64 {
    0.5 * mass * velocity.length_squared()
}

/// K_ω = ½ ωᵀ I ω, J (the derivation's equation (5)); tensor and angular velocity in the same axes.
pub fn rotational_kinetic_energy(inertia: &InertiaTensor, angular_velocity: DVec3) -> f64 {
    0.5 * angular_velocity.dot(*inertia * angular_velocity)
}

/// ∂K_v/∂v = m v, kg m/s.
pub fn linear_momentum(mass: f64, velocity: DVec3) -> DVec3 {
    velocity * mass
}

/// ∂K_ω/∂ω = I ω, kg m²/s, about the centre of mass; tensor and angular velocity in the same axes.
///
/// When a free body changes its shape, this is conserved, and the energy is not. The water behind the Three Gorges dam lengthens the day by
/// about 0.06 µs: 39.3 km³ were taken from the oceans, where cos² of the latitude is 0.692 in the mean (the ocean function's second degree,
/// W. Munk, G. MacDonald, *The Rotation of the Earth*, 1960), to 30.5° north, where it is 0.742. The elastic Earth yields under the load
/// and undoes 0.3075 of that (the load Love number k₂').
///
/// ```
/// use glam::DVec3;
/// use polhode::bodies::inertia::InertiaTensor;
/// use polhode::bodies::toolkit::{angular_momentum, rotational_kinetic_energy};
///
/// let (day, radius, polar_moment) = (86_164.1, 6.371e6, 8.034e37);
/// let water = 39.3e9 * 1000.0;
/// let moved = water * radius * radius * (30.5_f64.to_radians().cos().powi(2) - 0.692) * (1.0 - 0.3075);
/// let before = InertiaTensor::from_principal_moments(DVec3::new(8.008e37, 8.010e37, polar_moment));
/// let after = before + InertiaTensor { zz: moved, ..Default::default() };
///
/// let omega = DVec3::Z * (std::f64::consts::TAU / day);
/// let momentum = angular_momentum(&before, omega);
/// // No torque from outside acts: the momentum stays, and the spin follows from it.
/// let slower = after.solve(momentum);
/// let longer_day = std::f64::consts::TAU / slower.z - day;
/// assert!((longer_day * 1e6 - 0.06).abs() < 0.005, "{} µs", longer_day * 1e6);
/// // The energy L²/2I does not stay: it falls in the ratio of the spin, as forces within moved the water outwards.
/// let (k, k_after) = (rotational_kinetic_energy(&before, omega), rotational_kinetic_energy(&after, slower));
/// assert!(((k - k_after) / k - longer_day / day).abs() < 1e-15);
/// ```
///
/// (The text of the derivation says that the Earth slows "to maintain its kinetic energy". If the energy were kept, the day would lengthen
/// by half as much. The height of the lake, 175 m, contributes only a thousandth: the latitude is what counts.)
pub fn angular_momentum(inertia: &InertiaTensor, angular_velocity: DVec3) -> DVec3 {
    *inertia * angular_velocity
}

/// I ω + m (x − p) × v, kg m²/s: the angular momentum about the point p of a body whose centre of mass is at x and
/// moves with v. All vectors and the tensor in the same axes.
pub fn angular_momentum_about(
    point: DVec3,
    body: &MassProperties,
    centre_velocity: DVec3,
    angular_velocity: DVec3,
) -> DVec3 {
    let offset = body.centre_of_mass - point;
    body.inertia * angular_velocity + body.mass * offset.cross(centre_velocity)
}

/// The three terms of the kinetic energy of a body, relative to a reference point fixed in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KineticEnergyTerms {
    /// ½ ωᵀ I_p ω with the tensor about the reference point, J.
    pub rotational: f64,
    /// ½ m ẋ_pᵀ ẋ_p with the velocity of the reference point, J.
    pub linear: f64,
    /// ẋ_pᵀ ω × ∫ρ r dΩ, J: vanishes where the reference point is the centre of mass.
    pub cross: f64,
}

impl KineticEnergyTerms {
    /// The sum, which does not depend on the reference point.
    pub fn total(&self) -> f64 {
        self.rotational + self.linear + self.cross
    }
}

/// The kinetic energy of `body` from the `reference` point (of the body, m), which moves with `reference_velocity`:
/// the derivation's equation (4), cross term included. All vectors and the tensor in the same axes.
///
/// ```
/// use glam::DVec3;
/// use polhode::bodies::inertia::Shape;
/// use polhode::bodies::toolkit::{kinetic_energy_from, velocity_of_point};
///
/// let cone = Shape::Cone { radius: 1.0, height: 4.0 }.mass_properties(2.0)?;
/// let (omega, v) = (DVec3::new(1.0, 2.0, 3.0), DVec3::new(-1.0, 0.5, 0.0));
/// let at_centre = kinetic_energy_from(cone.centre_of_mass, &cone, v, omega);
/// assert_eq!(at_centre.cross, 0.0);
/// // From the tip, which moves otherwise, the terms differ and the sum does not.
/// let tip = DVec3::Z * 4.0;
/// let at_tip = kinetic_energy_from(tip, &cone, velocity_of_point(v, omega, tip - cone.centre_of_mass), omega);
/// assert!(at_tip.cross.abs() > 1.0 && (at_tip.total() - at_centre.total()).abs() < 1e-13);
/// # Ok::<(), polhode::Error>(())
/// ```
pub fn kinetic_energy_from(
    reference: DVec3,
    body: &MassProperties,
    reference_velocity: DVec3,
    angular_velocity: DVec3,
) -> KineticEnergyTerms {
    let first_moment = body.mass * (body.centre_of_mass - reference);
    KineticEnergyTerms {
        rotational: rotational_kinetic_energy(&body.inertia_about(reference), angular_velocity),
        linear: linear_kinetic_energy(body.mass, reference_velocity),
        cross: reference_velocity.dot(angular_velocity.cross(first_moment)),
    }
}
