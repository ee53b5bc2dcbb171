//! What a linear rotor does not take of a torque. Its line in WGSL is written by `shader.rs`.
//!
//! A linear rotor (moments 0, I, I) has no spin about its axis and nothing for a torque about it to act upon. The kernels
//! integrate it as a body with the moments I, I, I and no spin about the axis: m × ω vanishes for both, and as long as no
//! torque acts about the axis none arises. The sum of the torques is therefore projected across the axis, which is the first
//! principal one. That takes no power from the rotor, as ω has no part along the axis. Torques that follow from
//! the tensor (the gravity gradient) read the true one.
//!
//! This is no model that a scene names: a table has its column where one of its bodies is a linear rotor.

use super::formula::{Column, Epoch, Formula, Role, Row};
use crate::math::quaternion::Quaternion;
use crate::math::real::Real;
use crate::math::vector::Vector;

/// The torque in principal axes with its part along the first one multiplied by `factor`: 0 for a linear rotor, 1 for
/// another body.
#[inline(always)]
pub fn across_axis<R: Real>(factor: R, torque: Vector<R>) -> Vector<R> {
    Vector::new(factor * torque.x, torque.y, torque.z)
}

/// Beside the sum of the torques on it, which it projects.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LinearRotor;

impl Formula for LinearRotor {
    const STEM: &'static str = "linear_rotor";
    const COLUMNS: &'static [Column] = &[Column::number("factor")];
    const ROLE: Role = Role::Projection;

    #[inline(always)]
    fn torque<R: Real>(_: &impl Row<R>, _: &Epoch<R>, _: Quaternion<R>, _: Vector<R>) -> Vector<R> {
        Vector::zero()
    }
}
