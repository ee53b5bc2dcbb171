//! Torque kernels as types: each is compiled into its own loops, without the torques that a scene does not have.

use crate::engine::batch::load_combinations;
use crate::kernel::method::rk8_adaptive::Timed;
use crate::kernel::torque_kernel::{Conserving, Free};
use crate::math::real::Real;
use crate::torque::sum::{Columns, Common, Torques};

/// Gives each lane group its torque kernel.
pub(super) trait LaneTorques {
    /// The torque kernel of one lane group.
    type At<'a, R: Real>: Timed<R>;
    /// The torque kernel of the lane group of some columns.
    fn at<R: Real>(columns: Columns<'_, R>) -> Self::At<'_, R>;
}

/// No torque.
pub(super) struct Nothing;

impl LaneTorques for Nothing {
    type At<'a, R: Real> = Free;
    #[inline(always)]
    fn at<R: Real>(_: Columns<'_, R>) -> Free {
        Free
    }
}

/// No torque, with the conserved quantities of a free body.
pub(super) struct Projected;

impl LaneTorques for Projected {
    type At<'a, R: Real> = Conserving<R>;
    #[inline(always)]
    fn at<R: Real>(columns: Columns<'_, R>) -> Conserving<R> {
        Conserving { combinations: load_combinations(|column| columns.column(column)) }
    }
}

/// A constant torque in body axes and linear drag.
pub(super) struct CommonTorques;

impl LaneTorques for CommonTorques {
    type At<'a, R: Real> = Common<R>;
    #[inline(always)]
    fn at<R: Real>(columns: Columns<'_, R>) -> Common<R> {
        Common::load(&columns)
    }
}

/// All torques of the scene.
pub(super) struct AllTorques;

impl LaneTorques for AllTorques {
    type At<'a, R: Real> = Torques<'a, R>;
    #[inline(always)]
    fn at<R: Real>(columns: Columns<'_, R>) -> Torques<'_, R> {
        Torques::new(columns)
    }
}
