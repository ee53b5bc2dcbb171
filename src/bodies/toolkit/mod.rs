//! Attitudes and the equations of motion of one body, for checks of results and for work of one's own.
//!
//! Everything is `f64` and uses the types of `glam`, in SI units; orientations are unit quaternions that rotate body
//! coordinates to world. The equation numbers are those of "A Complete Derivation of the Newton-Euler Equations", whose
//! identities `tests/truth/derivation.rs` checks in its order, over random inputs.
//!
//! | in the derivation | here |
//! | --- | --- |
//! | 2.2: R(t) = R exp(t ω_B) = exp(t ω_W) R | [`exponential`], [`logarithm`], [`attitude_error`] |
//! | (5): rotational energy and inertia | [`rotational_kinetic_energy`], [`crate::bodies::inertia`] |
//! | 2.3: momentum | [`angular_momentum`] |
//! | (6), (8): torque | [`torque_of_motion`] |
//! | (9), with its sign corrected | [`angular_acceleration_body`] |
//! | 3: precession | [`momentum_angle`] |
//!
//! Sequences of Euler angles are named by [`EulerSequence`].

mod euler_angles;
mod motion;
mod rotation;

pub use euler_angles::{Axis, EulerSequence, TurnedAxes};
pub use motion::{
    angular_acceleration_body, angular_momentum, momentum_angle, rotational_kinetic_energy, torque_of_motion,
};
pub use rotation::{attitude_error, exponential, logarithm};
