//! A formula as a graph of scalar operations.
//!
//! Operands come before the operations that use them, so that the list of nodes is in an order of evaluation. Equal operations are one node
//! (ensured by [`Builder`]), and each node knows what it depends on.

use std::collections::{BTreeMap, HashMap};
use std::fmt;
use std::ops::{BitOr, BitOrAssign};
use std::sync::Arc;

use super::fault::Fault;
use crate::math::real::Function;

/// The most nodes of a graph.
pub const MOST_NODES: usize = 10_000;

/// A node of a [`Graph`], by its place in it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Node(pub(super) u32);

impl Node {
    /// The place in the graph.
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// The quantity of which an input is a part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum InputKind {
    /// Components x, y, z, w of the orientation.
    Orientation,
    /// Components of the angular velocity, rad/s, along the body's axes.
    AngularVelocity,
    /// Components of the angular momentum, kg m²/s, along the body's axes.
    AngularMomentum,
    /// Elements xx, yy, zz, xy, xz, yz of the inertia tensor, kg m²; along principal axes only the first three.
    Inertia,
    /// Time, s.
    Time,
    /// Phases that advance with time, in turns.
    Phase,
    /// Components of the position of the centre of mass, m, world axes.
    Position,
    /// Components of the velocity of the centre of mass, m/s, world axes.
    Velocity,
    /// A body's parameters, one number each.
    Parameter,
    /// Numbers formed from a body's parameters once, before a run ([`super::Stages::derived`]).
    Derived,
    /// Numbers formed from time (and parameters) once a step or stage ([`super::Stages::epoch`]).
    Epoch,
    /// The principal moments at the time, relative to those at the start, axis by axis.
    MomentRatio,
}

/// One number that a formula reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Input {
    /// The quantity of which it is a part.
    pub kind: InputKind,
    /// Which part, from 0.
    pub index: u16,
}

impl Input {
    /// The part `index` of `kind`.
    pub const fn new(kind: InputKind, index: u16) -> Self {
        Self { kind, index }
    }

    fn dependence(self) -> Dependence {
        match self.kind {
            InputKind::Orientation => Dependence::ATTITUDE,
            InputKind::AngularVelocity | InputKind::AngularMomentum => Dependence::VELOCITY,
            InputKind::Inertia | InputKind::Parameter | InputKind::Derived => Dependence::PARAMETERS,
            InputKind::Time | InputKind::Phase | InputKind::Epoch | InputKind::MomentRatio => Dependence::TIME,
            InputKind::Position | InputKind::Velocity => Dependence::POSITION,
        }
    }
}

/// What a node depends on; nothing at all if it is a constant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Dependence(u8);

impl Dependence {
    /// Depends on nothing.
    pub(crate) const NOTHING: Self = Self(0);
    /// Depends on parameters or the inertia: constant for each body.
    pub const PARAMETERS: Self = Self(1);
    /// Depends on time, phases or epoch values.
    pub const TIME: Self = Self(2);
    /// Depends on the angular velocity or momentum.
    pub const VELOCITY: Self = Self(4);
    /// Depends on the orientation.
    pub const ATTITUDE: Self = Self(8);
    /// Depends on the position or the velocity of the centre of mass.
    pub(crate) const POSITION: Self = Self(16);

    /// Whether it depends on any of `others`.
    pub const fn intersects(self, others: Self) -> bool {
        self.0 & others.0 != 0
    }

    /// Whether it depends on nothing but `others`.
    pub(crate) const fn is_within(self, others: Self) -> bool {
        self.0 & !others.0 == 0
    }
}

impl BitOr for Dependence {
    type Output = Self;
    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

impl BitOrAssign for Dependence {
    fn bitor_assign(&mut self, other: Self) {
        *self = *self | other;
    }
}

/// An operation of one operand.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Unary {
    /// −x.
    Neg,
    /// √x.
    Sqrt,
    /// |x|.
    Abs,
    /// The nearest integer, ties to even.
    Round,
    /// The opposite of a truth value.
    Not,
}

/// An operation of two operands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Binary {
    /// a + b.
    Add,
    /// a − b.
    Sub,
    /// a b.
    Mul,
    /// a / b.
    Div,
    /// The lesser.
    Min,
    /// The greater.
    Max,
    /// Whether a < b.
    Less,
    /// Whether both truth values hold.
    And,
    /// Whether one of two truth values holds.
    Or,
}

/// What a node does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Operation {
    /// A finite number, by the bits of its `f64`.
    Constant(u64),
    /// A known truth value.
    Truth(bool),
    /// An input.
    Input(Input),
    /// An operation of one operand.
    Unary(Unary, Node),
    /// An operation of two operands.
    Binary(Binary, Node, Node),
    /// a b + c as [`crate::math::real::Real::mul_add`].
    MulAdd(Node, Node, Node),
    /// The second operand if the first, a truth value, holds; otherwise the third.
    Select(Node, Node, Node),
    /// A function of one argument.
    Function(Function, Node),
    /// A function of two arguments.
    Function2(Function, Node, Node),
}

impl Operation {
    /// A constant.
    pub fn constant(x: f64) -> Self {
        Operation::Constant(x.to_bits())
    }

    /// The constant that it is, if it is one.
    pub fn as_constant(self) -> Option<f64> {
        match self {
            Operation::Constant(bits) => Some(f64::from_bits(bits)),
            _ => None,
        }
    }

    /// Whether it gives a truth value.
    pub(crate) fn is_truth(self) -> bool {
        matches!(
            self,
            Operation::Truth(_)
                | Operation::Unary(Unary::Not, _)
                | Operation::Binary(Binary::Less | Binary::And | Binary::Or, ..)
        )
    }

    /// The operands, in order.
    pub fn operands(self) -> impl DoubleEndedIterator<Item = Node> + Clone {
        let operands = match self {
            Operation::Constant(_) | Operation::Truth(_) | Operation::Input(_) => [None; 3],
            Operation::Unary(_, a) | Operation::Function(_, a) => [Some(a), None, None],
            Operation::Binary(_, a, b) | Operation::Function2(_, a, b) => [Some(a), Some(b), None],
            Operation::MulAdd(a, b, c) | Operation::Select(a, b, c) => [Some(a), Some(b), Some(c)],
        };
        operands.into_iter().flatten()
    }

    /// The same operation with commutative operands in the order that `stands_first` determines.
    fn with_order(self, stands_first: impl Fn(Node, Node) -> bool) -> Self {
        let ordered = |a, b| if stands_first(a, b) { (a, b) } else { (b, a) };
        match self {
            Operation::Binary(kind @ (Binary::Add | Binary::Mul | Binary::And | Binary::Or), a, b) => {
                let (a, b) = ordered(a, b);
                Operation::Binary(kind, a, b)
            }
            Operation::MulAdd(a, b, c) => {
                let (a, b) = ordered(a, b);
                Operation::MulAdd(a, b, c)
            }
            _ => self,
        }
    }

    /// A number that identifies the operation, apart from its operands.
    fn code(self) -> u64 {
        match self {
            Operation::Constant(_) | Operation::Input(_) => 0,
            Operation::Truth(truth) => 1 + u64::from(truth),
            Operation::Unary(kind, _) => 100 + kind as u64,
            Operation::Binary(kind, ..) => 200 + kind as u64,
            Operation::MulAdd(..) => 300,
            Operation::Select(..) => 301,
            Operation::Function(function, _) => 400 + function as u64,
            Operation::Function2(function, ..) => 500 + function as u64,
        }
    }

    /// The same operation on other operands.
    #[must_use]
    pub(super) fn with_operands(self, mut new: impl FnMut(Node) -> Node) -> Self {
        match self {
            Operation::Constant(_) | Operation::Truth(_) | Operation::Input(_) => self,
            Operation::Unary(operation, a) => Operation::Unary(operation, new(a)),
            Operation::Function(function, a) => Operation::Function(function, new(a)),
            Operation::Binary(operation, a, b) => Operation::Binary(operation, new(a), new(b)),
            Operation::Function2(function, a, b) => Operation::Function2(function, new(a), new(b)),
            Operation::MulAdd(a, b, c) => Operation::MulAdd(new(a), new(b), new(c)),
            Operation::Select(a, b, c) => Operation::Select(new(a), new(b), new(c)),
        }
    }
}

/// Operations in an order of evaluation.
#[derive(Clone, Default)]
pub struct Graph {
    operations: Vec<Operation>,
    dependence: Vec<Dependence>,
    /// The names that formulas give to their values; used only for readable texts.
    names: BTreeMap<Node, Arc<str>>,
}

/// Names are not part of the operations: graphs that differ only in names are equal and print alike, which fingerprints of studies rely on.
impl PartialEq for Graph {
    fn eq(&self, other: &Self) -> bool {
        self.operations == other.operations
    }
}

impl fmt::Debug for Graph {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { operations, dependence, names: _ } = self;
        formatter.debug_struct("Graph").field("operations", operations).field("dependence", dependence).finish()
    }
}

impl Graph {
    /// How many nodes there are.
    pub fn len(&self) -> usize {
        self.operations.len()
    }

    /// Whether there is no node.
    pub fn is_empty(&self) -> bool {
        self.operations.is_empty()
    }

    /// What a node does.
    pub fn operation(&self, node: Node) -> Operation {
        self.operations[node.index()]
    }

    /// What a node depends on.
    pub fn dependence(&self, node: Node) -> Dependence {
        self.dependence[node.index()]
    }

    /// The constant that a node is, if it is one.
    pub fn constant(&self, node: Node) -> Option<f64> {
        self.operation(node).as_constant()
    }

    /// The name that the formula gives to a node, if any; for a vector's component, followed by the component.
    pub(crate) fn name(&self, node: Node) -> Option<&Arc<str>> {
        self.names.get(&node)
    }

    /// Gives a node a name, unless it has one: of equal values the first name stands. Constants are written as they are.
    pub(super) fn name_node(&mut self, node: Node, name: &Arc<str>) {
        if !matches!(self.operation(node), Operation::Constant(_) | Operation::Truth(_)) {
            self.names.entry(node).or_insert_with(|| Arc::clone(name));
        }
    }

    /// All nodes, in order.
    pub fn nodes(&self) -> impl DoubleEndedIterator<Item = Node> + use<> {
        (0..self.operations.len() as u32).map(Node)
    }

    /// The nodes that `outputs` need, operands before their uses.
    pub fn live(&self, outputs: &[Node]) -> Vec<Node> {
        self.live_above(outputs, |_| false)
    }

    /// The same where nodes with `is_leaf` need no operands.
    pub(crate) fn live_above(&self, outputs: &[Node], is_leaf: impl Fn(Node) -> bool) -> Vec<Node> {
        let mut needed = vec![false; self.len()];
        for output in outputs {
            needed[output.index()] = true;
        }
        for node in self.nodes().rev() {
            if needed[node.index()] && !is_leaf(node) {
                self.operation(node).operands().for_each(|operand| needed[operand.index()] = true);
            }
        }
        self.nodes().filter(|node| needed[node.index()]).collect()
    }

    /// The inputs that `outputs` need, in the order of their kinds and indices.
    pub fn inputs(&self, outputs: &[Node]) -> Vec<Input> {
        let input = |node: Node| match self.operation(node) {
            Operation::Input(input) => Some(input),
            _ => None,
        };
        let mut inputs: Vec<Input> = self.live(outputs).into_iter().filter_map(input).collect();
        inputs.sort_unstable();
        inputs
    }

    /// What `outputs` depend on.
    pub(crate) fn dependence_of(&self, outputs: &[Node]) -> Dependence {
        outputs.iter().fold(Dependence::NOTHING, |sum, output| sum | self.dependence(*output))
    }

    /// The graph of only what `outputs` need, and their nodes in it.
    ///
    /// It does not depend on the order in which the operations were recorded: operands of commutative operations are in a canonical order
    /// (constants, inputs, then by the height and the structure of what they are), and nodes are in the order in which results need them.
    /// So equal formulas are equal graphs.
    pub(crate) fn compacted(&self, outputs: &[Node]) -> (Graph, Vec<Node>) {
        let ranks = self.ranks();
        let ordered = |operation: Operation| operation.with_order(|a, b| ranks[a.index()] <= ranks[b.index()]);
        let mut compact = Graph::default();
        let mut places: Vec<Option<Node>> = vec![None; self.len()];
        let mut open: Vec<Node> = outputs.iter().rev().copied().collect();
        while let Some(&node) = open.last() {
            let operation = ordered(self.operation(node));
            let missing = open.len();
            if places[node.index()].is_none() {
                open.extend(operation.operands().rev().filter(|operand| places[operand.index()].is_none()));
            }
            if open.len() == missing {
                open.pop();
                if places[node.index()].is_none() {
                    let placed = operation.with_operands(|operand| places[operand.index()].unwrap_or(operand));
                    let place = compact.push(placed);
                    places[node.index()] = Some(place);
                    if let Some(name) = self.name(node) {
                        compact.name_node(place, name);
                    }
                }
            }
        }
        (compact, outputs.iter().map(|output| places[output.index()].unwrap_or(*output)).collect())
    }

    /// For each node a description independent of its place: its height, its class and a digest of what is below it.
    fn ranks(&self) -> Vec<(u32, u8, u64)> {
        let mut ranks: Vec<(u32, u8, u64)> = Vec::with_capacity(self.len());
        for operation in &self.operations {
            let rank = match operation {
                Operation::Constant(bits) => (0, 0, *bits),
                Operation::Input(Input { kind, index }) => (0, 1, (*kind as u64) << 16 | u64::from(*index)),
                _ => {
                    let operation = operation.with_order(|a, b| ranks[a.index()] <= ranks[b.index()]);
                    let below = operation.operands().map(|operand| ranks[operand.index()]);
                    let height = below.clone().map(|rank| rank.0).max().unwrap_or(0);
                    let words = below.flat_map(|(height, class, digest)| [u64::from(height), u64::from(class), digest]);
                    // A multiplicative digest; a collision would only make two equal formulas compare unequal.
                    let digest = words.fold(operation.code(), |digest, word| {
                        let mixed = (digest ^ word).wrapping_mul(0x9e37_79b9_7f4a_7c15);
                        mixed ^ mixed >> 29
                    });
                    (height + 1, 2, digest)
                }
            };
            ranks.push(rank);
        }
        ranks
    }

    /// Appends an operation unchanged.
    pub(super) fn push(&mut self, operation: Operation) -> Node {
        let dependence = match operation {
            Operation::Input(input) => input.dependence(),
            _ => operation.operands().fold(Dependence::NOTHING, |sum, operand| sum | self.dependence(operand)),
        };
        let node = Node(self.operations.len() as u32);
        self.operations.push(operation);
        self.dependence.push(dependence);
        node
    }
}

/// A graph under construction, in which equal operations are one node.
#[derive(Clone, Debug, Default)]
pub struct Builder {
    graph: Graph,
    known: HashMap<Operation, Node>,
}

impl Builder {
    /// The graph so far.
    pub fn graph(&self) -> &Graph {
        &self.graph
    }

    /// The graph.
    pub(crate) fn into_graph(self) -> Graph {
        self.graph
    }

    /// Gives a node a name, unless it has one.
    pub(super) fn name_node(&mut self, node: Node, name: &Arc<str>) {
        self.graph.name_node(node, name);
    }

    /// The node of an operation, unsimplified: an existing one or a new one.
    pub(super) fn node(&mut self, operation: Operation) -> Result<Node, Fault> {
        if let Some(&node) = self.known.get(&operation) {
            return Ok(node);
        }
        if self.graph.len() >= MOST_NODES {
            return Err(Fault::TooManyNodes);
        }
        let node = self.graph.push(operation);
        self.known.insert(operation, node);
        Ok(node)
    }

    /// The node of a constant.
    ///
    /// # Errors
    ///
    /// If `x` is not finite, or the graph is full.
    pub fn constant(&mut self, x: f64) -> Result<Node, Fault> {
        if !x.is_finite() {
            return Err(Fault::NotFinite);
        }
        self.node(Operation::constant(x))
    }
}
