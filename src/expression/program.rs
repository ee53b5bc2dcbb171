//! A formula lowered to instructions of a register machine.
//!
//! Instructions read inputs and constants in place and write to slots, which are reused as soon as their contents are no longer needed.
//! Operations that belong together are joined into one instruction (`selection.rs`), which changes no bit of the results.

use super::graph::{Graph, Input, Node, Operation};
use super::selection::{MOST_OPERANDS, MOST_RESULTS, Selected, Selection};
use crate::math::real::Function;

/// Instructions that compute some results from inputs. [`Program::evaluate_columns`] executes them.
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

/// One operation. Operands are numbered inputs first, then constants, then slots; truth values are numbered separately.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Instruction {
    pub(super) kind: Kind,
    /// The slots of the results.
    pub(super) results: [u16; MOST_RESULTS],
    pub(super) operands: [u16; MOST_OPERANDS],
}

/// What an instruction does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Kind {
    Add,
    Sub,
    Mul,
    /// −(a b).
    NegMul,
    /// (a b) c.
    MulMul,
    Div,
    /// a b + c, rounded twice.
    MulThenAdd,
    /// a b − c, rounded twice.
    MulThenSub,
    /// c − a b, rounded twice.
    SubMul,
    /// a b + c d, each product rounded.
    AddProducts,
    /// a b − c d, each product rounded.
    SubProducts,
    /// ±a b + (±c) by one fused operation. The signs, here and below, are those of the terms: `true` is minus.
    MulAdd([bool; 2]),
    /// ±a b + (±(c d)): c d is rounded, the rest is one fused operation.
    Products2([bool; 2]),
    /// ±a b + (±c d + (±(e f))), by two fused operations.
    Products3([bool; 3]),
    /// ±a b + (±c d + (±e)), by two fused operations.
    MulAdd2([bool; 3]),
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
    /// sin a, and cos a as the second result.
    SinCos,
    /// sin E and, as the second result, cos E of Kepler's equation.
    Kepler,
    /// A vector v rotated by a quaternion q, or by its conjugate; operands are the components of q and those of v.
    Rotate(bool),
    /// A function of one argument.
    One(Function),
    /// A function of two arguments.
    Two(Function),
}

impl Kind {
    /// How many results it has.
    fn results(self) -> usize {
        match self {
            Kind::Rotate(_) => 3,
            Kind::SinCos | Kind::Kepler => 2,
            _ => 1,
        }
    }
}

impl Program {
    /// The program that computes `outputs`.
    pub fn new(graph: &Graph, outputs: &[Node]) -> Self {
        Lowering::new(graph, outputs).program(outputs)
    }

    /// What the program reads, in the order in which [`Program::evaluate_columns`] takes it.
    pub fn inputs(&self) -> &[Input] {
        &self.inputs
    }

    /// How many operations it takes.
    pub(crate) fn operations(&self) -> usize {
        self.instructions.len()
    }

    /// How many results it forms.
    pub(crate) fn output_count(&self) -> usize {
        self.outputs.len()
    }
}

struct Lowering<'a> {
    graph: &'a Graph,
    selection: Selection<'a>,
    /// Nodes to compute, in order; for a pair the one that is met first.
    order: Vec<(Node, Selected)>,
    /// For each node, the number of remaining uses.
    uses: Vec<u32>,
}

impl<'a> Lowering<'a> {
    fn new(graph: &'a Graph, outputs: &[Node]) -> Self {
        let live = graph.live(outputs);
        let mut lowering =
            Self { graph, selection: Selection::new(graph, &live, outputs), order: vec![], uses: vec![0; graph.len()] };
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
            let Some(selected) = self.selection.of(node) else {
                states[node.index()] = State::Done;
                open.pop();
                continue;
            };
            match state {
                State::New => {
                    states[node.index()] = State::Open;
                    let operands = selected.operands().iter().rev();
                    open.extend(operands.filter(|operand| states[operand.index()] == State::New));
                }
                State::Open => {
                    states[node.index()] = State::Done;
                    selected.operands().iter().for_each(|operand| self.uses[operand.index()] += 1);
                    for result in self.selection.results(node).into_iter().flatten() {
                        states[result.index()] = State::Done;
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
        // Results are never freed.
        outputs.iter().for_each(|output| self.uses[output.index()] += 1);
    }

    /// Orders by height, and within one height by kind: neighbours then do not wait for each other, and those of one kind
    /// are executed with one jump.
    fn gather(&mut self) {
        let mut heights = vec![0_u32; self.graph.len()];
        for node in self.graph.nodes() {
            let operands = self.graph.operation(node).operands();
            heights[node.index()] = operands.map(|operand| heights[operand.index()] + 1).max().unwrap_or(0);
        }
        // What is computed together is computed as early as its earliest part, since all of it needs the operands of any part.
        let height = |node: Node| {
            let results = self.selection.results(node).into_iter().flatten();
            results.map(|result| heights[result.index()]).min().unwrap_or(0)
        };
        self.order.sort_by_key(|&(node, selected)| (height(node), selected.kind));
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
        let read: Vec<Node> = self
            .graph
            .nodes()
            .filter(|node| self.uses[node.index()] > 0 && self.selection.of(*node).is_none())
            .collect();
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
        for (node, selected) in std::mem::take(&mut self.order) {
            let kind = selected.kind;
            let mut instruction = Instruction { kind, results: [0; MOST_RESULTS], operands: [0; MOST_OPERANDS] };
            for (place, operand) in instruction.operands.iter_mut().zip(selected.operands()) {
                *place = places[operand.index()];
            }
            for operand in selected.operands() {
                self.uses[operand.index()] -= 1;
                if self.uses[operand.index()] == 0 && self.selection.of(*operand).is_some() {
                    let place = places[operand.index()];
                    match self.graph.operation(*operand).is_truth() {
                        true => truths.free(place),
                        false => numbers.free(place - first_slot),
                    }
                }
            }
            let results = self.selection.results(node);
            if self.graph.operation(node).is_truth() {
                instruction.results[0] = truths.take();
                places[node.index()] = instruction.results[0];
            } else {
                // Results that nothing uses have slots while the instruction executes.
                let slots: Vec<u16> = (0..kind.results()).map(|_| numbers.take()).collect();
                for ((slot, result), place) in slots.into_iter().zip(results).zip(&mut instruction.results) {
                    *place = first_slot + slot;
                    match result {
                        Some(result) => places[result.index()] = *place,
                        None => numbers.free(slot),
                    }
                }
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

/// Slots and the list of free ones.
#[derive(Default)]
struct Slots {
    count: u16,
    free: Vec<u16>,
}

impl Slots {
    fn take(&mut self) -> u16 {
        // The slot freed last is the most likely to be in the cache.
        self.free.pop().unwrap_or_else(|| {
            self.count += 1;
            self.count - 1
        })
    }

    fn free(&mut self, slot: u16) {
        self.free.push(slot);
    }
}
