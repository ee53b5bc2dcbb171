//! Quantities from states.

use rayon::prelude::*;

use crate::bodies::BodyState;
use crate::bodies::inertia::principal_axes;
use crate::error::Result;
use crate::expression::{Input, InputKind, Program};
use crate::record::OutputState;
use crate::scene::{Quantity, QuantityEvaluator, Scene};

/// Bodies whose quantities are formed at once.
pub(super) const BLOCK: usize = 1 << 10;

/// Forms quantities of a scene's bodies, in lanes and all at once, or one of one body.
pub(in crate::run) struct Evaluator<'p> {
    all: Program,
    single: QuantityEvaluator<'p>,
}

/// The quantities of some bodies in a row, block by block.
pub(in crate::run) struct Values {
    /// By block, then by quantity, then by body.
    numbers: Vec<Vec<Vec<f64>>>,
}

impl Values {
    /// One quantity's values, block by block: of each block the first body's place, and the values.
    pub fn of(&self, quantity: usize) -> impl Iterator<Item = (usize, &[f64])> {
        self.numbers.iter().enumerate().map(move |(block, numbers)| (block * BLOCK, &numbers[quantity][..]))
    }

    /// Sets those of one body, by its place, to those of a body alone.
    pub fn set(&mut self, place: usize, alone: &Values) {
        for (numbers, own) in self.numbers[place / BLOCK].iter_mut().zip(&alone.numbers[0]) {
            numbers[place % BLOCK] = own[0];
        }
    }
}

impl<'p> Evaluator<'p> {
    /// Of the quantities in this order.
    pub fn new(scene: &'p Scene, quantities: &[Quantity]) -> Result<Self> {
        let (graph, outputs) = Quantity::expression(quantities)?;
        let single = QuantityEvaluator::of_expression(scene, quantities, (&graph, &outputs))?;
        let has_distance = quantities.contains(&Quantity::SeparatrixDistance);
        let moments = match has_distance && !single.varies() {
            true => scene.ensemble().inertia().par_iter().map(|tensor| principal_axes(tensor).moments).collect(),
            false => Vec::new(),
        };
        Ok(Self { all: Program::new(&graph, &outputs), single: single.with_moments(moments) })
    }

    /// Whether anything is formed of the own state of torques.
    pub fn reads_own_state(&self) -> bool {
        self.single.reads_own_state()
    }

    /// All quantities of the bodies from `first_body` on; NaN of a body that has failed, and those of its stop of one that was stopped. `own` has
    /// their own state, by number, where any is read.
    pub fn values(&self, first_body: usize, time: f64, states: &[OutputState], own: &[&[f64]]) -> Values {
        let of_block = |(block, states): (usize, &[OutputState])| {
            let first = first_body + block * BLOCK;
            let column = |&input: &Input| match self.single.own_place(input) {
                Some(place) => own
                    .get(place)
                    .map_or(vec![f64::NAN; states.len()], |numbers| numbers[block * BLOCK..][..states.len()].to_vec()),
                None => self.column(input, first, time, states),
            };
            let columns: Vec<Vec<f64>> = self.all.inputs().iter().map(column).collect();
            let columns: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
            let mut found = self.all.evaluate_columns(&columns, states.len());
            for (row, _) in states.iter().enumerate().filter(|(_, state)| !state.rotation.is_sound()) {
                found.iter_mut().for_each(|numbers| numbers[row] = f64::NAN);
            }
            found
        };
        Values { numbers: states.par_chunks(BLOCK).enumerate().map(of_block).collect() }
    }

    /// The quantity of a number of one body, whose state is sound, with its own state.
    pub fn value(&self, quantity: usize, body: usize, time: f64, state: (&BodyState, &[f64])) -> f64 {
        self.single.value(quantity, body, time, state)
    }

    /// What a formula reads of some bodies.
    fn column(&self, input: Input, first: usize, time: f64, states: &[OutputState]) -> Vec<f64> {
        let index = usize::from(input.index);
        // The choice is made once, so that each column is a loop of loads.
        let loaded = |load: fn(&BodyState, usize) -> f64| -> Vec<f64> {
            states.iter().map(|state| load(&state.rotation, index)).collect()
        };
        match input.kind {
            InputKind::Orientation => loaded(|state, index| state.orientation.to_array()[index]),
            InputKind::AngularVelocity => loaded(|state, index| state.angular_velocity_body.to_array()[index]),
            InputKind::Parameter if index < 3 => loaded(|state, index| state.angular_momentum_world.to_array()[index]),
            InputKind::Parameter if index == 3 => loaded(|state, _| state.kinetic_energy),
            _ => {
                let bodies = states.iter().enumerate();
                bodies
                    .map(|(row, state)| self.single.input(input, first + row, state.time(time), &state.rotation))
                    .collect()
            }
        }
    }
}
