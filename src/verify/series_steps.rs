//! Steps by Taylor series between two controllers, and how far apart two sides may form them.
//!
//! A step follows from the last coefficients. Under stiff damping these are small differences of large numbers, and rounding decides more of
//! them than of a step. How much is found by trial: the twin starts from states that are some roundings off.

use super::attempts::{Kernel, Moment};
use super::subject::TWIN;
use crate::engine::batch::AnyBatch;
use crate::engine::cpu::Cpu;
use crate::error::Result;
use crate::kernel::method::Method;
use crate::kernel::method::rk8_adaptive::Controller;
use crate::math::vector::TwoWords;

/// The greatest relative difference of steps whose last coefficients do not cancel.
const SERIES_STEP: f64 = 1e-6;
/// How far off a start is, relative to each number.
const NUDGE: f64 = 8.0 * f64::EPSILON;
/// How many times the scatter of such starts two sides may be apart. Observed is up to 0.8 of it (eddy currents and friction, three scenes).
const OF_SCATTER: f64 = 4.0;

/// The decrease of the remaining interval: for nearby numbers the differences are exact.
pub(super) fn gone(before: &TwoWords<f64>, after: &TwoWords<f64>) -> f64 {
    (before.value - after.value) + (before.residue - after.residue)
}

/// The step between two controllers, or what remained for the attitude to be brought through.
pub(super) fn series_step(before: &Controller<f64>, after: &Controller<f64>) -> f64 {
    gone(&before.left, &after.left).max(before.retried)
}

/// How far apart two steps may be, one of which is `h`.
pub(super) fn allowed(h: f64, scatter: f64) -> f64 {
    (SERIES_STEP * h).max(OF_SCATTER * scatter)
}

/// By row, how far apart the twin's steps are for starts that differ by some roundings; 0 if no side is further from the twin than usual, and
/// for other methods.
pub(super) fn scatter(
    kernel: Kernel,
    twin: &AnyBatch,
    (moment, expected): (&Moment, &Moment),
    sides: &[Moment],
) -> Result<Vec<f64>> {
    let step = |row: usize, after: &Moment| series_step(&moment.controllers[row], &after.controllers[row]);
    let apart = |row: usize, after: &Moment| (step(row, after) - step(row, expected)).abs();
    let rows = 0..moment.controllers.len();
    let is_usual = |row: usize| sides.iter().all(|side| apart(row, side) <= allowed(step(row, expected), 0.0));
    let mut scatter = vec![0.0_f64; rows.len()];
    if kernel.method != Method::Taylor || rows.clone().all(is_usual) {
        return Ok(scatter);
    }
    for nudge in [NUDGE, -NUDGE] {
        let mut off = moment.clone();
        for (component, number) in off.states.value.iter_mut().flat_map(|row| row.iter_mut().enumerate()) {
            *number *= 1.0 + if component % 2 == 0 { nudge } else { -nudge };
        }
        let after = kernel.attempt(&Cpu::new(TWIN), twin, &off)?;
        for row in rows.clone() {
            scatter[row] = scatter[row].max(apart(row, &after));
        }
    }
    Ok(scatter)
}
