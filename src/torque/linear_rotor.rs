//! Removes the part of a torque that a linear rotor cannot feel. Its line in WGSL is written by `shader.rs`.
//!
//! A linear rotor (moments 0, I, I) has no spin about its axis, and a torque about it has no effect. The kernels integrate it as a body
//! with the moments I, I, I and no spin about the axis: m × ω vanishes for both, and as long as no torque acts about the axis no spin
//! arises. The sum of the torques is therefore projected across the axis, which is the first principal one. This removes no power from the
//! rotor, as ω has no component along the axis. Torques that follow from the tensor (the gravity gradient) read the true one.
//!
//! This is not a model that a scene names: a table has its column if one of its bodies is a linear rotor.

use super::formula::{Column, Formula, Role};
use crate::math::real::Real;
use crate::math::vector::Vector;

/// The torque in principal axes with its part along the first one multiplied by `factor`: 0 for a linear rotor, 1 for
/// another body.
#[inline(always)]
pub(crate) fn across_axis<R: Real>(factor: R, torque: Vector<R>) -> Vector<R> {
    Vector::new(factor * torque.x, torque.y, torque.z)
}

/// Listed with the torques, whose sum it projects.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LinearRotor;

impl Formula for LinearRotor {
    const STEM: &'static str = "linear_rotor";
    const COLUMNS: &'static [Column] = &[Column::number("factor")];
    const ROLE: Role = Role::Projection;
}
