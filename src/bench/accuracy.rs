//! Work-precision: wall time against attitude error, of every method on every problem.
//!
//! A case is a problem, a strategy and an engine. Only the compute phase is timed: set-up (principal axes, scaling, constants of the closed
//! form) and start (upload, shader compilation) have columns of their own, and reading back is not timed. Errors come from a run's first
//! repeat and are the same to the last digit in every run on a machine.

use std::path::Path;

use super::front::{self, Point};
use super::problem::{Errors, NAMES, Problem, Truth};
use super::row::Row;
use super::timing::Timing;
use super::{Bench, Case, Swept, Watcher, sweep};
use crate::bench::strategy::{self, Sample, Strategy};
use crate::bench::warm::Warm;
use crate::engine::{Engine, EngineKind};
use crate::error::Result;
use crate::kernel::method::Method;
use crate::kernel::method::rk8_adaptive::least_tolerance;
use crate::math::Precision;
use crate::math::Quantiles;

/// The table's name.
pub const TABLE: &str = "accuracy";

/// Number of bodies in a problem.
const BODIES: usize = 4096;
const QUICK_BODIES: usize = 256;

/// Numbers of steps over the span. 34, 100, 334 and 1000 are those of published tables; 640 and 2560 are steps of 2⁻⁶ and 2⁻⁸ s over
/// ten seconds.
const STEPS: [u64; 11] = [10, 20, 34, 50, 100, 200, 334, 640, 1000, 2560, 5000];
const QUICK_STEPS: [u64; 4] = [20, 100, 334, 1000];

/// Methods that a quick run on a GPU takes.
const QUICK_SHADERS: [Method; 4] = [Method::Rk4, Method::Rk8, Method::Cf4, Method::ImplicitMidpoint];

/// The separatrix problem lasts ten times as long as the others, and takes as many times the steps.
const LONG: u64 = 10;

/// Attitude errors asked for where the library chooses method and step, rad.
const TOLERANCES: [f64; 8] = [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9];
const QUICK_TOLERANCES: [f64; 3] = [1e-2, 1e-5, 1e-8];

/// Tolerances of adaptive steps, as far as the arithmetic allows.
const STEP_ERRORS: [f64; 9] = [1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-11, 1e-13];
const QUICK_STEP_ERRORS: [f64; 3] = [1e-4, 1e-6, 1e-9];

/// With an attitude error greater than this in the 99th percentile, rad, a result says nothing about where a body points, and a row fails
/// its check.
pub(crate) const GREATEST_ERROR: f64 = 0.1;

/// A problem, a strategy and an engine.
#[derive(Clone, Debug)]
pub struct AccuracyCase {
    /// One of [`NAMES`].
    pub problem: &'static str,
    /// The strategy by which it is solved.
    pub strategy: Strategy,
    /// The engine that solves it.
    pub engine: Engine,
}

impl Case for AccuracyCase {
    fn label(&self) -> String {
        let engine = self.engine.description().kind.name();
        let (method, precision) = (self.strategy.method(), self.strategy.precision());
        let amount = match self.strategy {
            Strategy::Stepped { steps, .. } => format!("{steps} steps"),
            Strategy::Adaptive { tolerance, .. } => format!("tolerance {tolerance:e}"),
            Strategy::ClosedForm { .. } => "1 evaluation".to_owned(),
            Strategy::Asked { tolerance } => format!("{tolerance:e} rad"),
        };
        format!("{}/{engine}/{method}/{precision}/{amount}", self.problem)
    }

    fn engine(&self) -> &Engine {
        &self.engine
    }
}

/// All cases: problem by problem, on each engine by each strategy.
pub fn cases(bench: &Bench) -> Vec<AccuracyCase> {
    let (steps, tolerances): (&[u64], &[f64]) =
        if bench.quick { (&QUICK_STEPS, &QUICK_TOLERANCES) } else { (&STEPS, &TOLERANCES) };
    let mut cases = Vec::new();
    for problem in NAMES {
        let free = matches!(problem, "free" | "separatrix");
        for engine in &bench.engines {
            let mut add = |strategy| cases.push(AccuracyCase { problem, strategy, engine: engine.clone() });
            // Shaders take long to compile, above all on a software adapter.
            let few = bench.quick && engine.description().kind == EngineKind::Gpu;
            for method in Method::ALL.into_iter().filter(|method| !few || QUICK_SHADERS.contains(method)) {
                for &precision in engine.precisions() {
                    for &steps in steps {
                        let steps = if problem == "separatrix" { LONG * steps } else { steps };
                        add(Strategy::Stepped { method, precision, steps });
                    }
                }
            }
            let among = if bench.quick { &QUICK_STEP_ERRORS[..] } else { &STEP_ERRORS[..] };
            for &precision in engine.precisions() {
                for &tolerance in among.iter().filter(|&&tolerance| tolerance >= least_tolerance(precision)) {
                    add(Strategy::Adaptive { method: Method::Rk8, precision, tolerance });
                }
            }
            if engine.description().kind == EngineKind::Cpu {
                for &tolerance in among {
                    add(Strategy::Adaptive { method: Method::Taylor, precision: Precision::F64, tolerance });
                }
            }
            if free {
                engine.precisions().iter().for_each(|&precision| add(Strategy::ClosedForm { precision }));
            }
            tolerances.iter().for_each(|&tolerance| add(Strategy::Asked { tolerance }));
        }
    }
    cases
}

/// Measures the cases and appends their rows to the table [`TABLE`] in `folder`.
///
/// # Errors
///
/// Those of the table and of the engines; rows measured before are kept.
pub fn run(bench: &Bench, folder: &Path, watcher: &mut Watcher<'_>) -> Result<Swept> {
    let bodies = if bench.quick { QUICK_BODIES } else { BODIES };
    let mut known: Option<(Problem, Truth)> = None;
    sweep(bench, folder, TABLE, &cases(bench), watcher, |case, warm| {
        if known.as_ref().is_none_or(|(problem, _)| problem.name != case.problem) {
            known = match Problem::named(case.problem, bodies)? {
                Some(problem) => {
                    let truth = Truth::of(&problem)?;
                    Some((problem, truth))
                }
                None => None,
            };
        }
        // Cases are made only of known names.
        let Some((problem, truth)) = &known else { return Ok(Row::new()) };
        measure(bench, case, (problem, truth), warm)
    })
}

/// The results of a case after its repeats.
#[derive(Debug, Default)]
struct Measured {
    /// Choice of method and step, s; 0 if they are given.
    planning: f64,
    sample: Sample,
    compute: Timing,
    errors: Errors,
    /// Why it failed its check; empty if it passed.
    fault: String,
}

/// Measures one case; a case that the library refuses becomes a row that failed its check.
fn measure(bench: &Bench, case: &AccuracyCase, (problem, truth): (&Problem, &Truth), warm: &mut Warm) -> Result<Row> {
    let measured = match repeated(bench, case, (problem, truth), warm) {
        Err(refusal) if refusal.is_input() => Measured::refused(refusal.to_string()),
        other => other?,
    };
    Ok(measured.row(case, problem, truth))
}

fn repeated(
    bench: &Bench,
    case: &AccuracyCase,
    (problem, truth): (&Problem, &Truth),
    warm: &mut Warm,
) -> Result<Measured> {
    let (planning, sample, compute) = strategy::repeated(bench.repeats(), &case.engine, problem, case.strategy, warm)?;
    let errors = truth.errors(&sample.states);
    let fault = fault(&errors, case.strategy);
    Ok(Measured { planning, sample, compute, errors, fault })
}

/// Why a result fails its check; empty if it passes.
fn fault(errors: &Errors, strategy: Strategy) -> String {
    let error = errors.attitude.p99;
    match strategy {
        _ if errors.failed > 0 => format!("{} bodies failed", errors.failed),
        Strategy::Asked { tolerance } if error > tolerance => {
            format!("attitude error {error:.1e} rad at the 99th percentile; {tolerance:e} was asked for")
        }
        _ if error > GREATEST_ERROR => format!("attitude error above {GREATEST_ERROR} rad at the 99th percentile"),
        _ => String::new(),
    }
}

impl Measured {
    /// The results for a case that the library refused: unknown.
    fn refused(fault: String) -> Self {
        let nothing = Quantiles::UNKNOWN;
        let errors = Errors { failed: 0, attitude: nothing, kinetic_energy: nothing, angular_momentum_world: nothing };
        Self { compute: Timing::UNKNOWN, errors, fault, ..Self::default() }
    }

    fn row(&self, case: &AccuracyCase, problem: &Problem, truth: &Truth) -> Row {
        let bodies = problem.ensemble.len();
        let (steps, tolerance) = match case.strategy {
            Strategy::Stepped { steps, .. } => (steps as f64, f64::NAN),
            Strategy::Adaptive { tolerance, .. } => (self.sample.body_steps as f64 / bodies as f64, tolerance),
            Strategy::ClosedForm { .. } => (0.0, f64::NAN),
            Strategy::Asked { tolerance } => (self.sample.body_steps as f64 / bodies as f64, tolerance),
        };
        let seconds = self.compute.median;
        let rate = |amount: f64| if seconds > 0.0 { amount / seconds } else { f64::NAN };
        Row::new()
            .with("problem", problem.name)
            .with("method", case.strategy.method())
            .with("precision", case.strategy.precision())
            .with("bodies", bodies)
            .with("span_s", problem.span)
            .with("steps_mean", steps)
            .with("tolerance_rad", tolerance)
            .with("repeats", self.compute.repeats)
            .with("seconds_median", seconds)
            .with("seconds_min", self.compute.least)
            .with("seconds_spread", self.compute.spread)
            .with("plan_seconds", self.planning)
            .with("prepare_seconds", self.sample.prepare)
            .with("start_seconds", self.sample.start)
            .with("body_steps_per_second", rate(self.sample.body_steps as f64))
            .with("body_seconds_per_second", rate(bodies as f64 * problem.span))
            .with_quantiles("attitude_rad", &self.errors.attitude)
            .with_quantiles("energy_drift", &self.errors.kinetic_energy)
            .with_quantiles("momentum_drift", &self.errors.angular_momentum_world)
            .with("truth", truth.source)
            .with("truth_uncertainty_rad_p99", truth.uncertainty.p99)
            .with("failed_bodies", self.errors.failed)
            .with("valid", self.fault.is_empty())
            .with("fault", self.fault.as_str())
    }
}

/// A row as a point of a work-precision diagram. An error below the truth's uncertainty counts as that uncertainty.
pub fn point(row: &Row) -> Point {
    Point {
        seconds: row.number("seconds_median"),
        error: row.number("attitude_rad_p99").max(row.number("truth_uncertainty_rad_p99")),
        valid: row.flag("valid"),
    }
}

/// For each problem and error decade the fastest row that passed its check, as a table in Markdown.
///
/// Times for different numbers of bodies are not comparable, so the rows must be of one mode (`quick` or not).
pub fn summary(rows: &[Row]) -> String {
    let mut text = String::from(
        "| problem | error (rad) | fastest | engine | steps | compute (s) | body-s/s | p99 (rad) |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    for problem in NAMES {
        let of_problem: Vec<&Row> = rows.iter().filter(|row| row.text("problem") == problem).collect();
        let points: Vec<Point> = of_problem.iter().map(|row| point(row)).collect();
        for (exponent, index) in front::fastest_by_decade(&points) {
            let row = of_problem[index];
            text += &format!(
                "| {problem} | 1e{exponent} | {} {} | {} | {:.0} | {:.1e} | {:.1e} | {:.1e} |\n",
                row.text("method"),
                row.text("precision"),
                row.text("engine"),
                row.number("steps_mean"),
                row.number("seconds_median"),
                row.number("body_seconds_per_second"),
                row.number("attitude_rad_p99"),
            );
        }
    }
    text
}
