//! What is to be simulated: an ensemble, a span, output times and how accurately.

use std::fmt;
use std::ops::Range;
use std::sync::Arc;

use glam::DVec3;

use crate::bodies::Ensemble;
use crate::kernel::method::Method;
use crate::math::Precision;
use crate::torque::Torque;
use crate::torque::coupled::{carrier, coupled, is_carrier};
use crate::torque::force::Force;
use crate::torque::translated::translated;

mod adaptive_steps;
mod event;
mod histogram;
mod observed;
mod quantity;
mod quantity_evaluator;
mod statistical_accuracy;

pub use adaptive_steps::AdaptiveSteps;
pub use event::{Condition, Event};
pub use histogram::{Histogram, MOST_BINS};
pub use observed::MOST_CELLS;
pub(crate) use observed::Observed;
pub use quantity::{FormulaQuantity, OwnStateQuantity, Quantity, TorqueEnergyQuantity};
pub(crate) use quantity::{PARAMETERS, is_of_state};
pub(crate) use quantity_evaluator::QuantityEvaluator;
pub use statistical_accuracy::{StatisticalAccuracy, StatisticalTarget};

/// An ensemble, the torques and forces on it, and what is asked of it.
///
/// ```
/// use glam::{DQuat, DVec3};
/// use polhode::{Accuracy, Ensemble, Scene};
///
/// let ensemble = Ensemble::from_columns(
///     &[DVec3::new(1.0, 2.0, 2.5)],
///     &[DQuat::IDENTITY],
///     &[DVec3::new(0.1, 2.0, 0.1)],
/// )?;
/// let scene = Scene::new(ensemble).until(60.0).accuracy(Accuracy::attitude(1e-6));
/// assert_eq!(scene.end(), 60.0);
/// # Ok::<(), polhode::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    ensemble: Arc<Ensemble>,
    part: Part,
    end: f64,
    outputs: Outputs,
    /// The time between two checks for events, s, beside those at outputs.
    checks: Option<f64>,
    /// As the caller set it; otherwise it follows from what is asked for ([`Scene::stepping`]).
    stepping: Option<Stepping>,
    statistical: Option<StatisticalAccuracy>,
    precision: Option<Precision>,
    forces: Vec<Force>,
    skipping: bool,
    torques: Vec<Torque>,
    /// The original torques that depend on a position or velocity, by their indices. In `torques` they are replaced by functions of time,
    /// or coupled to the centre of mass.
    moving: Vec<(usize, Torque)>,
    pilot: bool,
    observed: Observed,
    states: bool,
    starts: bool,
    recomputed: Option<usize>,
}

/// The place of a scene's bodies in a larger scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// The index in the larger scene of this scene's body 0.
    pub first_body: usize,
    /// How many bodies the larger scene has.
    pub of: usize,
}

/// When the state is recorded.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Outputs {
    /// At the end only.
    #[default]
    End,
    /// At multiples of an interval, s, from the first to the end; the end itself is always recorded.
    Every(f64),
    /// At these times, s, increasing, none beyond the end; the end itself is always recorded.
    Times(Vec<f64>),
}

/// The errors asked for, each at a percentile over the bodies at the end; at least one. Where no attitude error is asked for, steps are chosen
/// by the others alone, and a simpler motion is taken for a body's own only if its attitude errs by less than the least of them, in rad.
///
/// ```
/// use polhode::Accuracy;
///
/// let both = Accuracy { energy: Some(1e-9), ..Accuracy::attitude(1e-6) };
/// assert_eq!(both.percentile, 99.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "study", derive(serde::Serialize))]
pub struct Accuracy {
    /// Attitude error, rad, in (0, π].
    pub attitude: Option<f64>,
    /// Error of the angular velocity in body axes relative to its magnitude, above 0.
    pub angular_velocity: Option<f64>,
    /// Error of the rotational kinetic energy, relative, above 0.
    pub energy: Option<f64>,
    /// The percentile, in (0, 100].
    pub percentile: f64,
}

impl Accuracy {
    /// An attitude error of `angle` rad in the 99th percentile.
    pub fn attitude(angle: f64) -> Self {
        Self { attitude: Some(angle), angular_velocity: None, energy: None, percentile: 99.0 }
    }

    /// The error asked for of one target; infinite if none is.
    pub(crate) fn of(&self, target: Target) -> f64 {
        let wanted = match target {
            Target::Attitude => self.attitude,
            Target::AngularVelocity => self.angular_velocity,
            Target::Energy => self.energy,
        };
        wanted.unwrap_or(f64::INFINITY)
    }

    /// The errors asked for, one by one.
    pub fn targets(&self) -> [(Target, Option<f64>); 3] {
        [
            (Target::Attitude, self.attitude),
            (Target::AngularVelocity, self.angular_velocity),
            (Target::Energy, self.energy),
        ]
    }

    /// The least of the errors asked for: an attitude error of that size comes with relative errors of about that
    /// size. π if none is asked for.
    pub(crate) fn strictest(&self) -> f64 {
        self.strictest_target().1
    }

    /// The least error, and its target.
    pub(crate) fn strictest_target(&self) -> (Target, f64) {
        let wanted = self.targets().into_iter().filter_map(|(target, wanted)| Some((target, wanted?)));
        wanted.fold((Target::Attitude, std::f64::consts::PI), |least, next| if next.1 < least.1 { next } else { least })
    }
}

/// A number in plain decimal notation where possible, with all its digits.
fn plain(number: f64) -> String {
    if (1e-3..1e4).contains(&number) { number.to_string() } else { format!("{number:e}") }
}

impl fmt::Display for Accuracy {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (target, wanted) in self.targets() {
            if let Some(wanted) = wanted {
                write!(formatter, "{} {} {}, ", target.name(), plain(wanted), target.unit())?;
            }
        }
        write!(formatter, "in {} % of the bodies", plain(self.percentile))
    }
}

/// A quantity for which an error may be asked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "study", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum Target {
    /// The attitude.
    #[default]
    Attitude,
    /// The angular velocity in body axes.
    AngularVelocity,
    /// The rotational kinetic energy.
    Energy,
}

impl Target {
    /// The name in messages.
    pub fn name(self) -> &'static str {
        match self {
            Target::Attitude => "attitude",
            Target::AngularVelocity => "angular velocity",
            Target::Energy => "energy",
        }
    }

    /// The unit of its error.
    fn unit(self) -> &'static str {
        match self {
            Target::Attitude => "rad",
            Target::AngularVelocity => "of its magnitude",
            Target::Energy => "of its value",
        }
    }
}

/// How steps are chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stepping {
    /// From an error asked for; method, step and precision follow.
    Accuracy(Accuracy),
    /// From the errors asked for statistics and event times, where none is asked for states.
    Statistics(StatisticalAccuracy),
    /// By the user.
    Pinned {
        /// The integrator.
        method: Method,
        /// Step size, s, above zero. Shortened where needed so that output times are hit exactly.
        dt: f64,
        /// The arithmetic; `None` takes `f64` where the engine has it.
        precision: Option<Precision>,
        /// Whether states are projected after each step onto what torque-free bodies conserve.
        projected: bool,
    },
    /// By each body, from the error of each step.
    Adaptive {
        /// The integrator, one of [`Method::ADAPTIVE`].
        method: Method,
        /// Tolerance and least step.
        steps: AdaptiveSteps,
        /// The arithmetic; `None` takes `f64` where the engine has it.
        precision: Option<Precision>,
    },
}

impl Stepping {
    /// How steps are chosen if nothing is set and states are kept.
    pub(crate) const DEFAULT: Self =
        Self::Accuracy(Accuracy { attitude: Some(1e-6), angular_velocity: None, energy: None, percentile: 99.0 });

    /// Equal steps; in `f64` if states are projected.
    pub(crate) fn pinned(method: Method, dt: f64, projected: bool) -> Self {
        Self::Pinned { method, dt, precision: projected.then_some(Precision::F64), projected }
    }

    /// Steps that each body chooses; in `f64` if they are of Taylor series.
    pub(crate) fn adaptive(method: Method, steps: AdaptiveSteps) -> Self {
        Self::Adaptive { method, steps, precision: (method == Method::Taylor).then_some(Precision::F64) }
    }
}

impl fmt::Display for Stepping {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Stepping::Accuracy(accuracy) => accuracy.fmt(formatter),
            Stepping::Statistics(accuracy) => accuracy.fmt(formatter),
            Stepping::Pinned { method, dt, projected, .. } => {
                let projected = if *projected { ", projected" } else { "" };
                write!(formatter, "{method}, dt = {dt:?} s{projected}")
            }
            Stepping::Adaptive { method, steps, .. } => {
                let of = if *method == Method::Rk8 { String::new() } else { format!(" {method}") };
                write!(formatter, "adaptive{of}, tolerance {:?}", steps.tolerance)?;
                steps.least_step.map_or(Ok(()), |step| write!(formatter, ", least step {step:?} s"))
            }
        }
    }
}

impl Scene {
    /// A scene of free bodies with a span of zero, to be filled in by the methods below. Scenes that are given the same [`Arc`] share one
    /// table of bodies.
    pub fn new(ensemble: impl Into<Arc<Ensemble>>) -> Self {
        let ensemble = ensemble.into();
        Self {
            part: Part { first_body: 0, of: ensemble.len() },
            ensemble,
            end: 0.0,
            outputs: Outputs::End,
            checks: None,
            stepping: None,
            statistical: None,
            precision: None,
            forces: Vec::new(),
            skipping: true,
            torques: Vec::new(),
            moving: Vec::new(),
            pilot: true,
            observed: Observed::default(),
            states: true,
            starts: false,
            recomputed: None,
        }
    }

    /// Declares the bodies a part of those of a larger scene. Indices in plans, records and sinks still count from 0; random
    /// torques, statistics and files use the larger scene's indices.
    #[must_use]
    pub fn part_of(mut self, part: Part) -> Self {
        self.part = part;
        self.torques.iter_mut().for_each(|torque| torque.count_from(part.first_body));
        self
    }

    /// The scene of a range of the bodies, counted from 0 there; it knows that it is a part of this one ([`Scene::part_of`]).
    ///
    /// # Panics
    ///
    /// If the range exceeds the scene's bodies.
    #[must_use]
    pub fn only(&self, bodies: Range<usize>) -> Self {
        let part = Part { first_body: self.part.first_body + bodies.start, of: self.part.of };
        let only = |torque: &Torque| torque.only(&bodies);
        let mut scene = Self {
            ensemble: Arc::new(self.ensemble.only(bodies.clone())),
            forces: self.forces.iter().map(|force| force.only(&bodies)).collect(),
            torques: self.torques.iter().map(only).collect(),
            moving: self.moving.iter().map(|(place, torque)| (*place, only(torque))).collect(),
            outputs: self.outputs.clone(),
            observed: self.observed.clone(),
            ..*self
        };
        scene.translate_torques();
        scene.part_of(part)
    }

    /// The place of the bodies in the scene that they are a part of; the whole scene if it is no part.
    pub fn part(&self) -> Part {
        self.part
    }

    /// Simulates from 0 to `end` seconds; `end` is finite and not negative.
    #[must_use]
    pub fn until(mut self, end: f64) -> Self {
        self.end = end;
        self
    }

    /// Records the state at these times.
    #[must_use]
    pub fn outputs(mut self, outputs: Outputs) -> Self {
        self.outputs = outputs;
        self
    }

    /// Records the start, 0 s, too, if the output times do not include it.
    #[must_use]
    pub fn with_start(mut self) -> Self {
        self.starts = true;
        self
    }

    /// Records no states of bodies. If statistics are asked for, they alone leave the device
    /// ([`crate::plan::SkipName::States`]), and the drift in the report is that of a sample of the bodies. If nothing else says how steps
    /// are chosen, they follow from the errors of statistics and events ([`Scene::statistical_accuracy`]).
    #[must_use]
    pub fn without_states(mut self) -> Self {
        self.states = false;
        self
    }

    /// Asks for an error, from which method, step and precision follow.
    #[must_use]
    pub fn accuracy(self, accuracy: Accuracy) -> Self {
        self.with_stepping(Stepping::Accuracy(accuracy))
    }

    /// Pins method, step (s) and precision.
    #[must_use]
    pub fn pinned(self, method: Method, dt: f64, precision: Option<Precision>) -> Self {
        self.with_stepping(Stepping::Pinned { method, dt, precision, projected: false })
    }

    /// Pins method and step (s), in `f64`, and after each step projects the state of each body onto what it conserves
    /// (`kernel/method/projection.rs`): only this keeps the phase near the separatrix. For scenes without torques; a plan refuses
    /// others.
    #[must_use]
    pub fn projected(self, method: Method, dt: f64) -> Self {
        self.with_stepping(Stepping::pinned(method, dt, true))
    }

    /// Lets each body choose its steps by `rk8`'s estimate of their errors ([`crate::kernel::method::rk8_adaptive`]).
    ///
    /// ```
    /// # use glam::{DQuat, DVec3};
    /// use polhode::scene::AdaptiveSteps;
    /// use polhode::{Engine, Ensemble, Plan, Scene};
    ///
    /// # let ensemble = Ensemble::from_columns(&[DVec3::new(1.0, 2.0, 2.5)], &[DQuat::IDENTITY], &[DVec3::X])?;
    /// let steps = AdaptiveSteps { tolerance: 1e-9, least_step: None };
    /// let scene = Scene::new(ensemble).until(60.0).adaptive(steps, None);
    /// let engine = Engine::cpu();
    /// let record = engine.run(&Plan::new(&scene, &engine)?)?;
    /// let work = record.trust().adaptive.expect("bodies took adaptive steps");
    /// assert!(work.accepted.total > 0 && work.flagged == 0);
    /// # Ok::<(), polhode::Error>(())
    /// ```
    #[must_use]
    pub fn adaptive(self, steps: AdaptiveSteps, precision: Option<Precision>) -> Self {
        self.with_stepping(Stepping::Adaptive { method: Method::Rk8, steps, precision })
    }

    /// Lets each body choose its steps by the size of the last terms of its Taylor series ([`crate::kernel::method::taylor`]): in `f64`, on the
    /// CPU.
    ///
    /// ```
    /// # use glam::{DQuat, DVec3};
    /// use polhode::scene::AdaptiveSteps;
    /// use polhode::{Engine, Ensemble, Plan, Scene, Torque};
    ///
    /// # let ensemble = Ensemble::from_columns(&[DVec3::new(1.0, 2.0, 2.5)], &[DQuat::IDENTITY], &[DVec3::X])?;
    /// let steps = AdaptiveSteps { tolerance: 1e-12, least_step: None };
    /// let scene = Scene::new(ensemble).until(60.0).torque(Torque::linear_drag(0.01)).taylor(steps);
    /// let engine = Engine::cpu();
    /// let record = engine.run(&Plan::new(&scene, &engine)?)?;
    /// assert_eq!(record.trust().adaptive.expect("bodies took adaptive steps").rejected.total, 0);
    /// # Ok::<(), polhode::Error>(())
    /// ```
    #[must_use]
    pub fn taylor(self, steps: AdaptiveSteps) -> Self {
        self.with_stepping(Stepping::adaptive(Method::Taylor, steps))
    }

    /// Sets how steps are chosen.
    #[must_use]
    pub(crate) fn with_stepping(mut self, stepping: Stepping) -> Self {
        self.stepping = Some(stepping);
        self.carry_centres();
        self
    }

    /// Pins only the arithmetic; `None` leaves the choice to the plan.
    #[must_use]
    pub fn precision(mut self, precision: Option<Precision>) -> Self {
        self.precision = precision;
        self.carry_centres();
        self
    }

    /// Sets how many bodies are recomputed after the run, so that its errors are known: with 0 none, and no error is estimated. The default is
    /// 192, or one body in a thousand if that is more; on the CPU more as far as a fiftieth of the run's time goes, and fewer, but at least 8,
    /// where they would take long ([`crate::plan::Explanation::sample`]).
    #[must_use]
    pub fn recompute(mut self, bodies: usize) -> Self {
        self.recomputed = Some(bodies);
        self
    }

    /// Sets whether work that the scene does not need may be skipped ([`crate::plan::SkipName`] lists what may). The default is true; with
    /// false every body is stepped with all torques, and all take the steps that the fastest needs.
    #[must_use]
    pub fn skipping(mut self, skipping: bool) -> Self {
        self.skipping = skipping;
        self
    }

    /// Whether work that the scene does not need may be skipped.
    pub fn may_skip(&self) -> bool {
        self.skipping
    }

    /// A constant force on every body's centre of mass, N, world axes. Needs bodies with masses
    /// ([`Ensemble::with_translation`]).
    #[must_use]
    pub fn force_world(self, force: DVec3) -> Self {
        self.force(Force::constant(force))
    }

    /// Adds a force on the bodies' centres of mass. Any number of them act together; parameters are checked when a plan is
    /// made. Needs bodies with masses ([`Ensemble::with_translation`]).
    #[must_use]
    pub fn force(mut self, force: Force) -> Self {
        self.forces.push(force);
        self.translate_torques();
        self
    }

    /// Adds a torque. Any number of them act together, also several of one model; parameters are checked when a plan is made.
    #[must_use]
    pub fn torque(mut self, mut torque: Torque) -> Self {
        torque.count_from(self.part.first_body);
        self.torques.truncate(self.stated_torques().len());
        if torque.needs().position {
            self.moving.push((self.torques.len(), torque.clone()));
        }
        self.torques.push(torque);
        self.translate_torques();
        self
    }

    /// Replaces positions and velocities in torques by functions of time, if these follow in closed form, and otherwise couples the torques
    /// to the centre of mass. A plan refuses torques for which neither is possible.
    fn translate_torques(&mut self) {
        for (place, torque) in &self.moving {
            let (ensemble, forces) = (&self.ensemble, &self.forces);
            let moved = translated(torque, ensemble, forces).or_else(|| coupled(torque, ensemble, forces));
            self.torques[*place] = moved.unwrap_or_else(|| torque.clone());
        }
        self.carry_centres();
    }

    /// Where a force turns with driven bodies, and series may be taken, the centre of mass is integrated with the rotation too.
    fn carry_centres(&mut self) {
        self.torques.truncate(self.stated_torques().len());
        let may_be_series = match self.stepping {
            Some(Stepping::Accuracy(_) | Stepping::Statistics(_)) | None => true,
            Some(Stepping::Adaptive { method, .. }) => method == Method::Taylor,
            Some(Stepping::Pinned { .. }) => false,
        };
        if may_be_series && self.precision != Some(Precision::F32) {
            self.torques.extend(carrier(&self.torques, &self.ensemble, &self.forces));
        }
    }

    /// The torques without one that only carries the centres of mass.
    pub(crate) fn stated_torques(&self) -> &[Torque] {
        let count = self.torques.iter().position(is_carrier).unwrap_or(self.torques.len());
        &self.torques[..count]
    }

    /// The first torque that requires centres of mass to be integrated with the rotation, and its index; this then applies to all
    /// bodies.
    pub(crate) fn coupling(&self) -> Option<(usize, &Torque)> {
        self.torques.iter().enumerate().find(|(_, torque)| torque.is_coupled())
    }

    /// Takes methods and steps from the shipped table ([`crate::plan::cost`]) instead of first trying them on a few bodies.
    #[must_use]
    pub fn without_pilot(mut self) -> Self {
        self.pilot = false;
        self
    }

    /// Whether methods and steps are tried on a few bodies first.
    pub(crate) fn has_pilot(&self) -> bool {
        self.pilot
    }

    /// The bodies.
    pub fn ensemble(&self) -> &Ensemble {
        &self.ensemble
    }

    /// Seeks events every so many seconds too, beside output times: each check costs the evaluation of the events' quantities and, for equal
    /// and adaptive steps, that a step ends there, and writes nothing. Without events it has no effect. `interval` is finite and above zero.
    #[must_use]
    pub fn event_checks(mut self, interval: f64) -> Self {
        self.checks = Some(interval);
        self
    }

    /// The time between two checks for events, s, if they are sought between outputs too.
    pub fn event_check_interval(&self) -> Option<f64> {
        self.checks
    }

    /// The end of the simulated span, s.
    pub fn end(&self) -> f64 {
        self.end
    }

    /// When the state is recorded.
    pub fn output_times(&self) -> &Outputs {
        &self.outputs
    }

    /// Whether the start is recorded too.
    pub(crate) fn records_start(&self) -> bool {
        self.starts
    }

    /// The number of bodies that are recomputed, if it was set.
    pub(crate) fn wanted_recomputed(&self) -> Option<usize> {
        self.recomputed
    }

    /// Whether states of bodies are recorded.
    pub fn keeps_states(&self) -> bool {
        self.states
    }

    /// The arithmetic that was asked for, by [`Scene::precision`] or otherwise by [`Scene::pinned`].
    pub fn wanted_precision(&self) -> Option<Precision> {
        match self.stepping {
            Some(Stepping::Pinned { precision, .. } | Stepping::Adaptive { precision, .. }) => {
                self.precision.or(precision)
            }
            Some(Stepping::Accuracy(_) | Stepping::Statistics(_)) | None => self.precision,
        }
    }

    /// The forces, in the order in which they were added.
    pub fn forces(&self) -> &[Force] {
        &self.forces
    }

    /// The torques, in the order in which they were added.
    pub fn torques(&self) -> &[Torque] {
        &self.torques
    }
}
