//! Assigns rows of a block to the lanes of a tile: a lane whose body has arrived is given to another body.

use super::adaptive::{Block, LEFT, store_controller};
use crate::bodies::columns::RATE_COLUMN;
use crate::engine::batch::store_state;
use crate::kernel::method::rk8_adaptive::{Controller, renormalised};
use crate::kernel::rigid_body::State;
use crate::math::clock::MOST_LANES;
use crate::math::real::{Real, Scalar};
use crate::math::vector::two_difference;

/// The rows that are in the lanes of one lane group.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Seating {
    /// Rows of the block.
    pub rows: [usize; MOST_LANES],
    /// Lanes that hold a body.
    taken: [bool; MOST_LANES],
}

impl Seating {
    /// Gives the lanes whose bodies have arrived to the rows from `next` to `count`. Rows that are not under way are
    /// skipped one by one or, if the rows of a group must be adjacent (`may_skip` is false), a whole group at a time.
    #[inline(always)]
    pub fn reassign(
        &mut self,
        lanes: usize,
        may_skip: bool,
        count: usize,
        next: &mut usize,
        is_under_way: impl Fn(usize) -> bool,
    ) {
        let group = |first: usize| first..(first + lanes).min(count);
        while !may_skip && *next < count && !group(*next).any(&is_under_way) {
            *next += lanes;
        }
        for lane in 0..lanes {
            if self.taken[lane] && is_under_way(self.rows[lane]) {
                continue;
            }
            while may_skip && *next < count && !is_under_way(*next) {
                *next += 1;
            }
            self.taken[lane] = *next < count && is_under_way(*next);
            if *next < count {
                self.rows[lane] = *next;
                *next += 1;
            }
        }
    }

    /// 1 for each lane that holds a body, else 0.
    #[inline(always)]
    pub fn occupied<R: Real>(&self) -> R {
        let mut numbers = [R::Scalar::default(); MOST_LANES];
        for (number, taken) in numbers.iter_mut().zip(self.taken).take(R::LANES) {
            *number = R::Scalar::from_f64(if taken { 1.0 } else { 0.0 });
        }
        R::load(&numbers)
    }

    /// Writes the lanes that hold a body to their rows.
    #[inline(always)]
    pub fn scatter<R: Real>(&self, number: R, column: &mut [R::Scalar]) {
        let mut numbers = [R::Scalar::default(); MOST_LANES];
        number.store(&mut numbers);
        for lane in 0..R::LANES {
            if self.taken[lane] {
                column[self.rows[lane]] = numbers[lane];
            }
        }
    }
}

impl<T: Scalar> Block<'_, '_, T> {
    /// Sets the remainder of the interval at its start; bodies may be ahead of it. Rows without a body have the rate 0, so
    /// that their remainder is 0.
    pub fn start_all(&mut self) {
        let rates = &self.source.parameters[RATE_COLUMN * self.source.stride + self.first..];
        for (row, &rate) in rates.iter().enumerate().take(self.bodies) {
            let [ahead, residue] = [LEFT.start, LEFT.start + 1].map(|column| self.controllers[column][row]);
            let span = self.span.times(rate);
            let left = if ahead.to_f64() < 0.0 {
                let (value, error) = two_difference(span.value, -ahead);
                renormalised(value, error + (span.residue + residue))
            } else {
                span
            };
            self.controllers[LEFT.start][row] = left.value;
            self.controllers[LEFT.start + 1][row] = left.residue;
        }
    }

    /// Writes the bodies of a lane group back.
    #[inline(always)]
    pub fn put_back<R: Real<Scalar = T>>(&mut self, seats: &Seating, bodies: &State<R>, controller: &Controller<R>) {
        let (state, controllers) = (&mut *self.state, &mut *self.controllers);
        store_state(bodies, |column, number: R| seats.scatter(number, state[column]));
        store_controller(controller, |column, number: R| seats.scatter(number, controllers[column]));
    }
}

/// The number of lanes in a mask.
#[inline(always)]
pub(super) fn lanes_in<R: Real>(mask: R::Mask) -> usize {
    let mut numbers = [R::Scalar::default(); MOST_LANES];
    R::select(mask, R::splat(1.0), R::splat(0.0)).store(&mut numbers);
    let mut count = 0.0;
    for number in &numbers[..R::LANES] {
        count += number.to_f64();
    }
    count as usize
}
