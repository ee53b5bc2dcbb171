//! A formula lowered to instructions of a register machine.
//!
//! Instructions read inputs and constants where they are and write to slots, which are used again as soon as nothing asks
//! for what is in them. A sign before an operand is taken into the instruction, and sine and cosine of one argument, or of
//! one eccentric anomaly, are one instruction; none of this changes a bit of the results.

use std::collections::HashMap;

use super::graph::{Binary, Graph, Input, Node, Operation, Unary};
use crate::math::real::Function;

/// Instructions that form some results from inputs. [`Program::evaluate_columns`] carries them out.
#[derive(Clone, Debug, PartialEq)]
pub struct Program {
    pub(super) inputs: Vec<Input>,
    pub(super) constants: Vec<f64>,
    /// Slots of numbers.
    pub(super) slots: usize,
    /// Slots of truth values.
    pub(super) truths: usize,
    pub(super) instructions: Vec<Instruction>,
    /// How many instructions of one kind follow each other.
    pub(super) runs: Vec<(Kind, u16)>,
    pub(super) outputs: Vec<u16>,
}

/// One operation. Operands count inputs first, then constants, then slots; truth values have a count of their own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Instruction {
    pub(super) kind: Kind,
    /// Where the result goes.
    pub(super) to: u16,
    pub(super) a: u16,
    pub(super) b: u16,
    /// The third operand, or where the second result goes.
    pub(super) c: u16,
}

impl Instruction {
    /// Its result's place and those of `a`, `b` and `c`.
    #[inline(always)]
    pub(super) fn places(&self) -> [usize; 4] {
        [self.to.into(), self.a.into(), self.b.into(), self.c.into()]
    }
}

/// What an instruction does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Kind {
    Add,
    Sub,
    Mul,
    /// −(a b).
    NegMul,
    Div,
    /// a b + c.
    MulAdd,
    /// a b − c.
    MulSub,
    /// −a b + c.
    NegMulAdd,
    /// −a b − c.
    NegMulSub,
    Neg,
    Sqrt,
    Abs,
    Round,
    Min,
    Max,
    Less,
    And,
    Or,
    Not,
    Select,
    /// sin a, and cos a to c.
    SinCos,
    /// sin E and, to c, cos E of Kepler's equation.
    Kepler,
    /// A function of one argument.
    One(Function),
    /// A function of two arguments.
    Two(Function),
}

impl Program {
    /// The program that forms `outputs`.
    pub fn new(graph: &Graph, outputs: &[Node]) -> Self {
        Lowering::new(graph, outputs).program(outputs)
    }

    /// What the program reads, in the order in which [`Program::evaluate_columns`] takes it.
    pub fn inputs(&self) -> &[Input] {
        &self.inputs
    }

    /// How many results it forms.
    pub fn output_count(&self) -> usize {
        self.outputs.len()
    }

    /// How many instructions it has.
    pub fn len(&self) -> usize {
        self.instructions.len()
    }

    /// Whether it has no instructions: its results are inputs and constants.
    pub fn is_empty(&self) -> bool {
        self.instructions.is_empty()
    }

    /// How many numbers a body needs at once beside inputs and constants.
    pub fn slot_count(&self) -> usize {
        self.slots
    }
}

/// An instruction whose operands are still nodes.
#[derive(Clone, Copy)]
struct Selected {
    kind: Kind,
    operands: [Option<Node>; 3],
}

/// What a node is known by once it is formed: sine and cosine of one argument stand for each other's instruction.
type Pair = (Node, Option<Node>);

struct Lowering<'a> {
    graph: &'a Graph,
    /// Nodes to form, in order; of a pair the one that is met first.
    order: Vec<(Node, Selected)>,
    /// For each node, how many uses are left.
    uses: Vec<u32>,
    /// The members of each pair that are needed: sine and cosine.
    pairs: HashMap<Pair, [Option<Node>; 2]>,
}

impl<'a> Lowering<'a> {
    fn new(graph: &'a Graph, outputs: &[Node]) -> Self {
        let mut lowering = Self { graph, order: vec![], uses: vec![0; graph.len()], pairs: HashMap::new() };
        let live = graph.live(outputs);
        for &node in &live {
            if let Some((pair, member)) = pair_of(graph.operation(node)) {
                lowering.pairs.entry(pair).or_default()[member] = Some(node);
            }
        }
        lowering.sort(outputs);
        lowering
    }

    /// Finds what is needed, depth first.
    fn sort(&mut self, outputs: &[Node]) {
        #[derive(Clone, Copy, PartialEq)]
        enum State {
            New,
            Open,
            Done,
        }
        let mut states = vec![State::New; self.graph.len()];
        let mut open: Vec<Node> = outputs.iter().rev().copied().collect();
        while let Some(&node) = open.last() {
            let state = states[node.index()];
            let Some(selected) = self.selected(node) else {
                states[node.index()] = State::Done;
                open.pop();
                continue;
            };
            match state {
                State::New => {
                    states[node.index()] = State::Open;
                    let operands = selected.operands.into_iter().rev().flatten();
                    open.extend(operands.filter(|operand| states[operand.index()] == State::New));
                }
                State::Open => {
                    states[node.index()] = State::Done;
                    selected.operands.into_iter().flatten().for_each(|operand| self.uses[operand.index()] += 1);
                    if let Some((pair, _)) = pair_of(self.graph.operation(node)) {
                        let members = self.pairs.get(&pair).copied().unwrap_or_default();
                        members.into_iter().flatten().for_each(|member| states[member.index()] = State::Done);
                    }
                    self.order.push((node, selected));
                    open.pop();
                }
                State::Done => {
                    open.pop();
                }
            }
        }
        self.gather();
        // Results are never given up.
        outputs.iter().for_each(|output| self.uses[output.index()] += 1);
    }

    /// Orders by height, and within one height by kind: neighbours then do not wait for each other, and those of one kind
    /// are carried out by one jump.
    fn gather(&mut self) {
        let mut heights = vec![0_u32; self.graph.len()];
        for node in self.graph.nodes() {
            let operands = self.graph.operation(node).operands();
            heights[node.index()] = operands.map(|operand| heights[operand.index()] + 1).max().unwrap_or(0);
        }
        // Sines and cosines of one argument are of one height.
        self.order.sort_by_key(|(node, selected)| (heights[node.index()], selected.kind));
    }

    /// The instruction of a node; none for inputs and constants.
    fn selected(&self, node: Node) -> Option<Selected> {
        let of = |kind, operands| Some(Selected { kind, operands });
        let one = |kind, a| of(kind, [Some(a), None, None]);
        let two = |kind, a, b| of(kind, [Some(a), Some(b), None]);
        match self.graph.operation(node) {
            Operation::Constant(_) | Operation::Truth(_) | Operation::Input(_) => None,
            Operation::Unary(Unary::Neg, a) => match self.graph.operation(a) {
                Operation::Binary(Binary::Mul, x, y) => two(Kind::NegMul, x, y),
                _ => one(Kind::Neg, a),
            },
            Operation::Unary(Unary::Sqrt, a) => one(Kind::Sqrt, a),
            Operation::Unary(Unary::Abs, a) => one(Kind::Abs, a),
            Operation::Unary(Unary::Round, a) => one(Kind::Round, a),
            Operation::Unary(Unary::Not, a) => one(Kind::Not, a),
            Operation::Binary(kind, a, b) => {
                let kind = match kind {
                    Binary::Add => Kind::Add,
                    Binary::Sub => Kind::Sub,
                    Binary::Mul => Kind::Mul,
                    Binary::Div => Kind::Div,
                    Binary::Min => Kind::Min,
                    Binary::Max => Kind::Max,
                    Binary::Less => Kind::Less,
                    Binary::And => Kind::And,
                    Binary::Or => Kind::Or,
                };
                two(kind, a, b)
            }
            Operation::MulAdd(a, b, c) => {
                let ((a, a_negative), (b, b_negative), (c, c_negative)) =
                    (self.without_sign(a), self.without_sign(b), self.without_sign(c));
                let kind = match (a_negative != b_negative, c_negative) {
                    (false, false) => Kind::MulAdd,
                    (false, true) => Kind::MulSub,
                    (true, false) => Kind::NegMulAdd,
                    (true, true) => Kind::NegMulSub,
                };
                of(kind, [Some(a), Some(b), Some(c)])
            }
            Operation::Select(condition, a, b) => of(Kind::Select, [Some(condition), Some(a), Some(b)]),
            Operation::Function(Function::Sin | Function::Cos, a) => one(Kind::SinCos, a),
            Operation::Function(function, a) => one(Kind::One(function), a),
            Operation::Function2(Function::KeplerSin | Function::KeplerCos, a, b) => two(Kind::Kepler, a, b),
            Operation::Function2(function, a, b) => two(Kind::Two(function), a, b),
        }
    }

    fn without_sign(&self, node: Node) -> (Node, bool) {
        match self.graph.operation(node) {
            Operation::Unary(Unary::Neg, x) => (x, true),
            _ => (node, false),
        }
    }

    fn program(mut self, outputs: &[Node]) -> Program {
        let mut places = vec![0_u16; self.graph.len()];
        let mut program = Program {
            inputs: vec![],
            constants: vec![],
            slots: 0,
            truths: 0,
            instructions: vec![],
            runs: vec![],
            outputs: vec![],
        };
        // Inputs and constants that an instruction or a result reads.
        let read: Vec<Node> =
            self.graph.nodes().filter(|node| self.uses[node.index()] > 0 && self.selected(*node).is_none()).collect();
        let mut constants = vec![];
        for node in read {
            match self.graph.operation(node) {
                Operation::Input(input) => program.inputs.push(input),
                Operation::Constant(bits) => constants.push((node, f64::from_bits(bits))),
                _ => {}
            }
        }
        program.inputs.sort_unstable();
        for node in self.graph.nodes() {
            if let Operation::Input(input) = self.graph.operation(node)
                && let Ok(place) = program.inputs.binary_search(&input)
            {
                places[node.index()] = place as u16;
            }
        }
        for (node, constant) in constants {
            places[node.index()] = (program.inputs.len() + program.constants.len()) as u16;
            program.constants.push(constant);
        }
        let first_slot = (program.inputs.len() + program.constants.len()) as u16;
        let (mut numbers, mut truths) = (Slots::default(), Slots::default());
        for (node, Selected { kind, operands }) in std::mem::take(&mut self.order) {
            let operand = |index: usize| operands[index].map_or(0, |operand| places[operand.index()]);
            let mut instruction = Instruction { kind, to: 0, a: operand(0), b: operand(1), c: operand(2) };
            for operand in operands.into_iter().flatten() {
                self.uses[operand.index()] -= 1;
                if self.uses[operand.index()] == 0 && self.selected(operand).is_some() {
                    let place = places[operand.index()];
                    match self.graph.operation(operand).is_truth() {
                        true => truths.free(place),
                        false => numbers.free(place - first_slot),
                    }
                }
            }
            if let Some((pair, _)) = pair_of(self.graph.operation(node)) {
                let members = self.pairs.get(&pair).copied().unwrap_or_default();
                let slots = [numbers.take(), numbers.take()];
                for (slot, member) in slots.into_iter().zip(members) {
                    match member {
                        Some(member) => places[member.index()] = first_slot + slot,
                        None => numbers.free(slot),
                    }
                }
                [instruction.to, instruction.c] = slots.map(|slot| first_slot + slot);
            } else {
                let place =
                    if self.graph.operation(node).is_truth() { truths.take() } else { first_slot + numbers.take() };
                (places[node.index()], instruction.to) = (place, place);
            }
            program.instructions.push(instruction);
            match program.runs.last_mut() {
                Some((last, count)) if *last == kind => *count += 1,
                _ => program.runs.push((kind, 1)),
            }
        }
        (program.slots, program.truths) = (numbers.count.into(), truths.count.into());
        program.outputs = outputs.iter().map(|output| places[output.index()]).collect();
        program
    }
}

/// Slots and which of them are free.
#[derive(Default)]
struct Slots {
    count: u16,
    free: Vec<u16>,
}

impl Slots {
    fn take(&mut self) -> u16 {
        // The slot that was given up last is the likeliest to be in the cache.
        self.free.pop().unwrap_or_else(|| {
            self.count += 1;
            self.count - 1
        })
    }

    fn free(&mut self, slot: u16) {
        self.free.push(slot);
    }
}

/// The arguments of a function that is formed together with its partner, and whether it is the first or second of both.
fn pair_of(operation: Operation) -> Option<(Pair, usize)> {
    match operation {
        Operation::Function(Function::Sin, a) => Some(((a, None), 0)),
        Operation::Function(Function::Cos, a) => Some(((a, None), 1)),
        Operation::Function2(Function::KeplerSin, a, b) => Some(((a, Some(b)), 0)),
        Operation::Function2(Function::KeplerCos, a, b) => Some(((a, Some(b)), 1)),
        _ => None,
    }
}
