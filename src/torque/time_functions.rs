//! What a formula computes from the time alone: a run's steps end near the times at which that changes fast.

use std::collections::BTreeSet;

use glam::{DQuat, DVec3};

use super::custom::{ExpressionModel, HostState};
use super::expressed::numbers_of_body;
use super::{Torque, Value};
use crate::bodies::Ensemble;
use crate::expression::graph::{Binary, Operation, Unary};
use crate::expression::{Dependence, Input, InputKind, Node, Program, Stages};

/// So many bodies are looked at if each has functions of its own, spread over the ensemble, and besides, of so many, those with the least, the
/// greatest and the smallest number of each kind that the functions read: a few pulses that are narrower than the others are among these.
const SPREAD_BODIES: usize = 16;
const COMPARED_BODIES: usize = 4096;
const MOST_BODIES: usize = 64;

/// What a formula computes from the time alone: functions that all bodies share, or those of some bodies.
pub(crate) struct TimeFunctions {
    program: Program,
    /// Whether all bodies share them.
    pub are_shared: bool,
    /// By body: the inputs of the program; `None` for the time.
    inputs: Vec<Vec<Option<f64>>>,
}

/// Nodes of a graph that depend on the time.
#[derive(Debug, Default)]
struct TimeNodes {
    /// Those that all bodies share.
    shared: Vec<Node>,
    /// Those of each body's own.
    own: Vec<Node>,
}

impl TimeFunctions {
    /// The values at some times, s, of each function; of some bodies one after the other, if each has its own.
    pub fn values(&self, times: &[f64]) -> Vec<Vec<f64>> {
        let of_body = |inputs: &Vec<Option<f64>>| {
            let column = |input: &Option<f64>| input.map_or_else(|| times.to_vec(), |number| vec![number; times.len()]);
            let columns: Vec<Vec<f64>> = inputs.iter().map(column).collect();
            let columns: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
            self.program.evaluate_columns(&columns, times.len())
        };
        self.inputs.iter().flat_map(of_body).collect()
    }
}

impl Torque {
    /// What its formula computes from the time alone, and what the forces on a centre of mass do that is integrated with it; nothing if it does not
    /// depend on the time other than through phases, or is evaluated at samples. Factors and summands of each body's own that are constant are
    /// left out: in `a * exp(-(time - t)^2)` the exponential is shared where t is.
    pub(crate) fn time_functions(&self, ensemble: &Ensemble) -> Vec<TimeFunctions> {
        let stages = self.model().expression().map_or(Vec::new(), ExpressionModel::stages_of_time);
        let of_stages = |stages: &Stages| {
            let TimeNodes { shared, own } = self.time_nodes(stages);
            let both = [(shared, true), (own, false)].into_iter().filter(|(nodes, _)| !nodes.is_empty());
            both.map(|(nodes, are_shared)| self.functions_of(stages, &nodes, are_shared, ensemble)).collect::<Vec<_>>()
        };
        stages.iter().flat_map(of_stages).collect()
    }

    /// What of the results that are formed from the time all bodies share, up to numbers of their own that do not change, and what they do not.
    fn time_nodes(&self, Stages { derived, epoch, .. }: &Stages) -> TimeNodes {
        let (graph, mut found) = (&epoch.graph, TimeNodes::default());
        let is_shared = |node: Node| {
            let is_shared = |input: &Input| match input.kind {
                InputKind::Derived => {
                    self.are_shared(&derived.graph.inputs(&[derived.outputs[usize::from(input.index)]]))
                }
                _ => self.are_shared(std::slice::from_ref(input)),
            };
            graph.inputs(&[node]).iter().all(is_shared)
        };
        let mut left = epoch.outputs.clone();
        let mut seen = BTreeSet::new();
        while let Some(node) = left.pop() {
            let changes = |node: &Node| graph.dependence(*node).intersects(Dependence::TIME);
            if !changes(&node) || !seen.insert(node) {
                continue;
            }
            let operation = graph.operation(node);
            match operation {
                _ if is_shared(node) => found.shared.push(node),
                Operation::Binary(Binary::Div, _, divisor) if changes(&divisor) => found.own.push(node),
                Operation::Unary(Unary::Neg, _)
                | Operation::Binary(Binary::Add | Binary::Sub | Binary::Mul | Binary::Div, ..)
                | Operation::MulAdd(..) => left.extend(operation.operands()),
                _ => found.own.push(node),
            }
        }
        found
    }

    fn functions_of(
        &self,
        Stages { derived, epoch, .. }: &Stages,
        nodes: &[Node],
        are_shared: bool,
        ensemble: &Ensemble,
    ) -> TimeFunctions {
        let program = Program::new(&epoch.graph, nodes);
        // Of the numbers formed before, those that they read, in the order of the program's inputs.
        let is_formed = |input: &&Input| input.kind == InputKind::Derived;
        let read = program.inputs().iter().filter(is_formed).map(|input| derived.outputs[usize::from(input.index)]);
        let before = Program::new(&derived.graph, &read.collect::<Vec<Node>>());
        let of_body = |body: usize| {
            let numbers = numbers_of_body(self.values(), body);
            let at_start = HostState::rigid(DQuat::IDENTITY, DVec3::ZERO, ensemble.inertia()[body], 0.0);
            let number = |input: &Input| at_start.input(*input, &numbers);
            let formed = before.evaluate_one(&before.inputs().iter().map(number).collect::<Vec<f64>>());
            let mut formed = formed.into_iter();
            let given = |input: &Input| match input.kind {
                InputKind::Time => None,
                InputKind::Derived => Some(formed.next().unwrap_or(f64::NAN)),
                _ => Some(number(input)),
            };
            program.inputs().iter().map(given).collect()
        };
        let count = if are_shared { 1 } else { COMPARED_BODIES }.min(ensemble.len());
        let inputs: Vec<_> = (0..count).map(|index| of_body(index * ensemble.len() / count)).collect();
        let looked_at = looked_at(&inputs);
        TimeFunctions { program, are_shared, inputs: looked_at.into_iter().map(|body| inputs[body].clone()).collect() }
    }

    /// Whether its formula depends on the time other than through phases, and is not evaluated at samples.
    pub(crate) fn reads_time(&self) -> bool {
        self.model().expression().is_some_and(ExpressionModel::reads_time)
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
            kind => kind == InputKind::Time,
        })
    }
}

/// Which bodies stand for all: some that are spread over them, and those with extreme inputs.
fn looked_at(inputs: &[Vec<Option<f64>>]) -> BTreeSet<usize> {
    let spread = SPREAD_BODIES.min(inputs.len());
    let mut found: BTreeSet<usize> = (0..spread).map(|index| index * inputs.len() / spread).collect();
    for input in 0..inputs[0].len() {
        let of_body =
            |body: usize| inputs[body][input].filter(|number| number.is_finite()).map(|number| (number, body));
        let numbers: Vec<(f64, usize)> = (0..inputs.len()).filter_map(of_body).collect();
        let by_value = |a: &&(f64, usize), b: &&(f64, usize)| a.0.total_cmp(&b.0);
        let by_size = |a: &&(f64, usize), b: &&(f64, usize)| a.0.abs().total_cmp(&b.0.abs());
        let ends = [numbers.iter().min_by(by_size), numbers.iter().min_by(by_value), numbers.iter().max_by(by_value)];
        let room = MOST_BODIES.saturating_sub(found.len());
        found.extend(ends.into_iter().flatten().map(|(_, body)| *body).take(room));
    }
    found
}
