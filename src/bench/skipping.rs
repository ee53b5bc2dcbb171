//! What is saved by leaving out work that a scene does not need: each scene with and without skipping.
//!
//! In each scene one kind of skip matters. It is run as planned and once without skipping ([`Scene::skipping`]) or, for some skips, as another
//! scene that takes the work left out: more outputs read, more digits, a torque of no effect, centres of mass. The final states are compared.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

use glam::{DQuat, DVec3};

use super::problem::{SEED, distances};
use super::row::Row;
use super::strategy::Reader;
use super::timing::{Timing, repeat};
use super::warm::Warm;
use super::{Bench, Case, Swept, Watcher, sweep};
use crate::bodies::BodyState;
use crate::bodies::Ensemble;
use crate::bodies::columns::STATE_COMPONENTS;
use crate::bodies::ensemble::Translation;
use crate::engine::Engine;
use crate::engine::batch;
use crate::error::Result;
use crate::kernel::free_motion::{ROW_COLUMNS, WORD_COLUMNS};
use crate::kernel::observe::Statistic;
use crate::math::Precision;
use crate::plan::{Plan, SkipName, Treatment};
use crate::run::run_into;
use crate::scene::{Accuracy, Outputs, Scene};
use crate::study::problem;
use crate::torque::Torque;
use crate::torque::force::Force;

/// The table's name.
pub const TABLE: &str = "skipping";

const BODIES: usize = 16_384;
const QUICK_BODIES: usize = 1024;

/// Simulated time, s.
const SPAN: f64 = 100.0;

/// The attitude error asked for, rad.
const TOLERANCE: f64 = 1e-6;

/// The error asked for, rad, at which the closed form's constants need two words.
const FINE_TOLERANCE: f64 = 1e-12;

/// The error asked for, rad, at which bodies are stepped by Taylor series.
const CLOSE_TOLERANCE: f64 = 1e-10;

/// Number of output times of the scene that shows the cost of outputs.
const OUTPUTS: u32 = 50;

/// The skips that have a scene.
pub(crate) const SKIPS: [SkipName; 14] = [
    SkipName::AtRest,
    SkipName::Spherical,
    SkipName::Steady,
    SkipName::Axisymmetric,
    SkipName::Free,
    SkipName::SetUp,
    SkipName::Torque,
    SkipName::Attitude,
    SkipName::Directions,
    SkipName::Translation,
    SkipName::TranslationSteps,
    SkipName::Steps,
    SkipName::Outputs,
    SkipName::States,
];

/// One scene on one engine.
#[derive(Clone, Debug)]
pub struct SkippingCase {
    /// The skip that matters in it.
    pub skip: SkipName,
    /// The engine that runs it.
    pub engine: Engine,
}

impl Case for SkippingCase {
    fn label(&self) -> String {
        let engine = self.engine.description().kind.name();
        format!("{}/{engine}", self.skip)
    }

    fn engine(&self) -> &Engine {
        &self.engine
    }
}

/// All cases.
pub fn cases(bench: &Bench) -> Vec<SkippingCase> {
    let of_engine = |engine: &Engine| SKIPS.map(|skip| SkippingCase { skip, engine: engine.clone() });
    bench.engines.iter().flat_map(of_engine).collect()
}

/// The bodies with masses, starting at the origin at rest.
fn moving(ensemble: &Ensemble) -> Result<Ensemble> {
    let count = ensemble.len();
    let translation =
        Translation { mass: vec![1.0; count], position: vec![DVec3::ZERO; count], velocity: vec![DVec3::ZERO; count] };
    ensemble.clone().with_translation(translation)
}

/// Bodies that fall through air.
fn falling(ensemble: Ensemble) -> Scene {
    let gravity = Force::gravity(DVec3::new(0.0, 0.0, -9.81));
    Scene::new(ensemble).force(gravity).force(Force::linear_drag(0.1))
}

/// The scene in which a skip matters, as planned, and without skipping.
fn scenes(skip: SkipName, bodies: usize) -> Result<(Scene, Scene)> {
    let free = problem::free(bodies, SEED)?;
    // The bodies of the free problem with other moments or spins.
    let changed = |change: &(dyn Fn(DVec3, DVec3) -> (DVec3, DVec3) + Sync)| {
        Ensemble::from_fn(bodies, |body| {
            let moments = free.inertia()[body].to_matrix();
            let moments = DVec3::new(moments.x_axis.x, moments.y_axis.y, moments.z_axis.z);
            let (moments, spin) = change(moments, free.angular_velocity_body()[body]);
            (moments, free.orientation()[body], spin)
        })
    };
    // A drag that acts on all bodies or on every eighth.
    let drag =
        |all: bool| -> Vec<f64> { (0..bodies).map(|body| if all || body % 8 == 0 { 0.01 } else { 0.0 }).collect() };
    let scene = match skip {
        SkipName::AtRest => Scene::new(changed(&|moments, _| (moments, DVec3::ZERO))?),
        SkipName::Spherical => Scene::new(changed(&|moments, spin| (DVec3::splat(moments.x), spin))?),
        SkipName::Steady => Scene::new(changed(&|moments, spin| (moments, DVec3::new(0.0, 0.0, spin.z)))?),
        SkipName::Axisymmetric => {
            let round = |moments: DVec3| DVec3::new(moments.x, moments.x, moments.z.min(2.0 * moments.x));
            Scene::new(changed(&|moments, spin| (round(moments), spin))?)
        }
        // Tensors that are not diagonal, for which set-up in two words costs the most.
        SkipName::SetUp => {
            let turned = |body: usize| {
                let (tensor, q) = (free.inertia()[body], free.orientation()[body]);
                (tensor.rotated(q), q, free.angular_velocity_body()[body])
            };
            Scene::new(Ensemble::from_fn(bodies, turned)?)
        }
        SkipName::Torque => Scene::new(free.clone()).torque(Torque::linear_drag(drag(false))),
        SkipName::Steps => {
            // A few spin ten times as fast as the others; without the skip all would take their steps.
            let fast = |spin: DVec3| if spin.x > 2.0 { 10.0 * spin } else { spin };
            Scene::new(changed(&|moments, spin| (moments, fast(spin)))?).torque(Torque::linear_drag(drag(true)))
        }
        SkipName::TranslationSteps => falling(moving(&free)?).torque(Torque::linear_drag(drag(true))),
        SkipName::Outputs | SkipName::States => Scene::new(free.clone()).torque(Torque::linear_drag(drag(true))),
        _ => Scene::new(free.clone()),
    };
    let ask = |scene: Scene| scene.until(SPAN).accuracy(Accuracy::attitude(TOLERANCE));
    let scene = ask(scene);
    let often = || Outputs::Every(SPAN / f64::from(OUTPUTS));
    Ok(match skip {
        // Without this skip the run passes on states that nobody reads.
        SkipName::Outputs => (scene.clone(), scene.outputs(often())),
        SkipName::States => {
            let scene = scene.outputs(often()).statistics(Statistic::ALL);
            (scene.clone().without_states(), scene)
        }
        // Without this skip more digits are asked for.
        SkipName::SetUp => {
            let scene = scene.precision(Some(Precision::F64));
            (scene.clone(), scene.accuracy(Accuracy::attitude(FINE_TOLERANCE)))
        }
        // Without this skip a torque of zero strength depends on the whole attitude.
        SkipName::Attitude | SkipName::Directions => {
            let torque = match skip {
                SkipName::Attitude => Torque::linear_drag(drag(true)),
                _ => Torque::heavy_top(1.0, DVec3::Z * 0.1, DVec3::NEG_Z),
            };
            let scene = scene.torque(torque).accuracy(Accuracy::attitude(CLOSE_TOLERANCE));
            (scene.clone(), scene.torque(Torque::sine_spring(1e-30, DQuat::IDENTITY)))
        }
        // Without this skip unneeded centres of mass are moved.
        SkipName::Translation => (scene, ask(falling(moving(&free)?))),
        _ => (scene.clone(), scene.skipping(false)),
    })
}

/// Measures the cases and appends their rows to the table [`TABLE`] in `folder`.
///
/// # Errors
///
/// Those of the table and of the engines; rows measured before are kept.
pub fn run(bench: &Bench, folder: &Path, watcher: &mut Watcher<'_>) -> Result<Swept> {
    let bodies = if bench.quick { QUICK_BODIES } else { BODIES };
    sweep(bench, folder, TABLE, &cases(bench), watcher, |case, warm| {
        let (short, long) = scenes(case.skip, bodies)?;
        match (ran(bench, &case.engine, &short, warm), ran(bench, &case.engine, &long, warm)) {
            (Ok(short), Ok(long)) => Ok(row(case, bodies, &short, &long, String::new())),
            (Err(refusal), _) | (_, Err(refusal)) if refusal.is_input() => {
                Ok(row(case, bodies, &Ran::default(), &Ran::default(), refusal.to_string()))
            }
            (Err(error), _) | (_, Err(error)) => Err(error),
        }
    })
}

/// The results of a scene's runs.
#[derive(Debug, Default)]
struct Ran {
    /// Planning, s.
    plan: f64,
    /// Set-up, upload, integration and reading back, s.
    time: Timing,
    body_steps: u64,
    bytes: u64,
    failed: usize,
    states: Vec<BodyState>,
}

fn ran(bench: &Bench, engine: &Engine, scene: &Scene, warm: &mut Warm) -> Result<Ran> {
    let clock = Instant::now();
    let plan = Plan::new(scene, engine)?;
    let plan_seconds = clock.elapsed().as_secs_f64();
    let every = scene.keeps_states();
    let reads = if every { plan.times().len() } else { 1 };
    let mut ran = Ran { plan: plan_seconds, bytes: bytes(&plan, reads), ..Ran::default() };
    ran.time = repeat(bench.repeats(), || {
        warm.up()?;
        let mut reader = Reader { every, ..Reader::default() };
        let trust = run_into(engine, &plan, &mut reader, &mut |_| ControlFlow::Continue(()))?;
        ran.failed = trust.failed_bodies.len();
        ran.body_steps = trust.body_steps;
        ran.states = reader.states;
        let time = trust.wall_time;
        Ok(time.prepare + time.start + time.compute + time.read)
    })?;
    Ok(ran)
}

/// Bytes of the columns that the engine is given, and of the states that are read back `reads` times.
fn bytes(plan: &Plan<'_>, reads: usize) -> u64 {
    let of_group = |group: &crate::plan::Group| {
        let (given, read) = match group.treatment {
            Treatment::RegularPrecession => (0, 0),
            Treatment::ClosedForm { precision, .. } => {
                let word = if precision == Precision::F32 { 4 } else { 8 };
                (WORD_COLUMNS * 8 + ROW_COLUMNS * word, STATE_COMPONENTS * word)
            }
            // The two words of f32 are as long as the one of f64.
            Treatment::Stepped { precision, .. } | Treatment::Adaptive { precision, .. } => {
                (batch::bytes_per_body(precision), STATE_COMPONENTS * 8)
            }
        };
        (group.members.len() * (given + reads * read)) as u64
    };
    plan.groups().iter().map(of_group).sum()
}

fn row(case: &SkippingCase, bodies: usize, short: &Ran, long: &Ran, mut fault: String) -> Row {
    let difference = distances(&short.states, &long.states);
    let failed = short.failed + long.failed;
    if fault.is_empty() && failed > 0 {
        fault = format!("{failed} bodies failed");
    }
    if fault.is_empty() && difference.p99 > 2.0 * TOLERANCE {
        // Either result may be wrong by the error asked for.
        fault = format!("the ends differ by {:.1e} rad at the 99th percentile", difference.p99);
    }
    Row::new()
        .with("skip", case.skip.name())
        .with("bodies", bodies)
        .with("span_s", SPAN)
        .with("tolerance_rad", TOLERANCE)
        .with("repeats", short.time.repeats.min(long.time.repeats))
        .with("seconds_with", short.time.median)
        .with("seconds_with_spread", short.time.spread)
        .with("seconds_without", long.time.median)
        .with("seconds_without_spread", long.time.spread)
        .with("plan_seconds_with", short.plan)
        .with("plan_seconds_without", long.plan)
        .with("body_steps_with", short.body_steps)
        .with("body_steps_without", long.body_steps)
        .with("bytes_with", short.bytes)
        .with("bytes_without", long.bytes)
        .with_quantiles("difference_rad", &difference)
        .with("failed_bodies", failed)
        .with("valid", fault.is_empty())
        .with("fault", fault)
}

/// Time and bytes with and without each skip, as a table in Markdown.
pub fn summary(rows: &[Row]) -> String {
    let mut text = String::from(
        "| skip | engine | with (s) | without (s) | times as fast | bytes with | bytes without | difference, p99 (rad) |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    for row in rows {
        let (with, without) = (row.number("seconds_with"), row.number("seconds_without"));
        text += &format!(
            "| {} | {} | {with:.1e} | {without:.1e} | {:.1} | {:.1e} | {:.1e} | {:.1e}{} |\n",
            row.text("skip"),
            row.text("engine"),
            without / with,
            row.number("bytes_with"),
            row.number("bytes_without"),
            row.number("difference_rad_p99"),
            if row.flag("valid") { String::new() } else { format!(" FAILED: {}", row.text("fault")) },
        );
    }
    text
}
