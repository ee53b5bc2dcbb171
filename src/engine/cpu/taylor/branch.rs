//! Steps that end where a deciding number changes its sign: one that decides which of two numbers is the lesser, or a
//! truth value.

use super::Tile;
use crate::expression::jet::Place;
use crate::kernel::method::rk8_adaptive::LEAST_STEP;
use crate::kernel::method::taylor::{MOST_HALF_ORDER, MOST_ORDER, OVERFLOWING, form_relative_attitude, step_of};
use crate::math::lanes::Each;
use crate::math::quaternion::Quaternion;
use crate::math::real::{Real, outlined};

impl<R: Real, const G: usize> Tile<'_, R, G> {
    /// The step after which a deciding number first changes its sign or something fades or is no longer faded, or else the longest up to `h` over
    /// which the series of those that may do so keep the tolerance, but no shorter than the least step; and whether it ends at such a change.
    #[inline(always)]
    pub(super) fn cut(&self, group: usize, h: R) -> (R, R::Mask) {
        let mut cut = (h, R::splat(0.0).less_than(R::splat(0.0)));
        let jets = &self.motion.jets;
        for &place in jets.switches.iter().chain(jets.fading.iter().flat_map(|fading| &fading.levels)) {
            cut = outlined!(R, cut_at(self, group, place, cut));
        }
        cut
    }

    /// The lanes in which a number is not constant.
    #[inline(always)]
    pub(super) fn changes(&self, place: Place, group: usize) -> R::Mask {
        let row = self.series.row(place, self.motion.jets.order);
        let mut greatest = R::splat(0.0);
        for coefficient in &row[1..] {
            greatest = greatest.max(coefficient.0[group].abs());
        }
        R::splat(0.0).less_than(greatest)
    }

    /// A step, lengthened to the least one unless it ends where a deciding number changes its sign, and the number of steps in a row that end
    /// so after [`NEAR`] least ones at most, negative where this one is left shorter than the least. Of two such steps in a row the second is
    /// lengthened, so that a body goes on across such a place. One that is driven back to it from either side never gets away: see [`MOST_NEAR`].
    #[inline(always)]
    pub(super) fn at_least(&self, group: usize, step: R, is_cut: R::Mask) -> (R, R) {
        let (least, before, zero) = (self.least_step[group], self.controllers[group].step, R::splat(0.0));
        let is_short = is_cut & step.less_than(least) & !before.less_than(zero);
        let is_near = is_cut & step.less_than(least * R::splat(NEAR));
        let count = R::select(is_near, before.abs() + R::splat(1.0), zero);
        let step = step.max(R::select(is_short, least.min(R::splat(LEAST_STEP)), least));
        (step, R::select(is_short, -count, count))
    }

    /// The lanes in which a deciding number vanishes at the end of a step: the series there may be those of another
    /// branch.
    #[inline(always)]
    pub(super) fn ends_at_switch(&self, group: usize, h: R) -> R::Mask {
        let mut ends = R::splat(0.0).less_than(R::splat(0.0));
        for &place in &self.motion.jets.switches {
            ends = ends | outlined!(R, vanishes(self, group, place, h));
        }
        ends
    }
}

/// Steps that end at a sign after fewer least steps than this get a body nowhere.
const NEAR: f64 = 1024.0;
/// After as many of them in a row the body is flagged: a law that switches to and fro has no solution in the limit, and one that switches at
/// such a rate is beyond what steps can follow.
pub(super) const MOST_NEAR: f64 = 1000.0;

/// The number of terms of a deciding number against which its error is measured: of an oscillation two neighbours are never small together.
pub(super) const SWITCH_MEASURES: usize = 3;

/// The sign of a number below this fraction of the sum of its terms' magnitudes is not meaningful.
const NEGLIGIBLE: f64 = 1e-12;

/// [`Tile::ends_at_switch`] for one deciding number.
#[inline(always)]
fn vanishes<R: Real, const G: usize>(tile: &Tile<'_, R, G>, group: usize, place: Place, h: R) -> R::Mask {
    let (end, greatest) = end_of(tile.series.row(place, tile.motion.jets.order), group, h);
    !(greatest * R::splat(NEGLIGIBLE)).less_than(end.abs())
}

/// A number after a step, and the sum of the magnitudes of its terms.
#[inline(always)]
fn end_of<R: Real, const G: usize>(row: &[Each<R, G>], group: usize, h: R) -> (R, R) {
    let (mut end, mut greatest) = (R::splat(0.0), R::splat(0.0));
    for coefficient in row.iter().rev() {
        end = end.mul_add(h, coefficient.0[group]);
        greatest = greatest.mul_add(h, coefficient.0[group].abs());
    }
    (end, greatest)
}

/// A number at a time of the step, and its derivative.
#[inline(always)]
fn value_and_slope<R: Real, const G: usize>(row: &[Each<R, G>], group: usize, at: R) -> (R, R) {
    let (mut value, mut slope) = (R::splat(0.0), R::splat(0.0));
    for coefficient in row.iter().rev() {
        slope = slope.mul_add(at, value);
        value = value.mul_add(at, coefficient.0[group]);
    }
    (value, slope)
}

/// Whether a number may vanish in a step, by the sum of the magnitudes of its terms.
#[inline(always)]
fn may_vanish<R: Real>(start: R, greatest: R) -> R::Mask {
    // The allowance is for the terms that are not known.
    !greatest.less_than(start.abs() * R::splat(1.9)) & R::splat(0.0).less_than(greatest)
}

/// [`Tile::cut`] for one deciding number, of what the others have left.
#[inline(always)]
fn cut_at<R: Real, const G: usize>(
    tile: &Tile<'_, R, G>,
    group: usize,
    place: Place,
    (longest, is_cut): (R, R::Mask),
) -> (R, R::Mask) {
    /// Parts of a step. A resolved series of an oscillation turns by two radians in a step, and so has one extremum in a part at most.
    const PARTS: usize = 4;
    /// Halvings of the interval in which the sign changes, after which its length is below rounding.
    const HALVINGS: usize = 52;
    /// Halvings for an extremum: its value is then known to rounding.
    const HALVINGS_OF_EXTREMUM: usize = 26;
    let row = tile.series.row(place, tile.motion.jets.order);
    let (zero, one, negligible) = (R::splat(0.0), R::splat(1.0), R::splat(NEGLIGIBLE));
    let [.., last_but_one, last] = row else { return (longest, is_cut) };
    let (last, last_but_one) = (last.0[group].abs(), last_but_one.0[group].abs());
    // Of a series that overflows nothing is known.
    let limit = R::splat(OVERFLOWING);
    let is_known = last.less_than(limit) & last_but_one.less_than(limit);
    let (_, mut greatest) = end_of(row, group, longest);
    let may_vanish = may_vanish(row[0].0[group], greatest) & is_known;
    if !R::any(may_vanish) {
        return (longest, is_cut);
    }
    let mut inverse_logarithm = R::splat(f64::MAX);
    for (first, length) in row.iter().zip(&tile.motion.switch_lengths) {
        let size = first.0[group].abs();
        let own = length.relative(size, last, last_but_one);
        inverse_logarithm = inverse_logarithm.min(own);
    }
    let resolved = step_of(inverse_logarithm).max(tile.least_step[group]);
    let h = R::select(may_vanish, longest.min(resolved), longest);
    let is_shorter = h.less_than(longest);
    if R::any(is_shorter) {
        (_, greatest) = end_of(row, group, h);
    }
    let is_cut = is_cut & !is_shorter;
    // The sign that has decided the branch. A step may start where the sign changes, as at an output time, and then
    // rounding determines it.
    let decided = R::select(row[0].0[group].less_than(zero), -one, one);
    let passed = R::select(may_vanish, -(greatest * negligible), R::splat(f64::NEG_INFINITY));
    let none = zero.less_than(zero);
    let (mut changes, mut before, mut after) = (none, zero, h);
    let (mut last, mut last_value, mut last_slope) = (zero, decided * row[0].0[group], decided * row[1].0[group]);
    for part in 1..=PARTS {
        let at = h * R::splat(part as f64 / PARTS as f64);
        let (value, slope) = value_and_slope(row, group, at);
        let (value, slope) = (decided * value, decided * slope);
        let mut passes = value.less_than(passed);
        let mut end = at;
        // Between two slopes towards zero and away from it there is an extremum, above where the tangents meet.
        let length = at - last;
        let meet = (last_value - value + slope * length) / (slope - last_slope);
        let may_dip = last_slope.less_than(zero)
            & zero.less_than(slope)
            & last_slope.mul_add(meet, last_value).less_than(zero)
            & !passes
            & !changes;
        if R::any(may_dip) {
            let (mut falls, mut rises) = (last, at);
            for _ in 0..HALVINGS_OF_EXTREMUM {
                let middle = (falls + rises) * R::splat(0.5);
                let is_falling = (decided * value_and_slope(row, group, middle).1).less_than(zero);
                falls = R::select(is_falling, middle, falls);
                rises = R::select(is_falling, rises, middle);
            }
            let dips = may_dip & (decided * value_and_slope(row, group, falls).0).less_than(passed);
            end = R::select(dips, falls, end);
            passes = passes | dips;
        }
        let is_first = passes & !changes;
        before = R::select(is_first, last, before);
        after = R::select(is_first, end, after);
        changes = changes | passes;
        (last, last_value, last_slope) = (at, value, slope);
    }
    if !R::any(changes) {
        return (h, is_cut);
    }
    for _ in 0..HALVINGS {
        let middle = (before + after) * R::splat(0.5);
        let mut number = zero;
        for coefficient in row.iter().rev() {
            number = number.mul_add(middle, coefficient.0[group]);
        }
        let is_before = !(decided * number).less_than(zero);
        before = R::select(is_before, middle, before);
        after = R::select(is_before, after, middle);
    }
    // A little further, so that the next step starts on the other side.
    let after = after + h * R::splat(1e-11);
    (R::select(changes, after.min(h), h), is_cut | changes)
}

/// The attitude at the end of a step from q S(h), by the series of that step.
#[inline(always)]
pub(super) fn arrival<R: Real, const G: usize>(
    tile: &Tile<'_, R, G>,
    group: usize,
    h: R,
    begun: &Quaternion<R>,
) -> Quaternion<R> {
    let (order, count) = (tile.motion.jets.order, tile.motion.two_sided.half_order);
    let (zero, one) = (R::splat(0.0), R::splat(1.0));
    // The coefficients of ω, expanded about the end of the step.
    let mut shifted = [[Each([zero]); MOST_ORDER]; 3];
    for (row, place) in shifted.iter_mut().zip(tile.motion.angular_velocity) {
        for (coefficient, from) in row.iter_mut().zip(tile.series.row(place, order)) {
            coefficient[0] = from.0[group];
        }
        // The complete Horner scheme.
        for first in 0..count {
            for k in (first..order - 1).rev() {
                row[k][0] = row[k + 1][0].mul_add(h, row[k][0]);
            }
        }
    }
    let mut relative = [Each([*begun]); MOST_HALF_ORDER + 1];
    let relative = &mut relative[..count + 1];
    form_relative_attitude([&shifted[0], &shifted[1], &shifted[2]], relative);
    let [_, backwards] = tile.motion.two_sided.sums(relative, &Each([zero]), &Each([h]));
    let arrived = begun.product(backwards[0].conjugate());
    arrived * (one / arrived.norm_squared().sqrt())
}

/// Brings the attitudes of a lane group's bodies to the ends of their steps, so that directions can be formed from
/// them.
#[inline(always)]
pub(super) fn finish<R: Real, const G: usize>(tile: &mut Tile<'_, R, G>, group: usize) {
    let (pending, begun) = (tile.controllers[group].retried, tile.state[group].orientation.value);
    let zero = R::splat(0.0);
    let is_pending = zero.less_than(pending);
    let arrived = outlined!(R, arrival(tile, group, pending, &begun));
    tile.state[group].orientation.value = Quaternion::select(is_pending, arrived, begun);
    tile.controllers[group].retried = R::select(is_pending, zero, pending);
}
