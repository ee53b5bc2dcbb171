//! `polhode plan`.

use polhode::Plan;
use polhode::bodies::Blocks;
use polhode::plan::PlanDocument;
use polhode::run::write_plan;
use polhode::study::Study;

use crate::arguments::PlanArguments;
use crate::checkpoint::planned;
use crate::output::{self, Failure};
use crate::progress::planning;

/// Makes the plan of a study and writes it out.
pub fn plan(arguments: &PlanArguments) -> Result<(), Failure> {
    let study = Study::read(&arguments.study)?;
    if let Some(path) = &arguments.out {
        output::check_place(path, &study, arguments.force, |path| PlanDocument::read(path).is_ok())?;
    }
    let study = crate::engine::in_precision(study, &arguments.engine);
    let count = study.bodies().count;
    let bodies = planned(&study, arguments.no_skip).0;
    let scene = study.clone().part(bodies).scene()?.skipping(!arguments.no_skip);
    let engine = crate::engine::open(&arguments.engine, arguments.quiet)?;
    let costs = crate::engine::costs(arguments.costs.as_deref(), &engine)?;
    let planned = planning(arguments.quiet, |announce| Plan::announced(&scene, &engine, &costs, announce));
    let plan = planned.map_err(|error| study.located(error))?;
    let Some(path) = &arguments.out else { return output::print(&plan.to_json()) };
    write_plan(&plan, path)?;
    if !arguments.quiet {
        let blocks = Blocks::of(count);
        output::note(&format!(
            "{}: {} bodies in {} blocks of {}, so up to {} parts (`polhode run --shard`)",
            path.display(),
            count,
            blocks.count(),
            blocks.size(),
            blocks.count()
        ));
    }
    Ok(())
}
