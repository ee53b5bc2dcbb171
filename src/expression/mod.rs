//! Formulas as data: recorded once, evaluated anywhere.
//!
//! ```text
//! formula over `Real` ─┐                       ┌─▶ Stages   what is formed once a body, once a step, every time
//! closure of symbols  ─┼─▶ Graph (Expression) ─┼─▶ Program  tiles of lanes; one scalar, the reference
//! text                ─┘                       ├─▶ Jets     Taylor series over tiles of lanes
//!                                              └─▶ wgsl     a function for the shaders
//! ```
//!
//! * [`Symbol`] is a number that records the operations on it, so that vectors, quaternions and torques, which are generic over
//!   [`crate::math::real::Real`], record themselves.
//! * [`Graph`] holds scalar operations; equal ones are one node, and constants are folded (`simplify.rs`).
//! * [`Program`] is the lowered form, executed over tiles (`tile.rs`); operations that belong together are one instruction
//!   (`selection.rs`, `rotations.rs`).
//! * Jets (`jet`) give its Taylor series, coefficient by coefficient.
//! * [`wgsl`] writes the same operations in the same order for the GPU.
//! * [`Expression`] is a formula with its results, from text ([`Expression::parse`]) or from a closure
//!   ([`Expression::record`]).

mod derivative;
mod fault;
mod first_fault;
mod functions;
pub(crate) mod graph;
mod identifiers;
pub(crate) mod jet;
mod lexer;
pub(crate) mod orbit;
mod parser;
mod program;
mod replay;
mod rotations;
mod selection;
mod simplify;
mod stages;
mod symbol;
mod symbols;
#[cfg(test)]
mod tests;
mod text;
mod tile;
mod value;
pub(crate) mod vocabulary;
#[doc(hidden)]
pub mod wgsl;

use std::sync::Arc;

pub use fault::Fault;
pub use graph::{Dependence, Graph, Input, InputKind, MOST_NODES, Node};
pub use program::Program;
pub(crate) use replay::Replayed;
pub use stages::{Part, Stages};
pub use symbol::{Recorder, Symbol, Truth};
pub use symbols::{MOST_PARAMETERS, Name, Recorded, Scope, Shape, Symbols};
pub use text::{LONGEST_TEXT, MOST_LEVELS, TextError};
pub(crate) use tile::Scratch;

/// A formula: a graph and its results. Clones share it.
#[derive(Clone, Debug, PartialEq)]
pub struct Expression {
    formula: Arc<Part>,
    shape: Shape,
}

impl Expression {
    /// The formula that a closure records.
    ///
    /// ```
    /// use polhode::expression::{Expression, Shape, Symbols};
    ///
    /// # fn main() -> Result<(), polhode::expression::Fault> {
    /// let symbols = Symbols::rotation().parameter("c", Shape::Number)?;
    /// let drag = Expression::record(&symbols, |s| -(s.angular_velocity() * s.number("c")))?;
    /// assert_eq!(drag.shape(), Shape::Vector);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    ///
    /// If the closure uses a name that `symbols` does not offer, if the formula has more than [`MOST_NODES`] operations,
    /// constants that are not finite or a division by a constant zero, or if a recording is running on this thread.
    pub fn record<V: Recorded>(symbols: &Symbols, formula: impl FnOnce(&Scope) -> V) -> Result<Self, Fault> {
        let (graph, outputs) =
            Graph::record(|recorder| Ok::<_, Fault>(formula(&Scope::new(symbols, recorder)).into_symbols()))?;
        Ok(Self::new(&graph, &outputs, V::SHAPE))
    }

    /// The formula that a text describes.
    ///
    /// ```
    /// use polhode::expression::{Expression, Shape, Symbols};
    ///
    /// let symbols = Symbols::rotation().parameter("k", Shape::Number).unwrap();
    /// let text = "let up = to_body(vec(0, 0, 1));\n-k * cross(up, vec(0, 0, 1))";
    /// assert!(Expression::parse(text, &symbols, Shape::Vector).is_ok());
    /// let error = Expression::parse("k * omega", &symbols, Shape::Vector).unwrap_err();
    /// assert_eq!(error.to_string(), "line 1, column 5: unknown name `omega`");
    /// ```
    ///
    /// # Errors
    ///
    /// If the text is not a formula of the shape `wanted`; the error says where and why.
    pub fn parse(text: &str, symbols: &Symbols, wanted: Shape) -> Result<Self, TextError> {
        let (graph, outputs) = text::recorded(text, symbols, wanted)?;
        Ok(Self::new(&graph, &outputs, wanted))
    }

    fn new(graph: &Graph, outputs: &[Node], shape: Shape) -> Self {
        let (graph, outputs) = graph.compacted(outputs);
        Self { formula: Arc::new(Part { graph, outputs }), shape }
    }

    /// The formula that a closure records from any inputs.
    pub(crate) fn of_inputs<V: Recorded>(record: impl FnOnce(&Recorder) -> V) -> Result<Self, Fault> {
        let (graph, outputs) = Graph::record(|recorder| Ok::<_, Fault>(record(recorder).into_symbols()))?;
        Ok(Self::new(&graph, &outputs, V::SHAPE))
    }

    /// The formula with its inputs replaced.
    pub(crate) fn substituted(&self, mut inputs: impl FnMut(&Recorder, Input) -> Symbol) -> Result<Self, Fault> {
        let (graph, outputs) = Graph::record::<Fault>(|recorder| {
            Ok(self.graph().substituted(self.outputs(), |input| inputs(recorder, input)))
        })?;
        Ok(Self::new(&graph, &outputs, self.shape))
    }

    /// The formula in the recording that runs on this thread, with its inputs replaced.
    pub(crate) fn recorded_with(&self, inputs: impl FnMut(Input) -> Symbol) -> Vec<Symbol> {
        self.graph().substituted(self.outputs(), inputs)
    }

    /// The formula's results, followed by their time derivatives, as a graph.
    pub(crate) fn with_rates(&self) -> Result<(Graph, Vec<Node>), Fault> {
        let time = Input::new(InputKind::Time, 0);
        Graph::record::<Fault>(|recorder| {
            Ok(self.graph().with_derivatives(self.outputs(), time, |input| recorder.input(input)))
        })
    }

    /// The operations, without any that no result needs.
    pub fn graph(&self) -> &Graph {
        &self.formula.graph
    }

    /// The results, as many as the shape has numbers.
    pub fn outputs(&self) -> &[Node] {
        &self.formula.outputs
    }

    /// The shape of the result.
    pub fn shape(&self) -> Shape {
        self.shape
    }

    /// What the result depends on.
    pub fn dependence(&self) -> Dependence {
        self.graph().dependence_of(self.outputs())
    }

    /// The formula in parts that are computed once for each body, once for each step, and at every evaluation.
    pub fn stages(&self) -> Stages {
        self.graph().stages(self.outputs())
    }

    /// The formula as instructions.
    pub fn program(&self) -> Program {
        Program::new(self.graph(), self.outputs())
    }
}
