//! Every kernel of an engine compared with the machine's ceilings, multiply-adds and copies, measured on the same engine; with the
//! error that belongs to the speed, and the transfers between host and device in a run.

use std::collections::HashMap;
use std::path::Path;

use super::ceiling::{Ceiling, ceiling};
use super::problem::{Problem, Truth};
use super::row::Row;
use super::strategy::{self, Strategy};
use super::warm::Warm;
use super::{Bench, Case, Swept, Watcher, sweep};
use crate::bodies::columns::state_columns;
use crate::engine::{Backend, Engine, EngineKind};
use crate::error::Result;
use crate::kernel::free_motion::{ROW_COLUMNS, WORD_COLUMNS};
use crate::kernel::method::Method;
use crate::kernel::method::rk8_adaptive::least_tolerance;
use crate::math::Precision;

/// The table's name.
pub const TABLE: &str = "kernels";

/// One kernel on one engine.
#[derive(Clone, Debug)]
pub struct KernelCase {
    engine: Engine,
    problem: &'static str,
    strategy: Strategy,
    precision: Precision,
    bodies: usize,
}

impl KernelCase {
    /// How many times 10 s its span is.
    fn factor(&self) -> u32 {
        if matches!(self.strategy, Strategy::Adaptive { method: Method::Rk8, .. }) { LONGER } else { 1 }
    }
}

impl Case for KernelCase {
    fn label(&self) -> String {
        let engine = self.engine.description().kind.name();
        format!("{}/{engine}/{}/{}", self.problem, self.strategy.method(), self.precision)
    }

    fn engine(&self) -> &Engine {
        &self.engine
    }
}

/// Equal steps of 1/64 s over the span of 10 s.
const STEPS: u64 = 640;

/// Operations in an evaluation of the equations of motion including its share of the step's sums, as counted for `rk4`
/// ([`super::throughput`]). The fraction of the ceiling is accordingly an estimate, for comparing engines and machines.
const OPERATIONS: f64 = 313.0 / 4.0;

/// By which factor the span of adaptive steps of `rk8` is longer: some hundred attempts, so that loading and storing a body do not show.
const LONGER: u32 = 10;

/// Bodies, the first of all, whose errors are found over the span of 10 s: their truth takes much longer than what is timed.
const COMPARED: usize = 1 << 14;

/// Bodies in closed form on a GPU: an evaluation of fewer takes no longer than its submission.
const OF_CLOSED_FORM: usize = 1 << 21;

/// All cases.
pub fn cases(bench: &Bench) -> Vec<KernelCase> {
    let mut cases = Vec::new();
    for engine in &bench.engines {
        let description = engine.description();
        // Enough bodies to fill a GPU; a software adapter is not one.
        let is_gpu = description.kind == EngineKind::Gpu && !description.software;
        let bodies = match (bench.quick, is_gpu) {
            (true, _) => 1 << 12,
            (false, false) => 1 << 16,
            (false, true) => 1 << 20,
        };
        for &precision in engine.precisions() {
            let mut add = |problem, strategy| {
                let is_large = is_gpu && !bench.quick && matches!(strategy, Strategy::ClosedForm { .. });
                let bodies = if is_large { OF_CLOSED_FORM } else { bodies };
                cases.push(KernelCase { engine: engine.clone(), problem, strategy, precision, bodies });
            };
            let tolerance = least_tolerance(precision).max(1e-9);
            for problem in ["free", "forced"] {
                for method in Method::ALL {
                    add(problem, Strategy::Stepped { method, precision, steps: STEPS });
                }
                add(problem, Strategy::Adaptive { method: Method::Rk8, precision, tolerance });
                if precision == Precision::F64 && engine.speed_of_series().is_some() {
                    add(problem, Strategy::Adaptive { method: Method::Taylor, precision, tolerance });
                }
            }
            add("free", Strategy::ClosedForm { precision });
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
    let mut ceilings: HashMap<(String, Precision), Ceiling> = HashMap::new();
    let mut known: HashMap<(&'static str, usize, u32), (Problem, Truth)> = HashMap::new();
    sweep(bench, folder, TABLE, &cases(bench), watcher, |case, warm| {
        let description = case.engine.description();
        let key = (description.name.clone(), case.precision);
        let most = match ceilings.get(&key) {
            Some(most) => *most,
            None => ceiling(&description, case.precision)?,
        };
        ceilings.insert(key, most);
        let factor = case.factor();
        let place = (case.problem, case.bodies, factor);
        let compared = case.bodies.min(COMPARED / factor as usize);
        if !known.contains_key(&place)
            && let Some(problem) = Problem::named(case.problem, case.bodies)?
            && let Some(compared) = Problem::named(case.problem, compared)?
        {
            known.insert(place, (problem.longer(factor), Truth::of(&compared.longer(factor))?));
        }
        // Cases are made only of known names.
        let Some((problem, truth)) = known.get(&place) else { return Ok(Row::new()) };
        measure(bench, case, (problem, truth), most, warm)
    })
}

fn measure(
    bench: &Bench,
    case: &KernelCase,
    (problem, truth): (&Problem, &Truth),
    most: Ceiling,
    warm: &mut Warm,
) -> Result<Row> {
    let before = case.engine.traffic();
    // Of bodies that wait for the slowest of their workgroup.
    let mut imbalance = f64::NAN;
    let (sample, compute) = match case.strategy {
        // Without a plan, so that the device can be warmed up just before.
        Strategy::Adaptive { method: Method::Rk8, precision, tolerance } => strategy::timed(bench.repeats(), || {
            let (sample, of_session) = strategy::adaptive(&case.engine, problem, precision, tolerance, warm)?;
            imbalance = of_session;
            Ok(sample)
        })?,
        other => {
            let (_, sample, compute) = strategy::repeated(bench.repeats(), &case.engine, problem, other, warm)?;
            (sample, compute)
        }
    };
    let traffic = case.engine.traffic().since(before);
    let errors = truth.errors(&sample.states);
    let of_run = |count: u64| count as f64 / compute.repeats.max(1) as f64;
    let evaluations = match case.strategy {
        // For other methods a step does not consist of so many evaluations and their sums.
        Strategy::Stepped { method, .. } | Strategy::Adaptive { method, .. }
            if matches!(method, Method::Rk4 | Method::Rk8 | Method::Cf4) =>
        {
            sample.body_steps as f64 * f64::from(method.properties().evaluations)
        }
        _ => f64::NAN,
    };
    let moved = match case.strategy {
        Strategy::ClosedForm { precision } => problem.ensemble.len() as f64 * bytes_of_evaluation(precision),
        _ => f64::NAN,
    };
    let rate = |amount: f64| amount / compute.median;
    Ok(Row::new()
        .with("problem", case.problem)
        .with("method", case.strategy.method())
        .with("precision", case.precision.name())
        .with("bodies", case.bodies)
        .with("body_steps", sample.body_steps)
        .with("repeats", compute.repeats)
        .with("seconds_median", compute.median)
        .with("seconds_min", compute.least)
        .with("seconds_spread", compute.spread)
        .with("body_steps_per_second", rate(sample.body_steps as f64))
        .with_quantiles("attitude_rad", &errors.attitude)
        .with("failed_bodies", errors.failed)
        .with("imbalance", imbalance)
        .with("ceiling_flops", most.flops)
        .with("ceiling_bytes_per_second", most.bandwidth)
        .with("part_of_flops", rate(evaluations * OPERATIONS) / most.flops)
        .with("part_of_copies", rate(moved) / most.bandwidth)
        .with("device_waits", of_run(traffic.waits))
        .with("dispatches", of_run(traffic.dispatches))
        .with("bytes_written", of_run(traffic.bytes_written))
        .with("bytes_read", of_run(traffic.bytes_read)))
}

/// Bytes of the device's memory that one evaluation of a closed form reads and writes.
fn bytes_of_evaluation(precision: Precision) -> f64 {
    let (size, columns) = match precision {
        Precision::F32 => (size_of::<f32>(), state_columns::<f32>()),
        Precision::F64 => (size_of::<f64>(), state_columns::<f64>()),
    };
    (WORD_COLUMNS * size_of::<u64>() + (ROW_COLUMNS + columns) * size) as f64
}

/// The rows as a table in Markdown.
pub fn summary(rows: &[Row]) -> String {
    let mut text = String::from(
        "| case | body-steps/s | error, p99 (rad) | of the FMA ceiling | of the copy ceiling | waits | dispatches | MiB to and from |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    let part = |part: f64| if part.is_nan() { "–".to_owned() } else { format!("{part:.2}") };
    for row in rows {
        text += &format!(
            "| {} | {:.2e} | {:.1e} | {} | {} | {:.0} | {:.0} | {:.1} |\n",
            row.text("case"),
            row.number("body_steps_per_second"),
            row.number("attitude_rad_p99"),
            part(row.number("part_of_flops")),
            part(row.number("part_of_copies")),
            row.number("device_waits"),
            row.number("dispatches"),
            (row.number("bytes_written") + row.number("bytes_read")) / f64::from(1 << 20),
        );
    }
    text
}
