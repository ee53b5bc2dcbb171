//! How far rounding may take a recorded formula: a running error bound (N. J. Higham, *Accuracy and Stability of Numerical Algorithms*,
//! section 3.3). It uses the sizes of the terms instead of their sum, so that it holds for any order and grouping of a sum and for products
//! that are fused or factored out.

use crate::expression::graph::{Binary, Graph, Input, Node, Operation, Unary};
use crate::math::elementary::functions;
use crate::math::kepler::eccentric_anomaly;
use crate::math::real::{Function, sin_cos};

/// A number with its error bound.
#[derive(Clone, Copy, Debug)]
pub struct Running {
    /// Its value in `f64`.
    pub value: f64,
    /// The sum of the absolute values of its terms.
    size: f64,
    /// How far an evaluation may be from the value.
    pub error: f64,
}

#[derive(Clone, Copy)]
enum Found {
    Number(Running),
    Truth(bool),
    /// It hangs on rounding, or is out of range.
    Unknown,
}

/// An allowance for second-order terms, which the bounds neglect.
const SECOND_ORDER: f64 = 1.1;
/// Ulps of a quotient or a square root on a GPU; an ulp is up to two units of roundoff.
const GPU_ULPS: f64 = 2.5;
/// The largest error stated for a function in formulas, ulps (tests/mirror/parity/formulas.rs).
const FUNCTION_ULPS: f64 = 3.0;

/// How an evaluation rounds.
#[derive(Clone, Copy)]
struct Rounding {
    /// The unit roundoff.
    unit: f64,
    /// Whether products of sums may be multiplied out. Otherwise one factor of each product may be.
    distributes: bool,
}

impl Rounding {
    /// The magnitude that multiplies the error of another factor.
    fn magnitude(self, factor: &Running) -> f64 {
        if self.distributes { factor.size } else { factor.value.abs() }
    }

    fn size_of_product(self, a: &Running, b: &Running) -> f64 {
        if self.distributes { a.size * b.size } else { (a.size * b.value.abs()).max(a.value.abs() * b.size) }
    }
}

impl Running {
    /// The sum of the absolute values of its terms, by which the roundings of a sum are measured.
    pub fn size(&self) -> f64 {
        self.size
    }

    fn exact(value: f64) -> Self {
        Self { value, size: value.abs(), error: 0.0 }
    }

    fn is_zero(&self) -> bool {
        self.size == 0.0 && self.error == 0.0
    }

    /// Whether multiplication by it is exact.
    fn is_power_of_two(&self) -> bool {
        self.error == 0.0 && self.value.to_bits() & ((1 << 52) - 1) == 0 && self.value.is_normal()
    }

    fn sum(self, other: Self, sign: f64, rounding: Rounding) -> Self {
        let (value, size) = (self.value + sign * other.value, self.size + other.size);
        let rounding = if self.is_zero() || other.is_zero() { 0.0 } else { rounding.unit * size };
        Self { value, size, error: self.error + other.error + rounding }
    }

    fn product(self, other: Self, rounding: Rounding) -> Self {
        let (value, size) = (self.value * other.value, rounding.size_of_product(&self, &other));
        let is_exact = self.is_zero() || other.is_zero() || self.is_power_of_two() || other.is_power_of_two();
        let [own, others] = [&self, &other].map(|factor| rounding.magnitude(factor));
        let rounding = if is_exact { 0.0 } else { rounding.unit * size };
        let error = self.error * others + own * other.error + self.error * other.error + rounding;
        Self { value, size, error }
    }

    fn bounded(value: f64, error: f64) -> Found {
        Found::Number(Self { value, size: value.abs(), error })
    }
}

/// The bounds of some results for inputs that are exact numbers of the evaluation, whose unit roundoff is `u`; `None` if a
/// decision hangs on rounding or a quotient may be anything.
pub fn bounds(graph: &Graph, outputs: &[Node], input: impl Fn(Input) -> f64, u: f64) -> Vec<Option<Running>> {
    formed(graph, outputs, |which| (input(which), 0.0), Rounding { unit: u, distributes: true })
}

/// As [`bounds`], for inputs with an error, given as the second number, and without multiplying out products of sums:
/// in long formulas that would make the bound useless.
pub fn bounds_within(
    graph: &Graph,
    outputs: &[Node],
    input: impl Fn(Input) -> (f64, f64),
    u: f64,
) -> Vec<Option<Running>> {
    formed(graph, outputs, input, Rounding { unit: u, distributes: false })
}

fn formed(
    graph: &Graph,
    outputs: &[Node],
    input: impl Fn(Input) -> (f64, f64),
    rounding: Rounding,
) -> Vec<Option<Running>> {
    let mut found = vec![Found::Unknown; graph.len()];
    for node in graph.live(outputs) {
        found[node.index()] = of(graph.operation(node), &found, &input, rounding);
    }
    let number = |output: &Node| match found[output.index()] {
        Found::Number(number) => Some(Running { error: SECOND_ORDER * number.error, ..number }),
        _ => None,
    };
    outputs.iter().map(number).collect()
}

fn of(operation: Operation, found: &[Found], input: &impl Fn(Input) -> (f64, f64), rounding: Rounding) -> Found {
    let u = rounding.unit;
    let number = |node: Node| match found[node.index()] {
        Found::Number(number) => Some(number),
        _ => None,
    };
    let truth = |node: Node| match found[node.index()] {
        Found::Truth(truth) => Some(truth),
        _ => None,
    };
    let attempt = || -> Option<Found> {
        Some(match operation {
            Operation::Constant(bits) => {
                // A constant is rounded to the precision.
                let value = f64::from_bits(bits);
                let is_exact = u < 1e-12 || f64::from(value as f32) == value;
                Running::bounded(value, if is_exact { 0.0 } else { u * value.abs() })
            }
            Operation::Truth(truth) => Found::Truth(truth),
            Operation::Input(which) => match input(which) {
                (value, _) if !value.is_finite() => return None,
                (value, 0.0) => Found::Number(Running::exact(value)),
                (value, error) => Running::bounded(value, error),
            },
            Operation::Unary(unary, a) => match unary {
                Unary::Not => Found::Truth(!truth(a)?),
                Unary::Neg => Found::Number(Running { value: -number(a)?.value, ..number(a)? }),
                Unary::Abs => Found::Number(Running { value: number(a)?.value.abs(), ..number(a)? }),
                Unary::Sqrt => {
                    let a = number(a)?;
                    let root = a.value.max(0.0).sqrt();
                    // Near 0, with an error of the input: |√(a + e) − √a| ≤ √|e|.
                    if a.value < 4.0 * a.error && a.error > 16.0 * u * a.size {
                        return Some(Running::bounded(root, (a.error + a.value.abs()).sqrt()));
                    }
                    let is_clear = a.is_zero() || a.value > 4.0 * a.error;
                    let slope = if a.error == 0.0 { 0.0 } else { a.error / root };
                    is_clear.then(|| Running::bounded(root, slope + 2.0 * GPU_ULPS * u * root))?
                }
                Unary::Round => {
                    let a = number(a)?;
                    let to_border = (a.value - a.value.floor() - 0.5).abs();
                    (a.error == 0.0 || to_border > a.error).then(|| Running::bounded(a.value.round_ties_even(), 0.0))?
                }
            },
            Operation::Binary(binary, a, b) => match binary {
                Binary::And => Found::Truth(truth(a)? && truth(b)?),
                Binary::Or => Found::Truth(truth(a)? || truth(b)?),
                Binary::Less => {
                    let (a, b) = (number(a)?, number(b)?);
                    let error = a.error + b.error;
                    (error == 0.0 || (a.value - b.value).abs() > error).then_some(Found::Truth(a.value < b.value))?
                }
                Binary::Add => Found::Number(number(a)?.sum(number(b)?, 1.0, rounding)),
                Binary::Sub => Found::Number(number(a)?.sum(number(b)?, -1.0, rounding)),
                Binary::Mul => Found::Number(number(a)?.product(number(b)?, rounding)),
                Binary::Div => {
                    let (a, b) = (number(a)?, number(b)?);
                    let least = b.value.abs() - b.error;
                    let (value, size) = (a.value / b.value, a.size / b.value.abs());
                    let magnitude = if rounding.distributes { size } else { value.abs() };
                    let error = (a.error + magnitude * b.error) / least + 2.0 * GPU_ULPS * u * size;
                    (least > 0.0).then_some(Found::Number(Running { value, size, error }))?
                }
                Binary::Min | Binary::Max => {
                    let (a, b) = (number(a)?, number(b)?);
                    let (lesser, greater) = if a.value < b.value { (a, b) } else { (b, a) };
                    if greater.value - lesser.value > greater.error + lesser.error {
                        return Some(Found::Number(if binary == Binary::Min { lesser } else { greater }));
                    }
                    let value = if binary == Binary::Min { a.value.min(b.value) } else { a.value.max(b.value) };
                    Found::Number(Running { value, size: a.size.max(b.size), error: a.error.max(b.error) })
                }
            },
            Operation::MulAdd(a, b, c) => {
                Found::Number(number(a)?.product(number(b)?, rounding).sum(number(c)?, 1.0, rounding))
            }
            Operation::Select(condition, a, b) => match truth(condition) {
                Some(truth) => Found::Number(if truth { number(a)? } else { number(b)? }),
                // Either may be chosen.
                None => {
                    let (a, b) = (number(a)?, number(b)?);
                    let error = a.error.max(b.error) + (a.value - b.value).abs();
                    Found::Number(Running { size: a.size.max(b.size), error, ..a })
                }
            },
            // Stated: within one ulp of 1.
            Operation::Function(function @ (Function::Sin | Function::Cos), a) => {
                let a = number(a)?;
                let (sin, cos) = sin_cos(a.value);
                let value = if function == Function::Sin { sin } else { cos };
                Found::Number(Running { value, size: 1.0, error: a.error + 2.0 * u })
            }
            // Stated at the function: 4 units of roundoff of pi over 1 - e; then as a sine.
            Operation::Function2(function @ (Function::KeplerSin | Function::KeplerCos), m, e) => {
                let (m, e) = (number(m)?, number(e)?);
                let (_, sin, cos) = eccentric_anomaly(m.value, e.value);
                let value = if function == Function::KeplerSin { sin } else { cos };
                let anomaly = (4.0 * std::f64::consts::PI * u + m.error + e.error) / (1.0 - e.value - e.error);
                Found::Number(Running { value, size: 1.0, error: anomaly + 2.0 * u })
            }
            Operation::Function(function, a) => {
                let a = number(a)?;
                let of = |x: f64| match function {
                    Function::Tan => functions::tan(x),
                    Function::Asin => functions::asin(x.clamp(-1.0, 1.0)),
                    Function::Acos => functions::acos(x.clamp(-1.0, 1.0)),
                    Function::Exp => functions::exp(x),
                    Function::Ln => functions::ln(x),
                    Function::ArctangentRatio => functions::arctangent_ratio(x.max(0.0)),
                    _ => f64::NAN,
                };
                let ends = [of(a.value - a.error), of(a.value + a.error)];
                through(of(a.value), &ends, u)?
            }
            Operation::Function2(function, a, b) => {
                let (a, b) = (number(a)?, number(b)?);
                let of = |a: f64, b: f64| match function {
                    Function::Atan2 => functions::atan2(a, b),
                    Function::Pow => functions::pow(a, b),
                    _ => f64::NAN,
                };
                let around = |x: Running| [x.value - x.error, x.value + x.error];
                let ends: Vec<f64> = around(a).into_iter().flat_map(|a| around(b).map(|b| of(a, b))).collect();
                through(of(a.value, b.value), &ends, u)?
            }
        })
    };
    attempt().unwrap_or(Found::Unknown)
}

/// The bound of a monotonic function from its values at the ends of its arguments' ranges; `None` where it jumps.
fn through(value: f64, ends: &[f64], u: f64) -> Option<Found> {
    // At an end where the value is NaN the function is not defined.
    if ends.iter().any(|end| end.is_nan()) {
        return None;
    }
    let spread = ends.iter().fold(0.0, |spread: f64, end| spread.max((end - value).abs()));
    let error = spread + FUNCTION_ULPS * 2.0 * u * value.abs();
    (value.is_finite() && error < 1e-2 * value.abs().max(1.0)).then(|| Running::bounded(value, error))
}
