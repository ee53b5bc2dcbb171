//! Centres of mass that are integrated with the rotation: position and velocity are more states of the series.
//!
//! They have no scale of their own, and may start at rest at the origin. So the error of a step is measured against the
//! greatest of the terms |x_j| hʲ of the series itself up to j = 3, or against the first later one that does not
//! vanish. Measured against term j, the step is that of a series of an order lower by j; the longest of these steps is
//! taken.

use super::step::LanesOf;
use super::{Block, Tile};
use crate::bodies::columns::state_columns;
use crate::engine::cpu::seats::Seating;
use crate::expression::jet::{Jets, Place};
use crate::expression::{Fault, Input, InputKind};
use crate::kernel::method::taylor::{MOST_ORDER, OVERFLOWING, StepLength};
use crate::math::clock::MOST_LANES;
use crate::math::lanes::Each;
use crate::math::real::{Real, Scalar};
use crate::math::vector::{TwoWords, Vector};
use crate::torque::tile::gathered;

/// The number of terms of a series against which its error is measured; later terms count only if all of these vanish.
const MEASURES: usize = 4;

/// The places of the series of a centre of mass, and the step lengths that they allow.
#[derive(Debug)]
pub(super) struct CentreRows {
    position: [Place; 3],
    velocity: [Place; 3],
    /// By the number of the term.
    lengths: [StepLength; MOST_ORDER],
}

impl CentreRows {
    /// For series of this order, at a tolerance.
    pub fn new(jets: &Jets, order: usize, tolerance: f64) -> Result<Self, Fault> {
        let row = |kind, part| jets.input(Input::new(kind, part)).ok_or(Fault::ForeignSymbol);
        let rows = |kind| Ok::<_, Fault>([row(kind, 0)?, row(kind, 1)?, row(kind, 2)?]);
        Ok(Self {
            position: rows(InputKind::Position)?,
            velocity: rows(InputKind::Velocity)?,
            lengths: std::array::from_fn(|term| StepLength::new(order.saturating_sub(term).max(2), tolerance)),
        })
    }
}

/// Position (m) and velocity (m/s), world axes, with the rounding errors of their sums.
#[derive(Clone, Copy, Debug)]
pub(super) struct CentreState<R> {
    position: TwoWords<Vector<R>>,
    velocity: TwoWords<Vector<R>>,
}

impl<R: Real> CentreState<R> {
    #[inline(always)]
    pub fn zero() -> Self {
        let zero = TwoWords { value: Vector::zero(), residue: Vector::zero() };
        Self { position: zero, velocity: zero }
    }
}

impl<R: Real, const G: usize> Tile<'_, R, G> {
    /// Sets the start of a step.
    #[inline(always)]
    pub(super) fn start_centre(&mut self, group: usize) {
        let motion = self.motion;
        let Some(rows) = &motion.centre else { return };
        let CentreState { position, velocity } = self.centres[group];
        for (rows, vector) in [(rows.position, position.value), (rows.velocity, velocity.value)] {
            for (place, number) in rows.into_iter().zip([vector.x, vector.y, vector.z]) {
                self.series.set(place, 0, group, number);
            }
        }
    }

    /// log₂ 1/h by which a centre of mass keeps the tolerance, and whether that is a number.
    #[inline(always)]
    pub(super) fn centre_length(&self, rows: &CentreRows, group: usize) -> (R, R::Mask) {
        let (order, limit) = (self.motion.jets.order, R::splat(OVERFLOWING));
        let mut is_number = R::splat(0.0).less_than(limit);
        let mut greatest = R::splat(-1e3);
        for places in [rows.position, rows.velocity] {
            let last = self.vector(places, group, order).largest();
            let last_but_one = self.vector(places, group, order - 1).largest();
            is_number = is_number & last.less_than(limit) & last_but_one.less_than(limit);
            let (mut least, mut is_known) = (R::splat(1e3), R::splat(0.0).less_than(R::splat(0.0)));
            for (term, length) in rows.lengths.iter().enumerate().take(order - 1) {
                if term >= MEASURES && !R::any(!is_known) {
                    break;
                }
                let size = self.vector(places, group, term).largest();
                let of_term = length.relative(size, last, last_but_one);
                let longer = least.min(of_term);
                // The result of one body does not depend on those beside it.
                least = if term < MEASURES { longer } else { R::select(is_known, least, longer) };
                is_known = is_known | R::splat(0.0).less_than(size);
            }
            greatest = greatest.max(least);
        }
        (greatest, is_number)
    }

    /// Advances centres of mass to the ends of the steps.
    #[inline(always)]
    pub(super) fn take_centres(&mut self, rows: &CentreRows, steps: &Each<TwoWords<R>, G>, lanes: &[LanesOf<R>; G]) {
        let (paths, changes) = (self.increments(rows.position, steps), self.increments(rows.velocity, steps));
        for group in 0..G {
            let (before, taken) = (self.centres[group], lanes[group].taken);
            self.centres[group] = CentreState {
                position: added(before.position, paths[group], taken),
                velocity: added(before.velocity, changes[group], taken),
            };
        }
    }
}

/// Kahan's sum, in the lanes of `taken`.
#[inline(always)]
fn added<R: Real>(sum: TwoWords<Vector<R>>, increment: Vector<R>, taken: R::Mask) -> TwoWords<Vector<R>> {
    let corrected = increment + sum.residue;
    let value = sum.value + corrected;
    let residue = corrected - (value - sum.value);
    TwoWords { value: Vector::select(taken, value, sum.value), residue: Vector::select(taken, residue, sum.residue) }
}

impl<T: Scalar> Block<'_, '_, T> {
    /// The centres of mass of the bodies in some rows.
    #[inline(always)]
    pub(super) fn load_centres<R: Real<Scalar = T>>(&self, rows: &[usize; MOST_LANES]) -> CentreState<R> {
        let columns = &self.state[state_columns::<T>()..];
        let vector = |first: usize| {
            Vector::new(
                gathered(columns[first], rows),
                gathered(columns[first + 1], rows),
                gathered(columns[first + 2], rows),
            )
        };
        CentreState {
            position: TwoWords { value: vector(0), residue: vector(6) },
            velocity: TwoWords { value: vector(3), residue: vector(9) },
        }
    }

    /// Writes them back.
    #[inline(always)]
    pub(super) fn store_centres<R: Real<Scalar = T>>(&mut self, seats: &Seating, centres: &CentreState<R>) {
        let CentreState { position, velocity } = *centres;
        let vectors = [position.value, velocity.value, position.residue, velocity.residue];
        let columns = self.state[state_columns::<T>()..].chunks_exact_mut(3);
        for (columns, Vector { x, y, z }) in columns.zip(vectors) {
            for (column, number) in columns.iter_mut().zip([x, y, z]) {
                seats.scatter(number, column);
            }
        }
    }
}
