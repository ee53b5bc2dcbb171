//! Operations that do the work of several, as a rigid body's equations ask for them: each coefficient is loaded once for all of them.

use std::cell::Cell;

use super::super::{Jets, Operation, Place};
use super::{Series, Work};
use crate::math::lanes::Each;
use crate::math::real::Real;

impl<R: Real, const G: usize> Work<'_, R, G> {
    #[inline(always)]
    pub(super) fn vector_products(&self, operation: &Operation) {
        let [x, y, z, rows @ ..] = self.places(operation) else { return };
        let mut sums = [Each::<R, G>::zero(); 3];
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

    /// R = 1 − 2 (y² + z²), 2 (x y − z w), …, by the products that are equal in pairs.
    #[inline(always)]
    pub(super) fn rotation(&self, operation: &Operation) {
        let &[r11, r12, r13, r21, r22, r23, r31, r32, r33, x, y, z, w] = self.places(operation) else { return };
        let (x, y, z, w) =
            (self.part(x, 0, self.k), self.part(y, 0, self.k), self.part(z, 0, self.k), self.part(w, 0, self.k));
        let backs = x.iter().rev().zip(y.iter().rev()).zip(z.iter().rev().zip(w.iter().rev()));
        let mut fronts = x.iter().zip(y).zip(z.iter().zip(w));
        // Half of xx, yy, zz, then xy, xz, xw, yz, yw, zw.
        let mut sums = [Each::<R, G>::zero(); 9];
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
        if self.k.is_multiple_of(2)
            && let Some(((x, y), (z, w))) = fronts.nth(pairs)
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
    pub(super) fn pair_products(&self, a: Place, b: Place, c: Place) -> [Each<R, G>; 3] {
        pair_products(self.part(a, 0, self.k), self.part(b, 0, self.k), self.part(c, 0, self.k))
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
    pub(super) fn attitude(&self, operation: &Operation) {
        let &[x, y, z, w, wx, wy, wz] = self.places(operation) else { return };
        let part = |place| self.part(place, 0, self.k);
        let (qx, qy, qz, qw) = (part(x), part(y), part(z), part(w));
        let omega = (part(wx).iter().rev(), part(wy).iter().rev(), part(wz).iter().rev());
        let mut sums = [Each::<R, G>::zero(); 4];
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

    /// d × ω of some directions, row by row one coefficient of each and one of ω.
    #[inline(always)]
    fn crossed<const N: usize>(&self, directions: [[Place; 3]; N], omega: [Place; 3]) -> [[Each<R, G>; 3]; N] {
        let part = |place| self.part(place, 0, self.k);
        let (directions, [wx, wy, wz]) = (directions.map(|rows| rows.map(part)), omega.map(part));
        let mut sums = [[Each::<R, G>::zero(); 3]; N];
        for (j, ((a, b), c)) in wx.iter().rev().zip(wy.iter().rev()).zip(wz.iter().rev()).enumerate() {
            let (a, b, c) = (a.get(), b.get(), c.get());
            for (sums, [x, y, z]) in sums.iter_mut().zip(directions) {
                let (x, y, z) = (x[j].get(), y[j].get(), z[j].get());
                for g in 0..G {
                    let (a, b, c) = (a.0[g], b.0[g], c.0[g]);
                    let (x, y, z) = (x.0[g], y.0[g], z.0[g]);
                    sums[0].0[g] = y.mul_add(c, (-z).mul_add(b, sums[0].0[g]));
                    sums[1].0[g] = z.mul_add(a, (-x).mul_add(c, sums[1].0[g]));
                    sums[2].0[g] = x.mul_add(b, (-y).mul_add(a, sums[2].0[g]));
                }
            }
        }
        sums
    }

    #[inline(always)]
    pub(super) fn direction(&self, operation: &Operation) {
        let &[x, y, z, wx, wy, wz] = self.places(operation) else { return };
        let [sums] = self.crossed([[x, y, z]], [wx, wy, wz]);
        let factor = R::splat(((self.k + 1) as f64).recip());
        for (place, sum) in [x, y, z].into_iter().zip(sums) {
            self.numbers[place.at(self.k + 1)].set(each!(|g| sum.0[g] * factor));
        }
    }

    #[inline(always)]
    pub(super) fn turning(&self, operation: &Operation) {
        let &[ux, uy, uz, vx, vy, vz, wx, wy, wz, advances] = self.places(operation) else { return };
        let (u, v) = ([ux, uy, uz], [vx, vy, vz]);
        let [u_sums, v_sums] = self.crossed([u, v], [wx, wy, wz]);
        let (advance, per_unit) = (self.numbers[advances.at(1)].get(), self.factor(operation, 0));
        let (rate, factor) = (each!(|g| advance.0[g] * per_unit.0[g]), R::splat(((self.k + 1) as f64).recip()));
        for axis in 0..3 {
            let (own, other) = (self.now(u[axis]), self.now(v[axis]));
            let (u_sum, v_sum) = (u_sums[axis], v_sums[axis]);
            let u_next = each!(|g| rate.0[g].mul_add(other.0[g], u_sum.0[g]) * factor);
            let v_next = each!(|g| (-rate.0[g]).mul_add(own.0[g], v_sum.0[g]) * factor);
            self.numbers[u[axis].at(self.k + 1)].set(u_next);
            self.numbers[v[axis].at(self.k + 1)].set(v_next);
        }
    }
}

impl<R: Real, const G: usize> Series<R, G> {
    /// Euler's equations, where there is nothing else: with no operations between orders what is constant is found once.
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
pub(super) fn pair_products<R: Real, const G: usize>(
    a: &[Cell<Each<R, G>>],
    b: &[Cell<Each<R, G>>],
    c: &[Cell<Each<R, G>>],
) -> [Each<R, G>; 3] {
    let count = a.len();
    let backs = a.iter().rev().zip(b.iter().rev()).zip(c.iter().rev());
    let mut fronts = a.iter().zip(b).zip(c);
    let mut sums = [Each::<R, G>::zero(); 3];
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
        && let Some(((a, b), c)) = fronts.nth(pairs)
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
