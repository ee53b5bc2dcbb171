//! Lowers functions through the differential equations that they satisfy.

use super::super::polynomial::{Factor, Polynomial};
use super::super::{FADED, Fading, Kind, RowNumber};
use super::Lowering;
use crate::expression::fault::Fault;
use crate::expression::symbol::Symbol;
use crate::math::real::{Function, Real, Scalar};

/// Powers with smaller exponents are watched as those with this one.
const LEAST_EXPONENT: f64 = 0.1;

impl Lowering<'_> {
    /// Notes a power that may fade; of what it is a function, and where that is as if the power had faded, and as if its reciprocal had.
    fn watch(&mut self, power: RowNumber, of: RowNumber, levels: [Factor; 2]) {
        let levels = levels.map(|level| {
            let distance = Polynomial::row(of).sum(Polynomial::constant(level).negative());
            let row = self.materialised(&distance);
            self.keep(row)
        });
        self.fading.push(Fading { power, levels });
    }

    pub(super) fn quotient(&mut self, a: &Polynomial, b: &Polynomial) -> Polynomial {
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

    pub(super) fn square_root(&mut self, a: &Polynomial) -> RowNumber {
        let a = self.materialised(a);
        self.keep(a);
        let row = self.operation(Kind::Sqrt, &[(false, true), (true, false)], &[a])[0];
        self.roots.push([row, a]);
        row
    }

    pub(super) fn sine_and_cosine(&mut self, a: &Polynomial) -> [RowNumber; 2] {
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
    pub(super) fn primitive(&mut self, function: Function, a: &Polynomial, r: &Polynomial) -> RowNumber {
        let (a, r) = (self.materialised(a), self.materialised(r));
        self.keep(r);
        self.operation(Kind::Primitive(function), &[(false, false), (false, true), (true, false)], &[a, r])[0]
    }

    pub(super) fn function(&mut self, function: Function, a: &Polynomial) -> Polynomial {
        let one = Polynomial::number(1.0);
        match function {
            Function::Sin => Polynomial::row(self.sine_and_cosine(a)[0]),
            Function::Cos => Polynomial::row(self.sine_and_cosine(a)[1]),
            Function::Exp => {
                let a = self.materialised(a);
                let power = self.operation(Kind::Exp, &[(false, true); 2], &[a])[0];
                self.watch(power, a, [-FADED, FADED].map(Factor::number));
                Polynomial::row(power)
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
            // Σ (−x)ⁿ/(2n + 1), with as many terms as in its evaluation.
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

    pub(super) fn function_of_two(
        &mut self,
        function: Function,
        a: &Polynomial,
        b: &Polynomial,
    ) -> Result<Polynomial, Fault> {
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
                    // The bases with which it is negligible, and large; those of small exponents are finite too.
                    let magnitude = exponent.symbol().abs().max(Symbol::splat(LEAST_EXPONENT));
                    let base =
                        |sign: f64| Factor::of((Symbol::splat(sign * FADED) / magnitude).function(Function::Exp));
                    self.watch(rows[0], a, [base(-1.0), base(1.0)]);
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
}
