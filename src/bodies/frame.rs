//! The transformation from a body's own axes and units back to the user's.

use glam::{DQuat, DVec3};

use super::Status;
use super::columns::{PARAMETER_COMPONENTS, STATE_COMPONENTS, StateWords};
use super::inertia::principal_axes;
use super::user_axes::{self, UserAxes, of_components};
use crate::bodies::Ensemble;
use crate::math::power_of_two::{binary_exponent, scaled_by_power_of_two, vector_scaled_by_power_of_two};
use crate::math::quaternion::Quaternion;
use crate::math::vector::Vector;

/// Transforms a scaled state to the user's axes and units. If moments of inertia change in time, it holds for one time, at first 0
/// ([`BodyFrame::at`]).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyFrame {
    /// Principal moments in units of 2^`moment_exponent` kg m², ascending; for a linear rotor the moments that it is integrated
    /// with, I, I, I ([`crate::torque::linear_rotor`]).
    pub scaled_moments: DVec3,
    /// Whether the body is a linear rotor, whose axis is the first principal one.
    pub is_linear_rotor: bool,
    /// Rotates principal coordinates to body coordinates.
    pub principal_to_body: DQuat,
    /// k: moments are in units of 2^k kg m².
    pub moment_exponent: i32,
    /// r: rates are in units of 2^r rad/s.
    pub rate_exponent: i32,
}

/// One body's state in the user's axes and units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyState {
    /// Unit quaternion that rotates body coordinates to world.
    pub orientation: DQuat,
    /// Angular velocity in body axes, rad/s.
    pub angular_velocity_body: DVec3,
    /// Angular momentum in world axes, N m s.
    pub angular_momentum_world: DVec3,
    /// Rotational kinetic energy, J.
    pub kinetic_energy: f64,
    /// |q| − 1 of the orientation as it was integrated, before it was normalised for output.
    pub norm_error: f64,
    /// The body's status.
    pub status: Status,
}

impl BodyState {
    /// NaN everywhere, so that a state that was never written cannot pass for one.
    pub(crate) const UNKNOWN: Self = Self {
        orientation: DQuat::NAN,
        angular_velocity_body: DVec3::NAN,
        angular_momentum_world: DVec3::NAN,
        kinetic_energy: f64::NAN,
        norm_error: f64::NAN,
        status: Status::Valid,
    };

    /// Whether no component is NaN and no step has failed on the body.
    pub(crate) fn is_sound(&self) -> bool {
        self.status.is_good() && self.is_finite()
    }

    /// Whether every component that goes into results is finite.
    pub(crate) fn is_finite(&self) -> bool {
        self.orientation.is_finite()
            && self.angular_velocity_body.is_finite()
            && self.angular_momentum_world.is_finite()
            && self.kinetic_energy.is_finite()
    }
}

impl BodyFrame {
    /// The frame of a body that is already scaled and in its principal axes.
    pub(crate) const UNIT: Self = Self {
        scaled_moments: DVec3::ONE,
        is_linear_rotor: false,
        principal_to_body: DQuat::IDENTITY,
        moment_exponent: 0,
        rate_exponent: 0,
    };

    /// The frame of one body of an ensemble at the start. `driven_rate` maps its middle moment, kg m², to the rate (rad/s) to which
    /// torques bring it within about a radian, 0 without torques.
    pub(crate) fn of_body(ensemble: &Ensemble, body: usize, driven_rate: impl FnOnce(f64) -> f64) -> Self {
        let mut axes = principal_axes(&ensemble.inertia()[body]);
        let is_linear_rotor = ensemble.is_linear_rotor(body);
        if is_linear_rotor {
            axes.moments = DVec3::splat(0.5 * axes.moments.y + 0.5 * axes.moments.z);
        }
        let moment_exponent = binary_exponent(axes.moments.y);
        let scaled_moments = vector_scaled_by_power_of_two(axes.moments, -moment_exponent);
        let spin = ensemble.angular_velocity_body()[body].abs().max_element();
        let rate_exponent = binary_exponent(spin.max(driven_rate(axes.moments.y)));
        let principal_to_body = axes.principal_to_body;
        Self { scaled_moments, is_linear_rotor, principal_to_body, moment_exponent, rate_exponent }
    }

    /// The principal moments of the body's tensor, in units of 2^`moment_exponent` kg m², ascending.
    pub(crate) fn tensor_moments(&self) -> DVec3 {
        if self.is_linear_rotor { self.scaled_moments * DVec3::new(0.0, 1.0, 1.0) } else { self.scaled_moments }
    }

    /// The scaled parameters: 1/I₁, 1/I₂, 1/I₃ and 2^r.
    pub(crate) fn parameters(&self) -> [f64; PARAMETER_COMPONENTS] {
        let inverse = self.scaled_moments.recip();
        [inverse.x, inverse.y, inverse.z, scaled_by_power_of_two(1.0, self.rate_exponent)]
    }

    /// The scaled state ([`StateWords`]) in which a body of an ensemble with this frame starts.
    pub(crate) fn initial(&self, ensemble: &Ensemble, body: usize) -> [f64; STATE_COMPONENTS] {
        let m = self.angular_momentum_principal(ensemble, body);
        let q = unit_product(ensemble.orientation()[body], self.principal_to_body);
        [q.x, q.y, q.z, q.w, m.x, m.y, m.z]
    }

    /// The scaled angular momentum with which a body of an ensemble with this frame starts.
    pub(crate) fn angular_momentum_principal(&self, ensemble: &Ensemble, body: usize) -> DVec3 {
        let omega_body = vector_scaled_by_power_of_two(ensemble.angular_velocity_body()[body], -self.rate_exponent);
        let mut omega = self.to_principal(omega_body);
        if self.is_linear_rotor {
            omega.x = 0.0;
        }
        self.scaled_moments * omega
    }

    /// Body coordinates to principal.
    pub(crate) fn to_principal(self, vector_body: DVec3) -> DVec3 {
        self.principal_to_body.conjugate() * vector_body
    }

    /// `x` in SI units, whose dimension is (kg m²)^`moments` · s^−`rates`, in the body's own units.
    pub(crate) fn scaled(&self, x: f64, moments: i32, rates: i32) -> f64 {
        scaled_by_power_of_two(x, -(self.moment_exponent * moments + self.rate_exponent * rates))
    }

    /// A torque (N m) in the body's own units, component by component.
    pub(crate) fn scaled_torque(&self, torque: DVec3) -> DVec3 {
        vector_scaled_by_power_of_two(torque, -(self.moment_exponent + 2 * self.rate_exponent))
    }

    /// The state in the user's axes and units from one row of the state that was read.
    pub(crate) fn state_of(&self, words: &StateWords, row: usize) -> BodyState {
        BodyState { status: words.status[row], ..self.body_state(words.combined(row)) }
    }

    /// The state in the user's axes and units from a scaled one (`[q x, y, z, w, m x, y, z]`, see [`StateWords`]).
    pub fn body_state(&self, scaled: [f64; STATE_COMPONENTS]) -> BodyState {
        let [qx, qy, qz, qw, mx, my, mz] = scaled;
        let found = UserAxes::<f64>::new(|_| self).components(Quaternion::new(qx, qy, qz, qw), Vector::new(mx, my, mz));
        of_components(|component| found[component])
    }
}

/// The state of one body at the start, computed as for stepped bodies.
pub(crate) fn initial_state(ensemble: &Ensemble, body: usize) -> BodyState {
    let frame = BodyFrame::of_body(ensemble, body, |_| 0.0);
    frame.body_state(frame.initial(ensemble, body))
}

/// The angle of the rotation between two orientations, rad, in [0, π]: twice the arc tangent of the vector part of
/// conj(p) q over its scalar part, which keeps small angles.
pub(crate) fn attitude_error(a: &BodyState, b: &BodyState) -> f64 {
    let relative = a.orientation.conjugate() * b.orientation;
    2.0 * DVec3::new(relative.x, relative.y, relative.z).length().atan2(relative.w.abs())
}

/// The product of two unit quaternions, normalised to first order in the rounding of their norms.
#[inline]
pub(crate) fn unit_product(a: DQuat, b: DQuat) -> DQuat {
    let quaternion = |q: DQuat| Quaternion::new(q.x, q.y, q.z, q.w);
    let product = user_axes::unit_product(quaternion(a), quaternion(b));
    DQuat::from_xyzw(product.x, product.y, product.z, product.w)
}
