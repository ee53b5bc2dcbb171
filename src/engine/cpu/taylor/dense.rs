//! Dense output: steps go beyond the end of the interval, where the states are those of their series.
//!
//! Where outputs are closer together than steps, a step that ended at each would cost as much as a long one. Here steps have their own
//! lengths, the series of the last one of each body is kept, and an output costs an evaluation. The series of (q, m) are those of the step
//! itself, so that the error of an output is that of a step at most. `left` of a body that is ahead is negative. A body's steps depend on
//! neither the outputs nor on other bodies.

use super::super::adaptive::{Block, LEFT};
use super::{TaylorMotion, Tile};
use crate::bodies::columns::{STATE_COMPONENTS, state_columns};
use crate::engine::batch::{load_state, store_state};
use crate::kernel::method::taylor::order_of;
use crate::kernel::rigid_body::State;
use crate::math::clock::MOST_LANES;
use crate::math::quaternion::{Quaternion, norm_correction_of_step};
use crate::math::real::{Real, Scalar};
use crate::math::vector::Vector;

/// The most intervals that a step takes: a body at rest has no longest step, and what is left of one is carried in two words.
pub(super) const MOST_INTERVALS: f64 = 1024.0;

impl TaylorMotion {
    /// The count of numbers that are kept for a body.
    pub fn kept_columns(&self) -> usize {
        kept_columns(self.jets.order)
    }
}

/// The coefficients of (q, m) up to an order, and the step.
fn kept_columns(order: usize) -> usize {
    STATE_COMPONENTS * (order + 1) + 1
}

/// Bytes that are kept for a body at a tolerance, with the state at the end of its step.
pub(crate) fn kept_bytes(tolerance: f64) -> usize {
    (kept_columns(order_of(tolerance)) + state_columns::<f64>()) * size_of::<f64>()
}

/// The place of the first number of a row; its others follow at distances of [`MOST_LANES`], so that those of a lane group are together.
fn place(row: usize, columns: usize) -> usize {
    row / MOST_LANES * columns * MOST_LANES + row % MOST_LANES
}

/// Moves some of the rows, ascending, to the front.
pub(in crate::engine::cpu) fn keep_rows<T: Copy>(kept: &mut [T], columns: usize, rows: &[usize]) {
    for (to, &from) in rows.iter().enumerate() {
        let (to, from) = (place(to, columns), place(from, columns));
        for column in 0..columns {
            kept[to + column * MOST_LANES] = kept[from + column * MOST_LANES];
        }
    }
}

/// Keeps the series of those bodies of a lane group that have come to the end of the interval or beyond.
#[inline(always)]
pub(super) fn keep_series<R: Real, const G: usize>(
    block: &mut Block<'_, '_, R::Scalar>,
    tile: &Tile<'_, R, G>,
    group: usize,
    arrived: R::Mask,
) {
    let (motion, columns) = (tile.motion, tile.motion.kept_columns());
    let Some([x, y, z, w]) = motion.orientation else { return };
    let [a, b, c] = motion.momentum;
    let mut is_kept = [R::Scalar::default(); MOST_LANES];
    R::select(arrived, R::splat(1.0), R::splat(0.0)).store(&mut is_kept);
    let rows = &tile.seats[group].rows;
    let count = motion.jets.order + 1;
    let mut numbers = [R::Scalar::default(); MOST_LANES];
    let series = [x, y, z, w, a, b, c];
    for column in 0..columns {
        let (k, component) = (column / STATE_COMPONENTS, column % STATE_COMPONENTS);
        if k < count {
            tile.series.at(series[component], k)[group].store(&mut numbers);
        } else {
            tile.steps[group].store(&mut numbers);
        }
        for lane in 0..R::LANES {
            if is_kept[lane].to_f64() > 0.0 {
                block.kept[place(rows[lane], columns) + column * MOST_LANES] = numbers[lane];
            }
        }
    }
}

/// Forms the states of all bodies of a block at the end of the interval.
#[inline(always)]
pub(super) fn evaluate<R: Real>(block: &mut Block<'_, '_, R::Scalar>, motion: &TaylorMotion) {
    let (columns, order) = (motion.kept_columns(), motion.jets.order);
    for offset in (0..block.bodies).step_by(R::LANES) {
        let kept = &block.kept[place(offset, columns)..];
        let step = R::load(&kept[(columns - 1) * MOST_LANES..]);
        let left = R::load(&block.controllers[LEFT.start][offset..]);
        let residue = R::load(&block.controllers[LEFT.start + 1][offset..]);
        let since = step + left + residue;
        // Horner's sums of all components side by side, as each waits for its own last operation.
        let mut start = [R::splat(0.0); STATE_COMPONENTS];
        let mut change = [R::splat(0.0); STATE_COMPONENTS];
        for k in (1..order + 1).rev() {
            let numbers = &kept[k * STATE_COMPONENTS * MOST_LANES..][..STATE_COMPONENTS * MOST_LANES];
            for component in 0..STATE_COMPONENTS {
                change[component] = change[component].mul_add(since, R::load(&numbers[component * MOST_LANES..]));
            }
        }
        for component in 0..STATE_COMPONENTS {
            start[component] = R::load(&kept[component * MOST_LANES..]);
            change[component] = change[component] * since;
        }
        let [x, y, z, w, a, b, c] = start;
        let (q, m) = (Quaternion::new(x, y, z, w), Vector::new(a, b, c));
        let [x, y, z, w, a, b, c] = change;
        let (q_change, m_change) = (Quaternion::new(x, y, z, w), Vector::new(a, b, c));
        let correction = norm_correction_of_step(q, q + q_change);
        let ahead: State<R> = load_state(|column| R::load(&block.state[column][offset..]));
        // A body that has failed stays where it was.
        let is_sound = ahead.status.less_than(R::splat(0.5));
        let mut state = ahead;
        let (own_q, own_m) = (&mut state.orientation.value, &mut state.angular_momentum_principal.value);
        *own_q = Quaternion::select(is_sound, q + (q_change + correction), *own_q);
        *own_m = Vector::select(is_sound, m + m_change, *own_m);
        store_state(&state, |column, number: R| number.store(&mut block.outputs[column][offset..]));
    }
}
