//! Quantities from states.

use std::borrow::Cow;

use crate::bodies::BodyState;
use crate::error::Result;
use crate::expression::{Input, InputKind, Program};
use crate::math::parallel;
use crate::record::OutputState;
use crate::scene::{Quantity, QuantityEvaluator, Scene};

/// Bodies whose quantities are formed at once.
pub(super) const BLOCK: usize = 1 << 10;

/// Forms all quantities of a scene's bodies in lanes, or one quantity of one body.
pub(in crate::run) struct Evaluator<'p> {
    all: Program,
    single: QuantityEvaluator<'p>,
}

/// The quantities of some bodies in a row, block by block.
pub(in crate::run) struct Values {
    /// By block, then by quantity, then by body.
    numbers: Vec<Vec<Vec<f64>>>,
    /// The places of the bodies that have failed, ascending.
    failed: Vec<usize>,
    /// The number of all bodies.
    count: usize,
}

impl Values {
    /// The number of bodies that have not failed.
    pub fn sound(&self) -> usize {
        self.count - self.failed.len()
    }

    /// The number of bodies.
    pub fn count(&self) -> usize {
        self.count
    }

    /// The places of the bodies that have failed, ascending.
    pub fn failed(&self) -> &[usize] {
        &self.failed
    }

    /// A quantity of the body in a place.
    pub fn at(&self, quantity: usize, place: usize) -> f64 {
        self.numbers[place / BLOCK][quantity][place % BLOCK]
    }

    /// One quantity's values, block by block: the place of the block's first body, and the values.
    pub fn of(&self, quantity: usize) -> impl Iterator<Item = (usize, &[f64])> {
        self.numbers.iter().enumerate().map(move |(block, numbers)| (block * BLOCK, &numbers[quantity][..]))
    }

    /// Sets the values of the body in a place from `alone`, which holds one body.
    pub fn set(&mut self, place: usize, alone: &Values) {
        for (numbers, own) in self.numbers[place / BLOCK].iter_mut().zip(&alone.numbers[0]) {
            numbers[place % BLOCK] = own[0];
        }
    }
}

impl<'p> Evaluator<'p> {
    /// For these quantities, in this order.
    pub fn new(scene: &'p Scene, quantities: &[Quantity]) -> Result<Self> {
        let (graph, outputs) = Quantity::expression(quantities)?;
        let single = QuantityEvaluator::of_expression(scene, quantities, (&graph, &outputs))?;
        Ok(Self { all: Program::new(&graph, &outputs), single: single.with_axes() })
    }

    /// Whether a quantity reads the own state of torques.
    pub fn reads_own_state(&self) -> bool {
        self.single.reads_own_state()
    }

    /// All quantities of the bodies from `first_body` on; NaN for a body that has failed, and those of the stop for one
    /// that was stopped. `own` has their own state, by number, if any is read.
    pub fn values(&self, first_body: usize, time: f64, states: &[OutputState], own: &[&[f64]]) -> Values {
        self.values_of(&|row| first_body + row, time, states, own)
    }

    /// The same of any bodies; `body` gives those of the rows.
    pub fn values_of(
        &self,
        body: &(dyn Fn(usize) -> usize + Sync),
        time: f64,
        states: &[OutputState],
        own: &[&[f64]],
    ) -> Values {
        let of_block = |(block, states): (usize, &[OutputState])| {
            let first = block * BLOCK;
            let of_state = StateColumns::of(states);
            let column = |&input: &Input| -> Cow<'_, [f64]> {
                if let Some(place) = self.single.own_place(input) {
                    let unknown = || Cow::Owned(vec![f64::NAN; states.len()]);
                    return own
                        .get(place)
                        .map_or_else(unknown, |numbers| Cow::Borrowed(&numbers[block * BLOCK..][..states.len()]));
                }
                let index = usize::from(input.index);
                match input.kind {
                    InputKind::Orientation => Cow::Borrowed(of_state.column(index)),
                    InputKind::AngularVelocity => Cow::Borrowed(of_state.column(4 + index)),
                    InputKind::Parameter if index < 4 => Cow::Borrowed(of_state.column(7 + index)),
                    _ => {
                        let bodies = states.iter().enumerate();
                        let input = |(row, state): (usize, &OutputState)| {
                            self.single.input(input, body(first + row), state.time(time), &state.rotation)
                        };
                        Cow::Owned(bodies.map(input).collect())
                    }
                }
            };
            let columns: Vec<Cow<'_, [f64]>> = self.all.inputs().iter().map(column).collect();
            let columns: Vec<&[f64]> = columns.iter().map(|column| &column[..]).collect();
            let mut found = self.all.evaluate_columns(&columns, states.len());
            let failed = of_state.failed(states);
            for &row in &failed {
                found.iter_mut().for_each(|numbers| numbers[row] = f64::NAN);
            }
            let failed: Vec<usize> = failed.into_iter().map(|row| block * BLOCK + row).collect();
            (found, failed)
        };
        let blocks = parallel::map_tasks(states.chunks(BLOCK), |block, states| of_block((block, states)));
        let (numbers, failed): (_, Vec<Vec<usize>>) = blocks.into_iter().unzip();
        Values { numbers, failed: failed.concat(), count: states.len() }
    }

    /// A constant of a body that formulas read.
    pub fn constant(&self, input: Input, body: usize) -> f64 {
        self.single.input(input, body, 0.0, &BodyState::UNKNOWN)
    }

    /// A quantity, by number, of one body whose state is sound, with its own state.
    pub fn value(&self, quantity: usize, body: usize, time: f64, state: (&BodyState, &[f64])) -> f64 {
        self.single.value(quantity, body, time, state)
    }
}

/// The numbers of a state that formulas read directly: attitude, angular velocity, angular momentum and kinetic energy.
const NUMBERS: usize = 11;

/// Places between columns: a cache line, as columns whose distance is a power of two evict each other from the
/// first-level cache.
const GAP: usize = 8;

/// The states of a block of bodies, one column for each of these numbers.
struct StateColumns {
    count: usize,
    numbers: Vec<f64>,
}

impl StateColumns {
    fn of(states: &[OutputState]) -> Self {
        let stride = states.len() + GAP;
        let mut numbers = vec![0.0; NUMBERS * stride];
        for (row, state) in states.iter().enumerate() {
            let BodyState { orientation, angular_velocity_body, angular_momentum_world, kinetic_energy, .. } =
                state.rotation;
            let [x, y, z, w] = orientation.to_array();
            let [a, b, c] = angular_velocity_body.to_array();
            let [d, e, f] = angular_momentum_world.to_array();
            let of_state = [x, y, z, w, a, b, c, d, e, f, kinetic_energy];
            numbers.chunks_exact_mut(stride).zip(of_state).for_each(|(column, number)| column[row] = number);
        }
        Self { count: states.len(), numbers }
    }

    fn column(&self, number: usize) -> &[f64] {
        &self.numbers[number * (self.count + GAP)..][..self.count]
    }

    /// The places of bodies that have failed.
    fn failed(&self, states: &[OutputState]) -> Vec<usize> {
        // Zero times a finite number is zero; any other product is NaN.
        let mut checks = vec![0.0; self.count];
        for number in 0..NUMBERS {
            checks.iter_mut().zip(self.column(number)).for_each(|(check, number)| *check += number * 0.0);
        }
        let has_failed =
            |(place, state): &(usize, &OutputState)| checks[*place] != 0.0 || !state.rotation.status.is_good();
        states.iter().enumerate().filter(has_failed).map(|(place, _)| place).collect()
    }
}
