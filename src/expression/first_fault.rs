//! Finds the operation of a formula that first gives no finite number.

use super::graph::{Binary, Graph, Input, Node, Operation, Unary};
use super::{Expression, Program};

impl Expression {
    /// The operation, with its operands, that makes a result infinite or NaN; `None` if all results are finite. Evaluated in `f64`.
    pub(crate) fn first_fault(&self, input: impl FnMut(Input) -> f64) -> Option<String> {
        let (graph, outputs) = (self.graph(), self.outputs());
        let is_number = |node: &Node| !graph.operation(*node).is_truth();
        let nodes: Vec<Node> = graph.live(outputs).into_iter().filter(is_number).collect();
        let program = Program::new(graph, &nodes);
        let inputs: Vec<f64> = program.inputs().iter().copied().map(input).collect();
        let numbers = program.evaluate_one(&inputs);
        let value = |node: Node| nodes.binary_search(&node).map_or(0.0, |place| numbers[place]);
        let mut node = *outputs.iter().find(|output| !value(**output).is_finite())?;
        // Descend until the operands are finite.
        while let Some(operand) = graph.operation(node).operands().find(|operand| !value(*operand).is_finite()) {
            node = operand;
        }
        Some(described(graph, node, value))
    }
}

fn described(graph: &Graph, node: Node, value: impl Fn(Node) -> f64) -> String {
    let joined = |a: Node, sign: &str, b: Node| format!("{:?} {sign} {:?}", value(a), value(b));
    let call = |name: String, operands: &[Node]| {
        let operands: Vec<String> = operands.iter().map(|operand| format!("{:?}", value(*operand))).collect();
        format!("{}({})", name.to_lowercase(), operands.join(", "))
    };
    match graph.operation(node) {
        Operation::Constant(bits) => format!("{:?}", f64::from_bits(bits)),
        Operation::Truth(truth) => truth.to_string(),
        Operation::Input(input) => format!("an input ({:?}) that is not finite", input.kind),
        Operation::Unary(Unary::Neg, a) => format!("-({:?})", value(a)),
        Operation::Unary(kind, a) => call(format!("{kind:?}"), &[a]),
        Operation::Binary(Binary::Add, a, b) => joined(a, "+", b),
        Operation::Binary(Binary::Sub, a, b) => joined(a, "-", b),
        Operation::Binary(Binary::Mul, a, b) => joined(a, "*", b),
        Operation::Binary(Binary::Div, a, b) => joined(a, "/", b),
        Operation::Binary(kind, a, b) => call(format!("{kind:?}"), &[a, b]),
        Operation::MulAdd(a, b, c) => format!("{} + {:?}", joined(a, "*", b), value(c)),
        Operation::Select(_, a, b) => call("select".to_owned(), &[a, b]),
        Operation::Function(function, a) => call(format!("{function:?}"), &[a]),
        Operation::Function2(function, a, b) => call(format!("{function:?}"), &[a, b]),
    }
}

#[cfg(test)]
mod tests {
    use super::super::{InputKind, Shape, Symbols};
    use super::*;

    #[test]
    fn the_operation_is_that_which_makes_the_result_no_number() {
        let symbols = Symbols::inertia().parameter("k", Shape::Number).expect("a name");
        for (text, expected) in [
            ("1 + 2 * sqrt(k - time)", Some("sqrt(-1.5)")),
            ("time / (k - 0.5)", Some("2.0 / 0.0")),
            ("ln(time - 2) * 0.1 + k", Some("ln(0.0)")),
            ("pow(-time, k) + sqrt(time)", Some("pow(-2.0, 0.5)")),
            ("exp(1000 * time)", Some("exp(2000.0)")),
            ("select(time < 1, sqrt(-time), time)", None),
            ("sqrt(time) + k", None),
        ] {
            let formula = Expression::parse(text, &symbols, Shape::Number).unwrap_or_else(|error| panic!("{error}"));
            let found = formula.first_fault(|input| if input.kind == InputKind::Time { 2.0 } else { 0.5 });
            assert_eq!(found.as_deref(), expected, "{text}");
        }
    }
}
