//! The torque-free motion of one body as a value.

use glam::{DQuat, DVec3};

use crate::batch::{BodyFrame, BodyState};
use crate::double_double::DoubleDouble;
use crate::elementary::power_of_two;
use crate::ensemble::Ensemble;
use crate::error::Result;
use crate::free_motion::evaluation::{Instant, Row, evaluate};
use crate::free_motion::frame::scaled_body;
use crate::free_motion::setup::{Constants, Theory, separatrix_row, set_up};
use crate::inertia::InertiaTensor;
use crate::phase::{Rate, Time, fraction_from_turns, phase_at, phase_from_turns, phase_turns};

/// Binary places by which rates are held below one turn per unit of time; the unit is 2^−r s with the largest
/// component of ω in [1, 2) · 2^r rad/s, and no rate exceeds half a turn in it.
pub(crate) const HEADROOM: i32 = 3;

/// The torque-free motion of one body.
#[derive(Clone, Debug)]
pub struct FreeMotion {
    frame: BodyFrame,
    row: Row<f64>,
    phases: Phases,
    theory: Theory<f64>,
    separatrix: bool,
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
        let (frame, initial) = scaled_body(
            &ensemble.inertia()[body],
            ensemble.orientation()[body],
            ensemble.angular_velocity_body()[body],
        );
        let mut constants = set_up(&initial);
        if constants.separatrix {
            separatrix_row(&mut constants, initial.orientation);
        }
        Self {
            frame,
            row: constants.row,
            phases: Phases::new(&constants, frame.rate_exponent),
            theory: constants.theory,
            separatrix: constants.separatrix,
        }
    }

    /// The state at `time` seconds after the initial one; negative times lie before it.
    pub fn at(&self, time: f64) -> BodyState {
        let exact = Time::from_seconds(time);
        let instant = Instant {
            polhode: phase_turns(phase_at(self.phases.polhode_start, self.phases.polhode_rate, exact)),
            precession: phase_turns(phase_at(0, self.phases.precession_rate, exact)),
            time: exact.scaled(self.frame.rate_exponent),
        };
        let state = evaluate(&self.row, &instant);
        let (q, m) = (state.orientation, state.angular_momentum_principal);
        self.frame.body_state([q.x, q.y, q.z, q.w, m.x, m.y, m.z])
    }
}
