//! [`crate::method::taylor`] on tiles, whose lanes are given to other bodies as theirs arrive.

use std::sync::atomic::Ordering;

use super::adaptive::{Block, LEFT, SLICE, load_controller, store_controller};
use super::tile::{lanes_in, scatter};
use crate::batch::{RATE_COLUMN, load_state, status_column, store_state};
use crate::clock::MOST_LANES;
use crate::engine::adaptive::AdaptiveSteps;
use crate::error::{Error, Result};
use crate::expression::jet::{Jets, Place, Series};
use crate::expression::{Fault, Input, InputKind, Scratch};
use crate::lanes::{Each, LaneScalar, LaneTask};
use crate::method::rk8_adaptive::{Controller, LEAST_STEP, renormalised};
use crate::method::taylor::{
    Coefficient, Coefficients, MOST_ORDER, StepLength, TwoSided, form_relative_attitude, half_order_of, order_of,
    step_of,
};
use crate::method::{Method, Status, flagged};
use crate::quaternion::{Quaternion, norm_correction_of_step};
use crate::real::{Outlined, Real, Scalar};
use crate::rigid_body::State;
use crate::torque::motion::RecordedMotion;
use crate::torque::sum::{Source, StepTime};
use crate::torque::tile::{gathered, start_of};
use crate::torque::{PER_TICK, TorqueTable};
use crate::vector::{TwoWords, Vector, two_difference};

/// The controller's column that holds the step whose end the attitude has not been brought to yet ([`TwoSided`]).
const PENDING: usize = 3;

/// A row that advances evenly with time.
#[derive(Clone, Copy, Debug)]
struct Advancing {
    place: Place,
    /// Its number among the phases, or behind them for the time.
    number: usize,
    /// The column of its rate a second; none for the time.
    rate_column: Option<usize>,
    /// The column of a ramp's progress in a tick.
    per_tick: Option<usize>,
}

/// What a session's steps have in common.
#[derive(Debug)]
pub(super) struct TaylorMotion {
    jets: Jets,
    momentum: [Place; 3],
    /// Rows of the orientation, where a torque asks for it.
    orientation: Option<[Place; 4]>,
    angular_velocity: [Place; 3],
    advancing: Vec<Advancing>,
    length: StepLength,
    two_sided: TwoSided,
    steps: AdaptiveSteps,
}

impl TaylorMotion {
    /// The motion under the torques of a table.
    ///
    /// # Errors
    ///
    /// [`Error::MethodUnavailable`] where a formula has no Taylor series.
    pub fn new(table: &TorqueTable, steps: AdaptiveSteps) -> Result<Self> {
        Self::recorded(table, steps).map_err(|fault| Error::MethodUnavailable {
            method: Method::Taylor,
            expected: format!("a torque has no Taylor series: {fault}").into(),
        })
    }

    fn recorded(table: &TorqueTable, steps: AdaptiveSteps) -> std::result::Result<Self, Fault> {
        let motion = RecordedMotion::new(table)?;
        let order = order_of(steps.tolerance);
        let jets = motion.lowered()?.up_to(order);
        let state = |kind, part| jets.input(Input::new(kind, part)).ok_or(Fault::ForeignSymbol);
        let momentum = |part| state(InputKind::AngularMomentum, part);
        let part = |part| state(InputKind::Orientation, part);
        let orientation = if motion.needs_attitude { Some([part(0)?, part(1)?, part(2)?, part(3)?]) } else { None };
        let momentum = [momentum(0)?, momentum(1)?, momentum(2)?];
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
        Ok(Self {
            momentum,
            orientation,
            angular_velocity: [x, y, z],
            advancing,
            length: StepLength::new(order, steps.tolerance),
            two_sided: TwoSided::new(half_order_of(order), steps.tolerance),
            steps,
            jets,
        })
    }
}

/// Steps of a block in lanes; says whether any body is still under way.
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

/// Each groups of a tile: one waits for its own sums, and the coefficients of four leave the first-level cache.
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
    /// What forms the factors of a lane group.
    scratch: Scratch<R, 1>,
    factors: Vec<Each<R, 1>>,
    /// Rows of the block, and the bodies in them.
    rows: [[usize; MOST_LANES]; G],
    bodies: [[usize; MOST_LANES]; G],
    /// Lanes that hold a body.
    taken: [[bool; MOST_LANES]; G],
    state: [State<R>; G],
    controllers: [Controller<R>; G],
    spans: [TwoWords<R>; G],
    /// The reference rate, 1/s, and its reciprocal.
    rate: [R; G],
    seconds: [R; G],
    least_step: [R; G],
    /// Of what advances with time: its rate in the body's own unit of time, and a ramp's progress in a tick.
    rates: Vec<[R; G]>,
    per_tick: [R; G],
    /// The series of the attitude relative to where a step starts.
    relative: Vec<Coefficient<R>>,
    /// Turns of lanes without work since lanes were given away last.
    idle: [usize; G],
    /// The first row that has not been looked at.
    next: usize,
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
            rows: [[0; MOST_LANES]; G],
            bodies: [[0; MOST_LANES]; G],
            taken: [[false; MOST_LANES]; G],
            state: [state; G],
            controllers: [Controller::new(); G],
            spans: [words; G],
            rate: [one; G],
            seconds: [one; G],
            least_step: [one; G],
            rates: vec![[zero; G]; motion.advancing.len()],
            per_tick: [zero; G],
            relative: vec![Coefficient(state.orientation.value); motion.two_sided.half_order + 1],
            idle: [0; G],
            next: 0,
        }
    }

    /// Where there is something left to do.
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

    /// What is left of the interval at its start. Rows that are no bodies have the rate 0, so that nothing is.
    fn start_rows(&mut self) {
        let rates = &self.source.parameters[RATE_COLUMN * self.source.stride + self.first..];
        for (row, &rate) in rates.iter().enumerate().take(self.bodies) {
            self.controllers[LEFT.start][row] = self.span.value * rate;
            self.controllers[LEFT.start + 1][row] = self.span.residue * rate;
        }
    }

    /// Writes the bodies of a lane group back.
    #[inline(always)]
    fn unseat<R: Real<Scalar = T>, const G: usize>(&mut self, tile: &Tile<'_, R, G>, group: usize) {
        let (rows, taken) = (&tile.rows[group], &tile.taken[group]);
        let state = &mut *self.state;
        store_state(&tile.state[group], |column, number: R| scatter(number, rows, taken, state[column]));
        let controllers = &mut *self.controllers;
        store_controller(&tile.controllers[group], |column, number: R| {
            scatter(number, rows, taken, controllers[column]);
        });
    }

    /// Gives the lanes of a group whose bodies have arrived to bodies that have not.
    #[inline(always)]
    fn reseat<R: Real<Scalar = T>, const G: usize>(&mut self, tile: &mut Tile<'_, R, G>, group: usize) {
        self.unseat(tile, group);
        for lane in 0..R::LANES {
            let row = tile.rows[group][lane];
            if tile.taken[group][lane] && self.waits(row) {
                continue;
            }
            while tile.next < self.bodies && !self.waits(tile.next) {
                tile.next += 1;
            }
            tile.taken[group][lane] = tile.next < self.bodies;
            if tile.next < self.bodies {
                tile.rows[group][lane] = tile.next;
                tile.next += 1;
            }
        }
        self.seat(tile, group);
    }

    #[inline(always)]
    fn seat<R: Real<Scalar = T>, const G: usize>(&mut self, tile: &mut Tile<'_, R, G>, group: usize) {
        let (source, rows, motion) = (self.source, tile.rows[group], tile.motion);
        tile.state[group] = load_state(|column| gathered(self.state[column], &rows));
        let mut controller = load_controller(|column| gathered(self.controllers[column], &rows));
        let mut numbers = [T::default(); MOST_LANES];
        for (number, taken) in numbers.iter_mut().zip(&tile.taken[group]) {
            *number = T::from_f64(if *taken { 1.0 } else { 0.0 });
        }
        let taken = R::load(&numbers);
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
        let span = |word: T| R::splat(word.to_f64()) * rate;
        tile.spans[group] = TwoWords { value: span(self.span.value), residue: span(self.span.residue) };
        tile.least_step[group] = match motion.steps.least_step {
            Some(step) => R::splat(step) * rate,
            None => R::splat(LEAST_STEP),
        };
        let program = &motion.jets.factors;
        for (index, input) in program.inputs().iter().enumerate() {
            let column = &source.parameters[usize::from(input.index) * source.stride..];
            *tile.scratch.input(index) = Each([gathered(column, &bodies)]);
        }
        program.run(&mut tile.scratch, &mut tile.factors);
        tile.series.set_factors(&motion.jets, group, &tile.factors);
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

/// [`Block::reseat`] as a function of its own.
struct Reseat<'s, 'a, 'b, 'c, R: Real, const G: usize> {
    block: &'s mut Block<'a, 'b, R::Scalar>,
    tile: &'s mut Tile<'c, R, G>,
    group: usize,
}

impl<R: Real, const G: usize> Outlined for Reseat<'_, '_, '_, '_, R, G> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        self.block.reseat(self.tile, self.group);
    }
}

impl<T: Scalar> LaneTask<T> for Steps<'_, '_, T> {
    type Output = bool;
    const IN_LANES_ONLY: bool = true;

    #[inline(always)]
    fn run<R: Real<Scalar = T>>(self) -> bool {
        let Self { block, motion } = self;
        R::outlined(Advance::<R, GROUPS> { block, motion })
    }
}

/// [`Steps`] in tiles of G lane groups.
struct Advance<'a, 'b, R: Real, const G: usize> {
    block: Block<'a, 'b, R::Scalar>,
    motion: &'a TaylorMotion,
}

impl<R: Real, const G: usize> Outlined for Advance<'_, '_, R, G> {
    type Output = bool;
    #[inline(always)]
    fn run(self) -> bool {
        let Self { mut block, motion } = self;
        let mut tile = Tile::<R, G>::new(motion, block.source);
        if block.starts {
            block.start_rows();
        }
        let mut slots = 0;
        for _ in 0..SLICE {
            let mut is_under_way = false;
            for group in 0..G {
                let mut under_way = tile.under_way(group);
                if tile.next < block.bodies {
                    // To give lanes away costs some of a step of all of them, so it waits until as much is lost.
                    tile.idle[group] += R::LANES - lanes_in::<R>(under_way);
                    if 2 * tile.idle[group] >= R::LANES || !R::any(under_way) {
                        R::outlined(Reseat { block: &mut block, tile: &mut tile, group });
                        tile.idle[group] = 0;
                        under_way = tile.under_way(group);
                    }
                }
                is_under_way |= R::any(under_way);
            }
            if !is_under_way {
                break;
            }
            slots += G * R::LANES;
            R::outlined(Start { tile: &mut tile });
            tile.series.form(&motion.jets);
            for group in 0..G {
                R::outlined(Conclusion { tile: &mut tile, group });
            }
        }
        for group in 0..G {
            block.unseat(&tile, group);
        }
        block.slots.fetch_add(slots as u64, Ordering::Relaxed);
        (0..block.bodies).any(|row| block.waits(row))
    }
}

/// Sets what a step starts from.
struct Start<'s, 'a, R: Real, const G: usize> {
    tile: &'s mut Tile<'a, R, G>,
}

impl<R: Real, const G: usize> Outlined for Start<'_, '_, R, G> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let Self { tile } = self;
        let motion = tile.motion;
        for group in 0..G {
            let State { orientation: TwoWords { value: q, .. }, angular_momentum_principal, .. } = tile.state[group];
            let m = angular_momentum_principal.value;
            for (place, number) in motion.momentum.into_iter().zip([m.x, m.y, m.z]) {
                tile.series.set(place, 0, group, number);
            }
            if let Some(places) = motion.orientation {
                for (place, number) in places.into_iter().zip([q.x, q.y, q.z, q.w]) {
                    tile.series.set(place, 0, group, number);
                }
            }
            if motion.advancing.is_empty() {
                continue;
            }
            let (span, left) = (tile.spans[group], tile.controllers[group].left);
            let (gone, gone_residue) = two_difference(span.value, left.value);
            let seconds = tile.seconds[group];
            let time =
                TwoWords { value: gone * seconds, residue: (gone_residue + (span.residue - left.residue)) * seconds };
            let ticks = tile.source.columns::<R>(0).ticks(StepTime::Own(&time));
            for (advancing, rates) in motion.advancing.iter().zip(&tile.rates) {
                let per_tick = if advancing.per_tick.is_some() { Some(tile.per_tick[group]) } else { None };
                let start = start_of(&tile.source, advancing.number, &tile.bodies[group], &ticks, per_tick);
                tile.series.set(advancing.place, 0, group, start);
                tile.series.set(advancing.place, 1, group, rates[group]);
            }
        }
    }
}

/// The attitude at the end of a step by the series of the step itself, from q S(h).
struct Arrival<'s, 'a, R: Real, const G: usize> {
    tile: &'s mut Tile<'a, R, G>,
    group: usize,
    h: R,
    begun: &'s Quaternion<R>,
}

/// Coefficients of ω about another time.
struct Shifted<R>([[R; MOST_ORDER]; 3]);

impl<R: Real> Coefficients<R> for Shifted<R> {
    #[inline(always)]
    fn at(&self, order: usize) -> Vector<R> {
        let Self([x, y, z]) = self;
        Vector::new(x[order], y[order], z[order])
    }
}

impl<R: Real, const G: usize> Outlined for Arrival<'_, '_, R, G> {
    type Output = Quaternion<R>;
    #[inline(always)]
    fn run(self) -> Quaternion<R> {
        let Self { tile, group, h, begun } = self;
        let (order, count) = (tile.motion.jets.order, tile.motion.two_sided.half_order);
        let (zero, one) = (R::splat(0.0), R::splat(1.0));
        let mut shifted = Shifted([[zero; MOST_ORDER]; 3]);
        for (row, place) in shifted.0.iter_mut().zip(tile.motion.angular_velocity) {
            for (coefficient, from) in row.iter_mut().zip(tile.series.row(place, order)) {
                *coefficient = from.0[group];
            }
            // Horner's scheme again and again (the complete one).
            for first in 0..count {
                for k in (first..order - 1).rev() {
                    row[k] = row[k + 1].mul_add(h, row[k]);
                }
            }
        }
        form_relative_attitude(shifted, &mut tile.relative);
        let [_, backwards] = tile.motion.two_sided.sums(&tile.relative, zero, h);
        let arrived = begun.product(backwards.conjugate());
        arrived * (one / arrived.norm_squared().sqrt())
    }
}

/// What comes of a step for a lane group, now that its series are known.
struct Conclusion<'s, 'a, R: Real, const G: usize> {
    tile: &'s mut Tile<'a, R, G>,
    group: usize,
}

/// The coefficients of ω of a lane group.
struct AngularVelocity<'s, R, const G: usize> {
    rows: [&'s [Each<R, G>]; 3],
    group: usize,
}

impl<R: Real, const G: usize> Coefficients<R> for AngularVelocity<'_, R, G> {
    #[inline(always)]
    fn at(&self, order: usize) -> Vector<R> {
        let [x, y, z] = self.rows;
        Vector::new(x[order].0[self.group], y[order].0[self.group], z[order].0[self.group])
    }
}

impl<R: Real, const G: usize> Tile<'_, R, G> {
    /// Coefficient k of m.
    #[inline(always)]
    fn momentum(&self, group: usize, order: usize) -> Vector<R> {
        let [x, y, z] = self.motion.momentum;
        let at = |place| self.series.at(place, order)[group];
        Vector::new(at(x), at(y), at(z))
    }

    /// Coefficient k of q.
    #[inline(always)]
    fn orientation(&self, places: [Place; 4], group: usize, order: usize) -> Quaternion<R> {
        let [x, y, z, w] = places;
        let at = |place| self.series.at(place, order)[group];
        Quaternion::new(at(x), at(y), at(z), at(w))
    }

    /// The norm of coefficient k of what the series are formed for; of m in units of `scale`.
    #[inline(always)]
    fn norm(&self, group: usize, order: usize, inverse_scale: R) -> R {
        let m = self.momentum(group, order).largest() * inverse_scale;
        match self.motion.orientation {
            Some(places) => m.max(largest(self.orientation(places, group, order))),
            None => m,
        }
    }

    /// log₂ 1/h by the last coefficients of ω that the formula for the attitude leaves out.
    #[inline(always)]
    fn own_logarithm(&self, group: usize) -> R {
        let (two_sided, [x, y, z]) = (&self.motion.two_sided, self.motion.angular_velocity);
        let norm = |order: usize| {
            let at = |place| self.series.at(place, order)[group];
            Vector::new(at(x), at(y), at(z)).largest()
        };
        let last = 2 * two_sided.half_order;
        two_sided.own_length.inverse_logarithm(norm(last), norm(last - 1))
    }

    /// The step after which something that decides has changed its sign, where that is shorter than `h`.
    #[inline(always)]
    fn cut(&self, group: usize, h: R) -> R {
        let mut cut = h;
        for &place in &self.motion.jets.switches {
            cut = R::outlined(Cut { tile: self, group, place, h: cut });
        }
        cut
    }
}

/// The largest magnitude of a component.
#[inline(always)]
fn largest<R: Real>(q: Quaternion<R>) -> R {
    q.vector().largest().max(q.w.abs())
}

/// [`Tile::cut`] for one number that decides.
struct Cut<'s, 'a, R: Real, const G: usize> {
    tile: &'s Tile<'a, R, G>,
    group: usize,
    place: Place,
    h: R,
}

impl<R: Real, const G: usize> Outlined for Cut<'_, '_, R, G> {
    type Output = R;
    #[inline(always)]
    fn run(self) -> R {
        /// Halvings of the interval in which the sign changes: its length is then below rounding.
        const HALVINGS: usize = 52;
        /// What is smaller than this part of its greatest term has no sign that counts.
        const NEGLIGIBLE: f64 = 1e-12;
        let Self { tile, group, place, h } = self;
        let row = tile.series.row(place, tile.motion.jets.order);
        let (zero, negligible) = (R::splat(0.0), R::splat(NEGLIGIBLE));
        let start = row[0].0[group];
        let (mut end, mut greatest) = (zero, zero);
        for coefficient in row.iter().rev() {
            end = end.mul_add(h, coefficient.0[group]);
            greatest = greatest.mul_add(h, coefficient.0[group].abs());
        }
        let changes = (start * end).less_than(zero)
            & (greatest * negligible).less_than(end.abs())
            & (greatest * negligible).less_than(start.abs());
        if !R::any(changes) {
            return h;
        }
        let (mut before, mut after) = (zero, h);
        for _ in 0..HALVINGS {
            let middle = (before + after) * R::splat(0.5);
            let mut number = zero;
            for coefficient in row.iter().rev() {
                number = number.mul_add(middle, coefficient.0[group]);
            }
            let is_before = !(start * number).less_than(zero);
            before = R::select(is_before, middle, before);
            after = R::select(is_before, after, middle);
        }
        // A little further, so that the next step starts on the other side.
        let after = after + h * R::splat(1e-11);
        R::select(changes, after.min(h), h)
    }
}

impl<R: Real, const G: usize> Outlined for Conclusion<'_, '_, R, G> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let Self { tile, group } = self;
        let motion = tile.motion;
        let (order, zero, one) = (motion.jets.order, R::splat(0.0), R::splat(1.0));
        let under_way = tile.under_way(group);
        let controller = tile.controllers[group];
        let state = tile.state[group];
        let (q, m) = (state.orientation.value, state.angular_momentum_principal.value);
        let (left, pending) = (controller.left, controller.retried);
        let is_left = under_way & zero.less_than(left.value);

        // A body that starts from rest is measured by what it gains in an eighth of its unit of time.
        let gained = tile.momentum(group, 1).largest() * R::splat(0.125);
        let scale = m.largest().max(gained).max(R::splat(1e-15));
        let inverse_scale = one / scale;
        let norms = [tile.norm(group, order, inverse_scale), tile.norm(group, order - 1, inverse_scale)];
        let limit = R::splat(1e290);
        let mut is_number = norms[0].less_than(limit) & norms[1].less_than(limit);
        let mut inverse_logarithm = motion.length.inverse_logarithm(norms[0], norms[1]);

        if motion.orientation.is_none() {
            let rows = motion.angular_velocity;
            let count = motion.two_sided.half_order;
            let [x, y, z] = rows;
            let rows = [tile.series.row(x, count), tile.series.row(y, count), tile.series.row(z, count)];
            let relative = &mut tile.relative;
            form_relative_attitude(AngularVelocity { rows, group }, relative);
            let norms = [largest(relative[count].0), largest(relative[count - 1].0)];
            is_number = is_number & norms[0].less_than(limit) & norms[1].less_than(limit);
            let own = motion.two_sided.length.inverse_logarithm(norms[0], norms[1]);
            let own = own.max(tile.own_logarithm(group));
            inverse_logarithm = inverse_logarithm.max(own);
        }
        let mut step = step_of(inverse_logarithm);
        // From where a root vanishes nothing is known of its series.
        for &root in &motion.jets.roots {
            let vanishes = !zero.less_than(tile.series.at(root, 0)[group]) & zero.less_than(gained);
            step = R::select(vanishes, step.min(R::splat(0.01 * motion.steps.tolerance.sqrt())), step);
        }
        let too_small = !(is_number & !step.less_than(tile.least_step[group]));
        let step = R::select(too_small, one, step);
        let within = step.min(left.value);
        let cut = tile.cut(group, within);
        let is_cut = cut.less_than(within);
        // A last step that would leave almost nothing takes the rest as well.
        let last = left.value.less_than(step * R::splat(1.01)) & !is_cut;
        let step = cut.max(tile.least_step[group]).min(within);
        let h = TwoWords { value: R::select(last, left.value, step), residue: R::select(last, left.residue, zero) };
        let taken = is_left & !too_small;

        let mut m_change = tile.momentum(group, order);
        for k in (1..order).rev() {
            m_change = m_change.axpy(h.value, tile.momentum(group, k));
        }
        let mut next = state;
        let increment = m_change * h.value + tile.momentum(group, 1) * h.residue;
        next.angular_momentum_principal.value = m + increment;
        let mut controller = controller;
        match motion.orientation {
            Some(places) => {
                let mut q_change = tile.orientation(places, group, order);
                for k in (1..order).rev() {
                    q_change = q_change.axpy(h.value, tile.orientation(places, group, k));
                }
                let increment = q_change * h.value + tile.orientation(places, group, 1) * h.residue;
                let correction = norm_correction_of_step(q, q + increment);
                next.orientation.value = q + (increment + correction);
                tile.state[group] = State::select(taken, next, state);
            }
            None => {
                let [forwards, backwards] = motion.two_sided.sums(&tile.relative, h.value, pending);
                let is_pending = under_way & zero.less_than(pending);
                let arrived = q.product(backwards.conjugate());
                let arrived = arrived * (one / arrived.norm_squared().sqrt());
                // Where the series are no numbers the attitude stays where the last step began.
                let begun = q * (one / q.norm_squared().sqrt());
                let here = Quaternion::select(is_pending, Quaternion::select(is_number, arrived, begun), q);
                let mut stays = state;
                stays.orientation.value = here;
                next.orientation.value = here.product(forwards);
                let ends_branch = taken & is_cut;
                let mut next_pending = h.value;
                if R::any(ends_branch) {
                    let begun = next.orientation.value;
                    let arrived = R::outlined(Arrival { tile, group, h: h.value, begun: &begun });
                    next.orientation.value = Quaternion::select(ends_branch, arrived, begun);
                    next_pending = R::select(ends_branch, zero, next_pending);
                }
                tile.state[group] = State::select(taken, next, State::select(under_way, stays, state));
                controller.retried = R::select(taken, next_pending, R::select(under_way, zero, pending));
            }
        }
        let status = tile.state[group].status;
        tile.state[group].status = flagged(status, is_left & too_small, Status::StepBelowLimit);

        let (value, lost) = two_difference(left.value, h.value);
        let rest = renormalised(value, lost + (left.residue - h.residue));
        controller.left = TwoWords {
            value: R::select(taken, rest.value, left.value),
            residue: R::select(taken, rest.residue, left.residue),
        };
        controller.accepted = R::select(taken, controller.accepted + one, controller.accepted);
        tile.controllers[group] = controller;
    }
}
