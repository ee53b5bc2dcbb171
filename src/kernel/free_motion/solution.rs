//! The torque-free motion of one body as a value.

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};

use crate::bodies::Ensemble;
use crate::bodies::columns::STATE_COMPONENTS;
use crate::bodies::frame::initial_state;
use crate::bodies::inertia::InertiaTensor;
use crate::bodies::{BodyFrame, BodyState};
use crate::error::Result;
use crate::kernel::free_motion::evaluation::{Instant, OFFSET, Row, SLOPE, evaluate};
use crate::kernel::free_motion::frame::scaled_body;
use crate::kernel::free_motion::setup::{Constants, SetUp, Theory, separatrix_row, set_up};
use crate::math::double_double::DoubleDouble;
use crate::math::elementary::power_of_two;
use crate::math::phase::{Rate, Time, fraction_from_turns, phase_at, phase_from_turns, phase_turns};
use crate::math::power_of_two::scaled_by_power_of_two;

/// Number of binary places by which rates are kept below one turn per unit of time; the unit is 2^−r s with the largest
/// component of ω in [1, 2) · 2^r rad/s, and no rate exceeds half a turn in it.
pub(crate) const HEADROOM: i32 = 3;

/// The torque-free motion of one body: its state at any time, and what characterises the motion.
///
/// ```
/// use glam::{DQuat, DVec3};
/// use polhode::kernel::free_motion::{FreeMotion, Polhode};
///
/// // Next to the middle axis: the wing nut's flip.
/// let motion = FreeMotion::new(DVec3::new(1.0, 2.0, 3.0), DQuat::IDENTITY, DVec3::new(1e-3, 5.0, 0.0))?;
/// assert_eq!(motion.polhode(), Polhode::AboutFirst);
/// let period = motion.nutation_period().unwrap();
/// let flip = motion.flips(0.0, period).next().unwrap();
/// assert!(motion.at(flip - 1.0).angular_velocity_body.y > 0.0);
/// assert!(motion.at(flip + 1.0).angular_velocity_body.y < 0.0);
/// # Ok::<(), polhode::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct FreeMotion {
    frame: BodyFrame,
    row: Row<f64>,
    phases: Phases,
    theory: Theory<f64>,
    separatrix: bool,
    /// Rate of v, turns per second.
    polhode_rate: f64,
    /// Rate of μ t, turns per second.
    precession_rate: f64,
    /// v at the start, turns.
    polhode_start: f64,
    initial: BodyState,
}

/// The curve that the angular momentum draws in the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Polhode {
    /// A point: the body turns steadily about one axis, or is at rest.
    Point,
    /// A closed curve around the axis of the least moment.
    AboutFirst,
    /// A closed curve around the axis of the greatest moment.
    AboutThird,
    /// The separatrix: from one end of the middle axis to the other, once.
    Separatrix,
}

/// The integers of a row: two rates and a phase at the start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Phases {
    pub polhode_rate: Rate,
    pub polhode_start: u64,
    pub precession_rate: Rate,
}

impl Phases {
    /// The integers of a set-up, for rates in units of 2^`rate_exponent` per second.
    pub fn new(constants: &Constants<f64>, rate_exponent: i32) -> Self {
        Self::from_turns(constants.polhode_rate, constants.precession_rate, constants.polhode_start, rate_exponent)
    }

    /// The integers of two rates, turns per 2^−`rate_exponent` s, and a phase in turns.
    pub fn from_turns(
        polhode_rate: DoubleDouble,
        precession_rate: DoubleDouble,
        polhode_start: DoubleDouble,
        rate_exponent: i32,
    ) -> Self {
        let rate = |turns: DoubleDouble| {
            let scale = power_of_two(-HEADROOM);
            let (fraction, negative) = fraction_from_turns(turns.high * scale, turns.low * scale);
            Rate { fraction, exponent: rate_exponent + HEADROOM, negative }
        };
        Self {
            polhode_rate: rate(polhode_rate),
            polhode_start: phase_from_turns(polhode_start.high, polhode_start.low),
            precession_rate: rate(precession_rate),
        }
    }
}

impl FreeMotion {
    /// The motion of a body.
    ///
    /// # Errors
    ///
    /// As [`Ensemble::from_columns`].
    pub fn new(inertia: impl Into<InertiaTensor>, orientation: DQuat, angular_velocity_body: DVec3) -> Result<Self> {
        let ensemble = Ensemble::from_columns(&[inertia.into()], &[orientation], &[angular_velocity_body])?;
        Ok(Self::of_body(&ensemble, 0))
    }

    /// The motion of one body of an ensemble.
    ///
    /// # Panics
    ///
    /// Where the ensemble has no such body.
    pub fn of_body(ensemble: &Ensemble, body: usize) -> Self {
        let (frame, initial) = scaled_body(ensemble, body, SetUp::TwoWords);
        let mut constants = set_up::<_, DoubleDouble<f64>>(&initial);
        if constants.separatrix {
            separatrix_row(&mut constants, initial.orientation);
        }
        let per_second = |turns: DoubleDouble| scaled_by_power_of_two(turns.to_f64(), frame.rate_exponent);
        Self {
            frame,
            row: constants.row,
            phases: Phases::new(&constants, frame.rate_exponent),
            theory: constants.theory,
            separatrix: constants.separatrix,
            polhode_rate: per_second(constants.polhode_rate),
            precession_rate: per_second(constants.precession_rate),
            polhode_start: constants.polhode_start.to_f64(),
            initial: initial_state(ensemble, body),
        }
    }

    /// The state at `time` seconds after the initial one; negative times lie before it.
    ///
    /// At 0 it is the initial state itself. If `time` is not finite, every component is NaN.
    pub fn at(&self, time: f64) -> BodyState {
        if time == 0.0 {
            return self.initial;
        }
        if !time.is_finite() {
            return self.frame.body_state([f64::NAN; STATE_COMPONENTS]);
        }
        self.at_exactly(Time::from_seconds(time))
    }

    /// The state at a time that need not be an `f64`, such as a step of a grid ([`Time::of_step`]).
    pub fn at_exactly(&self, time: Time) -> BodyState {
        let instant = Instant {
            polhode: phase_turns(phase_at(self.phases.polhode_start, self.phases.polhode_rate, time)),
            precession: phase_turns(phase_at(0, self.phases.precession_rate, time)),
            time: time.scaled(self.frame.rate_exponent),
        };
        let state = evaluate(&self.row, &instant);
        let (q, m) = (state.orientation, state.angular_momentum_principal);
        self.frame.body_state([q.x, q.y, q.z, q.w, m.x, m.y, m.z])
    }

    /// The curve that the angular momentum draws in the body.
    pub fn polhode(&self) -> Polhode {
        let still = self.theory.steady > 0.0 || self.theory.amplitudes.x == 0.0 || self.theory.lambda == 0.0;
        if still {
            Polhode::Point
        } else if self.separatrix {
            Polhode::Separatrix
        } else if self.theory.sense > 0.0 {
            Polhode::AboutThird
        } else {
            Polhode::AboutFirst
        }
    }

    /// The elliptic modulus k in [0, 1]: 0 for symmetric bodies and steady rotations, 1 on the separatrix.
    pub fn modulus(&self) -> f64 {
        match self.polhode() {
            Polhode::Point => 0.0,
            Polhode::Separatrix => 1.0,
            _ => self.theory.modulus_squared.sqrt(),
        }
    }

    /// The complementary modulus k′ in [0, 1], which keeps its digits when k is close to 1.
    pub fn complementary_modulus(&self) -> f64 {
        match self.polhode() {
            Polhode::Point => 1.0,
            Polhode::Separatrix => 0.0,
            _ => self.theory.complement_squared.sqrt(),
        }
    }

    /// The time after which the angular momentum returns to the same place in the body, 4K/λ, s; `None` if it never leaves it or never
    /// returns.
    pub fn polhode_period(&self) -> Option<f64> {
        match self.polhode() {
            Polhode::AboutFirst | Polhode::AboutThird => Some(1.0 / self.polhode_rate),
            Polhode::Point | Polhode::Separatrix => None,
        }
    }

    /// The period of the angle between the axis of circulation and the angular momentum, 2K/λ, s; `None` if that angle is constant (as in
    /// symmetric bodies) or takes each value only once.
    ///
    /// It is also the time between two flips of a spin about the middle axis ([`FreeMotion::flips`]).
    pub fn nutation_period(&self) -> Option<f64> {
        if self.theory.modulus_squared == 0.0 { None } else { self.polhode_period().map(|period| 0.5 * period) }
    }

    /// The mean rate at which the body precesses about its angular momentum, 2μ + sν, rad/s; the spin rate if the rotation is steady.
    pub fn mean_precession_rate(&self) -> f64 {
        let relative = match self.polhode() {
            Polhode::Point => 0.0,
            _ => self.theory.sense * self.polhode_rate,
        };
        TAU * (2.0 * self.precession_rate + relative)
    }

    /// The times from `start` to `end`, s, at which the spin about the middle axis changes sign, in order.
    ///
    /// If ω starts near the middle axis this is the flip of the wing nut (V. A. Dzhanibekov 1985): v passes a multiple of π every 2K/λ; on
    /// the separatrix this happens once, and in a steady rotation never.
    pub fn flips(&self, start: f64, end: f64) -> impl Iterator<Item = f64> + use<> {
        let (first, count, period, offset) = match self.polhode() {
            Polhode::Point => (0, 0, 0.0, 0.0),
            Polhode::Separatrix => {
                let unit = scaled_by_power_of_two(1.0, -self.frame.rate_exponent);
                let time = -self.row.shape[OFFSET] / self.row.shape[SLOPE] * unit;
                (0, i64::from(start <= time && time <= end), 0.0, time)
            }
            Polhode::AboutFirst | Polhode::AboutThird => {
                let period = 0.5 / self.polhode_rate;
                let offset = -self.polhode_start / self.polhode_rate;
                let first = ((start - offset) / period).ceil() as i64;
                let last = ((end - offset) / period).floor() as i64;
                (first, last.saturating_sub(first).saturating_add(1).max(0), period, offset)
            }
        };
        (0..count).map(move |index| offset + (first + index) as f64 * period)
    }
}
