//! Series formed order by order, for the lane groups of a tile at once.

use std::cell::Cell;

use super::super::functions;
use super::{Jets, Kind, Operation, Place};
use crate::real::{Function, Outlined, Real, sin_cos};

/// Carries out something for all groups. It is a macro because a closure cannot be made to be inlined.
macro_rules! each {
    (|$group:ident| $number:expr) => {{
        let mut all = Lane::<R, G>::zero();
        for $group in 0..G {
            all.0[$group] = $number;
        }
        all
    }};
}

/// One number of each of G lane groups, aligned: vectors that straddle two cache lines cost more.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(crate) struct Lane<R, const G: usize>(pub [R; G]);

impl<R: Real, const G: usize> Lane<R, G> {
    #[inline(always)]
    pub fn zero() -> Self {
        Self([R::splat(0.0); G])
    }
}

/// The coefficients of all rows for one tile of G lane groups, and the factors of its bodies.
#[derive(Clone, Debug)]
pub(crate) struct Series<R, const G: usize> {
    numbers: Vec<Lane<R, G>>,
    factors: Vec<Lane<R, G>>,
}

impl<R: Real, const G: usize> Series<R, G> {
    /// Room for these series.
    #[inline(always)]
    pub fn new(jets: &Jets) -> Self {
        // One for each use, so that operations read theirs side by side.
        let factors = vec![Lane::zero(); jets.factor_numbers.len()];
        Self { numbers: vec![Lane::zero(); jets.room], factors }
    }

    /// A coefficient.
    #[inline(always)]
    pub fn at(&self, place: Place, order: usize) -> &[R; G] {
        &self.numbers[place.at(order)].0
    }

    /// The first coefficients of a row.
    #[inline(always)]
    pub fn row(&self, place: Place, count: usize) -> &[Lane<R, G>] {
        &self.numbers[place.at(0)..][..count]
    }

    /// Sets a coefficient of a row that the caller starts.
    #[inline(always)]
    pub fn set(&mut self, place: Place, order: usize, group: usize, number: R) {
        self.numbers[place.at(order)].0[group % G] = number;
    }

    /// Takes the factors of a lane group, as [`Jets::factors`] gives them.
    #[inline(always)]
    pub fn set_factors(&mut self, jets: &Jets, group: usize, factors: &[R]) {
        for (place, &number) in self.factors.iter_mut().zip(&jets.factor_numbers) {
            place.0[group % G] = factors[number];
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

impl<R: Real, const G: usize> Series<R, G> {
    /// Euler's equations, where there is nothing else: with no operations between orders what is constant is found once.
    #[inline(always)]
    fn form_euler(&mut self, jets: &Jets, euler: &Operation, order: usize) {
        let &[a, b, c, wa, wb, wc] = &jets.rows[euler.first..][..euler.count] else { return };
        let mut factors = [[Lane::<R, G>::zero(); 3]; 4];
        for (row, factors) in factors.iter_mut().zip(self.factors[euler.factor..].chunks_exact(3)) {
            row.copy_from_slice(factors);
        }
        let [gyroscopic, inverse, own, constant] = factors;
        let numbers = Cell::from_mut(self.numbers.as_mut_slice()).as_slice_of_cells();
        let row = |place: Place| &numbers[place.at(0)..][..jets.order + 1];
        let (m, omega) = ([row(a), row(b), row(c)], [row(wa), row(wb), row(wc)]);
        for axis in 0..3 {
            let start = m[axis][0].get();
            omega[axis][0].set(each!(|g| inverse[axis].0[g] * start.0[g]));
        }
        for k in 0..order {
            let pairs = pair_products(&m[0][..k + 1], &m[1][..k + 1], &m[2][..k + 1]);
            let factor = R::splat(((k + 1) as f64).recip());
            for axis in 0..3 {
                let (now, pair) = (m[axis][k].get(), pairs[axis]);
                let mut rate = each!(|g| own[axis].0[g] * now.0[g]);
                if k == 0 {
                    rate = each!(|g| rate.0[g] + constant[axis].0[g]);
                }
                let next = each!(|g| gyroscopic[axis].0[g].mul_add(pair.0[g], rate.0[g]) * factor);
                m[axis][k + 1].set(next);
                omega[axis][k + 1].set(each!(|g| inverse[axis].0[g] * next.0[g]));
            }
        }
    }
}

/// The three products of three rows a, b and c: b c, c a, a b.
#[inline(always)]
fn pair_products<R: Real, const G: usize>(
    a: &[Cell<Lane<R, G>>],
    b: &[Cell<Lane<R, G>>],
    c: &[Cell<Lane<R, G>>],
) -> [Lane<R, G>; 3] {
    let count = a.len();
    let backs = a.iter().rev().zip(b.iter().rev()).zip(c.iter().rev());
    let fronts = a.iter().zip(b).zip(c);
    let mut sums = [Lane::<R, G>::zero(); 3];
    let pairs = count / 2;
    for (front, back) in fronts.clone().zip(backs).take(pairs) {
        let ((a, b), c) = front;
        let p = [a.get(), b.get(), c.get()];
        let ((a, b), c) = back;
        let q = [a.get(), b.get(), c.get()];
        for g in 0..G {
            sums[0].0[g] = p[1].0[g].mul_add(q[2].0[g], q[1].0[g].mul_add(p[2].0[g], sums[0].0[g]));
            sums[1].0[g] = p[2].0[g].mul_add(q[0].0[g], q[2].0[g].mul_add(p[0].0[g], sums[1].0[g]));
            sums[2].0[g] = p[0].0[g].mul_add(q[1].0[g], q[0].0[g].mul_add(p[1].0[g], sums[2].0[g]));
        }
    }
    if count % 2 == 1
        && let Some(((a, b), c)) = fronts.skip(pairs).next()
    {
        let p = [a.get(), b.get(), c.get()];
        for g in 0..G {
            sums[0].0[g] = p[1].0[g].mul_add(p[2].0[g], sums[0].0[g]);
            sums[1].0[g] = p[2].0[g].mul_add(p[0].0[g], sums[1].0[g]);
            sums[2].0[g] = p[0].0[g].mul_add(p[1].0[g], sums[2].0[g]);
        }
    }
    sums
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
    numbers: &'a [Cell<Lane<R, G>>],
    factors: &'a [Lane<R, G>],
    k: usize,
}

/// Σ a_j b_{n−1−j} of two rows of n coefficients.
#[inline(always)]
fn convolution<R: Real, const G: usize>(a: &[Cell<Lane<R, G>>], b: &[Cell<Lane<R, G>>]) -> Lane<R, G> {
    added_convolution(a, b, Lane::zero(), Lane::zero())
}

/// The same with what is added to the terms of even and odd number.
#[inline(always)]
fn added_convolution<R: Real, const G: usize>(
    a: &[Cell<Lane<R, G>>],
    b: &[Cell<Lane<R, G>>],
    mut even: Lane<R, G>,
    mut odd: Lane<R, G>,
) -> Lane<R, G> {
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
    fn now(&self, place: Place) -> Lane<R, G> {
        self.numbers[place.at(self.k)].get()
    }

    #[inline(always)]
    fn set(&self, place: Place, number: Lane<R, G>) {
        self.numbers[place.at(self.k)].set(number);
    }

    #[inline(always)]
    fn start(&self, place: Place) -> Lane<R, G> {
        self.numbers[place.at(0)].get()
    }

    /// Coefficients from `from` to `to`, inclusive.
    #[inline(always)]
    fn part(&self, place: Place, from: usize, to: usize) -> &'a [Cell<Lane<R, G>>] {
        &self.numbers[place.at(0)..][from..to + 1]
    }

    #[inline(always)]
    fn factor(&self, operation: &Operation, index: usize) -> Lane<R, G> {
        self.factors[operation.factor + index]
    }

    /// 1/k; 0 for k = 0.
    #[inline(always)]
    fn inverse_order(&self) -> R {
        R::splat(if self.k == 0 { 0.0 } else { (self.k as f64).recip() })
    }

    #[inline(always)]
    fn times_order(&self, number: Lane<R, G>) -> Lane<R, G> {
        let k = R::splat(self.k as f64);
        each!(|g| number.0[g] * k)
    }

    #[inline(always)]
    fn linear(&self, operation: &Operation) {
        let [to, terms @ ..] = self.places(operation) else { return };
        let mut sum = match operation.constant {
            Some(constant) if self.k == 0 => self.factors[constant],
            _ => Lane::zero(),
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
        let mut other = Lane::<R, G>::zero();
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
        let mut sum = Lane::zero();
        for pair in pairs.chunks_exact(2) {
            sum = added_convolution(self.part(pair[0], 0, self.k), self.part(pair[1], 0, self.k), sum, Lane::zero());
        }
        self.set(*to, sum);
    }

    #[inline(always)]
    fn vector_products(&self, operation: &Operation) {
        let [x, y, z, rows @ ..] = self.places(operation) else { return };
        let mut sums = [Lane::<R, G>::zero(); 3];
        for rows in rows.chunks_exact(4) {
            let &[f, a, b, c] = rows else { continue };
            let part = |place| self.part(place, 0, self.k);
            let rows = part(f).iter().rev().zip(part(a)).zip(part(b).iter().zip(part(c)));
            for ((f, a), (b, c)) in rows {
                let (f, a, b, c) = (f.get(), a.get(), b.get(), c.get());
                for g in 0..G {
                    sums[0].0[g] = f.0[g].mul_add(a.0[g], sums[0].0[g]);
                    sums[1].0[g] = f.0[g].mul_add(b.0[g], sums[1].0[g]);
                    sums[2].0[g] = f.0[g].mul_add(c.0[g], sums[2].0[g]);
                }
            }
        }
        self.set(*x, sums[0]);
        self.set(*y, sums[1]);
        self.set(*z, sums[2]);
    }

    /// Terms that are equal in pairs once, and doubled.
    #[inline(always)]
    fn square_of(&self, a: Place, k: usize) -> Lane<R, G> {
        let half = k.div_ceil(2);
        let (front, back) = (self.part(a, 0, k), self.part(a, k + 1 - half, k));
        let sum = if half == 0 { Lane::zero() } else { convolution(&front[..half], back) };
        let two = R::splat(2.0);
        if k % 2 == 0 {
            let middle = front[k / 2].get();
            each!(|g| middle.0[g].mul_add(middle.0[g], sum.0[g] * two))
        } else {
            each!(|g| sum.0[g] * two)
        }
    }

    /// R = 1 − 2 (y² + z²), 2 (x y − z w), …, by the products that are equal in pairs.
    #[inline(always)]
    fn rotation(&self, operation: &Operation) {
        let &[r11, r12, r13, r21, r22, r23, r31, r32, r33, x, y, z, w] = self.places(operation) else { return };
        let (x, y, z, w) =
            (self.part(x, 0, self.k), self.part(y, 0, self.k), self.part(z, 0, self.k), self.part(w, 0, self.k));
        let backs = x.iter().rev().zip(y.iter().rev()).zip(z.iter().rev().zip(w.iter().rev()));
        let fronts = x.iter().zip(y).zip(z.iter().zip(w));
        // Half of xx, yy, zz, then xy, xz, xw, yz, yw, zw.
        let mut sums = [Lane::<R, G>::zero(); 9];
        let pairs = self.k.div_ceil(2);
        for (front, back) in fronts.clone().zip(backs).take(pairs) {
            let ((x, y), (z, w)) = front;
            let p = [x.get(), y.get(), z.get(), w.get()];
            let ((x, y), (z, w)) = back;
            let q = [x.get(), y.get(), z.get(), w.get()];
            for g in 0..G {
                let [px, py, pz, pw] = [p[0].0[g], p[1].0[g], p[2].0[g], p[3].0[g]];
                let [qx, qy, qz, qw] = [q[0].0[g], q[1].0[g], q[2].0[g], q[3].0[g]];
                sums[0].0[g] = px.mul_add(qx, sums[0].0[g]);
                sums[1].0[g] = py.mul_add(qy, sums[1].0[g]);
                sums[2].0[g] = pz.mul_add(qz, sums[2].0[g]);
                sums[3].0[g] = px.mul_add(qy, py.mul_add(qx, sums[3].0[g]));
                sums[4].0[g] = px.mul_add(qz, pz.mul_add(qx, sums[4].0[g]));
                sums[5].0[g] = px.mul_add(qw, pw.mul_add(qx, sums[5].0[g]));
                sums[6].0[g] = py.mul_add(qz, pz.mul_add(qy, sums[6].0[g]));
                sums[7].0[g] = py.mul_add(qw, pw.mul_add(qy, sums[7].0[g]));
                sums[8].0[g] = pz.mul_add(qw, pw.mul_add(qz, sums[8].0[g]));
            }
        }
        if self.k % 2 == 0
            && let Some(((x, y), (z, w))) = fronts.skip(pairs).next()
        {
            let (x, y, z, w, half) = (x.get(), y.get(), z.get(), w.get(), R::splat(0.5));
            for g in 0..G {
                let (x, y, z, w) = (x.0[g], y.0[g], z.0[g], w.0[g]);
                sums[0].0[g] = (x * half).mul_add(x, sums[0].0[g]);
                sums[1].0[g] = (y * half).mul_add(y, sums[1].0[g]);
                sums[2].0[g] = (z * half).mul_add(z, sums[2].0[g]);
                sums[3].0[g] = x.mul_add(y, sums[3].0[g]);
                sums[4].0[g] = x.mul_add(z, sums[4].0[g]);
                sums[5].0[g] = x.mul_add(w, sums[5].0[g]);
                sums[6].0[g] = y.mul_add(z, sums[6].0[g]);
                sums[7].0[g] = y.mul_add(w, sums[7].0[g]);
                sums[8].0[g] = z.mul_add(w, sums[8].0[g]);
            }
        }
        let [xx, yy, zz, xy, xz, xw, yz, yw, zw] = sums;
        let (two, four) = (R::splat(2.0), R::splat(4.0));
        let one = R::splat(if self.k == 0 { 1.0 } else { 0.0 });
        self.set(r11, each!(|g| one - four * (yy.0[g] + zz.0[g])));
        self.set(r22, each!(|g| one - four * (xx.0[g] + zz.0[g])));
        self.set(r33, each!(|g| one - four * (xx.0[g] + yy.0[g])));
        self.set(r12, each!(|g| two * (xy.0[g] - zw.0[g])));
        self.set(r21, each!(|g| two * (xy.0[g] + zw.0[g])));
        self.set(r13, each!(|g| two * (xz.0[g] + yw.0[g])));
        self.set(r31, each!(|g| two * (xz.0[g] - yw.0[g])));
        self.set(r23, each!(|g| two * (yz.0[g] - xw.0[g])));
        self.set(r32, each!(|g| two * (yz.0[g] + xw.0[g])));
    }

    /// The three products of three rows.
    #[inline(always)]
    fn pair_products(&self, a: Place, b: Place, c: Place) -> [Lane<R, G>; 3] {
        pair_products(self.part(a, 0, self.k), self.part(b, 0, self.k), self.part(c, 0, self.k))
    }

    #[inline(always)]
    fn triple(&self, operation: &Operation) {
        let &[bc, ca, ab, a, b, c] = self.places(operation) else { return };
        let sums = self.pair_products(a, b, c);
        self.set(bc, sums[0]);
        self.set(ca, sums[1]);
        self.set(ab, sums[2]);
    }

    #[inline(always)]
    fn euler(&self, operation: &Operation) {
        let [a, b, c, wa, wb, wc, added @ ..] = self.places(operation) else { return };
        let pairs = self.pair_products(*a, *b, *c);
        let factor = R::splat(((self.k + 1) as f64).recip());
        for (axis, (m, omega)) in [(*a, *wa), (*b, *wb), (*c, *wc)].into_iter().enumerate() {
            let of = |kind: usize| self.factor(operation, 3 * kind + axis);
            let (gyroscopic, inverse, own, now) = (of(0), of(1), of(2), self.now(m));
            let mut rate = each!(|g| own.0[g] * now.0[g]);
            if self.k == 0 {
                let constant = of(3);
                rate = each!(|g| rate.0[g] + constant.0[g]);
            }
            if let Some(added) = added.get(axis) {
                let added = self.now(*added);
                rate = each!(|g| rate.0[g] + added.0[g]);
            }
            let pair = pairs[axis];
            let next = each!(|g| gyroscopic.0[g].mul_add(pair.0[g], rate.0[g]) * factor);
            self.numbers[m.at(self.k + 1)].set(next);
            self.numbers[omega.at(self.k + 1)].set(each!(|g| inverse.0[g] * next.0[g]));
        }
    }

    /// Components x, y, z, w of q ω, its pure vector: row by row one coefficient of q and one of ω.
    #[inline(always)]
    fn attitude(&self, operation: &Operation) {
        let &[x, y, z, w, wx, wy, wz] = self.places(operation) else { return };
        let part = |place| self.part(place, 0, self.k);
        let (qx, qy, qz, qw) = (part(x), part(y), part(z), part(w));
        let omega = (part(wx).iter().rev(), part(wy).iter().rev(), part(wz).iter().rev());
        let mut sums = [Lane::<R, G>::zero(); 4];
        let rows = qx.iter().zip(qy).zip(qz.iter().zip(qw)).zip(omega.0.zip(omega.1).zip(omega.2));
        for (((qx, qy), (qz, qw)), ((vx, vy), vz)) in rows {
            let (qx, qy, qz, qw) = (qx.get(), qy.get(), qz.get(), qw.get());
            let (vx, vy, vz) = (vx.get(), vy.get(), vz.get());
            for g in 0..G {
                let (x, y, z, w) = (qx.0[g], qy.0[g], qz.0[g], qw.0[g]);
                let (a, b, c) = (vx.0[g], vy.0[g], vz.0[g]);
                // As `Quaternion::product_vector`.
                sums[0].0[g] = w.mul_add(a, y.mul_add(c, (-z).mul_add(b, sums[0].0[g])));
                sums[1].0[g] = w.mul_add(b, z.mul_add(a, (-x).mul_add(c, sums[1].0[g])));
                sums[2].0[g] = w.mul_add(c, x.mul_add(b, (-y).mul_add(a, sums[2].0[g])));
                sums[3].0[g] = (-x).mul_add(a, (-y).mul_add(b, (-z).mul_add(c, sums[3].0[g])));
            }
        }
        let half = R::splat(0.5 / (self.k + 1) as f64);
        for (place, sum) in [x, y, z, w].into_iter().zip(sums) {
            self.numbers[place.at(self.k + 1)].set(each!(|g| sum.0[g] * half));
        }
    }

    #[inline(always)]
    fn integral(&self, operation: &Operation) {
        let &[x, rate] = self.places(operation) else { return };
        let (rate, factor) = (self.now(rate), R::splat(((self.k + 1) as f64).recip()));
        self.numbers[x.at(self.k + 1)].set(each!(|g| rate.0[g] * factor));
    }

    #[inline(always)]
    fn quotient(&self, operation: &Operation) {
        let &[to, inverse, a, b] = self.places(operation) else { return };
        let (k, mut rest) = (self.k, self.now(a));
        if k == 0 {
            let b = self.start(b);
            let (one, a) = (R::splat(1.0), rest);
            self.set(inverse, each!(|g| one / b.0[g]));
            self.set(to, each!(|g| a.0[g] / b.0[g]));
            return;
        }
        let sum = convolution(self.part(b, 1, k), self.part(to, 0, k - 1));
        let inverse = self.start(inverse);
        rest = each!(|g| (rest.0[g] - sum.0[g]) * inverse.0[g]);
        self.set(to, rest);
    }

    #[inline(always)]
    fn sqrt(&self, operation: &Operation) {
        let &[to, inverse, a] = self.places(operation) else { return };
        let (k, a) = (self.k, self.now(a));
        if k == 0 {
            let (zero, half) = (R::splat(0.0), R::splat(0.5));
            let root = each!(|g| a.0[g].sqrt());
            self.set(to, root);
            // At 0 there is no series: the root stays there for a step that is cut short.
            self.set(inverse, each!(|g| R::select(zero.less_than(root.0[g]), half / root.0[g], zero)));
            return;
        }
        // The middle terms of the square, without the first and the last.
        let sum = if k == 1 { Lane::zero() } else { self.square_of(Place { base: to.base + 1, ..to }, k - 2) };
        let inverse = self.start(inverse);
        self.set(to, each!(|g| (a.0[g] - sum.0[g]) * inverse.0[g]));
    }

    #[inline(always)]
    fn sin_cos_affine(&self, operation: &Operation) {
        let &[sin, cos, a] = self.places(operation) else { return };
        if self.k == 0 {
            self.start_sin_cos(sin, cos, self.start(a));
            return;
        }
        let (rate, inverse) = (self.numbers[a.at(1)].get(), self.inverse_order());
        let (s, c) = (self.numbers[sin.at(self.k - 1)].get(), self.numbers[cos.at(self.k - 1)].get());
        self.set(sin, each!(|g| c.0[g] * (rate.0[g] * inverse)));
        self.set(cos, each!(|g| -(s.0[g] * (rate.0[g] * inverse))));
    }

    #[inline(always)]
    fn start_sin_cos(&self, sin: Place, cos: Place, angle: Lane<R, G>) {
        let (mut s, mut c) = (Lane::zero(), Lane::zero());
        for g in 0..G {
            (s.0[g], c.0[g]) = sin_cos(angle.0[g]);
        }
        self.set(sin, s);
        self.set(cos, c);
    }

    #[inline(always)]
    fn later_sin_cos(&self, sin: Place, cos: Place, slope: Place) {
        let (k, inverse) = (self.k, self.inverse_order());
        let slopes = self.part(slope, 1, k);
        let of_cos = convolution(slopes, self.part(cos, 0, k - 1));
        let of_sin = convolution(slopes, self.part(sin, 0, k - 1));
        self.set(sin, each!(|g| of_cos.0[g] * inverse));
        self.set(cos, each!(|g| -(of_sin.0[g] * inverse)));
    }

    #[inline(always)]
    fn sin_cos(&self, operation: &Operation) {
        let &[sin, cos, slope, a] = self.places(operation) else { return };
        if self.k == 0 {
            self.start_sin_cos(sin, cos, self.now(a));
        } else {
            self.set(slope, self.times_order(self.now(a)));
            self.later_sin_cos(sin, cos, slope);
        }
    }

    #[inline(always)]
    fn exp(&self, operation: &Operation) {
        let &[to, slope, a] = self.places(operation) else { return };
        if self.k == 0 {
            let a = self.now(a);
            self.set(to, each!(|g| functions::of_one(Function::Exp, a.0[g])));
            return;
        }
        self.set(slope, self.times_order(self.now(a)));
        let sum = convolution(self.part(slope, 1, self.k), self.part(to, 0, self.k - 1));
        let inverse = self.inverse_order();
        self.set(to, each!(|g| sum.0[g] * inverse));
    }

    /// t' = (1 + t²) a'.
    #[inline(always)]
    fn tan(&self, operation: &Operation) {
        let &[to, square, slope, a] = self.places(operation) else { return };
        let (k, one) = (self.k, R::splat(1.0));
        if k == 0 {
            let a = self.now(a);
            let tan = each!(|g| functions::of_one(Function::Tan, a.0[g]));
            self.set(to, tan);
            self.set(square, each!(|g| tan.0[g].mul_add(tan.0[g], one)));
            return;
        }
        self.set(slope, self.times_order(self.now(a)));
        let sum = convolution(self.part(slope, 1, k), self.part(square, 0, k - 1));
        let inverse = self.inverse_order();
        self.set(to, each!(|g| sum.0[g] * inverse));
        self.set(square, self.square_of(to, k));
    }

    /// r y' = a'.
    #[inline(always)]
    fn primitive(&self, operation: &Operation, function: Function) {
        let &[to, slope, inverse, a, r] = self.places(operation) else { return };
        let (k, a) = (self.k, self.now(a));
        if k == 0 {
            let (r, one) = (self.start(r), R::splat(1.0));
            self.set(to, each!(|g| functions::of_one(function, a.0[g])));
            self.set(inverse, each!(|g| one / r.0[g]));
            return;
        }
        let a = self.times_order(a);
        self.set_slope(to, slope, inverse, a, r);
    }

    /// The coefficient of y with r y' = s, where `now` is that of s that goes with it.
    #[inline(always)]
    fn set_slope(&self, to: Place, slope: Place, inverse: Place, now: Lane<R, G>, r: Place) {
        let k = self.k;
        let sum = if k == 1 { Lane::zero() } else { convolution(self.part(slope, 1, k - 1), self.part(r, 1, k - 1)) };
        let inverse = self.start(inverse);
        let own = each!(|g| (now.0[g] - sum.0[g]) * inverse.0[g]);
        self.set(slope, own);
        let inverse = self.inverse_order();
        self.set(to, each!(|g| own.0[g] * inverse));
    }

    /// r θ' = x y' − y x'.
    #[inline(always)]
    fn atan2(&self, operation: &Operation) {
        let &[to, slope, y_slope, x_slope, inverse, y, x, r] = self.places(operation) else { return };
        let (k, y_now, x_now) = (self.k, self.now(y), self.now(x));
        if k == 0 {
            let (r, one) = (self.start(r), R::splat(1.0));
            self.set(to, each!(|g| functions::of_two(Function::Atan2, y_now.0[g], x_now.0[g])));
            self.set(inverse, each!(|g| one / r.0[g]));
            return;
        }
        self.set(y_slope, self.times_order(y_now));
        self.set(x_slope, self.times_order(x_now));
        let first = convolution(self.part(y_slope, 1, k), self.part(x, 0, k - 1));
        let second = convolution(self.part(x_slope, 1, k), self.part(y, 0, k - 1));
        self.set_slope(to, slope, inverse, each!(|g| first.0[g] - second.0[g]), r);
    }

    /// a p' = b a' p.
    #[inline(always)]
    fn power(&self, operation: &Operation) {
        let &[to, slope, own_slope, inverse, a] = self.places(operation) else { return };
        let (k, now, exponent) = (self.k, self.now(a), self.factor(operation, 0));
        if k == 0 {
            let one = R::splat(1.0);
            self.set(to, each!(|g| functions::of_two(Function::Pow, now.0[g], exponent.0[g])));
            self.set(inverse, each!(|g| one / now.0[g]));
            return;
        }
        self.set(slope, self.times_order(now));
        let first = convolution(self.part(slope, 1, k), self.part(to, 0, k - 1));
        let second =
            if k == 1 { Lane::zero() } else { convolution(self.part(own_slope, 1, k - 1), self.part(a, 1, k - 1)) };
        let inverse = self.start(inverse);
        let own = each!(|g| (exponent.0[g] * first.0[g] - second.0[g]) * inverse.0[g]);
        self.set(own_slope, own);
        let inverse = self.inverse_order();
        self.set(to, each!(|g| own.0[g] * inverse));
    }

    /// (1 − e cos E) E' = M'.
    #[inline(always)]
    fn kepler(&self, operation: &Operation) {
        let &[sin, cos, slope, inverse, a] = self.places(operation) else { return };
        let (k, now, e) = (self.k, self.now(a), self.factor(operation, 0));
        if k == 0 {
            let (mut s, mut c, one) = (Lane::zero(), Lane::zero(), R::splat(1.0));
            for g in 0..G {
                (s.0[g], c.0[g]) = functions::kepler(now.0[g], e.0[g]);
            }
            self.set(sin, s);
            self.set(cos, c);
            self.set(inverse, each!(|g| one / (one - e.0[g] * c.0[g])));
            return;
        }
        let sum = if k == 1 { Lane::zero() } else { convolution(self.part(slope, 1, k - 1), self.part(cos, 1, k - 1)) };
        let (rate, inverse) = (self.times_order(now), self.start(inverse));
        self.set(slope, each!(|g| e.0[g].mul_add(sum.0[g], rate.0[g]) * inverse.0[g]));
        self.later_sin_cos(sin, cos, slope);
    }

    /// What decides at the start.
    #[inline(always)]
    fn decide(&self, operation: &Operation) {
        let [to, rows @ ..] = self.places(operation) else { return };
        let (zero, one, half) = (R::splat(0.0), R::splat(1.0), R::splat(0.5));
        let a = self.start(rows[0]);
        let b = self.start(rows[rows.len() - 1]);
        let decided = match operation.kind {
            Kind::Below => each!(|g| R::select(a.0[g].less_than(zero), one, zero)),
            Kind::And => each!(|g| a.0[g] * b.0[g]),
            Kind::Or => each!(|g| a.0[g].max(b.0[g])),
            Kind::Not => each!(|g| one - a.0[g]),
            _ => each!(|g| R::select(a.0[g].abs().less_than(half), zero, a.0[g].round())),
        };
        self.numbers[to.at(0)].set(decided);
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
