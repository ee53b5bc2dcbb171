//! Values of the language, and the operators and functions on them.

use super::fault::Fault;
use super::symbol::{Recorder, Symbol, Truth};
use super::symbols::{Scope, Shape};
use super::vocabulary;
use crate::math::quaternion::Quaternion;
use crate::math::real::{Function, Real, sin_cos};
use crate::math::vector::Vector;

/// A value.
#[derive(Clone, Copy, Debug)]
pub(super) enum Value {
    Number(Symbol),
    Vector(Vector<Symbol>),
    Rotation(Quaternion<Symbol>),
    Truth(Truth),
    /// The inertia tensor, which has only products with vectors, and elements.
    Inertia,
}

use Value::{Inertia, Number, Rotation};

impl Value {
    /// Its description, with an article.
    pub(super) fn described(&self) -> &'static str {
        match self {
            Number(_) => Shape::Number.described(),
            Value::Vector(_) => Shape::Vector.described(),
            Rotation(_) => Shape::Quaternion.described(),
            Value::Truth(_) => "a truth value",
            Inertia => "the inertia",
        }
    }

    /// Takes `name` in texts written from the recording, if it has no name yet.
    pub(super) fn take_name(self, name: &str, recorder: &Recorder) {
        match self {
            Number(x) => recorder.name(name, &[x]),
            Value::Vector(v) => recorder.name(name, &[v.x, v.y, v.z]),
            Rotation(q) => recorder.name(name, &[q.x, q.y, q.z, q.w]),
            Value::Truth(truth) => truth.take_name(&name.into()),
            Inertia => {}
        }
    }

    /// The numbers of a value, which must have the shape `wanted`.
    pub(super) fn into_symbols(self, wanted: Shape) -> Result<Vec<Symbol>, Fault> {
        match (self, wanted) {
            (Number(x), Shape::Number) => Ok(vec![x]),
            (Value::Vector(v), Shape::Vector) => Ok(vec![v.x, v.y, v.z]),
            (Rotation(q), Shape::Quaternion) => Ok(vec![q.x, q.y, q.z, q.w]),
            _ => Err(shape("the result", &self, wanted.described())),
        }
    }

    /// A component of a vector or a rotation, or an element of the inertia.
    pub(super) fn component(self, name: &str, scope: &Scope) -> Result<Value, Fault> {
        let unknown = |known| Fault::UnknownComponent { name: name.to_owned(), known };
        Ok(Number(match (self, name) {
            (Value::Vector(v), "x") => v.x,
            (Value::Vector(v), "y") => v.y,
            (Value::Vector(v), "z") => v.z,
            (Value::Vector(_), _) => return Err(unknown("x, y, z")),
            (Rotation(q), "x") => q.x,
            (Rotation(q), "y") => q.y,
            (Rotation(q), "z") => q.z,
            (Rotation(q), "w") => q.w,
            (Rotation(_), _) => return Err(unknown("x, y, z, w")),
            (Inertia, _) => scope.inertia_element(name)?,
            _ => return Err(shape(&format!("`.{name}`"), &self, "a vector or a rotation")),
        }))
    }
}

fn shape(of: &str, found: &Value, needed: &str) -> Fault {
    Fault::Shape { of: of.to_owned(), found: found.described().to_owned(), needed: needed.to_owned() }
}

/// −a or !a.
pub(super) fn prefixed(sign: &str, a: Value) -> Result<Value, Fault> {
    Ok(match (sign, a) {
        ("-", Number(x)) => Number(-x),
        ("-", Value::Vector(v)) => Value::Vector(-v),
        ("-", Rotation(q)) => Rotation(Quaternion::new(-q.x, -q.y, -q.z, -q.w)),
        ("!", Value::Truth(truth)) => Value::Truth(!truth),
        ("!", _) => return Err(shape("`!`", &a, "a truth value")),
        _ => return Err(shape("`-`", &a, "a number, a vector or a rotation")),
    })
}

/// a `sign` b.
pub(super) fn joined(sign: &str, a: Value, b: Value, scope: &Scope) -> Result<Value, Fault> {
    match sign {
        "+" | "-" => sum(sign, a, b),
        "*" => product(a, b, scope),
        "/" => quotient(a, b),
        "&&" | "||" => match (a, b) {
            (Value::Truth(a), Value::Truth(b)) => Ok(Value::Truth(if sign == "&&" { a & b } else { a | b })),
            (Value::Truth(_), other) | (other, _) => Err(shape(&format!("`{sign}`"), &other, "truth values")),
        },
        _ => match (a, b) {
            (Number(a), Number(b)) => Ok(Value::Truth(match sign {
                "<" => a.less_than(b),
                ">" => b.less_than(a),
                "<=" => !b.less_than(a),
                _ => !a.less_than(b),
            })),
            (Number(_), other) | (other, _) => Err(shape(&format!("`{sign}`"), &other, "numbers")),
        },
    }
}

fn sum(sign: &str, a: Value, b: Value) -> Result<Value, Fault> {
    let add = sign == "+";
    Ok(match (a, b) {
        (Number(a), Number(b)) => Number(if add { a + b } else { a - b }),
        (Value::Vector(a), Value::Vector(b)) => Value::Vector(if add { a + b } else { a - b }),
        (Rotation(a), Rotation(b)) => Rotation(if add { a + b } else { a - b }),
        _ => {
            return Err(Fault::Shape {
                of: format!("`{sign}`"),
                found: format!("{} and {}", a.described(), b.described()),
                needed: "two numbers, two vectors or two rotations".to_owned(),
            });
        }
    })
}

fn product(a: Value, b: Value, scope: &Scope) -> Result<Value, Fault> {
    let needed = match (a, b) {
        (Number(a), Number(b)) => return Ok(Number(a * b)),
        (Number(a), Value::Vector(b)) | (Value::Vector(b), Number(a)) => return Ok(Value::Vector(b * a)),
        (Number(a), Rotation(b)) | (Rotation(b), Number(a)) => return Ok(Rotation(b * a)),
        (Rotation(a), Rotation(b)) => return Ok(Rotation(a.product(b))),
        (Inertia, Value::Vector(v)) => return Ok(Value::Vector(scope.inertia_times(v))),
        (Value::Vector(_), Value::Vector(_)) => "`dot(a, b)` or `cross(a, b)`",
        (Rotation(_), Value::Vector(_)) | (Value::Vector(_), Rotation(_)) => {
            "`rotate(q, v)` or `rotate_inverse(q, v)` (with the attitude: `to_world(v)`, `to_body(v)`)"
        }
        (Inertia, _) | (_, Inertia) => "`inertia * v` with a vector v, or elements as `inertia.xx`",
        _ => "numbers, a number and a vector or rotation, or two rotations",
    };
    let found = format!("{} and {}", a.described(), b.described());
    Err(Fault::Shape { of: "`*`".to_owned(), found, needed: needed.to_owned() })
}

fn quotient(a: Value, b: Value) -> Result<Value, Fault> {
    let Number(divisor) = b else { return Err(shape("the divisor of `/`", &b, "a number")) };
    Ok(match a {
        Number(x) => Number(x / divisor),
        Value::Vector(v) => Value::Vector(Vector::new(v.x / divisor, v.y / divisor, v.z / divisor)),
        Rotation(q) => Rotation(Quaternion::new(q.x / divisor, q.y / divisor, q.z / divisor, q.w / divisor)),
        _ => return Err(shape("`/`", &a, "a number, a vector or a rotation")),
    })
}

/// The greatest magnitude of a power's exponent n.
pub(super) const MOST_EXPONENT: i32 = 16;

/// aⁿ by products: squares from the left, as `x^3` is `x * x * x` and `x^4` is `(x^2)^2`.
pub(super) fn power(a: Value, exponent: i32) -> Result<Value, Fault> {
    let Number(x) = a else {
        let needed = if matches!(a, Value::Vector(_)) { "a number; |v|² is `dot(v, v)`" } else { "a number" };
        return Err(shape("`^`", &a, needed));
    };
    let magnitude = exponent.unsigned_abs();
    let mut result = Symbol::splat(1.0);
    for bit in (0..u32::BITS - magnitude.leading_zeros()).rev() {
        result = result * result;
        if magnitude >> bit & 1 == 1 {
            result = result * x;
        }
    }
    Ok(Number(if exponent < 0 { Symbol::splat(1.0) / result } else { result }))
}

/// An exponent that [`power`] takes.
fn whole(exponent: Symbol) -> Option<i32> {
    let number = exponent.constant()?;
    (number == number.trunc() && number.abs() <= f64::from(MOST_EXPONENT)).then_some(number as i32)
}

/// The arguments of a function, taken one by one.
struct Arguments<'a> {
    function: &'a str,
    values: &'a [Value],
}

impl Arguments<'_> {
    fn refuse(&self, index: usize, needed: &str) -> Fault {
        let of = match self.values.len() {
            1 => format!("`{}`", self.function),
            _ => format!("argument {} of `{}`", index + 1, self.function),
        };
        shape(&of, &self.values[index], needed)
    }

    fn number(&self, index: usize) -> Result<Symbol, Fault> {
        match self.values[index] {
            Number(x) => Ok(x),
            _ => Err(self.refuse(index, "a number")),
        }
    }

    fn vector(&self, index: usize) -> Result<Vector<Symbol>, Fault> {
        match self.values[index] {
            Value::Vector(v) => Ok(v),
            _ => Err(self.refuse(index, "a vector")),
        }
    }

    fn rotation(&self, index: usize) -> Result<Quaternion<Symbol>, Fault> {
        match self.values[index] {
            Rotation(q) => Ok(q),
            _ => Err(self.refuse(index, "a rotation")),
        }
    }
}

/// A call.
pub(super) fn called(function: &str, values: &[Value], scope: &Scope) -> Result<Value, Fault> {
    let Some((_, count)) = vocabulary::FUNCTIONS.into_iter().find(|(name, _)| *name == function) else {
        let known = vocabulary::FUNCTIONS.into_iter().map(|(name, _)| name);
        return Err(Fault::UnknownName { name: function.to_owned(), nearest: super::fault::nearest(function, known) });
    };
    if values.len() != count {
        return Err(Fault::ArgumentCount { function: function.to_owned(), found: values.len(), needed: count });
    }
    let of = Arguments { function, values };
    let (zero, one) = (|| Symbol::splat(0.0), || Symbol::splat(1.0));
    Ok(match function {
        "dot" => Number(of.vector(0)?.dot(of.vector(1)?)),
        "cross" => Value::Vector(of.vector(0)?.cross(of.vector(1)?)),
        "norm" => Number(match values[0] {
            Rotation(q) => q.norm_squared().sqrt(),
            _ => {
                let v = of.vector(0)?;
                v.dot(v).sqrt()
            }
        }),
        "normalize" => match values[0] {
            Rotation(q) => Rotation(q * (one() / q.norm_squared().sqrt())),
            _ => {
                let v = of.vector(0)?;
                Value::Vector(v * (one() / v.dot(v).sqrt()))
            }
        },
        "vec" => Value::Vector(Vector::new(of.number(0)?, of.number(1)?, of.number(2)?)),
        "quat" => Rotation(Quaternion::new(of.number(0)?, of.number(1)?, of.number(2)?, of.number(3)?)),
        "conjugate" => Rotation(of.rotation(0)?.conjugate()),
        "rotate" => Value::Vector(of.rotation(0)?.rotate(of.vector(1)?)),
        "rotate_inverse" => Value::Vector(of.rotation(0)?.rotate_inverse(of.vector(1)?)),
        "to_body" | "to_world" => {
            let v = of.vector(0)?;
            let Some(attitude) = scope.symbols().find("attitude") else {
                return Err(Fault::NotOffered { name: "attitude".to_owned() });
            };
            let q = scope.quaternion(&attitude.name);
            Value::Vector(if function == "to_body" { q.rotate_inverse(v) } else { q.rotate(v) })
        }
        "sin" => Number(sin_cos(of.number(0)?).0),
        "cos" => Number(sin_cos(of.number(0)?).1),
        "tan" => Number(of.number(0)?.function(Function::Tan)),
        "asin" => Number(of.number(0)?.function(Function::Asin)),
        "acos" => Number(of.number(0)?.function(Function::Acos)),
        "exp" => Number(of.number(0)?.function(Function::Exp)),
        "ln" => Number(of.number(0)?.function(Function::Ln)),
        "atan2" => Number(of.number(0)?.function_with(Function::Atan2, of.number(1)?)),
        "pow" => match whole(of.number(1)?) {
            Some(exponent) => power(Number(of.number(0)?), exponent)?,
            None => Number(of.number(0)?.function_with(Function::Pow, of.number(1)?)),
        },
        "kepler_sin" => Number(of.number(0)?.function_with(Function::KeplerSin, of.number(1)?)),
        "kepler_cos" => Number(of.number(0)?.function_with(Function::KeplerCos, of.number(1)?)),
        "sqrt" => Number(of.number(0)?.sqrt()),
        "abs" => Number(of.number(0)?.abs()),
        "min" => Number(of.number(0)?.min(of.number(1)?)),
        "max" => Number(of.number(0)?.max(of.number(1)?)),
        "clamp" => Number(of.number(0)?.max(of.number(1)?).min(of.number(2)?)),
        "step" => Number(Symbol::select(of.number(1)?.less_than(of.number(0)?), zero(), one())),
        "smoothstep" => {
            let (low, high, x) = (of.number(0)?, of.number(1)?, of.number(2)?);
            let t = ((x - low) / (high - low)).max(zero()).min(one());
            Number(t * t * (Symbol::splat(3.0) - Symbol::splat(2.0) * t))
        }
        _ => selected(&of)?,
    })
}

/// `select(condition, a, b)`.
fn selected(of: &Arguments) -> Result<Value, Fault> {
    let Value::Truth(condition) = of.values[0] else { return Err(of.refuse(0, "a truth value, as `a < b`")) };
    Ok(match (of.values[1], of.values[2]) {
        (Number(a), Number(b)) => Number(Symbol::select(condition, a, b)),
        (Value::Vector(a), Value::Vector(b)) => Value::Vector(Vector::select(condition, a, b)),
        (Rotation(a), Rotation(b)) => Rotation(Quaternion::select(condition, a, b)),
        (Number(_) | Value::Vector(_) | Rotation(_), _) => {
            return Err(of.refuse(2, &format!("{}, as argument 2", of.values[1].described())));
        }
        _ => return Err(of.refuse(1, "a number, a vector or a rotation")),
    })
}
