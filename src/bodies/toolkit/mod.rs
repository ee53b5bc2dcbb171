//! The statements of "A Complete Derivation of the Newton-Euler Equations", each as a function.
//!
//! Everything is `f64` and uses the types of `glam`, in SI units; orientations are unit quaternions that rotate body
//! coordinates to world. `tests/truth/derivation.rs` checks the derivation's identities in its order, over random inputs.
//!
//! | in the derivation | here |
//! | --- | --- |
//! | (1), (2), 4.1: the cross-product matrix | [`cross_product_matrix`], [`vector_of_cross_product_matrix`] |
//! | 2.2: R(t) = R exp(t ω_B) = exp(t ω_W) R | [`rotated_body`], [`rotated_world`], [`exponential`], [`logarithm`] |
//! | 4.2: derivatives of rotations | [`left_jacobian`], [`right_jacobian`], their inverses |
//! | (3): velocity of a point | [`velocity_of_point`], [`acceleration_of_point`], [`instantaneous_axis`] |
//! | (4): kinetic energy and its cross term | [`kinetic_energy_from`] |
//! | (5): rotational energy and inertia | [`rotational_kinetic_energy`], [`crate::bodies::inertia`] |
//! | 2.3: momentum | [`linear_momentum`], [`angular_momentum`], [`angular_momentum_about`] |
//! | (6), (7), (8): generalized forces | [`force_of_motion`], [`torque_of_motion`] |
//! | (9), with its sign corrected | [`angular_acceleration_body`], [`angular_acceleration_world`] |
//! | (7) and (9) together | [`newton_euler_body`], [`newton_euler_world`] |
//! | end of 3: no precession of eigenvectors | [`momentum_angle`], [`is_without_precession`], [`polhode`](fn@polhode) |
//!
//! Inertia about another point is [`MassProperties::inertia_about`](crate::bodies::inertia::MassProperties::inertia_about),
//! in another frame [`InertiaTensor::rotated`](crate::bodies::inertia::InertiaTensor::rotated). Attitudes are converted by
//! [`AxisAngle`], [`orientation_of_matrix`], [`EulerSequence`] and [`ModifiedRodrigues`].

mod attitude;
mod cross_product;
mod energy;
mod euler_angles;
mod jacobian;
mod kinematics;
mod newton_euler;
mod polhode;
mod rotation;

pub use attitude::{AxisAngle, ModifiedRodrigues, matrix_of_orientation, orientation_of_matrix};
pub use cross_product::{cross_product_matrix, vector_of_cross_product_matrix};
pub use energy::{
    KineticEnergyTerms, angular_momentum, angular_momentum_about, kinetic_energy_from, linear_kinetic_energy,
    linear_momentum, rotational_kinetic_energy,
};
pub use euler_angles::{Axis, EulerAngles, EulerSequence, TurnedAxes};
pub use jacobian::{left_jacobian, left_jacobian_inverse, right_jacobian, right_jacobian_inverse};
pub use kinematics::{
    InstantaneousAxis, acceleration_of_point, instantaneous_axis, orientation_rate_body, orientation_rate_world,
    velocity_of_point,
};
pub use newton_euler::{
    Accelerations, Wrench, angular_acceleration_body, angular_acceleration_world, force_of_motion, gyroscopic_term,
    newton_euler_body, newton_euler_world, torque_of_motion,
};
pub use polhode::{Polhode, PolhodeClass, is_without_precession, momentum_angle, polhode};
pub use rotation::{
    attitude_error, exponential, exponential_matrix, logarithm, logarithm_matrix, rotated_body, rotated_world,
};
