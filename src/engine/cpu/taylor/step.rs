//! One step: what it starts from, and what comes of it.

use super::Tile;
use super::branch::Arrival;
use crate::bodies::Status;
use crate::bodies::status::flagged;
use crate::expression::jet::Place;
use crate::kernel::method::rk8_adaptive::renormalised;
use crate::kernel::method::taylor::{Coefficients, TwoSided, form_relative_attitude, step_of};
use crate::kernel::rigid_body::State;
use crate::math::lanes::Each;
use crate::math::quaternion::{Quaternion, norm_correction_of_step};
use crate::math::real::{Outlined, Real, sin_cos};
use crate::math::vector::{TwoWords, Vector, two_difference};
use crate::torque::sum::StepTime;
use crate::torque::tile::start_of;

/// Sets what a step starts from.
pub(super) struct Start<'s, 'a, R: Real, const G: usize> {
    pub tile: &'s mut Tile<'a, R, G>,
}

impl<R: Real, const G: usize> Outlined for Start<'_, '_, R, G> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let Self { tile } = self;
        let motion = tile.motion;
        for group in 0..G {
            let State { orientation: TwoWords { value: q, .. }, angular_momentum_principal, .. } = tile.state[group];
            let m = angular_momentum_principal.value;
            for (place, number) in motion.momentum.into_iter().zip([m.x, m.y, m.z]) {
                tile.series.set(place, 0, group, number);
            }
            if let Some(places) = motion.orientation {
                for (place, number) in places.into_iter().zip([q.x, q.y, q.z, q.w]) {
                    tile.series.set(place, 0, group, number);
                }
            }
            if motion.advancing.is_empty() {
                tile.start_directions(group);
                continue;
            }
            let (span, left) = (tile.spans[group], tile.controllers[group].left);
            let (gone, gone_residue) = two_difference(span.value, left.value);
            let seconds = tile.seconds[group];
            let time =
                TwoWords { value: gone * seconds, residue: (gone_residue + (span.residue - left.residue)) * seconds };
            let ticks = tile.source.columns::<R>(0).ticks(StepTime::Own(&time));
            for (advancing, rates) in motion.advancing.iter().zip(&tile.rates) {
                let per_tick = if advancing.per_tick.is_some() { Some(tile.per_tick[group]) } else { None };
                let start = start_of(&tile.source, advancing.number, &tile.bodies[group], &ticks, per_tick);
                tile.series.set(advancing.place, 0, group, start);
                tile.series.set(advancing.place, 1, group, rates[group]);
            }
            tile.start_directions(group);
        }
    }
}

/// What comes of a step for a lane group, now that its series are known.
pub(super) struct Conclusion<'s, 'a, R: Real, const G: usize> {
    pub tile: &'s mut Tile<'a, R, G>,
    pub group: usize,
}

/// The coefficients of a vector of a lane group.
struct VectorRows<'s, R, const G: usize> {
    rows: [&'s [Each<R, G>]; 3],
    group: usize,
}

impl<R: Real, const G: usize> Coefficients<R> for VectorRows<'_, R, G> {
    #[inline(always)]
    fn at(&self, order: usize) -> Vector<R> {
        let [x, y, z] = self.rows;
        Vector::new(x[order].0[self.group], y[order].0[self.group], z[order].0[self.group])
    }
}

impl<R: Real, const G: usize> Tile<'_, R, G> {
    /// Coefficient k of m.
    #[inline(always)]
    fn momentum(&self, group: usize, order: usize) -> Vector<R> {
        self.vector(self.motion.momentum, group, order)
    }

    /// Coefficient k of three rows. No closures here: one that is not inlined is compiled for the least processor.
    #[inline(always)]
    fn vector(&self, [x, y, z]: [Place; 3], group: usize, order: usize) -> Vector<R> {
        let series = &self.series;
        Vector::new(series.at(x, order)[group], series.at(y, order)[group], series.at(z, order)[group])
    }

    /// The first coefficients of three rows.
    #[inline(always)]
    fn rows(&self, [x, y, z]: [Place; 3], count: usize) -> [&[Each<R, G>]; 3] {
        [self.series.row(x, count), self.series.row(y, count), self.series.row(z, count)]
    }

    /// Sets what directions start a step from: where the attitude is known by itself.
    #[inline(always)]
    fn start_directions(&mut self, group: usize) {
        let (motion, zero) = (self.motion, R::splat(0.0));
        if motion.directions.is_empty() {
            return;
        }
        let (under_way, goes_on) = (self.under_way(group), zero.less_than(self.controllers[group].retried));
        if R::any(under_way & !goes_on) {
            let q = self.state[group].orientation.value;
            let mut vector = 0;
            for (turns, angles) in motion.turns.iter().zip(&self.angles) {
                let own = self.worlds[vector][group];
                if let Some(turns) = turns {
                    let [factor, offset] = angles[group];
                    let (sin, cos) = sin_cos(factor.mul_add(self.series.at(*turns, 0)[group], offset));
                    let ahead = self.worlds[vector + 1][group];
                    for now in [own * cos + ahead * sin, ahead * cos - own * sin] {
                        let kept = self.directions[vector][group];
                        self.directions[vector][group] = Vector::select(goes_on, kept, q.rotate_inverse(now));
                        vector += 1;
                    }
                } else {
                    let kept = self.directions[vector][group];
                    self.directions[vector][group] = Vector::select(goes_on, kept, q.rotate_inverse(own));
                    vector += 1;
                }
            }
        }
        for (places, direction) in motion.directions.iter().zip(&self.directions) {
            let Vector { x, y, z } = direction[group];
            for (place, number) in places.iter().zip([x, y, z]) {
                self.series.set(*place, 0, group, number);
            }
        }
    }

    /// Brings the directions of lanes that take a step to its end.
    #[inline(always)]
    fn advance_directions(&mut self, group: usize, h: &TwoWords<R>, taken: R::Mask) {
        let motion = self.motion;
        for (place, places) in motion.directions.iter().enumerate() {
            let rows = VectorRows { rows: self.rows(*places, motion.jets.order + 1), group };
            let increment = increment(&rows, motion.jets.order, h);
            let before = self.directions[place][group];
            self.directions[place][group] = Vector::select(taken, before + increment, before);
        }
    }

    /// Coefficient k of q.
    #[inline(always)]
    fn orientation(&self, places: [Place; 4], group: usize, order: usize) -> Quaternion<R> {
        let [x, y, z, w] = places;
        let Vector { x, y, z } = self.vector([x, y, z], group, order);
        Quaternion::new(x, y, z, self.series.at(w, order)[group])
    }

    /// The norm of coefficient k of what the series are formed for; of m in units of `scale`.
    #[inline(always)]
    fn norm(&self, group: usize, order: usize, inverse_scale: R) -> R {
        let m = self.momentum(group, order).largest() * inverse_scale;
        if let Some(places) = self.motion.orientation {
            return m.max(largest(self.orientation(places, group, order)));
        }
        let mut norm = m;
        for (places, inverse_scale) in self.motion.directions.iter().zip(&self.inverse_scales) {
            norm = norm.max(self.vector(*places, group, order).largest() * inverse_scale[group]);
        }
        norm
    }

    /// log₂ 1/h by which the formula for the attitude keeps the tolerance, and whether that is a number.
    #[inline(always)]
    fn attitude_length(&self, group: usize) -> (R, R::Mask) {
        let (last, last_but_one) = (self.bounds[0][group], self.bounds[1][group]);
        let limit = R::splat(1e290);
        let is_number = last.less_than(limit) & last_but_one.less_than(limit);
        (self.motion.two_sided.length.inverse_logarithm(last, last_but_one), is_number)
    }
}

/// Bounds the coefficients of the attitude relative to where the steps start.
pub(super) struct AttitudeBounds<'s, 'a, R: Real, const G: usize> {
    pub tile: &'s mut Tile<'a, R, G>,
}

impl<R: Real, const G: usize> Outlined for AttitudeBounds<'_, '_, R, G> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let Self { tile } = self;
        let (mut norms, mut majorant) = (std::mem::take(&mut tile.norms), std::mem::take(&mut tile.majorant));
        let [x, y, z] = tile.rows(tile.motion.angular_velocity, norms.len());
        for (order, (norm, ((x, y), z))) in norms.iter_mut().zip(x.iter().zip(y).zip(z)).enumerate() {
            for g in 0..G {
                let omega = Vector::new(x[g], y[g], z[g]);
                // The first ones are what most depends on; three components are less than their sum.
                norm[g] = match order {
                    0..3 => omega.dot(omega).sqrt(),
                    _ => omega.x.abs() + omega.y.abs() + omega.z.abs(),
                };
            }
        }
        tile.bounds = TwoSided::majorant(&norms, &mut majorant);
        (tile.norms, tile.majorant) = (norms, majorant);
    }
}

/// By how much a vector changes in a step.
#[inline(always)]
fn increment<R: Real, const G: usize>(rows: &VectorRows<'_, R, G>, order: usize, h: &TwoWords<R>) -> Vector<R> {
    let mut change = rows.at(order);
    for k in (1..order).rev() {
        change = change.axpy(h.value, rows.at(k));
    }
    change * h.value + rows.at(1) * h.residue
}

/// The largest magnitude of a component.
#[inline(always)]
fn largest<R: Real>(q: Quaternion<R>) -> R {
    q.vector().largest().max(q.w.abs())
}

impl<R: Real, const G: usize> Outlined for Conclusion<'_, '_, R, G> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let Self { tile, group } = self;
        let motion = tile.motion;
        let (order, zero, one) = (motion.jets.order, R::splat(0.0), R::splat(1.0));
        let under_way = tile.under_way(group);
        let controller = tile.controllers[group];
        let state = tile.state[group];
        let (q, m) = (state.orientation.value, state.angular_momentum_principal.value);
        let (left, pending) = (controller.left, controller.retried);
        let is_left = under_way & zero.less_than(left.value);

        // A body that starts from rest is measured by what it gains in an eighth of its unit of time.
        let gained = tile.momentum(group, 1).largest() * R::splat(0.125);
        let scale = m.largest().max(gained).max(R::splat(1e-15));
        let inverse_scale = one / scale;
        let norms = [tile.norm(group, order, inverse_scale), tile.norm(group, order - 1, inverse_scale)];
        let limit = R::splat(1e290);
        let mut is_number = norms[0].less_than(limit) & norms[1].less_than(limit);
        let mut inverse_logarithm = motion.length.inverse_logarithm(norms[0], norms[1]);

        if motion.orientation.is_none() {
            let count = motion.two_sided.half_order;
            let mut relative = std::mem::take(&mut tile.relative);
            let rows = tile.rows(motion.angular_velocity, count);
            form_relative_attitude(VectorRows { rows, group }, &mut relative);
            tile.relative = relative;
            let (own, is_finite) = tile.attitude_length(group);
            is_number = is_number & is_finite;
            inverse_logarithm = inverse_logarithm.max(own);
        }
        let mut step = step_of(inverse_logarithm);
        // From where a root vanishes nothing is known of its series.
        for &root in &motion.jets.roots {
            let vanishes = !zero.less_than(tile.series.at(root, 0)[group]) & zero.less_than(gained);
            step = R::select(vanishes, step.min(R::splat(0.01 * motion.steps.tolerance.sqrt())), step);
        }
        let too_small = !(is_number & !step.less_than(tile.least_step[group]));
        let step = R::select(too_small, one, step);
        let within = step.min(left.value);
        let cut = tile.cut(group, within);
        let is_cut = cut.less_than(within);
        // A last step that would leave almost nothing takes the rest as well.
        let last = left.value.less_than(step * R::splat(1.01)) & !is_cut;
        let step = cut.max(tile.least_step[group]).min(within);
        let h = TwoWords { value: R::select(last, left.value, step), residue: R::select(last, left.residue, zero) };
        let taken = is_left & !too_small;

        let m_rows = VectorRows { rows: tile.rows(motion.momentum, order + 1), group };
        let mut next = state;
        next.angular_momentum_principal.value = m + increment(&m_rows, order, &h);
        tile.advance_directions(group, &h, taken);
        let mut controller = controller;
        match motion.orientation {
            Some(places) => {
                let mut q_change = tile.orientation(places, group, order);
                for k in (1..order).rev() {
                    q_change = q_change.axpy(h.value, tile.orientation(places, group, k));
                }
                let increment = q_change * h.value + tile.orientation(places, group, 1) * h.residue;
                let correction = norm_correction_of_step(q, q + increment);
                next.orientation.value = q + (increment + correction);
                tile.state[group] = State::select(taken, next, state);
            }
            None => {
                let [forwards, backwards] = motion.two_sided.sums(&tile.relative, h.value, pending);
                let is_pending = under_way & zero.less_than(pending);
                let arrived = q.product(backwards.conjugate());
                let arrived = arrived * (one / arrived.norm_squared().sqrt());
                let mut here = Quaternion::select(is_pending, arrived, q);
                if R::any(is_pending & !is_number) {
                    // Where the series are no numbers the attitude stays where the last step began.
                    let begun = q * (one / q.norm_squared().sqrt());
                    here = Quaternion::select(is_pending & !is_number, begun, here);
                }
                let mut stays = state;
                stays.orientation.value = here;
                next.orientation.value = here.product(forwards);
                let ends_branch = taken & is_cut;
                let mut next_pending = h.value;
                if R::any(ends_branch) {
                    let begun = next.orientation.value;
                    let arrived = R::outlined(Arrival { tile, group, h: h.value, begun: &begun });
                    next.orientation.value = Quaternion::select(ends_branch, arrived, begun);
                    next_pending = R::select(ends_branch, zero, next_pending);
                }
                tile.state[group] = State::select(taken, next, State::select(under_way, stays, state));
                controller.retried = R::select(taken, next_pending, R::select(under_way, zero, pending));
            }
        }
        let status = tile.state[group].status;
        tile.state[group].status = flagged(status, is_left & too_small, Status::StepBelowLimit);

        let (value, lost) = two_difference(left.value, h.value);
        let rest = renormalised(value, lost + (left.residue - h.residue));
        controller.left = TwoWords {
            value: R::select(taken, rest.value, left.value),
            residue: R::select(taken, rest.residue, left.residue),
        };
        controller.accepted = R::select(taken, controller.accepted + one, controller.accepted);
        tile.controllers[group] = controller;
    }
}
