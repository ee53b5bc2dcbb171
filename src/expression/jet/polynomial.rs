//! Sums of products of rows, with factors that are constant for each body.

use super::super::symbol::Symbol;
use super::RowNumber;
use crate::math::real::Real;

/// The most rows of a product.
const MOST_FACTORS: usize = 3;

/// The placeholder for absent factors.
const NONE: RowNumber = RowNumber::MAX;

/// A product of rows, in the order of their numbers; without any it is 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct Monomial([RowNumber; MOST_FACTORS]);

impl Monomial {
    pub const ONE: Self = Self([NONE; MOST_FACTORS]);

    pub fn of(row: RowNumber) -> Self {
        Self([row, NONE, NONE])
    }

    /// Its rows.
    pub fn rows(&self) -> impl Iterator<Item = RowNumber> + Clone + '_ {
        self.0.iter().copied().filter(|row| *row != NONE)
    }

    pub fn degree(&self) -> usize {
        self.rows().count()
    }

    /// The product of two, if it does not have too many factors.
    pub fn product(&self, other: &Self) -> Option<Self> {
        let mut rows = [NONE; 2 * MOST_FACTORS];
        rows[..MOST_FACTORS].copy_from_slice(&self.0);
        rows[MOST_FACTORS..].copy_from_slice(&other.0);
        rows.sort_unstable();
        let [first, second, third, NONE, NONE, NONE] = rows else { return None };
        Some(Self([first, second, third]))
    }

    /// The product without one of its factors.
    pub fn without(&self, row: RowNumber) -> Self {
        let mut rows = self.0;
        if let Some(place) = rows.iter().position(|factor| *factor == row) {
            rows[place] = NONE;
            rows.sort_unstable();
        }
        Self(rows)
    }
}

/// The factor of a monomial: a number times a function of parameters. They are kept separate, so that sums of multiples of one thing remain
/// multiples of it, and vanish if they cancel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Factor {
    scale: f64,
    symbol: Option<Symbol>,
}

impl Factor {
    pub const ONE: Self = Self { scale: 1.0, symbol: None };

    pub fn number(scale: f64) -> Self {
        Self { scale, symbol: None }
    }

    pub fn of(symbol: Symbol) -> Self {
        match symbol.constant() {
            Some(scale) => Self::number(scale),
            None => Self { scale: 1.0, symbol: Some(symbol) },
        }
    }

    pub fn symbol(self) -> Symbol {
        match self.symbol {
            Some(symbol) if self.scale == 1.0 => symbol,
            Some(symbol) if self.scale == -1.0 => -symbol,
            Some(symbol) => symbol * Symbol::splat(self.scale),
            None => Symbol::splat(self.scale),
        }
    }

    pub fn is_zero(self) -> bool {
        self.scale == 0.0
    }

    pub fn times(self, other: Self) -> Self {
        let symbol = match (self.symbol, other.symbol) {
            (Some(a), Some(b)) => Some(a * b),
            (a, b) => a.or(b),
        };
        Self { scale: self.scale * other.scale, symbol }
    }

    pub fn over(self, other: Self) -> Self {
        match other.symbol {
            // A power of two, or a rounding of one unit.
            None => Self { scale: self.scale / other.scale, ..self },
            Some(divisor) => {
                let quotient = self.symbol.unwrap_or(Symbol::splat(1.0)) / divisor;
                Self { scale: self.scale / other.scale, symbol: Some(quotient) }
            }
        }
    }

    pub fn plus(self, other: Self) -> Self {
        if self.symbol == other.symbol {
            Self { scale: self.scale + other.scale, ..self }
        } else if other.is_zero() {
            self
        } else if self.is_zero() {
            other
        } else {
            Self::of(self.symbol() + other.symbol())
        }
    }
}

/// Σ c · monomial; the factors c depend only on parameters.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Polynomial {
    /// In the order of the monomials, each once.
    pub terms: Vec<(Monomial, Factor)>,
}

impl Polynomial {
    pub fn constant(factor: Factor) -> Self {
        Self { terms: vec![(Monomial::ONE, factor)] }
    }

    pub fn number(number: f64) -> Self {
        Self::constant(Factor::number(number))
    }

    pub fn row(row: RowNumber) -> Self {
        Self { terms: vec![(Monomial::of(row), Factor::ONE)] }
    }

    /// The factor that it consists of, if it contains no row.
    pub fn as_constant(&self) -> Option<Factor> {
        match self.terms[..] {
            [] => Some(Factor::number(0.0)),
            [(Monomial::ONE, factor)] => Some(factor),
            _ => None,
        }
    }

    pub fn scaled(mut self, factor: Factor) -> Self {
        for (_, own) in &mut self.terms {
            *own = own.times(factor);
        }
        self.without_zeros()
    }

    pub fn negative(self) -> Self {
        self.scaled(Factor::number(-1.0))
    }

    pub fn sum(mut self, other: Self) -> Self {
        for (monomial, factor) in other.terms {
            self.add(monomial, factor);
        }
        self.without_zeros()
    }

    pub fn add(&mut self, monomial: Monomial, factor: Factor) {
        match self.terms.binary_search_by(|(own, _)| own.cmp(&monomial)) {
            Ok(place) => self.terms[place].1 = self.terms[place].1.plus(factor),
            Err(place) => self.terms.insert(place, (monomial, factor)),
        }
    }

    /// Removes a term.
    pub fn take(&mut self, monomial: &Monomial) -> Option<Factor> {
        let place = self.terms.iter().position(|(own, _)| own == monomial)?;
        Some(self.terms.remove(place).1)
    }

    /// The product, term by term; `None` if a product of rows is not `allowed` or there would be too many.
    pub fn product(&self, other: &Self, allowed: impl Fn(&Monomial) -> bool) -> Option<Self> {
        const MOST_PAIRS: usize = 100;
        if self.terms.len() * other.terms.len() > MOST_PAIRS {
            return None;
        }
        let mut product = Self::default();
        for (a, a_factor) in &self.terms {
            for (b, b_factor) in &other.terms {
                let monomial = a.product(b).filter(&allowed)?;
                product.add(monomial, a_factor.times(*b_factor));
            }
        }
        Some(product.without_zeros())
    }

    pub fn without_zeros(mut self) -> Self {
        self.terms.retain(|(_, factor)| !factor.is_zero());
        self
    }
}
