//! Adaptive `rk8` on tiles, whose lanes are given to other bodies as theirs arrive.

use std::sync::atomic::Ordering;

use super::{Rk8, Tile, TileSlopes};
use crate::bodies::columns::status_column;
use crate::engine::batch::{load_body, load_state};
use crate::engine::cpu::adaptive::{Block as AdaptiveBlock, LEFT, load_controller};
use crate::engine::cpu::seats::{Seating, lanes_in};
use crate::kernel::method::rk8::TIMES;
use crate::kernel::method::rk8_adaptive::{Controller, Limits, Trial};
use crate::math::lanes::{Each, GROUPS, LaneScalar, LaneTask};
use crate::math::real::{Real, Scalar, outlined};
use crate::math::vector::TwoWords;
use crate::torque::tile::{TileTime, gathered};

/// Makes the attempts of a block; returns whether any body is still under way.
pub(in crate::engine::cpu) fn attempts_in_tiles<T: LaneScalar>(block: AdaptiveBlock<'_, '_, T>) -> bool {
    T::dispatch(Attempts(block))
}

struct Attempts<'a, 'b, T>(AdaptiveBlock<'a, 'b, T>);

/// The lane groups of a tile and the rows of a block that are in them. A lane whose body has arrived takes the next row that has not:
/// otherwise lanes would wait for the slowest of those beside them.
struct Seats<R: Real> {
    seats: [Seating; GROUPS],
    controllers: Each<Controller<R>>,
    spans: Each<TwoWords<R>>,
    limits: Each<Limits<R>>,
    /// Attempts of lanes without work since lanes were last reassigned.
    idle: [usize; GROUPS],
    /// The first row that has not been considered.
    next: usize,
}

impl<T: Scalar> AdaptiveBlock<'_, '_, T> {
    /// Whether there is something left to do in a row.
    fn is_under_way(&self, row: usize) -> bool {
        let left = self.controllers[LEFT.start][row].to_f64();
        left > 0.0 && self.state[status_column::<T>()][row].to_f64() < 0.5
    }

    /// Gives the lanes of a group whose bodies have arrived to bodies that have not.
    #[inline(always)]
    fn fill<R: Real<Scalar = T>>(&mut self, tile: &mut Tile<'_, R>, seats: &mut Seats<R>, group: usize) {
        self.put_back(&seats.seats[group], &tile.state[group], &seats.controllers[group]);
        // Bodies that are not rigid read adjacent columns.
        let is_rigid = self.source.table.is_rigid();
        seats.seats[group].reassign(R::LANES, is_rigid, self.bodies, &mut seats.next, |row| self.is_under_way(row));
        self.load(tile, seats, group);
    }

    #[inline(always)]
    fn load<R: Real<Scalar = T>>(&mut self, tile: &mut Tile<'_, R>, seats: &mut Seats<R>, group: usize) {
        let (source, mut rows) = (self.source, seats.seats[group].rows);
        tile.state[group] = load_state(|column| gathered(self.state[column], &rows));
        let mut controller = load_controller(|column| gathered(self.controllers[column], &rows));
        let taken: R = seats.seats[group].occupied();
        controller.left = TwoWords { value: controller.left.value * taken, residue: controller.left.residue * taken };
        seats.controllers[group] = controller;
        for row in &mut rows {
            *row += self.first;
        }
        let (body, rate) = load_body(|column| gathered(&source.parameters[column * source.stride..], &rows));
        tile.body[group] = body;
        seats.spans[group] = self.span.times(rate);
        seats.limits[group] = self.steps.limits(rate);
        tile.torques.load_rows(group, &rows);
    }
}

impl<T: Scalar> LaneTask<T> for Attempts<'_, '_, T> {
    type Output = bool;
    const IN_LANES_ONLY: bool = true;

    #[inline(always)]
    fn run<R: Real<Scalar = T>>(self) -> bool {
        let Self(mut block) = self;
        let mut tile = Tile::<R>::new(block.source);
        if block.starts {
            block.start_all();
        }
        let none = Limits { tolerance: R::splat(1.0), least_step: R::splat(1.0) };
        let mut seats = Seats {
            seats: [Seating::default(); GROUPS],
            controllers: Each([Controller::new(); GROUPS]),
            spans: tile.h,
            limits: Each([none; GROUPS]),
            idle: [0; GROUPS],
            next: 0,
        };
        let is_rigid = block.source.table.is_rigid();
        let mut slots = 0;
        for _ in 0..block.attempts {
            tile.active = 0;
            for group in 0..GROUPS {
                let mut under_way = seats.controllers[group].under_way(&tile.state[group]);
                // Reassigning lanes costs a part of an attempt of the whole group, so it waits until idle lanes have
                // lost as much. Bodies that are not rigid are replaced all together.
                if seats.next < block.bodies {
                    seats.idle[group] += R::LANES - lanes_in::<R>(under_way);
                }
                let is_due = is_rigid && 2 * seats.idle[group] >= R::LANES;
                if seats.next < block.bodies && (is_due || !R::any(under_way)) {
                    outlined!(R, block.fill(&mut tile, &mut seats, group));
                    seats.idle[group] = 0;
                    under_way = seats.controllers[group].under_way(&tile.state[group]);
                }
                if R::any(under_way) {
                    tile.groups[tile.active % GROUPS] = group;
                    tile.active += 1;
                }
            }
            if tile.active == 0 {
                break;
            }
            slots += tile.active * R::LANES;
            let mut gone = seats.spans;
            let mut trials = [None; GROUPS];
            for group in tile.active() {
                let (body, state) = (&tile.body[group], &tile.state[group]);
                let trial =
                    Trial::new(body, seats.spans[group], &seats.limits[group], &seats.controllers[group], state);
                (tile.h[group], gone[group]) = (trial.h, trial.gone);
                trials[group] = Some(trial);
            }
            tile.start(TileTime::Own(&gone));
            for (stage, &fraction) in TIMES.iter().enumerate() {
                // A loop, as closures that the standard library calls are not compiled for the lanes.
                let mut elapsed = Each([R::splat(0.0); GROUPS]);
                for group in tile.active() {
                    elapsed[group] = tile.h[group].value * R::splat(fraction);
                }
                tile.torques.at(&elapsed, &tile.groups[..tile.active.min(GROUPS)]);
                tile.stage::<Rk8>(stage);
            }
            for group in tile.active() {
                let slopes = TileSlopes { slopes: &tile.slopes, group };
                if let Some(trial) = &trials[group] {
                    (tile.state[group], seats.controllers[group]) =
                        trial.concluded(&slopes, &seats.limits[group], seats.controllers[group], tile.state[group]);
                }
            }
        }
        for group in 0..GROUPS {
            block.put_back(&seats.seats[group], &tile.state[group], &seats.controllers[group]);
        }
        block.slots.fetch_add(slots as u64, Ordering::Relaxed);
        (0..block.bodies).any(|row| block.is_under_way(row))
    }
}
