//! The start and the conclusion of one step.

use super::Tile;
use super::branch::{MOST_NEAR, arrival};
use super::dense::MOST_INTERVALS;
use crate::bodies::Status;
use crate::bodies::status::flagged;
use crate::expression::jet::Place;
use crate::kernel::method::rk8_adaptive::renormalised;
use crate::kernel::method::taylor::{OVERFLOWING, TwoSided, form_relative_attitude, step_of};
use crate::kernel::rigid_body::State;
use crate::math::lanes::Each;
use crate::math::quaternion::{Quaternion, norm_correction_of_step};
use crate::math::real::{Real, outlined, sin_cos};
use crate::math::vector::{TwoWords, Vector, two_difference};
use crate::torque::sum::StepTime;
use crate::torque::tile::start_of;

/// Sets the first coefficients of a step.
#[inline(always)]
pub(super) fn start<R: Real, const G: usize>(tile: &mut Tile<'_, R, G>) {
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
        tile.start_centre(group);
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

impl<R: Real, const G: usize> Tile<'_, R, G> {
    /// Coefficient k of m.
    #[inline(always)]
    fn momentum(&self, group: usize, order: usize) -> Vector<R> {
        self.vector(self.motion.momentum, group, order)
    }

    /// Coefficient k of three rows. No closures here: one that is not inlined is compiled for the oldest supported
    /// processor.
    #[inline(always)]
    pub(super) fn vector(&self, [x, y, z]: [Place; 3], group: usize, order: usize) -> Vector<R> {
        let series = &self.series;
        Vector::new(series.at(x, order)[group], series.at(y, order)[group], series.at(z, order)[group])
    }

    /// The first coefficients of three rows.
    #[inline(always)]
    fn rows(&self, [x, y, z]: [Place; 3], count: usize) -> [&[Each<R, G>]; 3] {
        [self.series.row(x, count), self.series.row(y, count), self.series.row(z, count)]
    }

    /// Sets the directions at the start of a step: from the attitude, or as carried on if the attitude is behind.
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

    /// The changes of three rows in a step.
    #[inline(always)]
    pub(super) fn increments(&self, places: [Place; 3], h: &Each<TwoWords<R>, G>) -> Each<Vector<R>, G> {
        let order = self.motion.jets.order;
        let [x, y, z] = self.rows(places, order + 1);
        let mut changes = Each([Vector::zero(); G]);
        for k in (1..order + 1).rev() {
            for g in 0..G {
                changes[g] = changes[g].axpy(h[g].value, Vector::new(x[k][g], y[k][g], z[k][g]));
            }
        }
        for g in 0..G {
            changes[g] = changes[g] * h[g].value + Vector::new(x[1][g], y[1][g], z[1][g]) * h[g].residue;
        }
        changes
    }

    /// Coefficient k of q.
    #[inline(always)]
    fn orientation(&self, places: [Place; 4], group: usize, order: usize) -> Quaternion<R> {
        let [x, y, z, w] = places;
        let Vector { x, y, z } = self.vector([x, y, z], group, order);
        Quaternion::new(x, y, z, self.series.at(w, order)[group])
    }

    /// The norm of coefficient k of the quantities whose series are formed; m is multiplied by `inverse_scale`.
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

    /// log₂ 1/h with which the series of a power shows how it grows, unless it has faded.
    #[inline(always)]
    fn length_of_fading(&self, power: Place, group: usize) -> R {
        let (order, [least, most]) = (self.motion.jets.order, self.motion.seen.map(R::splat));
        let now = self.series.at(power, 0)[group].abs();
        let [last_but_one, last] = [order - 1, order].map(|k| self.series.at(power, k)[group].abs());
        let is_seen = least.less_than(now) & now.less_than(most);
        let limit = R::splat(OVERFLOWING);
        let is_known = is_seen & last.less_than(limit) & last_but_one.less_than(limit);
        let own = self.motion.fading_length.relative(now, last, last_but_one);
        R::select(is_known, own, R::splat(f64::NEG_INFINITY))
    }

    /// log₂ 1/h with which the formula for the attitude keeps the tolerance, and whether that is a number.
    #[inline(always)]
    fn attitude_length(&self, group: usize) -> (R, R::Mask) {
        let (last, last_but_one) = (self.bounds[0][group], self.bounds[1][group]);
        let limit = R::splat(OVERFLOWING);
        let is_number = last.less_than(limit) & last_but_one.less_than(limit);
        (self.motion.two_sided.length.inverse_logarithm(last, last_but_one), is_number)
    }
}

/// Bounds the coefficients of the attitude relative to where the steps start.
#[inline(always)]
pub(super) fn bound_attitudes<R: Real, const G: usize>(tile: &mut Tile<'_, R, G>) {
    let (mut norms, mut majorant) = (std::mem::take(&mut tile.norms), std::mem::take(&mut tile.majorant));
    let [x, y, z] = tile.rows(tile.motion.angular_velocity, norms.len());
    for (order, (norm, ((x, y), z))) in norms.iter_mut().zip(x.iter().zip(y).zip(z)).enumerate() {
        for g in 0..G {
            let omega = Vector::new(x[g], y[g], z[g]);
            // The first ones matter most; for the others the sum of three components bounds the norm.
            norm[g] = match order {
                0..3 => omega.dot(omega).sqrt(),
                _ => omega.x.abs() + omega.y.abs() + omega.z.abs(),
            };
        }
    }
    tile.bounds = TwoSided::majorant(&norms, &mut majorant);
    (tile.norms, tile.majorant) = (norms, majorant);
}

/// The largest magnitude of a component.
#[inline(always)]
fn largest<R: Real>(q: Quaternion<R>) -> R {
    q.vector().largest().max(q.w.abs())
}

/// Lanes of a group in which a body is under way; takes a step; takes one that ends at a change of sign; has finite
/// series.
#[derive(Clone, Copy)]
pub(super) struct LanesOf<R: Real> {
    under_way: R::Mask,
    pub taken: R::Mask,
    ends_branch: R::Mask,
    is_number: R::Mask,
}

impl<R: Real> LanesOf<R> {
    #[inline(always)]
    fn none() -> Self {
        let none = R::splat(0.0).less_than(R::splat(0.0));
        Self { under_way: none, taken: none, ends_branch: none, is_number: none }
    }
}

/// Concludes a step whose series are known. Lane groups are treated together, so that none waits for its own sums.
#[inline(always)]
pub(super) fn conclude<R: Real, const G: usize>(tile: &mut Tile<'_, R, G>) {
    let motion = tile.motion;
    let (order, zero, one) = (motion.jets.order, R::splat(0.0), R::splat(1.0));
    if motion.orientation.is_none() {
        let mut relative = std::mem::take(&mut tile.relative);
        form_relative_attitude(tile.rows(motion.angular_velocity, motion.two_sided.half_order), &mut relative);
        tile.relative = relative;
    }
    let mut lanes = [LanesOf::<R>::none(); G];
    let mut steps = Each([TwoWords { value: zero, residue: zero }; G]);
    for group in 0..G {
        let left = tile.controllers[group].left;
        let under_way = tile.under_way(group);
        let is_left = under_way & zero.less_than(left.value);
        // A body that starts from rest is measured by its gain in an eighth of its unit of time.
        let gained = tile.momentum(group, 1).largest() * R::splat(0.125);
        let m = tile.state[group].angular_momentum_principal.value;
        let inverse_scale = one / m.largest().max(gained).max(R::splat(1e-15));
        let norms = [tile.norm(group, order, inverse_scale), tile.norm(group, order - 1, inverse_scale)];
        let limit = R::splat(OVERFLOWING);
        let mut is_number = norms[0].less_than(limit) & norms[1].less_than(limit);
        let mut inverse_logarithm = motion.length.inverse_logarithm(norms[0], norms[1]);
        if motion.orientation.is_none() {
            let (own, is_finite) = tile.attitude_length(group);
            is_number = is_number & is_finite;
            inverse_logarithm = inverse_logarithm.max(own);
        }
        if let Some(rows) = &motion.centre {
            let (own, is_finite) = tile.centre_length(rows, group);
            is_number = is_number & is_finite;
            inverse_logarithm = inverse_logarithm.max(own);
        }
        for fading in &motion.jets.fading {
            inverse_logarithm = inverse_logarithm.max(tile.length_of_fading(fading.power, group));
        }
        let mut step = step_of(inverse_logarithm);
        // Where a root vanishes its series tells nothing, unless it stays so.
        for &place in &motion.jets.roots {
            let vanishes = !zero.less_than(tile.series.at(place, 0)[group]) & tile.changes(place, group);
            let short = R::splat(0.01 * motion.steps.tolerance.sqrt()).max(tile.least_step[group]);
            step = R::select(vanishes, step.min(short), step);
        }
        let too_small = !(is_number & !step.less_than(tile.least_step[group]));
        let step = R::select(too_small, one, step);
        // A last step that would leave almost nothing takes the rest as well.
        let (takes_all, within) = match motion.is_dense {
            true => (zero.less_than(zero), step.min(tile.spans[group].value * R::splat(MOST_INTERVALS))),
            false => {
                let takes_all = left.value.less_than(step * R::splat(1.01));
                (takes_all, R::select(takes_all, left.value, step))
            }
        };
        let (cut, is_cut) = tile.cut(group, within);
        let last = takes_all & !cut.less_than(within);
        let (step, near) = tile.at_least(group, cut, is_cut);
        let step = step.min(within);
        let too_small = too_small | R::splat(MOST_NEAR).less_than(near.abs());
        let before = &mut tile.controllers[group].step;
        *before = R::select(is_left & !too_small, near, *before);
        steps[group] = TwoWords { value: step, residue: R::select(last, left.residue, zero) };
        tile.steps[group] = step;
        let ends_branch = is_cut | tile.ends_at_switch(group, steps[group].value);
        lanes[group] = LanesOf { under_way, taken: is_left & !too_small, ends_branch, is_number };
        let status = tile.state[group].status;
        tile.state[group].status = flagged(status, is_left & too_small, Status::StepBelowLimit);
    }
    tile.take_attitudes(&steps, &lanes);
    let changes = tile.increments(motion.momentum, &steps);
    for group in 0..G {
        let m = tile.state[group].angular_momentum_principal.value;
        let next = Vector::select(lanes[group].taken, m + changes[group], m);
        tile.state[group].angular_momentum_principal.value = next;
    }
    for (number, places) in motion.directions.iter().enumerate() {
        let changes = tile.increments(*places, &steps);
        for group in 0..G {
            let before = tile.directions[number][group];
            tile.directions[number][group] = Vector::select(lanes[group].taken, before + changes[group], before);
        }
    }
    if let Some(rows) = &motion.centre {
        tile.take_centres(rows, &steps, &lanes);
    }
    for group in 0..G {
        let (h, taken) = (steps[group], lanes[group].taken);
        let controller = &mut tile.controllers[group];
        let left = controller.left;
        let (value, lost) = two_difference(left.value, h.value);
        let rest = renormalised(value, lost + (left.residue - h.residue));
        controller.left = TwoWords {
            value: R::select(taken, rest.value, left.value),
            residue: R::select(taken, rest.residue, left.residue),
        };
        controller.accepted = R::select(taken, controller.accepted + one, controller.accepted);
    }
}

impl<R: Real, const G: usize> Tile<'_, R, G> {
    /// Advances the attitudes of lanes that take a step. An attitude that follows from the angular velocity also needs
    /// the series at the end of its step, so this completes the step before and begins the present one.
    #[inline(always)]
    fn take_attitudes(&mut self, steps: &Each<TwoWords<R>, G>, lanes: &[LanesOf<R>; G]) {
        let (motion, order) = (self.motion, self.motion.jets.order);
        let (zero, one) = (R::splat(0.0), R::splat(1.0));
        if let Some(places) = motion.orientation {
            for group in 0..G {
                let (q, h) = (self.state[group].orientation.value, steps[group]);
                let mut q_change = self.orientation(places, group, order);
                for k in (1..order).rev() {
                    q_change = q_change.axpy(h.value, self.orientation(places, group, k));
                }
                let increment = q_change * h.value + self.orientation(places, group, 1) * h.residue;
                let correction = norm_correction_of_step(q, q + increment);
                let next = q + (increment + correction);
                self.state[group].orientation.value = Quaternion::select(lanes[group].taken, next, q);
            }
            return;
        }
        let (mut forwards, mut pending) = (Each([zero; G]), Each([zero; G]));
        for group in 0..G {
            (forwards[group], pending[group]) = (steps[group].value, self.controllers[group].retried);
        }
        let [forwards, backwards] = motion.two_sided.sums(&self.relative, &forwards, &pending);
        for group in 0..G {
            let LanesOf { under_way, taken, ends_branch, is_number } = lanes[group];
            let (h, pending, q) = (steps[group].value, pending[group], self.state[group].orientation.value);
            let is_pending = under_way & zero.less_than(pending);
            let arrived = q.product(backwards[group].conjugate());
            let arrived = arrived * (one / arrived.norm_squared().sqrt());
            let mut here = Quaternion::select(is_pending, arrived, q);
            if R::any(is_pending & !is_number) {
                // If the series are not finite, the attitude stays at the start of the last step.
                let begun = q * (one / q.norm_squared().sqrt());
                here = Quaternion::select(is_pending & !is_number, begun, here);
            }
            let mut next = here.product(forwards[group]);
            let ends_branch = taken & ends_branch;
            let mut next_pending = h;
            if R::any(ends_branch) {
                let arrived = outlined!(R, arrival(self, group, h, &next));
                next = Quaternion::select(ends_branch, arrived, next);
                next_pending = R::select(ends_branch, zero, next_pending);
            }
            self.state[group].orientation.value = Quaternion::select(taken, next, here);
            self.controllers[group].retried = R::select(taken, next_pending, R::select(under_way, zero, pending));
        }
    }
}
