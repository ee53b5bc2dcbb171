//! Series formed order by order, for the lane groups of a tile at once.

use std::cell::Cell;

use super::{Jets, Kind, Operation, Place};
use crate::math::lanes::Each;
use crate::math::real::{Outlined, Real};

/// Carries out something for all groups. It is a macro because a closure cannot be made to be inlined.
macro_rules! each {
    (|$group:ident| $number:expr) => {{
        let mut all = Each::<R, G>::zero();
        for $group in 0..G {
            all.0[$group] = $number;
        }
        all
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
    /// Room for these series.
    #[inline(always)]
    pub fn new(jets: &Jets) -> Self {
        // One for each use, so that operations read theirs side by side.
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

    /// Sets a coefficient of a row that the caller starts.
    #[inline(always)]
    pub fn set(&mut self, place: Place, order: usize, group: usize, number: R) {
        self.numbers[place.at(order)].0[group % G] = number;
    }

    /// Takes the factors of a lane group, as [`Jets::factors`] gives them.
    #[inline(always)]
    pub fn set_factors(&mut self, jets: &Jets, group: usize, factors: &[Each<R, 1>]) {
        for (place, &number) in self.factors.iter_mut().zip(&jets.factor_numbers) {
            let Each([factor]) = factors[number];
            place.0[group % G] = factor;
        }
    }

    /// Forms all coefficients: of states up to [`Jets::order`], of what follows from them up to one less.
    #[inline(always)]
    pub fn form(&mut self, jets: &Jets) {
        self.form_up_to(jets, jets.order);
    }

    /// The same up to a lower order.
    #[inline(always)]
    pub fn form_up_to(&mut self, jets: &Jets, order: usize) {
        R::outlined(Formation { jets, series: self, order });
    }
}

struct Formation<'a, R: Real, const G: usize> {
    jets: &'a Jets,
    series: &'a mut Series<R, G>,
    order: usize,
}

/// What an operation of one order works on.
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

/// The same with what is added to the terms of even and odd number.
#[inline(always)]
fn added_convolution<R: Real, const G: usize>(
    a: &[Cell<Each<R, G>>],
    b: &[Cell<Each<R, G>>],
    mut even: Each<R, G>,
    mut odd: Each<R, G>,
) -> Each<R, G> {
    let (pairs, reversed) = (a.chunks_exact(2), b.rchunks_exact(2));
    let (last, first) = (pairs.remainder(), reversed.remainder());
    for (a, b) in pairs.zip(reversed) {
        let ([a0, a1], [b0, b1]) = (a, b) else { continue };
        let (a0, a1, b0, b1) = (a0.get(), a1.get(), b0.get(), b1.get());
        for g in 0..G {
            even.0[g] = a0.0[g].mul_add(b1.0[g], even.0[g]);
            odd.0[g] = a1.0[g].mul_add(b0.0[g], odd.0[g]);
        }
    }
    if let ([a], [b]) = (last, first) {
        let (a, b) = (a.get(), b.get());
        for g in 0..G {
            even.0[g] = a.0[g].mul_add(b.0[g], even.0[g]);
        }
    }
    each!(|g| even.0[g] + odd.0[g])
}

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
        &self.numbers[place.at(0)..][from..to + 1]
    }

    #[inline(always)]
    fn factor(&self, operation: &Operation, index: usize) -> Each<R, G> {
        self.factors[operation.factor + index]
    }

    /// 1/k; 0 for k = 0.
    #[inline(always)]
    fn inverse_order(&self) -> R {
        R::splat(if self.k == 0 { 0.0 } else { (self.k as f64).recip() })
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

    /// Terms that are equal in pairs once, and doubled.
    #[inline(always)]
    fn square_of(&self, a: Place, k: usize) -> Each<R, G> {
        let half = k.div_ceil(2);
        let (front, back) = (self.part(a, 0, k), self.part(a, k + 1 - half, k));
        let sum = if half == 0 { Each::zero() } else { convolution(&front[..half], back) };
        let two = R::splat(2.0);
        if k.is_multiple_of(2) {
            let middle = front[k / 2].get();
            each!(|g| middle.0[g].mul_add(middle.0[g], sum.0[g] * two))
        } else {
            each!(|g| sum.0[g] * two)
        }
    }

    #[inline(always)]
    fn integral(&self, operation: &Operation) {
        let &[x, rate] = self.places(operation) else { return };
        let (rate, factor) = (self.now(rate), R::splat(((self.k + 1) as f64).recip()));
        self.numbers[x.at(self.k + 1)].set(each!(|g| rate.0[g] * factor));
    }

    #[inline(always)]
    fn pick(&self, operation: &Operation) {
        let &[to, condition, a, b] = self.places(operation) else { return };
        let (condition, a, b, half) = (self.start(condition), self.now(a), self.now(b), R::splat(0.5));
        self.set(to, each!(|g| R::select(half.less_than(condition.0[g]), a.0[g], b.0[g])));
    }

    /// One order of operations of a kind.
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
            Kind::Turning => all!(turning),
            Kind::SinCosAffine if self.k > 0 => all!(sin_cos_affine),
            Kind::Pick => all!(pick),
            Kind::Below | Kind::And | Kind::Or | Kind::Not | Kind::Round if self.k > 0 => {}
            _ => all!(rare),
        }
    }

    /// What needs much code is a function of its own.
    #[inline(always)]
    fn rare(&self, operation: &Operation) {
        R::outlined(Rare { work: *self, operation });
    }
}

struct Rare<'w, 'a, R: Real, const G: usize> {
    work: Work<'a, R, G>,
    operation: &'w Operation,
}

impl<R: Real, const G: usize> Outlined for Rare<'_, '_, R, G> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let Self { work, operation } = self;
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
            // The others are carried out where they are met.
            _ => {}
        }
    }
}

impl<R: Real, const G: usize> Outlined for Formation<'_, R, G> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let Self { jets, series, order } = self;
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
}
