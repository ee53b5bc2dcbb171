//! Simplifies an operation when it enters a graph.
//!
//! Operations on constants are evaluated in `f64`. Otherwise an operation is rewritten only if the result is the same to the bit in every
//! precision, whether or not products are fused with sums, with two exceptions: the sign of a zero is not kept, and zero times anything is
//! zero, even if that is infinite or NaN.

use super::fault::Fault;
use super::functions;
use super::graph::{Binary, Builder, Node, Operation, Unary};
use crate::math::real::Function;

use Binary::{Add, And, Div, Less, Max, Min, Mul, Or, Sub};
use Unary::{Abs, Neg, Not, Round, Sqrt};

impl Builder {
    /// The node of an operation, simplified.
    ///
    /// # Errors
    ///
    /// If the graph is full, a constant is divided by zero, or operations on constants give a result that is not finite.
    pub fn apply(&mut self, operation: Operation) -> Result<Node, Fault> {
        match operation {
            Operation::Constant(bits) => self.constant(f64::from_bits(bits)),
            Operation::Truth(_) | Operation::Input(_) => self.node(operation),
            Operation::Unary(kind, a) => self.unary(kind, a),
            Operation::Binary(kind, a, b) => match kind {
                Add | Sub => self.sum(kind, a, b),
                Mul => self.product(a, b),
                Div => self.quotient(a, b),
                Min | Max | Less => self.comparison(kind, a, b),
                And | Or => self.connective(kind, a, b),
            },
            Operation::MulAdd(a, b, c) => self.mul_add(a, b, c),
            Operation::Select(condition, a, b) => self.select(condition, a, b),
            Operation::Function(function, a) => match self.number(a) {
                Some(x) => self.constant(functions::of_constant(function, x)),
                None => self.node(operation),
            },
            Operation::Function2(function, a, b) => match (self.number(a), self.number(b)) {
                (Some(x), Some(y)) => self.constant(functions::of_constants(function, x, y)),
                // On a circle the eccentric anomaly is the mean one.
                (None, Some(0.0)) if function == Function::KeplerSin => {
                    self.node(Operation::Function(Function::Sin, a))
                }
                (None, Some(0.0)) if function == Function::KeplerCos => {
                    self.node(Operation::Function(Function::Cos, a))
                }
                _ => self.node(operation),
            },
        }
    }

    fn number(&self, node: Node) -> Option<f64> {
        self.graph().constant(node)
    }

    fn truth(&self, node: Node) -> Option<bool> {
        match self.graph().operation(node) {
            Operation::Truth(truth) => Some(truth),
            _ => None,
        }
    }

    /// x, if the node is −x.
    fn negated(&self, node: Node) -> Option<Node> {
        match self.graph().operation(node) {
            Operation::Unary(Neg, x) => Some(x),
            _ => None,
        }
    }

    fn unary(&mut self, kind: Unary, a: Node) -> Result<Node, Fault> {
        if let Some(x) = self.number(a) {
            return self.constant(match kind {
                Neg => -x,
                Sqrt => x.sqrt(),
                Abs => x.abs(),
                Round => x.round_ties_even(),
                Not => return Err(Fault::NotFinite),
            });
        }
        if let (Not, Some(truth)) = (kind, self.truth(a)) {
            return self.node(Operation::Truth(!truth));
        }
        match (kind, self.graph().operation(a)) {
            (Neg, Operation::Unary(Neg, x)) | (Not, Operation::Unary(Not, x)) => Ok(x),
            // |−x| = |x|, and both ||x|| and [[x]] change nothing.
            (Abs, Operation::Unary(Neg, x)) => self.unary(Abs, x),
            (Abs, Operation::Unary(Abs, _)) | (Round, Operation::Unary(Round, _)) => Ok(a),
            _ => self.node(Operation::Unary(kind, a)),
        }
    }

    /// a + b or a − b.
    fn sum(&mut self, kind: Binary, a: Node, b: Node) -> Result<Node, Fault> {
        let (x, y) = (self.number(a), self.number(b));
        if let (Some(x), Some(y)) = (x, y) {
            return self.constant(if kind == Add { x + y } else { x - y });
        }
        if y == Some(0.0) {
            return Ok(a);
        }
        if x == Some(0.0) {
            return if kind == Add { Ok(b) } else { self.unary(Neg, b) };
        }
        if let Some(negated) = self.negated(b) {
            return self.sum(if kind == Add { Sub } else { Add }, a, negated);
        }
        if kind == Sub {
            return self.node(Operation::Binary(Sub, a, b));
        }
        if let Some(negated) = self.negated(a) {
            return self.node(Operation::Binary(Sub, b, negated));
        }
        self.node(Operation::Binary(Add, a.min(b), a.max(b)))
    }

    fn product(&mut self, a: Node, b: Node) -> Result<Node, Fault> {
        let (x, y) = (self.number(a), self.number(b));
        if let (Some(x), Some(y)) = (x, y) {
            return self.constant(x * y);
        }
        for (factor, other) in [(x, b), (y, a)] {
            match factor {
                Some(0.0) => return self.constant(0.0),
                Some(1.0) => return Ok(other),
                Some(-1.0) => return self.unary(Neg, other),
                _ => {}
            }
        }
        // Signs move to the front, where sums absorb them.
        match (self.negated(a), self.negated(b)) {
            (Some(a), Some(b)) => self.product(a, b),
            (Some(a), None) => self.product(a, b).and_then(|product| self.unary(Neg, product)),
            (None, Some(b)) => self.product(a, b).and_then(|product| self.unary(Neg, product)),
            (None, None) => self.node(Operation::Binary(Mul, a.min(b), a.max(b))),
        }
    }

    fn quotient(&mut self, a: Node, b: Node) -> Result<Node, Fault> {
        match (self.number(a), self.number(b)) {
            (_, Some(0.0)) => Err(Fault::DivisionByZero),
            (Some(x), Some(y)) => self.constant(x / y),
            (_, Some(1.0)) => Ok(a),
            (_, Some(y)) if has_exact_reciprocal(y) => {
                let reciprocal = self.constant(1.0 / y)?;
                self.product(a, reciprocal)
            }
            _ => self.node(Operation::Binary(Div, a, b)),
        }
    }

    /// The lesser, the greater, or whether a < b. Operands keep their order, which determines the result for NaN.
    fn comparison(&mut self, kind: Binary, a: Node, b: Node) -> Result<Node, Fault> {
        if let (Some(x), Some(y)) = (self.number(a), self.number(b)) {
            return match kind {
                Min => self.constant(x.min(y)),
                Max => self.constant(x.max(y)),
                _ => self.node(Operation::Truth(x < y)),
            };
        }
        match (kind, a == b) {
            (Less, true) => self.node(Operation::Truth(false)),
            (_, true) => Ok(a),
            _ => self.node(Operation::Binary(kind, a, b)),
        }
    }

    fn connective(&mut self, kind: Binary, a: Node, b: Node) -> Result<Node, Fault> {
        for (known, other) in [(self.truth(a), b), (self.truth(b), a)] {
            if let Some(truth) = known {
                // True decides "or", false decides "and".
                return if truth == (kind == Or) { self.node(Operation::Truth(truth)) } else { Ok(other) };
            }
        }
        if a == b { Ok(a) } else { self.node(Operation::Binary(kind, a.min(b), a.max(b))) }
    }

    fn select(&mut self, condition: Node, a: Node, b: Node) -> Result<Node, Fault> {
        if let Some(truth) = self.truth(condition) {
            return Ok(if truth { a } else { b });
        }
        if a == b {
            return Ok(a);
        }
        match self.graph().operation(condition) {
            Operation::Unary(Not, opposite) => self.node(Operation::Select(opposite, b, a)),
            _ => self.node(Operation::Select(condition, a, b)),
        }
    }

    fn mul_add(&mut self, a: Node, b: Node, c: Node) -> Result<Node, Fault> {
        let (x, y, z) = (self.number(a), self.number(b), self.number(c));
        if let (Some(x), Some(y), Some(z)) = (x, y, z) {
            return self.constant(x * y + z);
        }
        if z == Some(0.0) {
            return self.product(a, b);
        }
        for (factor, other) in [(x, b), (y, a)] {
            match factor {
                Some(0.0) => return Ok(c),
                Some(1.0) => return self.sum(Add, other, c),
                Some(-1.0) => return self.sum(Sub, c, other),
                _ => {}
            }
        }
        if let (Some(x), Some(y)) = (x, y)
            && is_exact_product(x, y)
        {
            let product = self.constant(x * y)?;
            return self.sum(Add, product, c);
        }
        let (a, b) = match (self.negated(a), self.negated(b)) {
            (Some(a), Some(b)) => (a, b),
            _ => (a, b),
        };
        self.node(Operation::MulAdd(a.min(b), a.max(b), c))
    }
}

/// Whether 1/x is exact in `f64` and in `f32`: for powers of two in the range of both.
fn has_exact_reciprocal(x: f64) -> bool {
    const EXPONENTS: std::ops::RangeInclusive<u64> = 1023 - 126..=1023 + 126;
    let bits = x.to_bits();
    bits << 12 == 0 && EXPONENTS.contains(&(bits << 1 >> 53))
}

/// Whether both numbers and their product are exact in `f32`, so that it does not matter where the product is rounded.
fn is_exact_product(x: f64, y: f64) -> bool {
    // The product of two numbers of 24 bits has at most 48 and is exact in f64.
    [x, y, x * y].into_iter().all(|number| f64::from(number as f32) == number && number != 0.0)
}
