//! Selects the instruction for each node.
//!
//! An interpreter spends its time reading operands and storing results. A product that only one sum reads, or a sum that only the next one
//! reads, is therefore merged into that instruction: components of cross products and dot products are one instruction each. Some
//! instructions have several results: sine and cosine of one argument, or of one eccentric anomaly, and rotated vectors. The operations and
//! their roundings are those of the graph.

use std::collections::HashMap;

use super::graph::{Binary, Graph, Node, Operation, Unary};
use super::program::Kind;
use super::rotations::{Rotation, rotations};
use crate::math::real::Function;

/// Operands of the longest instruction.
pub(super) const MOST_OPERANDS: usize = 7;
/// The most results of an instruction.
pub(super) const MOST_RESULTS: usize = 3;

/// The results of an instruction in order, as far as they are used.
type Results = [Option<Node>; MOST_RESULTS];

/// An instruction whose operands are still nodes.
#[derive(Clone, Copy)]
pub(super) struct Selected {
    pub kind: Kind,
    operands: [Node; MOST_OPERANDS],
    count: usize,
}

impl Selected {
    fn new<const N: usize>(kind: Kind, of: [Node; N]) -> Self {
        let mut operands = [Node::default(); MOST_OPERANDS];
        operands[..N].copy_from_slice(&of);
        Self { kind, operands, count: N }
    }

    /// What the instruction reads.
    pub fn operands(&self) -> &[Node] {
        &self.operands[..self.count]
    }
}

/// Chooses the instructions of a graph.
pub(super) struct Selection<'a> {
    graph: &'a Graph,
    /// Whether at most one operation, or one result, reads a node.
    is_read_once: Vec<bool>,
    /// The instruction of nodes that are computed together with others, and all its results.
    joint: HashMap<Node, (Selected, Results)>,
}

/// A product, and whether it is negated.
type Product = (Node, Node, bool);

/// The arguments that sine and cosine share; two for Kepler's equation.
type Pair = (Node, Option<Node>);

impl<'a> Selection<'a> {
    /// A selection for the nodes that results use.
    pub fn new(graph: &'a Graph, live: &[Node], outputs: &[Node]) -> Self {
        let mut reads = vec![0_u32; graph.len()];
        let read = live.iter().flat_map(|&node| graph.operation(node).operands()).chain(outputs.iter().copied());
        read.for_each(|node| reads[node.index()] += 1);
        let mut joint = HashMap::new();
        let mut pairs: HashMap<Pair, Results> = HashMap::new();
        for &node in live {
            if let Some((pair, member)) = pair_of(graph.operation(node)) {
                pairs.entry(pair).or_default()[member] = Some(node);
            }
        }
        for ((a, b), members) in pairs {
            let selected = b.map_or(Selected::new(Kind::SinCos, [a]), |b| Selected::new(Kind::Kepler, [a, b]));
            joint.extend(members.into_iter().flatten().map(|member| (member, (selected, members))));
        }
        for Rotation { results, operands, is_inverse } in rotations(graph, live) {
            let selected = Selected::new(Kind::Rotate(is_inverse), operands);
            joint.extend(results.map(|result| (result, (selected, results.map(Some)))));
        }
        Self { graph, is_read_once: reads.into_iter().map(|count| count <= 1).collect(), joint }
    }

    /// All results of a node's instruction.
    pub fn results(&self, node: Node) -> Results {
        self.joint.get(&node).map_or([Some(node), None, None], |(_, results)| *results)
    }

    /// The instruction of a node; none for inputs and constants.
    pub fn of(&self, node: Node) -> Option<Selected> {
        if let Some((selected, _)) = self.joint.get(&node) {
            return Some(*selected);
        }
        let one = |kind, a| Some(Selected::new(kind, [a]));
        match self.graph.operation(node) {
            Operation::Constant(_) | Operation::Truth(_) | Operation::Input(_) => None,
            Operation::Unary(Unary::Neg, a) => match self.graph.operation(a) {
                Operation::Binary(Binary::Mul, x, y) => Some(Selected::new(Kind::NegMul, [x, y])),
                _ => one(Kind::Neg, a),
            },
            Operation::Unary(Unary::Sqrt, a) => one(Kind::Sqrt, a),
            Operation::Unary(Unary::Abs, a) => one(Kind::Abs, a),
            Operation::Unary(Unary::Round, a) => one(Kind::Round, a),
            Operation::Unary(Unary::Not, a) => one(Kind::Not, a),
            Operation::Binary(kind, a, b) => {
                let two = |kind| Selected::new(kind, [a, b]);
                Some(match kind {
                    Binary::Add => self.sum(a, b),
                    Binary::Sub => self.difference(a, b),
                    Binary::Mul => self.product(a, b),
                    Binary::Div => two(Kind::Div),
                    Binary::Min => two(Kind::Min),
                    Binary::Max => two(Kind::Max),
                    Binary::Less => two(Kind::Less),
                    Binary::And => two(Kind::And),
                    Binary::Or => two(Kind::Or),
                })
            }
            Operation::MulAdd(a, b, c) => Some(self.fused(a, b, c)),
            Operation::Select(condition, a, b) => Some(Selected::new(Kind::Select, [condition, a, b])),
            Operation::Function(function, a) => one(Kind::One(function), a),
            Operation::Function2(function, a, b) => Some(Selected::new(Kind::Two(function), [a, b])),
        }
    }

    fn without_sign(&self, node: Node) -> (Node, bool) {
        match self.graph.operation(node) {
            Operation::Unary(Unary::Neg, x) => (x, true),
            _ => (node, false),
        }
    }

    /// The factors of a product that nothing else reads.
    fn own_product(&self, node: Node) -> Option<[Node; 2]> {
        match self.graph.operation(node) {
            Operation::Binary(Binary::Mul, a, b) if self.is_read_once[node.index()] => Some([a, b]),
            _ => None,
        }
    }

    /// The same for a product with a sign, which nothing else reads either.
    fn own_signed_product(&self, node: Node) -> Option<Product> {
        let (inner, is_negative) = self.without_sign(node);
        let is_own = self.is_read_once[node.index()];
        self.own_product(inner).filter(|_| is_own).map(|[a, b]| (a, b, is_negative))
    }

    fn product(&self, a: Node, b: Node) -> Selected {
        match (self.own_product(a), self.own_product(b)) {
            (Some([x, y]), _) => Selected::new(Kind::MulMul, [x, y, b]),
            (None, Some([x, y])) => Selected::new(Kind::MulMul, [x, y, a]),
            (None, None) => Selected::new(Kind::Mul, [a, b]),
        }
    }

    fn sum(&self, a: Node, b: Node) -> Selected {
        match (self.own_product(a), self.own_product(b)) {
            (Some([x, y]), Some([z, w])) => Selected::new(Kind::AddProducts, [x, y, z, w]),
            (Some([x, y]), None) => Selected::new(Kind::MulThenAdd, [x, y, b]),
            (None, Some([x, y])) => Selected::new(Kind::MulThenAdd, [x, y, a]),
            (None, None) => Selected::new(Kind::Add, [a, b]),
        }
    }

    fn difference(&self, a: Node, b: Node) -> Selected {
        match (self.own_product(a), self.own_product(b)) {
            (Some([x, y]), Some([z, w])) => Selected::new(Kind::SubProducts, [x, y, z, w]),
            (Some([x, y]), None) => Selected::new(Kind::MulThenSub, [x, y, b]),
            (None, Some([x, y])) => Selected::new(Kind::SubMul, [x, y, a]),
            (None, None) => Selected::new(Kind::Sub, [a, b]),
        }
    }

    /// Two factors without their signs.
    fn factors(&self, a: Node, b: Node) -> Product {
        let ((a, a_is_negative), (b, b_is_negative)) = (self.without_sign(a), self.without_sign(b));
        (a, b, a_is_negative != b_is_negative)
    }

    /// a b + c.
    fn fused(&self, a: Node, b: Node, c: Node) -> Selected {
        let (a, b, first) = self.factors(a, b);
        if let Some((x, y, second)) = self.own_signed_product(c) {
            return Selected::new(Kind::Products2([first, second]), [a, b, x, y]);
        }
        // A negated sum may differ from the sum of negated terms in the sign of a zero.
        if let Operation::MulAdd(x, y, z) = self.graph.operation(c)
            && self.is_read_once[c.index()]
        {
            let (x, y, second) = self.factors(x, y);
            if let Some((z, w, third)) = self.own_signed_product(z) {
                return Selected::new(Kind::Products3([first, second, third]), [a, b, x, y, z, w]);
            }
            let (z, third) = self.without_sign(z);
            return Selected::new(Kind::MulAdd2([first, second, third]), [a, b, x, y, z]);
        }
        let (c, second) = self.without_sign(c);
        Selected::new(Kind::MulAdd([first, second]), [a, b, c])
    }
}

/// The arguments of a function that is computed together with its partner, and whether it is the first or second of the two.
fn pair_of(operation: Operation) -> Option<(Pair, usize)> {
    match operation {
        Operation::Function(Function::Sin, a) => Some(((a, None), 0)),
        Operation::Function(Function::Cos, a) => Some(((a, None), 1)),
        Operation::Function2(Function::KeplerSin, a, b) => Some(((a, Some(b)), 0)),
        Operation::Function2(Function::KeplerCos, a, b) => Some(((a, Some(b)), 1)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::super::Program;
    use super::super::fault::Fault;
    use super::super::graph::{Input, InputKind};
    use super::*;
    use crate::math::real::Real;

    const NUMBERS: [f64; 6] = [0.7, -1.3, 2.9, 0.31, -5.3, 1.7];

    fn signed<R: Real>(is_negative: bool, x: R) -> R {
        if is_negative { -x } else { x }
    }

    /// The result of every instruction of several operations, for six numbers.
    fn joined<R: Real>([a, b, c, d, e, f]: [R; 6]) -> Vec<(Kind, R)> {
        let mut all = vec![
            (Kind::NegMul, -(a * b)),
            (Kind::MulMul, a * b * c),
            (Kind::MulThenAdd, a * b + c),
            (Kind::MulThenAdd, c + a * b),
            (Kind::MulThenSub, a * b - c),
            (Kind::SubMul, c - a * b),
            (Kind::AddProducts, a * b + c * d),
            (Kind::SubProducts, a * b - c * d),
        ];
        for signs in 0..8 {
            let [p, q, s] = [1, 2, 4].map(|bit| signs & bit != 0);
            if !s {
                all.push((Kind::MulAdd([p, q]), signed(p, a).mul_add(b, signed(q, c))));
                all.push((Kind::Products2([p, q]), signed(p, a).mul_add(b, signed(q, c * d))));
            }
            let inner = signed(q, c).mul_add(d, signed(s, e * f));
            all.push((Kind::Products3([p, q, s]), signed(p, a).mul_add(b, inner)));
            all.push((Kind::MulAdd2([p, q, s]), signed(p, a).mul_add(b, signed(q, c).mul_add(d, signed(s, e)))));
        }
        all
    }

    #[test]
    fn joined_operations_are_one_instruction_and_give_what_they_give_apart() {
        let mut kinds = Vec::new();
        let (graph, nodes) = Graph::record::<Fault>(|recorder| {
            let number = |index: u16| recorder.input(Input::new(InputKind::Parameter, index));
            let (of_kinds, symbols) = joined([0, 1, 2, 3, 4, 5].map(number)).into_iter().unzip();
            kinds = of_kinds;
            Ok(symbols)
        })
        .unwrap();
        let columns = NUMBERS.map(|number| [number; 5]);
        for ((&node, &kind), (_, expected)) in nodes.iter().zip(&kinds).zip(joined(NUMBERS)) {
            let program = Program::new(&graph, &[node]);
            let found: Vec<Kind> = program.instructions.iter().map(|instruction| instruction.kind).collect();
            assert_eq!(found, [kind]);
            let number = |input: &Input| usize::from(input.index);
            let numbers: Vec<f64> = program.inputs().iter().map(|input| NUMBERS[number(input)]).collect();
            assert_eq!(program.evaluate_one(&numbers), [expected], "{kind:?}");
            // Lanes round a sum of products once.
            let of_lanes: Vec<&[f64]> = program.inputs().iter().map(|input| &columns[number(input)][..]).collect();
            for found in &program.evaluate_columns(&of_lanes, 5)[0] {
                assert!((found - expected).abs() < 1e-14, "{kind:?}: {found} instead of {expected}");
            }
        }
    }

    #[test]
    fn what_is_read_elsewhere_is_formed_once_and_apart() {
        let counted = |form: &dyn Fn([crate::expression::Symbol; 3]) -> Vec<crate::expression::Symbol>| {
            let (graph, nodes) = Graph::record::<Fault>(|recorder| {
                Ok(form([0, 1, 2].map(|index| recorder.input(Input::new(InputKind::Parameter, index)))))
            })
            .unwrap();
            Program::new(&graph, &nodes).instructions.len()
        };
        assert_eq!(counted(&|[a, b, c]| vec![a * b + c]), 1);
        assert_eq!(counted(&|[a, b, c]| vec![a * b + c, a * b]), 2);
        assert_eq!(counted(&|[a, b, c]| vec![a * b + c, a * b - c]), 3);
    }
}
