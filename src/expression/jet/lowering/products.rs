//! Products and sums: how far they are expanded, and the rows that result.

use super::super::polynomial::{Factor, Monomial, Polynomial};
use super::super::{Kind, RowNumber};
use super::directions::entries_of;
use super::{Class, Draft, Lowering};

impl Lowering<'_> {
    pub(super) fn product(&mut self, a: &Polynomial, b: &Polynomial) -> Polynomial {
        if let Some(factor) = a.as_constant() {
            return b.clone().scaled(factor);
        }
        if let Some(factor) = b.as_constant() {
            return a.clone().scaled(factor);
        }
        if let Some(product) = a.product(b, |monomial| self.is_expanded(monomial)) {
            return self.rotated(product);
        }
        let ((a, a_factor), (b, b_factor)) = (self.factored(a), self.factored(b));
        Polynomial::row(self.product_row(a, b)).scaled(a_factor.times(b_factor))
    }

    /// Whether a product is kept as it is until the other terms of its sum are known: a quadratic form of the orientation, times a
    /// function of time.
    pub(super) fn is_expanded(&self, monomial: &Monomial) -> bool {
        let count = |class| monomial.rows().filter(|&row| self.class(row) == class).count();
        let (attitude, rotation, time) = (count(Class::Attitude), count(Class::Rotation), count(Class::Time));
        let is_form = attitude + rotation + time == monomial.degree() && (1..=2).contains(&(attitude + 2 * rotation));
        monomial.degree() <= 1 || (is_form && time <= 1)
    }

    /// Replaces products of two components of the orientation by entries of the rotation matrix R ([`entries_of`]). For the rotation of a
    /// vector this leaves a third of the terms.
    pub(super) fn rotated(&mut self, polynomial: Polynomial) -> Polynomial {
        let is_attitude = |row: &RowNumber| self.class(*row) == Class::Attitude;
        let pair_of = |monomial: &Monomial| {
            let mut parts = monomial.rows().filter(is_attitude);
            Some((parts.next()?, parts.next()?))
        };
        if !polynomial.terms.iter().any(|(monomial, _)| pair_of(monomial).is_some()) {
            return polynomial;
        }
        let pairs: Vec<_> = polynomial.terms.iter().map(|(monomial, _)| pair_of(monomial)).collect();
        let parts = self.orientation();
        let entries = self.rotation();
        let mut rotated = Polynomial::default();
        for ((monomial, factor), pair) in polynomial.terms.into_iter().zip(pairs) {
            let Some((a, b)) = pair else {
                rotated.add(monomial, factor);
                continue;
            };
            let rest = monomial.without(a).without(b);
            let number = |row| parts.iter().position(|part| *part == row).unwrap_or(0);
            entries_of(number(a).min(number(b)), number(a).max(number(b)), &mut |entry, part| {
                let product = match entry {
                    Some(entry) => rest.product(&Monomial::of(entries[entry])),
                    None => Some(rest),
                };
                if let Some(product) = product {
                    rotated.add(product, factor.times(Factor::number(part)));
                }
            });
        }
        rotated.without_zeros()
    }

    /// The entries of the matrix of the rotation from principal axes to the world, row by row.
    pub(super) fn rotation(&mut self) -> [RowNumber; 9] {
        if let Some(rows) = self.rotation {
            return rows;
        }
        let rows = [(); 9].map(|()| self.new_row(Class::Rotation, false, false));
        let read = self.orientation();
        self.drafts.push(Draft::new(Kind::Rotation, 9, [&rows[..], &read].concat()));
        self.rotation = Some(rows);
        rows
    }

    /// A row, and its factor.
    pub(super) fn factored(&mut self, polynomial: &Polynomial) -> (RowNumber, Factor) {
        if let [(monomial, factor)] = polynomial.terms[..]
            && monomial.degree() > 0
        {
            let single = Polynomial { terms: vec![(monomial, Factor::ONE)] };
            return (self.materialised(&single), factor);
        }
        (self.materialised(polynomial), Factor::ONE)
    }

    pub(super) fn product_row(&mut self, a: RowNumber, b: RowNumber) -> RowNumber {
        let (a, b) = (a.min(b), a.max(b));
        if let Some(&row) = self.products.get(&(a, b)) {
            return row;
        }
        self.keep(a);
        self.keep(b);
        let (kind, read) = if a == b { (Kind::Square, vec![a]) } else { (Kind::Product, vec![a, b]) };
        let row = self.operation(kind, &[(false, false)], &read)[0];
        self.products.insert((a, b), row);
        row
    }

    /// The row of a polynomial. Terms with the same function of time as a factor are added up first.
    pub(super) fn materialised(&mut self, polynomial: &Polynomial) -> RowNumber {
        if let [(monomial, factor)] = polynomial.terms[..]
            && monomial.degree() == 1
            && factor == Factor::ONE
            && let Some(row) = monomial.rows().next()
        {
            return row;
        }
        if let Some((_, row)) = self.sums.iter().find(|(known, _)| known == polynomial) {
            return *row;
        }
        let mut by_time: Vec<(RowNumber, Polynomial)> = Vec::new();
        let mut linear: Vec<(RowNumber, Factor)> = Vec::new();
        let mut constant = None;
        let time_of =
            |lowering: &Self, monomial: &Monomial| monomial.rows().find(|&row| lowering.class(row) == Class::Time);
        for (monomial, factor) in &polynomial.terms {
            match (monomial.degree(), time_of(self, monomial)) {
                (0, _) => constant = Some(*factor),
                (2.., Some(time)) => {
                    let rest = monomial.without(time);
                    match by_time.iter_mut().find(|(row, _)| *row == time) {
                        Some((_, sum)) => sum.add(rest, *factor),
                        None => by_time.push((time, Polynomial { terms: vec![(rest, *factor)] })),
                    }
                }
                (1, _) => linear.extend(monomial.rows().map(|row| (row, *factor))),
                _ => {
                    let mut rows = monomial.rows();
                    if let (Some(a), Some(b)) = (rows.next(), rows.next()) {
                        linear.push((self.product_row(a, b), *factor));
                    }
                }
            }
        }
        for (time, mut sum) in by_time {
            // The terms multiplied by this function.
            if let Some(place) = linear.iter().position(|(row, _)| *row == time) {
                sum.add(Monomial::ONE, linear.swap_remove(place).1);
            }
            let (row, factor) = self.factored(&sum);
            linear.push((self.product_row(time, row), factor));
        }
        let row = match (&linear[..], constant) {
            (&[(row, Factor::ONE)], None) => row,
            _ => {
                let rows: Vec<RowNumber> = linear.iter().map(|(row, _)| *row).collect();
                let is_short = rows.iter().all(|row| self.rows[*row as usize].is_short);
                let kind = if is_short { Kind::ShortLinear } else { Kind::Linear };
                let to = self.operation(kind, &[(is_short, is_short)], &rows)[0];
                if let Some(draft) = self.drafts.last_mut() {
                    draft.factors = linear.iter().map(|(_, factor)| factor.symbol()).collect();
                    draft.constant = constant.map(Factor::symbol);
                }
                to
            }
        };
        self.sums.push((polynomial.clone(), row));
        row
    }
}
