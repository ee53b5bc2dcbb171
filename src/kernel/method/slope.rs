//! What the Runge-Kutta methods on (q, m) share: rates, and dt/6.

use crate::kernel::rigid_body::{Body, Correction, orientation_rate};
use crate::kernel::torque_kernel::TorqueKernel;
use crate::math::quaternion::Quaternion;
use crate::math::real::{Real, Scalar};
use crate::math::vector::{TwoWords, Vector};

/// A rate of change of the state.
#[derive(Clone, Copy, Debug)]
pub struct Slope<R> {
    /// dq/dt.
    pub q: Quaternion<R>,
    /// dm/dt.
    pub m: Vector<R>,
}

/// The rate at which a body turns, and the rate of its angular momentum.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Turn<R> {
    pub omega: Vector<R>,
    /// dm/dt.
    pub m: Vector<R>,
}

/// The rate at which a body turns, and dm/dt.
#[inline(always)]
pub(crate) fn turn<R: Real, E: TorqueKernel<R>>(
    body: &Body<R>,
    torques: &E,
    epoch: &E::Epoch,
    correction: &Correction<R>,
    q: Quaternion<R>,
    m: Vector<R>,
) -> Turn<R> {
    let motion = torques.motion(epoch, body, correction, m);
    let mut m_rate = motion.gyroscopic_term;
    if !E::FREE {
        m_rate = m_rate + torques.torque(epoch, body, q, motion.angular_velocity);
    }
    Turn { omega: motion.axes_rate, m: m_rate }
}

/// dq/dt and dm/dt.
#[inline(always)]
pub fn rates<R: Real, E: TorqueKernel<R>>(
    body: &Body<R>,
    torques: &E,
    epoch: &E::Epoch,
    correction: &Correction<R>,
    q: Quaternion<R>,
    m: Vector<R>,
) -> Slope<R> {
    let turn = turn(body, torques, epoch, correction, q, m);
    Slope { q: orientation_rate(q, turn.omega), m: turn.m }
}

/// dt/6 rounded, and the difference between dt and six times that.
///
/// dt/6 is never a machine number. Weighted by the sum of four slopes its rounding would stretch time by up to 6e-8;
/// the difference is instead added once, with the slope at the middle of the step. Both subtractions are exact.
#[inline(always)]
pub fn sixth_of<R: Real>(dt: TwoWords<R>) -> TwoWords<R> {
    let sixth = dt.value * R::splat(1.0 / 6.0);
    if R::Scalar::WORDS == 1 {
        return TwoWords { value: sixth, residue: R::splat(0.0) };
    }
    let lacking = (dt.value - R::splat(4.0) * sixth) - R::splat(2.0) * sixth;
    TwoWords { value: sixth, residue: lacking + dt.residue }
}
