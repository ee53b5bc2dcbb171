//! Forms the results of a study from those of its parts.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde_json::Value;

use crate::engine::Progress;
use crate::error::{Error, FileAction, Result};
use crate::kernel::observe::Partial;
use crate::record::failed_file;
use crate::record::folder::{OutputFolder, PLAN, REPORT, file_entry};
use crate::record::npz_file::Times;
use crate::record::observed_files::{write_events, write_histograms};
use crate::record::part_file::{BLOCKS, BlocksLine, EVENTS, EventEntry, PartFile, STUDY_TEXT};
use crate::record::report::{EventReport, FailureReport, QuantityReport, StatisticsReport, StoppedReport, Versions};
use crate::record::shard::{Shard, ShardState, ranges, states};
use crate::record::statistics_file::StatisticsFiles;
use crate::record::table_file;
use crate::record::{EventRecord, FailedBody, Gathered, StateTable, Statistics};
use crate::run::files::KeptStatistics;
use crate::run::outcome::{MergedAccuracy, Outcome};
use crate::run::state_tables::{TableFile, WriteTime};
use crate::scene::{Event, Observed};
use crate::study::Format;
use crate::study::observed::observed_in;
use crate::study::text::read_text;

/// Rows that are copied at once.
const ROWS: usize = 1 << 15;

/// The contents of `report.json` of merged parts; `docs/outputs.md` has its keys.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MergedReport {
    /// The study, as the parts name it.
    pub study: Value,
    /// Number of bodies.
    pub bodies: usize,
    /// Simulated time, s.
    pub span: f64,
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
    /// The quantities of statistics, histograms and events; empty where the study asks for none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub quantities: Vec<QuantityReport>,
    /// Statistics at the end; `null` where the study asks for none.
    pub statistics: Option<StatisticsReport>,
    /// Events; empty where the study asks for none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub events: Vec<EventReport>,
    /// Bodies that events have stopped; left out if no event stops bodies.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stopped: Option<StoppedReport>,
    /// Errors at the end.
    pub accuracy: MergedAccuracy,
    /// Whether the samples of all parts agree with the requested errors of statistics; `null` where none are requested,
    /// or where this is not known of all parts.
    pub statistical_met: Option<bool>,
    /// Bodies that have failed, ascending.
    pub failed_bodies: Vec<usize>,
    /// Their numbers by reason.
    pub failures: Vec<FailureReport>,
    /// The number of bodies that may fail in a successful run.
    pub allowed_failures: u64,
    /// Files beside this one.
    pub files: Vec<String>,
    /// The reports of the parts, in their order.
    pub parts: Vec<Value>,
    /// Versions of the software that merged.
    pub versions: Versions,
}

impl MergedReport {
    /// The text of `report.json`.
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

/// Merges the parts of a study in the folder `all` into `folder`: the same tables as one run's, to the byte,
/// `plan.json`, and a `report.json` of all parts. `observer` receives the progress in rows.
///
/// # Errors
///
/// [`Error::Table`] where a part is missing, failed, still running or changed, or where parts belong to several plans,
/// studies or versions; [`Error::File`]; [`Error::Interrupted`].
pub fn merge(
    all: &Path,
    folder: OutputFolder,
    observer: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<MergedReport> {
    merge_folders(all, &shard_folders(all)?, folder, None, observer)
}

/// The folders of all parts in `all`, in their order, each with its name; an error if one is missing.
fn shard_folders(all: &Path) -> Result<Vec<(String, PathBuf)>> {
    let states = states(all)?;
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
    let shards = (1..=states.len()).filter_map(|index| Shard::new(index, states.len()));
    Ok(shards.map(|shard| (format!("part {shard}"), shard.folder(all))).collect())
}

/// As [`merge`], for the parts in some named folders, in the order of their bodies; `final_states` is the table of all
/// bodies' final states if the parts have appended to it.
pub(super) fn merge_folders(
    all: &Path,
    folders: &[(String, PathBuf)],
    mut folder: OutputFolder,
    final_states: Option<TableFile>,
    observer: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<MergedReport> {
    let (pieces, plan) = pieces(all, folders)?;
    let first = &pieces[0].part;
    let ((has_final, has_snapshots), times) = (first.tables(), &first.times);
    let observed = observed_in(all, first.entry(STUDY_TEXT).unwrap_or_default())?;
    let format = first.output_format().ok_or_else(|| Error::Table {
        path: all.to_owned(),
        reason: "its tables are in a format that this build does not write".to_owned(),
    })?;
    folder.add_metadata(first.metadata.clone());
    let tables_of = |stem: &str| -> Vec<PathBuf> {
        let name = format!("{stem}.{}", format.name());
        pieces.iter().map(|piece| piece.folder.join(&name)).collect()
    };
    if first.cells.is_some() {
        // Every part has the cells of the whole study.
        table_file::concatenate(&mut folder, "cells", format, &tables_of("cells")[..1])?;
    }
    if first.initial {
        table_file::concatenate(&mut folder, "initial", format, &tables_of("initial"))?;
    }
    let failures: Vec<FailedBody> =
        pieces.iter().flat_map(|piece| &piece.part.failures).map(FailedBody::from).collect();
    let end = times[times.len() - 1];
    let outcome = Outcome {
        bodies: first.body_count,
        outputs: times.len(),
        span: end,
        accuracy: MergedAccuracy::of(
            pieces.iter().map(|piece| (&piece.report["accuracy"], piece.part.bodies)),
            &failures,
            first.body_count,
        ),
        failures: FailureReport::of(&failures),
    };
    folder.add_metadata(outcome.metadata());
    let (bodies, layout) = (0..first.body_count, first.layout());
    let rows = (has_snapshots as usize * times.len() + has_final as usize) * first.body_count;
    let mut rows = Rows { done: 0, total: rows as u64, observer };
    if let Some(table) = final_states {
        table.finish()?;
    }
    if has_final {
        let mut table = TableFile::begin(&mut folder, ("final", format), bodies.clone(), &layout, Times::One(end))?;
        for (piece, path) in pieces.iter().zip(tables_of("final")) {
            rows.copy(&mut StateTable::open_known(&path)?, &piece.part, 0, &mut table)?;
        }
        table.finish()?;
    }
    if has_snapshots {
        let mut table = TableFile::begin(&mut folder, ("snapshots", format), bodies, &layout, Times::Many(times))?;
        let mut sources =
            tables_of("snapshots").iter().map(|path| StateTable::open_known(path)).collect::<Result<Vec<_>>>()?;
        for time in 0..times.len() {
            for (piece, source) in pieces.iter().zip(&mut sources) {
                rows.copy(source, &piece.part, time, &mut table)?;
            }
        }
        table.finish()?;
    }
    let KeptStatistics { report: statistics, histograms, histograms_by_cell } =
        merged_statistics(&pieces, &observed, format, &mut folder)?;
    if !failures.is_empty() {
        failed_file::write(&mut folder, format, &failures)?;
    }
    let events = merged_events(&pieces, &observed)?;
    if !events.is_empty() {
        write_events(&mut folder, format, &events, times, first.cells)?;
    }
    write_histograms(&mut folder, format, &observed.histograms, (&histograms, &histograms_by_cell))?;
    folder.write(PLAN, plan.as_bytes())?;
    let reports = || pieces.iter().map(|piece| &piece.report);
    let report = MergedReport {
        study: pieces[0].report["study"].clone(),
        bodies: first.body_count,
        span: end,
        outputs: times.len(),
        shards: pieces.len(),
        engines: engines(reports()),
        body_steps: reports().filter_map(|report| report["body_steps"].as_u64()).fold(0, u64::saturating_add),
        seconds: reports().filter_map(|report| report["wall_time"]["total"].as_f64()).sum(),
        quantities: QuantityReport::of(&observed),
        statistics,
        events: events.iter().map(|record| EventReport::new(record, end)).collect(),
        stopped: StoppedReport::of(&events),
        accuracy: outcome.accuracy,
        statistical_met: all_met(reports().map(|report| report["statistical_accuracy"]["met"].as_bool())),
        failed_bodies: failures.iter().map(|failed| failed.body).collect(),
        failures: outcome.failures,
        allowed_failures: first.allowed_failures,
        files: folder.names().to_vec(),
        parts: reports().cloned().collect(),
        versions: Versions::here(),
    };
    folder.write(REPORT, report.to_json().as_bytes())?;
    folder.commit()?;
    Ok(report)
}

/// The parts in their order, and the plan that they follow; an error if they do not make up one run.
fn pieces(all: &Path, folders: &[(String, PathBuf)]) -> Result<(Vec<Piece>, String)> {
    let wrong = |reason: String| Error::Table { path: all.to_owned(), reason };
    let (mut pieces, mut plan, mut next) = (Vec::<Piece>::new(), None, 0);
    for (name, folder) in folders {
        let wrong = |reason: String| Error::Table { path: folder.clone(), reason };
        let first_name = || &folders[0].0;
        let part = PartFile::read(folder)?;
        if part.first_body != next {
            return Err(wrong(format!("expected {name}: it is of another cut, run it again")));
        }
        next += part.bodies;
        let own = read_text(&folder.join(PLAN))?;
        if plan.get_or_insert_with(|| own.clone()) != &own {
            return Err(wrong(format!(
                "its plan is not that of {}: run one of them again, see `polhode status`",
                first_name()
            )));
        }
        if let Some(what) = pieces.first().and_then(|first| part.difference(&first.part)) {
            let reason = format!(
                "its study is not that of {}: {what}: run one of them again, see `polhode status`",
                first_name()
            );
            return Err(wrong(reason));
        }
        check_files(&part, folder).map_err(|error| match error {
            Error::Table { path, reason } => {
                Error::Table { path, reason: format!("{reason}: run the part again with --force") }
            }
            error => error,
        })?;
        let report: Value = serde_json::from_str(&read_text(&folder.join(REPORT))?)
            .map_err(|_| wrong(format!("its {REPORT} is cut: run it again with --force")))?;
        if !is_of(&report, part.bodies) {
            return Err(wrong(format!("its {REPORT} counts bodies that it has not: run it again with --force")));
        }
        pieces.push(Piece { folder: folder.clone(), part, report });
    }
    match pieces.first() {
        Some(first) if next == first.part.body_count && !first.part.times.is_empty() => {
            Ok((pieces, plan.unwrap_or_default()))
        }
        _ => Err(wrong("the parts have not all bodies: run them again with one plan".to_owned())),
    }
}

/// Whether a report can belong to a part of `bodies` bodies.
fn is_of(report: &Value, bodies: usize) -> bool {
    if report["bodies"].as_u64() != Some(bodies as u64) {
        return false;
    }
    let is_within = |count: u64| count <= bodies as u64;
    let sample = &report["accuracy"];
    ["bodies", "lost", "diverged", "beyond"].iter().filter_map(|key| sample[key].as_u64()).all(is_within)
}

/// Refuses a part whose files were changed after its run.
pub(super) fn check_files(part: &PartFile, folder: &Path) -> Result<()> {
    for entry in &part.files {
        let path = folder.join(&entry.name);
        // Only a regular file of the right length is read: others may have no end.
        let found = std::fs::metadata(&path).map_err(|error| Error::file(&path, FileAction::Read, &error))?;
        let has_size = found.is_file() && found.len() == entry.bytes;
        if !has_size || file_entry(folder, &entry.name)? != *entry {
            let reason = "it is not as its run wrote it".to_owned();
            return Err(Error::Table { path, reason });
        }
    }
    Ok(())
}

/// Copies and counts rows.
struct Rows<'a> {
    done: u64,
    total: u64,
    observer: &'a mut dyn FnMut(Progress) -> ControlFlow<()>,
}

impl Rows<'_> {
    /// Copies the rows of a part at an output time.
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
struct Lines<'a> {
    path: PathBuf,
    offset: u64,
    part: &'a PartFile,
}

impl<'a> Lines<'a> {
    fn open(piece: &'a Piece) -> Self {
        Self { path: piece.folder.join(BLOCKS), offset: 0, part: &piece.part }
    }

    fn unexpected(&self, time: f64) -> Error {
        Error::Table { path: self.path.clone(), reason: format!("expected statistics at {time:?} s") }
    }

    /// The next line, which must be that of `time`; no file stays open between calls.
    fn next(&mut self, time: f64) -> Result<BlocksLine> {
        use std::io::{Seek, SeekFrom};
        let failed = |error: std::io::Error| Error::file(&self.path, FileAction::Read, &error);
        let mut file = File::open(&self.path).map_err(failed)?;
        file.seek(SeekFrom::Start(self.offset)).map_err(failed)?;
        let mut line = String::new();
        self.offset += BufReader::new(file).read_line(&mut line).map_err(failed)? as u64;
        let reason = || "expected the statistics of a part's blocks, a line an output".to_owned();
        let line: BlocksLine =
            serde_json::from_str(&line).map_err(|_| Error::Table { path: self.path.clone(), reason: reason() })?;
        if line.is_of(self.part, time) { Ok(line) } else { Err(self.unexpected(time)) }
    }
}

/// Writes the statistics at all output times.
fn merged_statistics(
    pieces: &[Piece],
    observed: &Observed,
    format: Format,
    folder: &mut OutputFolder,
) -> Result<KeptStatistics> {
    let mut merged = KeptStatistics::default();
    let has_statistics = !observed.statistics.is_empty();
    if !has_statistics && observed.histograms.is_empty() {
        return Ok(merged);
    }
    let plain = observed.plain_statistics();
    let mut files = StatisticsFiles::begin(folder, format, observed, pieces[0].part.times.len())?;
    let mut lines: Vec<Lines<'_>> = pieces.iter().map(Lines::open).collect();
    for &time in &pieces[0].part.times {
        let statistics = match plain.is_empty() {
            true => {
                let gathered = gathered_at(time, observed, &mut lines)?;
                let (statistics, counts) = gathered.summed(observed, time);
                let by_cell = gathered.summed_by_cell(observed, time);
                files.append_cells(by_cell.iter().map(|of| &of.statistics))?;
                if !observed.histograms.is_empty() {
                    merged.histograms.push(counts);
                    let of_cells = by_cell.into_iter().map(|of| of.histograms).collect::<Vec<_>>();
                    merged.histograms_by_cell.extend((!of_cells.is_empty()).then_some(of_cells));
                }
                statistics
            }
            false => Statistics::new(time, &plain, &blocks_at(time, plain.len(), &mut lines)?),
        };
        files.append(&statistics)?;
        merged.report = has_statistics.then(|| StatisticsReport::after(merged.report.take(), &statistics));
    }
    files.finish()?;
    Ok(merged)
}

/// The statistics of all blocks at an output time, from the next lines of all parts.
fn blocks_at(time: f64, statistics: usize, lines: &mut [Lines<'_>]) -> Result<Vec<Vec<Partial<f64>>>> {
    let mut blocks = Vec::new();
    for lines in lines {
        let line = lines.next(time)?;
        if line.gathered.is_some() || line.blocks.iter().any(|block| block.len() != statistics) {
            return Err(lines.unexpected(time));
        }
        blocks.extend(line.blocks);
    }
    Ok(blocks)
}

/// The same for the results formed from the states.
fn gathered_at(time: f64, observed: &Observed, lines: &mut [Lines<'_>]) -> Result<Gathered> {
    let mut all = Gathered::new(observed, 0, 0);
    for lines in lines {
        let found = lines.next(time)?.gathered.filter(|found| found.fits(observed));
        all.append(found.ok_or_else(|| lines.unexpected(time))?, lines.part.first_body);
    }
    Ok(all)
}

/// The events of all parts.
fn merged_events(pieces: &[Piece], observed: &Observed) -> Result<Vec<EventRecord>> {
    if observed.events.is_empty() {
        return Ok(Vec::new());
    }
    let (mut of_parts, bodies) = (vec![Vec::new(); observed.events.len()], pieces[0].part.body_count);
    for piece in pieces {
        let path = piece.folder.join(EVENTS);
        // As long as the part has events; its length and its sum are known.
        let text = std::fs::read_to_string(&path).map_err(|error| Error::file(&path, FileAction::Read, &error))?;
        let entries: Vec<EventEntry> = serde_json::from_str(&text).unwrap_or_default();
        if entries.len() != of_parts.len() || !entries.iter().all(|entry| entry.is_of(&piece.part)) {
            return Err(Error::Table { path, reason: "expected the events of a part's bodies".to_owned() });
        }
        of_parts.iter_mut().zip(entries).for_each(|(parts, entry)| parts.push(entry));
    }
    let unknown = || Error::Table {
        path: pieces[0].folder.join(EVENTS),
        reason: "expected events whose times are known in a way that this build knows".to_owned(),
    };
    let merged =
        |(event, parts): (&Event, Vec<EventEntry>)| EventEntry::merged(event, bodies, &parts).ok_or_else(unknown);
    observed.events.iter().zip(of_parts).map(merged).collect()
}

/// The engines of all parts, by their reports, each with the number of its parts.
fn engines<'a>(reports: impl Iterator<Item = &'a Value>) -> BTreeMap<String, usize> {
    let mut engines = BTreeMap::new();
    for report in reports {
        let name = report["engine"]["adapter"].as_str().unwrap_or_default();
        let name = match report["fallback"]["engine"].as_str() {
            None => name.to_owned(),
            Some(next) => format!("{name}, after a fault {next}"),
        };
        *engines.entry(name).or_default() += 1;
    }
    engines
}

/// Whether all parts met a requirement: `Some(false)` if one did not, else `None` if one is unknown.
fn all_met(mut parts: impl Iterator<Item = Option<bool>>) -> Option<bool> {
    parts
        .try_fold(true, |all, met| if met == Some(false) { None } else { Some(all && met == Some(true)) })
        .map_or(Some(false), |all| all.then_some(true))
}
