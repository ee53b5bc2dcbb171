//! `polhode run` with checkpoints: some bodies at a time, so that `--resume` can continue.

use std::ops::{ControlFlow, Range};
use std::path::{Path, PathBuf};
use std::time::Duration;

use polhode::plan::PlanDocument;
use polhode::record::OutputFolder;
use polhode::run::{Checkpoint, MergedReport, OutputSize};
use polhode::study::Study;
use serde_json::Value;

use crate::arguments::RunArguments;
use crate::output::{self, Failure};
use crate::progress::{self, Watch};
use crate::run::{LONG, check_disk, check_time, plan, say_leftovers, say_what_is_doubtful};
use crate::shards::say_merged;

/// The default time between two checkpoints.
const EVERY: Duration = Duration::from_secs(60);

/// The bodies from which the plan of a study is made, and whether these are only some.
pub fn planned(study: &Study, no_skip: bool) -> (Range<usize>, bool) {
    let all = study.bodies().count;
    // Without skipping all are stepped alike, as finely as the fastest needs.
    let planned = if no_skip { 0..all } else { Checkpoint::planned_bodies(study) };
    let is_sample = planned.len() < all;
    (planned, is_sample)
}

/// The time between two checkpoints that was asked for: by this command, by the run that it continues into a folder, or by the study.
fn asked(arguments: &RunArguments, study: &Study, path: &Path) -> Option<Duration> {
    let noted = || arguments.resume.then(|| Checkpoint::interval(&Checkpoint::folder_of(path))).flatten();
    arguments.checkpoint.or_else(noted).or_else(|| study.checkpoint())
}

/// The time between two checkpoints, if a run into a folder has any: on request, and if the plan is made from only some of the bodies, so
/// that not all need to be in memory together.
pub fn every(arguments: &RunArguments, study: &Study, path: &Path) -> Option<Duration> {
    let is_default = arguments.resume || arguments.plan.is_none() && planned(study, arguments.no_skip).1;
    let every = asked(arguments, study, path).or(is_default.then_some(EVERY));
    // A part is a checkpoint itself, and without bodies there is none.
    every.filter(|_| arguments.shard.is_none() && study.bodies().count > 0)
}

/// The report of the finished run of a study in a folder, unless a run that was to replace its results can be continued.
pub fn finished(arguments: &RunArguments, study: &Study, path: &Path) -> Option<Value> {
    let place = Checkpoint::folder_of(path);
    if Checkpoint::replaces(&place, path) {
        return None;
    }
    let study = crate::engine::in_precision(study.clone(), &arguments.engine);
    let report = Checkpoint::finished(path, &study, !arguments.no_skip)?;
    // A kill between the last two moments of the run has left its pieces beside the results.
    if Checkpoint::find(&place, &study)
        .is_ok_and(|left| left.is_none_or(|left| left.bodies_done() == left.body_count()))
    {
        Checkpoint::remove(&place);
    }
    Some(report)
}

/// Says that `--resume` has nothing to do, and ends as the finished run did.
pub fn say_finished(arguments: &RunArguments, study: &Study, report: &Value, path: &Path) -> Result<(), Failure> {
    if !arguments.quiet {
        let path = path.display();
        output::note(&format!(
            "note: {path} has all results of this study: the run is complete, nothing is left to do"
        ));
    }
    if arguments.json {
        output::print(&(serde_json::to_string_pretty(report).unwrap_or_default() + "\n"))?;
    }
    let failed = report["failed_bodies"].as_array().map_or(0, Vec::len);
    if failed > 0 {
        output::note(&format!("warning: {failed} of {} bodies have failed", report["bodies"]));
    }
    // The report of a run in pieces has those of its pieces.
    let own = std::slice::from_ref(report);
    let parts = report["parts"].as_array().map_or(own, Vec::as_slice);
    let is_asked = |what: &dyn Fn(&Value) -> bool| parts.iter().any(what);
    let of_states = is_asked(&|part| !part["accuracy"]["target"].is_null());
    let of_statistics = is_asked(&|part| !part["statistical_accuracy"].is_null());
    let is_met = [&report["statistical_met"], &report["statistical_accuracy"]["met"]].contains(&&Value::Bool(true));
    let is_missed = of_states && report["accuracy"]["met"] != true || of_statistics && !is_met;
    Failure::reported_unless(failed as u64 <= study.allowed_failures() && !(arguments.strict && is_missed))
}

/// Runs a study, or the rest of it, into a folder.
pub fn run(arguments: &RunArguments, study: Study, path: &Path, every: Duration) -> Result<(), Failure> {
    let report = run_until_written(arguments, study, path, every)?;
    say_merged(&report, path, (arguments.quiet, arguments.json))?;
    let is_asked = report.parts.iter().any(|part| !part["accuracy"]["target"].is_null());
    let is_missed = is_asked && report.accuracy.met != Some(true);
    let of_statistics = report.parts.iter().any(|part| !part["statistical_accuracy"].is_null());
    let is_missed = is_missed || of_statistics && report.statistical_met != Some(true);
    Failure::reported_unless(!(arguments.strict && is_missed))
}

fn run_until_written(
    arguments: &RunArguments,
    study: Study,
    path: &Path,
    every: Duration,
) -> Result<MergedReport, Failure> {
    let study = crate::engine::in_precision(study, &arguments.engine);
    let document = arguments.plan.as_deref().map(PlanDocument::read).transpose()?;
    let place = Checkpoint::folder_of(path);
    let replaces = arguments.force || arguments.resume && Checkpoint::replaces(&place, path);
    let mut folder = OutputFolder::create(path, replaces).map_err(|error| match error {
        // `--force` beside `--resume` is refused.
        polhode::Error::FolderNotEmpty { path } if arguments.resume => Failure::Input(format!(
            "{}: the output folder is not empty, and --resume replaces no results but those that its run was to replace: move them away, or begin anew with --force",
            path.display()
        )),
        error => error.into(),
    })?;
    let traces = folder.traces().clone();
    progress::remove_at_end(vec![traces.clone()]);
    say_leftovers(&folder);
    if arguments.force {
        Checkpoint::remove(&place);
    }
    let found = Checkpoint::find(&place, &study).map_err(|error| {
        Failure::Input(format!("{error}: {} cannot be resumed; --force removes it and starts anew", place.display()))
    })?;
    let engine = crate::engine::open_for_run(arguments)?;
    // A user who asks for checkpoints wants what is computed to be kept, and waits for it.
    let is_asked = asked(arguments, &study, path).is_some();
    let mut checkpoint = match found {
        Some(found) if !arguments.resume && found.bodies_done() > 0 => {
            let (done, all) = (found.bodies_done(), found.body_count());
            let place = place.display();
            return Err(Failure::Input(format!(
                "{place} has {done} of {all} bodies of a run that was not finished: --resume continues it, --force starts anew"
            )));
        }
        Some(found) if arguments.resume => {
            let (planned, here) = (found.plan().engine(), engine.description().name_of_arithmetic());
            if planned != here {
                return Err(Failure::Input(format!(
                    "--resume: the run was begun on {planned}, this is {here}, whose bits may differ: choose the engine of the run, or begin anew with --force"
                )));
            }
            if found.plan().may_skip() == arguments.no_skip {
                let [begun, here] = [!arguments.no_skip, arguments.no_skip].map(|without| match without {
                    true => "without skipping (--no-skip)",
                    false => "with skipping",
                });
                return Err(Failure::Input(format!(
                    "--resume: the run was begun {begun}, this is {here}: choose what the run was begun with, or begin anew with --force"
                )));
            }
            for lost in found.lost() {
                let (first, last) = (lost.bodies.start, lost.bodies.end - 1);
                output::note(&format!("note: bodies {first} to {last} are computed again: {}", lost.reason));
            }
            found
        }
        // A checkpoint without pieces is not worth a question.
        _ => {
            Checkpoint::remove(&place);
            if arguments.resume && !arguments.quiet {
                output::note(&format!("note: there is no {}: the run starts from the beginning", place.display()));
            }
            let all = study.bodies().count;
            let planned = if document.is_some() { 0..all } else { planned(&study, arguments.no_skip).0 };
            let scene = study.clone().part(planned.clone()).scene()?.skipping(!arguments.no_skip);
            say_what_is_doubtful(&study, &scene, arguments.quiet);
            let plan = plan(arguments, (&study, &scene), &engine, document.as_ref())?;
            let of_all = all as f64 / planned.len() as f64;
            // Starting again takes no longer than continuing.
            let is_short = plan.explain().seconds().is_some_and(|seconds| seconds * of_all < LONG);
            let is_through = is_short && !(is_asked || arguments.resume || study.output().snapshots);
            // Pieces are kept until they are merged.
            let OutputSize { rows, least_bytes, likely_bytes } = OutputSize::of(&plan, study.output());
            let in_all = |count: u64, times: u64| ((count as f64 * of_all) as u64).saturating_mul(times);
            let copies = if is_through { 1 } else { 2 };
            let size = OutputSize {
                rows: in_all(rows, 1),
                least_bytes: in_all(least_bytes, copies),
                likely_bytes: in_all(likely_bytes, copies),
            };
            check_disk(&folder, size, arguments.quiet)?;
            check_time(&plan, &study, of_all, arguments)?;
            progress::leave(Err(place.clone()));
            let mut checkpoint = Checkpoint::begin(&place, &plan)?;
            if is_through {
                checkpoint.write_through(&study, &plan, &mut folder)?;
            } else if replaces && has_files(path) {
                checkpoint.note_replaced(path)?;
            }
            checkpoint
        }
    };
    if let Some(every) = arguments.checkpoint {
        checkpoint.note_interval(every)?;
    }
    let mut watch = Watch::new(arguments.quiet);
    let mut begun = |checkpoint: &Checkpoint, bodies: Range<usize>, piece: &_| {
        progress::remove_at_end(vec![Clone::clone(piece), traces.clone()]);
        progress::leave(left(arguments, checkpoint, path));
        let piece = is_asked.then(|| format!("bodies {} to {}", bodies.start, bodies.end - 1));
        progress::finish_before_the_end(piece)
    };
    let mut observe = |progress| {
        let stop = watch.observe(progress);
        if is_asked { ControlFlow::Continue(()) } else { stop }
    };
    let computed = checkpoint.advance(&engine, &study, every, &mut begun, &mut observe);
    let _ = progress::finish_before_the_end(None);
    watch.finish();
    progress::leave(left(arguments, &checkpoint, path));
    progress::remove_at_end(vec![traces]);
    computed.map_err(|error| -> Failure {
        match left(arguments, &checkpoint, path) {
            Ok(left) if !(error.is_input() || matches!(error, polhode::Error::Interrupted { .. })) => {
                output::note(&format!("note: {left}"));
            }
            Ok(_) => {}
            Err(_) => progress::remove_empty(),
        }
        match error {
            polhode::Error::PlanMismatch { field, planned, found, .. } => Failure::Input(format!(
                "--resume: {field} is {planned} in {}, {found} in the study: choose what the run was begun with, or begin anew with --force",
                place.display()
            )),
            error => study.located(error).into(),
        }
    })?;
    let mut watch = Watch::new(arguments.quiet);
    let merged = checkpoint.finish(folder, &mut |progress| watch.observe(progress));
    watch.finish();
    Ok(merged?)
}

/// Whether a folder is there and has anything in it.
fn has_files(folder: &Path) -> bool {
    std::fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_some())
}

/// What exists of a run that is stopped now, and how to continue it; if it cannot be continued, the folder that is of no use.
fn left(arguments: &RunArguments, checkpoint: &Checkpoint, path: &Path) -> Result<String, PathBuf> {
    let (done, all) = (checkpoint.bodies_done(), checkpoint.body_count());
    let place = Checkpoint::folder_of(path);
    if !checkpoint.is_kept() {
        return Err(place);
    }
    let out = arguments.out.as_ref().map_or_else(String::new, |out| format!(" --out {}", out.display()));
    let skipping = if arguments.no_skip { " --no-skip" } else { "" };
    let (study, engine) = (arguments.study.display(), arguments.engine.chosen());
    Ok(format!(
        "{done} of {all} bodies are in {}; `polhode run {study}{out}{engine}{skipping} --resume` continues the run",
        place.display()
    ))
}
