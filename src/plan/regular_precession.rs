//! Two uniform rotations at once: the free motion of a body with two or three equal moments, or spinning about a
//! principal axis.
//!
//! ```text
//! q(t) = q₀ exp(a m₀ t) exp(λ e_k t),   m(t) = exp(−λ e_k t) m₀
//! ```
//!
//! in principal axes, with m₀ the angular momentum at the start, k the axis of symmetry, a the mean inverse moment across it
//! and λ = (1/I_k − a) m₀·e_k (L. D. Landau, E. M. Lifshitz, *Mechanics*, § 33, equations 33.3 and 33.4, there with
//! angles). The first factor is the precession about the fixed angular momentum, the second the spin about the axis. With
//! equal moments, or a spin along an axis, λ = 0.
//!
//! The set-up is in double-double arithmetic and angles are integers of a turn ([`crate::math::phase`]), as in
//! [`crate::kernel::free_motion`], whose limiting cases these are at a tenth of its cost; the error does not grow with time.

use glam::{DQuat, DVec3};

use crate::bodies::Ensemble;
use crate::bodies::{BodyFrame, BodyState};
use crate::kernel::free_motion::{SetUp, scaled_body};
use crate::math::double_double::DoubleDouble;
use crate::math::elementary::{power_of_two, sin_cos_turns};
use crate::math::phase::{Rate, Time, fraction_from_turns, phase_at, phase_turns};
use crate::plan::class::{FreeBody, Shape};

/// The motion of one body, in units of its own scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RegularPrecession {
    frame: BodyFrame,
    orientation: DQuat,
    angular_momentum_principal: DVec3,
    direction: DVec3,
    spin_axis: DVec3,
    /// Rates of half the angles: of the precession and of the spin.
    half_rates: [Rate; 2],
}

/// Rates of half angles are below 2^`HEADROOM` turns per unit of time: a body's spin is below 2√3 in its own units, and
/// λ is at most as great as the spin about the axis.
const HEADROOM: i32 = 1;

/// 1/4π.
const HALF_TURNS: (f64, f64) = (0.5 * 0.15915494309189535, -0.5 * 9.839338337591243e-18);

impl RegularPrecession {
    /// The motion of a body of an ensemble in a class simpler than [`Shape::Asymmetric`], over `span` seconds; a body near
    /// the class moves as the nearest member does.
    ///
    /// # Panics
    ///
    /// Where the ensemble has no such body.
    pub fn of_body(ensemble: &Ensemble, body: usize, shape: Shape, span: f64) -> Self {
        type Dd = DoubleDouble;
        let (frame, initial) = scaled_body(ensemble, body, SetUp::TwoWords);
        let momentum: [Dd; 3] = std::array::from_fn(|axis| initial.moments[axis] * initial.angular_velocity[axis]);
        let m = DVec3::from_array(momentum.map(Dd::to_f64));
        let length = (momentum[0].squared() + momentum[1].squared() + momentum[2].squared()).sqrt();
        let unit = crate::math::power_of_two::scaled_by_power_of_two(1.0, frame.rate_exponent);
        let free = FreeBody { moments: frame.scaled_moments, angular_momentum_principal: m, span: span * unit };
        let axis = free.bound(shape).axis;

        let inverse = initial.moments.map(|moment| Dd::from(1.0) / moment);
        let (inverse_moment, spin_rate) = match shape {
            Shape::AtRest => (Dd::from(0.0), Dd::from(0.0)),
            Shape::Spherical | Shape::Steady => (inverse[axis], Dd::from(0.0)),
            Shape::Axisymmetric | Shape::Asymmetric => {
                let across = (inverse[(axis + 1) % 3] + inverse[(axis + 2) % 3]).scaled(0.5);
                (across, (inverse[axis] - across) * momentum[axis])
            }
        };
        let rate = |radians: Dd| {
            let turns = (radians * Dd::splat(HALF_TURNS.0, HALF_TURNS.1)).scaled(power_of_two(-HEADROOM));
            let (fraction, negative) = fraction_from_turns(turns.high, turns.low);
            Rate { fraction, exponent: frame.rate_exponent + HEADROOM, negative }
        };
        let precession = if m == DVec3::ZERO { Dd::from(0.0) } else { length * inverse_moment };
        let q = initial.orientation;
        Self {
            frame,
            orientation: DQuat::from_xyzw(q.x, q.y, q.z, q.w),
            angular_momentum_principal: m,
            direction: if m == DVec3::ZERO { DVec3::X } else { m / length.to_f64() },
            spin_axis: DVec3::AXES[axis],
            half_rates: [rate(precession), rate(spin_rate)],
        }
    }

    /// The state at `time` seconds, which must be finite.
    pub fn at(&self, time: f64) -> BodyState {
        let time = Time::from_seconds(time);
        let [precession, spin] = self.half_rates;
        let precession = turned(self.direction, phase_at(0, precession, time));
        let spin = turned(self.spin_axis, phase_at(0, spin, time));
        let q = self.orientation * precession * spin;
        let m = spin.conjugate() * self.angular_momentum_principal;
        self.frame.body_state([q.x, q.y, q.z, q.w, m.x, m.y, m.z])
    }
}

/// The rotation about a unit vector whose half angle is a phase.
fn turned(axis: DVec3, half_angle: u64) -> DQuat {
    let (sin, cos) = sin_cos_turns(phase_turns::<f64>(half_angle));
    let v = axis * sin;
    DQuat::from_xyzw(v.x, v.y, v.z, cos)
}
