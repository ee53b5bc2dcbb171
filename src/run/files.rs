//! A run whose outputs go to files.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

use crate::engine::{Backend, Progress};
use crate::error::Result;
use crate::kernel::observe::Partial;
use crate::plan::{Plan, PlanDocument};
use crate::record::column::Layout;
use crate::record::csv_file;
use crate::record::failed_file;
use crate::record::folder::{Metadata, OutputFile, OutputFolder, PLAN, REPORT, write_whole};
use crate::record::observed_files::{write_events, write_histograms};
use crate::record::part_file::{
    BLOCKS, BlocksLine, EVENTS, EventEntry, FORMAT, FailureEntry, PART, PLAN_TEXT, PartFile, STUDY_TEXT,
};
use crate::record::report::{EventReport, Report, StatisticsReport, StoppedReport, StudyReport};
use crate::record::statistics_file::StatisticsFiles;
use crate::record::{EventRecord, Gathered, HistogramCounts, OfCell, OutputState, Sink, Statistics};
use crate::run::outcome::Outcome;
use crate::run::state_tables::{StateQueue, StateTables, TableFile, WriteTime, timed};
use crate::run::{initial_file, run_into};
use crate::study::{Format, Output, Study};

/// The sink of a run: passes states to the thread that writes their tables, writes statistics to their file, and keeps
/// the rest.
struct FileSink<'q> {
    states: &'q mut StateQueue,
    /// The sampled torques' own state, for the bodies that come next.
    own: Vec<Vec<f64>>,
    statistics: StatisticsFiles,
    kept: Kept,
    /// The results by block from which [`crate::run::merge`] forms statistics and histograms, for a part of a study.
    blocks: Option<OutputFile>,
    /// The index of the first body in the whole study.
    first_body: usize,
}

/// Results that are written when the run is over.
#[derive(Default)]
struct Kept {
    statistics: KeptStatistics,
    events: Vec<EventRecord>,
    spent: WriteTime,
}

/// What is left of the statistics once their tables are written.
#[derive(Default)]
pub(super) struct KeptStatistics {
    /// Those of the last output so far.
    pub report: Option<StatisticsReport>,
    /// By output, then by histogram.
    pub histograms: Vec<Vec<HistogramCounts>>,
    /// By output, then by cell, then by histogram; empty if they are not asked for.
    pub histograms_by_cell: Vec<Vec<Vec<HistogramCounts>>>,
}

impl<'q> FileSink<'q> {
    fn begin(
        folder: &mut OutputFolder,
        output: &Output,
        plan: &Plan<'_>,
        is_part: bool,
        states: &'q mut StateQueue,
    ) -> Result<Self> {
        let (observed, outputs) = (plan.scene().observed(), plan.times().len());
        let statistics = StatisticsFiles::begin(folder, output.format, observed, outputs)?;
        let is_gathered = !(observed.statistics.is_empty() && observed.histograms.is_empty());
        let blocks = (is_part && is_gathered).then(|| folder.begin(BLOCKS)).transpose()?;
        Ok(Self {
            states,
            own: Vec::new(),
            statistics,
            kept: Kept::default(),
            blocks,
            first_body: plan.scene().part().first_body,
        })
    }

    fn finish(self) -> Result<Kept> {
        let Self { statistics, blocks, mut kept, .. } = self;
        timed(&mut kept.spent.disk, || {
            statistics.finish()?;
            blocks.map_or(Ok(()), OutputFile::finish)
        })?;
        Ok(kept)
    }
}

impl Sink for FileSink<'_> {
    fn wants(&mut self, index: usize, _: usize, _: f64) -> bool {
        self.states.wants(index)
    }

    fn bodies(&mut self, index: usize, time: f64, first_body: usize, states: &[OutputState]) -> Result<()> {
        let own = std::mem::take(&mut self.own);
        self.states.push(index, time, first_body, &mut states.to_vec(), own)
    }

    fn take_bodies(&mut self, index: usize, time: f64, first_body: usize, states: &mut Vec<OutputState>) -> Result<()> {
        let own = std::mem::take(&mut self.own);
        self.states.push(index, time, first_body, states, own)
    }

    fn own_state(&mut self, numbers: Vec<Vec<f64>>) -> Result<()> {
        self.own = numbers;
        Ok(())
    }

    fn statistics(&mut self, _: usize, statistics: &Statistics) -> Result<()> {
        let statistics = statistics.clone().counted_from(self.first_body);
        let done = timed(&mut self.kept.spent.disk, || self.statistics.append(&statistics));
        let report = &mut self.kept.statistics.report;
        *report = Some(StatisticsReport::after(report.take(), &statistics));
        done
    }

    fn statistics_of_blocks(&mut self, _: usize, time: f64, blocks: &[Vec<Partial<f64>>]) -> Result<()> {
        let Some(file) = &mut self.blocks else { return Ok(()) };
        let line =
            timed(&mut self.kept.spent.format, || BlocksLine::of_blocks(time, blocks, self.first_body).to_line());
        timed(&mut self.kept.spent.disk, || file.write(line.as_bytes()))
    }

    fn gathered(&mut self, _: usize, time: f64, gathered: Gathered) -> Result<()> {
        let Some(file) = &mut self.blocks else { return Ok(()) };
        let line = timed(&mut self.kept.spent.format, || BlocksLine::of_gathered(time, gathered).to_line());
        timed(&mut self.kept.spent.disk, || file.write(line.as_bytes()))
    }

    fn histograms(&mut self, _: usize, histograms: &[HistogramCounts]) -> Result<()> {
        self.kept.statistics.histograms.push(histograms.to_vec());
        Ok(())
    }

    fn by_cell(&mut self, _: usize, cells: Vec<OfCell>) -> Result<()> {
        let of_cell = |cell: OfCell| (cell.statistics.counted_from(self.first_body), cell.histograms);
        let (statistics, histograms): (Vec<_>, Vec<_>) = cells.into_iter().map(of_cell).unzip();
        timed(&mut self.kept.spent.disk, || self.statistics.append_cells(statistics.iter()))?;
        let kept = &mut self.kept.statistics;
        if !kept.histograms.is_empty() {
            kept.histograms_by_cell.push(histograms);
        }
        Ok(())
    }

    fn events(&mut self, events: Vec<EventRecord>) -> Result<()> {
        self.kept.events = events;
        Ok(())
    }
}

/// The size of all tables of states that a run writes, without their headers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OutputSize {
    /// Rows, one for each body and output time in each table.
    pub rows: u64,
    /// The least number of bytes: exact for arrays; for text, if all numbers are short.
    pub least_bytes: u64,
    /// The likely number of bytes: for text, with numbers of usual length.
    pub likely_bytes: u64,
}

impl OutputSize {
    /// The size of the tables that `output` asks of a run of `plan`.
    pub fn of(plan: &Plan<'_>, output: &Output) -> Self {
        let ensemble = plan.scene().ensemble();
        let times = output.snapshots as u64 * plan.times().len() as u64 + output.final_state as u64;
        let rows = times.saturating_mul(ensemble.len() as u64);
        let numbers = Layout::of_output(output, plan.scene(), None).columns.len() as u64;
        let (least, likely) = match output.format {
            Format::Csv => {
                let status = csv_file::STATUS_BYTES;
                (csv_file::LEAST_BYTES * numbers + status, csv_file::LIKELY_BYTES * numbers + status)
            }
            Format::Npz => (8 * numbers + 1, 8 * numbers + 1),
            // Indices, times and codes take less than a byte in all.
            #[cfg(feature = "parquet")]
            Format::Parquet => (8 * numbers, 8 * numbers + 1),
        };
        let initial = if output.initial { ensemble.len() as u64 } else { 0 };
        let in_all = |bytes: u64, of_number: u64| {
            rows.saturating_mul(bytes).saturating_add(initial.saturating_mul(of_number * initial_file::LEAST_NUMBERS))
        };
        let (least_number, likely_number) = match output.format {
            Format::Csv => (csv_file::LEAST_BYTES, csv_file::LIKELY_BYTES),
            Format::Npz => (8, 8),
            #[cfg(feature = "parquet")]
            Format::Parquet => (8, 8),
        };
        Self {
            rows: rows + initial,
            least_bytes: in_all(least, least_number),
            likely_bytes: in_all(likely, likely_number),
        }
    }
}

/// Writes a plan ([`Plan::to_json`]) to a file, which appears at once as a whole and replaces any of its name.
///
/// # Errors
///
/// [`crate::Error::File`].
pub fn write_plan(plan: &Plan<'_>, path: &Path) -> Result<()> {
    write_whole(path, plan.to_json().as_bytes())
}

/// Runs `plan` on `engine` and writes the tables that `output` asks for, `plan.json` and `report.json`, into `folder`,
/// and, if bodies have failed, a table `failed` of them ([`crate::record::FailedBody`]).
///
/// All files appear together when all are complete and on the disk; if anything fails or `observer` breaks, none
/// appears. Memory does not grow with the number of output times, but for the counts of histograms, which are kept to the
/// end. `since` is when the work on the study began, for the report.
///
/// # Errors
///
/// As [`run_into`], and [`crate::Error::File`] where a file cannot be written.
pub fn run_to_folder(
    engine: &dyn Backend,
    plan: &Plan<'_>,
    study: Option<&Study>,
    output: &Output,
    folder: OutputFolder,
    since: Instant,
    observer: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Report> {
    run_files(engine, plan, (study, output), folder, None, since, observer)
}

/// As [`run_to_folder`], for a part of a study ([`Study::part`]). `document` is the plan that all parts follow, and is
/// written unchanged. Beside the tables of states and statistics it writes the data from which [`crate::run::merge`]
/// forms those of the whole study; only the merge makes tables of events, survival and histograms.
pub fn run_part_to_folder(
    engine: &dyn Backend,
    plan: &Plan<'_>,
    study: &Study,
    document: &PlanDocument,
    folder: OutputFolder,
    since: Instant,
    observer: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Report> {
    let part_of = PartOf { document, final_states: None };
    run_files(engine, plan, (Some(study), study.output()), folder, Some(part_of), since, observer)
}

/// The whole to which a run of some bodies of a study belongs.
pub(super) struct PartOf<'a> {
    /// The plan of all bodies.
    pub document: &'a PlanDocument,
    /// The table of final states of all bodies, to which those of the part go; without one they go to the part's own
    /// table.
    pub final_states: Option<&'a mut TableFile>,
}

/// The study and the plan of a run, for the metadata of files.
fn metadata(study: Option<&Study>, plan: &str) -> Metadata {
    let mut metadata = vec![("polhode.version".to_owned(), env!("CARGO_PKG_VERSION").to_owned())];
    if let Some(study) = study {
        metadata.extend(study.title().map(|title| ("polhode.title".to_owned(), title.to_owned())));
        metadata.push((STUDY_TEXT.to_owned(), study.text().to_owned()));
        metadata.push(("polhode.seed".to_owned(), study.seed().to_string()));
    }
    metadata.push((PLAN_TEXT.to_owned(), plan.to_owned()));
    metadata
}

pub(super) fn run_files(
    engine: &dyn Backend,
    plan: &Plan<'_>,
    (study, output): (Option<&Study>, &Output),
    mut folder: OutputFolder,
    part_of: Option<PartOf<'_>>,
    since: Instant,
    observer: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Report> {
    let study_seconds = since.elapsed().as_secs_f64();
    let design = study.and_then(Study::design);
    let cells = design.map(|design| design.cells());
    let is_part = part_of.is_some();
    let plan_text = part_of.as_ref().map_or_else(|| plan.to_json(), |part| part.document.text().to_owned());
    let of_all = part_of.and_then(|part| part.final_states);
    let output = &Output { final_state: output.final_state && of_all.is_none(), ..output.clone() };
    let metadata = metadata(study, &plan_text);
    folder.add_metadata(metadata.clone());
    let layout = Layout::of_output(output, plan.scene(), cells);
    let columns = layout.columns.clone();
    let tables = StateTables::begin(&mut folder, output, layout, plan, of_all)?;
    let ((mut trust, kept), mut spent) = tables.while_running(|queue| {
        let mut sink = FileSink::begin(&mut folder, output, plan, is_part, queue)?;
        timed(&mut sink.kept.spent.disk, || {
            if let Some(design) = design {
                initial_file::write_cells(&mut folder, output.format, design, plan.scene().part().of)?;
            }
            match output.initial {
                true => initial_file::write_initial(&mut folder, output.format, study, plan.scene()),
                false => Ok(()),
            }
        })?;
        let trust = run_into(engine, plan, &mut sink, observer)?;
        folder.add_metadata(Outcome::of(plan, &trust).metadata());
        Ok((trust, sink.finish()?))
    })?;
    spent.format += kept.spent.format;
    spent.disk += kept.spent.disk;
    let (part, scene) = (plan.scene().part(), plan.scene());
    trust.failures.iter_mut().for_each(|failed| failed.body += part.first_body);
    trust.failed_bodies.iter_mut().for_each(|body| *body += part.first_body);
    if !trust.failures.is_empty() {
        failed_file::write(&mut folder, output.format, &trust.failures)?;
    }
    let failures = if is_part { trust.failures.iter().map(FailureEntry::from).collect() } else { Vec::new() };
    if !is_part {
        if !kept.events.is_empty() {
            write_events(&mut folder, output.format, &kept.events, plan.times(), cells)?;
        }
        let counts = (&kept.statistics.histograms[..], &kept.statistics.histograms_by_cell[..]);
        write_histograms(&mut folder, output.format, scene.wanted_histograms(), counts)?;
    } else if !kept.events.is_empty() {
        let entries: Vec<EventEntry> =
            kept.events.iter().map(|record| EventEntry::new(record, part.first_body)).collect();
        folder.write(EVENTS, &serde_json::to_vec(&entries).unwrap_or_default())?;
    }
    folder.write(PLAN, plan_text.as_bytes())?;
    let mut report = Report::new(study.map(StudyReport::of), plan, trust);
    report.statistics = kept.statistics.report;
    report.events = kept.events.iter().map(|record| EventReport::new(record, scene.end())).collect();
    report.stopped = StoppedReport::of(&kept.events);
    report.files = folder.names().to_vec();
    report.files.extend(is_part.then(|| PART.to_owned()));
    report.wall_time.study = (study_seconds - report.wall_time.plan).max(0.0);
    report.wall_time.format = spent.format;
    report.wall_time.disk = spent.disk;
    report.wall_time.total = since.elapsed().as_secs_f64();
    let text = report.to_json();
    folder.write(REPORT, text.as_bytes())?;
    if is_part {
        let contents = PartFile {
            format: FORMAT,
            polhode: env!("CARGO_PKG_VERSION").to_owned(),
            first_body: part.first_body,
            bodies: scene.ensemble().len(),
            body_count: part.of,
            columns,
            cells,
            metadata,
            times: plan.times().to_vec(),
            final_state: output.final_state,
            snapshots: output.snapshots,
            initial: output.initial,
            output_format: output.format.name().to_owned(),
            allowed_failures: study.map_or(0, Study::allowed_failures),
            failures,
            files: folder.entries()?,
        };
        folder.write(PART, contents.to_json().as_bytes())?;
    }
    folder.commit()?;
    Ok(report)
}
