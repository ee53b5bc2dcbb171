//! From a graph to rows and operations on them.

use std::collections::HashMap;

use super::super::fault::Fault;
use super::super::graph::{Binary, Dependence, Graph, Input, InputKind, Node, Operation as NodeOperation, Unary};
use super::super::program::Program;
use super::super::replay;
use super::super::symbol::{Symbol, Truth};
use super::polynomial::{Factor, Monomial, Polynomial};
use super::{Jets, Kind, Operation, Place, RowNumber};
use crate::real::{Function, Real, Scalar};

/// What is to be formed of a graph.
#[derive(Clone, Debug, Default)]
pub(crate) struct Equations {
    /// States and their derivatives.
    pub rates: Vec<(Input, Node)>,
    /// The angular velocity.
    pub angular_velocity: Option<[Node; 3]>,
    /// Whether the orientation is a state too, with q' = ½ q ω.
    pub has_orientation: bool,
    /// Series that are wanted beside those of the states and the angular velocity.
    pub outputs: Vec<Node>,
}

/// What a row depends on, as far as the expansion of products asks.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Class {
    /// A component of the orientation.
    Attitude,
    /// An entry of the matrix of the rotation.
    Rotation,
    /// Of time and parameters.
    Time,
    Other,
}

#[derive(Clone, Copy, Debug)]
struct Row {
    class: Class,
    /// Whether only its first two coefficients are not 0.
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
    /// For each body once.
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
    /// Of nodes that depend on parameters alone.
    parameters: Vec<Option<replay::Value>>,
    /// Of the others.
    values: Vec<Option<Value>>,
    rows: Vec<Row>,
    drafts: Vec<Draft>,
    given: Vec<(Input, RowNumber)>,
    products: HashMap<(RowNumber, RowNumber), RowNumber>,
    sums: Vec<(Polynomial, RowNumber)>,
    circular: HashMap<(RowNumber, Option<RowNumber>), [RowNumber; 2]>,
    switches: Vec<RowNumber>,
    roots: Vec<RowNumber>,
    /// The entries of the matrix of the rotation, where they are asked for.
    rotation: Option<[RowNumber; 9]>,
}

/// A graph in rows and operations, of no order yet.
#[derive(Clone, Debug)]
pub(crate) struct Lowered {
    rows: Vec<Row>,
    drafts: Vec<Draft>,
    /// What stands for the factor of a draft: its place among those of [`Lowered::factors`].
    factors: Program,
    given: Vec<(Input, RowNumber)>,
    outputs: Vec<RowNumber>,
    switches: Vec<RowNumber>,
    roots: Vec<RowNumber>,
    /// The same factors of each draft, and of its constant, by number.
    numbers: Vec<(Vec<usize>, Option<usize>)>,
}

/// Lowers what `equations` ask for.
///
/// # Errors
///
/// Where the factors are more than a graph may have, or not finite.
pub(crate) fn lowered(graph: &Graph, equations: &Equations) -> Result<Lowered, Fault> {
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
            rotation: None,
        };
        outputs = lowering.lower(equations, |input| recorder.input(input))?;
        // Equal factors are one.
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
        let Lowering { rows, drafts, given, switches, roots, .. } = lowering;
        kept = Some((rows, drafts, given, switches, roots, numbers));
        Ok(factors)
    })?;
    let Some((rows, drafts, given, switches, roots, numbers)) = kept else { return Err(Fault::ForeignSymbol) };
    let factors = Program::new(&factor_graph, &factor_nodes);
    Ok(Lowered { rows, drafts, factors, given, outputs, switches, roots, numbers })
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
        let rates = equations.rates.iter().map(|(_, rate)| *rate);
        let angular_velocity = equations.angular_velocity.into_iter().flatten();
        let wanted: Vec<Node> = rates.chain(angular_velocity).chain(equations.outputs.iter().copied()).collect();
        for node in self.graph.live(&wanted) {
            self.lower_node(node, &mut input)?;
        }
        let mut outputs = Vec::new();
        for node in equations.angular_velocity.into_iter().flatten().chain(equations.outputs.iter().copied()) {
            let value = self.number(node);
            let row = self.materialised(&value);
            outputs.push(self.keep(row));
        }
        if !self.follow_euler(equations, &outputs) {
            for (state, rate) in &equations.rates {
                let rate = self.number(*rate);
                let rate = self.materialised(&rate);
                let state = self.given_row(*state);
                self.drafts.push(Draft::new(Kind::Integral, 0, vec![state, rate]));
            }
        }
        if equations.has_orientation {
            let orientation = self.orientation();
            self.drafts.push(Draft::new(
                Kind::Attitude,
                0,
                [&orientation[..], &outputs[..3.min(outputs.len())]].concat(),
            ));
        }
        self.drop_unused(&outputs);
        self.share_triples();
        self.add_products();
        self.share_factors();
        Ok(outputs)
    }

    fn orientation(&mut self) -> [RowNumber; 4] {
        [0, 1, 2, 3].map(|part| self.given_row(Input::new(InputKind::Orientation, part)))
    }

    /// Where ω is m by constant factors, Euler's equations, what is linear in a component's own m and what is constant are one operation.
    fn follow_euler(&mut self, equations: &Equations, angular_velocity: &[RowNumber]) -> bool {
        let momentum = [0, 1, 2].map(|part| Input::new(InputKind::AngularMomentum, part));
        let are_momenta = equations.rates.iter().map(|(state, _)| *state).eq(momentum);
        let (Some(nodes), true) = (equations.angular_velocity, are_momenta) else { return false };
        let m = momentum.map(|state| self.given_row(state));
        let mut factors = [[Factor::number(0.0); 3]; 4];
        for (axis, node) in nodes.into_iter().enumerate() {
            match self.number(node).terms[..] {
                [(monomial, factor)] if monomial == Monomial::of(m[axis]) => factors[1][axis] = factor,
                _ => return false,
            }
        }
        let mut rests = Vec::new();
        for (axis, (_, rate)) in equations.rates.iter().enumerate() {
            let mut rate = self.number(*rate);
            let (b, c) = (m[(axis + 1) % 3], m[(axis + 2) % 3]);
            let pair = self.products.get(&(b.min(c), b.max(c))).copied();
            let own = [pair.map(Monomial::of), None, Some(Monomial::of(m[axis])), Some(Monomial::ONE)];
            for (factors, monomial) in factors.iter_mut().zip(own) {
                if let Some(factor) = monomial.and_then(|monomial| rate.take(&monomial)) {
                    factors[axis] = factor;
                }
            }
            rests.push(rate);
        }
        let mut rows = [&m[..], &angular_velocity[..3]].concat();
        if rests.iter().any(|rest| !rest.terms.is_empty()) {
            rows.extend(rests.iter().map(|rest| self.materialised(rest)).collect::<Vec<_>>());
        }
        for draft in &mut self.drafts {
            // Later coefficients follow from those of m when these are formed.
            if draft.writes == 1 && angular_velocity[..3].contains(&draft.rows[0]) {
                draft.kind = Kind::Start;
            }
        }
        let mut draft = Draft::new(Kind::Euler, 0, rows);
        draft.factors = factors.concat().into_iter().map(Factor::symbol).collect();
        self.drafts.push(draft);
        true
    }

    /// Leaves out what no result needs.
    fn drop_unused(&mut self, outputs: &[RowNumber]) {
        let mut needed = vec![false; self.rows.len()];
        let wanted = outputs.iter().chain(&self.switches);
        wanted.for_each(|row| needed[*row as usize] = true);
        for draft in self.drafts.iter().rev() {
            let (written, read) = draft.rows.split_at(draft.writes);
            if written.is_empty() || written.iter().any(|row| needed[*row as usize]) {
                read.iter().for_each(|row| needed[*row as usize] = true);
            }
        }
        let is_needed = |rows: &[RowNumber]| rows.is_empty() || rows.iter().any(|row| needed[*row as usize]);
        self.drafts.retain(|draft| is_needed(&draft.rows[..draft.writes]));
        self.roots.retain(|row| is_needed(&[*row]));
        let drafts = &self.drafts;
        self.products.retain(|_, row| drafts.iter().any(|draft| draft.rows[..draft.writes].contains(row)));
    }

    fn given_row(&mut self, input: Input) -> RowNumber {
        if let Some((_, row)) = self.given.iter().find(|(given, _)| *given == input) {
            return *row;
        }
        // What is not a state advances at a constant rate.
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

    /// Of what is formed from rows.
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
            // A graph holds no number where a truth value belongs, and operands stand before their uses.
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
                    // It changes where the distance to the integer passes ½. A phase that is rounded only loses whole turns.
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
            // Constants depend on nothing, and the others give no number.
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

    /// 1 where a number is below 0 at the start.
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

    fn product(&mut self, a: &Polynomial, b: &Polynomial) -> Polynomial {
        if let Some(factor) = a.as_constant() {
            return b.clone().scaled(factor);
        }
        if let Some(factor) = b.as_constant() {
            return a.clone().scaled(factor);
        }
        if let Some(product) = a.product(b, |monomial| self.is_expanded(monomial)) {
            return self.rotated(product);
        }
        let ((a, a_factor), (b, b_factor)) = (self.factored(a), self.factored(b));
        Polynomial::row(self.product_row(a, b)).scaled(a_factor.times(b_factor))
    }

    /// Whether a product stays as it is until it is known what is added to it: a quadratic form of the orientation, times a
    /// function of time.
    fn is_expanded(&self, monomial: &Monomial) -> bool {
        let count = |class| monomial.rows().filter(|&row| self.class(row) == class).count();
        let (attitude, rotation, time) = (count(Class::Attitude), count(Class::Rotation), count(Class::Time));
        let is_form = attitude + rotation + time == monomial.degree() && (1..=2).contains(&(attitude + 2 * rotation));
        monomial.degree() <= 1 || (is_form && time <= 1)
    }

    /// Products of two components of the orientation as entries of the matrix R of the rotation, by |q|² = 1:
    /// 4 x y = R₁₂ + R₂₁, 4 z w = R₂₁ − R₁₂, 4 x² = 1 + R₁₁ − R₂₂ − R₃₃ and so on. Of what rotates a vector this leaves a
    /// third of the terms.
    fn rotated(&mut self, polynomial: Polynomial) -> Polynomial {
        let is_attitude = |row: &RowNumber| self.class(*row) == Class::Attitude;
        let pair_of = |monomial: &Monomial| {
            let mut parts = monomial.rows().filter(is_attitude);
            Some((parts.next()?, parts.next()?))
        };
        if !polynomial.terms.iter().any(|(monomial, _)| pair_of(monomial).is_some()) {
            return polynomial;
        }
        let pairs: Vec<_> = polynomial.terms.iter().map(|(monomial, _)| pair_of(monomial)).collect();
        let parts = self.orientation();
        let entries = self.rotation();
        let mut rotated = Polynomial::default();
        for ((monomial, factor), pair) in polynomial.terms.into_iter().zip(pairs) {
            let Some((a, b)) = pair else {
                rotated.add(monomial, factor);
                continue;
            };
            let rest = monomial.without(a).without(b);
            let number = |row| parts.iter().position(|part| *part == row).unwrap_or(0);
            let (a, b) = (number(a).min(number(b)), number(a).max(number(b)));
            let mut add = |entry: Option<usize>, sign: f64| {
                let product = match entry {
                    Some(entry) => rest.product(&Monomial::of(entries[entry])),
                    None => Some(rest),
                };
                if let Some(product) = product {
                    rotated.add(product, factor.times(Factor::number(0.25 * sign)));
                }
            };
            if a == b {
                add(None, 1.0);
                for axis in 0..3 {
                    add(Some(4 * axis), if axis == a || a == 3 { 1.0 } else { -1.0 });
                }
            } else {
                // Of x y and z w the entries are those of row 1 and column 2, and the other way round.
                let axes = if b < 3 { (a, b) } else { ((a + 1) % 3, (a + 2) % 3) };
                let (upper, lower) = (3 * axes.0 + axes.1, 3 * axes.1 + axes.0);
                add(Some(upper), if b < 3 { 1.0 } else { -1.0 });
                add(Some(lower), 1.0);
            }
        }
        rotated.without_zeros()
    }

    /// The entries of the matrix of the rotation from principal axes to the world, row by row.
    fn rotation(&mut self) -> [RowNumber; 9] {
        if let Some(rows) = self.rotation {
            return rows;
        }
        let rows = [(); 9].map(|()| self.new_row(Class::Rotation, false, false));
        let read = self.orientation();
        self.drafts.push(Draft::new(Kind::Rotation, 9, [&rows[..], &read].concat()));
        self.rotation = Some(rows);
        rows
    }

    /// A row, and what it is to be multiplied by.
    fn factored(&mut self, polynomial: &Polynomial) -> (RowNumber, Factor) {
        if let [(monomial, factor)] = polynomial.terms[..]
            && monomial.degree() > 0
        {
            let single = Polynomial { terms: vec![(monomial, Factor::ONE)] };
            return (self.materialised(&single), factor);
        }
        (self.materialised(polynomial), Factor::ONE)
    }

    fn product_row(&mut self, a: RowNumber, b: RowNumber) -> RowNumber {
        let (a, b) = (a.min(b), a.max(b));
        if let Some(&row) = self.products.get(&(a, b)) {
            return row;
        }
        self.keep(a);
        self.keep(b);
        let (kind, read) = if a == b { (Kind::Square, vec![a]) } else { (Kind::Product, vec![a, b]) };
        let row = self.operation(kind, &[(false, false)], &read)[0];
        self.products.insert((a, b), row);
        row
    }

    fn quotient(&mut self, a: &Polynomial, b: &Polynomial) -> Polynomial {
        if let Some(divisor) = b.as_constant() {
            let mut quotient = a.clone();
            for (_, factor) in &mut quotient.terms {
                *factor = factor.over(divisor);
            }
            return quotient;
        }
        let ((a, a_factor), (b, b_factor)) = (self.factored(a), self.factored(b));
        self.keep(b);
        let row = self.operation(Kind::Quotient, &[(false, true), (true, false)], &[a, b])[0];
        Polynomial::row(row).scaled(a_factor.over(b_factor))
    }

    fn square_root(&mut self, a: &Polynomial) -> RowNumber {
        let a = self.materialised(a);
        let row = self.operation(Kind::Sqrt, &[(false, true), (true, false)], &[a])[0];
        self.roots.push(row);
        row
    }

    fn sine_and_cosine(&mut self, a: &Polynomial) -> [RowNumber; 2] {
        let a = self.materialised(a);
        if let Some(rows) = self.circular.get(&(a, None)) {
            return *rows;
        }
        let rows = if self.rows[a as usize].is_short {
            self.keep(a);
            self.operation(Kind::SinCosAffine, &[(false, true); 2], &[a])
        } else {
            self.operation(Kind::SinCos, &[(false, true); 3], &[a])
        };
        self.circular.insert((a, None), [rows[0], rows[1]]);
        [rows[0], rows[1]]
    }

    /// The function with the derivative a'/r.
    fn primitive(&mut self, function: Function, a: &Polynomial, r: &Polynomial) -> RowNumber {
        let (a, r) = (self.materialised(a), self.materialised(r));
        self.keep(r);
        self.operation(Kind::Primitive(function), &[(false, false), (false, true), (true, false)], &[a, r])[0]
    }

    fn function(&mut self, function: Function, a: &Polynomial) -> Polynomial {
        let one = Polynomial::number(1.0);
        match function {
            Function::Sin => Polynomial::row(self.sine_and_cosine(a)[0]),
            Function::Cos => Polynomial::row(self.sine_and_cosine(a)[1]),
            Function::Exp => {
                let a = self.materialised(a);
                Polynomial::row(self.operation(Kind::Exp, &[(false, true); 2], &[a])[0])
            }
            Function::Tan => {
                let a = self.materialised(a);
                Polynomial::row(self.operation(Kind::Tan, &[(false, true); 3], &[a])[0])
            }
            Function::Ln => Polynomial::row(self.primitive(function, a, a)),
            Function::Asin | Function::Acos => {
                let square = self.product(a, a);
                let root = self.square_root(&one.sum(square.negative()));
                let sign = Factor::number(if function == Function::Asin { 1.0 } else { -1.0 });
                Polynomial::row(self.primitive(function, a, &Polynomial::row(root).scaled(sign)))
            }
            // Σ (−x)ⁿ/(2n + 1): as many terms as where it is evaluated.
            Function::ArctangentRatio => {
                let a = self.materialised(a);
                let a = Polynomial::row(a);
                let term = |n: u32| f64::from(1 - 2 * (n as i32 % 2)) / f64::from(2 * n + 1);
                let last = <f64 as Scalar>::ARCTANGENT_TERMS;
                let mut sum = Polynomial::number(term(last));
                for n in (0..last).rev() {
                    sum = self.product(&sum, &a).sum(Polynomial::number(term(n)));
                }
                sum
            }
            // These have two arguments.
            Function::Atan2 | Function::Pow | Function::KeplerSin | Function::KeplerCos => Polynomial::default(),
        }
    }

    fn function_of_two(&mut self, function: Function, a: &Polynomial, b: &Polynomial) -> Result<Polynomial, Fault> {
        Ok(match function {
            Function::Atan2 => {
                let (x_squared, y_squared) = (self.product(b, b), self.product(a, a));
                let r = self.materialised(&x_squared.sum(y_squared));
                let (y, x) = (self.materialised(a), self.materialised(b));
                for row in [r, y, x] {
                    self.keep(row);
                }
                let written = [(false, false), (false, true), (false, true), (false, true), (true, false)];
                Polynomial::row(self.operation(Kind::Atan2, &written, &[y, x, r])[0])
            }
            Function::Pow => match b.as_constant() {
                Some(exponent) if exponent.is_zero() => Polynomial::number(1.0),
                Some(exponent) if matches!(exponent.symbol().constant(), Some(n) if n > 0.0 && n <= 8.0 && n == n.round()) =>
                {
                    let mut product = a.clone();
                    for _ in 1..exponent.symbol().constant().unwrap_or(1.0) as u32 {
                        product = self.product(&product, a);
                    }
                    product
                }
                Some(exponent) => {
                    let a = self.materialised(a);
                    self.keep(a);
                    let written = [(false, true), (false, true), (false, true), (true, false)];
                    let rows = self.operation(Kind::Power, &written, &[a]);
                    if let Some(draft) = self.drafts.last_mut() {
                        draft.factors.push(exponent.symbol());
                    }
                    Polynomial::row(rows[0])
                }
                // aᵇ = exp(b ln a).
                None => {
                    let logarithm = self.function(Function::Ln, a);
                    let exponent = self.product(b, &logarithm);
                    self.function(Function::Exp, &exponent)
                }
            },
            Function::KeplerSin | Function::KeplerCos => {
                let Some(eccentricity) = b.as_constant() else { return Err(Fault::VaryingEccentricity) };
                let mean_anomaly = self.materialised(a);
                let factor = self.materialised(b);
                let known = self.circular.get(&(mean_anomaly, Some(factor))).copied();
                let rows = known.unwrap_or_else(|| {
                    let written = [(false, true), (false, true), (false, true), (true, false)];
                    let rows = self.operation(Kind::Kepler, &written, &[mean_anomaly]);
                    if let Some(draft) = self.drafts.last_mut() {
                        draft.factors.push(eccentricity.symbol());
                    }
                    [rows[0], rows[1]]
                });
                self.circular.insert((mean_anomaly, Some(factor)), rows);
                Polynomial::row(rows[usize::from(function == Function::KeplerCos)])
            }
            _ => Polynomial::default(),
        })
    }

    /// The row of a polynomial. What is multiplied by the same function of time is added up before.
    fn materialised(&mut self, polynomial: &Polynomial) -> RowNumber {
        if let [(monomial, factor)] = polynomial.terms[..]
            && monomial.degree() == 1
            && factor == Factor::ONE
            && let Some(row) = monomial.rows().next()
        {
            return row;
        }
        if let Some((_, row)) = self.sums.iter().find(|(known, _)| known == polynomial) {
            return *row;
        }
        let mut by_time: Vec<(RowNumber, Polynomial)> = Vec::new();
        let mut linear: Vec<(RowNumber, Factor)> = Vec::new();
        let mut constant = None;
        let time_of =
            |lowering: &Self, monomial: &Monomial| monomial.rows().find(|&row| lowering.class(row) == Class::Time);
        for (monomial, factor) in &polynomial.terms {
            match (monomial.degree(), time_of(self, monomial)) {
                (0, _) => constant = Some(*factor),
                (2.., Some(time)) => {
                    let rest = monomial.without(time);
                    match by_time.iter_mut().find(|(row, _)| *row == time) {
                        Some((_, sum)) => sum.add(rest, *factor),
                        None => by_time.push((time, Polynomial { terms: vec![(rest, *factor)] })),
                    }
                }
                (1, _) => linear.extend(monomial.rows().map(|row| (row, *factor))),
                _ => {
                    let mut rows = monomial.rows();
                    if let (Some(a), Some(b)) = (rows.next(), rows.next()) {
                        linear.push((self.product_row(a, b), *factor));
                    }
                }
            }
        }
        for (time, mut sum) in by_time {
            // What is multiplied by the function alone.
            if let Some(place) = linear.iter().position(|(row, _)| *row == time) {
                sum.add(Monomial::ONE, linear.swap_remove(place).1);
            }
            let (row, factor) = self.factored(&sum);
            linear.push((self.product_row(time, row), factor));
        }
        let row = match (&linear[..], constant) {
            (&[(row, Factor::ONE)], None) => row,
            _ => {
                let rows: Vec<RowNumber> = linear.iter().map(|(row, _)| *row).collect();
                let is_short = rows.iter().all(|row| self.rows[*row as usize].is_short);
                let kind = if is_short { Kind::ShortLinear } else { Kind::Linear };
                let to = self.operation(kind, &[(is_short, is_short)], &rows)[0];
                if let Some(draft) = self.drafts.last_mut() {
                    draft.factors = linear.iter().map(|(_, factor)| factor.symbol()).collect();
                    draft.constant = constant.map(Factor::symbol);
                }
                to
            }
        };
        self.sums.push((polynomial.clone(), row));
        row
    }

    /// The three products of three rows in one operation, which reads each of them once.
    fn share_triples(&mut self) {
        let heights = heights(&self.drafts, self.rows.len());
        let mut pairs: Vec<(RowNumber, RowNumber)> = self.products.keys().copied().filter(|(a, b)| a != b).collect();
        pairs.sort_unstable();
        for &(a, b) in &pairs {
            for &(_, c) in pairs.iter().filter(|(first, _)| *first == b) {
                let products = [(b, c), (a, c), (a, b)].map(|pair| self.products.get(&pair).copied());
                let [Some(bc), Some(ca), Some(ab)] = products else { continue };
                let is_attitude = [a, b, c].iter().any(|&row| self.class(row) == Class::Attitude);
                // Of equal height, none of them is below another.
                let are_level = [ca, ab].iter().all(|row| heights[*row as usize] == heights[bc as usize]);
                if is_attitude || !are_level || !self.are_products(&[bc, ca, ab]) {
                    continue;
                }
                self.replace(&[bc, ca, ab], Draft::new(Kind::Triple, 3, vec![bc, ca, ab, a, b, c]));
            }
        }
    }

    /// Whether each of these rows is formed by a product of its own.
    fn are_products(&self, rows: &[RowNumber]) -> bool {
        rows.iter().all(|row| {
            let own = |draft: &&Draft| draft.rows.first() == Some(row);
            self.drafts.iter().find(own).is_some_and(|draft| matches!(draft.kind, Kind::Product | Kind::Square))
        })
    }

    /// Products that only one sum reads, all with one factor, in one operation that adds them up.
    fn add_products(&mut self) {
        let mut reads = vec![0_usize; self.rows.len()];
        for draft in &self.drafts {
            draft.rows[draft.writes..].iter().for_each(|row| reads[*row as usize] += 1);
        }
        let mut at = 0;
        while at < self.drafts.len() {
            let group = if self.drafts[at].kind == Kind::Linear { self.group_of(at, &reads) } else { None };
            let Some((places, factor)) = group else {
                at += 1;
                continue;
            };
            let rows: Vec<RowNumber> = places.iter().map(|place| self.drafts[at].rows[1 + place]).collect();
            let mut operands = Vec::new();
            for row in &rows {
                let own = |draft: &&Draft| draft.writes == 1 && draft.rows[0] == *row;
                if let Some(draft) = self.drafts.iter().find(own) {
                    operands.extend([draft.rows[1], draft.rows[draft.rows.len() - 1]]);
                }
            }
            let sum = self.new_row(Class::Other, false, false);
            reads.push(1);
            let linear = &mut self.drafts[at];
            for place in places.into_iter().rev() {
                linear.rows.remove(1 + place);
                linear.factors.remove(place);
            }
            if linear.factors.is_empty() && linear.constant.is_none() && factor.constant() == Some(1.0) {
                let to = linear.rows[0];
                *linear = Draft::new(Kind::Products, 1, [&[to][..], &operands].concat());
            } else {
                linear.rows.push(sum);
                linear.factors.push(factor);
                self.drafts.push(Draft::new(Kind::Products, 1, [&[sum][..], &operands].concat()));
            }
            self.drafts.retain(|own| !(own.writes == 1 && rows.contains(&own.rows[0])));
            // Places have moved.
            at = 0;
        }
    }

    /// Three sums of products by the same functions in one operation, which reads these once: a vector by a function, a direction that
    /// turns.
    fn share_factors(&mut self) {
        let mut counts = vec![0_usize; self.rows.len()];
        let is_sum = |draft: &Draft| matches!(draft.kind, Kind::Product | Kind::Products);
        for draft in self.drafts.iter().filter(|draft| is_sum(draft)) {
            let mut read = draft.rows[1..].to_vec();
            read.sort_unstable();
            read.dedup();
            read.iter().for_each(|row| counts[*row as usize] += 1);
        }
        let heights = heights(&self.drafts, self.rows.len());
        // The factors that others have too, and what each of them multiplies.
        let split = |draft: &Draft| -> Option<(Vec<RowNumber>, Vec<RowNumber>)> {
            let mut pairs = Vec::new();
            for pair in draft.rows[1..].chunks_exact(2) {
                let (a, b) = (pair[0], pair[1]);
                pairs.push(match (counts[a as usize] > 2, counts[b as usize] > 2) {
                    (true, false) => (a, b),
                    (false, true) => (b, a),
                    _ => return None,
                });
            }
            pairs.sort_unstable();
            Some(pairs.into_iter().unzip())
        };
        // By height, as then none of a group is below another, and by the factors shared.
        type Groups = Vec<((usize, Vec<RowNumber>), Vec<(RowNumber, Vec<RowNumber>)>)>;
        let mut groups = Groups::new();
        for draft in self.drafts.iter().filter(|draft| is_sum(draft)) {
            let Some((shared, own)) = split(draft) else { continue };
            let (key, member) = ((heights[draft.rows[0] as usize], shared), (draft.rows[0], own));
            match groups.iter_mut().find(|(known, _)| *known == key) {
                Some((_, members)) => members.push(member),
                None => groups.push((key, vec![member])),
            }
        }
        for ((_, shared), members) in groups {
            for three in members.chunks_exact(3) {
                let mut rows: Vec<RowNumber> = three.iter().map(|(to, _)| *to).collect();
                self.drafts.retain(|draft| draft.writes != 1 || !rows.contains(&draft.rows[0]));
                for (place, &row) in shared.iter().enumerate() {
                    rows.push(row);
                    rows.extend(three.iter().map(|(_, own)| own[place]));
                }
                self.drafts.push(Draft::new(Kind::VectorProducts, 3, rows));
            }
        }
    }

    /// Terms of a sum, at least two, that are products which nothing else reads, and have the same factor.
    fn group_of(&self, at: usize, reads: &[usize]) -> Option<(Vec<usize>, Symbol)> {
        let draft = &self.drafts[at];
        let is_own =
            |row: RowNumber| reads[row as usize] == 1 && !self.rows[row as usize].is_kept && self.are_products(&[row]);
        let terms: Vec<usize> = (0..draft.factors.len()).filter(|place| is_own(draft.rows[1 + place])).collect();
        terms.iter().find_map(|&first| {
            let factor = draft.factors[first];
            let alike: Vec<usize> = terms.iter().copied().filter(|&place| draft.factors[place] == factor).collect();
            (alike.len() > 1).then_some((alike, factor))
        })
    }

    /// Puts one operation in the place of those that form these rows.
    fn replace(&mut self, rows: &[RowNumber], draft: Draft) {
        let forms = |own: &Draft| own.writes == 1 && rows.contains(&own.rows[0]);
        let first = self.drafts.iter().position(forms).unwrap_or(self.drafts.len());
        self.drafts.retain(|own| !forms(own));
        self.drafts.insert(first, draft);
    }
}

/// How many operations lie below each row, at most.
fn heights(drafts: &[Draft], rows: usize) -> Vec<usize> {
    let mut heights = vec![0_usize; rows];
    // A shared operation may stand before what forms its operands; no row needs more rounds than there are operations.
    for _ in 0..=drafts.len() {
        let mut has_changed = false;
        for draft in drafts {
            let (written, read) = draft.rows.split_at(draft.writes);
            let height = read.iter().map(|row| heights[*row as usize] + 1).max().unwrap_or(1);
            for row in written {
                has_changed |= heights[*row as usize] != height;
                heights[*row as usize] = height;
            }
        }
        if !has_changed {
            break;
        }
    }
    heights
}

impl Draft {
    fn new(kind: Kind, writes: usize, rows: Vec<RowNumber>) -> Self {
        Self { kind, writes, rows, factors: Vec::new(), constant: None }
    }
}

impl Lowered {
    /// Series of the states up to this order.
    pub fn up_to(&self, order: usize) -> Jets {
        let mut room = 0;
        let rows: Vec<Place> = self
            .rows
            .iter()
            .map(|row| {
                let base = room;
                room += if row.is_kept { order + 1 } else { 1 };
                Place { base: base as u32, stride: u32::from(row.is_kept) }
            })
            .collect();
        let mut jets = Jets {
            order,
            operations: vec![],
            runs: vec![],
            rows: vec![],
            factor_numbers: vec![],
            room,
            factors: self.factors.clone(),
            given: self.given.iter().map(|(input, row)| (*input, rows[*row as usize])).collect(),
            outputs: self.outputs.iter().map(|row| rows[*row as usize]).collect(),
            switches: self.switches.iter().map(|row| rows[*row as usize]).collect(),
            roots: self.roots.iter().map(|row| rows[*row as usize]).collect(),
        };
        for draft in self.sorted() {
            let (draft, (factors, constant)) = (&self.drafts[draft], &self.numbers[draft]);
            let factor = jets.factor_numbers.len();
            jets.factor_numbers.extend(factors.iter().chain(constant));
            let constant = constant.map(|_| factor + factors.len());
            let (first, count) = (jets.rows.len(), draft.rows.len());
            jets.rows.extend(draft.rows.iter().map(|row| rows[*row as usize]));
            jets.operations.push(Operation { kind: draft.kind, first, count, factor, constant });
            match jets.runs.last_mut() {
                Some((kind, count)) if *kind == draft.kind => *count += 1,
                _ => jets.runs.push((draft.kind, 1)),
            }
        }
        jets
    }

    /// The drafts by height, and within one height by kind; what only the next order reads stands last.
    fn sorted(&self) -> Vec<usize> {
        let heights = heights(&self.drafts, self.rows.len());
        let height = |draft: &Draft| match draft.writes {
            0 => usize::MAX,
            _ => heights[draft.rows[0] as usize],
        };
        let mut order: Vec<usize> = (0..self.drafts.len()).collect();
        order.sort_by_key(|&draft| (height(&self.drafts[draft]), self.drafts[draft].kind));
        order
    }
}
