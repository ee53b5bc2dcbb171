//! Two uniform rotations at once: the free motion of a body with two or three equal moments, or spinning about a
//! principal axis.
//!
//! ```text
//! q(t) = q₀ exp(a m₀ t) exp(λ e_k t),   m(t) = exp(−λ e_k t) m₀
//! ```
//!
//! in principal axes, with m₀ the angular momentum at the start, k the axis of symmetry, a the mean inverse moment across it
//! and λ = (1/I_k − a) m₀·e_k (L. D. Landau, E. M. Lifshitz, *Mechanics*, § 33, equations 33.3 and 33.4, there with
//! angles). The first factor is the precession about the fixed angular momentum, the second the spin about the axis. With
//! equal moments, or a spin along an axis, λ = 0.
//!
//! The rates are formed in double-double arithmetic and angles are integer fractions of a turn ([`crate::math::phase`]), as in the general
//! closed form, whose limiting cases these are; the error does not grow with time. Nothing is kept between output times, so that memory
//! does not grow with the number of bodies. A state takes some 0.14 µs of a core, since the rates are formed anew (`cargo bench --bench
//! costs`).

use glam::DVec3;

use super::formed::{FORMED_BODIES, Formed};
use super::rows::{BLOCK, InitialBlock, TurnsBlock};
use super::setup::SetUp;
use crate::bodies::BodyFrame;
use crate::bodies::Ensemble;
use crate::bodies::user_axes::{UserAxes, UserColumns};
use crate::math::double_double::DoubleDouble;
use crate::math::elementary::{Turns, power_of_two, sin_cos_turns};
use crate::math::lanes::{LaneScalar, LaneTask};
use crate::math::phase::{Rate, Time, fraction_from_turns, phase_at};
use crate::math::quaternion::Quaternion;
use crate::math::real::Real;
use crate::math::vector::Vector;

/// Which of the two rotations a motion has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Rotations {
    /// Neither: the body stays as it is.
    None,
    /// The precession alone, with 1/I_k for a.
    Precession,
    /// Both.
    PrecessionAndSpin,
}

/// Rates of half angles are below 2^`HEADROOM` turns per unit of time: a body's spin is below 2√3 in its own units, and
/// λ is at most the spin about the axis.
const HEADROOM: i32 = 1;

/// 1/4π.
const HALF_TURNS: (f64, f64) = (0.5 * 0.15915494309189535, -0.5 * 9.839338337591243e-18);

/// Some bodies of an ensemble at one time.
pub(crate) struct PrecessionBlock {
    initial: InitialBlock,
    frames: [BodyFrame; BLOCK],
    /// The number of the axis k.
    axes: [f64; BLOCK],
    /// Rates of the half angles of the precession and of the spin, 2^`HEADROOM` turns per unit of time, in two words each.
    rates: [[f64; BLOCK]; 4],
    end: UserColumns,
    start: UserColumns,
}

impl PrecessionBlock {
    /// A block without bodies.
    pub fn new() -> Self {
        Self {
            initial: InitialBlock::at_rest(),
            frames: [BodyFrame::UNIT; BLOCK],
            axes: [0.0; BLOCK],
            rates: [[0.0; BLOCK]; 4],
            end: UserColumns::UNKNOWN,
            start: UserColumns::UNKNOWN,
        }
    }

    /// Evaluates `count` bodies (at most [`FORMED_BODIES`]), which `body` names, at `time` seconds after their initial states, and
    /// transforms the initial states too if `wants_start`. `axis` gives k from the frame and the scaled angular momentum along principal
    /// axes.
    pub fn form(
        &mut self,
        ensemble: &Ensemble,
        count: usize,
        body: impl Fn(usize) -> usize,
        (rotations, axis): (Rotations, impl Fn(&BodyFrame, DVec3) -> usize),
        (time, wants_start): (f64, bool),
    ) {
        assert!(count <= FORMED_BODIES);
        let Self { initial, frames, axes, rates, end, start } = self;
        initial.fill(ensemble, &mut frames[..count], body, SetUp::TwoWords);
        for (place, number) in axes.iter_mut().enumerate().take(count) {
            *number = axis(&frames[place], initial.angular_momentum(place)) as f64;
        }
        f64::dispatch(HalfRates { initial, axes, rotations, rates });
        let exact = Time::from_seconds(time);
        let (mut precession, mut spin) = ([0; BLOCK], [0; BLOCK]);
        for place in 0..count {
            let phase = |first: usize| {
                let (fraction, negative) = fraction_from_turns(rates[first][place], rates[first + 1][place]);
                let exponent = frames[place].rate_exponent + HEADROOM;
                phase_at(0, Rate { fraction, exponent, negative }, exact)
            };
            (precession[place], spin[place]) = (phase(0), phase(2));
        }
        let half_angles = [TurnsBlock::new(&precession), TurnsBlock::new(&spin)];
        let start = wants_start.then_some(start);
        f64::dispatch(Evaluation { initial, frames, axes, half_angles: &half_angles, end, start });
    }
}

impl Formed for PrecessionBlock {
    fn columns(&self) -> [&UserColumns; 2] {
        [&self.end, &self.start]
    }
}

/// In each lane, the number of the three that belongs to the axis.
#[inline(always)]
fn along<R: Real>(axis: R, [first, second, third]: [DoubleDouble<R>; 3]) -> DoubleDouble<R> {
    let later = DoubleDouble::select(axis.less_than(R::splat(1.5)), second, third);
    DoubleDouble::select(axis.less_than(R::splat(0.5)), first, later)
}

/// Forms the rates of half the angles.
struct HalfRates<'a> {
    initial: &'a InitialBlock,
    axes: &'a [f64; BLOCK],
    rotations: Rotations,
    rates: &'a mut [[f64; BLOCK]; 4],
}

impl LaneTask<f64> for HalfRates<'_> {
    type Output = ();

    #[inline(always)]
    fn run<R: Real<Scalar = f64>>(self) {
        if self.rotations == Rotations::None {
            *self.rates = [[0.0; BLOCK]; 4];
            return;
        }
        let zero = DoubleDouble::<R>::splat(0.0, 0.0);
        for offset in (0..BLOCK).step_by(R::LANES) {
            let initial = self.initial.load::<R>(offset);
            let axis = R::load(&self.axes[offset..]);
            let [mx, my, mz] = initial.angular_momentum();
            let length = (mx.squared() + my.squared() + mz.squared()).sqrt();
            let (one, [ix, iy, iz]) = (DoubleDouble::<R>::splat(1.0, 0.0), initial.moments);
            let [x, y, z] = [one / ix, one / iy, one / iz];
            let own = along(axis, [x, y, z]);
            let (across, spin) = match self.rotations {
                Rotations::None | Rotations::Precession => (own, zero),
                Rotations::PrecessionAndSpin => {
                    let across = along(axis, [y + z, z + x, x + y]).scaled(0.5);
                    (across, (own - across) * along(axis, [mx, my, mz]))
                }
            };
            for (number, radians) in [length * across, spin].into_iter().enumerate() {
                let half_turns = DoubleDouble::splat(HALF_TURNS.0, HALF_TURNS.1);
                let turns = (radians * half_turns).scaled(power_of_two(-HEADROOM));
                turns.high.store(&mut self.rates[2 * number][offset..]);
                turns.low.store(&mut self.rates[2 * number + 1][offset..]);
            }
        }
    }
}

/// Rotates the bodies, and transforms them to the user's axes and units.
struct Evaluation<'a> {
    initial: &'a InitialBlock,
    frames: &'a [BodyFrame; BLOCK],
    axes: &'a [f64; BLOCK],
    /// Half angles of the precession and of the spin.
    half_angles: &'a [TurnsBlock<f64>; 2],
    end: &'a mut UserColumns,
    start: Option<&'a mut UserColumns>,
}

impl LaneTask<f64> for Evaluation<'_> {
    type Output = ();

    #[inline(always)]
    fn run<R: Real<Scalar = f64>>(mut self) {
        let (zero, one) = (R::splat(0.0), R::splat(1.0));
        for offset in (0..BLOCK).step_by(R::LANES) {
            let frames = UserAxes::<R>::new(|lane| &self.frames[offset + lane]);
            if let Some(start) = &mut self.start {
                let (q, m) = self.initial.state::<R>(offset);
                start.store(offset, frames.components(q, m));
            }
            let initial = self.initial.load::<R>(offset);
            let [x, y, z] = initial.angular_momentum();
            let m = Vector::new(x.high + x.low, y.high + y.low, z.high + z.low);
            let length = m.dot(m).sqrt();
            let turns = zero.less_than(length);
            let inverse = one / R::select(turns, length, one);
            let axis = R::load(&self.axes[offset..]);
            let (is_first, is_third) = (axis.less_than(R::splat(0.5)), R::splat(1.5).less_than(axis));
            let (first, third) = (R::select(is_first, one, zero), R::select(is_third, one, zero));
            let precession = turned(m * inverse, self.half_angles[0].load(offset));
            let spin = turned(Vector::new(first, one - first - third, third), self.half_angles[1].load(offset));
            let q = initial.orientation.product(precession).product(spin);
            self.end.store(offset, frames.components(q, spin.rotate_inverse(m)));
        }
    }
}

/// The rotation about a unit vector by twice a half angle.
#[inline(always)]
fn turned<R: Real>(axis: Vector<R>, half_angle: Turns<R>) -> Quaternion<R> {
    let (sin, cos) = sin_cos_turns(half_angle);
    Quaternion::new(axis.x * sin, axis.y * sin, axis.z * sin, cos)
}
