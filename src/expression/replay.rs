//! Records a formula again with other inputs, and with exact phases instead of products with time.
//!
//! A time in `f32` is soon too coarse for a sine. If the argument of a sine or cosine, or the mean anomaly of Kepler's equation, is r t + b, and r and b depend only on
//! parameters, r t is a phase that the clock counts exactly ([`crate::math::clock`]): an input in turns, whose rate r is computed
//! once for each body.

use super::graph::{Binary, Dependence, Graph, Input, InputKind, Node, Operation, Unary};
use super::symbol::{Symbol, Truth};
use crate::math::real::{Function, Real};

/// The replacement of a node.
#[derive(Clone, Copy)]
pub(super) enum Value {
    Number(Symbol),
    Truth(Truth),
}

/// r t + b; no rate if t does not occur.
#[derive(Clone, Copy)]
struct Affine {
    rate: Option<Symbol>,
    offset: Symbol,
}

/// A formula recorded again.
pub struct Replayed {
    /// The results.
    pub outputs: Vec<Symbol>,
    /// Rates of its phases, rad/s, which depend only on parameters; phase i is the input [`InputKind::Phase`] i.
    pub rates: Vec<Symbol>,
}

impl Graph {
    /// Records the operations that form `outputs` again, in the recording that runs on this thread. `input` replaces each input; it is
    /// asked for phases from `first_phase` on.
    pub fn replayed(&self, outputs: &[Node], first_phase: u16, mut input: impl FnMut(Input) -> Symbol) -> Replayed {
        let zero = Symbol::splat(0.0);
        let mut values = vec![Value::Number(zero); self.len()];
        let mut affine: Vec<Option<Affine>> = vec![None; self.len()];
        // The argument of each phase, which sine and cosine share.
        let mut phases: Vec<(Node, Symbol)> = Vec::new();
        let mut rates = Vec::new();
        for node in self.live(outputs) {
            let operation = self.operation(node);
            let turned = match operation {
                Operation::Function(Function::Sin | Function::Cos, argument)
                | Operation::Function2(Function::KeplerSin | Function::KeplerCos, argument, _) => {
                    match affine[argument.index()] {
                        Some(Affine { rate: Some(rate), offset }) => {
                            let known = phases.iter().find(|(known, _)| *known == argument).map(|(_, angle)| *angle);
                            Some(match known {
                                Some(angle) => angle,
                                None => {
                                    let index = first_phase + rates.len() as u16;
                                    let turns = input(Input::new(InputKind::Phase, index));
                                    let angle = turns * Symbol::splat(std::f64::consts::TAU) + offset;
                                    if let Some(name) = self.name(argument) {
                                        angle.take_name(name);
                                    }
                                    rates.push(rate);
                                    phases.push((argument, angle));
                                    angle
                                }
                            })
                        }
                        _ => None,
                    }
                }
                _ => None,
            };
            let value = recorded(operation, |operand| values[operand.index()], turned, &mut input);
            self.hand_name_on(node, value);
            values[node.index()] = value;
            affine[node.index()] = self.affine(node, value, &affine);
        }
        let outputs = outputs.iter().map(|output| number(values[output.index()])).collect();
        Replayed { outputs, rates }
    }

    /// Records the operations that form `outputs` again, unchanged, in the recording that runs on this thread.
    pub(super) fn substituted(&self, outputs: &[Node], mut input: impl FnMut(Input) -> Symbol) -> Vec<Symbol> {
        let mut values = vec![Value::Number(Symbol::splat(0.0)); self.len()];
        for node in self.live(outputs) {
            let operation = self.operation(node);
            let value = recorded(operation, |operand| values[operand.index()], None, &mut input);
            self.hand_name_on(node, value);
            values[node.index()] = value;
        }
        outputs.iter().map(|output| number(values[output.index()])).collect()
    }

    /// Gives the replacement of a node its name, unless it has one.
    pub(super) fn hand_name_on(&self, node: Node, value: Value) {
        match (self.name(node), value) {
            (Some(name), Value::Number(number)) => number.take_name(name),
            (Some(name), Value::Truth(truth)) => truth.take_name(name),
            (None, _) => {}
        }
    }

    /// A node as r t + b, if it has that form.
    fn affine(&self, node: Node, value: Value, known: &[Option<Affine>]) -> Option<Affine> {
        let dependence = self.dependence(node);
        if !dependence.is_within(Dependence::PARAMETERS | Dependence::TIME) {
            return None;
        }
        let Value::Number(value) = value else { return None };
        if !dependence.intersects(Dependence::TIME) {
            return Some(Affine { rate: None, offset: value });
        }
        let of = |node: Node| known[node.index()];
        let sum = |a: Affine, b: Affine| Affine {
            rate: match (a.rate, b.rate) {
                (Some(a), Some(b)) => Some(a + b),
                (a, b) => a.or(b),
            },
            offset: a.offset + b.offset,
        };
        let negative = |a: Affine| Affine { rate: a.rate.map(|rate| -rate), offset: -a.offset };
        let product = |a: Affine, b: Affine| match (a.rate, b.rate) {
            (None, rate) => Some(Affine { rate: rate.map(|rate| rate * a.offset), offset: a.offset * b.offset }),
            (rate, None) => Some(Affine { rate: rate.map(|rate| rate * b.offset), offset: a.offset * b.offset }),
            _ => None,
        };
        match self.operation(node) {
            Operation::Input(Input { kind: InputKind::Time, .. }) => {
                Some(Affine { rate: Some(Symbol::splat(1.0)), offset: Symbol::splat(0.0) })
            }
            Operation::Unary(Unary::Neg, a) => of(a).map(negative),
            Operation::Binary(Binary::Add, a, b) => Some(sum(of(a)?, of(b)?)),
            Operation::Binary(Binary::Sub, a, b) => Some(sum(of(a)?, negative(of(b)?))),
            Operation::Binary(Binary::Mul, a, b) => product(of(a)?, of(b)?),
            Operation::Binary(Binary::Div, a, b) => match (of(a)?, of(b)?) {
                (a, Affine { rate: None, offset }) => {
                    Some(Affine { rate: a.rate.map(|rate| rate / offset), offset: a.offset / offset })
                }
                _ => None,
            },
            Operation::MulAdd(a, b, c) => Some(sum(product(of(a)?, of(b)?)?, of(c)?)),
            _ => None,
        }
    }
}

pub(super) fn number(value: Value) -> Symbol {
    match value {
        Value::Number(number) => number,
        // A graph has no number where a truth value belongs.
        Value::Truth(truth) => Symbol::select(truth, Symbol::splat(1.0), Symbol::splat(0.0)),
    }
}

/// An operation recorded again; `value` replaces its operands, `argument` that of a sine or cosine, or the mean anomaly.
pub(super) fn recorded(
    operation: Operation,
    value: impl Fn(Node) -> Value,
    argument: Option<Symbol>,
    input: &mut impl FnMut(Input) -> Symbol,
) -> Value {
    let of = |node: Node| number(value(node));
    let truth = |node: Node| match value(node) {
        Value::Truth(truth) => truth,
        Value::Number(number) => Symbol::splat(0.5).less_than(number),
    };
    Value::Number(match operation {
        Operation::Constant(bits) => Symbol::splat(f64::from_bits(bits)),
        Operation::Truth(known) => {
            let (zero, one) = (Symbol::splat(0.0), Symbol::splat(1.0));
            return Value::Truth(if known { zero.less_than(one) } else { one.less_than(zero) });
        }
        Operation::Input(from) => input(from),
        Operation::Unary(Unary::Neg, a) => -of(a),
        Operation::Unary(Unary::Sqrt, a) => of(a).sqrt(),
        Operation::Unary(Unary::Abs, a) => of(a).abs(),
        Operation::Unary(Unary::Round, a) => of(a).round(),
        Operation::Unary(Unary::Not, a) => return Value::Truth(!truth(a)),
        Operation::Binary(Binary::Add, a, b) => of(a) + of(b),
        Operation::Binary(Binary::Sub, a, b) => of(a) - of(b),
        Operation::Binary(Binary::Mul, a, b) => of(a) * of(b),
        Operation::Binary(Binary::Div, a, b) => of(a) / of(b),
        Operation::Binary(Binary::Min, a, b) => of(a).min(of(b)),
        Operation::Binary(Binary::Max, a, b) => of(a).max(of(b)),
        Operation::Binary(Binary::Less, a, b) => return Value::Truth(of(a).less_than(of(b))),
        Operation::Binary(Binary::And, a, b) => return Value::Truth(truth(a) & truth(b)),
        Operation::Binary(Binary::Or, a, b) => return Value::Truth(truth(a) | truth(b)),
        Operation::MulAdd(a, b, c) => of(a).mul_add(of(b), of(c)),
        Operation::Select(condition, a, b) => Symbol::select(truth(condition), of(a), of(b)),
        Operation::Function(function, a) => argument.unwrap_or_else(|| of(a)).function(function),
        Operation::Function2(function, a, b) => argument.unwrap_or_else(|| of(a)).function_with(function, of(b)),
    })
}
