//! Random formulas: as trees, which are evaluated naively, recorded, and written as text.
#![allow(dead_code, reason = "each test file uses its part")]

use polhode::expression::{Expression, Fault, Scope, Shape, Symbol, Symbols};
use polhode::math::real::{Real, sin_cos};

use super::random::Random;

/// Inputs of every formula, p0 to p5.
pub const INPUTS: usize = 6;

/// A formula.
#[derive(Clone, Debug)]
pub enum Tree {
    Input(usize),
    Constant(f64),
    One(&'static str, Box<Tree>),
    Two(&'static str, Box<Tree>, Box<Tree>),
    MulAdd(Box<[Tree; 3]>),
    /// The third where the first is less than the second, the fourth elsewhere.
    Select(Box<[Tree; 4]>),
}

impl Tree {
    /// A formula of about `size` operations.
    pub fn random(random: &mut Random, size: usize) -> Tree {
        if size == 0 {
            // Powers of two and zero, which are simplified; short numbers, exact in f32; and others.
            const SPECIAL: [f64; 8] = [0.0, 1.0, -1.0, 2.0, 0.5, -4.0, 3.0, 1.5];
            return match random.bits() % 8 {
                0 => Tree::Constant(SPECIAL[(random.bits() % 8) as usize]),
                1 => Tree::Constant(random.between(-2.0, 2.0)),
                _ => Tree::Input((random.bits() % INPUTS as u64) as usize),
            };
        }
        let mut part = |share: usize| Box::new(Tree::random(random, (size - 1) / share));
        match size % 3 {
            0 => {
                let (a, b, c, d) = (*part(4), *part(4), *part(4), *part(4));
                match random.bits() % 4 {
                    0 => Tree::Select(Box::new([a, b, c, d])),
                    _ => Tree::MulAdd(Box::new([a, b, c])),
                }
            }
            1 if size > 1 => {
                let a = part(1);
                let names = ["-", "sqrt", "abs", "sin", "cos", "round"];
                Tree::One(names[(random.bits() % 6) as usize], a)
            }
            _ => {
                let (a, b) = (part(2), part(2));
                let names = ["+", "-", "*", "*", "/", "min", "max", "+"];
                Tree::Two(names[(random.bits() % 8) as usize], a, b)
            }
        }
    }

    /// The formula over any number type.
    pub fn call<R: Real>(&self, x: &[R]) -> R {
        match self {
            Tree::Input(index) => x[*index],
            Tree::Constant(c) => R::splat(*c),
            Tree::One(name, a) => {
                let a = a.call(x);
                match *name {
                    "-" => -a,
                    "sqrt" => a.sqrt(),
                    "abs" => a.abs(),
                    "sin" => sin_cos(a).0,
                    "cos" => sin_cos(a).1,
                    _ => a.round(),
                }
            }
            Tree::Two(name, a, b) => {
                let (a, b) = (a.call(x), b.call(x));
                match *name {
                    "+" => a + b,
                    "-" => a - b,
                    "*" => a * b,
                    "/" => a / b,
                    "min" => a.min(b),
                    _ => a.max(b),
                }
            }
            Tree::MulAdd(parts) => parts[0].call(x).mul_add(parts[1].call(x), parts[2].call(x)),
            Tree::Select(parts) => {
                let [a, b, c, d] = parts.each_ref().map(|part| part.call(x));
                R::select(a.less_than(b), c, d)
            }
        }
    }

    /// The value, and how far rounding with unit roundoff `u` may take an evaluation from it, in units of `u`: a running
    /// error bound (N. J. Higham, *Accuracy and Stability of Numerical Algorithms*, section 3.3). None where a number leaves
    /// the range of `f32` or a decision hangs on rounding.
    pub fn bounded(&self, x: &[f64], u: f64) -> Option<(f64, f64)> {
        let ordered =
            |(a, ea): (f64, f64), (b, eb): (f64, f64)| (ea + eb == 0.0) || (a - b).abs() > 2.0 * (ea + eb) * u;
        let (value, error) = match self {
            Tree::Input(index) => (x[*index], 0.0),
            Tree::Constant(c) => (*c, if f64::from(*c as f32) == *c { 0.0 } else { c.abs() }),
            Tree::One(name, a) => {
                let (a, e) = a.bounded(x, u)?;
                match *name {
                    "-" => (-a, e),
                    "abs" => (a.abs(), e),
                    "sqrt" if e == 0.0 => (a.sqrt(), a.sqrt()),
                    "sqrt" => (a > 4.0 * e * u).then(|| (a.sqrt(), e / a.sqrt() + a.sqrt()))?,
                    // Stated: an error of one unit in the last place of 1.
                    "sin" => (a.abs() < 512.0).then(|| (sin_cos(a).0, e + 2.0))?,
                    "cos" => (a.abs() < 512.0).then(|| (sin_cos(a).1, e + 2.0))?,
                    _ => {
                        let is_clear = (a - a.floor() - 0.5).abs() > 2.0 * e * u && a.abs() < 1e6;
                        is_clear.then(|| (a.round_ties_even(), 0.0))?
                    }
                }
            }
            Tree::Two(name, a, b) => {
                let (first, second) = (a.bounded(x, u)?, b.bounded(x, u)?);
                let ((a, ea), (b, eb)) = (first, second);
                match *name {
                    "+" => (a + b, ea + eb + (a + b).abs()),
                    "-" => (a - b, ea + eb + (a - b).abs()),
                    "*" => (a * b, a.abs() * eb + b.abs() * ea + ea * eb * u + (a * b).abs()),
                    "/" => (b.abs() > 4.0 * eb * u && b != 0.0)
                        .then(|| (a / b, 2.0 * (ea + (a / b).abs() * eb) / b.abs() + (a / b).abs()))?,
                    "min" => (a.min(b), ea.max(eb)),
                    _ => (a.max(b), ea.max(eb)),
                }
            }
            Tree::MulAdd(parts) => {
                let [(a, ea), (b, eb), (c, ec)] =
                    [0, 1, 2].map(|part| parts[part].bounded(x, u)).into_iter().collect::<Option<Vec<_>>>()?[..]
                else {
                    return None;
                };
                let (product, sum) = ((a * b).abs(), (a * b + c).abs());
                (a * b + c, a.abs() * eb + b.abs() * ea + ea * eb * u + ec + product + sum)
            }
            Tree::Select(parts) => {
                let (a, b) = (parts[0].bounded(x, u)?, parts[1].bounded(x, u)?);
                let (c, d) = (parts[2].bounded(x, u)?, parts[3].bounded(x, u)?);
                if !ordered(a, b) {
                    return None;
                }
                if a.0 < b.0 { c } else { d }
            }
        };
        let is_normal = |x: f64| x == 0.0 || (1e-30..1e30).contains(&x.abs());
        // Beyond a relative error of 1/8 second-order terms are no longer small.
        (is_normal(value) && error.is_finite() && error < 1e30).then_some((value, 1.2 * error))
    }

    /// The text, with parentheses everywhere.
    pub fn text(&self) -> String {
        match self {
            Tree::Input(index) => format!("p{index}"),
            Tree::Constant(c) => format!("({c:?})"),
            Tree::One("-", a) => format!("(-{})", a.text()),
            Tree::One(name, a) => format!("{name}({})", a.text()),
            Tree::Two(name @ ("min" | "max"), a, b) => format!("{name}({}, {})", a.text(), b.text()),
            Tree::Two(name, a, b) => format!("({} {name} {})", a.text(), b.text()),
            Tree::MulAdd(parts) => format!("({} * {} + {})", parts[0].text(), parts[1].text(), parts[2].text()),
            Tree::Select(parts) => {
                let [a, b, c, d] = parts.each_ref().map(Tree::text);
                format!("select({a} < {b}, {c}, {d})")
            }
        }
    }

    /// The same formula without what the language has no word for: fused sums and rounding.
    pub fn spoken(&self) -> Tree {
        match self {
            Tree::Input(_) | Tree::Constant(_) => self.clone(),
            Tree::One("round", a) => Tree::One("abs", Box::new(a.spoken())),
            Tree::One(name, a) => Tree::One(name, Box::new(a.spoken())),
            Tree::Two(name, a, b) => Tree::Two(name, Box::new(a.spoken()), Box::new(b.spoken())),
            Tree::MulAdd(parts) => {
                let [a, b, c] = parts.each_ref().map(Tree::spoken);
                Tree::Two("+", Box::new(Tree::Two("*", Box::new(a), Box::new(b))), Box::new(c))
            }
            Tree::Select(parts) => Tree::Select(Box::new(parts.each_ref().map(Tree::spoken))),
        }
    }

    /// The recorded formula.
    pub fn recorded(&self) -> Result<Expression, Fault> {
        Expression::record(&symbols(), |scope: &Scope| -> Symbol {
            let inputs: Vec<Symbol> = (0..INPUTS).map(|index| scope.number(&format!("p{index}"))).collect();
            self.call(&inputs)
        })
    }
}

/// The parameters p0 to p5.
pub fn symbols() -> Symbols {
    (0..INPUTS).fold(Symbols::parameters_only(), |symbols, index| {
        symbols.parameter(&format!("p{index}"), Shape::Number).expect("a free name")
    })
}

/// Numbers that are exact in `f32`.
pub fn inputs(random: &mut Random) -> [f64; INPUTS] {
    [(); INPUTS].map(|()| f64::from(random.between(-2.0, 2.0) as f32))
}
