//! `polhode verify`.

use polhode::study::{Study, problem};
use polhode::verify::{Options, verify as verify_engine};
use polhode::{Method, Scene};

use crate::arguments::VerifyArguments;
use crate::output::{self, Failure};

/// A study is planned with no more of its bodies than these: with them a plan is that of the run, or nearly.
const MOST_PLANNED: usize = 200_000;

/// The step for the generated ensemble, s: its bodies turn by at most a tenth of a radian in it.
const GENERATED_STEP: f64 = 1.0 / 64.0;

/// Compares an engine with its scalar twin and the reference, step by step.
pub fn verify(arguments: &VerifyArguments) -> Result<(), Failure> {
    let options = Options {
        steps: arguments.steps,
        from_step: arguments.from_step,
        body: arguments.body,
        bodies: Some(arguments.bodies),
        ..Options::default()
    };
    let wanted = crate::engine::precision(&arguments.engine);
    let study = match &arguments.study {
        None => None,
        Some(file) => {
            let study = Study::read(file)?.truncated(MOST_PLANNED.max(arguments.bodies));
            Some(crate::engine::in_precision(study, &arguments.engine))
        }
    };
    let scene = match &study {
        Some(study) => study.scene()?,
        None => {
            let end = GENERATED_STEP * options.from_step.saturating_add(options.steps) as f64;
            let ensemble = problem::free(arguments.bodies, arguments.seed)?;
            Scene::new(ensemble).until(end).pinned(Method::Rk4, GENERATED_STEP, wanted)
        }
    };
    let engine = crate::engine::open_for_verify(&arguments.engine)?;
    let report = verify_engine(&engine, &scene, &options).map_err(|error| match &study {
        Some(study) => study.located(error),
        None => error,
    })?;
    if arguments.json {
        output::print(&report.to_json())?;
    } else {
        output::show(&report.to_string())?;
    }
    Failure::reported_unless(report.agrees())
}
