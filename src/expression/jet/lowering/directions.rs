//! Directions as states: if the attitude is used only to rotate vectors of the world into the body, these vectors are states in its
//! place.
//!
//! With R from the body to the world, d = Rᵀ v for a vector v fixed in the world obeys d' = d × ω: six products for each order, where the
//! orientation and the entries of R take twenty. For v = x cos φ + y sin φ with φ' = n the two directions u = Rᵀ v and w = Rᵀ (y cos φ − x
//! sin φ) are states: u' = u × ω + n w, w' = w × ω − n u. For any other function of time, v = Σ f(t) v_f, each v_f is fixed.

use std::collections::{BTreeMap, HashMap};

use super::super::polynomial::{Factor, Monomial, Polynomial};
use super::super::{Kind, RowNumber};
use super::{Class, Draft, Lowering};
use crate::expression::graph::{Binary, Dependence, Graph, Input, InputKind, Node, Operation, Unary};
use crate::expression::symbol::Symbol;
use crate::math::real::Real;

/// A vector in the world: for each component the node that it is a multiple of (none for 1), and the multiple.
type World = [(Option<Node>, f64); 3];

/// Which nodes of a graph are components of directions.
#[derive(Clone, Debug, Default)]
pub(super) struct Directions {
    pub vectors: Vec<World>,
    /// By node: the index of the vector, the component in the body, and a factor.
    pub components: HashMap<Node, (usize, usize, f64)>,
}

/// The composition of one vector: a sum of states, each multiplied by a row or not.
pub(super) type Parts = Vec<(Option<RowNumber>, [RowNumber; 3])>;

/// A vector in body axes that is a state.
#[derive(Clone, Copy, Debug)]
pub(super) struct State {
    pub rows: [RowNumber; 3],
    /// The vector in the world; for one that turns, at the angle 0.
    pub world: [Symbol; 3],
    pub turning: Option<Turning>,
}

/// A vector of the world that turns uniformly, with the one a quarter of a turn ahead.
#[derive(Clone, Copy, Debug)]
pub(super) struct Turning {
    pub rows: [RowNumber; 3],
    /// The other one at the angle 0.
    pub world: [Symbol; 3],
    /// The angle, rad: the input that it follows, a factor, and an offset.
    pub angle: (Input, Symbol, Symbol),
}

/// Terms of a polynomial in the components x, y, z, w of the orientation, at most two of them in each, each multiplied by at most one node.
type Form = BTreeMap<(Option<Node>, Vec<u8>), f64>;

/// More terms than the rotation of a vector has.
const MOST_TERMS: usize = 64;

impl Directions {
    /// The directions among the nodes that `wanted` need.
    pub fn of(graph: &Graph, wanted: &[Node]) -> Self {
        let mut forms: HashMap<Node, Form> = HashMap::new();
        let mut found = Self::default();
        for node in graph.live(wanted) {
            let Some(form) = form(graph, node, &forms) else { continue };
            if let Some((vector, component)) =
                graph.dependence(node).intersects(Dependence::ATTITUDE).then(|| direction(&form)).flatten()
            {
                found.add(node, vector, component);
            }
            forms.insert(node, form);
        }
        found
    }

    /// The nodes that `wanted` need if components of directions need only the vectors in the world.
    pub fn live(&self, graph: &Graph, wanted: &[Node]) -> Vec<Node> {
        let is_component = |node: Node| self.components.contains_key(&node);
        let live = graph.live_above(wanted, is_component);
        let used = live.iter().filter_map(|node| self.components.get(node));
        let vectors = used.flat_map(|&(vector, ..)| self.vectors[vector]).filter_map(|(node, _)| node);
        let wanted: Vec<Node> = wanted.iter().copied().chain(vectors).collect();
        graph.live_above(&wanted, is_component)
    }

    fn add(&mut self, node: Node, vector: World, component: usize) {
        // Multiples of one vector are merged.
        let factor = vector.iter().map(|(_, multiple)| *multiple).find(|multiple| *multiple != 0.0).unwrap_or(1.0);
        let vector = vector.map(|(node, multiple)| (node, multiple / factor));
        let place = self.vectors.iter().position(|known| *known == vector).unwrap_or_else(|| {
            self.vectors.push(vector);
            self.vectors.len() - 1
        });
        self.components.insert(node, (place, component, factor));
    }
}

/// A node as a polynomial in the orientation, if it is one.
fn form(graph: &Graph, node: Node, forms: &HashMap<Node, Form>) -> Option<Form> {
    let one = |key: (Option<Node>, Vec<u8>), number: f64| Form::from([(key, number)]);
    if !graph.dependence(node).intersects(Dependence::ATTITUDE) {
        return Some(match graph.operation(node) {
            Operation::Constant(bits) => one((None, vec![]), f64::from_bits(bits)),
            _ => one((Some(node), vec![]), 1.0),
        });
    }
    let of = |operand: Node| forms.get(&operand);
    let form = match graph.operation(node) {
        Operation::Input(Input { kind: InputKind::Orientation, index, .. }) => one((None, vec![index as u8]), 1.0),
        Operation::Unary(Unary::Neg, a) => sum(Form::new(), of(a)?, -1.0),
        Operation::Binary(Binary::Add, a, b) => sum(of(a)?.clone(), of(b)?, 1.0),
        Operation::Binary(Binary::Sub, a, b) => sum(of(a)?.clone(), of(b)?, -1.0),
        Operation::Binary(Binary::Mul, a, b) => product(of(a)?, of(b)?)?,
        Operation::MulAdd(a, b, c) => sum(product(of(a)?, of(b)?)?, of(c)?, 1.0),
        _ => return None,
    };
    (form.len() <= MOST_TERMS).then_some(form)
}

fn sum(mut a: Form, b: &Form, factor: f64) -> Form {
    for (key, number) in b {
        *a.entry(key.clone()).or_insert(0.0) += factor * number;
    }
    a.retain(|_, number| *number != 0.0);
    a
}

fn product(a: &Form, b: &Form) -> Option<Form> {
    let mut product = Form::new();
    for ((a_node, a_parts), a_number) in a {
        for ((b_node, b_parts), b_number) in b {
            let mut parts = [&a_parts[..], &b_parts[..]].concat();
            parts.sort_unstable();
            if parts.len() > 2 || (a_node.is_some() && b_node.is_some()) {
                return None;
            }
            *product.entry((a_node.or(*b_node), parts)).or_insert(0.0) += a_number * b_number;
        }
    }
    product.retain(|_, number| *number != 0.0);
    Some(product)
}

/// The vector v and the component i such that a form is the component i of Rᵀ v, from the entries of R.
fn direction(form: &Form) -> Option<(World, usize)> {
    // Keyed by the node and the entry of R, or none: |q|² = 1.
    let mut entries: BTreeMap<(Option<Node>, Option<usize>), f64> = BTreeMap::new();
    for ((node, parts), &number) in form {
        let mut add = |entry: Option<usize>, factor: f64| {
            *entries.entry((*node, entry)).or_insert(0.0) += factor * number;
        };
        match parts[..] {
            [] => add(None, 1.0),
            [a, b] => entries_of(usize::from(a), usize::from(b), &mut add),
            _ => return None,
        }
    }
    let mut vector = [(None, 0.0); 3];
    let mut component = None;
    for ((node, entry), number) in entries.into_iter().filter(|(_, number)| *number != 0.0) {
        let entry = entry?;
        let (row, column) = (entry / 3, entry % 3);
        if component.is_some_and(|known| known != column) || vector[row].1 != 0.0 {
            return None;
        }
        component = Some(column);
        vector[row] = (node, number);
    }
    Some((vector, component?))
}

/// The product of components a ≤ b of the orientation by the entries of R, row by row, and 1: 4 x y = R₁₂ + R₂₁, 4 z w = R₂₁ − R₁₂,
/// 4 x² = 1 + R₁₁ − R₂₂ − R₃₃ and so on.
pub(super) fn entries_of(a: usize, b: usize, add: &mut impl FnMut(Option<usize>, f64)) {
    if a == b {
        add(None, 0.25);
        for axis in 0..3 {
            add(Some(4 * axis), if axis == a || a == 3 { 0.25 } else { -0.25 });
        }
    } else {
        // For x y and z w the entries are those of row 1 and column 2, and vice versa.
        let axes = if b < 3 { (a, b) } else { ((a + 1) % 3, (a + 2) % 3) };
        let (upper, lower) = (3 * axes.0 + axes.1, 3 * axes.1 + axes.0);
        add(Some(upper), if b < 3 { 0.25 } else { -0.25 });
        add(Some(lower), 0.25);
    }
}

impl Lowering<'_> {
    /// A component of a direction.
    pub(super) fn direction(&mut self, (vector, component, factor): (usize, usize, f64)) -> Polynomial {
        let parts = self.parts_of(vector);
        let mut polynomial = Polynomial::default();
        for (time, rows) in parts {
            let row = Monomial::of(rows[component]);
            let monomial = time.and_then(|time| row.product(&Monomial::of(time))).unwrap_or(row);
            polynomial.add(monomial, Factor::number(factor));
        }
        polynomial
    }

    fn parts_of(&mut self, vector: usize) -> Parts {
        if let Some(parts) = &self.parts[vector] {
            return parts.clone();
        }
        // By functions of time: the vectors that they multiply.
        let mut vectors: Vec<(Option<RowNumber>, [Factor; 3])> = Vec::new();
        for (axis, (node, multiple)) in self.directions.vectors[vector].into_iter().enumerate() {
            let number = match node {
                Some(node) => self.number(node),
                None => Polynomial::number(1.0),
            };
            for (monomial, factor) in number.scaled(Factor::number(multiple)).terms {
                let time = match monomial.degree() {
                    0 => None,
                    1 => monomial.rows().next(),
                    _ => Some(self.materialised(&Polynomial { terms: vec![(monomial, Factor::ONE)] })),
                };
                let place = vectors.iter().position(|(known, _)| *known == time).unwrap_or_else(|| {
                    vectors.push((time, [Factor::number(0.0); 3]));
                    vectors.len() - 1
                });
                vectors[place].1[axis] = vectors[place].1[axis].plus(factor);
            }
        }
        let parts = match self.turning(&vectors) {
            Some(rows) => vec![(None, rows)],
            None => vectors.into_iter().map(|(time, vector)| (time, self.fixed(vector))).collect(),
        };
        self.parts[vector] = Some(parts.clone());
        parts
    }

    fn new_direction(&mut self) -> [RowNumber; 3] {
        [(); 3].map(|()| self.new_row(Class::Rotation, false, true))
    }

    /// The state of a vector that is fixed in the world.
    fn fixed(&mut self, vector: [Factor; 3]) -> [RowNumber; 3] {
        let world = vector.map(Factor::symbol);
        let known = self.states.iter().find(|state| state.turning.is_none() && state.world == world);
        if let Some(state) = known {
            return state.rows;
        }
        let rows = self.new_direction();
        self.states.push(State { rows, world, turning: None });
        rows
    }

    /// The state of a vector that turns uniformly, if these are its parts.
    fn turning(&mut self, vectors: &[(Option<RowNumber>, [Factor; 3])]) -> Option<[RowNumber; 3]> {
        let &[(Some(first), first_vector), (Some(second), second_vector)] = vectors else { return None };
        let (row, vectors) = self.circular.iter().find_map(|(&(angle, eccentricity), &[sin, cos])| {
            let vectors = match (first, second) {
                _ if eccentricity.is_some() => None,
                (a, b) if [a, b] == [cos, sin] => Some([first_vector, second_vector]),
                (a, b) if [a, b] == [sin, cos] => Some([second_vector, first_vector]),
                _ => None,
            };
            vectors.map(|vectors| (angle, vectors))
        })?;
        let angle = self.angle(row)?;
        let [world, ahead] = vectors.map(|vector| vector.map(Factor::symbol));
        let known = self.states.iter().find(|state| {
            state.world == world
                && state.turning.is_some_and(|turning| (turning.world, turning.angle) == (ahead, angle))
        });
        if let Some(state) = known {
            return Some(state.rows);
        }
        let (rows, others) = (self.new_direction(), self.new_direction());
        self.states.push(State { rows, world, turning: Some(Turning { rows: others, world: ahead, angle }) });
        Some(rows)
    }

    /// A row that advances uniformly as f · input + c.
    fn angle(&self, row: RowNumber) -> Option<(Input, Symbol, Symbol)> {
        let input = |row: RowNumber| {
            let given = self.given.iter().find(|(_, known)| *known == row);
            given.map(|(input, _)| *input).filter(|_| self.rows[row as usize].is_short)
        };
        let (zero, one) = (Symbol::splat(0.0), Symbol::splat(1.0));
        if let Some(input) = input(row) {
            return Some((input, one, zero));
        }
        let (polynomial, _) = self.sums.iter().find(|(_, known)| *known == row)?;
        let (mut advances, mut offset) = (None, zero);
        for (monomial, factor) in &polynomial.terms {
            match monomial.degree() {
                0 => offset = factor.symbol(),
                1 if advances.is_none() => advances = Some((input(monomial.rows().next()?)?, factor.symbol())),
                _ => return None,
            }
        }
        let (input, factor) = advances?;
        Some((input, factor, offset))
    }

    /// The equations of the directions that are states.
    pub(super) fn follow_directions(&mut self, angular_velocity: &[RowNumber]) {
        let (turning, fixed): (Vec<State>, Vec<State>) =
            self.states.iter().copied().partition(|state| state.turning.is_some());
        for pair in fixed.chunks(2) {
            let kind = if pair.len() == 2 { Kind::TwoDirections } else { Kind::Direction };
            let rows = pair.iter().flat_map(|state| state.rows).chain(angular_velocity.iter().copied());
            self.drafts.push(Draft::new(kind, 0, rows.collect()));
        }
        for State { rows, turning, .. } in turning {
            let Some(Turning { rows: others, angle: (input, factor, _), .. }) = turning else { continue };
            let row = self.given_row(input);
            let mut draft = Draft::new(Kind::Turning, 0, [&rows[..], &others, angular_velocity, &[row]].concat());
            draft.factors.push(factor);
            self.drafts.push(draft);
        }
    }
}
