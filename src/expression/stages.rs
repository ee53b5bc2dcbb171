//! Splits a formula into parts that are computed at different times.
//!
//! What depends only on parameters is computed once for each body, on the host in `f64`, and stored as columns. What depends on
//! time as well is computed once for each step or stage. The rest is computed at every evaluation.

use super::graph::{Builder, Dependence, Graph, Input, InputKind, Node, Operation, Unary};

/// A formula in three parts, each of which reads the results of those before it.
#[derive(Clone, Debug, PartialEq)]
pub struct Stages {
    /// The part computed once for each body: output i is the input `Derived` i of the others.
    pub derived: Part,
    /// The part computed once for each step or stage: output i is the input `Epoch` i of the last.
    pub epoch: Part,
    /// The part computed at every evaluation: the outputs of the formula.
    pub rest: Part,
}

/// A graph and its results.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Part {
    /// The operations.
    pub graph: Graph,
    /// The results.
    pub outputs: Vec<Node>,
}

impl Graph {
    /// The formula of `outputs` in three parts, with everything computed as early as possible.
    ///
    /// Inputs, constants, truth values and mere changes of sign are not stored.
    pub fn stages(&self, outputs: &[Node]) -> Stages {
        let early = |within: Dependence| {
            move |node: Node| {
                let dependence = self.dependence(node);
                let stored = match self.operation(node) {
                    Operation::Constant(_) | Operation::Input(_) | Operation::Unary(Unary::Neg, _) => false,
                    operation => !operation.is_truth(),
                };
                stored && dependence.is_within(within) && dependence != Dependence::NOTHING
            }
        };
        let of_parameters = early(Dependence::PARAMETERS);
        let of_time = early(Dependence::PARAMETERS | Dependence::TIME);
        let epoch: Vec<Node> = self.frontier(outputs, |node| of_time(node) && !of_parameters(node), of_parameters);
        let derived = {
            let stops = |node: Node| of_parameters(node);
            let everything: Vec<Node> = outputs.iter().chain(&epoch).copied().collect();
            self.frontier(&everything, stops, |_| false)
        };
        Stages {
            derived: self.part(&derived, &[]),
            epoch: self.part(&epoch, &[(InputKind::Derived, &derived)]),
            rest: self.part(outputs, &[(InputKind::Derived, &derived), (InputKind::Epoch, &epoch)]),
        }
    }

    /// The first nodes for which `wanted` holds on the paths down from `outputs` that do not pass through `closed` ones.
    fn frontier(&self, outputs: &[Node], wanted: impl Fn(Node) -> bool, closed: impl Fn(Node) -> bool) -> Vec<Node> {
        let mut seen = vec![false; self.len()];
        let mut found = vec![];
        let mut open = outputs.to_vec();
        while let Some(node) = open.pop() {
            if std::mem::replace(&mut seen[node.index()], true) {
                continue;
            }
            if wanted(node) {
                found.push(node);
            } else if !closed(node) {
                open.extend(self.operation(node).operands());
            }
        }
        found.sort_unstable();
        found
    }

    /// The formula of `outputs`, in which nodes computed elsewhere are inputs.
    fn part(&self, outputs: &[Node], given: &[(InputKind, &[Node])]) -> Part {
        // Outputs of this part itself are computed here, even if a list contains them.
        let mut inputs = vec![None; self.len()];
        for (kind, nodes) in given {
            for (index, node) in nodes.iter().enumerate() {
                inputs[node.index()] = Some(Input::new(*kind, index as u16));
            }
        }
        let mut needed = vec![false; self.len()];
        outputs.iter().for_each(|output| needed[output.index()] = true);
        for node in self.nodes().rev() {
            if needed[node.index()] && inputs[node.index()].is_none() {
                self.operation(node).operands().for_each(|operand| needed[operand.index()] = true);
            }
        }
        let mut builder = Builder::default();
        let mut places = vec![Node(0); self.len()];
        for node in self.nodes().filter(|node| needed[node.index()]) {
            let operation = match inputs[node.index()] {
                Some(input) => Operation::Input(input),
                None => self.operation(node).with_operands(|operand| places[operand.index()]),
            };
            // A part has no more nodes than the whole, so it is never full.
            if let Ok(place) = builder.node(operation) {
                places[node.index()] = place;
                if let Some(name) = self.name(node) {
                    builder.name_node(place, name);
                }
            }
        }
        let outputs = outputs.iter().map(|output| places[output.index()]).collect();
        Part { graph: builder.into_graph(), outputs }
    }
}

#[cfg(test)]
mod tests {
    use super::super::fault::Fault;
    use super::super::graph::Binary;
    use super::*;
    use crate::math::real::Real;

    #[test]
    fn a_formula_is_cut_where_its_dependence_changes() {
        let (graph, outputs) = Graph::record::<Fault>(|recorder| {
            let input = |kind, index| recorder.input(Input::new(kind, index));
            let (a, b) = (input(InputKind::Parameter, 0), input(InputKind::Parameter, 1));
            let (time, omega) = (input(InputKind::Time, 0), input(InputKind::AngularVelocity, 0));
            // √(a b) once for each body, √(a b) + t b once for each step; b itself and −a are inputs of the rest.
            let slow = (a * b).sqrt();
            Ok(vec![omega * (slow + time * b) + omega * slow - b * omega.abs(), omega.mul_add(-a, b)])
        })
        .unwrap();
        let stages = graph.stages(&outputs);
        assert_eq!((stages.derived.outputs.len(), stages.epoch.outputs.len(), stages.rest.outputs.len()), (1, 1, 2));
        assert!(matches!(stages.derived.graph.operation(stages.derived.outputs[0]), Operation::Unary(Unary::Sqrt, _)));
        let epoch = &stages.epoch;
        assert!(matches!(epoch.graph.operation(epoch.outputs[0]), Operation::Binary(Binary::Add, ..)));
        let kinds = |part: &Part| part.graph.inputs(&part.outputs).iter().map(|input| input.kind).collect::<Vec<_>>();
        assert_eq!(kinds(epoch), [InputKind::Time, InputKind::Parameter, InputKind::Derived]);
        use InputKind::{AngularVelocity, Derived, Epoch, Parameter};
        assert_eq!(kinds(&stages.rest), [AngularVelocity, Parameter, Parameter, Derived, Epoch]);
    }
}
