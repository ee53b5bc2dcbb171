//! The problems on which methods are compared, with their true solutions.

use crate::bodies::BodyState;
use crate::bodies::Ensemble;
use crate::bodies::Status;
use crate::bodies::frame::attitude_error;
use crate::engine::batch::prepare_with;
use crate::engine::{End, Engine, unobserved};
use crate::error::Result;
use crate::kernel::free_motion::FreeMotion;
use crate::kernel::method::Method;
use crate::math::Precision;
use crate::math::Quantiles;
use crate::math::parallel;
use crate::scene::Scene;
use crate::study::problem;
use crate::torque::Torque;

/// The seed that selects the bodies; fixed, so that figures from all machines are for the same bodies.
pub const SEED: u64 = 1;

/// Bodies under torques over a span.
#[derive(Clone, Debug)]
pub struct Problem {
    /// The name in rows and on the command line.
    pub name: &'static str,
    /// Simulated time, s.
    pub span: f64,
    /// The bodies.
    pub ensemble: Ensemble,
    /// The torques.
    pub torques: Vec<Torque>,
}

/// Names of all problems.
pub const NAMES: [&str; 7] = ["free", "separatrix", "forced", "heavy-top", "gravity-gradient", "drag", "driven"];

impl Problem {
    /// One of [`NAMES`] with `bodies` bodies ([`crate::study::problem`] describes them); `None` for any other name.
    ///
    /// # Errors
    ///
    /// [`crate::Error::TooManyBodies`] where the memory does not suffice.
    pub fn named(name: &str, bodies: usize) -> Result<Option<Self>> {
        let Some(name) = NAMES.into_iter().find(|known| *known == name) else { return Ok(None) };
        let one = |(ensemble, torque): (Ensemble, Torque)| (ensemble, vec![torque]);
        let (ensemble, torques) = match name {
            "free" => (problem::free(bodies, SEED)?, Vec::new()),
            "separatrix" => (problem::separatrix(bodies, SEED)?, Vec::new()),
            "forced" => problem::forced(bodies, SEED).map(|(ensemble, torques)| (ensemble, torques.to_vec()))?,
            "heavy-top" => one(problem::heavy_top(bodies, SEED)?),
            "gravity-gradient" => one(problem::gravity_gradient(bodies, SEED)?),
            "drag" => one(problem::drag(bodies, SEED)?),
            _ => one(problem::driven(bodies, SEED)?),
        };
        let span = if name == "separatrix" { problem::SEPARATRIX_SPAN } else { problem::FREE_SPAN };
        Ok(Some(Self { name, span, ensemble, torques }))
    }

    /// The same over a span `factor` times as long.
    pub fn longer(self, factor: u32) -> Self {
        Self { span: self.span * f64::from(factor), ..self }
    }

    /// The scene without a method or an error asked for.
    pub fn scene(&self) -> Scene {
        let scene = Scene::new(self.ensemble.clone()).until(self.span);
        self.torques.iter().cloned().fold(scene, Scene::torque)
    }

    /// The states at the end of the span after so many equal steps in a second, on the CPU in `f64`.
    fn stepped(&self, method: Method, steps: u64) -> Result<Vec<BodyState>> {
        let steps = (self.span * steps as f64).ceil() as u64;
        let (frames, batch) = prepare_with(&self.ensemble, &self.torques, self.span, Precision::F64)?;
        let mut session = Engine::cpu().start(batch, method)?;
        session.advance_to(End::of_steps(self.span / steps as f64, steps), &mut unobserved)?;
        let words = session.read(0..frames.len())?;
        Ok(frames.iter().enumerate().map(|(body, frame)| frame.body_state(words.combined(body))).collect())
    }
}

/// The states at the end of a problem, as well as they are known.
#[derive(Clone, Debug)]
pub struct Truth {
    states: Vec<BodyState>,
    /// How far the truth may be from the real one: attitude, rad.
    pub uncertainty: Quantiles,
    /// Its source.
    pub source: &'static str,
}

/// Number of steps of the reference in a second: `rk8` then has a truncation error below 1e-15 rad over 10 s in the 99th percentile of every
/// problem with torques (2e-8 rad at 10 steps, order 8).
const REFERENCE_STEPS: u64 = 200;

/// Those of the method that checks the reference.
const CHECK_STEPS: u64 = 400;

/// The greatest attitude error of the closed form against golden data of 25 digits, rad, over the spans used here
/// (`tests/truth/golden_free_motion.rs`).
const CLOSED_FORM_ERROR: f64 = 1e-13;

impl Truth {
    /// The truth of a problem: the closed form in `f64` if no torque acts; otherwise `rk8` in `f64` at a step of 1/200 s,
    /// whose distance from `splitting6` at half that step is its uncertainty. The two share neither stages nor
    /// invariants.
    ///
    /// # Errors
    ///
    /// As [`Engine::start`].
    pub fn of(problem: &Problem) -> Result<Self> {
        if problem.torques.is_empty() {
            let state = |body| FreeMotion::of_body(&problem.ensemble, body).at(problem.span);
            let states = parallel::rows(problem.ensemble.len(), 1, &state);
            let error = CLOSED_FORM_ERROR;
            return Ok(Self {
                states,
                uncertainty: Quantiles { median: error, p99: error, max: error },
                source: "closed form",
            });
        }
        let states = problem.stepped(Method::Rk8, REFERENCE_STEPS)?;
        let check = problem.stepped(Method::Splitting6, CHECK_STEPS)?;
        Ok(Self { uncertainty: distances(&states, &check), states, source: "rk8, checked by splitting6" })
    }

    /// The errors of `states`, or of the first of them where there are more than the truth has.
    pub fn errors(&self, states: &[BodyState]) -> Errors {
        let states = &states[..states.len().min(self.states.len())];
        let relative = |change: f64, scale: f64| if scale > 0.0 { change / scale } else { change };
        let (mut attitude, mut energy, mut momentum) = (Vec::new(), Vec::new(), Vec::new());
        for (state, truth) in states.iter().zip(&self.states) {
            let finite = state.orientation.is_finite() && state.angular_velocity_body.is_finite();
            if !finite || state.status != Status::Valid {
                continue;
            }
            attitude.push(attitude_error(state, truth));
            energy.push(relative((state.kinetic_energy - truth.kinetic_energy).abs(), truth.kinetic_energy));
            let change = (state.angular_momentum_world - truth.angular_momentum_world).length();
            momentum.push(relative(change, truth.angular_momentum_world.length()));
        }
        // If no body is left, the errors are not known.
        let quantiles = |values: &mut [f64]| if values.is_empty() { Quantiles::UNKNOWN } else { Quantiles::of(values) };
        Errors {
            failed: states.len() - attitude.len(),
            attitude: quantiles(&mut attitude),
            kinetic_energy: quantiles(&mut energy),
            angular_momentum_world: quantiles(&mut momentum),
        }
    }
}

/// The angles, rad, between the attitudes of two runs of the same bodies.
pub(super) fn distances(states: &[BodyState], others: &[BodyState]) -> Quantiles {
    // A state that is NaN counts as being at the greatest distance.
    let known = |angle: f64| if angle.is_nan() { std::f64::consts::PI } else { angle };
    let mut angles: Vec<f64> = states.iter().zip(others).map(|(a, b)| known(attitude_error(a, b))).collect();
    Quantiles::of(&mut angles)
}

/// Errors at the end, over the bodies that did not fail.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Errors {
    /// Bodies whose state is not finite, or for which a step reported failure.
    pub failed: usize,
    /// Attitude error, rad.
    pub attitude: Quantiles,
    /// Relative error of the rotational kinetic energy; for free bodies its drift.
    pub kinetic_energy: Quantiles,
    /// Error of the angular momentum in world axes, relative to its magnitude; for free bodies its drift.
    pub angular_momentum_world: Quantiles,
}
