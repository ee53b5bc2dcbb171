//! An engine beside its scalar twin, step by step, over a whole scene.
//!
//! A kernel is written twice, in WGSL and in Rust. [`verify`] takes a scene as a run would, with its plan's groups, and compares three
//! sides: the engine, its scalar twin (the same operations in the same arithmetic, one body at a time), and, where the group is in
//! `f32`, the twin with the `f64` reference, which says how good the arithmetic is and is not judged.
//!
//! * Equal steps are taken one by one, each side from the twin's state before the step, so that differences do not add up and a bound
//!   can be counted in roundings of one step, for each body from its own numbers. The result of several steps in one call must
//!   have the bits of single ones.
//! * Adaptive steps are compared attempt by attempt, including the controller's decisions: whether a step is accepted, what the next one
//!   is, and what remains of the interval.
//! * Motion in closed form is compared at the output times.
//! * Centres of mass that an engine advances are compared with the host's, step by step.
//!
//! The first difference beyond its bound is reported with body, step, component, numbers and bound, and with the torque that causes it: the
//! step is repeated under each torque alone and without each of them, and a projected one without the projection. It is also repeated in
//! parts of its size, which distinguishes a fault in a slope from one later in the step, in how the state is carried over, or in the
//! controller of adaptive steps ([`Onset`]). If the engine has kernels that show their evaluations (`engine/tap.rs`; GPUs have),
//! those of the step are compared one by one, inputs and results: the first that differs is the stage at fault, and the part of it that
//! differs is the term ([`Stage`]). CPU lanes show none: there, short steps from the states and times of the twin's evaluations reveal
//! which slope is the first to differ and, for a Taylor series, the power with which the difference falls reveals which coefficient. For
//! free flows and projections, which evaluate nothing, for carrying over the state, and for decisions no stage is named, and the report
//! says why ([`NoStage`]).
//!
//! ```
//! use polhode::verify::{Options, verify};
//! use polhode::{Engine, Method, Scene, Torque};
//!
//! # fn main() -> polhode::Result<()> {
//! # use glam::{DQuat, DVec3};
//! # let ensemble = polhode::Ensemble::from_columns(&[DVec3::new(1.0, 2.0, 2.5)], &[DQuat::IDENTITY], &[DVec3::X])?;
//! let scene = Scene::new(ensemble).torque(Torque::linear_drag(0.1)).until(1.0).pinned(Method::Rk4, 0.01, None);
//! let report = verify(&Engine::cpu(), &scene, &Options::default())?;
//! assert!(report.agrees(), "{report}");
//! # Ok(())
//! # }
//! ```

mod attempts;
mod bound;
mod closed_form;
mod compare;
mod culprit;
mod onset;
mod report;
#[doc(hidden)]
pub mod running;
mod series_steps;
mod slopes;
mod stage;
mod steps;
mod subject;
mod tapped;
mod translation;

use std::ops::Range;

use crate::bodies::Members;
use crate::engine::{Backend, EngineKind};
use crate::error::{Error, Result};
use crate::kernel::method::Method;
use crate::plan::{Group, Plan, Treatment};
use crate::scene::Scene;
use crate::torque::Torque;

pub use compare::{Comparison, Field, Largest, Parting};
pub use culprit::Culprit;
pub use onset::Onset;
pub use report::{GroupReport, Report, Verdict};
pub use stage::{NoStage, Shown, Stage, Term};

use subject::Subject;

/// The default number of steps that are compared.
pub const DEFAULT_STEPS: u64 = 32;

/// What is compared in a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Number of steps for each group, at least one: equal steps, rounds of attempts, or output times if nothing is stepped.
    pub steps: u64,
    /// Number of steps before the first that is compared; the twin takes them.
    pub from_step: u64,
    /// The only body that is compared, by its index in the scene; it moves as in the plan of all bodies.
    pub body: Option<usize>,
    /// The number of bodies, the first ones, that are compared; they move as in the plan of all bodies. `None` for all.
    pub bodies: Option<usize>,
    /// Torques that the twin uses in place of the scene's, one for one: a fault planted on one side.
    #[doc(hidden)]
    pub twin_torques: Option<Vec<Torque>>,
}

impl Default for Options {
    fn default() -> Self {
        Self { steps: DEFAULT_STEPS, from_step: 0, body: None, bodies: None, twin_torques: None }
    }
}

/// A range of steps.
#[derive(Clone, Copy, Debug)]
struct Window {
    first: u64,
    count: u64,
}

impl Window {
    /// The part of the range within `total` steps.
    fn of(self, total: u64) -> Range<u64> {
        self.first.min(total)..self.first.saturating_add(self.count).min(total)
    }
}

/// The result of a group's comparison.
#[derive(Default)]
struct Found {
    steps: Range<u64>,
    /// Number of steps of the group, if known.
    total: u64,
    comparisons: Vec<Comparison>,
    notes: Vec<String>,
}

/// Compares `engine` with its scalar twin over a scene, as a run of it is planned.
///
/// # Errors
///
/// [`Error::Setting`] if no step is asked for, or a body or a first step that does not exist; those of [`Plan::new`] and of the
/// engine. A difference is not an error; it is in the report.
pub fn verify(engine: &dyn Backend, scene: &Scene, options: &Options) -> Result<Report> {
    let refused = |field, value: f64, expected| Err(Error::Setting { field, value, expected });
    let bodies = scene.ensemble().len();
    let first = options.bodies.unwrap_or(bodies).min(bodies);
    if options.steps == 0 {
        return refused("steps", 0.0, "expected one step or more, as nothing would be compared");
    }
    if let Some(body) = options.body.filter(|&body| body >= bodies) {
        return refused("body", body as f64, "expected the index of one of the bodies, from 0");
    }
    let twin_torques = options.twin_torques.as_deref().unwrap_or(scene.torques());
    if twin_torques.len() != scene.torques().len() {
        return refused("twin_torques", twin_torques.len() as f64, "expected one torque for each of the scene's");
    }
    let plan = Plan::new(scene, engine)?;
    let window = Window { first: options.from_step, count: options.steps };
    let mut groups = Vec::new();
    for group in plan.groups() {
        let members = match options.body {
            None if first == bodies => group.members.clone(),
            None => {
                let rows = group.members.rows(0..first);
                if rows.is_empty() {
                    continue;
                }
                Members::Some(rows.map(|row| group.members.body(row) as u32).collect())
            }
            Some(body) if group.members.rows(body..body + 1).is_empty() => continue,
            Some(body) => Members::Some(vec![body as u32]),
        };
        groups.push(compared(engine, &plan, group, members, twin_torques, window)?);
    }
    let report = Report {
        engine: engine.description().name,
        bodies: if options.body.is_some() { 1 } else { first },
        groups,
        not_compared: not_compared(&plan, engine),
    };
    if options.from_step > 0 && report.groups.iter().all(|group| group.steps.is_empty()) {
        return refused("from_step", options.from_step as f64, "no body takes as many steps: expected an earlier one");
    }
    Ok(report)
}

fn compared(
    engine: &dyn Backend,
    plan: &Plan<'_>,
    group: &Group,
    members: Members,
    twin_torques: &[Torque],
    window: Window,
) -> Result<GroupReport> {
    let precision = group.treatment.precision();
    let subject = Subject::new(plan.scene(), group, members, precision, twin_torques)?;
    let treatment = group.treatment;
    let is_coupled = subject.batch.torques().is_coupled();
    let found = match treatment {
        _ if is_coupled => Found { notes: vec![COUPLED.into()], ..Found::default() },
        Treatment::RegularPrecession => closed_form::compare_precession(plan, &subject, group, window)?,
        Treatment::ClosedForm { set_up, .. } => closed_form::compare(engine, plan, &subject, set_up, window)?,
        Treatment::Stepped { method, projected, .. } => {
            let kernel = steps::Kernel { method, projected };
            steps::compare(engine, plan, &subject, &treatment, kernel, window)?
        }
        Treatment::Adaptive { method, steps, .. } => {
            attempts::compare(engine, plan, &subject, attempts::Kernel { method, steps }, window)?
        }
    };
    let mut notes = found.notes;
    let has_centres = plan.scene().ensemble().translation().is_some() && !is_coupled;
    if has_centres && !translation::follows(plan.scene(), &treatment) {
        notes.push("centres of mass: not compared, as the host moves them in f64 whatever the engine".into());
    }
    Ok(GroupReport {
        shape: if group.class.is_driven() { "driven" } else { group.class.shape.name() },
        bodies: subject.len(),
        treatment,
        torques: subject.torque_names(),
        torque_names: (0..plan.scene().torques().len())
            .map(|torque| subject::torque_name(plan.scene(), torque))
            .collect(),
        steps: found.steps,
        total: found.total,
        comparisons: found.comparisons,
        notes,
    })
}

/// Why bodies whose centre of mass is part of the state are not compared.
const COUPLED: &str =
    "not compared: position and velocity are part of the state, which series on the CPU alone integrate";

/// Whether a GPU's shaders compute bodies with this treatment.
fn runs_shaders(treatment: &Treatment, engine: &dyn Backend) -> bool {
    match *treatment {
        Treatment::RegularPrecession | Treatment::Adaptive { method: Method::Taylor, .. } => false,
        _ => engine.runs_shaders(treatment.precision()),
    }
}

/// What a run of the plan does that is not compared.
fn not_compared(plan: &Plan<'_>, engine: &dyn Backend) -> Vec<String> {
    let scene = plan.scene();
    let mut list = Vec::new();
    let is_gpu = engine.description().kind == EngineKind::Gpu;
    if is_gpu && !plan.groups().iter().any(|group| runs_shaders(&group.treatment, engine)) {
        list.push("shaders: no shader computes any of these bodies".to_owned());
    }
    list.push("what a run's report says of it: drift, balance, error estimate".to_owned());
    if scene.observes() {
        list.push("statistics, histograms and events, which are formed of the states".to_owned());
    }
    if scene.torques().iter().any(Torque::is_sampled) {
        list.push(
            "samples of torques, which the host forms in f64: all steps are taken with the values of t = 0".to_owned(),
        );
    }
    if scene.stops() {
        list.push("stops by events: all bodies are stepped on here".to_owned());
    }
    list
}
