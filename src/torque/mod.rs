//! Torques: what acts on a body besides its own inertia.
//!
//! Integrators are generic over an [`Environment`]; [`Free`] is the one without torques, and with it no torque code is
//! compiled into a kernel. The WGSL twin of an environment is one chunk that defines `torque` (`shaders/torque/`).

use crate::quaternion::Quaternion;
use crate::real::Real;
use crate::rigid_body::Body;
use crate::vector::Vector;

/// All torques of a scene as one body (or lane group) feels them.
pub trait Environment<R: Real>: Copy {
    /// What depends on time alone, formed once for all evaluations at that time.
    type Epoch: Copy;

    /// Whether there is no torque at all, so that the kernel leaves it out.
    const FREE: bool;

    /// What depends on time alone, `fraction` of a step after the start of step `step` of the current interval.
    fn epoch(&self, step: u64, fraction: f64) -> Self::Epoch;

    /// The torque in principal axes, in units of the body's own scale.
    fn torque(
        &self,
        epoch: &Self::Epoch,
        body: &Body<R>,
        orientation: Quaternion<R>,
        angular_velocity_principal: Vector<R>,
    ) -> Vector<R>;
}

/// No torque.
#[derive(Clone, Copy, Debug)]
pub struct Free;

impl<R: Real> Environment<R> for Free {
    type Epoch = ();
    const FREE: bool = true;

    #[inline(always)]
    fn epoch(&self, _: u64, _: f64) {}

    #[inline(always)]
    fn torque(&self, _: &(), _: &Body<R>, _: Quaternion<R>, _: Vector<R>) -> Vector<R> {
        Vector::zero()
    }
}
