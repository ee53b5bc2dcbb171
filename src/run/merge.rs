//! The results of a study from those of its parts.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde_json::Value;

use crate::engine::Progress;
use crate::error::{Error, FileAction, Result};
use crate::kernel::observe::{Partial, Statistic};
use crate::plan::sampling::is_plausible;
use crate::record::failed_file;
use crate::record::folder::{OutputFolder, PLAN, REPORT, file_entry};
use crate::record::npz_file::Times;
use crate::record::report::{FailureReport, StatisticsReport};
use crate::record::shard::{BLOCKS, BlocksLine, PartFile, Shard, ShardState, ranges, status};
use crate::record::statistics_file::StatisticsFile;
use crate::record::{FailedBody, StateTable, Statistics};
use crate::run::files::{TableFile, WriteTime};
use crate::scene::Quantity;
use crate::study::text::read_text;

/// Rows that are read and handed on at once.
const ROWS: usize = 1 << 15;

/// What `report.json` of merged parts holds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MergedReport {
    /// The study, as the parts name it.
    pub study: Value,
    /// Number of bodies.
    pub bodies: usize,
    /// Number of output times.
    pub outputs: usize,
    /// Number of parts.
    pub shards: usize,
    /// The engines that computed, each with the number of its parts.
    pub engines: BTreeMap<String, usize>,
    /// Steps of all bodies together.
    pub body_steps: u64,
    /// Wall time of all parts together, s.
    pub seconds: f64,
    /// Statistics at the end; `null` where the study asks for none.
    pub statistics: Option<StatisticsReport>,
    /// Errors at the end.
    pub accuracy: MergedAccuracy,
    /// Whether the samples of all parts agree with the errors asked for of statistics; `null` where none are, or not of all parts that is known.
    pub statistical_met: Option<bool>,
    /// Bodies that have failed, ascending.
    pub failed_bodies: Vec<usize>,
    /// How many of them for which reason.
    pub failures: Vec<FailureReport>,
    /// How many bodies may fail in a run that has succeeded.
    pub allowed_failures: u64,
    /// Files beside this one.
    pub files: Vec<String>,
    /// The reports of the parts, in their order.
    pub parts: Vec<Value>,
}

/// Errors at the end of a sample of bodies that was recomputed more accurately: those of all parts' samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct MergedAccuracy {
    /// Bodies behind the figures.
    pub bodies: usize,
    /// The greatest attitude error, rad.
    pub attitude_max: Option<f64>,
    /// The greatest error of the angular velocity, relative.
    pub angular_velocity_max: Option<f64>,
    /// The greatest error of the kinetic energy, relative.
    pub kinetic_energy_max: Option<f64>,
    /// Bodies that are beyond one of the errors asked for.
    pub beyond: usize,
    /// Whether the sample agrees with what was asked for; `null` where nothing was asked for, or nothing is known.
    pub met: Option<bool>,
}

impl MergedReport {
    /// As it stands in `report.json`.
    pub fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).unwrap_or_default() + "\n"
    }
}

/// A part with its folder.
struct Piece {
    folder: PathBuf,
    part: PartFile,
    report: Value,
}

/// Merges the parts of a study that lie in the folder `all` into `folder`: the same tables as one run's, to the byte, `plan.json`, and a
/// `report.json` of all parts. `observer` is told of rows.
///
/// # Errors
///
/// [`Error::Table`] where a part is missing, failed, under way or not as it was written, or where parts are of several plans, studies or
/// versions; [`Error::File`]; [`Error::Interrupted`].
pub fn merge(
    all: &Path,
    mut folder: OutputFolder,
    observer: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<MergedReport> {
    let (pieces, plan) = pieces(all)?;
    let first = &pieces[0].part;
    let ((has_final, has_snapshots), statistics, times) = (first.tables(), first.statistics(), &first.times);
    let format = first.output_format().ok_or_else(|| Error::Table {
        path: all.to_owned(),
        reason: "its tables are in a format that this build does not write".to_owned(),
    })?;
    folder.set_metadata(first.metadata.clone());
    let (last, end) = (times.len() - 1, times[times.len() - 1]);
    let (bodies, layout) = (0..first.body_count, first.layout());
    let rows = (has_snapshots as usize * times.len() + has_final as usize) * first.body_count;
    let mut rows = Rows { done: 0, total: rows as u64, observer };
    if has_final {
        let mut table = TableFile::begin(&mut folder, ("final", format), bodies.clone(), &layout, Times::One(end))?;
        for piece in &pieces {
            let mut source = StateTable::open(&piece.folder.join(format!("final.{}", format.name())))?;
            rows.copy(&mut source, &piece.part, 0, &mut table)?;
        }
        table.finish()?;
    }
    if has_snapshots {
        let mut table = TableFile::begin(&mut folder, ("snapshots", format), bodies, &layout, Times::Many(times))?;
        let open = |piece: &Piece| StateTable::open(&piece.folder.join(format!("snapshots.{}", format.name())));
        let mut sources = pieces.iter().map(open).collect::<Result<Vec<_>>>()?;
        for time in 0..times.len() {
            for (piece, source) in pieces.iter().zip(&mut sources) {
                rows.copy(source, &piece.part, time, &mut table)?;
            }
        }
        table.finish()?;
    }
    let mut at_end = None;
    if !statistics.is_empty() {
        let quantities: Vec<Quantity> = statistics.iter().map(Quantity::from).collect();
        let mut file = StatisticsFile::begin(&mut folder, format, &quantities, &[], times.len())?;
        let mut lines = pieces.iter().map(|piece| Lines::open(&piece.folder)).collect::<Result<Vec<_>>>()?;
        for (index, &time) in times.iter().enumerate() {
            let found = merged_at(time, &statistics, &mut lines)?;
            file.append(&found)?;
            at_end = (index == last).then_some(found);
        }
        file.finish()?;
    }
    let failures: Vec<FailedBody> =
        pieces.iter().flat_map(|piece| &piece.part.failures).map(FailedBody::from).collect();
    if !failures.is_empty() {
        failed_file::write(&mut folder, format, &failures)?;
    }
    folder.write(PLAN, plan.as_bytes())?;
    let statistics = at_end.as_ref().map(StatisticsReport::from);
    let report = report(pieces, statistics, &failures, folder.names().to_vec());
    folder.write(REPORT, report.to_json().as_bytes())?;
    folder.commit()?;
    Ok(report)
}

/// The parts in their order, and the plan that they follow; refused where they do not make one run.
fn pieces(all: &Path) -> Result<(Vec<Piece>, String)> {
    let states = status(all)?;
    let number = |is: fn(&ShardState) -> bool| {
        let numbers: Vec<usize> = (1..).zip(&states).filter(|(_, state)| is(state)).map(|(number, _)| number).collect();
        (!numbers.is_empty()).then(|| ranges(&numbers))
    };
    let wrong = |reason: String| Error::Table { path: all.to_owned(), reason };
    if let Some(due) = number(ShardState::is_due) {
        let count = states.len();
        return Err(wrong(format!("expected {count} complete parts: run {due} (again), see `polhode status`")));
    }
    if let Some(running) = number(|state| *state == ShardState::Running) {
        return Err(wrong(format!("parts are under way: {running}")));
    }
    let (mut pieces, mut plan, mut next) = (Vec::<Piece>::new(), None, 0);
    for index in 1..=states.len() {
        let Some(shard) = Shard::new(index, states.len()) else { continue };
        let folder = shard.folder(all);
        let wrong = |reason: String| Error::Table { path: folder.clone(), reason };
        let part = PartFile::read(&folder)?;
        if (part.index, part.count, part.first_body) != (index, states.len(), next) {
            return Err(wrong(format!("expected part {shard}: it is of another cut, run it again")));
        }
        next += part.bodies;
        let own = read_text(&folder.join(PLAN))?;
        if plan.get_or_insert_with(|| own.clone()) != &own {
            return Err(wrong(format!("its plan is not that of part 1/{}: run it again with that", states.len())));
        }
        if let Some(what) = pieces.first().and_then(|first| part.difference(&first.part)) {
            let count = states.len();
            return Err(wrong(format!(
                "its study is not that of part 1/{count}: {what} differ: run it again with that"
            )));
        }
        for entry in &part.files {
            let found = file_entry(&folder, &entry.name)?;
            if found != *entry {
                let path = folder.join(&entry.name);
                let reason = "it is not as its run wrote it: run the part again with --force".to_owned();
                return Err(Error::Table { path, reason });
            }
        }
        let report = serde_json::from_str(&read_text(&folder.join(REPORT))?)
            .map_err(|_| wrong(format!("its {REPORT} is cut: run it again with --force")))?;
        pieces.push(Piece { folder, part, report });
    }
    match pieces.first() {
        Some(first) if next == first.part.body_count && !first.part.times.is_empty() => {
            Ok((pieces, plan.unwrap_or_default()))
        }
        _ => Err(wrong("the parts have not all bodies: run them again with one plan".to_owned())),
    }
}

/// Copies rows and counts them.
struct Rows<'a> {
    done: u64,
    total: u64,
    observer: &'a mut dyn FnMut(Progress) -> ControlFlow<()>,
}

impl Rows<'_> {
    /// The rows of a part at an output time.
    fn copy(&mut self, source: &mut StateTable, part: &PartFile, output: usize, table: &mut TableFile) -> Result<()> {
        let path = source.path().to_owned();
        let table_columns = part.layout().columns.len();
        let first = output * part.bodies;
        for start in (0..part.bodies).step_by(ROWS) {
            let count = ROWS.min(part.bodies - start);
            let found = source.read_rows((first + start) as u64, count)?;
            let body = part.first_body + start;
            let is_expected = found.bodies.iter().copied().eq(body..body + count);
            if !is_expected || found.rows.numbers.len() != table_columns {
                return Err(Error::Table {
                    path,
                    reason: format!("expected rows of bodies {body} to {}", body + count - 1),
                });
            }
            table.append(found.times[0], body, &found.rows, &mut WriteTime::default())?;
            self.done += count as u64;
            if (self.observer)(Progress { done: self.done, total: self.total }).is_break() {
                return Err(Error::Interrupted { steps: 0 });
            }
        }
        Ok(())
    }
}

/// The lines of a part's statistics, one after the other.
struct Lines {
    path: PathBuf,
    offset: u64,
}

impl Lines {
    fn open(folder: &Path) -> Result<Self> {
        Ok(Self { path: folder.join(BLOCKS), offset: 0 })
    }

    /// The next line; between two calls no file is open.
    fn next(&mut self) -> Result<BlocksLine> {
        use std::io::{Seek, SeekFrom};
        let failed = |error: std::io::Error| Error::file(&self.path, FileAction::Read, &error);
        let mut file = File::open(&self.path).map_err(failed)?;
        file.seek(SeekFrom::Start(self.offset)).map_err(failed)?;
        let mut line = String::new();
        self.offset += BufReader::new(file).read_line(&mut line).map_err(failed)? as u64;
        let reason = || "expected the statistics of a part's blocks, a line an output".to_owned();
        serde_json::from_str(&line).map_err(|_| Error::Table { path: self.path.clone(), reason: reason() })
    }
}

/// The statistics at an output time from the next lines of all parts.
fn merged_at(time: f64, statistics: &[Statistic], lines: &mut [Lines]) -> Result<Statistics> {
    let mut blocks: Vec<Vec<Partial<f64>>> = Vec::new();
    for lines in lines {
        let line = lines.next()?;
        if line.time != time || line.blocks.iter().any(|block| block.len() != statistics.len()) {
            return Err(Error::Table {
                path: lines.path.clone(),
                reason: format!("expected statistics at {time:?} s"),
            });
        }
        blocks.extend(line.blocks);
    }
    Ok(Statistics::new(time, statistics, &blocks))
}

fn report(
    pieces: Vec<Piece>,
    statistics: Option<StatisticsReport>,
    failures: &[FailedBody],
    files: Vec<String>,
) -> MergedReport {
    let mut engines = BTreeMap::new();
    for piece in &pieces {
        *engines.entry(piece.report["engine"]["adapter"].as_str().unwrap_or_default().to_owned()).or_default() += 1;
    }
    let (first, reports) = (&pieces[0], || pieces.iter().map(|piece| &piece.report));
    MergedReport {
        study: first.report["study"].clone(),
        bodies: first.part.body_count,
        outputs: first.part.times.len(),
        shards: pieces.len(),
        engines,
        body_steps: reports().filter_map(|report| report["body_steps"].as_u64()).sum(),
        seconds: reports().filter_map(|report| report["wall_time"]["total"].as_f64()).sum(),
        statistics,
        accuracy: accuracy(reports().map(|report| &report["accuracy"]), failures, first.part.body_count),
        statistical_met: all_met(reports().map(|report| report["statistical_accuracy"]["met"].as_bool())),
        failed_bodies: failures.iter().map(|failed| failed.body).collect(),
        failures: FailureReport::of(failures),
        allowed_failures: first.part.allowed_failures,
        files,
        parts: reports().cloned().collect(),
    }
}

/// Whether all parts met something; one that did not decides.
fn all_met(mut parts: impl Iterator<Item = Option<bool>>) -> Option<bool> {
    parts
        .try_fold(true, |all, met| if met == Some(false) { None } else { Some(all && met == Some(true)) })
        .map_or(Some(false), |all| all.then_some(true))
}

/// What the samples of all parts say together.
fn accuracy<'a>(
    parts: impl Iterator<Item = &'a Value> + Clone,
    failures: &[FailedBody],
    bodies: usize,
) -> MergedAccuracy {
    let sum = |key: &str| parts.clone().filter_map(|part| part[key].as_u64()).sum::<u64>() as usize;
    let max = |key: &str| parts.clone().filter_map(|part| part[key]["max"].as_f64()).reduce(f64::max);
    let percentile = parts.clone().find_map(|part| part["target"]["percentile"].as_f64());
    let draws = parts.clone().any(|part| part["same_draws"].as_bool() == Some(true));
    let (sampled, beyond) = (sum("bodies"), sum("beyond"));
    let is_known = sum("lost") > 0 || (sampled > 0 && !draws && sum("diverged") == 0);
    let met = |percentile: f64| {
        let part = 0.01 * percentile;
        let failed = failures.len() as f64 / bodies.max(1) as f64;
        sum("lost") == 0 && failed <= 1.0 - part && is_plausible(beyond, sampled, part)
    };
    MergedAccuracy {
        bodies: sampled,
        attitude_max: max("attitude"),
        angular_velocity_max: max("angular_velocity"),
        kinetic_energy_max: max("kinetic_energy"),
        beyond,
        met: percentile.filter(|_| is_known).map(met),
    }
}
