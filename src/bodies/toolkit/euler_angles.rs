//! Euler angles of all twenty-four sequences.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DQuat, DVec3};

use crate::error::{Error, Result};
use crate::math::elementary::functions::atan2;
use crate::math::quaternion::Quaternion;
use crate::math::real::Real;

/// An axis of coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Axis {
    /// The first.
    X,
    /// The second.
    Y,
    /// The third.
    Z,
}

/// The frame whose axes a sequence turns about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum TurnedAxes {
    /// The body's, which move with it: R = R₁ R₂ R₃.
    Body,
    /// The world's, which stay fixed: R = R₃ R₂ R₁.
    World,
}

/// The axes of three turns, in the order in which they are made.
///
/// Of its angles, the outer ones lie in (−π, π], the middle one in [0, π] where the first axis returns and in [−π/2, π/2] where all three
/// differ. In gimbal lock, where the first and third axis coincide and only a combination of their angles is determined, the angle of the
/// turn made last is 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct EulerSequence {
    axes: [Axis; 3],
    about: TurnedAxes,
}

/// The middle angle's distance from gimbal lock below which the outer angles are no longer resolved: their error there is the rounding of
/// the quaternion divided by this, 1e-9 rad.
const LOCK: f64 = 1e-7;

impl EulerSequence {
    /// Nautical angles: yaw about z, pitch about the new y, roll about the new x.
    pub const YAW_PITCH_ROLL: Self = Self { axes: [Axis::Z, Axis::Y, Axis::X], about: TurnedAxes::Body };

    /// The sequence about three axes, neighbouring ones different.
    ///
    /// # Errors
    /// [`Error::Setting`] with the number of the axis (1 or 2) that is the same as the one before.
    pub fn new(axes: [Axis; 3], about: TurnedAxes) -> Result<Self> {
        match (1..3).find(|&i| axes[i] == axes[i - 1]) {
            None => Ok(Self { axes, about }),
            Some(same) => Err(Error::Setting {
                field: "axis of an Euler sequence",
                value: same as f64,
                expected: "an axis other than the one before it",
            }),
        }
    }

    /// The orientation (body to world) that three turns by these angles (rad) lead to, in the order of the turns; any angles are valid.
    pub fn orientation(self, angles: [f64; 3]) -> DQuat {
        self.composed(angles, DQuat::from_axis_angle)
    }

    /// The same by the quaternions that `turned_about` forms of an axis and an angle.
    pub(crate) fn composed(self, angles: [f64; 3], turned_about: impl Fn(DVec3, f64) -> DQuat) -> DQuat {
        let turn = |i: usize| turned_about(DVec3::AXES[self.axes[i] as usize], angles[i]);
        match self.about {
            TurnedAxes::Body => turn(0) * turn(1) * turn(2),
            TurnedAxes::World => turn(2) * turn(1) * turn(0),
        }
    }

    /// The angles (rad) of a unit quaternion, in the order of the turns.
    ///
    /// One formula for all sequences (E. Bernardes, S. Viollet, PLoS ONE 17 (2022) e0276302): a sequence of three
    /// different axes becomes one whose first axis repeats by a quarter turn about the middle axis; the half sum and half
    /// difference of its outer angles are two arc tangents of the quaternion's components.
    #[inline(always)]
    pub(crate) fn angles_of<R: Real>(self, q: Quaternion<R>) -> [R; 3] {
        // About world axes in the order i, j, k; turns about body axes are the same in reverse order.
        let [mut i, j, mut k] = self.axes.map(|axis| axis as usize);
        if self.about == TurnedAxes::Body {
            (i, k) = (k, i);
        }
        let returns = i == k;
        if returns {
            k = 3 - i - j;
        }
        let signed = |x: R| if (i + 1) % 3 == j { x } else { -x };
        let (v, w) = ([q.x, q.y, q.z], q.w);
        let (a, b, c, d) = if returns {
            (w, v[i], v[j], signed(v[k]))
        } else {
            (w - v[j], v[i] + signed(v[k]), v[j] + w, signed(v[k]) - v[i])
        };
        let length = |x: R, y: R| x.mul_add(x, y * y).sqrt();
        let middle = R::splat(2.0) * atan2(length(c, d), length(a, b));
        let (half_sum, half_difference) = (atan2(b, a), atan2(d, c));
        let lock = R::splat(LOCK);
        let (is_low, is_high) = (!lock.less_than(middle), !lock.less_than(R::splat(PI) - middle));
        let is_locked = is_low | is_high;
        // Where c and d vanish, only the sum is determined; where a and b vanish, only the difference.
        let (sum, difference) = (R::splat(2.0) * half_sum, R::splat(2.0) * half_difference);
        let zero = R::splat(0.0);
        let (alone_first, alone_last) = match self.about {
            TurnedAxes::World => (R::select(is_low, sum, -difference), zero),
            TurnedAxes::Body => (zero, R::select(is_low, sum, difference)),
        };
        // The turns about i (first about world axes) and about k (last).
        let first = R::select(is_locked, alone_first, half_sum - half_difference);
        let last = R::select(is_locked, alone_last, half_sum + half_difference);
        let last = if returns { last } else { signed(last) };
        let middle = if returns { middle } else { middle - R::splat(FRAC_PI_2) };
        let (first, last) = (wrapped(first), wrapped(last));
        match self.about {
            TurnedAxes::World => [first, middle, last],
            TurnedAxes::Body => [last, middle, first],
        }
    }
}

/// The same angle in (−π, π].
#[inline(always)]
fn wrapped<R: Real>(angle: R) -> R {
    let (pi, turn) = (R::splat(PI), R::splat(TAU));
    let angle = R::select(pi.less_than(angle), angle - turn, angle);
    R::select(!(-pi).less_than(angle), angle + turn, angle)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Quaternions have four components, each with a handful of operations on numbers up to π.
    const ROUNDING: f64 = 8.0 * f64::EPSILON;

    /// All twenty-four.
    fn sequences() -> Vec<EulerSequence> {
        const AXES: [Axis; 3] = [Axis::X, Axis::Y, Axis::Z];
        let triples = AXES.into_iter().flat_map(|a| AXES.into_iter().flat_map(move |b| AXES.map(|c| [a, b, c])));
        let both = |axes| [TurnedAxes::Body, TurnedAxes::World].map(|about| EulerSequence::new(axes, about));
        triples.flat_map(both).flatten().collect()
    }

    /// The angles of an orientation, checked to lead to it again.
    fn restored(sequence: EulerSequence, q: DQuat, bound: f64) -> [f64; 3] {
        let angles = sequence.angles_of(Quaternion::new(q.x, q.y, q.z, q.w));
        let back = sequence.orientation(angles);
        let error = (back - q).length().min((back + q).length());
        assert!(error < bound, "{sequence:?}, {q}: {error:e}");
        angles
    }

    fn returns(sequence: EulerSequence) -> bool {
        sequence.axes[0] == sequence.axes[2]
    }

    #[test]
    fn all_sequences_restore_the_attitude() {
        assert_eq!(sequences().len(), 24);
        let components = [-0.9, -0.35, -0.01, 0.2, 0.6];
        for number in 0..625 {
            let q = [1, 5, 25, 125].map(|place| components[number / place % 5]);
            let q = DQuat::from_array(q).normalize();
            for sequence in sequences() {
                let [a, b, c] = restored(sequence, q, ROUNDING);
                let range = if returns(sequence) { 0.0..=PI } else { -FRAC_PI_2..=FRAC_PI_2 };
                assert!(range.contains(&b), "{sequence:?}: {b}");
                assert!([a, c].iter().all(|x| *x > -PI && *x <= PI), "{sequence:?}: {a}, {c}");
            }
        }
    }

    #[test]
    fn in_gimbal_lock_the_last_angle_is_zero_and_the_attitude_the_same() {
        for sequence in sequences() {
            let middle = if returns(sequence) { [0.0, PI] } else { [-FRAC_PI_2, FRAC_PI_2] };
            for (middle, first) in middle.into_iter().flat_map(|m| [-3.1, -0.4, 1.7].map(|f| (m, f))) {
                for last in [-2.9, -1.0, 0.3, 2.2] {
                    let angles = restored(sequence, sequence.orientation([first, middle, last]), 4.0 * ROUNDING);
                    assert_eq!(angles[2], 0.0, "{sequence:?}");
                }
            }
        }
    }

    #[test]
    fn neighbouring_axes_must_differ() {
        assert!(EulerSequence::new([Axis::X, Axis::X, Axis::Z], TurnedAxes::Body).is_err());
        assert!(EulerSequence::new([Axis::X, Axis::Z, Axis::Z], TurnedAxes::World).is_err());
    }
}
