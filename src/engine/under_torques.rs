//! The sum of torques of a batch in an arithmetic of the caller's own, for tests of orders.

use crate::engine::batch::Batch;
use crate::kernel::method::rk8_adaptive::Timed;
use crate::kernel::torque_kernel::Free;
use crate::math::real::Scalar;
use crate::torque::sum::{Common, Source, Torques};

/// Work under the torques that act on one body.
pub trait UnderTorques<T: Scalar> {
    /// What the work returns.
    type Output;
    /// Does the work.
    fn run<E: Timed<T>>(self, torques: &E) -> Self::Output;
}

/// Does some work under the torques that act on body `body` of a batch, in equal steps of `dt` s from the batch's time
/// on. They are summed from the batch's columns as kernels sum them, in an arithmetic that may have more digits than
/// the columns: only then do orders above 4 show over five halvings of a step.
pub fn under_torques<T: Scalar, W: UnderTorques<T>>(batch: &Batch<f64>, body: usize, dt: f64, work: W) -> W::Output {
    let table = &batch.torques;
    if table.is_empty() {
        return work.run(&Free);
    }
    let parameters: Vec<T> = batch.parameters.iter().map(|&number| T::from_f64(number)).collect();
    let source = Source { table, parameters: &parameters, stride: batch.stride, clock: table.clock(), dt };
    let workspace = source.workspace::<T>();
    let columns = source.group::<T>(body, &workspace);
    if table.is_common() { work.run(&Common::load(&columns)) } else { work.run(&Torques::new(columns)) }
}
