//! `polhode status` and `polhode merge`: the parts of a study in one folder.

use std::path::Path;

use polhode::plan::PlanDocument;
use polhode::record::{OutputFolder, ShardState, ranges, status as states};
use polhode::run::{MergedReport, merge as merge_parts};
use polhode::study::Study;
use serde::Serialize;

use crate::arguments::{MergeArguments, StatusArguments};
use crate::output::{self, Failure};
use crate::progress::{self, Watch, catch_interrupts};

/// The most reasons of failures that are printed.
const MOST_REASONS: usize = 10;

/// The states of the parts, as JSON: lists of their numbers.
#[derive(Default, Serialize)]
struct Found {
    parts: usize,
    complete: Vec<usize>,
    running: Vec<usize>,
    failed: Vec<usize>,
    foreign: Vec<usize>,
    incomplete: Vec<usize>,
    missing: Vec<usize>,
    /// The parts to be run again, in the notation of array launchers.
    due: String,
}

impl Found {
    fn of(states: &[ShardState]) -> Self {
        let mut found = Self { parts: states.len(), ..Self::default() };
        let due: Vec<usize> = (1..).zip(states).filter(|(_, state)| state.is_due()).map(|(number, _)| number).collect();
        found.due = ranges(&due);
        for (number, state) in (1..).zip(states) {
            let list = match state {
                ShardState::Complete { .. } => &mut found.complete,
                ShardState::Running => &mut found.running,
                ShardState::Failed(_) => &mut found.failed,
                ShardState::Foreign(_) => &mut found.foreign,
                ShardState::Incomplete => &mut found.incomplete,
                ShardState::Missing => &mut found.missing,
            };
            list.push(number);
        }
        found
    }
}

/// Reports which parts are complete and which are to be run again.
pub fn status(arguments: &StatusArguments) -> Result<(), Failure> {
    let plan = arguments.plan.as_deref().map(PlanDocument::read).transpose()?;
    let study = arguments.study.as_deref().map(Study::read).transpose()?;
    let states = states(&arguments.folder, plan.as_ref(), study.as_ref())?;
    let found = Found::of(&states);
    if arguments.due {
        output::print(&format!("{}\n", found.due))?;
    } else if arguments.json {
        output::print(&format!("{}\n", serde_json::to_string_pretty(&found).unwrap_or_default()))?;
    } else {
        output::show(&summary(&states, &found))?;
    }
    Failure::reported_unless(found.complete.len() == found.parts)
}

fn summary(states: &[ShardState], found: &Found) -> String {
    let failed_bodies: usize = states
        .iter()
        .map(|state| if let ShardState::Complete { failed_bodies } = state { *failed_bodies } else { 0 })
        .sum();
    let mut text = format!("{} of {} parts are complete", found.complete.len(), found.parts);
    if failed_bodies > 0 {
        text += &format!("; {failed_bodies} of their bodies have failed");
    }
    text.push('\n');
    let lists = [
        ("running", &found.running),
        ("failed", &found.failed),
        ("foreign", &found.foreign),
        ("incomplete", &found.incomplete),
        ("missing", &found.missing),
    ];
    for (name, list) in lists.into_iter().filter(|(_, list)| !list.is_empty()) {
        text += &format!("  {name:<11} {}\n", ranges(list));
        let reasons = (1..).zip(states).filter_map(|(number, state): (usize, _)| match state {
            ShardState::Failed(reason) if name == "failed" => Some((number, reason)),
            ShardState::Foreign(reason) if name == "foreign" => Some((number, reason)),
            _ => None,
        });
        for (number, reason) in reasons.take(MOST_REASONS) {
            text += &format!("    part {number}: {reason}\n");
        }
    }
    if !found.due.is_empty() {
        let force =
            if found.foreign.is_empty() { "" } else { "; foreign ones with --force, which replaces their results" };
        text += &format!("  run again   {}{force}\n", found.due);
    }
    text
}

/// Merges the parts into the files of one run.
pub fn merge(arguments: &MergeArguments) -> Result<(), Failure> {
    catch_interrupts();
    progress::begin_run();
    let path = arguments.out.clone().unwrap_or_else(|| arguments.folder.join("merged"));
    let merged = merge_into(arguments, &path);
    progress::end_run();
    say_merged(&merged?, &path, (arguments.quiet, arguments.json))
}

/// Reports the result of merging parts in `path`.
pub fn say_merged(report: &MergedReport, path: &Path, (quiet, json): (bool, bool)) -> Result<(), Failure> {
    let (failed, bodies) = (report.failed_bodies.len(), report.bodies);
    if let Some(table) = report.files.iter().find(|name| failed > 0 && name.starts_with("failed.")) {
        output::note(&format!("warning: {failed} of {bodies} bodies have failed; {table} says which, when and why"));
    }
    let too_fast: u64 = report.parts.iter().filter_map(|part| part["outside_usable_region"].as_u64()).sum();
    if too_fast > 0 {
        output::note(&too_fast_in_a_step(too_fast, bodies));
    }
    if json {
        output::print(&report.to_json())?;
    } else if !quiet {
        let mut files = report.files.clone();
        files.push(polhode::record::REPORT.to_owned());
        let met = match report.accuracy.met {
            Some(true) => ", as asked for",
            Some(false) => ", NOT MET",
            None => "",
        };
        let error = report.accuracy.attitude_max.map_or_else(String::new, |error| {
            format!("  errors   attitude {error:.1e} rad at most in {} bodies{met}\n", report.accuracy.bodies)
        });
        let statistics = match report.statistical_met {
            Some(true) => "  asked    of statistics: met in all parts\n",
            Some(false) => "  asked    of statistics: NOT MET\n",
            None if report.parts.iter().any(|part| !part["statistical_accuracy"].is_null()) => {
                "  asked    of statistics: NOT SHOWN to be met in all parts\n"
            }
            None => "",
        };
        let found = report.statistics.as_ref().map_or_else(String::new, ToString::to_string);
        let events: String = report.events.iter().map(ToString::to_string).collect();
        output::show(&format!(
            "{} bodies of {} parts, {:.3e} body-steps in {:.1} s of all parts together\n{found}{events}{error}{statistics}  failed   {} bodies\n  results  {} in {}\n",
            report.bodies,
            report.shards,
            report.body_steps as f64,
            report.seconds,
            report.failed_bodies.len(),
            files.join(", "),
            path.display(),
        ))?;
    }
    if report.engines.len() > 1 {
        let engines: Vec<String> = report.engines.iter().map(|(name, parts)| format!("{name} ({parts})")).collect();
        output::note(&format!("note: parts were computed on several engines: {}", engines.join("; ")));
    }
    Failure::reported_unless(failed as u64 <= report.allowed_failures)
}

/// The message about bodies that turn too far in a pinned step.
pub fn too_fast_in_a_step(count: u64, bodies: usize) -> String {
    format!(
        "warning: {count} of {bodies} bodies turn further in a step than the method's usable region reaches: use a shorter dt \
         (`polhode bench stability` shows what happens)"
    )
}

fn merge_into(arguments: &MergeArguments, path: &Path) -> Result<MergedReport, Failure> {
    // Checked before the results' folder is made, so that a wrong folder of parts leaves nothing behind.
    states(&arguments.folder, None, None)?;
    let folder = OutputFolder::create(path, arguments.force)?;
    progress::remove_at_end(vec![folder.traces().clone()]);
    let mut watch = Watch::new(arguments.quiet);
    let merged = merge_parts(&arguments.folder, folder, &mut |progress| watch.observe(progress));
    watch.finish();
    Ok(merged?)
}
