//! An engine's work per second as a function of the number of bodies, the steps of a dispatch, the outputs of a run and the
//! cores, compared with the machine's ceilings.
//!
//! The work is `rk4` on the bodies of the free problem.

use std::collections::HashMap;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

use super::ceiling::{Ceiling, ceiling};
use super::problem::SEED;
use super::row::Row;
use super::timing::{Timing, repeat};
use super::warm::Warm;
use super::{Bench, Case, Swept, Watcher, sweep};
use crate::bodies::Ensemble;
use crate::engine::batch::prepare;
use crate::engine::{End, Engine, EngineKind, unobserved};
use crate::error::{Error, Result};
use crate::kernel::method::Method;
use crate::math::Precision;
use crate::plan::Plan;
use crate::record::OutputFolder;
use crate::run::run_to_folder;
use crate::scene::{Outputs, Scene};
use crate::study::{Format, Output, problem};

/// The table's name.
pub const TABLE: &str = "throughput";

/// The parameter that is varied.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// The number of bodies.
    Bodies,
    /// Steps between two interventions of the host.
    Dispatch,
    /// Output times of a run that writes all of them.
    Outputs,
    /// Threads of the CPU engine.
    Cores,
}

impl Axis {
    /// The name in rows.
    pub fn name(self) -> &'static str {
        match self {
            Axis::Bodies => "bodies",
            Axis::Dispatch => "steps-per-dispatch",
            Axis::Outputs => "outputs",
            Axis::Cores => "cores",
        }
    }
}

/// One amount of work on one engine.
#[derive(Clone, Debug)]
pub struct ThroughputCase {
    axis: Axis,
    engine: Engine,
    precision: Precision,
    bodies: usize,
    steps: u64,
    steps_per_dispatch: u64,
    outputs: u64,
    threads: usize,
}

impl ThroughputCase {
    /// The value of the varied parameter.
    pub fn amount(&self) -> u64 {
        match self.axis {
            Axis::Bodies => self.bodies as u64,
            Axis::Dispatch => self.steps_per_dispatch,
            Axis::Outputs => self.outputs,
            Axis::Cores => self.threads as u64,
        }
    }
}

impl Case for ThroughputCase {
    fn label(&self) -> String {
        let engine = self.engine.description().kind.name();
        format!("{}/{engine}/{}/{}", self.axis.name(), self.precision, self.amount())
    }

    fn engine(&self) -> &Engine {
        &self.engine
    }
}

/// Step size, s.
const DT: f64 = 1.0 / 64.0;

/// Floating-point operations in a torque-free step of `rk4` as its formulas state them: four slopes of quaternion and momentum, their sums
/// and the normalisation, each operation counted once. The work of carrying the state in two words is not counted; what a compiler computes
/// once for several stages is counted for each. The fraction of the ceiling is accordingly an estimate, for comparing engines and machines.
const OPERATIONS: f64 = 313.0;

/// The approximate number of body-steps in a case in which the number of bodies is varied.
const WORK: u64 = 1 << 26;
const QUICK_WORK: u64 = 1 << 22;

/// All cases.
pub fn cases(bench: &Bench) -> Vec<ThroughputCase> {
    let mut cases = Vec::new();
    let all = rayon::current_num_threads();
    let work = if bench.quick { QUICK_WORK } else { WORK };
    let most = if bench.quick { 100_000 } else { 10_000_000 };
    for engine in &bench.engines {
        let description = engine.description();
        for &precision in engine.precisions() {
            let common = ThroughputCase {
                axis: Axis::Bodies,
                engine: engine.clone(),
                precision,
                bodies: 1 << 14,
                steps: 1024,
                steps_per_dispatch: u64::MAX,
                outputs: 1,
                threads: all,
            };
            // A software adapter computes on the same cores as the CPU engine, more slowly.
            let most = if description.software { most / 10 } else { most };
            for bodies in (0..=7).map(|exponent| 10_usize.pow(exponent)).filter(|&bodies| bodies <= most) {
                let steps = (work / bodies as u64).clamp(8, 4096);
                cases.push(ThroughputCase { bodies, steps, ..common.clone() });
            }
            for steps_per_dispatch in [1, 4, 16, 64, 256, 1024] {
                cases.push(ThroughputCase { axis: Axis::Dispatch, steps_per_dispatch, ..common.clone() });
            }
            for outputs in [1, 4, 16, 64] {
                let bodies = if bench.quick { 1 << 10 } else { 1 << 14 };
                cases.push(ThroughputCase { axis: Axis::Outputs, outputs, bodies, ..common.clone() });
            }
            if description.kind == EngineKind::Cpu {
                for threads in thread_counts(all) {
                    cases.push(ThroughputCase { axis: Axis::Cores, threads, ..common.clone() });
                }
            }
        }
    }
    cases
}

/// 1, 2, 4, … and all.
fn thread_counts(all: usize) -> Vec<usize> {
    let mut counts: Vec<usize> = (0..).map(|exponent| 1 << exponent).take_while(|&count| count < all).collect();
    counts.push(all);
    counts
}

/// Measures the cases and appends their rows to the table [`TABLE`] in `folder`.
///
/// # Errors
///
/// Those of the table and of the engines; rows measured before are kept.
pub fn run(bench: &Bench, folder: &Path, watcher: &mut Watcher<'_>) -> Result<Swept> {
    let mut ceilings: HashMap<(String, Precision, usize), Ceiling> = HashMap::new();
    sweep(bench, folder, TABLE, &cases(bench), watcher, |case, warm| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(case.threads).build();
        let pool =
            pool.map_err(|error| Error::file(folder, crate::error::FileAction::Create, &std::io::Error::other(error)))?;
        pool.install(|| {
            let description = case.engine.description();
            let key = (description.name.clone(), case.precision, case.threads);
            let known = match ceilings.get(&key) {
                Some(known) => *known,
                None => ceiling(&description, case.precision)?,
            };
            ceilings.insert(key, known);
            measure(bench, case, (folder, known), warm)
        })
    })
}

/// Wall times of one case, s.
#[derive(Clone, Copy, Debug, Default)]
struct Phases {
    prepare: f64,
    start: f64,
    compute: Timing,
    read: f64,
    write: f64,
}

fn measure(bench: &Bench, case: &ThroughputCase, (folder, ceiling): (&Path, Ceiling), warm: &mut Warm) -> Result<Row> {
    let measured = (|| {
        let ensemble = problem::free(case.bodies, SEED)?;
        if case.axis == Axis::Outputs {
            written(bench, case, ensemble, (folder, warm))
        } else {
            stepped(bench, case, &ensemble, warm)
        }
    })();
    let (phases, fault) = match measured {
        Ok(phases) => (phases, String::new()),
        // More bodies than memory holds are not a failure of the benchmark.
        Err(refusal) if refusal.is_input() => {
            (Phases { compute: Timing::UNKNOWN, ..Phases::default() }, refusal.to_string())
        }
        Err(error) => return Err(error),
    };
    let body_steps = (case.bodies as u64 * case.steps) as f64;
    let rate = body_steps / phases.compute.median;
    Ok(Row::new()
        .with("axis", case.axis.name())
        .with("amount", case.amount())
        .with("method", Method::Rk4.name())
        .with("precision", case.precision.name())
        .with("bodies", case.bodies)
        .with("steps", case.steps)
        .with("steps_per_dispatch", case.steps_per_dispatch.min(case.steps))
        .with("outputs", case.outputs)
        .with("pool_threads", case.threads)
        .with("repeats", phases.compute.repeats)
        .with("prepare_seconds", phases.prepare)
        .with("start_seconds", phases.start)
        .with("compute_seconds_median", phases.compute.median)
        .with("compute_seconds_min", phases.compute.least)
        .with("compute_seconds_spread", phases.compute.spread)
        .with("read_seconds", phases.read)
        .with("write_seconds", phases.write)
        .with("body_steps_per_second", rate)
        .with("ceiling_flops", ceiling.flops)
        .with("ceiling_bytes_per_second", ceiling.bandwidth)
        .with("part_of_flops", OPERATIONS * rate / ceiling.flops)
        .with("valid", fault.is_empty())
        .with("fault", fault))
}

/// Steps alone, in pieces of `steps_per_dispatch`.
fn stepped(bench: &Bench, case: &ThroughputCase, ensemble: &Ensemble, warm: &mut Warm) -> Result<Phases> {
    let mut phases = Phases::default();
    let clock = Instant::now();
    let (frames, batch) = prepare(ensemble, case.precision)?;
    phases.prepare = clock.elapsed().as_secs_f64();
    let clock = Instant::now();
    let mut session = case.engine.start(batch, Method::Rk4)?;
    phases.start = clock.elapsed().as_secs_f64();
    session.advance_to(End::of_steps(DT, 1), &mut unobserved)?;
    warm.up()?;
    phases.compute = repeat(bench.repeats(), || {
        let clock = Instant::now();
        let mut left = case.steps;
        while left > 0 {
            let steps = left.min(case.steps_per_dispatch);
            session.advance_to(End::of_steps(DT, steps), &mut unobserved)?;
            left -= steps;
        }
        Ok(clock.elapsed().as_secs_f64())
    })?;
    let clock = Instant::now();
    let words = session.read(0..frames.len())?;
    phases.read = clock.elapsed().as_secs_f64();
    drop(words);
    Ok(phases)
}

/// A run that writes every output as an archive for NumPy.
fn written(
    bench: &Bench,
    case: &ThroughputCase,
    ensemble: Ensemble,
    (folder, warm): (&Path, &mut Warm),
) -> Result<Phases> {
    let end = DT * case.steps as f64;
    let scene = Scene::new(ensemble).until(end).pinned(Method::Rk4, DT, Some(case.precision));
    let scene = scene.outputs(Outputs::Every(end / case.outputs as f64));
    let plan = Plan::new(&scene, &case.engine)?;
    let output = Output { final_state: false, snapshots: true, format: Format::Npz, ..Output::default() };
    let path = folder.join(format!(".throughput.{}", std::process::id()));
    let mut phases = Phases::default();
    let removed = |done: Result<Timing>| {
        // Whatever the result of the run, its files are of no further use.
        let _ = std::fs::remove_dir_all(&path);
        done
    };
    phases.compute = removed(repeat(bench.repeats(), || {
        warm.up()?;
        let since = Instant::now();
        let folder = OutputFolder::create(&path, true)?;
        let mut go_on = |_| ControlFlow::Continue(());
        let report = run_to_folder(&case.engine, &plan, None, &output, folder, since, &mut go_on)?;
        phases.prepare = report.wall_time.run.prepare;
        phases.start = report.wall_time.run.start;
        phases.read = report.wall_time.run.read;
        phases.write = report.wall_time.format + report.wall_time.disk;
        Ok(report.wall_time.run.compute)
    }))?;
    Ok(phases)
}

/// The best rate of each engine and precision, as a table in Markdown.
pub fn summary(rows: &[Row]) -> String {
    let mut text = String::from(
        "| case | compute (s) | body-steps/s | of the FMA ceiling | set-up (s) | start (s) | read (s) | write (s) |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    for row in rows {
        text += &format!(
            "| {} | {:.1e} | {:.2e} | {:.2} | {:.1e} | {:.1e} | {:.1e} | {:.1e} |\n",
            row.text("case"),
            row.number("compute_seconds_median"),
            row.number("body_steps_per_second"),
            row.number("part_of_flops"),
            row.number("prepare_seconds"),
            row.number("start_seconds"),
            row.number("read_seconds"),
            row.number("write_seconds"),
        );
    }
    text
}
