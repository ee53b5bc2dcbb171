//! Derivatives of a formula with respect to one of its inputs, recorded beside the formula.
//!
//! Every operation derives its result from the derivatives of its operands by its own rule (forward mode; A. Griewank, A. Walther,
//! *Evaluating Derivatives*, 2nd ed. 2008, section 3.1). For an operand that does not depend on the input, nothing is recorded. At a kink
//! (`abs`, `min`, `max`, `select`, `round`) the derivative is that of the side that is taken.

use super::graph::{Binary, Graph, Input, Node, Operation, Unary};
use super::replay::{Value, number, recorded};
use super::symbol::{Symbol, Truth};
use crate::math::real::{Function, Real};

impl Graph {
    /// Records the operations that form `outputs` again, in the recording that runs on this thread, followed by their
    /// derivatives with respect to `by`.
    pub(super) fn with_derivatives(
        &self,
        outputs: &[Node],
        by: Input,
        mut input: impl FnMut(Input) -> Symbol,
    ) -> Vec<Symbol> {
        let zero = Symbol::splat(0.0);
        let mut values = vec![Value::Number(zero); self.len()];
        let mut derivatives: Vec<Option<Symbol>> = vec![None; self.len()];
        for node in self.live(outputs) {
            let operation = self.operation(node);
            let value = recorded(operation, |operand| values[operand.index()], None, &mut input);
            self.hand_name_on(node, value);
            values[node.index()] = value;
            derivatives[node.index()] = match operation {
                Operation::Input(found) => (found == by).then(|| Symbol::splat(1.0)),
                _ => Rules { values: &values, derivatives: &derivatives }.derivative(operation, value),
            };
        }
        let values = outputs.iter().map(|output| number(values[output.index()]));
        values.chain(outputs.iter().map(|output| derivatives[output.index()].unwrap_or(zero))).collect()
    }
}

/// What is known of the operands.
struct Rules<'a> {
    values: &'a [Value],
    derivatives: &'a [Option<Symbol>],
}

impl Rules<'_> {
    fn of(&self, node: Node) -> Symbol {
        number(self.values[node.index()])
    }

    fn truth(&self, node: Node) -> Truth {
        match self.values[node.index()] {
            Value::Truth(truth) => truth,
            Value::Number(number) => Symbol::splat(0.5).less_than(number),
        }
    }

    /// The derivative of an operand.
    fn by(&self, node: Node) -> Option<Symbol> {
        self.derivatives[node.index()]
    }

    /// The derivative of an operation's result, which is `value`.
    fn derivative(&self, operation: Operation, value: Value) -> Option<Symbol> {
        let one = Symbol::splat(1.0);
        match operation {
            Operation::Constant(_) | Operation::Truth(_) | Operation::Input(_) => None,
            Operation::Unary(Unary::Neg, a) => self.by(a).map(|slope| -slope),
            Operation::Unary(Unary::Sqrt, a) => self.by(a).map(|slope| slope * Symbol::splat(0.5) / number(value)),
            Operation::Unary(Unary::Abs, a) => {
                let is_negative = self.of(a).less_than(Symbol::splat(0.0));
                self.by(a).map(|slope| Symbol::select(is_negative, -slope, slope))
            }
            Operation::Unary(Unary::Round | Unary::Not, _) => None,
            Operation::Binary(Binary::Add, a, b) => plus(self.by(a), self.by(b)),
            Operation::Binary(Binary::Sub, a, b) => plus(self.by(a), self.by(b).map(|slope| -slope)),
            Operation::Binary(Binary::Mul, a, b) => self.of_product(a, b),
            Operation::Binary(Binary::Div, a, b) => {
                let of_divisor = self.by(b).map(|slope| -(number(value) * slope));
                plus(self.by(a), of_divisor).map(|slope| slope / self.of(b))
            }
            Operation::Binary(Binary::Min, a, b) => self.of_side(self.of(a).less_than(self.of(b)), a, b),
            Operation::Binary(Binary::Max, a, b) => self.of_side(self.of(a).less_than(self.of(b)), b, a),
            Operation::Binary(Binary::Less | Binary::And | Binary::Or, ..) => None,
            Operation::MulAdd(a, b, c) => plus(self.of_product(a, b), self.by(c)),
            Operation::Select(condition, a, b) => self.of_side(self.truth(condition), a, b),
            Operation::Function(function, a) => {
                let (x, y) = (self.of(a), number(value));
                let slope = self.by(a)?;
                Some(match function {
                    Function::Sin => x.function(Function::Cos) * slope,
                    Function::Cos => -(x.function(Function::Sin) * slope),
                    Function::Tan => (one + y * y) * slope,
                    Function::Asin => slope / (one - x * x).sqrt(),
                    Function::Acos => -(slope / (one - x * x).sqrt()),
                    Function::Exp => y * slope,
                    Function::Ln => slope / x,
                    // Functions of two arguments.
                    _ => return None,
                })
            }
            Operation::Function2(function, a, b) => self.of_two(function, (a, b), number(value)),
        }
    }

    fn of_product(&self, a: Node, b: Node) -> Option<Symbol> {
        let first = self.by(a).map(|slope| slope * self.of(b));
        plus(first, self.by(b).map(|slope| self.of(a) * slope))
    }

    /// The derivative of `a` where the condition holds, that of `b` elsewhere.
    fn of_side(&self, condition: Truth, a: Node, b: Node) -> Option<Symbol> {
        let zero = Symbol::splat(0.0);
        match (self.by(a), self.by(b)) {
            (None, None) => None,
            (a, b) => Some(Symbol::select(condition, a.unwrap_or(zero), b.unwrap_or(zero))),
        }
    }

    fn of_two(&self, function: Function, (a, b): (Node, Node), value: Symbol) -> Option<Symbol> {
        let one = Symbol::splat(1.0);
        let (x, y) = (self.of(a), self.of(b));
        let (of_x, of_y) = (self.by(a), self.by(b));
        match function {
            // y = a, x = b.
            Function::Atan2 => {
                let square = x * x + y * y;
                let across = plus(of_x.map(|slope| y * slope), of_y.map(|slope| -(x * slope)));
                across.map(|across| across / square)
            }
            Function::Pow => plus(
                of_x.map(|slope| y * x.function_with(Function::Pow, y - one) * slope),
                of_y.map(|slope| value * x.function(Function::Ln) * slope),
            ),
            // E − e sin E = M.
            Function::KeplerSin | Function::KeplerCos => {
                let sin = x.function_with(Function::KeplerSin, y);
                let cos = x.function_with(Function::KeplerCos, y);
                let anomaly = plus(of_x, of_y.map(|slope| sin * slope))? / (one - y * cos);
                Some(if function == Function::KeplerSin { cos * anomaly } else { -(sin * anomaly) })
            }
            // Occurs only in the library's own formulas, which do not depend on time.
            _ => None,
        }
    }
}

fn plus(a: Option<Symbol>, b: Option<Symbol>) -> Option<Symbol> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a + b),
        (a, b) => a.or(b),
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Expression, Shape, Symbols};

    /// Compares the recorded derivative with central differences at two steps, extrapolated.
    #[test]
    fn derivatives_by_time_are_those_of_differences() {
        let symbols = Symbols::inertia().parameter("a", Shape::Number).expect("a name");
        let formulas = [
            "sin(a * time) * cos(time^2)",
            "-exp(-time / a) + ln(1 + time)",
            "sqrt(1 + a * time) / (2 + cos(time))",
            "tan(0.1 * time) + asin(0.2 * time) + acos(0.3 * time)",
            "atan2(sin(time), a + time) + atan2(a, time)",
            "pow(1 + time, a) + pow(a, time) + pow(time, time)",
            "abs(time - 2) * min(time, 3) + max(a, time) * smoothstep(0, 3, time)",
            "select(time < 2, time^3, 8) + clamp(time, 0, 2) * step(1, time)",
            "kepler_sin(time, 0.1 * a) + kepler_cos(2 * time, 0.3) + kepler_sin(a, 0.1 * time)",
            "norm(vec(time, 1, a)) * dot(vec(1, time, 2), cross(vec(time, 2, 1), vec(a, time, time^2)))",
            "inertia.xx + a",
        ];
        for text in formulas {
            let formula = Expression::parse(text, &symbols, Shape::Number).unwrap_or_else(|error| panic!("{error}"));
            let (graph, outputs) = formula.with_rates().expect("a graph");
            let program = super::super::Program::new(&graph, &outputs);
            let at = |time: f64| {
                let inputs = program.inputs().iter().map(|input| match input.kind {
                    super::super::InputKind::Time => time,
                    super::super::InputKind::Parameter => 1.3,
                    _ => 2.0,
                });
                program.evaluate_one(&inputs.collect::<Vec<f64>>())
            };
            for time in [0.4, 1.4, 2.5] {
                let slope = |h: f64| (at(time + h)[0] - at(time - h)[0]) / (2.0 * h);
                let expected = (4.0 * slope(1e-3) - slope(2e-3)) / 3.0;
                let found = at(time)[1];
                // h⁴/30 of the fifth derivative, which is below 1e3 here, and rounding divided by h.
                assert!((found - expected).abs() < 1e-9, "{text} at {time}: {found} and {expected}");
            }
        }
    }
}
