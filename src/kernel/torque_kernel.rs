//! The interface between integrators and torques: a sum of torques that they evaluate.

use crate::kernel::method::projection::{Combinations, projected};
use crate::kernel::rigid_body::{Body, Correction, State};
use crate::math::quaternion::Quaternion;
use crate::math::real::Real;
use crate::math::vector::Vector;

/// How a torque depends on the angular velocity, which decides how a splitting kicks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum VelocityDependence {
    /// It does not: at a frozen attitude the torque is constant.
    None,
    /// As τ₀ − c ω with one coefficient c ≥ 0 for all axes: the flow at a frozen attitude is an exponential.
    LinearDrag,
    /// In any other way: the flow at a frozen attitude must be integrated.
    General,
}

/// All torques of a scene, as they act on one body (or lane group).
pub trait TorqueKernel<R: Real>: Copy {
    /// What is formed once for all evaluations in a step.
    type Start: Copy;

    /// What depends only on time, formed once for all evaluations at that time. It is valid as long as its step's start is.
    type Epoch: Copy;

    /// Whether there is no torque at all, so that the kernel leaves it out.
    const FREE: bool;

    /// The start of step `step` of the current interval. It is valid until the next one is formed.
    fn start(&self, step: u64) -> Self::Start;

    /// What depends only on time, `fraction` of a step after its start.
    fn epoch(&self, start: &Self::Start, fraction: f64) -> Self::Epoch;

    /// The torque in principal axes, in units of the body's own scale.
    fn torque(
        &self,
        epoch: &Self::Epoch,
        body: &Body<R>,
        orientation: Quaternion<R>,
        angular_velocity_principal: Vector<R>,
    ) -> Vector<R>;

    /// How the torque depends on the angular velocity. `General` is right for every torque and costs the most.
    #[inline(always)]
    fn velocity_dependence(&self) -> VelocityDependence {
        VelocityDependence::General
    }

    /// The coefficient c of the part −c ω, in units of the body's own scale; read only for [`VelocityDependence::LinearDrag`].
    #[inline(always)]
    fn drag_coefficient(&self) -> R {
        R::splat(0.0)
    }

    /// The state after a step, projected onto what the body conserves if the kernel does so.
    #[inline(always)]
    fn projected(&self, _: &Body<R>, state: State<R>) -> State<R> {
        state
    }

    /// How the body turns at an angular momentum m in principal axes. A method that does not call this can integrate rigid bodies only.
    #[inline(always)]
    fn motion(&self, _: &Self::Epoch, body: &Body<R>, correction: &Correction<R>, m: Vector<R>) -> Motion<R> {
        Motion::rigid(body.angular_velocity(m, correction), body.gyroscopic_term(m, correction))
    }
}

/// How a body turns at an angular momentum m.
#[derive(Clone, Copy, Debug)]
pub struct Motion<R> {
    /// ω = I⁻¹ m, which torques read, in principal axes.
    pub angular_velocity: Vector<R>,
    /// The rate at which its axes turn: ω if the body is rigid.
    pub axes_rate: Vector<R>,
    /// m × the rate of the axes.
    pub gyroscopic_term: Vector<R>,
}

impl<R: Real> Motion<R> {
    /// Of a body whose axes turn at ω.
    #[inline(always)]
    pub fn rigid(angular_velocity: Vector<R>, gyroscopic_term: Vector<R>) -> Self {
        Self { angular_velocity, axes_rate: angular_velocity, gyroscopic_term }
    }

    /// The same with axes that turn faster by `slip`.
    #[inline(always)]
    pub(crate) fn with_slip(self, m: Vector<R>, slip: Vector<R>) -> Self {
        Self { axes_rate: self.angular_velocity + slip, gyroscopic_term: self.gyroscopic_term + m.cross(slip), ..self }
    }
}

/// No torque.
#[derive(Clone, Copy, Debug)]
pub struct Free;

impl<R: Real> TorqueKernel<R> for Free {
    type Start = ();
    type Epoch = ();
    const FREE: bool = true;

    #[inline(always)]
    fn start(&self, _: u64) {}

    #[inline(always)]
    fn epoch(&self, (): &(), _: f64) {}

    #[inline(always)]
    fn torque(&self, _: &(), _: &Body<R>, _: Quaternion<R>, _: Vector<R>) -> Vector<R> {
        Vector::zero()
    }

    #[inline(always)]
    fn velocity_dependence(&self) -> VelocityDependence {
        VelocityDependence::None
    }
}

/// No torque, and the state projected onto what a free body conserves after each step.
#[derive(Clone, Copy, Debug)]
pub struct Conserving<R> {
    /// The combinations at the start.
    pub combinations: Combinations<R>,
}

impl<R: Real> TorqueKernel<R> for Conserving<R> {
    type Start = ();
    type Epoch = ();
    const FREE: bool = true;

    #[inline(always)]
    fn start(&self, _: u64) {}

    #[inline(always)]
    fn epoch(&self, (): &(), _: f64) {}

    #[inline(always)]
    fn torque(&self, _: &(), _: &Body<R>, _: Quaternion<R>, _: Vector<R>) -> Vector<R> {
        Vector::zero()
    }

    #[inline(always)]
    fn velocity_dependence(&self) -> VelocityDependence {
        VelocityDependence::None
    }

    #[inline(always)]
    fn projected(&self, body: &Body<R>, state: State<R>) -> State<R> {
        projected(body, &self.combinations, state)
    }
}
