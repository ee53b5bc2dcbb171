//! `polhode explain`.

use polhode::Plan;
use polhode::study::Study;

use crate::arguments::ExplainArguments;
use crate::checkpoint::planned;
use crate::output::{self, Failure};
use crate::progress::planning;

/// Prints what a study would run, what it leaves out, and why.
pub fn explain(arguments: &ExplainArguments) -> Result<(), Failure> {
    let study = crate::engine::in_precision(Study::read(&arguments.study)?, &arguments.engine);
    // The explanation says where these are not all.
    let bodies = planned(&study, arguments.no_skip).0;
    let mut scene = study.clone().part(bodies).scene()?.skipping(!arguments.no_skip);
    if arguments.no_pilot {
        scene = scene.without_pilot();
    }
    let engine = crate::engine::open(&arguments.engine, arguments.json)?;
    let costs = crate::engine::costs(arguments.costs.as_deref(), &engine)?;
    let planned = planning(arguments.json, |announce| Plan::announced(&scene, &engine, &costs, announce));
    let plan = planned.map_err(|error| study.located(error))?;
    let explanation = plan.explain();
    if arguments.json { output::print(&explanation.to_json()) } else { output::show(&explanation.to_string()) }
}
