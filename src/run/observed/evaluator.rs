//! Quantities from states.

use glam::{DQuat, DVec3};
use rayon::prelude::*;

use crate::bodies::BodyState;
use crate::bodies::inertia::{InertiaTensor, principal_axes};
use crate::bodies::toolkit::EulerSequence;
use crate::expression::{Input, InputKind, Program};
use crate::record::OutputState;
use crate::scene::{Quantity, Scene};
use crate::torque::{Torque, variable_inertia};

/// Bodies whose quantities are formed at once.
pub(super) const BLOCK: usize = 1 << 10;

/// Forms quantities of a scene's bodies.
pub(super) struct Evaluator<'p> {
    scene: &'p Scene,
    quantities: Vec<Quantity>,
    /// Principal moments, kg m², ascending, where a quantity asks for them and they stay.
    moments: Vec<DVec3>,
    varies: bool,
}

/// The quantities of some bodies in a row, block by block.
pub(super) struct Values {
    numbers: Vec<f64>,
    quantities: usize,
    bodies: usize,
}

impl Values {
    /// One quantity's values, block by block: of each block the first body's place, and the values.
    pub fn of(&self, quantity: usize) -> impl Iterator<Item = (usize, &[f64])> {
        (0..self.bodies).step_by(BLOCK).map(move |first| {
            let count = BLOCK.min(self.bodies - first);
            let start = first * self.quantities + quantity * count;
            (first, &self.numbers[start..start + count])
        })
    }
}

impl<'p> Evaluator<'p> {
    /// Of the quantities in this order.
    pub fn new(scene: &'p Scene, quantities: Vec<Quantity>) -> Self {
        let varies = scene.torques().iter().any(Torque::changes_inertia);
        let has_distance = quantities.contains(&Quantity::SeparatrixDistance);
        let moments = match has_distance && !varies {
            true => scene.ensemble().inertia().par_iter().map(|tensor| principal_axes(tensor).moments).collect(),
            false => Vec::new(),
        };
        Self { scene, quantities, moments, varies }
    }

    /// All quantities of the bodies from `first_body` on; NaN of a body that has failed.
    pub fn values(&self, first_body: usize, time: f64, states: &[OutputState]) -> Values {
        let mut numbers = vec![f64::NAN; states.len() * self.quantities.len()];
        if !self.quantities.is_empty() {
            let blocks = numbers.par_chunks_mut(BLOCK * self.quantities.len()).zip(states.par_chunks(BLOCK));
            blocks.enumerate().for_each(|(block, (numbers, states))| {
                let first = first_body + block * BLOCK;
                for (quantity, numbers) in self.quantities.iter().zip(numbers.chunks_mut(states.len())) {
                    self.column(quantity, first, time, states, numbers);
                }
            });
        }
        Values { numbers, quantities: self.quantities.len(), bodies: states.len() }
    }

    /// One quantity of some bodies.
    fn column(&self, quantity: &Quantity, first: usize, time: f64, states: &[OutputState], numbers: &mut [f64]) {
        if let Quantity::Formula(formula) = quantity {
            let program = formula.program();
            let column = |&input: &Input| -> Vec<f64> {
                let bodies = states.iter().enumerate();
                bodies.map(|(row, state)| self.input(input, first + row, time, &state.rotation)).collect()
            };
            let columns: Vec<Vec<f64>> = program.inputs().iter().map(column).collect();
            let columns: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
            let found = program.evaluate_columns(&columns, states.len());
            for ((number, found), state) in numbers.iter_mut().zip(&found[0]).zip(states) {
                *number = if state.rotation.is_sound() { *found } else { f64::NAN };
            }
            return;
        }
        for (row, (number, state)) in numbers.iter_mut().zip(states).enumerate() {
            if state.rotation.is_sound() {
                *number = self.named(quantity, first + row, time, &state.rotation);
            }
        }
    }

    /// The quantity of a number of one body, whose state is sound.
    pub fn value(&self, quantity: usize, body: usize, time: f64, state: &BodyState) -> f64 {
        match &self.quantities[quantity] {
            Quantity::Formula(formula) => {
                let program: &Program = formula.program();
                let inputs: Vec<f64> =
                    program.inputs().iter().map(|&input| self.input(input, body, time, state)).collect();
                program.evaluate_one(&inputs)[0]
            }
            quantity => self.named(quantity, body, time, state),
        }
    }

    fn tensor(&self, body: usize, time: f64) -> InertiaTensor {
        let tensor = self.scene.ensemble().inertia()[body];
        if self.varies { variable_inertia::tensor_at(self.scene.torques(), body, tensor, time) } else { tensor }
    }

    /// What a formula reads.
    fn input(&self, input: Input, body: usize, time: f64, state: &BodyState) -> f64 {
        let index = usize::from(input.index);
        match input.kind {
            InputKind::Orientation => state.orientation.to_array()[index],
            InputKind::AngularVelocity => state.angular_velocity_body.to_array()[index],
            InputKind::AngularMomentum => {
                (state.orientation.conjugate() * state.angular_momentum_world).to_array()[index]
            }
            InputKind::Inertia => {
                let tensor = self.tensor(body, time);
                [tensor.xx, tensor.yy, tensor.zz, tensor.xy, tensor.xz, tensor.yz][index]
            }
            InputKind::Time => time,
            // Formulas of quantities have no other inputs.
            _ => f64::NAN,
        }
    }

    fn named(&self, quantity: &Quantity, body: usize, time: f64, state: &BodyState) -> f64 {
        let BodyState { orientation, angular_velocity_body: omega, angular_momentum_world: momentum, .. } = *state;
        match quantity {
            Quantity::KineticEnergy => state.kinetic_energy,
            Quantity::SpinRate => omega.length(),
            Quantity::AngularMomentum => momentum.length(),
            Quantity::AngularMomentumWorld(axis) => momentum.to_array()[axis % 3],
            Quantity::AngularVelocityBody(axis) => omega.to_array()[axis % 3],
            Quantity::Nutation => angle_between(orientation * omega, momentum),
            Quantity::DynamicInertia => dynamic_inertia(state),
            Quantity::SeparatrixDistance => {
                let moments = match self.moments.get(body) {
                    Some(moments) => *moments,
                    None => principal_axes(&self.tensor(body, time)).moments,
                };
                separatrix_distance(moments, dynamic_inertia(state))
            }
            Quantity::Yaw => EulerSequence::YAW_PITCH_ROLL.angles(orientation).angles[0],
            Quantity::Pitch => EulerSequence::YAW_PITCH_ROLL.angles(orientation).angles[1],
            Quantity::Roll => EulerSequence::YAW_PITCH_ROLL.angles(orientation).angles[2],
            Quantity::EulerAngle { sequence, index, .. } => sequence.angles(orientation).angles[index % 3],
            Quantity::AxisAngle { axis_body, direction_world, .. } => {
                angle_between(orientation * *axis_body, *direction_world)
            }
            Quantity::PotentialEnergy => self.potential_energy(body, orientation),
            Quantity::TotalEnergy => state.kinetic_energy + self.potential_energy(body, orientation),
            Quantity::Formula(_) => f64::NAN,
        }
    }

    fn potential_energy(&self, body: usize, orientation: DQuat) -> f64 {
        self.scene.torques().iter().filter_map(|torque| torque.potential_energy(body, orientation)).sum()
    }
}

/// The angle between two vectors, rad, which keeps small ones; NaN where one of them is zero.
fn angle_between(a: DVec3, b: DVec3) -> f64 {
    // By their largest components first, so that no product leaves the range of numbers.
    let (a, b) = (a / a.abs().max_element(), b / b.abs().max_element());
    a.cross(b).length().atan2(a.dot(b))
}

/// L²/2T, kg m².
fn dynamic_inertia(state: &BodyState) -> f64 {
    let momentum = state.angular_momentum_world.length();
    // In this order, as squares of a molecule's momentum are below the least number.
    momentum / (2.0 * state.kinetic_energy) * momentum
}

/// −1 to 1: see [`Quantity::SeparatrixDistance`].
fn separatrix_distance(moments: DVec3, dynamic_inertia: f64) -> f64 {
    let excess = dynamic_inertia - moments.y;
    let room = if excess >= 0.0 { moments.z - moments.y } else { moments.y - moments.x };
    // Without room there is no distance but what rounding makes.
    let distance = if room > 0.0 { excess / room } else { 0.0 * excess };
    if distance.is_nan() { distance } else { distance.clamp(-1.0, 1.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_angles_and_any_lengths() {
        for length in [1e-200, 1.0, 1e200] {
            let (a, b) = (DVec3::X * length, DVec3::new(1.0, 1e-12, 0.0) / length);
            assert!((angle_between(a, b) - 1e-12).abs() < 1e-27, "{length}");
        }
        assert!((angle_between(DVec3::X, -DVec3::X) - std::f64::consts::PI).abs() < 1e-15);
        assert!(angle_between(DVec3::X, DVec3::ZERO).is_nan());
    }

    #[test]
    fn the_distance_from_the_separatrix_ends_at_the_axes() {
        let moments = DVec3::new(1.0, 2.0, 4.0);
        let found = [1.0, 1.5, 2.0, 3.0, 4.0].map(|inertia| separatrix_distance(moments, inertia));
        assert_eq!(found, [-1.0, -0.5, 0.0, 0.5, 1.0]);
        assert_eq!(separatrix_distance(DVec3::ONE, 1.0), 0.0);
        assert!(separatrix_distance(moments, f64::NAN).is_nan());
    }
}
