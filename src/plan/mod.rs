//! What will run: a scene resolved for an engine.
//!
//! A plan puts every body into a [`class`](class::Class), within tolerances that follow from the error asked for, and collects bodies that
//! are treated alike into [groups](group::Group). Within a group, bodies keep the ensemble's order, so that outputs can be assembled block
//! by block in bounded memory. A body's group, and so its result, depends only on the body, the scene and the settings, not on the bodies
//! beside it. What is left out is listed as [skips](skip::Skip), each with its reason and the bound that makes it safe.

use std::ops::Range;
use std::time::{Duration, Instant};

use crate::engine::{Backend, Description};
use crate::error::{Error, Result};
use crate::kernel::method::Method;
use crate::kernel::method::rk8_adaptive::LEAST_STEP;
use crate::math::Precision;
use crate::math::parallel;
use crate::scene::{AdaptiveSteps, Event, Quantity, Scene, Stepping};
use crate::torque::Torque;
use crate::torque::control::{Control, MOST_SAMPLES, Schedule};

mod breaks;
mod centres;
#[doc(hidden)]
pub mod choice;
#[doc(hidden)]
pub mod class;
#[doc(hidden)]
pub mod cost;
mod coupled;
mod dense;
#[cfg(feature = "study")]
mod document;
mod driven;
pub(crate) mod errors;
pub mod explain;
#[cfg(feature = "study")]
mod fingerprint;
#[doc(hidden)]
pub mod group;
mod grouping;
mod lane_classification;
pub(crate) mod own_state;
mod parts;
mod pilot;
pub(crate) mod recomputation;
mod reference;
mod resolution;
mod sampled;
pub(crate) mod sampling;
pub mod skip;
pub(crate) mod statistical;
mod statistical_pilot;
mod stratified;
pub(crate) mod subset;
mod time_limit;
mod times;
mod unseen;

pub(crate) use choice::{ADAPTIVE, CLOSED_FORM, greatest_rate, rate_of_body};
pub use choice::{CLOSED_FORM_F32, Rule, SKIP_SHARE, Scheme};
pub use class::{Bound, Class, Shape};
pub use cost::Costs;
#[cfg(feature = "study")]
pub use document::PlanDocument;
pub(crate) use driven::ActingTorques;
pub use driven::TorqueSet;
pub use explain::Explanation;
pub use group::{Group, Treatment};
pub use parts::Part;
pub(crate) use parts::listed;
pub use pilot::Found;
pub use resolution::{Resolution, Stepped};
#[doc(hidden)]
pub use sampled::pilot_steps;
pub use skip::{Skip, SkipName};
pub use statistical::StatisticError;
pub use times::{Interval, MOST_OUTPUTS};

use centres::CentreWork;
use cost::work::{Works, works_of};
use skip::{leaves_states, skips};
use stratified::PlannedSample;
pub(crate) use stratified::{SEED, Stratified, for_statistics};
use time_limit::TimeLimit;
pub(crate) use times::steps_over;
use times::{Times, longest_over};

/// A scene resolved for an engine: which bodies are treated how, and the output times.
#[derive(Clone, Debug)]
pub struct Plan<'a> {
    scene: &'a Scene,
    engine: Description,
    method: Method,
    precision: Precision,
    longest_step: f64,
    times: Times,
    resolution: Resolution,
    groups: Vec<Group>,
    skips: Vec<Skip>,
    /// What the torques on its stepped bodies cost.
    works: Works,
    centres: CentreWork,
    costs: Costs,
    planning: Duration,
    /// Which bodies are recomputed, how, and what that takes.
    sample: PlannedSample,
}

impl<'a> Plan<'a> {
    /// Resolves `scene` for `engine`.
    ///
    /// Where method and step are pinned, every body is stepped that way, except bodies at rest without torque. Where an error is asked for,
    /// torque-free bodies are not stepped. For each set of torques that act on a body, a [`pilot`](Scene::without_pilot) on a few of the
    /// bodies finds method and steps: equal steps that follow each body's own rate or, where that is cheaper, adaptive steps of `rk8` or
    /// Taylor series ([`Scheme`]). A stepped body is in `f32` if the floor of `f32`, 1e-6 rad plus 3e-8 of the angle turned, is below the
    /// error asked for; the closed form is in `f32` from 9.6e-7 rad on ([`CLOSED_FORM_F32`] with [`SKIP_SHARE`]). All others are in `f64`.
    ///
    /// Where only errors of statistics are asked for ([`Scene::statistical_accuracy`]), the pilot tries steps against those. This also
    /// works for chaotic motion, in which no attitude can be predicted.
    ///
    /// It takes as long as it needs; [`Plan::announced`] limits it.
    ///
    /// # Errors
    ///
    /// [`Error::Setting`] for a span, step, output time or accuracy out of range; [`Error::PrecisionUnavailable`] where the engine lacks
    /// the precision pinned or needed; [`Error::MissingMass`] where a force acts on bodies without mass; [`Error::Torque`],
    /// [`Error::Force`] and [`Error::ColumnLength`] for parameters of torques and forces; [`Error::AccuracyOutOfReach`] and
    /// [`Error::StatisticsOutOfReach`] where no candidate meets what is asked for; [`Error::RigidOnly`] where internal dissipation or
    /// changing moments of inertia act and the pinned method cannot follow them; [`Error::TorquePair`] for torques that exclude each other;
    /// [`Error::OwnState`] for a quantity of own state that no torque has; [`Error::MethodUnavailable`] where a torque depends on the
    /// body's position and that is known only through Taylor series, which are not available; [`Error::StoppedCentre`] where an event stops
    /// bodies whose centres of mass are stepped; [`Error::Body`] for a body whose adaptive steps would never reach the end.
    pub fn new(scene: &'a Scene, engine: &dyn Backend) -> Result<Self> {
        Self::with_costs(scene, engine, &Costs::shipped())
    }

    /// As [`Plan::new`], but ranks candidates by the given costs, such as those measured on this engine.
    ///
    /// # Errors
    ///
    /// As [`Plan::new`].
    pub fn with_costs(scene: &'a Scene, engine: &dyn Backend, costs: &Costs) -> Result<Self> {
        Self::limited(scene, engine, costs, &TimeLimit::new())
    }

    /// As [`Plan::with_costs`], for a caller who waits: if planning takes longer than a few seconds, `announce` is told once how long
    /// it takes at most, and planning ends by then. The plan itself does not depend on that: either the same plan results, or none.
    ///
    /// # Errors
    ///
    /// As [`Plan::new`], and [`Error::PlanningTime`].
    pub fn announced(
        scene: &'a Scene,
        engine: &dyn Backend,
        costs: &Costs,
        announce: impl FnOnce(Duration) + Send,
    ) -> Result<Self> {
        let limit = TimeLimit::new();
        limit.held(|| Self::limited(scene, engine, costs, &limit), announce)
    }

    fn limited(scene: &'a Scene, engine: &dyn Backend, costs: &Costs, limit: &TimeLimit) -> Result<Self> {
        let since = Instant::now();
        let mut times = Self::checked(scene)?.with_breaks(breaks::of(scene));
        times.set_dense(dense::suits(scene, &times));
        let costs = &costs.on(engine);
        // Inside the thread pool, so that its threads need not be woken for each of many small pieces of work.
        rayon::scope(|_| {
            let resolution = Resolution::new(scene, engine, &times, (costs, limit))?;
            let mut plan = Self { costs: costs.clone(), ..Self::resolved(scene, engine, resolution, times)? };
            plan.times.set_dense(plan.groups.iter().any(|group| group.is_dense));
            plan.draw_sample();
            Ok(Self { planning: since.elapsed(), ..plan })
        })
    }

    /// Checks everything that does not depend on the choice, and returns the times of outputs and checks.
    fn checked(scene: &Scene) -> Result<Times> {
        let times = Times::of(scene)?;
        for (index, torque) in scene.torques().iter().enumerate() {
            torque.validate(index, scene.ensemble())?;
        }
        check_together(scene.torques())?;
        check_samples(scene)?;
        for (index, force) in scene.forces().iter().enumerate() {
            force.validate(index, scene.ensemble().len())?;
        }
        if scene.forces().iter().any(|force| !force.is_zero()) && scene.ensemble().translation().is_none() {
            return Err(Error::MissingMass);
        }
        check_stops(scene)?;
        scene.observed().quantities().iter().try_for_each(Quantity::check)?;
        Quantity::own_places(&scene.observed().quantities(), scene.torques())?;
        Quantity::check_energies(&scene.observed().quantities(), scene.torques())?;
        if let Some(wanted) = scene.wanted_statistical_accuracy() {
            wanted.check(scene.observed())?;
        }
        Ok(times)
    }

    /// The plan that follows from an existing resolution of the same scene.
    fn resolved(scene: &'a Scene, engine: &dyn Backend, resolution: Resolution, times: Times) -> Result<Self> {
        let mut groups = resolution.groups(scene);
        dense::mark(&mut groups, &times);
        for precision in groups.iter().filter_map(|group| group.treatment.precision_of_steps()) {
            if !engine.precisions().contains(&precision) {
                return Err(Error::PrecisionUnavailable { adapter: engine.description().name, precision });
            }
        }
        let works = works_of(scene, &groups);
        let skips = skips(scene, &groups, &works, times.all().len());
        let (method, precision, longest_step) = main_treatment(&groups, scene, engine);
        let engine = engine.description();
        let costs = Costs::shipped();
        let (planning, sample) = (Duration::ZERO, PlannedSample::default());
        let plan = Self {
            scene,
            engine,
            method,
            precision,
            longest_step,
            times,
            resolution,
            groups,
            skips,
            works,
            centres: CentreWork::of(scene),
            costs,
            planning,
            sample,
        };
        plan.check_steps()?;
        plan.check_rates()?;
        Ok(plan)
    }

    /// The same plan for a part of its scene ([`Scene::only`]): each body moves as in the whole, to the bit.
    ///
    /// # Errors
    ///
    /// [`Error::PrecisionUnavailable`] where another engine lacks a precision.
    pub fn of_part<'p>(&self, part: &'p Scene, engine: &dyn Backend) -> Result<Plan<'p>> {
        let plan = Plan::resolved(part, engine, self.resolution.clone(), self.times.clone())?;
        // The longest step of the whole scene, which none of the part's bodies may take.
        Ok(Plan { longest_step: self.longest_step, sample: self.sample.clone(), ..plan })
    }

    /// The scene.
    pub fn scene(&self) -> &'a Scene {
        self.scene
    }

    /// The integrator of the stepped bodies (of most of them, where there are several).
    pub fn method(&self) -> Method {
        self.method
    }

    /// The arithmetic of the stepped bodies (of most of them, where it differs).
    pub fn precision(&self) -> Precision {
        self.precision
    }

    /// The longest step that any body takes, s; steps are shortened so that output times are hit exactly.
    pub fn longest_step(&self) -> f64 {
        self.longest_step
    }

    /// Output times, s, increasing; the last one is the end.
    pub fn times(&self) -> &[f64] {
        self.times.outputs()
    }

    /// The times, s, increasing, at which steps end: those of outputs ([`Plan::times`]), the checks for events between them
    /// ([`Scene::event_checks`]), and those near which a formula of the time changes fast.
    pub fn advance_times(&self) -> &[f64] {
        self.times.all()
    }

    /// The number of checks for events between output times, if there are any.
    pub(crate) fn checks(&self) -> Option<usize> {
        self.times.checks()
    }

    /// The times at which steps end because a formula of the time changes fast near them, s, ascending.
    pub(crate) fn breaks(&self) -> &[f64] {
        self.times.breaks()
    }

    /// Whether an advance time is one of them.
    pub(crate) fn is_break(&self, time: f64) -> bool {
        self.breaks().binary_search_by(|other| other.total_cmp(&time)).is_ok()
    }

    /// Whether an advance time is an output time.
    pub(crate) fn is_output(&self, index: usize) -> bool {
        let time = self.advance_times()[index];
        self.times().binary_search_by(|output| output.total_cmp(&time)).is_ok()
    }

    /// Bodies that are treated alike; each body is in one group.
    pub fn groups(&self) -> &[Group] {
        &self.groups
    }

    /// Whether no body is stepped.
    pub fn is_closed_form(&self) -> bool {
        self.groups.iter().all(|group| group.treatment.precision_of_steps().is_none())
    }

    /// The choices that the groups follow from.
    pub fn resolution(&self) -> &Resolution {
        &self.resolution
    }

    /// What is left out.
    pub fn skips(&self) -> &[Skip] {
        &self.skips
    }

    /// The time it took to make the plan; zero for a plan that was read.
    pub fn planning_time(&self) -> Duration {
        self.planning
    }

    /// Whether states are not read back at the outputs, because only statistics are asked for ([`SkipName::States`]).
    pub fn leaves_states(&self) -> bool {
        leaves_states(self.scene)
    }

    /// Whether states are wanted at one time only, all of them at once.
    pub(crate) fn reads_states_once(&self) -> bool {
        self.times().len() == 1 && self.checks().is_none() && self.scene.reduced_statistics().is_empty()
    }

    /// The time from the predecessor of advance time `index` (the start for the first) to it, s.
    pub fn span_before(&self, index: usize) -> f64 {
        let times = self.advance_times();
        times[index] - if index == 0 { 0.0 } else { times[index - 1] }
    }

    /// The longest equal step that any body takes, s, but for those that end at a change of what a sampled torque holds; 0 without equal steps.
    pub(crate) fn longest_equal_step(&self) -> f64 {
        let of_group = |group: &Group| {
            let spans = (0..self.advance_times().len()).map(|index| self.span_before(index));
            let intervals = spans.map(|span| group.treatment.interval(span));
            intervals.filter(|interval| interval.steps > 0).map(|interval| interval.dt).fold(0.0, f64::max)
        };
        self.groups().iter().map(of_group).fold(0.0, f64::max)
    }

    /// The steps to advance time `index` from the one before (from 0 for the first), for a body with the longest step.
    pub fn interval(&self, index: usize) -> Interval {
        steps_over(self.span_before(index), self.longest_step)
    }

    /// Steps of a body of `group` over the whole span.
    pub fn steps_of(&self, group: &Group) -> u64 {
        self.steps_after(group, 0)
    }

    /// The work of a group as progress counts it: body-steps, or body-outputs if its bodies are not stepped.
    pub fn work_of(&self, group: &Group) -> u64 {
        let of_body = match group.treatment {
            Treatment::Stepped { .. } => self.steps_of(group),
            Treatment::RegularPrecession | Treatment::ClosedForm { .. } | Treatment::Adaptive { .. } => {
                self.advance_times().len() as u64
            }
        };
        of_body.saturating_mul(group.members.len() as u64)
    }

    /// The work of one body of `group` after the first `advances` of the advance times.
    pub(crate) fn work_after(&self, group: &Group, advances: usize) -> u64 {
        match group.treatment {
            Treatment::Stepped { .. } => self.steps_after(group, advances),
            _ => (self.advance_times().len() - advances) as u64,
        }
    }

    fn steps_after(&self, group: &Group, advances: usize) -> u64 {
        let times = self.advance_times();
        let schedule = Schedule::of(&group.class.torques.of(self.scene.torques()));
        let before = |index: usize| if index == 0 { 0.0 } else { times[index - 1] };
        let steps = |index: usize| group.treatment.steps_between(schedule.as_ref(), (before(index), times[index]));
        (advances..times.len()).map(steps).fold(0, u64::saturating_add)
    }

    /// The most steps that any body takes over the whole span.
    pub fn steps(&self) -> u64 {
        self.groups.iter().map(|group| self.steps_of(group)).max().unwrap_or(0)
    }

    /// Steps of all bodies together.
    pub fn body_steps(&self) -> u64 {
        self.groups
            .iter()
            .map(|group| self.steps_of(group).saturating_mul(group.members.len() as u64))
            .fold(0, u64::saturating_add)
    }

    /// Refuses a body whose own steps would never reach the end: it would hold up all others, and a pilot tries only a few bodies.
    fn check_rates(&self) -> Result<()> {
        let (scene, end) = (self.scene, self.scene.end());
        // In the body's own unit of time. Steps below the least step flag a body at once.
        let rate_and_most = |body: usize| {
            let (rate, frame) = rate_of_body(scene, scene.torques(), body);
            (rate, 2.0_f64.powi(frame.rate_exponent) / LEAST_STEP)
        };
        let is_too_fast = |body: &usize| {
            let (rate, most) = rate_and_most(*body);
            rate * end > MOST_RADIANS_OF_STEPS && rate <= most
        };
        // A least step bounds the number of steps.
        let is_unbounded =
            |steps: &AdaptiveSteps| steps.least_step.is_none_or(|least| end > MOST_RADIANS_OF_STEPS * least);
        for group in &self.groups {
            let is_fast = group.class.torques.is_empty() || group.rate * end > MOST_RADIANS_OF_STEPS;
            if !(is_fast && matches!(&group.treatment, Treatment::Adaptive { steps, .. } if is_unbounded(steps))) {
                continue;
            }
            let of_piece =
                |_, mut rows: Range<usize>| rows.find_map(|row| Some(group.members.body(row)).filter(is_too_fast));
            let too_fast = parallel::map_tasks(parallel::pieces(group.members.len()), of_piece);
            if let Some(body) = too_fast.into_iter().flatten().next() {
                return Err(Error::Body {
                    body,
                    field: "rate",
                    value: rate_and_most(body).0,
                    expected: "expected at most 1e12 rad until the end: no run finishes the steps of more (rad/s)",
                });
            }
        }
        Ok(())
    }

    /// Refuses a number of steps that no machine finishes: it is a mistake in the input.
    fn check_steps(&self) -> Result<()> {
        if self.steps() > MOST_STEPS {
            return Err(Error::Setting {
                field: "dt",
                value: self.longest_step,
                expected: "more than 1e15 steps would be needed: use a longer step or a shorter span (s)",
            });
        }
        Ok(())
    }
}

/// Refuses torques that exclude each other.
fn check_together(torques: &[Torque]) -> Result<()> {
    for (index, torque) in torques.iter().enumerate() {
        let model = torque.owned_name();
        if let Some(expected) = torque.declaration().only_one.clone()
            && torques[..index].iter().any(|before| before.name() == model)
        {
            return Err(Error::TorquePair { torque: index, model, expected });
        }
    }
    Ok(())
}

/// Refuses more samples of sampled torques than a run can finish.
fn check_samples(scene: &Scene) -> Result<()> {
    for (index, torque) in scene.torques().iter().enumerate() {
        let Some(sampling) = torque.control().map(Control::sampling) else { continue };
        if scene.end() / sampling.every > MOST_SAMPLES {
            return Err(Error::Torque {
                torque: index,
                model: torque.owned_name(),
                body: None,
                field: "every".into(),
                value: sampling.every,
                expected: "more than 1e9 samples would follow: expected a longer period, or a shorter span (s)".into(),
            });
        }
        if sampling.delay / sampling.every > MOST_PERIODS {
            return Err(Error::Torque {
                torque: index,
                model: torque.owned_name(),
                body: None,
                field: "delay".into(),
                value: sampling.delay,
                expected: "expected at most 1000 periods of `every` (s)".into(),
            });
        }
    }
    Ok(())
}

/// The longest delay, in periods: the samples taken meanwhile are kept.
const MOST_PERIODS: f64 = 1000.0;

/// The most steps a body may need.
const MOST_STEPS: u64 = 1_000_000_000_000_000;

/// The greatest angle, rad, that a body may turn in adaptive steps of about one radian: they take a core about a day.
const MOST_RADIANS_OF_STEPS: f64 = 1e12;

/// `f64` where the engine has it.
fn widest(engine: &dyn Backend) -> Precision {
    if engine.precisions().contains(&Precision::F64) { Precision::F64 } else { Precision::F32 }
}

/// Method and arithmetic of most of the stepped bodies, and the longest step; if nothing is stepped, what would be used.
fn main_treatment(groups: &[Group], scene: &Scene, engine: &dyn Backend) -> (Method, Precision, f64) {
    let mut most: Option<(usize, Method, Precision)> = None;
    let mut longest: f64 = 0.0;
    for group in groups {
        let (method, precision, longest_step) = match group.treatment {
            Treatment::Stepped { method, precision, longest_step, .. } => (method, precision, longest_step),
            Treatment::Adaptive { method, precision, .. } => (method, precision, longest_over(scene.end())),
            Treatment::RegularPrecession | Treatment::ClosedForm { .. } => continue,
        };
        longest = longest.max(longest_step);
        if most.is_none_or(|(count, ..)| group.members.len() > count) {
            most = Some((group.members.len(), method, precision));
        }
    }
    match most {
        Some((_, method, precision)) => (method, precision, longest),
        None => {
            let closed_form = groups.iter().find_map(|group| match group.treatment {
                Treatment::ClosedForm { precision, .. } => Some(precision),
                _ => None,
            });
            let precision = closed_form.or(scene.wanted_precision()).unwrap_or(widest(engine));
            match scene.stepping() {
                Stepping::Pinned { method, dt, .. } => (method, precision, dt),
                Stepping::Adaptive { method, .. } => (method, precision, longest_over(scene.end())),
                Stepping::Accuracy(_) | Stepping::Statistics(_) => (Method::Rk4, precision, longest_over(scene.end())),
            }
        }
    }
}

/// Refuses events that stop bodies whose centres of mass are stepped: their positions between steps are not known.
fn check_stops(scene: &Scene) -> Result<()> {
    let stepped = scene.forces().iter().find(|force| !force.has_closed_form());
    let stopping = scene.wanted_events().iter().position(Event::stops);
    match (stopping, stepped, scene.ensemble().translation()) {
        (Some(event), Some(force), Some(_)) => {
            let name = scene.wanted_events()[event].name().to_owned();
            Err(Error::StoppedCentre { event, name, force: force.name() })
        }
        _ => Ok(()),
    }
}
