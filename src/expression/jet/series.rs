//! Series computed order by order, for the lane groups of a tile at once.

use std::cell::Cell;

use super::{Jets, Kind, MOST_ORDER, Operation, Place};
use crate::math::lanes::Each;
use crate::math::real::{Real, outlined};

/// Does something for all groups. It is a macro because each closure would have to be marked `#[inline(always)]`.
macro_rules! each {
    (|$group:ident| $number:expr) => {{
        let mut all = Each::<R, G>::zero();
        for $group in 0..G {
            all.0[$group] = $number;
        }
        all
    }};
}

/// The terms of a sum over all coefficients so far, which must include the first; those with the latest coefficients come last.
macro_rules! latest_last {
    ($count:expr, |$j:ident| $term:block) => {{
        for $j in 1..$count {
            $term
        }
        let $j = 0;
        $term
    }};
}

mod coarse;
mod recurrences;

/// The coefficients of all rows for one tile of G lane groups, and the factors of its bodies.
#[derive(Clone, Debug)]
pub(crate) struct Series<R, const G: usize> {
    numbers: Vec<Each<R, G>>,
    factors: Vec<Each<R, G>>,
}

impl<R: Real, const G: usize> Series<R, G> {
    /// Memory for these series.
    #[inline(always)]
    pub fn new(jets: &Jets) -> Self {
        // One entry for each use, so that operations read theirs consecutively.
        let factors = vec![Each::zero(); jets.factor_numbers.len()];
        Self { numbers: vec![Each::zero(); jets.room], factors }
    }

    /// A coefficient.
    #[inline(always)]
    pub fn at(&self, place: Place, order: usize) -> &[R; G] {
        &self.numbers[place.at(order)].0
    }

    /// The first coefficients of a row.
    #[inline(always)]
    pub fn row(&self, place: Place, count: usize) -> &[Each<R, G>] {
        &self.numbers[place.at(0)..][..count]
    }

    /// Sets a coefficient of a row that the caller initialises.
    #[inline(always)]
    pub fn set(&mut self, place: Place, order: usize, group: usize, number: R) {
        self.numbers[place.at(order)].0[group % G] = number;
    }

    /// Sets the factors of a lane group, as [`Jets::factors`] computes them.
    #[inline(always)]
    pub fn set_factors(&mut self, jets: &Jets, group: usize, factors: &[Each<R, 1>]) {
        for (place, &number) in self.factors.iter_mut().zip(&jets.factor_numbers) {
            let Each([factor]) = factors[number];
            place.0[group % G] = factor;
        }
    }

    /// Computes all coefficients: of states up to [`Jets::order`], of what follows from them up to one less.
    #[inline(always)]
    pub fn form(&mut self, jets: &Jets) {
        self.form_up_to(jets, jets.order);
    }

    /// The same up to a lower order.
    #[inline(always)]
    pub fn form_up_to(&mut self, jets: &Jets, order: usize) {
        outlined!(R, form(jets, self, order));
    }
}

/// The memory that an operation of one order works on.
#[derive(Clone, Copy)]
struct Work<'a, R: Real, const G: usize> {
    jets: &'a Jets,
    numbers: &'a [Cell<Each<R, G>>],
    factors: &'a [Each<R, G>],
    k: usize,
}

/// Σ a_j b_{n−1−j} of two rows of n coefficients.
#[inline(always)]
fn convolution<R: Real, const G: usize>(a: &[Cell<Each<R, G>>], b: &[Cell<Each<R, G>>]) -> Each<R, G> {
    added_convolution(a, b, Each::zero(), Each::zero())
}

/// The same plus further terms, for the first half and for the second.
///
/// From the middle outwards, as in other sums of this kind: the latest coefficients, at both ends, are needed last, so that a
/// processor can begin a sum while the previous one is unfinished. It uses indices, as two iterators of which one is reversed are not
/// fused.
#[inline(always)]
fn added_convolution<R: Real, const G: usize>(
    a: &[Cell<Each<R, G>>],
    b: &[Cell<Each<R, G>>],
    mut first: Each<R, G>,
    mut second: Each<R, G>,
) -> Each<R, G> {
    let n = a.len();
    let b = &b[..n];
    if !n.is_multiple_of(2) {
        let (a, b) = (a[n / 2].get(), b[n / 2].get());
        for g in 0..G {
            first.0[g] = a.0[g].mul_add(b.0[g], first.0[g]);
        }
    }
    for j in (0..n / 2).rev() {
        let (a, a_back, b, b_back) = (a[j].get(), a[n - 1 - j].get(), b[j].get(), b[n - 1 - j].get());
        for g in 0..G {
            first.0[g] = a.0[g].mul_add(b_back.0[g], first.0[g]);
            second.0[g] = a_back.0[g].mul_add(b.0[g], second.0[g]);
        }
    }
    each!(|g| first.0[g] + second.0[g])
}

/// 1/k; 0 for k = 0.
const INVERSES: [f64; MOST_ORDER + 1] = {
    let mut inverses = [0.0; MOST_ORDER + 1];
    let mut k = 1;
    while k < inverses.len() {
        inverses[k] = 1.0 / k as f64;
        k += 1;
    }
    inverses
};

impl<'a, R: Real, const G: usize> Work<'a, R, G> {
    #[inline(always)]
    fn places(&self, operation: &Operation) -> &'a [Place] {
        &self.jets.rows[operation.first..][..operation.count]
    }

    /// The present coefficient.
    #[inline(always)]
    fn now(&self, place: Place) -> Each<R, G> {
        self.numbers[place.at(self.k)].get()
    }

    #[inline(always)]
    fn set(&self, place: Place, number: Each<R, G>) {
        self.numbers[place.at(self.k)].set(number);
    }

    #[inline(always)]
    fn start(&self, place: Place) -> Each<R, G> {
        self.numbers[place.at(0)].get()
    }

    /// Coefficients from `from` to `to`, inclusive.
    #[inline(always)]
    fn part(&self, place: Place, from: usize, to: usize) -> &'a [Cell<Each<R, G>>] {
        &self.numbers[place.at(from)..][..to + 1 - from]
    }

    /// The coefficients so far of three rows.
    #[inline(always)]
    fn rows(&self, [x, y, z]: [Place; 3]) -> [&'a [Cell<Each<R, G>>]; 3] {
        [self.part(x, 0, self.k), self.part(y, 0, self.k), self.part(z, 0, self.k)]
    }

    #[inline(always)]
    fn factor(&self, operation: &Operation, index: usize) -> Each<R, G> {
        self.factors[operation.factor + index]
    }

    /// 1/k; 0 for k = 0.
    #[inline(always)]
    fn inverse_order(&self) -> R {
        R::splat(INVERSES[self.k])
    }

    /// 1/(k + 1).
    #[inline(always)]
    fn inverse_next_order(&self) -> R {
        R::splat(INVERSES[self.k + 1])
    }

    #[inline(always)]
    fn times_order(&self, number: Each<R, G>) -> Each<R, G> {
        let k = R::splat(self.k as f64);
        each!(|g| number.0[g] * k)
    }

    #[inline(always)]
    fn linear(&self, operation: &Operation) {
        let [to, terms @ ..] = self.places(operation) else { return };
        let mut sum = match operation.constant {
            Some(constant) if self.k == 0 => self.factors[constant],
            _ => Each::zero(),
        };
        let factors = &self.factors[operation.factor..][..terms.len()];
        let (pairs, factor_pairs) = (terms.chunks_exact(2), factors.chunks_exact(2));
        if let ([term], [factor]) = (pairs.remainder(), factor_pairs.remainder()) {
            let term = self.now(*term);
            for g in 0..G {
                sum.0[g] = factor.0[g].mul_add(term.0[g], sum.0[g]);
            }
        }
        // Two sums, so that one does not wait for the other.
        let mut other = Each::<R, G>::zero();
        for (terms, factors) in pairs.zip(factor_pairs) {
            let ([a, b], [p, q]) = (terms, factors) else { continue };
            let (a, b) = (self.now(*a), self.now(*b));
            for g in 0..G {
                sum.0[g] = p.0[g].mul_add(a.0[g], sum.0[g]);
                other.0[g] = q.0[g].mul_add(b.0[g], other.0[g]);
            }
        }
        self.set(*to, each!(|g| sum.0[g] + other.0[g]));
    }

    #[inline(always)]
    fn product(&self, operation: &Operation) {
        let &[to, a, b] = self.places(operation) else { return };
        self.set(to, convolution(self.part(a, 0, self.k), self.part(b, 0, self.k)));
    }

    #[inline(always)]
    fn products(&self, operation: &Operation) {
        let [to, pairs @ ..] = self.places(operation) else { return };
        let mut sum = Each::zero();
        for pair in pairs.chunks_exact(2) {
            sum = added_convolution(self.part(pair[0], 0, self.k), self.part(pair[1], 0, self.k), sum, Each::zero());
        }
        self.set(*to, sum);
    }

    /// Terms that are equal in pairs are computed once and doubled.
    #[inline(always)]
    fn square_of(&self, a: Place, k: usize) -> Each<R, G> {
        let (n, two) = (k + 1, R::splat(2.0));
        let a = self.part(a, 0, k);
        let mut sums = [Each::<R, G>::zero(); 2];
        for j in (0..n / 2).rev() {
            let (a, back) = (a[j].get(), a[n - 1 - j].get());
            let sum = &mut sums[j % 2];
            for g in 0..G {
                sum.0[g] = a.0[g].mul_add(back.0[g], sum.0[g]);
            }
        }
        let sum = each!(|g| (sums[0].0[g] + sums[1].0[g]) * two);
        if n.is_multiple_of(2) {
            return sum;
        }
        let middle = a[n / 2].get();
        each!(|g| middle.0[g].mul_add(middle.0[g], sum.0[g]))
    }

    #[inline(always)]
    fn integral(&self, operation: &Operation) {
        let &[x, rate] = self.places(operation) else { return };
        let (rate, factor) = (self.now(rate), self.inverse_next_order());
        self.numbers[x.at(self.k + 1)].set(each!(|g| rate.0[g] * factor));
    }

    #[inline(always)]
    fn pick(&self, operation: &Operation) {
        let &[to, condition, a, b] = self.places(operation) else { return };
        let (condition, a, b, half) = (self.start(condition), self.now(a), self.now(b), R::splat(0.5));
        self.set(to, each!(|g| R::select(half.less_than(condition.0[g]), a.0[g], b.0[g])));
    }

    /// Executes one order of the operations of a kind.
    #[inline(always)]
    fn carry_out(&self, kind: Kind, operations: &[Operation]) {
        macro_rules! all {
            ($name:ident $(, $argument:expr)*) => {
                for operation in operations {
                    self.$name(operation $(, $argument)*);
                }
            };
        }
        match kind {
            Kind::Linear => all!(linear),
            Kind::ShortLinear if self.k > 1 => {}
            Kind::ShortLinear => all!(linear),
            Kind::Product => all!(product),
            Kind::Products => all!(products),
            Kind::VectorProducts => all!(vector_products),
            Kind::Square => {
                for operation in operations {
                    if let &[to, a] = self.places(operation) {
                        self.set(to, self.square_of(a, self.k));
                    }
                }
            }
            Kind::Triple => all!(triple),
            Kind::Rotation => all!(rotation),
            Kind::Start if self.k > 0 => {}
            Kind::Start => all!(linear),
            Kind::Euler => all!(euler),
            Kind::Integral => all!(integral),
            Kind::Attitude => all!(attitude),
            Kind::Direction => all!(direction),
            Kind::TwoDirections => all!(two_directions),
            Kind::Turning => all!(turning),
            Kind::SinCosAffine if self.k > 0 => all!(sin_cos_affine),
            Kind::Pick => all!(pick),
            Kind::Below | Kind::And | Kind::Or | Kind::Not | Kind::Round if self.k > 0 => {}
            _ => all!(rare),
        }
    }

    #[inline(always)]
    fn rare(&self, operation: &Operation) {
        // A copy, so that this one need not be in memory.
        let work = *self;
        outlined!(R, carry_out_rare(work, operation));
    }
}

/// Operations with much code, which are compiled separately.
#[inline(always)]
fn carry_out_rare<R: Real, const G: usize>(work: Work<'_, R, G>, operation: &Operation) {
    match operation.kind {
        Kind::Quotient => work.quotient(operation),
        Kind::Sqrt => work.sqrt(operation),
        Kind::SinCosAffine => work.sin_cos_affine(operation),
        Kind::SinCos => work.sin_cos(operation),
        Kind::Exp => work.exp(operation),
        Kind::Tan => work.tan(operation),
        Kind::Primitive(function) => work.primitive(operation, function),
        Kind::Atan2 => work.atan2(operation),
        Kind::Power => work.power(operation),
        Kind::Kepler => work.kepler(operation),
        Kind::Below | Kind::And | Kind::Or | Kind::Not | Kind::Round => work.decide(operation),
        // The others are executed inline.
        _ => {}
    }
}

/// [`Series::form_up_to`] as a separate function.
#[inline(always)]
fn form<R: Real, const G: usize>(jets: &Jets, series: &mut Series<R, G>, order: usize) {
    assert_eq!(series.numbers.len(), jets.room, "its own room");
    if let Some(euler) = jets.euler_alone() {
        series.form_euler(jets, euler, order.min(jets.order));
        return;
    }
    let numbers = Cell::from_mut(series.numbers.as_mut_slice()).as_slice_of_cells();
    for k in 0..order.min(jets.order) {
        let work = Work { jets, numbers, factors: &series.factors, k };
        let mut rest = jets.operations.as_slice();
        for &(kind, count) in &jets.runs {
            let (run, later) = rest.split_at(count);
            rest = later;
            work.carry_out(kind, run);
        }
    }
}
