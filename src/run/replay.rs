//! One body of a plan, computed alone and more accurately.

use std::fmt;
use std::ops::ControlFlow;

use crate::bodies::frame::attitude_error;
use crate::engine::{Backend, Engine, Progress};
use crate::error::{Error, Result};
use crate::kernel::method::Method;
use crate::math::Precision;
use crate::plan::{Plan, TorqueSet, Treatment};
use crate::record::{OutputState, Sink, Statistics};
use crate::run::run_into;
use crate::scene::{Accuracy, AdaptiveSteps, Outputs, Scene};
use crate::torque::Torque;
use crate::torque::force::Force;

/// The tolerance of a replay's steps, and that of the coarser ones from which its own error follows.
const TOLERANCES: [f64; 2] = [1e-14, 1e-12];

/// The attitude error, rad, required of a torque-free body's closed form.
const CLOSED_FORM: f64 = 2e-14;

/// The equal steps of a replay, as fractions of the run's, and the coarser ones.
const PARTS: [f64; 2] = [0.125, 0.25];

/// The motion of one body, computed alone on the CPU in `f64`, more accurately than in its run.
///
/// Torque-free bodies follow their closed form; others take adaptive steps of `rk8` at a tolerance of 1e-14, or of
/// Taylor series if the centre of mass is part of the motion, or, if a force turns with the body, equal steps of an
/// eighth of the run's. A random torque is drawn for the run's own steps, which `rk8` then takes; outputs are then only
/// at the run's output times.
#[derive(Clone, Debug)]
pub struct Replay {
    /// Index of the body, in the whole scene if the plan's is a part of one.
    pub body: usize,
    /// How it was computed.
    pub how: How,
    /// Times, s, increasing, with the state at each.
    pub track: Vec<(f64, OutputState)>,
    /// The distance of the track's end from that of a coarser computation: about the replay's own error, or more.
    /// `None` for a body under a random torque, whose steps cannot be chosen.
    pub own_error: Option<StateError>,
}

#[cfg(feature = "study")]
impl Replay {
    /// The track as comma-separated values, with the columns of a run's `snapshots.csv`.
    pub fn to_csv(&self) -> Vec<u8> {
        crate::record::csv_file::track(self.body, &self.track)
    }

    /// Writes [`Replay::to_csv`] to a file, which appears at once as a whole and replaces any of its name.
    ///
    /// # Errors
    ///
    /// [`Error::File`].
    pub fn write(&self, path: &std::path::Path) -> Result<()> {
        crate::record::folder::write_whole(path, &self.to_csv())
    }
}

/// How a body is computed alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum How {
    /// By the closed form of torque-free motion.
    ClosedForm,
    /// By `rk8` in adaptive steps.
    Adaptive {
        /// The tolerance.
        tolerance: f64,
    },
    /// By Taylor series of the rotation and the centre of mass together.
    Series {
        /// The tolerance.
        tolerance: f64,
    },
    /// By `rk8` in equal steps.
    Equal {
        /// The longest step, s.
        longest_step: f64,
    },
}

impl fmt::Display for How {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            How::ClosedForm => formatter.write_str("closed form"),
            How::Adaptive { tolerance } => write!(formatter, "rk8 in adaptive steps, tolerance {tolerance:e}"),
            How::Series { tolerance } => write!(formatter, "Taylor series, tolerance {tolerance:e}"),
            How::Equal { longest_step } => write!(formatter, "rk8 in equal steps of {longest_step:?} s at most"),
        }
    }
}

/// The difference between two states of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "study", derive(serde::Serialize))]
pub struct StateError {
    /// Angle between the orientations, rad.
    pub attitude: f64,
    /// Of the angular velocities in body axes, relative to the second one's magnitude; absolute, rad/s, where that is 0.
    pub angular_velocity: f64,
    /// Of the rotational kinetic energy, relative to the second one; absolute, J, where that is 0.
    pub kinetic_energy: f64,
    /// Of the positions of the centre of mass, m, if there are any.
    pub position: Option<f64>,
    /// Of their velocities, m/s.
    pub velocity: Option<f64>,
}

impl StateError {
    /// The difference of `state` from `reference`; NaN where one of them is NaN.
    pub fn between(state: &OutputState, reference: &OutputState) -> Self {
        let relative = |change: f64, scale: f64| if scale > 0.0 { change / scale } else { change };
        let (own, other) = (&state.rotation, &reference.rotation);
        let rate = (own.angular_velocity_body - other.angular_velocity_body).length();
        let centres = state.translation.zip(reference.translation);
        Self {
            attitude: attitude_error(own, other),
            angular_velocity: relative(rate, other.angular_velocity_body.length()),
            kinetic_energy: relative((own.kinetic_energy - other.kinetic_energy).abs(), other.kinetic_energy),
            position: centres.map(|(own, other)| own.0.distance(other.0)),
            velocity: centres.map(|(own, other)| own.1.distance(other.1)),
        }
    }
}

impl fmt::Display for StateError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { attitude, angular_velocity, kinetic_energy, position, velocity } = self;
        write!(formatter, "attitude {attitude:.1e} rad, angular velocity {angular_velocity:.1e}")?;
        // A table need not have the energy.
        if !kinetic_energy.is_nan() {
            write!(formatter, ", energy {kinetic_energy:.1e}")?;
        }
        if let (Some(position), Some(velocity)) = (position, velocity) {
            write!(formatter, ", position {position:.1e} m, velocity {velocity:.1e} m/s")?;
        }
        Ok(())
    }
}

/// Computes a body of a plan's scene alone, at the plan's output times and at `samples` times that divide the span into
/// equal parts, including its start and end. `body` is its index in the plan's scene.
///
/// ```
/// use glam::{DQuat, DVec3};
/// use polhode::run::{StateError, replay};
/// use polhode::{Accuracy, Engine, Ensemble, Plan, Scene, Torque};
///
/// let bodies = |body: usize| (DVec3::new(1.0, 2.0, 2.5), DQuat::IDENTITY, DVec3::new(0.1, 1.0 + body as f64, 0.0));
/// let scene = Scene::new(Ensemble::from_fn(100, bodies)?)
///     .torque(Torque::linear_drag(0.1))
///     .until(60.0)
///     .accuracy(Accuracy::attitude(1e-6));
/// let engine = Engine::cpu();
/// let plan = Plan::new(&scene, &engine)?;
/// let replay = replay(&plan, 17, 1000)?;
/// let alone = polhode::run::alone(&engine, &plan, 17)?;
/// let error = StateError::between(&alone[0].1, &replay.track[999].1);
/// assert!(error.attitude < 1e-5 && replay.own_error.is_some_and(|own| own.attitude < 1e-9));
/// # Ok::<(), polhode::Error>(())
/// ```
///
/// # Errors
///
/// [`Error::Setting`] where there is no such body; what [`Plan::new`] and [`run_into`] return.
pub fn replay(plan: &Plan<'_>, body: usize, samples: usize) -> Result<Replay> {
    replay_until(plan, body, samples, plan.scene().end())
}

/// As [`replay`], up to `end`, s, such as the time at which an event has stopped the body
/// ([`OutputState::stopped_at`]). A body under a random torque, whose stop is known only to an output, is followed to
/// the end of the plan all the same.
pub fn replay_until(plan: &Plan<'_>, body: usize, samples: usize, end: f64) -> Result<Replay> {
    let scene = only(plan, body)?.unobserved();
    let engine = Engine::cpu();
    let is_free = TorqueSet::acting_on(scene.torques(), 0).is_empty();
    let draws = !is_free && scene.torques().iter().any(Torque::is_random);
    let scene = if draws { scene } else { scene.until(end).outputs(Outputs::Times(times(plan, samples, end))) };
    let states = |how: How| -> Result<Vec<(f64, OutputState)>> {
        let scene = match how {
            How::ClosedForm => scene.clone().skipping(true).accuracy(Accuracy::attitude(CLOSED_FORM)),
            How::Adaptive { tolerance } => {
                scene.clone().adaptive(AdaptiveSteps { tolerance, least_step: None }, Some(Precision::F64))
            }
            How::Series { tolerance } => scene.clone().taylor(AdaptiveSteps { tolerance, least_step: None }),
            How::Equal { longest_step } => scene.clone().pinned(Method::Rk8, longest_step, Some(Precision::F64)),
        };
        let scene = scene.precision(Some(Precision::F64));
        collected(&engine, &Plan::new(&scene, &engine)?)
    };
    let longest_step = longest_step_of(plan, body);
    let turning = scene.forces().iter().any(Force::needs_attitude);
    let [fine, coarse] = [0, 1].map(|which: usize| {
        if is_free {
            How::ClosedForm
        } else if draws {
            How::Equal { longest_step }
        } else if scene.coupling().is_some() {
            How::Series { tolerance: TOLERANCES[which] }
        } else if turning {
            How::Equal { longest_step: longest_step * PARTS[which] }
        } else {
            How::Adaptive { tolerance: TOLERANCES[which] }
        }
    });
    let track = states(fine)?;
    let own_error = match (draws, is_free, track.last()) {
        (true, ..) | (.., None) => None,
        // Its error is that of rounding.
        (_, true, Some(_)) => Some(StateError {
            attitude: CLOSED_FORM,
            angular_velocity: CLOSED_FORM,
            kinetic_energy: CLOSED_FORM,
            position: None,
            velocity: None,
        }),
        (_, _, Some((_, end))) => states(coarse)?.last().map(|(_, coarse)| StateError::between(coarse, end)),
    };
    Ok(Replay { body: plan.scene().part().first_body + body, how: fine, track, own_error })
}

/// A body of a plan's scene, computed alone as in the run: it has, bit for bit, the states of the whole run on this
/// engine at the output times, including those after an event has stopped it.
///
/// # Errors
///
/// As [`replay`].
pub fn alone(engine: &dyn Backend, plan: &Plan<'_>, body: usize) -> Result<Vec<(f64, OutputState)>> {
    let scene = only(plan, body)?.only_stopping();
    collected(engine, &plan.of_part(&scene, engine)?)
}

/// The scene with one body alone.
fn only(plan: &Plan<'_>, body: usize) -> Result<Scene> {
    let scene = plan.scene();
    if body >= scene.ensemble().len() {
        let expected = "expected the index of one of the bodies, from 0";
        return Err(Error::Setting { field: "body", value: body as f64, expected });
    }
    Ok(scene.only(body..body + 1))
}

/// Output times, with samples between them.
fn times(plan: &Plan<'_>, samples: usize, end: f64) -> Vec<f64> {
    let parts = samples.saturating_sub(1).max(1) as f64;
    let sampled = (0..samples).map(|sample| end * (sample as f64 / parts));
    let of_plan = plan.times().iter().copied().take_while(|&time| time < end);
    let mut times: Vec<f64> = sampled.chain(of_plan).chain([end]).collect();
    times.sort_by(f64::total_cmp);
    times.dedup();
    times
}

/// The longest equal step of a body, s, or that of the plan if it takes none.
fn longest_step_of(plan: &Plan<'_>, body: usize) -> f64 {
    let own = plan.groups().iter().find(|group| !group.members.rows(body..body + 1).is_empty());
    match own.map(|group| group.treatment) {
        Some(Treatment::Stepped { longest_step, .. }) => longest_step,
        _ => plan.longest_step(),
    }
}

/// Keeps the states of a body.
#[derive(Default)]
struct Track(Vec<(f64, OutputState)>);

impl Sink for Track {
    fn wants(&mut self, _: usize, _: usize, _: f64) -> bool {
        true
    }

    fn bodies(&mut self, _: usize, time: f64, _: usize, states: &[OutputState]) -> Result<()> {
        self.0.extend(states.iter().map(|&state| (time, state)));
        Ok(())
    }

    fn statistics(&mut self, _: usize, _: &Statistics) -> Result<()> {
        Ok(())
    }
}

/// The states of a plan of one body.
fn collected(engine: &dyn Backend, plan: &Plan<'_>) -> Result<Vec<(f64, OutputState)>> {
    let mut track = Track::default();
    run_into(engine, plan, &mut track, &mut |_: Progress| ControlFlow::Continue(()))?;
    Ok(track.0)
}
