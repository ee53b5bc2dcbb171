//! Torques that are expressions, evaluated over a tile.

use super::kept::Kept;
use crate::expression::Scratch;
use crate::math::clock::phase_after;
use crate::math::lanes::{Each, GROUPS};
use crate::math::quaternion::Quaternion;
use crate::math::real::{Real, Scalar};
use crate::math::vector::Vector;
use crate::torque::expressed::{Expressed, Given};

/// A torque that is an expression, on a tile.
pub(super) struct TileExpression<'a, R: Real> {
    expressed: &'a Expressed,
    /// The number of its instance.
    pub index: usize,
    /// The first row of its parameters, and the number of its first phase.
    first: usize,
    first_phase: usize,
    epoch: Scratch<R, GROUPS>,
    torque: Scratch<R, GROUPS>,
    /// Results of the time-dependent part.
    epochs: Vec<Each<R>>,
    /// The inputs that are components of the state.
    orientation: [Option<usize>; 4],
    angular_velocity: [Option<usize>; 3],
}

impl<'a, R: Real> TileExpression<'a, R> {
    #[inline(always)]
    pub fn new(expressed: &'a Expressed, first: usize, first_phase: usize, index: usize) -> Self {
        let input = |given: Given| expressed.torque.inputs.iter().position(|found| *found == given);
        Self {
            expressed,
            index,
            first,
            first_phase,
            orientation: [0, 1, 2, 3].map(|part| input(Given::Orientation(part))),
            angular_velocity: [0, 1, 2].map(|part| input(Given::AngularVelocity(part))),
            epoch: Scratch::new(&expressed.epoch.program),
            torque: Scratch::new(&expressed.torque.program),
            epochs: vec![Each([R::splat(0.0); GROUPS]); expressed.epoch.program.output_count()],
        }
    }

    /// Loads the parameters.
    #[inline(always)]
    pub fn load(&mut self, parameters: &[Each<R>]) {
        let Expressed { epoch, torque, .. } = self.expressed;
        for (instructions, scratch) in [(epoch, &mut self.epoch), (torque, &mut self.torque)] {
            for (index, given) in instructions.inputs.iter().enumerate() {
                if let Given::Column(column) = *given {
                    *scratch.input(index) = parameters[self.first + column];
                }
            }
        }
    }

    /// Evaluates the time-dependent part; the starts of the phases are followed by that of the time itself, if it is read. `ratios` are
    /// those of the moments, if they change. Results that are the same for all bodies are kept in `kept`, by the number of the time.
    #[inline(always)]
    pub fn form_epoch(
        &mut self,
        starts: &[Each<R>],
        rates: &[Each<R>],
        elapsed: &Each<R>,
        ratios: Option<&[Each<R>; 3]>,
        kept: Option<(&mut Kept<R::Scalar>, usize)>,
    ) {
        let Expressed { epoch, torque, .. } = self.expressed;
        for (instructions, scratch) in [(epoch, &mut self.epoch), (torque, &mut self.torque)] {
            for (index, given) in instructions.inputs.iter().enumerate() {
                match *given {
                    Given::Phase(phase) => {
                        let (start, rate) = (&starts[self.first_phase + phase], &rates[self.first_phase + phase]);
                        for (group, number) in scratch.input(index).iter_mut().enumerate() {
                            *number = phase_after(start[group], rate[group], elapsed[group]);
                        }
                    }
                    Given::Time => {
                        let start = &starts[rates.len()];
                        for (group, number) in scratch.input(index).iter_mut().enumerate() {
                            *number = start[group] + elapsed[group];
                        }
                    }
                    Given::MomentRatio(axis) => {
                        if let Some(ratios) = ratios {
                            *scratch.input(index) = ratios[axis];
                        }
                    }
                    _ => {}
                }
            }
        }
        if self.epochs.is_empty() {
            return;
        }
        match kept {
            None => epoch.program.run(&mut self.epoch, &mut self.epochs),
            Some((kept, time)) => match kept.at(time) {
                Some(numbers) => {
                    for (epoch, number) in self.epochs.iter_mut().zip(numbers) {
                        *epoch = Each([R::splat(number.to_f64()); GROUPS]);
                    }
                }
                None => {
                    epoch.program.run(&mut self.epoch, &mut self.epochs);
                    kept.keep(time, self.epochs.iter().map(|numbers| numbers[0]));
                }
            },
        }
        for (index, given) in torque.inputs.iter().enumerate() {
            if let Given::Epoch(number) = *given {
                *self.torque.input(index) = self.epochs[number];
            }
        }
    }

    /// Sets the state of a lane group. The components are written out: an index that is not a constant would force them through memory.
    #[inline(always)]
    pub fn place(&mut self, group: usize, q: Quaternion<R>, omega: Vector<R>) {
        let [x, y, z, w] = self.orientation;
        self.set(x, group, q.x);
        self.set(y, group, q.y);
        self.set(z, group, q.z);
        self.set(w, group, q.w);
        let [x, y, z] = self.angular_velocity;
        self.set(x, group, omega.x);
        self.set(y, group, omega.y);
        self.set(z, group, omega.z);
    }

    #[inline(always)]
    fn set(&mut self, input: Option<usize>, group: usize, number: R) {
        if let Some(index) = input {
            self.torque.input(index)[group] = number;
        }
    }

    /// Adds the torque to a sum, component by component.
    #[inline(always)]
    pub fn add(&mut self, sums: &mut [Each<R>]) {
        self.expressed.torque.program.accumulate(&mut self.torque, sums);
    }
}
