//! `polhode verify`.

use polhode::study::{Study, problem};
use polhode::verify::{COLUMNS, Report, verify as verify_engine};
use polhode::{Method, Plan, Precision};
use serde_json::json;

use crate::arguments::VerifyArguments;
use crate::output::{self, Failure};

/// The step of the generated ensemble, s: its bodies turn by a tenth of a radian or less in it.
const GENERATED_STEP: f64 = 1.0 / 64.0;

/// Steps an engine beside its scalar twin and the reference.
pub fn verify(arguments: &VerifyArguments) -> Result<(), Failure> {
    let engine = crate::engine::open_for_verify(&arguments.engine)?;
    let wanted = crate::engine::precision(&arguments.engine);
    let (ensemble, method, precision, dt) = match &arguments.study {
        None => {
            let ensemble = problem::free(arguments.bodies, arguments.seed)?;
            (ensemble, Method::Rk4, wanted.unwrap_or(Precision::F32), GENERATED_STEP)
        }
        Some(file) => {
            let mut study = Study::read(file)?.truncated(arguments.bodies);
            if let Some(precision) = wanted {
                study = study.with_precision(precision);
            }
            let scene = study.scene()?.skipping(false);
            let plan = Plan::new(&scene, &engine).map_err(|error| study.located(error))?;
            (scene.ensemble().clone(), plan.method(), plan.precision(), plan.longest_step())
        }
    };
    let report = verify_engine(&engine, &ensemble, method, precision, dt, arguments.steps)?;
    if arguments.json {
        output::print(&json_text(&report))?
    } else {
        output::show(&table(&report))?
    }
    if report.agrees() { Ok(()) } else { Err(Failure::Disagreement) }
}

fn table(report: &Report) -> String {
    let mut text = format!(
        "{} bodies, {} steps of {:e} s, {} in {}\n",
        report.bodies, report.steps, report.dt, report.method, report.precision
    );
    for comparison in &report.comparisons {
        text += &format!("\n{}\n  against {}\n", comparison.sides[0], comparison.sides[1]);
        for ((column, _), largest) in COLUMNS.iter().zip(&comparison.largest) {
            text += &format!(
                "    {column:<26} at most {:>9.3} ulps, {:.2e} (body {}, step {})\n",
                largest.ulps, largest.absolute, largest.body, largest.step
            );
        }
        text += &match &comparison.parting {
            None => "    within the bound at every step\n".to_owned(),
            Some(parting) => format!(
                "    PARTS at step {}, body {}: {} differs by {:.3} ulps, the bound is {:.3}\n",
                parting.step, parting.body, parting.column, parting.ulps, parting.bound
            ),
        };
    }
    text += if report.agrees() { "\nverdict: they agree\n" } else { "\nverdict: THEY DO NOT AGREE\n" };
    text
}

fn json_text(report: &Report) -> String {
    let comparisons: Vec<_> = report
        .comparisons
        .iter()
        .map(|comparison| {
            let largest: Vec<_> = COLUMNS
                .iter()
                .zip(&comparison.largest)
                .map(|((column, _), largest)| {
                    json!({
                        "column": column, "ulps": largest.ulps, "absolute": largest.absolute,
                        "body": largest.body, "step": largest.step,
                    })
                })
                .collect();
            let parting = comparison.parting.map(|parting| {
                json!({
                    "step": parting.step, "body": parting.body, "column": parting.column,
                    "ulps": parting.ulps, "bound": parting.bound,
                })
            });
            json!({ "sides": comparison.sides, "largest": largest, "parting": parting })
        })
        .collect();
    let value = json!({
        "bodies": report.bodies, "steps": report.steps, "dt": report.dt, "method": report.method.name(),
        "precision": report.precision.name(), "agrees": report.agrees(), "comparisons": comparisons,
    });
    format!("{value:#}\n")
}
