//! Lowers a graph to rows and operations on them.

mod assembly;
mod count;
mod directions;
mod functions;
mod products;
mod sharing;

use std::collections::HashMap;

use super::super::fault::Fault;
use super::super::graph::{Binary, Dependence, Graph, Input, InputKind, Node, Operation as NodeOperation, Unary};
use super::super::program::Program;
use super::super::replay;
use super::super::symbol::{Symbol, Truth};
use super::polynomial::{Factor, Polynomial};
use super::{DirectionState, Fading, Kind, RowNumber, TurningState};
use crate::math::real::Real;
use directions::{Directions, Parts, State, Turning};

/// What is to be computed from a graph.
#[derive(Clone, Debug, Default)]
pub(crate) struct Equations {
    /// States and their derivatives.
    pub rates: Vec<(Input, Node)>,
    /// The angular velocity.
    pub angular_velocity: Option<[Node; 3]>,
    /// Whether the orientation is a state too, with q' = ½ q ω, or replaced by directions ([`lowered_by_directions`]).
    pub has_orientation: bool,
    /// Series that are wanted in addition to those of the states and the angular velocity.
    pub outputs: Vec<Node>,
}

/// What a row depends on, as far as the expansion of products distinguishes it.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Class {
    /// A component of the orientation.
    Attitude,
    /// An entry of the matrix of the rotation, or a component of a direction.
    Rotation,
    /// A function of time and parameters.
    Time,
    Other,
}

#[derive(Clone, Copy, Debug)]
struct Row {
    class: Class,
    /// Whether only its first two coefficients are nonzero.
    is_short: bool,
    /// Whether earlier coefficients are read.
    is_kept: bool,
}

#[derive(Clone, Debug)]
struct Draft {
    kind: Kind,
    /// How many of its rows it writes.
    writes: usize,
    rows: Vec<RowNumber>,
    factors: Vec<Symbol>,
    constant: Option<Symbol>,
}

/// A truth value.
#[derive(Clone, Copy)]
enum Condition {
    /// Constant for each body.
    Parameters(Truth),
    Row(RowNumber),
}

#[derive(Clone)]
enum Value {
    Number(Polynomial),
    Truth(Condition),
}

struct Lowering<'g> {
    graph: &'g Graph,
    /// The values of nodes that depend only on parameters.
    parameters: Vec<Option<replay::Value>>,
    /// The values of the other nodes.
    values: Vec<Option<Value>>,
    rows: Vec<Row>,
    drafts: Vec<Draft>,
    given: Vec<(Input, RowNumber)>,
    products: HashMap<(RowNumber, RowNumber), RowNumber>,
    sums: Vec<(Polynomial, RowNumber)>,
    circular: HashMap<(RowNumber, Option<RowNumber>), [RowNumber; 2]>,
    switches: Vec<RowNumber>,
    roots: Vec<[RowNumber; 2]>,
    fading: Vec<Fading<RowNumber>>,
    /// The entries of the rotation matrix, if they are used.
    rotation: Option<[RowNumber; 9]>,
    /// The directions that replace the orientation: how each vector is composed, and the states.
    directions: Directions,
    parts: Vec<Option<Parts>>,
    states: Vec<State>,
}

/// A graph as rows and operations, for an order still to be chosen.
#[derive(Clone, Debug)]
pub(crate) struct Lowered {
    rows: Vec<Row>,
    drafts: Vec<Draft>,
    /// The program that computes the factors.
    factors: Program,
    given: Vec<(Input, RowNumber)>,
    outputs: Vec<RowNumber>,
    switches: Vec<RowNumber>,
    roots: Vec<[RowNumber; 2]>,
    fading: Vec<Fading<RowNumber>>,
    /// The indices of each draft's factors, and of its constant.
    numbers: Vec<(Vec<usize>, Option<usize>)>,
    directions: Vec<DirectionState<RowNumber>>,
    /// Whether the orientation is a state.
    pub has_orientation: bool,
}

/// Lowers what `equations` ask for. Factors with more operations than a graph may have, or that are not finite, are refused.
pub(crate) fn lowered(graph: &Graph, equations: &Equations) -> Result<Lowered, Fault> {
    lowered_with(graph, equations, Directions::default())
}

/// The same with directions in place of the orientation; `None` if something else uses the orientation.
pub(crate) fn lowered_by_directions(graph: &Graph, equations: &Equations) -> Result<Option<Lowered>, Fault> {
    let wanted = equations.wanted();
    let directions = Directions::of(graph, &wanted);
    let is_orientation =
        |node: Node| matches!(graph.operation(node), NodeOperation::Input(Input { kind: InputKind::Orientation, .. }));
    if directions.live(graph, &wanted).into_iter().any(is_orientation) {
        return Ok(None);
    }
    lowered_with(graph, &Equations { has_orientation: false, ..equations.clone() }, directions).map(Some)
}

impl Lowered {
    /// Whether it decides between cases.
    pub fn has_switches(&self) -> bool {
        !self.switches.is_empty()
    }

    /// Whether something that it computes may fade until its series no longer show it.
    pub fn has_fading(&self) -> bool {
        !self.fading.is_empty()
    }

    /// Whether directions are states.
    pub fn has_directions(&self) -> bool {
        !self.directions.is_empty()
    }
}

impl Equations {
    /// All nodes that are wanted.
    fn wanted(&self) -> Vec<Node> {
        let rates = self.rates.iter().map(|(_, rate)| *rate);
        rates.chain(self.angular_velocity.into_iter().flatten()).chain(self.outputs.iter().copied()).collect()
    }
}

fn lowered_with(graph: &Graph, equations: &Equations, directions: Directions) -> Result<Lowered, Fault> {
    let mut kept = None;
    let mut outputs = Vec::new();
    let (factor_graph, factor_nodes) = Graph::record::<Fault>(|recorder| {
        let mut lowering = Lowering {
            graph,
            parameters: vec![None; graph.len()],
            values: vec![None; graph.len()],
            rows: vec![],
            drafts: vec![],
            given: vec![],
            products: HashMap::new(),
            sums: vec![],
            circular: HashMap::new(),
            switches: vec![],
            roots: vec![],
            fading: vec![],
            rotation: None,
            parts: vec![None; directions.vectors.len()],
            states: vec![],
            directions,
        };
        outputs = lowering.lower(equations, |input| recorder.input(input))?;
        // Equal factors are merged.
        let mut factors: Vec<Symbol> = Vec::new();
        let mut number = |factor: Symbol| match factors.iter().position(|known| *known == factor) {
            Some(place) => place,
            None => {
                factors.push(factor);
                factors.len() - 1
            }
        };
        let numbers: Vec<(Vec<usize>, Option<usize>)> = lowering
            .drafts
            .iter()
            .map(|draft| {
                (draft.factors.iter().map(|&factor| number(factor)).collect(), draft.constant.map(&mut number))
            })
            .collect();
        let directions: Vec<DirectionState<RowNumber>> = lowering
            .states
            .iter()
            .map(|&State { rows, world, turning }| DirectionState {
                rows,
                world: world.map(&mut number),
                turning: turning.map(|Turning { rows, world, angle: (input, factor, offset), .. }| TurningState {
                    rows,
                    world: world.map(&mut number),
                    angle: (input, number(factor), number(offset)),
                }),
            })
            .collect();
        let Lowering { rows, drafts, given, switches, roots, fading, .. } = lowering;
        kept = Some((rows, drafts, given, switches, roots, fading, numbers, directions));
        Ok(factors)
    })?;
    let Some((rows, drafts, given, switches, roots, fading, numbers, directions)) = kept else {
        return Err(Fault::ForeignSymbol);
    };
    let factors = Program::new(&factor_graph, &factor_nodes);
    let has_orientation = equations.has_orientation;
    Ok(Lowered { rows, drafts, factors, given, outputs, switches, roots, fading, numbers, directions, has_orientation })
}

impl Lowering<'_> {
    fn lower(
        &mut self,
        equations: &Equations,
        mut input: impl FnMut(Input) -> Symbol,
    ) -> Result<Vec<RowNumber>, Fault> {
        let states = equations.rates.iter().map(|(state, _)| *state);
        let attitude = (0..4).map(|part| Input::new(InputKind::Orientation, part));
        let states: Vec<Input> = states.chain(attitude.take(if equations.has_orientation { 4 } else { 0 })).collect();
        for &state in &states {
            let class = if state.kind == InputKind::Orientation { Class::Attitude } else { Class::Other };
            let row = self.new_row(class, false, true);
            self.given.push((state, row));
        }
        for node in self.directions.live(self.graph, &equations.wanted()) {
            self.lower_node(node, &mut input)?;
        }
        let mut outputs = Vec::new();
        for node in equations.angular_velocity.into_iter().flatten().chain(equations.outputs.iter().copied()) {
            let value = self.number(node);
            let row = self.materialised(&value);
            outputs.push(self.keep(row));
        }
        let followed = self.follow_euler(equations, &outputs);
        for (state, rate) in &equations.rates[followed..] {
            let rate = self.number(*rate);
            let rate = self.materialised(&rate);
            let state = self.given_row(*state);
            self.drafts.push(Draft::new(Kind::Integral, 0, vec![state, rate]));
        }
        if equations.has_orientation {
            let orientation = self.orientation();
            self.drafts.push(Draft::new(
                Kind::Attitude,
                0,
                [&orientation[..], &outputs[..3.min(outputs.len())]].concat(),
            ));
        }
        self.follow_directions(&outputs[..3.min(outputs.len())]);
        self.drop_unused(&outputs);
        self.share_triples();
        self.add_products();
        self.share_factors();
        self.sum_in_euler();
        Ok(outputs)
    }

    fn orientation(&mut self) -> [RowNumber; 4] {
        [0, 1, 2, 3].map(|part| self.given_row(Input::new(InputKind::Orientation, part)))
    }

    fn given_row(&mut self, input: Input) -> RowNumber {
        if let Some((_, row)) = self.given.iter().find(|(given, _)| *given == input) {
            return *row;
        }
        // An input that is not a state advances at a constant rate.
        let row = self.new_row(Class::Time, true, true);
        self.given.push((input, row));
        row
    }

    fn new_row(&mut self, class: Class, is_short: bool, is_kept: bool) -> RowNumber {
        self.rows.push(Row { class, is_short, is_kept });
        (self.rows.len() - 1) as RowNumber
    }

    fn keep(&mut self, row: RowNumber) -> RowNumber {
        self.rows[row as usize].is_kept = true;
        row
    }

    fn class(&self, row: RowNumber) -> Class {
        self.rows[row as usize].class
    }

    /// The class of what is computed from rows.
    fn class_of(&self, mut rows: impl Iterator<Item = RowNumber>) -> Class {
        if rows.all(|row| self.class(row) == Class::Time) { Class::Time } else { Class::Other }
    }

    fn is_parameter(&self, node: Node) -> bool {
        self.graph.dependence(node).is_within(Dependence::PARAMETERS)
    }

    fn number(&self, node: Node) -> Polynomial {
        match (&self.parameters[node.index()], &self.values[node.index()]) {
            (Some(replay::Value::Number(factor)), _) => Polynomial::constant(Factor::of(*factor)),
            (_, Some(Value::Number(polynomial))) => polynomial.clone(),
            // A graph has no number where a truth value belongs, and operands come before their uses.
            _ => Polynomial::default(),
        }
    }

    fn condition(&self, node: Node) -> Condition {
        match (&self.parameters[node.index()], &self.values[node.index()]) {
            (Some(replay::Value::Truth(truth)), _) => Condition::Parameters(*truth),
            (_, Some(Value::Truth(condition))) => *condition,
            _ => Condition::Parameters(Symbol::splat(1.0).less_than(Symbol::splat(0.0))),
        }
    }

    fn lower_node(&mut self, node: Node, input: &mut impl FnMut(Input) -> Symbol) -> Result<(), Fault> {
        let operation = self.graph.operation(node);
        if self.is_parameter(node) {
            let of = |operand: Node| {
                let unset = replay::Value::Number(Symbol::splat(0.0));
                self.parameters[operand.index()].unwrap_or(unset)
            };
            self.parameters[node.index()] = Some(replay::recorded(operation, of, None, input));
            return Ok(());
        }
        if let Some(&component) = self.directions.components.get(&node) {
            self.values[node.index()] = Some(Value::Number(self.direction(component)));
            return Ok(());
        }
        let value = match operation {
            NodeOperation::Input(input) => Value::Number(Polynomial::row(self.given_row(input))),
            NodeOperation::Unary(Unary::Not, a) => Value::Truth(self.not(a)),
            NodeOperation::Binary(kind @ (Binary::And | Binary::Or), a, b) => Value::Truth(self.connective(kind, a, b)),
            NodeOperation::Binary(Binary::Less, a, b) => {
                let difference = self.difference(a, b);
                Value::Truth(Condition::Row(self.below(&difference)))
            }
            _ => Value::Number(self.lower_number(operation)?),
        };
        self.values[node.index()] = Some(value);
        Ok(())
    }

    fn difference(&self, a: Node, b: Node) -> Polynomial {
        self.number(a).sum(self.number(b).negative())
    }

    fn lower_number(&mut self, operation: NodeOperation) -> Result<Polynomial, Fault> {
        Ok(match operation {
            NodeOperation::Unary(Unary::Neg, a) => self.number(a).negative(),
            NodeOperation::Unary(Unary::Sqrt, a) => {
                let a = self.number(a);
                let row = self.square_root(&a);
                Polynomial::row(row)
            }
            NodeOperation::Unary(Unary::Abs, a) => {
                let a = self.number(a);
                let below = self.below(&a);
                self.picked(below, &a.clone().negative(), &a)
            }
            NodeOperation::Unary(Unary::Round, a) => {
                let a = self.number(a);
                let row = self.materialised(&a);
                let (class, is_short) = (self.class_of([row].into_iter()), self.rows[row as usize].is_short);
                let to = self.new_row(class, true, true);
                self.drafts.push(Draft::new(Kind::Round, 1, vec![to, row]));
                let rounded = Polynomial::row(to);
                if !is_short {
                    // It changes where the distance to the integer passes ½. Rounding a phase only removes whole turns.
                    let distance = a.sum(rounded.clone().negative());
                    let square = self.product(&distance, &distance);
                    let switch = square.sum(Polynomial::number(-0.25));
                    let switch = self.materialised(&switch);
                    self.add_switch(switch);
                }
                rounded
            }
            NodeOperation::Binary(Binary::Add, a, b) => self.number(a).sum(self.number(b)),
            NodeOperation::Binary(Binary::Sub, a, b) => self.difference(a, b),
            NodeOperation::Binary(Binary::Mul, a, b) => self.product(&self.number(a), &self.number(b)),
            NodeOperation::Binary(Binary::Div, a, b) => self.quotient(&self.number(a), &self.number(b)),
            NodeOperation::Binary(Binary::Min, a, b) => {
                let below = self.below(&self.difference(b, a));
                self.picked(below, &self.number(b), &self.number(a))
            }
            NodeOperation::Binary(Binary::Max, a, b) => {
                let below = self.below(&self.difference(a, b));
                self.picked(below, &self.number(b), &self.number(a))
            }
            NodeOperation::MulAdd(a, b, c) => self.product(&self.number(a), &self.number(b)).sum(self.number(c)),
            NodeOperation::Select(condition, a, b) => {
                let (a, b) = (self.number(a), self.number(b));
                let condition = self.condition_row(self.condition(condition));
                self.picked(condition, &a, &b)
            }
            NodeOperation::Function(function, a) => {
                let a = self.number(a);
                self.function(function, &a)
            }
            NodeOperation::Function2(function, a, b) => {
                let (a, b) = (self.number(a), self.number(b));
                self.function_of_two(function, &a, &b)?
            }
            // Constants depend on nothing, and the others do not give numbers.
            _ => Polynomial::default(),
        })
    }

    fn operation(&mut self, kind: Kind, written: &[(bool, bool)], read: &[RowNumber]) -> Vec<RowNumber> {
        let class = self.class_of(read.iter().copied());
        let to: Vec<RowNumber> =
            written.iter().map(|&(is_short, is_kept)| self.new_row(class, is_short, is_kept)).collect();
        let rows = to.iter().chain(read).copied().collect();
        self.drafts.push(Draft::new(kind, to.len(), rows));
        to
    }

    fn not(&mut self, a: Node) -> Condition {
        match self.condition(a) {
            Condition::Parameters(truth) => Condition::Parameters(!truth),
            Condition::Row(row) => Condition::Row(self.operation(Kind::Not, &[(true, false)], &[row])[0]),
        }
    }

    fn connective(&mut self, kind: Binary, a: Node, b: Node) -> Condition {
        let rows = [a, b].map(|operand| self.condition_row(self.condition(operand)));
        let kind = if kind == Binary::And { Kind::And } else { Kind::Or };
        Condition::Row(self.operation(kind, &[(true, false)], &rows)[0])
    }

    fn condition_row(&mut self, condition: Condition) -> RowNumber {
        match condition {
            Condition::Row(row) => row,
            Condition::Parameters(truth) => {
                let number = Symbol::select(truth, Symbol::splat(1.0), Symbol::splat(0.0));
                self.materialised(&Polynomial::constant(Factor::of(number)))
            }
        }
    }

    /// 1 if a number is below 0 at the start.
    fn below(&mut self, number: &Polynomial) -> RowNumber {
        let row = self.materialised(number);
        self.add_switch(row);
        self.operation(Kind::Below, &[(true, false)], &[row])[0]
    }

    fn add_switch(&mut self, row: RowNumber) {
        self.keep(row);
        if !self.switches.contains(&row) {
            self.switches.push(row);
        }
    }

    fn picked(&mut self, condition: RowNumber, a: &Polynomial, b: &Polynomial) -> Polynomial {
        let (a, b) = (self.materialised(a), self.materialised(b));
        let is_short = [a, b].iter().all(|row| self.rows[*row as usize].is_short);
        Polynomial::row(self.operation(Kind::Pick, &[(is_short, is_short)], &[condition, a, b])[0])
    }
}

impl Draft {
    fn new(kind: Kind, writes: usize, rows: Vec<RowNumber>) -> Self {
        Self { kind, writes, rows, factors: Vec::new(), constant: None }
    }
}
