//! Sums of products of rows, with factors that are constant for each body.

use super::super::symbol::Symbol;
use super::RowNumber;
use crate::real::Real;

/// The most rows of a product.
const MOST_FACTORS: usize = 3;

/// What stands where a product has no more factors.
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

    /// The product of two, where it does not have too many factors.
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

/// Σ c · monomial; the factors c depend on parameters alone.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Polynomial {
    /// In the order of the monomials, each once.
    pub terms: Vec<(Monomial, Symbol)>,
}

impl Polynomial {
    pub fn constant(factor: Symbol) -> Self {
        Self { terms: vec![(Monomial::ONE, factor)] }
    }

    pub fn row(row: RowNumber) -> Self {
        Self { terms: vec![(Monomial::of(row), Symbol::splat(1.0))] }
    }

    /// The factor that it is where it contains no row.
    pub fn as_constant(&self) -> Option<Symbol> {
        match self.terms[..] {
            [] => Some(Symbol::splat(0.0)),
            [(Monomial::ONE, factor)] => Some(factor),
            _ => None,
        }
    }

    pub fn scaled(mut self, factor: Symbol) -> Self {
        for (_, own) in &mut self.terms {
            *own = *own * factor;
        }
        self.without_zeros()
    }

    pub fn sum(mut self, other: Self) -> Self {
        for (monomial, factor) in other.terms {
            self.add(monomial, factor);
        }
        self.without_zeros()
    }

    pub fn add(&mut self, monomial: Monomial, factor: Symbol) {
        match self.terms.binary_search_by(|(own, _)| own.cmp(&monomial)) {
            Ok(place) => self.terms[place].1 = self.terms[place].1 + factor,
            Err(place) => self.terms.insert(place, (monomial, factor)),
        }
    }

    /// Every pair of terms multiplied; none where a product of rows is not `allowed` or there would be too many.
    pub fn product(&self, other: &Self, allowed: impl Fn(&Monomial) -> bool) -> Option<Self> {
        const MOST_PAIRS: usize = 100;
        if self.terms.len() * other.terms.len() > MOST_PAIRS {
            return None;
        }
        let mut product = Self::default();
        for (a, a_factor) in &self.terms {
            for (b, b_factor) in &other.terms {
                let monomial = a.product(b).filter(&allowed)?;
                product.add(monomial, *a_factor * *b_factor);
            }
        }
        Some(product.without_zeros())
    }

    fn without_zeros(mut self) -> Self {
        self.terms.retain(|(_, factor)| factor.constant() != Some(0.0));
        self
    }
}
