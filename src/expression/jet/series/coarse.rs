//! Operations that do the work of several for a rigid body's equations: each coefficient is loaded once for all of them.

use std::cell::Cell;

use super::super::{Jets, Operation, Place};
use super::{INVERSES, Series, Work};
use crate::math::lanes::Each;
use crate::math::real::Real;

/// Adds d × ω of one coefficient of each to three sums from `$first` on, for a lane group.
macro_rules! add_cross {
    ($sums:ident, $first:literal, $g:ident, ($x:ident, $y:ident, $z:ident), ($a:ident, $b:ident, $c:ident)) => {{
        let (x, y, z) = ($x.0[$g], $y.0[$g], $z.0[$g]);
        let (a, b, c) = ($a.0[$g], $b.0[$g], $c.0[$g]);
        $sums[$first].0[$g] = y.mul_add(c, (-z).mul_add(b, $sums[$first].0[$g]));
        $sums[$first + 1].0[$g] = z.mul_add(a, (-x).mul_add(c, $sums[$first + 1].0[$g]));
        $sums[$first + 2].0[$g] = x.mul_add(b, (-y).mul_add(a, $sums[$first + 2].0[$g]));
    }};
}

impl<R: Real, const G: usize> Work<'_, R, G> {
    #[inline(always)]
    pub(super) fn vector_products(&self, operation: &Operation) {
        let [x, y, z, rows @ ..] = self.places(operation) else { return };
        let n = self.k + 1;
        let mut sums = [Each::<R, G>::zero(); 3];
        for rows in rows.chunks_exact(4) {
            let &[f, a, b, c] = rows else { continue };
            let (f, [a, b, c]) = (self.part(f, 0, self.k), self.rows([a, b, c]));
            latest_last!(n, |j| {
                let (f, a, b, c) = (f[n - 1 - j].get(), a[j].get(), b[j].get(), c[j].get());
                for g in 0..G {
                    sums[0].0[g] = f.0[g].mul_add(a.0[g], sums[0].0[g]);
                    sums[1].0[g] = f.0[g].mul_add(b.0[g], sums[1].0[g]);
                    sums[2].0[g] = f.0[g].mul_add(c.0[g], sums[2].0[g]);
                }
            });
        }
        self.set(*x, sums[0]);
        self.set(*y, sums[1]);
        self.set(*z, sums[2]);
    }

    /// R = 1 − 2 (y² + z²), 2 (x y − z w), …, from products that are equal in pairs.
    #[inline(always)]
    pub(super) fn rotation(&self, operation: &Operation) {
        let &[r11, r12, r13, r21, r22, r23, r31, r32, r33, x, y, z, w] = self.places(operation) else { return };
        let n = self.k + 1;
        let ([x, y, z], w) = (self.rows([x, y, z]), self.part(w, 0, self.k));
        // Half of xx, yy, zz, then xy, xz, xw, yz, yw, zw.
        let mut sums = [Each::<R, G>::zero(); 9];
        if !n.is_multiple_of(2) {
            let (x, y, z, w) = (x[n / 2].get(), y[n / 2].get(), z[n / 2].get(), w[n / 2].get());
            let half = R::splat(0.5);
            for g in 0..G {
                let (x, y, z, w) = (x.0[g], y.0[g], z.0[g], w.0[g]);
                sums[0].0[g] = x * half * x;
                sums[1].0[g] = y * half * y;
                sums[2].0[g] = z * half * z;
                sums[3].0[g] = x * y;
                sums[4].0[g] = x * z;
                sums[5].0[g] = x * w;
                sums[6].0[g] = y * z;
                sums[7].0[g] = y * w;
                sums[8].0[g] = z * w;
            }
        }
        for j in (0..n / 2).rev() {
            let p = [x[j].get(), y[j].get(), z[j].get(), w[j].get()];
            let q = [x[n - 1 - j].get(), y[n - 1 - j].get(), z[n - 1 - j].get(), w[n - 1 - j].get()];
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
    pub(super) fn pair_products(&self, a: Place, b: Place, c: Place) -> [Each<R, G>; 3] {
        let [a, b, c] = self.rows([a, b, c]);
        pair_products(a, b, c)
    }

    #[inline(always)]
    pub(super) fn triple(&self, operation: &Operation) {
        let &[bc, ca, ab, a, b, c] = self.places(operation) else { return };
        let sums = self.pair_products(a, b, c);
        self.set(bc, sums[0]);
        self.set(ca, sums[1]);
        self.set(ab, sums[2]);
    }

    #[inline(always)]
    pub(super) fn euler(&self, operation: &Operation) {
        let [a, b, c, wa, wb, wc, added @ ..] = self.places(operation) else { return };
        let (m, omega) = ([*a, *b, *c], [*wa, *wb, *wc]);
        let pairs = self.pair_products(*a, *b, *c);
        let Some((own, added_factors)) = self.factors[operation.factor..].split_first_chunk::<12>() else { return };
        let (count, factor) = (added.len() / 3, self.inverse_next_order());
        // Unrolled: an index that is not a constant would keep the sums in memory.
        macro_rules! follow {
            ($($axis:literal),*) => {
                $({
                    let now = self.now(m[$axis]);
                    let mut rate = each!(|g| own[6 + $axis].0[g] * now.0[g]);
                    if self.k == 0 {
                        rate = each!(|g| rate.0[g] + own[9 + $axis].0[g]);
                    }
                    let terms = added[$axis * count..][..count].iter().zip(&added_factors[$axis * count..][..count]);
                    for (row, factor) in terms {
                        let number = self.now(*row);
                        rate = each!(|g| factor.0[g].mul_add(number.0[g], rate.0[g]));
                    }
                    let next = each!(|g| own[$axis].0[g].mul_add(pairs[$axis].0[g], rate.0[g]) * factor);
                    self.numbers[m[$axis].at(self.k + 1)].set(next);
                    self.numbers[omega[$axis].at(self.k + 1)].set(each!(|g| own[3 + $axis].0[g] * next.0[g]));
                })*
            };
        }
        follow!(0, 1, 2);
    }

    /// Components x, y, z, w of q ω with ω as a pure vector: for each order one coefficient of q and one of ω.
    #[inline(always)]
    pub(super) fn attitude(&self, operation: &Operation) {
        let &[x, y, z, w, wx, wy, wz] = self.places(operation) else { return };
        let n = self.k + 1;
        let ([qx, qy, qz], qw, [wx, wy, wz]) = (self.rows([x, y, z]), self.part(w, 0, self.k), self.rows([wx, wy, wz]));
        let mut sums = [Each::<R, G>::zero(); 4];
        latest_last!(n, |j| {
            let (qx, qy, qz, qw) = (qx[j].get(), qy[j].get(), qz[j].get(), qw[j].get());
            let (vx, vy, vz) = (wx[n - 1 - j].get(), wy[n - 1 - j].get(), wz[n - 1 - j].get());
            for g in 0..G {
                let (x, y, z, w) = (qx.0[g], qy.0[g], qz.0[g], qw.0[g]);
                let (a, b, c) = (vx.0[g], vy.0[g], vz.0[g]);
                // As `Quaternion::product_vector`.
                sums[0].0[g] = w.mul_add(a, y.mul_add(c, (-z).mul_add(b, sums[0].0[g])));
                sums[1].0[g] = w.mul_add(b, z.mul_add(a, (-x).mul_add(c, sums[1].0[g])));
                sums[2].0[g] = w.mul_add(c, x.mul_add(b, (-y).mul_add(a, sums[2].0[g])));
                sums[3].0[g] = (-x).mul_add(a, (-y).mul_add(b, (-z).mul_add(c, sums[3].0[g])));
            }
        });
        let half = R::splat(0.5 * INVERSES[n]);
        for (place, sum) in [x, y, z, w].into_iter().zip(sums) {
            self.numbers[place.at(self.k + 1)].set(each!(|g| sum.0[g] * half));
        }
    }

    /// d × ω for a direction: for each order one coefficient of d and one of ω.
    #[inline(always)]
    fn crossed(&self, [x, y, z]: [Place; 3], omega: [Place; 3]) -> [Each<R, G>; 3] {
        let n = self.k + 1;
        let ([x, y, z], [a, b, c]) = (self.rows([x, y, z]), self.rows(omega));
        let mut sums = [Each::<R, G>::zero(); 3];
        latest_last!(n, |j| {
            let (x, y, z) = (x[j].get(), y[j].get(), z[j].get());
            let (a, b, c) = (a[n - 1 - j].get(), b[n - 1 - j].get(), c[n - 1 - j].get());
            for g in 0..G {
                add_cross!(sums, 0, g, (x, y, z), (a, b, c));
            }
        });
        sums
    }

    /// u × ω and v × ω, for which ω is read once.
    #[inline(always)]
    fn both_crossed(&self, u: [Place; 3], v: [Place; 3], omega: [Place; 3]) -> [Each<R, G>; 6] {
        let n = self.k + 1;
        let ([u_x, u_y, u_z], [v_x, v_y, v_z], [a, b, c]) = (self.rows(u), self.rows(v), self.rows(omega));
        let mut sums = [Each::<R, G>::zero(); 6];
        latest_last!(n, |j| {
            let (x, y, z) = (u_x[j].get(), u_y[j].get(), u_z[j].get());
            let (u, v, w) = (v_x[j].get(), v_y[j].get(), v_z[j].get());
            let (a, b, c) = (a[n - 1 - j].get(), b[n - 1 - j].get(), c[n - 1 - j].get());
            for g in 0..G {
                add_cross!(sums, 0, g, (x, y, z), (a, b, c));
                add_cross!(sums, 3, g, (u, v, w), (a, b, c));
            }
        });
        sums
    }

    #[inline(always)]
    pub(super) fn direction(&self, operation: &Operation) {
        let &[dx, dy, dz, wx, wy, wz] = self.places(operation) else { return };
        let (sums, factor) = (self.crossed([dx, dy, dz], [wx, wy, wz]), self.inverse_next_order());
        for (place, sum) in [dx, dy, dz].into_iter().zip(sums) {
            self.numbers[place.at(self.k + 1)].set(each!(|g| sum.0[g] * factor));
        }
    }

    #[inline(always)]
    pub(super) fn two_directions(&self, operation: &Operation) {
        let &[ux, uy, uz, vx, vy, vz, wx, wy, wz] = self.places(operation) else { return };
        let sums = self.both_crossed([ux, uy, uz], [vx, vy, vz], [wx, wy, wz]);
        let factor = self.inverse_next_order();
        for (place, sum) in [ux, uy, uz, vx, vy, vz].into_iter().zip(sums) {
            self.numbers[place.at(self.k + 1)].set(each!(|g| sum.0[g] * factor));
        }
    }

    #[inline(always)]
    pub(super) fn turning(&self, operation: &Operation) {
        let &[ux, uy, uz, vx, vy, vz, wx, wy, wz, advances] = self.places(operation) else { return };
        let sums = self.both_crossed([ux, uy, uz], [vx, vy, vz], [wx, wy, wz]);
        let (advance, per_unit) = (self.numbers[advances.at(1)].get(), self.factor(operation, 0));
        let (rate, factor) = (each!(|g| advance.0[g] * per_unit.0[g]), self.inverse_next_order());
        // Unrolled: an index that is not a constant would keep the sums in memory.
        macro_rules! follow {
            ($(($u:expr, $v:expr, $axis:literal)),*) => {
                $({
                    let (own, other) = (self.now($u), self.now($v));
                    let u_next = each!(|g| rate.0[g].mul_add(other.0[g], sums[$axis].0[g]) * factor);
                    let v_next = each!(|g| (-rate.0[g]).mul_add(own.0[g], sums[3 + $axis].0[g]) * factor);
                    self.numbers[$u.at(self.k + 1)].set(u_next);
                    self.numbers[$v.at(self.k + 1)].set(v_next);
                })*
            };
        }
        follow!((ux, vx, 0), (uy, vy, 1), (uz, vz, 2));
    }
}

impl<R: Real, const G: usize> Series<R, G> {
    /// Euler's equations alone: with no other operations between orders, constants are loaded once.
    #[inline(always)]
    pub(super) fn form_euler(&mut self, jets: &Jets, euler: &Operation, order: usize) {
        let &[a, b, c, wa, wb, wc] = &jets.rows[euler.first..][..euler.count] else { return };
        let mut factors = [[Each::<R, G>::zero(); 3]; 4];
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
            let factor = R::splat(INVERSES[k + 1]);
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
pub(super) fn pair_products<R: Real, const G: usize>(
    a: &[Cell<Each<R, G>>],
    b: &[Cell<Each<R, G>>],
    c: &[Cell<Each<R, G>>],
) -> [Each<R, G>; 3] {
    let n = a.len();
    let (b, c) = (&b[..n], &c[..n]);
    let mut sums = [Each::<R, G>::zero(); 3];
    if !n.is_multiple_of(2) {
        let p = [a[n / 2].get(), b[n / 2].get(), c[n / 2].get()];
        for g in 0..G {
            sums[0].0[g] = p[1].0[g] * p[2].0[g];
            sums[1].0[g] = p[2].0[g] * p[0].0[g];
            sums[2].0[g] = p[0].0[g] * p[1].0[g];
        }
    }
    for j in (0..n / 2).rev() {
        let p = [a[j].get(), b[j].get(), c[j].get()];
        let q = [a[n - 1 - j].get(), b[n - 1 - j].get(), c[n - 1 - j].get()];
        for g in 0..G {
            sums[0].0[g] = p[1].0[g].mul_add(q[2].0[g], q[1].0[g].mul_add(p[2].0[g], sums[0].0[g]));
            sums[1].0[g] = p[2].0[g].mul_add(q[0].0[g], q[2].0[g].mul_add(p[0].0[g], sums[1].0[g]));
            sums[2].0[g] = p[0].0[g].mul_add(q[1].0[g], q[0].0[g].mul_add(p[1].0[g], sums[2].0[g]));
        }
    }
    sums
}
