//! A number type that records the operations on it.
//!
//! Whatever is generic over [`Real`] records itself when it is called with symbols: vectors, quaternions, torques.

use std::cell::RefCell;
use std::marker::PhantomData;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use super::fault::Fault;
use super::graph::{Binary, Builder, Graph, Input, Node, Operation, Unary};
use crate::math::operators;
use crate::math::real::{Function, Real};

/// A node of the graph that the current thread records. It is meaningless outside its recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Symbol(Handle);

/// A truth value of the graph that the current thread records.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Truth(Handle);

/// A node and the recording that it belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Handle {
    node: Node,
    recording: u32,
}

/// The handle after an error: nothing more is recorded, and the first error is reported.
const FAULTY: Handle = Handle { node: Node(0), recording: 0 };

struct Recording {
    number: u32,
    builder: Builder,
    fault: Option<Fault>,
}

impl Recording {
    fn node_of(&mut self, handle: Handle) -> Option<Node> {
        if handle.recording == self.number {
            return Some(handle.node);
        }
        if handle != FAULTY {
            self.fault.get_or_insert(Fault::ForeignSymbol);
        }
        None
    }

    fn handle_of(&mut self, node: Result<Node, Fault>) -> Handle {
        match node {
            Ok(node) => Handle { node, recording: self.number },
            Err(fault) => {
                self.fault.get_or_insert(fault);
                FAULTY
            }
        }
    }
}

thread_local! {
    static CURRENT: RefCell<Option<Recording>> = const { RefCell::new(None) };
}

/// Numbers of recordings; 0 is none. After 2³² recordings numbers repeat, which only a symbol kept that long could notice.
static LAST: AtomicU32 = AtomicU32::new(1);

/// Ends the recording of this thread, even if a panic unwinds through it.
struct Ended;

impl Drop for Ended {
    fn drop(&mut self) {
        CURRENT.with_borrow_mut(|current| *current = None);
    }
}

/// Provides the inputs of a recording.
pub struct Recorder {
    /// Recordings belong to a thread.
    here: PhantomData<*const ()>,
}

impl Recorder {
    /// The symbol of an input.
    pub fn input(&self, input: Input) -> Symbol {
        Symbol(record(Operation::Input(input), []))
    }

    /// Names a value; one with several components gets `u_x`, `u_y` and so on. A value that has a name keeps it.
    pub(crate) fn name(&self, name: &str, numbers: &[Symbol]) {
        if let [number] = numbers {
            return number.take_name(&name.into());
        }
        for (number, component) in numbers.iter().zip(["x", "y", "z", "w"]) {
            number.take_name(&format!("{name}_{component}").into());
        }
    }

    /// The first error so far.
    pub fn fault(&self) -> Option<Fault> {
        CURRENT.with_borrow(|current| current.as_ref().and_then(|recording| recording.fault.clone()))
    }

    /// Makes the recording fail, if it has not yet.
    pub(super) fn refuse(&self, fault: Fault) -> Symbol {
        CURRENT.with_borrow_mut(|current| {
            if let Some(recording) = current {
                recording.fault.get_or_insert(fault);
            }
        });
        Symbol(FAULTY)
    }
}

impl Graph {
    /// The graph that `work` records, and the nodes of the symbols that it returns.
    ///
    /// # Errors
    ///
    /// Those of `work`; if a recording is running on this thread; if the formula has too many nodes, constants that are not
    /// finite or a division by a constant zero; if a symbol belongs to another recording.
    pub fn record<E: From<Fault>>(
        work: impl FnOnce(&Recorder) -> Result<Vec<Symbol>, E>,
    ) -> Result<(Graph, Vec<Node>), E> {
        let number = LAST.fetch_add(1, Ordering::Relaxed).max(1);
        let begun = CURRENT.with_borrow_mut(|current| {
            let free = current.is_none();
            if free {
                *current = Some(Recording { number, builder: Builder::default(), fault: None });
            }
            free
        });
        if !begun {
            return Err(Fault::Nested.into());
        }
        let ended = Ended;
        let symbols = work(&Recorder { here: PhantomData })?;
        let Some(mut recording) = CURRENT.with_borrow_mut(Option::take) else {
            return Err(Fault::ForeignSymbol.into());
        };
        drop(ended);
        let nodes: Option<Vec<Node>> = symbols.into_iter().map(|symbol| recording.node_of(symbol.0)).collect();
        match (recording.fault, nodes) {
            (None, Some(nodes)) => Ok((recording.builder.into_graph(), nodes)),
            (fault, _) => Err(fault.unwrap_or(Fault::ForeignSymbol).into()),
        }
    }
}

/// Records an operation; its operands are in `operands` and, as placeholders, in `operation`.
fn record<const N: usize>(operation: Operation, operands: [Handle; N]) -> Handle {
    CURRENT.with_borrow_mut(|current| {
        let Some(recording) = current else { return FAULTY };
        let mut nodes = [Node(0); N];
        for (node, handle) in nodes.iter_mut().zip(operands) {
            match recording.node_of(handle) {
                Some(found) => *node = found,
                None => return FAULTY,
            }
        }
        let mut nodes = nodes.into_iter();
        let operation = operation.with_operands(|placeholder| nodes.next().unwrap_or(placeholder));
        let node = recording.builder.apply(operation);
        recording.handle_of(node)
    })
}

/// Names a node of the recording on this thread, unless it has a name.
fn name_node(handle: Handle, name: &Arc<str>) {
    CURRENT.with_borrow_mut(|current| {
        if let Some(recording) = current
            && let Some(node) = recording.node_of(handle)
        {
            recording.builder.name_node(node, name);
        }
    });
}

/// The placeholder for operands until [`record`] inserts them.
const OPERAND: Node = Node(0);

fn unary(kind: Unary, a: Handle) -> Handle {
    record(Operation::Unary(kind, OPERAND), [a])
}

fn binary(kind: Binary, a: Handle, b: Handle) -> Handle {
    record(Operation::Binary(kind, OPERAND, OPERAND), [a, b])
}

impl Truth {
    /// Takes `name` in texts written from the recording, unless it has a name.
    pub(super) fn take_name(self, name: &Arc<str>) {
        name_node(self.0, name);
    }
}

impl Symbol {
    /// Takes `name` in texts written from the recording, unless it has a name.
    pub(super) fn take_name(self, name: &Arc<str>) {
        name_node(self.0, name);
    }

    /// The constant that this symbol is, if it is one.
    pub fn constant(self) -> Option<f64> {
        CURRENT.with_borrow_mut(|current| {
            let recording = current.as_mut()?;
            let node = recording.node_of(self.0)?;
            recording.builder.graph().constant(node)
        })
    }

    /// An elementary function of one argument.
    #[must_use]
    pub fn function(self, function: Function) -> Symbol {
        Symbol(record(Operation::Function(function, OPERAND), [self.0]))
    }

    /// An elementary function of two arguments.
    #[must_use]
    pub(crate) fn function_with(self, function: Function, second: Symbol) -> Symbol {
        Symbol(record(Operation::Function2(function, OPERAND, OPERAND), [self.0, second.0]))
    }
}

operators! { [] Symbol:
    Add::add(self, other: Self) = Self(binary(Binary::Add, self.0, other.0));
    Sub::sub(self, other: Self) = Self(binary(Binary::Sub, self.0, other.0));
    Mul::mul(self, other: Self) = Self(binary(Binary::Mul, self.0, other.0));
    Div::div(self, other: Self) = Self(binary(Binary::Div, self.0, other.0));
    Neg::neg(self) = Self(unary(Unary::Neg, self.0));
}

operators! { [] Truth:
    BitAnd::bitand(self, other: Self) = Self(binary(Binary::And, self.0, other.0));
    BitOr::bitor(self, other: Self) = Self(binary(Binary::Or, self.0, other.0));
    Not::not(self) = Self(unary(Unary::Not, self.0));
}

impl Real for Symbol {
    type Scalar = f64;
    type Mask = Truth;
    const LANES: usize = 1;

    fn splat(x: f64) -> Self {
        Self(record(Operation::constant(x), []))
    }
    fn from_lanes(mut lane: impl FnMut(usize) -> f64) -> Self {
        Self::splat(lane(0))
    }
    fn load(column: &[f64]) -> Self {
        Self::splat(column[0])
    }
    /// Writes the constant that the symbol is; NaN if it is not constant.
    fn store(self, column: &mut [f64]) {
        column[0] = self.constant().unwrap_or(f64::NAN);
    }
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        Self(record(Operation::MulAdd(OPERAND, OPERAND, OPERAND), [self.0, factor.0, addend.0]))
    }
    fn sqrt(self) -> Self {
        Self(unary(Unary::Sqrt, self.0))
    }
    fn abs(self) -> Self {
        Self(unary(Unary::Abs, self.0))
    }
    fn min(self, other: Self) -> Self {
        Self(binary(Binary::Min, self.0, other.0))
    }
    fn max(self, other: Self) -> Self {
        Self(binary(Binary::Max, self.0, other.0))
    }
    fn less_than(self, other: Self) -> Truth {
        Truth(binary(Binary::Less, self.0, other.0))
    }
    fn select(mask: Truth, if_true: Self, if_false: Self) -> Self {
        Self(record(Operation::Select(OPERAND, OPERAND, OPERAND), [mask.0, if_true.0, if_false.0]))
    }
    /// Always true, as a recording takes both branches.
    fn any(_: Truth) -> bool {
        true
    }
    /// The product and zero: the rounding error is not recorded.
    fn two_product(self, other: Self) -> (Self, Self) {
        (self * other, Self::splat(0.0))
    }
    fn outlined<O>(work: impl FnOnce() -> O) -> O {
        work()
    }
    fn recorded(function: Function, arguments: &[Self]) -> Option<Self> {
        match *arguments {
            [x] => Some(x.function(function)),
            [x, y] => Some(x.function_with(function, y)),
            _ => None,
        }
    }
    fn round(self) -> Self {
        Self(unary(Unary::Round, self.0))
    }
}

#[cfg(test)]
mod tests {
    use super::super::graph::InputKind;
    use super::*;

    fn recorded(work: impl FnOnce(Symbol, Symbol) -> Symbol) -> Result<(Graph, Vec<Node>), Fault> {
        Graph::record(|recorder| {
            let input = |index| recorder.input(Input::new(InputKind::Parameter, index));
            Ok(vec![work(input(0), input(1))])
        })
    }

    #[test]
    fn equal_operations_are_one_node() {
        let (graph, outputs) = recorded(|x, y| (x + y) * (y + x)).unwrap();
        assert_eq!(graph.live(&outputs).len(), 4);
    }

    #[test]
    fn operations_that_change_nothing_leave_no_node() {
        fn c(x: f64) -> Symbol {
            Symbol::splat(x)
        }
        let same: [fn(Symbol) -> Symbol; 7] = [
            |x| x * c(1.0),
            |x| x + c(0.0),
            |x| -(-x),
            |x| x / c(1.0),
            |x| c(0.0) * x + x,
            |x| x - c(0.0),
            |x| x.mul_add(c(1.0), c(0.0)),
        ];
        for work in same {
            let (graph, outputs) = recorded(|x, _| work(x)).unwrap();
            assert_eq!(graph.operation(outputs[0]), Operation::Input(Input::new(InputKind::Parameter, 0)));
        }
        let (graph, outputs) = recorded(|x, _| x - x).unwrap();
        assert_eq!(graph.live(&outputs).len(), 2, "x - x is kept: x may be no number");
    }

    #[test]
    fn only_division_by_a_power_of_two_becomes_a_product() {
        for (divisor, is_product) in [(4.0, true), (-0.5, true), (3.0, false), (2f64.powi(200), false)] {
            let (graph, outputs) = recorded(|x, _| x / Symbol::splat(divisor)).unwrap();
            let operation = graph.operation(outputs[0]);
            assert_eq!(matches!(operation, Operation::Binary(Binary::Mul, ..)), is_product, "{divisor}");
        }
    }

    #[test]
    fn faults_are_reported_and_the_thread_is_free_again() {
        assert_eq!(recorded(|x, _| x / Symbol::splat(0.0)), Err(Fault::DivisionByZero));
        assert_eq!(recorded(|_, _| Symbol::splat(-1.0).sqrt()), Err(Fault::NotFinite));
        let nested = recorded(|x, _| {
            assert_eq!(recorded(|y, _| y), Err(Fault::Nested));
            x
        });
        assert!(nested.is_ok());
        let panicked = std::panic::catch_unwind(|| recorded(|_, _| panic!("planted")));
        assert!(panicked.is_err());
        let mut kept = None;
        recorded(|x, _| *kept.insert(x)).unwrap();
        assert_eq!(recorded(|x, _| x + kept.unwrap()), Err(Fault::ForeignSymbol));
    }

    #[test]
    fn a_graph_is_not_larger_than_the_limit() {
        let sum = |terms: u32| recorded(|x, y| (0..terms).fold(x, |sum, _| sum * y));
        assert!(sum(9_998).is_ok());
        assert_eq!(sum(9_999), Err(Fault::TooManyNodes));
    }
}
