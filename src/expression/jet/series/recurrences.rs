//! Quotients, roots and functions, each by its recurrence, and decisions at the start.

use super::super::{Kind, OVERFLOWING, Operation, Place};
use super::{Work, convolution};
use crate::expression::functions;
use crate::math::lanes::Each;
use crate::math::real::{Function, Real, sin_cos};

/// A quotient below this is that of an exponential that has faded long before ([`super::super::FADED`]).
const FADED_QUOTIENT: f64 = 1e-100;

impl<R: Real, const G: usize> Work<'_, R, G> {
    #[inline(always)]
    pub(super) fn quotient(&self, operation: &Operation) {
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
        // Below an exponential that overflows, a quotient is 0 and stays so.
        let (start, zero) = (self.start(to), R::splat(0.0));
        let (most, faded) = (R::splat(OVERFLOWING), R::splat(FADED_QUOTIENT));
        let next = each!(|g| {
            let is_lost = !rest.0[g].abs().less_than(most) & start.0[g].abs().less_than(faded);
            R::select(is_lost, zero, rest.0[g])
        });
        self.set(to, next);
    }

    #[inline(always)]
    pub(super) fn sqrt(&self, operation: &Operation) {
        let &[to, inverse, a] = self.places(operation) else { return };
        let (k, a) = (self.k, self.now(a));
        if k == 0 {
            let (zero, half) = (R::splat(0.0), R::splat(0.5));
            let root = each!(|g| a.0[g].sqrt());
            self.set(to, root);
            // At 0 there is no series: the root stays 0 for a step that is cut short.
            self.set(inverse, each!(|g| R::select(zero.less_than(root.0[g]), half / root.0[g], zero)));
            return;
        }
        // The middle terms of the square, without the first and the last.
        let sum = if k == 1 { Each::zero() } else { self.square_of(Place { base: to.base + 1, ..to }, k - 2) };
        let inverse = self.start(inverse);
        self.set(to, each!(|g| (a.0[g] - sum.0[g]) * inverse.0[g]));
    }

    #[inline(always)]
    pub(super) fn sin_cos_affine(&self, operation: &Operation) {
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
    pub(super) fn start_sin_cos(&self, sin: Place, cos: Place, angle: Each<R, G>) {
        let (mut s, mut c) = (Each::zero(), Each::zero());
        for g in 0..G {
            (s.0[g], c.0[g]) = sin_cos(angle.0[g]);
        }
        self.set(sin, s);
        self.set(cos, c);
    }

    #[inline(always)]
    pub(super) fn later_sin_cos(&self, sin: Place, cos: Place, slope: Place) {
        let (k, inverse) = (self.k, self.inverse_order());
        let slopes = self.part(slope, 1, k);
        let of_cos = convolution(slopes, self.part(cos, 0, k - 1));
        let of_sin = convolution(slopes, self.part(sin, 0, k - 1));
        self.set(sin, each!(|g| of_cos.0[g] * inverse));
        self.set(cos, each!(|g| -(of_sin.0[g] * inverse)));
    }

    #[inline(always)]
    pub(super) fn sin_cos(&self, operation: &Operation) {
        let &[sin, cos, slope, a] = self.places(operation) else { return };
        if self.k == 0 {
            self.start_sin_cos(sin, cos, self.now(a));
        } else {
            self.set(slope, self.times_order(self.now(a)));
            self.later_sin_cos(sin, cos, slope);
        }
    }

    #[inline(always)]
    pub(super) fn exp(&self, operation: &Operation) {
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
    pub(super) fn tan(&self, operation: &Operation) {
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
    pub(super) fn primitive(&self, operation: &Operation, function: Function) {
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

    /// The coefficient of y with r y' = s, where `now` is the matching coefficient of s.
    #[inline(always)]
    pub(super) fn set_slope(&self, to: Place, slope: Place, inverse: Place, now: Each<R, G>, r: Place) {
        let k = self.k;
        let sum = if k == 1 { Each::zero() } else { convolution(self.part(slope, 1, k - 1), self.part(r, 1, k - 1)) };
        let inverse = self.start(inverse);
        let own = each!(|g| (now.0[g] - sum.0[g]) * inverse.0[g]);
        self.set(slope, own);
        let inverse = self.inverse_order();
        self.set(to, each!(|g| own.0[g] * inverse));
    }

    /// r θ' = x y' − y x'.
    #[inline(always)]
    pub(super) fn atan2(&self, operation: &Operation) {
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
    pub(super) fn power(&self, operation: &Operation) {
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
            if k == 1 { Each::zero() } else { convolution(self.part(own_slope, 1, k - 1), self.part(a, 1, k - 1)) };
        let inverse = self.start(inverse);
        let own = each!(|g| (exponent.0[g] * first.0[g] - second.0[g]) * inverse.0[g]);
        self.set(own_slope, own);
        let inverse = self.inverse_order();
        self.set(to, each!(|g| own.0[g] * inverse));
    }

    /// (1 − e cos E) E' = M'.
    #[inline(always)]
    pub(super) fn kepler(&self, operation: &Operation) {
        let &[sin, cos, slope, inverse, a] = self.places(operation) else { return };
        let (k, now, e) = (self.k, self.now(a), self.factor(operation, 0));
        if k == 0 {
            let (mut s, mut c, one) = (Each::zero(), Each::zero(), R::splat(1.0));
            for g in 0..G {
                (s.0[g], c.0[g]) = functions::kepler(now.0[g], e.0[g]);
            }
            self.set(sin, s);
            self.set(cos, c);
            self.set(inverse, each!(|g| one / (one - e.0[g] * c.0[g])));
            return;
        }
        let sum = if k == 1 { Each::zero() } else { convolution(self.part(slope, 1, k - 1), self.part(cos, 1, k - 1)) };
        let (rate, inverse) = (self.times_order(now), self.start(inverse));
        self.set(slope, each!(|g| e.0[g].mul_add(sum.0[g], rate.0[g]) * inverse.0[g]));
        self.later_sin_cos(sin, cos, slope);
    }

    /// Operations that decide at the start.
    #[inline(always)]
    pub(super) fn decide(&self, operation: &Operation) {
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
}
