//! [`crate::kernel::method::taylor`] on tiles, whose lanes are given to other bodies as theirs arrive.

mod branch;
mod centre;
mod dense;
mod step;

use std::sync::atomic::Ordering;

use super::adaptive::{Block, CONTROLLER_COLUMNS, LEFT, load_controller};
use super::seats::{Seating, lanes_in};
use crate::bodies::columns::{RATE_COLUMN, status_column};
use crate::engine::batch::load_state;
use crate::error::{Error, Result};
use crate::expression::jet::{FADED, Jets, Place, Series};
use crate::expression::{Fault, Input, InputKind, Scratch};
use crate::kernel::method::Method;
use crate::kernel::method::rk8_adaptive::Controller;
use crate::kernel::method::taylor::{StepLength, TwoSided, half_order_of, order_of};
use crate::kernel::rigid_body::State;
use crate::math::clock::MOST_LANES;
use crate::math::lanes::{Each, LaneScalar, LaneTask};
use crate::math::quaternion::Quaternion;
use crate::math::real::{Real, Scalar, outlined};
use crate::math::vector::{TwoWords, Vector};
use crate::scene::AdaptiveSteps;
use crate::torque::motion::RecordedMotion;
use crate::torque::sum::Source;
use crate::torque::tile::gathered;
use crate::torque::{PER_TICK, TorqueTable};
use branch::{SWITCH_MEASURES, finish};
use centre::{CentreRows, CentreState};
pub(super) use dense::keep_rows;
pub(crate) use dense::kept_bytes;
use dense::{evaluate, keep_series};
use step::{bound_attitudes, conclude, start};

/// The controller's column of the pending step: the attitude has not yet been brought to its end ([`TwoSided`]).
const PENDING: usize = 3;
// The controller's step, which series do not need, counts steps that end where a number changes its sign ([`Tile::at_least`]).

/// How well the series of a power must show its growth, relative to itself, so that no step passes a pulse of it.
const GROWTH_SHOWN: f64 = 1e-2;

/// A row that advances evenly with time.
#[derive(Clone, Copy, Debug)]
struct Advancing {
    place: Place,
    /// Its number among the phases; the time comes after them.
    number: usize,
    /// The column of its rate per second; `None` for the time.
    rate_column: Option<usize>,
    /// The column of a ramp's progress per tick.
    per_tick: Option<usize>,
}

/// What all steps of a session share.
#[derive(Debug)]
pub(super) struct TaylorMotion {
    jets: Jets,
    momentum: [Place; 3],
    /// Rows of the orientation, if a torque reads it.
    orientation: Option<[Place; 4]>,
    angular_velocity: [Place; 3],
    /// Rows of the centre of mass, if a torque reads it.
    centre: Option<CentreRows>,
    /// Vectors of the world in body axes that are states in place of the orientation; each that turns is followed by
    /// its partner.
    directions: Vec<[Place; 3]>,
    /// The rows with which the angles of those that turn advance, by the number of the state.
    turns: Vec<Option<Place>>,
    advancing: Vec<Advancing>,
    length: StepLength,
    /// That of powers that may fade, relative to themselves, and between which magnitudes it holds.
    fading_length: StepLength,
    seen: [f64; 2],
    /// Those of the deciding numbers, relative to their first terms.
    switch_lengths: [StepLength; SWITCH_MEASURES],
    two_sided: TwoSided,
    steps: AdaptiveSteps,
    /// Whether steps go beyond the interval, at whose end the series are evaluated ([`dense`]).
    is_dense: bool,
}

impl TaylorMotion {
    /// The motion under the torques of a table; dense output needs the attitude's own series.
    ///
    /// # Errors
    ///
    /// [`Error::MethodUnavailable`] where a formula has no Taylor series.
    pub fn new(table: &TorqueTable, steps: AdaptiveSteps, is_dense: bool) -> Result<Self> {
        Self::recorded(table, steps, is_dense).map_err(|fault| Error::MethodUnavailable {
            method: Method::Taylor,
            expected: format!("a torque has no Taylor series: {fault}").into(),
        })
    }

    fn recorded(table: &TorqueTable, steps: AdaptiveSteps, is_dense: bool) -> std::result::Result<Self, Fault> {
        let motion = RecordedMotion::for_series(table)?;
        let order = order_of(steps.tolerance);
        let lowered = motion.lowered(is_dense)?;
        let jets = lowered.up_to(order);
        let state = |kind, part| jets.input(Input::new(kind, part)).ok_or(Fault::ForeignSymbol);
        let momentum = |part| state(InputKind::AngularMomentum, part);
        let part = |part| state(InputKind::Orientation, part);
        let orientation = if lowered.has_orientation { Some([part(0)?, part(1)?, part(2)?, part(3)?]) } else { None };
        let momentum = [momentum(0)?, momentum(1)?, momentum(2)?];
        let is_coupled = table.is_coupled();
        let centre = is_coupled.then(|| CentreRows::new(&jets, order, steps.tolerance)).transpose()?;
        let &[x, y, z] = &jets.outputs[..] else { return Err(Fault::ForeignSymbol) };
        let mut advancing = Vec::new();
        for &(input, place) in &jets.given {
            let number = match input.kind {
                InputKind::Phase => usize::from(input.index),
                InputKind::Time => table.phase_count(),
                _ => continue,
            };
            let owner = table
                .list()
                .iter()
                .find(|instance| (instance.first_phase..instance.first_phase + instance.phases).contains(&number));
            advancing.push(Advancing {
                place,
                number,
                rate_column: owner.map(|instance| instance.rate_column(number - instance.first_phase)),
                per_tick: table.ramp_of(number).map(|first| first + PER_TICK),
            });
        }
        let directions = jets.directions.iter().flat_map(|state| {
            let partner = state.turning.iter().map(|turning| turning.rows);
            std::iter::once(state.rows).chain(partner)
        });
        let turns = jets.directions.iter().map(|state| jets.input(state.turning?.angle.0)).collect();
        Ok(Self {
            momentum,
            orientation,
            angular_velocity: [x, y, z],
            centre,
            directions: directions.collect(),
            turns,
            advancing,
            length: StepLength::new(order, steps.tolerance),
            fading_length: StepLength::new(order, GROWTH_SHOWN),
            seen: [-FADED, FADED].map(f64::exp),
            switch_lengths: std::array::from_fn(|term| StepLength::new(order - 1 - term, steps.tolerance)),
            two_sided: TwoSided::new(half_order_of(order), steps.tolerance),
            steps,
            jets,
            is_dense,
        })
    }

    /// The count of numbers that are kept for a body beside its state.
    pub fn columns(&self) -> usize {
        3 * self.directions.len()
    }
}

/// Steps of a block in lanes; returns whether any body is still under way.
pub(super) fn steps_in_tiles<T: LaneScalar>(block: Block<'_, '_, T>) -> bool {
    match block.motion {
        Some(motion) => T::dispatch(Steps { block, motion }),
        None => false,
    }
}

/// The same one body at a time.
pub(super) fn steps_one_by_one<T: Scalar>(block: Block<'_, '_, T>) -> bool {
    match block.motion {
        Some(motion) => Steps { block, motion }.run::<T>(),
        None => false,
    }
}

/// Lane groups of a tile: with one it waits for its own sums, and the coefficients of four do not fit the first-level
/// cache.
const GROUPS: usize = 2;

struct Steps<'a, 'b, T> {
    block: Block<'a, 'b, T>,
    motion: &'a TaylorMotion,
}

/// The bodies of a tile and where they come from. A lane whose body has arrived takes the next row that has not.
struct Tile<'a, R: Real, const G: usize> {
    motion: &'a TaylorMotion,
    source: Source<'a, R::Scalar>,
    series: Series<R, G>,
    /// Memory for forming the factors of a lane group.
    scratch: Scratch<R, 1>,
    factors: Vec<Each<R, 1>>,
    /// Rows of the block, and the bodies in them.
    seats: [Seating; G],
    bodies: [[usize; MOST_LANES]; G],
    state: Each<State<R>, G>,
    centres: Each<CentreState<R>, G>,
    controllers: Each<Controller<R>, G>,
    spans: Each<TwoWords<R>, G>,
    /// The reference rate, 1/s, and its reciprocal.
    rate: Each<R, G>,
    seconds: Each<R, G>,
    least_step: Each<R, G>,
    /// For each row that advances with time, its rate in the body's own unit of time; and a ramp's progress per tick.
    rates: Vec<Each<R, G>>,
    per_tick: Each<R, G>,
    /// The directions at the start of a step; in the world (at the angle 0 for those that turn); and the reciprocals of
    /// their magnitudes.
    directions: Vec<Each<Vector<R>, G>>,
    worlds: Vec<Each<Vector<R>, G>>,
    inverse_scales: Vec<Each<R, G>>,
    /// The factor and the offset of the angle of each state that turns.
    angles: Vec<Each<[R; 2], G>>,
    /// The series of the attitude relative to the start of the step.
    relative: Vec<Each<Quaternion<R>, G>>,
    /// The norms of the angular velocity's coefficients, a majorant of the attitude's, and its last two coefficients.
    norms: Vec<Each<R, G>>,
    majorant: Vec<Each<R, G>>,
    bounds: [Each<R, G>; 2],
    /// Steps of lanes without work since lanes were last reassigned.
    idle: [usize; G],
    /// The first row that has not been considered.
    next: usize,
    /// The last steps.
    steps: Each<R, G>,
}

impl<'a, R: Real, const G: usize> Tile<'a, R, G> {
    #[inline(always)]
    fn new(motion: &'a TaylorMotion, source: Source<'a, R::Scalar>) -> Self {
        let (zero, one) = (R::splat(0.0), R::splat(1.0));
        let state = load_state(|_| zero);
        let words = TwoWords { value: zero, residue: zero };
        let jets = &motion.jets;
        Self {
            motion,
            source,
            series: Series::new(jets),
            scratch: Scratch::new(&jets.factors),
            factors: vec![Each::zero(); jets.factors.output_count()],
            seats: [Seating::default(); G],
            bodies: [[0; MOST_LANES]; G],
            state: Each([state; G]),
            centres: Each([CentreState::zero(); G]),
            controllers: Each([Controller::new(); G]),
            spans: Each([words; G]),
            rate: Each([one; G]),
            seconds: Each([one; G]),
            least_step: Each([one; G]),
            rates: vec![Each([zero; G]); motion.advancing.len()],
            per_tick: Each([zero; G]),
            directions: vec![Each([Vector::zero(); G]); motion.directions.len()],
            worlds: vec![Each([Vector::zero(); G]); motion.directions.len()],
            inverse_scales: vec![Each([zero; G]); motion.directions.len()],
            angles: vec![Each([[zero; 2]; G]); jets.directions.len()],
            relative: vec![Each([state.orientation.value; G]); motion.two_sided.half_order + 1],
            norms: vec![Each::zero(); 2 * motion.two_sided.half_order + 1],
            majorant: vec![Each::zero(); 2 * motion.two_sided.half_order + 2],
            bounds: [Each::zero(); 2],
            idle: [0; G],
            next: 0,
            steps: Each([zero; G]),
        }
    }

    /// Sets the directions in the world of a lane group's bodies from their factors.
    #[inline(always)]
    fn set_worlds(&mut self, group: usize) {
        let factors = &self.factors;
        let world = |numbers: [usize; 3]| {
            let [x, y, z] = numbers;
            Vector::new(factors[x][0], factors[y][0], factors[z][0])
        };
        let mut vector = 0;
        for (state, angles) in self.motion.jets.directions.iter().zip(&mut self.angles) {
            let own = world(state.world);
            self.worlds[vector][group] = own;
            let mut largest = own.largest();
            if let Some(turning) = &state.turning {
                let (_, factor, offset) = turning.angle;
                angles[group] = [factors[factor][0], factors[offset][0]];
                let ahead = world(turning.world);
                self.worlds[vector + 1][group] = ahead;
                largest = largest.max(ahead.largest());
            }
            // A vector of size zero has no error.
            let inverse = R::splat(1.0) / largest.max(R::splat(1e-290));
            for _ in 0..if state.turning.is_some() { 2 } else { 1 } {
                self.inverse_scales[vector][group] = inverse;
                vector += 1;
            }
        }
    }

    /// The lanes whose bodies are not finished.
    #[inline(always)]
    fn under_way(&self, group: usize) -> R::Mask {
        let Controller { left, retried: pending, .. } = self.controllers[group];
        R::splat(0.0).less_than(left.value.max(pending)) & self.state[group].status.less_than(R::splat(0.5))
    }
}

impl<T: Scalar> Block<'_, '_, T> {
    fn waits(&self, row: usize) -> bool {
        let (left, pending) = (self.controllers[LEFT.start][row].to_f64(), self.controllers[PENDING][row].to_f64());
        (left > 0.0 || pending > 0.0) && self.state[status_column::<T>()][row].to_f64() < 0.5
    }

    /// Gives the lanes of a group whose bodies have arrived to bodies that have not.
    #[inline(always)]
    fn reseat<R: Real<Scalar = T>, const G: usize>(&mut self, tile: &mut Tile<'_, R, G>, group: usize) {
        self.put_group_back(tile, group);
        tile.seats[group].reassign(R::LANES, true, self.bodies, &mut tile.next, |row| self.waits(row));
        self.seat(tile, group);
    }

    /// Writes the bodies of a lane group back.
    #[inline(always)]
    fn put_group_back<R: Real<Scalar = T>, const G: usize>(&mut self, tile: &Tile<'_, R, G>, group: usize) {
        let seats = &tile.seats[group];
        self.put_back(seats, &tile.state[group], &tile.controllers[group]);
        if tile.motion.centre.is_some() {
            self.store_centres(seats, &tile.centres[group]);
        }
        let columns = self.controllers[CONTROLLER_COLUMNS..].chunks_exact_mut(3);
        for (columns, direction) in columns.zip(&tile.directions) {
            let Vector { x, y, z } = direction[group];
            for (column, number) in columns.iter_mut().zip([x, y, z]) {
                seats.scatter(number, column);
            }
        }
    }

    #[inline(always)]
    fn seat<R: Real<Scalar = T>, const G: usize>(&mut self, tile: &mut Tile<'_, R, G>, group: usize) {
        let (source, rows, motion) = (self.source, tile.seats[group].rows, tile.motion);
        tile.state[group] = load_state(|column| gathered(self.state[column], &rows));
        if motion.centre.is_some() {
            tile.centres[group] = self.load_centres(&rows);
        }
        let mut controller = load_controller(|column| gathered(self.controllers[column], &rows));
        let taken: R = tile.seats[group].occupied();
        controller.left = TwoWords { value: controller.left.value * taken, residue: controller.left.residue * taken };
        controller.retried = controller.retried * taken;
        tile.controllers[group] = controller;
        let mut bodies = rows;
        for body in &mut bodies {
            *body += self.first;
        }
        tile.bodies[group] = bodies;
        let rate = gathered::<R>(&source.parameters[RATE_COLUMN * source.stride..], &bodies);
        let seconds = R::splat(1.0) / rate;
        (tile.rate[group], tile.seconds[group]) = (rate, seconds);
        tile.spans[group] = self.span.times(rate);
        tile.least_step[group] = motion.steps.limits(rate).least_step;
        let program = &motion.jets.factors;
        for (index, input) in program.inputs().iter().enumerate() {
            let column = &source.parameters[usize::from(input.index) * source.stride..];
            *tile.scratch.input(index) = Each([gathered(column, &bodies)]);
        }
        program.run(&mut tile.scratch, &mut tile.factors);
        tile.series.set_factors(&motion.jets, group, &tile.factors);
        let columns = self.controllers[CONTROLLER_COLUMNS..].chunks_exact(3);
        for (columns, direction) in columns.zip(&mut tile.directions) {
            let column = |axis: usize| gathered::<R>(&*columns[axis], &rows);
            direction[group] = Vector::new(column(0), column(1), column(2));
        }
        tile.set_worlds(group);
        for (advancing, rates) in motion.advancing.iter().zip(&mut tile.rates) {
            rates[group] = match advancing.rate_column {
                Some(column) => gathered::<R>(&source.parameters[column * source.stride..], &bodies) * seconds,
                None => seconds,
            };
            if let Some(column) = advancing.per_tick {
                tile.per_tick[group] = gathered(&source.parameters[column * source.stride..], &bodies);
            }
        }
    }
}

impl<T: Scalar> LaneTask<T> for Steps<'_, '_, T> {
    type Output = bool;
    const IN_LANES_ONLY: bool = true;

    #[inline(always)]
    fn run<R: Real<Scalar = T>>(self) -> bool {
        let Self { block, motion } = self;
        outlined!(R, advance::<R, GROUPS>(block, motion))
    }
}

/// [`Steps`] in tiles of G lane groups.
#[inline(always)]
fn advance<R: Real, const G: usize>(mut block: Block<'_, '_, R::Scalar>, motion: &TaylorMotion) -> bool {
    let mut tile = Tile::<R, G>::new(motion, block.source);
    if block.starts {
        block.start_all();
    }
    let mut slots = 0;
    // Lanes of each group that take a step.
    let mut under_way = [R::splat(0.0).less_than(R::splat(0.0)); G];
    for _ in 0..block.attempts {
        let mut is_under_way = false;
        for (group, under_way) in under_way.iter_mut().enumerate() {
            *under_way = tile.under_way(group);
            if tile.next < block.bodies {
                // Reassigning lanes costs a part of a step of the whole group, so it waits until idle lanes have
                // lost as much.
                tile.idle[group] += R::LANES - lanes_in::<R>(*under_way);
                if 2 * tile.idle[group] >= R::LANES || !R::any(*under_way) {
                    outlined!(R, block.reseat(&mut tile, group));
                    tile.idle[group] = 0;
                    *under_way = tile.under_way(group);
                }
            }
            if R::any(*under_way) {
                is_under_way = true;
                slots += R::LANES;
            }
        }
        if !is_under_way {
            break;
        }
        outlined!(R, start(&mut tile));
        tile.series.form(&motion.jets);
        if motion.orientation.is_none() {
            outlined!(R, bound_attitudes(&mut tile));
        }
        outlined!(R, conclude(&mut tile));
        if motion.is_dense {
            for (group, &under_way) in under_way.iter().enumerate() {
                let arrived = under_way & !tile.under_way(group);
                if R::any(arrived) {
                    outlined!(R, keep_series(&mut block, &tile, group, arrived));
                }
            }
        }
    }
    for group in 0..G {
        if block.is_single && !tile.directions.is_empty() {
            outlined!(R, finish(&mut tile, group));
        }
        block.put_group_back(&tile, group);
    }
    block.slots.fetch_add(slots as u64, Ordering::Relaxed);
    let waits = (0..block.bodies).any(|row| block.waits(row));
    if motion.is_dense && !waits {
        outlined!(R, evaluate::<R>(&mut block, motion));
    }
    waits
}
