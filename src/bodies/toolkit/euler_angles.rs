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
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct EulerSequence {
    axes: [Axis; 3],
    about: TurnedAxes,
}

/// Three angles (rad) of a sequence.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EulerAngles {
    /// The angles in the order of the turns: the outer ones in (−π, π], the middle one in [0, π] where the first axis
    /// returns and in [−π/2, π/2] where all three differ.
    pub angles: [f64; 3],
    /// Whether the first and third axis coincide, so that only a combination of their angles is determined; the angle
    /// of the turn made last is then given as 0.
    pub is_gimbal_locked: bool,
}

/// The middle angle's distance from gimbal lock below which the outer angles are no longer resolved: their error there is the rounding of
/// the quaternion divided by this, 1e-9 rad.
const LOCK: f64 = 1e-7;

const AXES: [Axis; 3] = [Axis::X, Axis::Y, Axis::Z];

impl EulerSequence {
    /// Nautical angles: yaw about z, pitch about the new y, roll about the new x.
    pub const YAW_PITCH_ROLL: Self = Self { axes: [Axis::Z, Axis::Y, Axis::X], about: TurnedAxes::Body };
    /// Euler's own: precession about z, nutation about the new x, spin about the new z.
    pub const PRECESSION_NUTATION_SPIN: Self = Self { axes: [Axis::Z, Axis::X, Axis::Z], about: TurnedAxes::Body };

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

    /// All twenty-four: twelve about body axes, twelve about world axes.
    pub fn all() -> impl Iterator<Item = Self> {
        let triples = AXES.into_iter().flat_map(|a| AXES.into_iter().flat_map(move |b| AXES.map(|c| [a, b, c])));
        triples.flat_map(|axes| [TurnedAxes::Body, TurnedAxes::World].map(|about| Self::new(axes, about))).flatten()
    }

    /// The axes, in the order of the turns.
    pub fn axes(self) -> [Axis; 3] {
        self.axes
    }

    /// The frame of the axes.
    pub fn about(self) -> TurnedAxes {
        self.about
    }

    /// The orientation after turns by `angles` rad.
    ///
    /// ```
    /// use polhode::bodies::toolkit::EulerSequence;
    ///
    /// let sequence = EulerSequence::YAW_PITCH_ROLL;
    /// let q = sequence.orientation([0.3, -0.2, 3.0]);
    /// let back = sequence.angles(q);
    /// assert!(back.angles.iter().zip([0.3, -0.2, 3.0]).all(|(a, b)| (a - b).abs() < 1e-14));
    /// assert!(!back.is_gimbal_locked);
    /// ```
    pub fn orientation(self, angles: [f64; 3]) -> DQuat {
        let turn = |i: usize| {
            let (sine, cosine) = (0.5 * angles[i]).sin_cos();
            let u = DVec3::AXES[self.axes[i] as usize] * sine;
            DQuat::from_xyzw(u.x, u.y, u.z, cosine)
        };
        match self.about {
            TurnedAxes::Body => turn(0) * turn(1) * turn(2),
            TurnedAxes::World => turn(2) * turn(1) * turn(0),
        }
    }

    /// The angles of a unit quaternion.
    ///
    /// One formula for all sequences (E. Bernardes, S. Viollet, PLoS ONE 17 (2022) e0276302): a sequence of three
    /// different axes becomes one whose first axis repeats by a quarter turn about the middle axis; the half sum and half
    /// difference of its outer angles are two arc tangents of the quaternion's components.
    pub fn angles(self, orientation: DQuat) -> EulerAngles {
        let [x, y, z, w] = orientation.to_array();
        let (angles, is_gimbal_locked) = self.angles_of(Quaternion::new(x, y, z, w));
        EulerAngles { angles, is_gimbal_locked }
    }

    /// The same for any number type; the mask is set where the sequence is in gimbal lock.
    #[inline(always)]
    pub(crate) fn angles_of<R: Real>(self, q: Quaternion<R>) -> ([R; 3], R::Mask) {
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
        let angles = match self.about {
            TurnedAxes::World => [first, middle, last],
            TurnedAxes::Body => [last, middle, first],
        };
        (angles, is_locked)
    }
}

/// The same angle in (−π, π].
#[inline(always)]
fn wrapped<R: Real>(angle: R) -> R {
    let (pi, turn) = (R::splat(PI), R::splat(TAU));
    let angle = R::select(pi.less_than(angle), angle - turn, angle);
    R::select(!(-pi).less_than(angle), angle + turn, angle)
}
