//! Fuses several operations into one that reads shared rows once.

use super::super::polynomial::{Factor, Monomial};
use super::super::{Kind, RowNumber};
use super::assembly::heights;
use super::{Class, Draft, Equations, Lowering};
use crate::expression::graph::{Input, InputKind};
use crate::expression::symbol::Symbol;

impl Lowering<'_> {
    /// If ω is m times constant factors, Euler's equations, the terms linear in a component's own m and the constant terms become one
    /// operation.
    /// Returns how many of the first states it covers: the components of m, or none.
    pub(super) fn follow_euler(&mut self, equations: &Equations, angular_velocity: &[RowNumber]) -> usize {
        let momentum = [0, 1, 2].map(|part| Input::new(InputKind::AngularMomentum, part));
        let are_momenta = equations.rates.iter().take(3).map(|(state, _)| *state).eq(momentum);
        let (Some(nodes), true) = (equations.angular_velocity, are_momenta) else { return 0 };
        let m = momentum.map(|state| self.given_row(state));
        let mut factors = [[Factor::number(0.0); 3]; 4];
        for (axis, node) in nodes.into_iter().enumerate() {
            match self.number(node).terms[..] {
                [(monomial, factor)] if monomial == Monomial::of(m[axis]) => factors[1][axis] = factor,
                _ => return 0,
            }
        }
        let mut rests = Vec::new();
        for (axis, (_, rate)) in equations.rates.iter().take(3).enumerate() {
            let mut rate = self.number(*rate);
            let (b, c) = (m[(axis + 1) % 3], m[(axis + 2) % 3]);
            let pair = self.products.get(&(b.min(c), b.max(c))).copied();
            let own = [pair.map(Monomial::of), None, Some(Monomial::of(m[axis])), Some(Monomial::ONE)];
            for (factors, monomial) in factors.iter_mut().zip(own) {
                if let Some(factor) = monomial.and_then(|monomial| rate.take(&monomial)) {
                    factors[axis] = factor;
                }
            }
            rests.push(rate);
        }
        let mut rows = [&m[..], &angular_velocity[..3]].concat();
        let mut factors = factors.concat();
        if rests.iter().any(|rest| !rest.terms.is_empty()) {
            factors.extend([Factor::number(1.0); 3]);
            rows.extend(rests.iter().map(|rest| self.materialised(rest)).collect::<Vec<_>>());
        }
        for draft in &mut self.drafts {
            // Later coefficients follow from those of m when these are computed.
            if draft.writes == 1 && angular_velocity[..3].contains(&draft.rows[0]) {
                draft.kind = Kind::Start;
            }
        }
        let mut draft = Draft::new(Kind::Euler, 0, rows);
        draft.factors = factors.into_iter().map(Factor::symbol).collect();
        self.drafts.push(draft);
        momentum.len()
    }

    /// Moves sums that only Euler's equations read into that operation, if they have equally many terms for each axis.
    pub(super) fn sum_in_euler(&mut self) {
        let Some(euler) = self.drafts.iter().find(|draft| draft.kind == Kind::Euler) else { return };
        let added = euler.rows[6..].to_vec();
        let reads = |row: RowNumber| {
            let read = self.drafts.iter().flat_map(|draft| &draft.rows[draft.writes..]);
            read.filter(|read| **read == row).count()
        };
        let own_sum = |row: &RowNumber| {
            let own = self.drafts.iter().find(|draft| draft.kind == Kind::Linear && draft.rows[0] == *row)?;
            let is_own = reads(*row) == 1 && !self.rows[*row as usize].is_kept && own.constant.is_none();
            is_own.then(|| (own.rows[1..].to_vec(), own.factors.clone()))
        };
        let sums: Vec<_> = added.iter().filter_map(own_sum).collect();
        let are_all = sums.len() == 3 && sums.iter().all(|(rows, _)| rows.len() == sums[0].0.len());
        if !are_all {
            return;
        }
        self.drafts.retain(|draft| draft.writes != 1 || !added.contains(&draft.rows[0]));
        for draft in self.drafts.iter_mut().filter(|draft| draft.kind == Kind::Euler) {
            draft.rows.truncate(6);
            draft.factors.truncate(12);
            for (rows, factors) in &sums {
                draft.rows.extend(rows);
                draft.factors.extend(factors);
            }
        }
    }

    /// The rows that some rows and the rates of all states need.
    fn needed<'r>(&self, wanted: impl Iterator<Item = &'r RowNumber>) -> Vec<bool> {
        let mut needed = vec![false; self.rows.len()];
        wanted.for_each(|row| needed[*row as usize] = true);
        for draft in self.drafts.iter().rev() {
            let (written, read) = draft.rows.split_at(draft.writes);
            if written.is_empty() || written.iter().any(|row| needed[*row as usize]) {
                read.iter().for_each(|row| needed[*row as usize] = true);
            }
        }
        needed
    }

    /// Removes what no result needs.
    pub(super) fn drop_unused(&mut self, outputs: &[RowNumber]) {
        let mut needed = self.needed(outputs.iter().chain(&self.switches));
        self.fading.retain(|fading| needed[fading.power as usize]);
        if !self.fading.is_empty() {
            let levels = self.fading.iter().flat_map(|fading| &fading.levels);
            needed = self.needed(outputs.iter().chain(&self.switches).chain(levels));
        }
        let is_needed = |rows: &[RowNumber]| rows.is_empty() || rows.iter().any(|row| needed[*row as usize]);
        self.drafts.retain(|draft| is_needed(&draft.rows[..draft.writes]));
        self.roots.retain(|[row, _]| is_needed(&[*row]));
        let drafts = &self.drafts;
        self.products.retain(|_, row| drafts.iter().any(|draft| draft.rows[..draft.writes].contains(row)));
    }

    /// Fuses the three products of three rows into one operation, which reads each of them once.
    pub(super) fn share_triples(&mut self) {
        let heights = heights(&self.drafts, self.rows.len());
        let mut pairs: Vec<(RowNumber, RowNumber)> = self.products.keys().copied().filter(|(a, b)| a != b).collect();
        pairs.sort_unstable();
        for &(a, b) in &pairs {
            for &(_, c) in pairs.iter().filter(|(first, _)| *first == b) {
                let products = [(b, c), (a, c), (a, b)].map(|pair| self.products.get(&pair).copied());
                let [Some(bc), Some(ca), Some(ab)] = products else { continue };
                let is_attitude = [a, b, c].iter().any(|&row| self.class(row) == Class::Attitude);
                // At equal height, none of them is below another.
                let are_level = [ca, ab].iter().all(|row| heights[*row as usize] == heights[bc as usize]);
                if is_attitude || !are_level || !self.are_products(&[bc, ca, ab]) {
                    continue;
                }
                self.replace(&[bc, ca, ab], Draft::new(Kind::Triple, 3, vec![bc, ca, ab, a, b, c]));
            }
        }
    }

    /// Whether each of these rows is formed by a product of its own.
    pub(super) fn are_products(&self, rows: &[RowNumber]) -> bool {
        rows.iter().all(|row| {
            let own = |draft: &&Draft| draft.rows.first() == Some(row);
            self.drafts.iter().find(own).is_some_and(|draft| matches!(draft.kind, Kind::Product | Kind::Square))
        })
    }

    /// Fuses products that only one sum reads, all with one factor, into one operation that adds them up.
    pub(super) fn add_products(&mut self) {
        let mut reads = vec![0_usize; self.rows.len()];
        for draft in &self.drafts {
            draft.rows[draft.writes..].iter().for_each(|row| reads[*row as usize] += 1);
        }
        let mut at = 0;
        while at < self.drafts.len() {
            let group = if self.drafts[at].kind == Kind::Linear { self.group_of(at, &reads) } else { None };
            let Some((places, factor)) = group else {
                at += 1;
                continue;
            };
            let rows: Vec<RowNumber> = places.iter().map(|place| self.drafts[at].rows[1 + place]).collect();
            let mut operands = Vec::new();
            for row in &rows {
                let own = |draft: &&Draft| draft.writes == 1 && draft.rows[0] == *row;
                if let Some(draft) = self.drafts.iter().find(own) {
                    operands.extend([draft.rows[1], draft.rows[draft.rows.len() - 1]]);
                }
            }
            let sum = self.new_row(Class::Other, false, false);
            reads.push(1);
            let linear = &mut self.drafts[at];
            for place in places.into_iter().rev() {
                linear.rows.remove(1 + place);
                linear.factors.remove(place);
            }
            if linear.factors.is_empty() && linear.constant.is_none() && factor.constant() == Some(1.0) {
                let to = linear.rows[0];
                *linear = Draft::new(Kind::Products, 1, [&[to][..], &operands].concat());
            } else {
                linear.rows.push(sum);
                linear.factors.push(factor);
                self.drafts.push(Draft::new(Kind::Products, 1, [&[sum][..], &operands].concat()));
            }
            self.drafts.retain(|own| !(own.writes == 1 && rows.contains(&own.rows[0])));
            // Indices have changed.
            at = 0;
        }
    }

    /// Fuses three sums of products with the same functions into one operation, which reads these once: a vector times a function, a
    /// direction that turns.
    pub(super) fn share_factors(&mut self) {
        let mut counts = vec![0_usize; self.rows.len()];
        let is_sum = |draft: &Draft| matches!(draft.kind, Kind::Product | Kind::Products);
        for draft in self.drafts.iter().filter(|draft| is_sum(draft)) {
            let mut read = draft.rows[1..].to_vec();
            read.sort_unstable();
            read.dedup();
            read.iter().for_each(|row| counts[*row as usize] += 1);
        }
        let heights = heights(&self.drafts, self.rows.len());
        // The factors that others share, and what each of them multiplies.
        let split = |draft: &Draft| -> Option<(Vec<RowNumber>, Vec<RowNumber>)> {
            let mut pairs = Vec::new();
            for pair in draft.rows[1..].chunks_exact(2) {
                let (a, b) = (pair[0], pair[1]);
                pairs.push(match (counts[a as usize] > 2, counts[b as usize] > 2) {
                    (true, false) => (a, b),
                    (false, true) => (b, a),
                    _ => return None,
                });
            }
            pairs.sort_unstable();
            Some(pairs.into_iter().unzip())
        };
        // By height, so that none of a group is below another, and by the shared factors.
        type Groups = Vec<((usize, Vec<RowNumber>), Vec<(RowNumber, Vec<RowNumber>)>)>;
        let mut groups = Groups::new();
        for draft in self.drafts.iter().filter(|draft| is_sum(draft)) {
            let Some((shared, own)) = split(draft) else { continue };
            let (key, member) = ((heights[draft.rows[0] as usize], shared), (draft.rows[0], own));
            match groups.iter_mut().find(|(known, _)| *known == key) {
                Some((_, members)) => members.push(member),
                None => groups.push((key, vec![member])),
            }
        }
        for ((_, shared), members) in groups {
            for three in members.chunks_exact(3) {
                let mut rows: Vec<RowNumber> = three.iter().map(|(to, _)| *to).collect();
                self.drafts.retain(|draft| draft.writes != 1 || !rows.contains(&draft.rows[0]));
                for (place, &row) in shared.iter().enumerate() {
                    rows.push(row);
                    rows.extend(three.iter().map(|(_, own)| own[place]));
                }
                self.drafts.push(Draft::new(Kind::VectorProducts, 3, rows));
            }
        }
    }

    /// At least two terms of a sum that are products which nothing else reads, with the same factor.
    pub(super) fn group_of(&self, at: usize, reads: &[usize]) -> Option<(Vec<usize>, Symbol)> {
        let draft = &self.drafts[at];
        let is_own =
            |row: RowNumber| reads[row as usize] == 1 && !self.rows[row as usize].is_kept && self.are_products(&[row]);
        let terms: Vec<usize> = (0..draft.factors.len()).filter(|place| is_own(draft.rows[1 + place])).collect();
        terms.iter().find_map(|&first| {
            let factor = draft.factors[first];
            let alike: Vec<usize> = terms.iter().copied().filter(|&place| draft.factors[place] == factor).collect();
            (alike.len() > 1).then_some((alike, factor))
        })
    }

    /// Replaces the operations that form these rows by one.
    pub(super) fn replace(&mut self, rows: &[RowNumber], draft: Draft) {
        let forms = |own: &Draft| own.writes == 1 && rows.contains(&own.rows[0]);
        let first = self.drafts.iter().position(forms).unwrap_or(self.drafts.len());
        self.drafts.retain(|own| !forms(own));
        self.drafts.insert(first, draft);
    }
}
