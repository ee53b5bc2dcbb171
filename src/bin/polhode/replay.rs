//! `polhode replay`.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use polhode::bodies::{Blocks, Status};
use polhode::plan::{Costs, PlanDocument};
use polhode::record::{OutputState, PLAN, REPORT, ROTATION_COLUMNS, StateTable};
use polhode::run::{Replay, StateError, alone, replay_until};
use polhode::study::Study;
use polhode::{Engine, Error, Plan, Scene};
use serde::Serialize;

use crate::arguments::ReplayArguments;
use crate::output::{self, Failure};
use crate::progress::planning;

/// The first columns of a rotation, without which there is nothing to compare: orientation and angular velocity.
const NEEDED: usize = 7;

/// The most lines of errors that are printed.
const MOST_LINES: usize = 12;

/// The source of a body's values.
enum Origin {
    /// A table of a run.
    Table(PathBuf),
    /// The body alone, by the plan.
    Run,
}

/// A value of the body compared with the replay.
#[derive(Serialize)]
struct Compared {
    time: f64,
    status: u8,
    #[serde(flatten)]
    error: StateError,
}

/// The result, as JSON.
#[derive(Serialize)]
struct Found<'a> {
    body: usize,
    computed_by: String,
    own_error: Option<StateError>,
    values_from: String,
    errors: &'a [Compared],
    track: String,
    rows: usize,
}

/// Computes one body alone and compares it with a run's values, or with those that a run would have.
pub fn replay(arguments: &ReplayArguments) -> Result<(), Failure> {
    let folder = arguments.study.is_dir().then_some(&*arguments.study);
    let file = folder.map_or_else(|| Ok(arguments.study.clone()), study_of)?;
    let study = Study::read(&file).map_err(|error| match (error, folder) {
        (Error::File { path, action, kind, reason }, Some(folder)) if path == file => {
            let reason =
                format!("{reason}; {} names it: give the study itself with --plan", folder.join(REPORT).display());
            Error::File { path, action, kind, reason }
        }
        (error, _) => error,
    })?;
    if let Some(track) = &arguments.out {
        output::check_place(track, &study, arguments.force, |_| false)?;
    }
    let count = study.bodies().count;
    if arguments.body >= count {
        let value = format!("--body {}: expected the index of a body, from 0 to {}", arguments.body, count.max(1) - 1);
        return Err(Failure::Input(value));
    }
    let mut study = crate::engine::in_precision(study, &arguments.engine);
    let document = folder.map(|folder| folder.join(PLAN)).or_else(|| arguments.plan.clone());
    let document = document.map(|file| PlanDocument::read(&file)).transpose()?;
    let table = folder.and_then(table_of);
    // The engine that computed a table's values is not needed.
    let engine = match &table {
        Some(_) => Engine::cpu(),
        None => crate::engine::open(&arguments.engine, arguments.json)?,
    };
    let (scene, body, document) = match document {
        Some(document) => {
            if let Some(precision) = document.wanted_precision() {
                study = study.with_precision(precision);
            }
            // As much of the study as the plan has fingerprints for.
            let size = Blocks::of(count).size();
            let first = arguments.body / size * size;
            let scene = study.clone().part(first..first + size).scene()?.skipping(document.may_skip());
            (scene, arguments.body - first, Some(document))
        }
        None => (study.scene()?, arguments.body, None),
    };
    let plan = match &document {
        Some(document) => Plan::repeated(&scene, &engine, document),
        None => planning(arguments.json, |announce| Plan::announced(&scene, &engine, &Costs::shipped(), announce)),
    };
    let plan = plan.map_err(|error| study.located(error))?;
    let origin = table.map_or(Origin::Run, Origin::Table);
    let mut values = match &origin {
        Origin::Table(path) => values_of(path, arguments.body, &scene, plan.times().len())?,
        Origin::Run => alone(&engine, &plan, body)?,
    };
    // The body does not move after its stop.
    let stop = values.iter().find_map(|(_, state)| state.stopped_at);
    let under_way = values.iter().take_while(|(_, state)| state.stopped_at.is_none()).count();
    values.truncate(under_way + 1);
    let found = replay_until(&plan, body, arguments.samples as usize, stop.unwrap_or(scene.end()))?;
    let errors: Vec<Compared> = values.iter().filter_map(|value| compared(value, &found)).collect();
    let track = arguments.out.clone().unwrap_or_else(|| default_track(&file, arguments.body));
    found.write(&track)?;
    let from = match &origin {
        Origin::Table(path) => path.display().to_string(),
        Origin::Run => format!("the plan's, on {}", engine.description().name),
    };
    if arguments.json {
        let found = Found {
            body: arguments.body,
            computed_by: found.how.to_string(),
            own_error: found.own_error,
            values_from: from,
            errors: &errors,
            track: track.display().to_string(),
            rows: found.track.len(),
        };
        return output::print(&format!("{}\n", serde_json::to_string_pretty(&found).unwrap_or_default()));
    }
    output::show(&summary(&found, &errors, &from, &track))
}

/// The study that a run has read.
fn study_of(folder: &Path) -> Result<PathBuf, Failure> {
    let path = folder.join(REPORT);
    let wrong = |reason: &str| Error::Table { path: path.clone(), reason: reason.to_owned() };
    let failed = |error: std::io::Error| Error::file(&path, polhode::error::FileAction::Read, &error);
    let text = std::fs::read_to_string(&path).map_err(failed)?;
    let report: serde_json::Value =
        serde_json::from_str(&text).map_err(|_| wrong("expected the report that a run has left"))?;
    let name =
        report["study"]["file"].as_str().ok_or_else(|| wrong("it names no study: give the study with --plan"))?;
    Ok(PathBuf::from(name))
}

/// The table with the most values of a body.
fn table_of(folder: &Path) -> Option<PathBuf> {
    let names = ["snapshots", "final"]
        .into_iter()
        .flat_map(|stem| polhode::study::Format::ALL.iter().map(move |format| format!("{stem}.{}", format.name())));
    names.map(|name| folder.join(name)).find(|path| path.is_file())
}

/// The values of a body in a table of one or of all output times. Angular momentum and energy may be missing.
fn values_of(path: &Path, body: usize, scene: &Scene, outputs: usize) -> Result<Vec<(f64, OutputState)>, Failure> {
    let mut table = StateTable::open(path)?;
    if let Some(missing) =
        ROTATION_COLUMNS[..NEEDED].iter().find(|name| !table.columns().iter().any(|own| own == *name))
    {
        let reason =
            format!("expected columns of orientation and angular velocity: it has no {missing} (output.columns)");
        return Err(Error::Table { path: path.to_owned(), reason }.into());
    }
    let count = scene.part().of;
    let outputs = if path.file_stem().is_some_and(|stem| stem == "final") { 1 } else { outputs };
    let mut values = Vec::with_capacity(outputs);
    for output in 0..outputs {
        let rows = table.read((output * count + body) as u64, 1)?;
        match rows.first() {
            Some(row) if row.body == body => values.push((row.time, row.state)),
            _ => {
                let reason = format!("expected a row of body {body} at each of {outputs} output times");
                return Err(Error::Table { path: path.to_owned(), reason }.into());
            }
        }
    }
    Ok(values)
}

/// The difference between a value and the replay at its time.
fn compared((time, state): &(f64, OutputState), replay: &Replay) -> Option<Compared> {
    let time = &state.stopped_at.unwrap_or(*time);
    let place = replay.track.binary_search_by(|(other, _)| other.total_cmp(time)).ok()?;
    let reference = &replay.track[place].1;
    let mut known = *state;
    if state.rotation.orientation.is_finite() && state.rotation.angular_velocity_body.is_finite() {
        // A table without these columns says nothing against the body.
        (known.rotation.angular_momentum_world, known.rotation.kinetic_energy) =
            (reference.rotation.angular_momentum_world, reference.rotation.kinetic_energy);
    }
    Some(Compared { time: *time, status: known.status().number(), error: StateError::between(state, reference) })
}

fn summary(replay: &Replay, errors: &[Compared], from: &str, track: &Path) -> String {
    let mut text = format!("Body {} alone, on the CPU in f64: {}\n", replay.body, replay.how);
    // Writing to memory does not fail.
    let _ = match &replay.own_error {
        Some(error) => writeln!(text, "  its own error at the end: about {error}"),
        None => {
            writeln!(text, "  its own error is not known: a random torque acts, and other steps would use other draws")
        }
    };
    let _ = writeln!(text, "  values  {from}");
    let step = errors.len().div_ceil(MOST_LINES).max(1);
    for (index, Compared { time, status, error }) in errors.iter().enumerate() {
        // The last one, and some before it.
        if (errors.len() - 1 - index).is_multiple_of(step) {
            let _ = match Status::from_code(f64::from(*status)) {
                Status::Valid => writeln!(text, "  t = {time:?} s: {error}"),
                Status::Stopped => writeln!(text, "  t = {time:?} s, where an event has stopped the body: {error}"),
                status => writeln!(text, "  t = {time:?} s: the body has failed: {status}"),
            };
        }
    }
    let _ = writeln!(text, "  track   {} rows in {}", replay.track.len(), track.display());
    text
}

/// The study's name with the body's, in the current folder.
fn default_track(study: &Path, body: usize) -> PathBuf {
    let stem = study.file_stem().unwrap_or(study.as_os_str());
    let mut name = stem.to_owned();
    name.push(format!(".body-{body}.csv"));
    PathBuf::from(name)
}
