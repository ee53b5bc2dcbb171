//! Quantities from states.

use glam::DVec3;
use rayon::prelude::*;

use crate::bodies::BodyState;
use crate::bodies::inertia::{InertiaTensor, principal_axes};
use crate::error::Result;
use crate::expression::{Input, InputKind, Program};
use crate::record::OutputState;
use crate::scene::{Quantity, Scene};
use crate::torque::{Torque, variable_inertia};

/// Bodies whose quantities are formed at once.
pub(super) const BLOCK: usize = 1 << 10;

/// Forms quantities of a scene's bodies, in lanes and all at once, or one of one body.
pub(in crate::run) struct Evaluator<'p> {
    scene: &'p Scene,
    all: Program,
    /// Each by itself.
    each: Vec<Program>,
    /// Principal moments, kg m², ascending, where a quantity asks for them and they stay.
    moments: Vec<DVec3>,
    varies: bool,
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
}

impl<'p> Evaluator<'p> {
    /// Of the quantities in this order.
    pub fn new(scene: &'p Scene, quantities: &[Quantity]) -> Result<Self> {
        let (graph, outputs) = Quantity::expression(quantities)?;
        let varies = scene.torques().iter().any(Torque::changes_inertia);
        let has_distance = quantities.contains(&Quantity::SeparatrixDistance);
        let moments = match has_distance && !varies {
            true => scene.ensemble().inertia().par_iter().map(|tensor| principal_axes(tensor).moments).collect(),
            false => Vec::new(),
        };
        let each = outputs.iter().map(|output| Program::new(&graph, &[*output])).collect();
        Ok(Self { scene, all: Program::new(&graph, &outputs), each, moments, varies })
    }

    /// All quantities of the bodies from `first_body` on; NaN of a body that has failed.
    pub fn values(&self, first_body: usize, time: f64, states: &[OutputState]) -> Values {
        let of_block = |(block, states): (usize, &[OutputState])| {
            let first = first_body + block * BLOCK;
            let column = |&input: &Input| self.column(input, first, time, states);
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

    /// The quantity of a number of one body, whose state is sound.
    pub fn value(&self, quantity: usize, body: usize, time: f64, state: &BodyState) -> f64 {
        let program = &self.each[quantity];
        let inputs = program.inputs().iter().map(|&input| self.input(input, body, time, state));
        program.evaluate_one(&inputs.collect::<Vec<f64>>())[0]
    }

    fn tensor(&self, body: usize, time: f64) -> InertiaTensor {
        let tensor = self.scene.ensemble().inertia()[body];
        if self.varies { variable_inertia::tensor_at(self.scene.torques(), body, tensor, time) } else { tensor }
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
                bodies.map(|(row, state)| self.input(input, first + row, time, &state.rotation)).collect()
            }
        }
    }

    /// What a formula reads.
    #[inline]
    fn input(&self, input: Input, body: usize, time: f64, state: &BodyState) -> f64 {
        let index = usize::from(input.index);
        match input.kind {
            InputKind::Orientation => state.orientation.to_array()[index],
            InputKind::AngularVelocity => state.angular_velocity_body.to_array()[index],
            InputKind::Inertia => {
                let tensor = self.tensor(body, time);
                [tensor.xx, tensor.yy, tensor.zz, tensor.xy, tensor.xz, tensor.yz][index]
            }
            InputKind::Time => time,
            // In the order of `PARAMETERS`.
            InputKind::Parameter => match index {
                0..=2 => state.angular_momentum_world.to_array()[index],
                3 => state.kinetic_energy,
                4..=6 => {
                    let moments = self.moments.get(body).copied();
                    let moments = moments.unwrap_or_else(|| principal_axes(&self.tensor(body, time)).moments);
                    moments.to_array()[index - 4]
                }
                _ => {
                    let torques = self.scene.torques().iter();
                    torques.filter_map(|torque| torque.potential_energy(body, state.orientation)).sum()
                }
            },
            // Formulas of quantities have no other inputs.
            _ => f64::NAN,
        }
    }
}
