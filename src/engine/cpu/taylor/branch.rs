//! Steps that end where a deciding number changes its sign: one that decides which of two numbers is the lesser, or a
//! truth value.

use super::Tile;
use crate::expression::jet::Place;
use crate::kernel::method::rk8_adaptive::LEAST_STEP;
use crate::kernel::method::taylor::{MOST_HALF_ORDER, MOST_ORDER, form_relative_attitude};
use crate::math::lanes::Each;
use crate::math::quaternion::Quaternion;
use crate::math::real::{Outlined, Real};

impl<R: Real, const G: usize> Tile<'_, R, G> {
    /// The step after which a deciding number has changed its sign, or `h` if that is shorter.
    #[inline(always)]
    pub(super) fn cut(&self, group: usize, h: R) -> R {
        let mut cut = h;
        for &place in &self.motion.jets.switches {
            cut = R::outlined(Cut { tile: self, group, place, h: cut });
        }
        cut
    }

    /// A step, lengthened to the least one, and whether it is left shorter because it ends where a deciding number changes its sign. Of two
    /// such steps in a row the second is lengthened, so that a body that goes to and fro across such a place goes on.
    #[inline(always)]
    pub(super) fn at_least(&self, group: usize, step: R, is_cut: R::Mask) -> (R, R::Mask) {
        let (least, before) = (self.least_step[group], self.controllers[group].step);
        let is_short = is_cut & step.less_than(least) & before.less_than(R::splat(0.5));
        (step.max(R::select(is_short, least.min(R::splat(LEAST_STEP)), least)), is_short)
    }

    /// The lanes in which a deciding number vanishes at the end of a step: the series there may be those of another
    /// branch.
    #[inline(always)]
    pub(super) fn ends_at_switch(&self, group: usize, h: R) -> R::Mask {
        let mut ends = R::splat(0.0).less_than(R::splat(0.0));
        for &place in &self.motion.jets.switches {
            ends = ends | R::outlined(Vanishes { tile: self, group, place, h });
        }
        ends
    }
}

/// The sign of a number below this fraction of the sum of its terms' magnitudes is not meaningful.
const NEGLIGIBLE: f64 = 1e-12;

/// [`Tile::ends_at_switch`] for one deciding number.
struct Vanishes<'s, 'a, R: Real, const G: usize> {
    tile: &'s Tile<'a, R, G>,
    group: usize,
    place: Place,
    h: R,
}

impl<R: Real, const G: usize> Outlined for Vanishes<'_, '_, R, G> {
    type Output = R::Mask;
    #[inline(always)]
    fn run(self) -> R::Mask {
        let Self { tile, group, place, h } = self;
        let (end, greatest) = end_of(tile.series.row(place, tile.motion.jets.order), group, h);
        !(greatest * R::splat(NEGLIGIBLE)).less_than(end.abs())
    }
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

/// [`Tile::cut`] for one deciding number.
struct Cut<'s, 'a, R: Real, const G: usize> {
    tile: &'s Tile<'a, R, G>,
    group: usize,
    place: Place,
    h: R,
}

impl<R: Real, const G: usize> Outlined for Cut<'_, '_, R, G> {
    type Output = R;
    #[inline(always)]
    fn run(self) -> R {
        /// Halvings of the interval in which the sign changes, after which its length is below rounding.
        const HALVINGS: usize = 52;
        let Self { tile, group, place, h } = self;
        let row = tile.series.row(place, tile.motion.jets.order);
        let (zero, one, negligible) = (R::splat(0.0), R::splat(1.0), R::splat(NEGLIGIBLE));
        // The sign that has decided the branch. A step may start where the sign changes, as at an output time, and then
        // rounding determines it.
        let decided = R::select(row[0].0[group].less_than(zero), -one, one);
        let (end, greatest) = end_of(row, group, h);
        let changes = (decided * end).less_than(zero) & (greatest * negligible).less_than(end.abs());
        if !R::any(changes) {
            return h;
        }
        let (mut before, mut after) = (zero, h);
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
        R::select(changes, after.min(h), h)
    }
}

/// The attitude at the end of a step from q S(h), by the series of that step.
pub(super) struct Arrival<'s, 'a, R: Real, const G: usize> {
    pub tile: &'s Tile<'a, R, G>,
    pub group: usize,
    pub h: R,
    pub begun: &'s Quaternion<R>,
}

impl<R: Real, const G: usize> Outlined for Arrival<'_, '_, R, G> {
    type Output = Quaternion<R>;
    #[inline(always)]
    fn run(self) -> Quaternion<R> {
        let Self { tile, group, h, begun } = self;
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
}

/// Brings the attitudes of a lane group's bodies to the ends of their steps, so that directions can be formed from
/// them.
pub(super) struct Finish<'s, 'a, R: Real, const G: usize> {
    pub tile: &'s mut Tile<'a, R, G>,
    pub group: usize,
}

impl<R: Real, const G: usize> Outlined for Finish<'_, '_, R, G> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let Self { tile, group } = self;
        let (pending, begun) = (tile.controllers[group].retried, tile.state[group].orientation.value);
        let zero = R::splat(0.0);
        let is_pending = zero.less_than(pending);
        let arrived = R::outlined(Arrival { tile, group, h: pending, begun: &begun });
        tile.state[group].orientation.value = Quaternion::select(is_pending, arrived, begun);
        tile.controllers[group].retried = R::select(is_pending, zero, pending);
    }
}
