//! `polhode run`.

use std::path::{Path, PathBuf};
use std::time::Instant;

use polhode::bodies::Blocks;
use polhode::plan::PlanDocument;
use polhode::plan::explain::SampleRow;
use polhode::record::{OutputFolder, Report, Shard, is_complete};
use polhode::run::{OutputSize, run_part_to_folder, run_to_folder};
use polhode::study::Study;
use polhode::{Engine, Plan, Scene};

use crate::arguments::RunArguments;
use crate::checkpoint;
use crate::launcher::{self, ShardArgument};
use crate::output::{self, Failure};
use crate::progress::{self, Watch, catch_interrupts};
use crate::shards::too_fast_in_a_step;

/// Results of this many bytes or more are announced.
const LARGE: u64 = 10_000_000_000;

/// Runs that are expected to take this long, s, are announced; if they are computed in pieces and stopped, what they have computed is kept.
pub const LONG: f64 = 600.0;
/// Runs that are expected to take longer than this, s, are refused.
const MOST: f64 = 30.0 * DAY;
const DAY: f64 = 86_400.0;

/// A recomputed sample that is expected to take this long, s, and this fraction of the run, is announced.
const DEAR_SAMPLE: f64 = 2.0;
const SHARE_OF_SAMPLE: f64 = 0.1;

/// Runs a study into a folder.
pub fn run(arguments: &RunArguments) -> Result<(), Failure> {
    catch_interrupts();
    progress::begin_run();
    let part = match arguments.shard {
        None => None,
        Some(ShardArgument::Given(shard)) => Some(shard),
        Some(ShardArgument::Auto(count)) => {
            let found = launcher::find(count, |name| std::env::var(name).ok()).map_err(Failure::Input)?;
            let (shard, from) = found;
            output::note(&format!("part {shard} ({from})"));
            Some(shard)
        }
    };
    let all = arguments.out.clone().unwrap_or_else(|| default_folder(&arguments.study));
    let since = Instant::now();
    let study = Study::read(&arguments.study)?;
    say_if_there_are_no_bodies(&study);
    if arguments.resume
        && let Some(report) = checkpoint::finished(arguments, &study, &all)
    {
        progress::end_run();
        return checkpoint::say_finished(arguments, &study, &report, &all);
    }
    if let Some(every) = checkpoint::every(arguments, &study, &all) {
        let done = checkpoint::run(arguments, study, &all, every);
        progress::end_run();
        return done;
    }
    let done = run_until_written(arguments, (study, since), (part, &all));
    progress::end_run();
    match (&done, part) {
        (Ok(_), Some(shard)) => shard.forget_failure(&all),
        (Err(failure), Some(shard)) => {
            if let Some(reason) = failure.reason().filter(|_| all.is_dir()) {
                shard.leave_failure(&all, &reason);
            }
        }
        (_, None) => {}
    }
    match done? {
        Some((study, report, path)) => say_what_is_written(arguments, &study, &report, &path),
        None => Ok(()),
    }
}

/// The study, the outcome, and its folder; `None` if the part is complete already.
fn run_until_written(
    arguments: &RunArguments,
    (study, since): (Study, Instant),
    (part, all): (Option<Shard>, &Path),
) -> Result<Option<(Study, Report, PathBuf)>, Failure> {
    let mut study = crate::engine::in_precision(study, &arguments.engine);
    let document = arguments.plan.as_deref().map(PlanDocument::read).transpose()?;
    // The folder is tried before anything that takes long.
    let path = part.map_or_else(|| all.to_owned(), |shard| shard.folder(all));
    if let Some((shard, document)) = part.zip(document.as_ref()) {
        if !arguments.force && is_complete(shard, all, document, &study) {
            output::note(&format!("part {shard} is complete already, of this study and plan: nothing to do"));
            return Ok(None);
        }
        let count = study.bodies().count;
        let bodies = shard.bodies(count).ok_or_else(|| {
            let blocks = Blocks::of(count).count();
            Failure::Input(format!("--shard {shard}: expected up to {blocks} parts of the study's {count} bodies"))
        })?;
        study = study.part(bodies);
    }
    let folder = OutputFolder::create(&path, arguments.force)?;
    progress::remove_at_end(vec![folder.traces().clone()]);
    say_leftovers(&folder);
    say_unfinished(&path, part.is_some());
    let scene = study.scene()?.skipping(!arguments.no_skip);
    let wanted = study.output();
    say_what_is_doubtful(&study, &scene, arguments.quiet);
    let engine = crate::engine::open_for_run(arguments)?;
    let plan = plan(arguments, (&study, &scene), &engine, document.as_ref())?;

    check_disk(&folder, OutputSize::of(&plan, wanted), arguments.quiet)?;
    let sample = check_time(&plan, &study, 1.0, arguments)?;
    let mut watch = Watch::new(arguments.quiet).with_sample(sample);
    let mut observe = |progress| watch.observe(progress);
    let done = match document.as_ref().filter(|_| part.is_some()) {
        None => run_to_folder(&engine, &plan, Some(&study), wanted, folder, since, &mut observe),
        Some(document) => run_part_to_folder(&engine, &plan, &study, document, folder, since, &mut observe),
    };
    watch.finish();
    let report = done?;
    Ok(Some((study, report, path)))
}

/// Reports what killed runs had left in a folder.
pub fn say_leftovers(folder: &OutputFolder) {
    for leftover in folder.leftovers() {
        output::note(&format!("note: removed what a killed run had left: {}", leftover.display()));
    }
}

/// Reports that there are checkpoints of an earlier run, which this one neither continues nor removes.
fn say_unfinished(path: &Path, is_part: bool) {
    let place = polhode::run::Checkpoint::folder_of(path);
    if !is_part && place.is_dir() {
        output::note(&format!(
            "note: {} has what a run that was not finished has computed; --resume continues it if it is of this study, this run leaves it as it is",
            place.display()
        ));
    }
}

/// Warns of a study without bodies, whose tables have no rows.
fn say_if_there_are_no_bodies(study: &Study) {
    let bodies = study.bodies();
    if bodies.count == 0 {
        let reason = if bodies.table.is_some() { "the table of bodies has no rows" } else { "bodies.count is 0" };
        output::note(&format!("warning: {reason}: there is nothing to compute, and the tables will have no rows"));
    }
}

/// Reports that a study asks for no results, or for what is hardly meant.
pub fn say_what_is_doubtful(study: &Study, scene: &Scene, quiet: bool) {
    let (wanted, quantiles) = (study.output(), scene.wanted_quantiles());
    if quiet {
        return;
    }
    if !(wanted.final_state || wanted.snapshots || scene.observes()) {
        output::note("note: the study asks for no results: only plan.json and report.json are written");
    }
    if quantiles.iter().all(|percent| *percent <= 1.0) && quantiles.iter().any(|percent| percent.fract() > 0.0) {
        output::note("note: output.quantiles are percentages, all of them 1 or less here: the median is 50, not 0.5");
    }
}

/// The plan of a study, newly made or read from a file.
pub fn plan<'s>(
    arguments: &RunArguments,
    (study, scene): (&Study, &'s Scene),
    engine: &Engine,
    document: Option<&PlanDocument>,
) -> Result<Plan<'s>, Failure> {
    let plan = match document {
        None => {
            let costs = crate::engine::costs(arguments.costs.as_deref(), engine)?;
            progress::planning(arguments.quiet, |announce| Plan::announced(scene, engine, &costs, announce))
        }
        Some(document) => {
            let (planned, here) = (document.engine(), engine.description().name_of_arithmetic());
            if planned != here && !arguments.quiet {
                output::note(&format!("the plan is for {planned}, this is {here}: bits may differ"));
            }
            Plan::repeated(scene, engine, document)
        }
    };
    Ok(plan.map_err(|error| study.located(error))?)
}

fn say_what_is_written(arguments: &RunArguments, study: &Study, report: &Report, path: &Path) -> Result<(), Failure> {
    let format = study.output().format;
    if let Some(fallback) = report.fallback.as_ref().filter(|_| arguments.quiet || arguments.json) {
        output::note(&format!("warning: fallback {fallback}"));
    }
    if !report.failed_bodies.is_empty() {
        output::note(&format!(
            "warning: {} of {} bodies have failed; failed.{} says which, when and why",
            report.failed_bodies.len(),
            report.bodies,
            format.name()
        ));
    }
    if report.outside_usable_region > 0 {
        output::note(&too_fast_in_a_step(report.outside_usable_region as u64, report.bodies));
    }
    if let Some(repairs) = report.repairs.filter(|repairs| arguments.quiet && repairs.bodies > 0) {
        output::note(&format!(
            "note: {} of {} inertia tensors were repaired, with relative changes up to {:.1e}",
            repairs.bodies, report.bodies, repairs.largest_relative_change
        ));
    }
    if arguments.json {
        output::print(&report.to_json())?;
    } else if !arguments.quiet {
        output::show(&summary(report, path))?;
    }
    let few_have_failed = report.failed_bodies.len() as u64 <= study.allowed_failures();
    Failure::reported_unless(few_have_failed && (!arguments.strict || is_met(report)))
}

/// Whether a run has met all that was asked of it.
fn is_met(report: &Report) -> bool {
    let states = report.accuracy.sample.target.is_none() || report.accuracy.sample.met == Some(true);
    states && report.statistical_accuracy.as_ref().is_none_or(|statistical| statistical.sample.met == Some(true))
}

/// Announces the size of large results, and refuses those for which the disk has no space.
pub fn check_disk(folder: &OutputFolder, size: OutputSize, quiet: bool) -> Result<(), Failure> {
    let OutputSize { rows, least_bytes, likely_bytes } = size;
    let (path, gigabytes) = (folder.path(), |bytes: u64| bytes as f64 / 1e9);
    // If the system does not say what is free, nothing is refused.
    let available = fs4::available_space(folder.staging()).unwrap_or(u64::MAX);
    if least_bytes > available {
        return Err(polhode::Error::DiskSpace { path: path.to_owned(), rows, needed: least_bytes, available }.into());
    }
    let message =
        format!("{rows} rows, about {:.1} GB, will be written to {}", gigabytes(likely_bytes), path.display());
    if likely_bytes > available {
        output::note(&format!("warning: {message}: only {:.1} GB are free", gigabytes(available)));
    } else if likely_bytes > LARGE && !quiet {
        output::note(&format!("note: {message}"));
    }
    Ok(())
}

/// Announces the time of a run, if it is known and long, and refuses one that takes longer than can be intended; the plan's bodies
/// stand for `times` as many. Returns the bodies that are recomputed.
pub fn check_time(plan: &Plan<'_>, study: &Study, times: f64, arguments: &RunArguments) -> Result<SampleRow, Failure> {
    let explanation = plan.explain();
    let sample = explanation.sample;
    // Classes whose time is not known count as nothing.
    let seconds: f64 = explanation.classes.iter().filter_map(|class| class.seconds).sum::<f64>() * times;
    if seconds > MOST && !arguments.however_long {
        return Err(study.located(polhode::Error::RunTime { days: seconds / DAY }).into());
    }
    if arguments.quiet {
        return Ok(sample);
    }
    if let Some(seconds) = explanation.seconds().map(|seconds| seconds * times).filter(|seconds| *seconds >= LONG) {
        output::note(&format!("note: about {} of computing are expected; Ctrl-C ends the run", time(seconds)));
    }
    let is_dear = |of_sample: &f64| *of_sample >= DEAR_SAMPLE && *of_sample >= SHARE_OF_SAMPLE * seconds;
    if let Some(of_sample) = sample.seconds.filter(is_dear) {
        output::note(&format!(
            "note: the run takes some {} more, to recompute {} of its bodies more accurately, so that its errors are known",
            time(of_sample),
            sample.bodies
        ));
    }
    Ok(sample)
}

/// A duration in words.
pub fn time(seconds: f64) -> String {
    let (amount, unit) = match seconds {
        _ if seconds < 120.0 => (seconds, "s"),
        _ if seconds < 7200.0 => (seconds / 60.0, "minutes"),
        _ if seconds < 2.0 * DAY => (seconds / 3600.0, "hours"),
        _ => (seconds / DAY, "days"),
    };
    format!("{amount:.0} {unit}")
}

/// The study's name with the extension `.out`, in the current folder.
fn default_folder(study: &Path) -> PathBuf {
    let stem = study.file_stem().unwrap_or(study.as_os_str());
    let mut name = stem.to_owned();
    name.push(".out");
    PathBuf::from(name)
}

fn summary(report: &Report, folder: &Path) -> String {
    let mut files = report.files.clone();
    files.push(polhode::record::REPORT.to_owned());
    format!("{report}\n  results  {} in {}\n", files.join(", "), output::printable(&folder.to_string_lossy()))
}
