//! What a formula computes from the time alone: a run's steps end near the times at which that changes fast.

use glam::{DQuat, DVec3};

use super::custom::HostState;
use super::expressed::numbers_of_body;
use super::{Torque, Value};
use crate::bodies::Ensemble;
use crate::expression::{Input, InputKind, Node, Program, Stages};

/// So many bodies are looked at if each has functions of its own.
const MOST_BODIES: usize = 16;

/// What a formula computes from the time alone.
pub(crate) struct TimeFunctions {
    /// The values at some times, of each function; of some bodies one after the other, if each has its own.
    pub values: Vec<Vec<f64>>,
    /// Whether all bodies share them.
    pub are_shared: bool,
}

impl Torque {
    /// What its formula computes from the time alone, at some times (s); `None` if it does not depend on the time other than through phases, or
    /// is evaluated at samples.
    pub(crate) fn time_functions(&self, ensemble: &Ensemble, times: &[f64]) -> Option<TimeFunctions> {
        let Stages { derived, epoch, .. } = self.model().expression()?.stages_of_time()?;
        let program = Program::new(&epoch.graph, &epoch.outputs);
        // Of the numbers formed before, those that they read, in the order of the program's inputs.
        let is_formed = |input: &&Input| input.kind == InputKind::Derived;
        let read = program.inputs().iter().filter(is_formed).map(|input| derived.outputs[usize::from(input.index)]);
        let before = Program::new(&derived.graph, &read.collect::<Vec<Node>>());
        let are_shared = self.are_shared(program.inputs()) && self.are_shared(before.inputs());
        let of_body = |body: usize| {
            let numbers = numbers_of_body(self.values(), body);
            let at_start = HostState::rigid(DQuat::IDENTITY, DVec3::ZERO, ensemble.inertia()[body], 0.0);
            let number = |input: &Input| at_start.input(*input, &numbers);
            let formed = before.evaluate_one(&before.inputs().iter().map(number).collect::<Vec<f64>>());
            let mut formed = formed.into_iter();
            let column = |input: &Input| match input.kind {
                InputKind::Time => times.to_vec(),
                InputKind::Derived => vec![formed.next().unwrap_or(f64::NAN); times.len()],
                _ => vec![number(input); times.len()],
            };
            let columns: Vec<Vec<f64>> = program.inputs().iter().map(column).collect();
            let columns: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
            program.evaluate_columns(&columns, times.len())
        };
        let count = if are_shared { 1 } else { MOST_BODIES }.min(ensemble.len());
        let values = (0..count).flat_map(|index| of_body(index * ensemble.len() / count)).collect();
        Some(TimeFunctions { values, are_shared })
    }

    /// Whether inputs are the same for all bodies.
    fn are_shared(&self, inputs: &[Input]) -> bool {
        let width = |value: &Value| match value {
            Value::Number(_) => 1,
            Value::Vector(_) => 3,
            Value::Rotation(_) => 4,
            // Formulas have no parameters of other shapes.
            _ => 0,
        };
        let of_value = |value: &Value| vec![value.is_shared(); width(value)];
        let of_parameters: Vec<bool> = self.values().iter().flat_map(of_value).collect();
        inputs.iter().all(|input| match input.kind {
            InputKind::Parameter => of_parameters[usize::from(input.index)],
            kind => matches!(kind, InputKind::Derived | InputKind::Time),
        })
    }
}
