//! A run whose outputs go to files.

use std::ops::{ControlFlow, Range};
use std::path::Path;
use std::time::Instant;

use crate::engine::{Backend, Progress};
use crate::error::{Error, Result};
use crate::kernel::observe::Partial;
use crate::plan::{Plan, PlanDocument};
use crate::record::column::{Layout, StateRows};
use crate::record::csv_file::{self, CsvFile};
use crate::record::failed_file;
use crate::record::folder::{Metadata, OutputFile, OutputFolder, PLAN, REPORT, write_whole};
use crate::record::npz_file::{NpzFile, Times};
use crate::record::observed_files::{write_events, write_histograms};
#[cfg(feature = "parquet")]
use crate::record::parquet_file::ParquetStates;
use crate::record::report::{EventReport, Report, StatisticsReport, StudyReport};
use crate::record::shard::{BLOCKS, BlocksLine, PART, PartContents, PartFile, Shard};
use crate::record::statistics_file::StatisticsFile;
use crate::record::{EventRecord, HistogramCounts, OutputState, Sink, Statistics};
use crate::run::observed::Evaluator;
use crate::run::{initial_file, run_into};
use crate::study::{Format, Output, Study};

/// Wall time of writing tables, s.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct WriteTime {
    pub format: f64,
    pub disk: f64,
}

/// What `work` returns; the time that it takes is added to `seconds`.
fn timed<T>(seconds: &mut f64, work: impl FnOnce() -> T) -> T {
    let clock = Instant::now();
    let done = work();
    *seconds += clock.elapsed().as_secs_f64();
    done
}

/// A table of states under way in any format.
#[derive(Debug)]
pub(super) enum TableFile {
    Csv(CsvFile),
    Npz(NpzFile),
    #[cfg(feature = "parquet")]
    Parquet(Box<ParquetStates>),
}

impl TableFile {
    /// Begins a table of the bodies in a range, counted as in the whole that they are a part of.
    pub fn begin(
        folder: &mut OutputFolder,
        (stem, format): (&str, Format),
        bodies: Range<usize>,
        layout: &Layout,
        times: Times<'_>,
    ) -> Result<Self> {
        let name = format!("{stem}.{}", format.name());
        Ok(match format {
            Format::Csv => TableFile::Csv(CsvFile::begin(folder.begin(&name)?, layout)?),
            Format::Npz => TableFile::Npz(NpzFile::begin(folder.begin(&name)?, bodies, times, layout)?),
            #[cfg(feature = "parquet")]
            Format::Parquet => TableFile::Parquet(Box::new(ParquetStates::begin(folder, stem, layout)?)),
        })
    }

    /// Appends the rows of the bodies from `first_body` on.
    pub fn append(&mut self, time: f64, first_body: usize, rows: &StateRows, spent: &mut WriteTime) -> Result<()> {
        match self {
            TableFile::Csv(file) => {
                let rows = timed(&mut spent.format, || file.format(time, first_body, rows));
                timed(&mut spent.disk, || file.write(&rows))
            }
            TableFile::Npz(file) => timed(&mut spent.disk, || file.write(rows)),
            #[cfg(feature = "parquet")]
            TableFile::Parquet(file) => timed(&mut spent.disk, || file.write(time, first_body, rows.clone())),
        }
    }

    pub fn finish(self) -> Result<()> {
        match self {
            TableFile::Csv(file) => file.finish(),
            TableFile::Npz(file) => file.finish(),
            #[cfg(feature = "parquet")]
            TableFile::Parquet(file) => file.finish(),
        }
    }
}

/// Writes the states and statistics that a study asks for as they come.
struct FileSink<'p> {
    layout: Layout,
    /// Forms the derived quantities of the tables.
    evaluator: Option<Evaluator<'p>>,
    statistics: Option<StatisticsFile>,
    /// Those of the end.
    at_end: Option<Statistics>,
    histograms: Vec<Vec<HistogramCounts>>,
    events: Vec<EventRecord>,
    final_state: Option<TableFile>,
    snapshots: Option<TableFile>,
    /// The statistics of each block, of a part of a study.
    blocks: Option<OutputFile>,
    /// Of the study that the bodies are a part of.
    first_body: usize,
    last: usize,
    spent: WriteTime,
}

impl<'p> FileSink<'p> {
    fn begin(
        folder: &mut OutputFolder,
        output: &Output,
        layout: Layout,
        plan: &'p Plan<'_>,
        is_part: bool,
    ) -> Result<Self> {
        let (times, ensemble) = (plan.times(), plan.scene().ensemble());
        let first_body = plan.scene().part().first_body;
        let bodies = first_body..first_body + ensemble.len();
        let mut table = |wanted: bool, stem: &str, times: Times<'_>| {
            let of = (stem, output.format);
            wanted.then(|| TableFile::begin(folder, of, bodies.clone(), &layout, times)).transpose()
        };
        let (final_state, snapshots) = (
            table(output.final_state, "final", Times::One(plan.scene().end()))?,
            table(output.snapshots, "snapshots", Times::Many(times))?,
        );
        let (wanted, quantiles) = (plan.scene().wanted_statistics(), plan.scene().wanted_quantiles());
        let statistics = (!wanted.is_empty())
            .then(|| StatisticsFile::begin(folder, output.format, wanted, quantiles, times.len()))
            .transpose()?;
        let blocks = (is_part && !wanted.is_empty()).then(|| folder.begin(BLOCKS)).transpose()?;
        let quantities = &layout.quantities;
        let evaluator = (!quantities.is_empty()).then(|| Evaluator::new(plan.scene(), quantities)).transpose()?;
        Ok(Self {
            layout,
            evaluator,
            statistics,
            blocks,
            first_body,
            at_end: None,
            histograms: Vec::new(),
            events: Vec::new(),
            final_state,
            snapshots,
            last: times.len() - 1,
            spent: WriteTime::default(),
        })
    }

    fn finish(&mut self) -> Result<()> {
        let mut tables = self.final_state.take().into_iter().chain(self.snapshots.take());
        let (statistics, blocks) = (self.statistics.take(), self.blocks.take());
        timed(&mut self.spent.disk, || {
            tables.try_for_each(TableFile::finish)?;
            statistics.map_or(Ok(()), StatisticsFile::finish)?;
            blocks.map_or(Ok(()), OutputFile::finish)
        })
    }
}

impl Sink for FileSink<'_> {
    fn wants(&mut self, index: usize, _: usize, _: f64) -> bool {
        self.snapshots.is_some() || (index == self.last && self.final_state.is_some())
    }

    fn bodies(&mut self, index: usize, time: f64, first_body: usize, states: &[OutputState]) -> Result<()> {
        let at_end = index == self.last;
        let rows = timed(&mut self.spent.format, || {
            let values = self.evaluator.as_ref().map(|evaluator| evaluator.values(first_body, time, states));
            let of = |place: usize| values.iter().flat_map(move |values| values.of(place)).flat_map(|(_, part)| part);
            let derived = (0..self.layout.quantities.len()).map(|place| of(place).copied().collect()).collect();
            StateRows::of(&self.layout, states, derived)
        });
        let tables = self.snapshots.iter_mut().chain(self.final_state.iter_mut().filter(|_| at_end));
        for table in tables {
            table.append(time, self.first_body + first_body, &rows, &mut self.spent)?;
        }
        Ok(())
    }

    fn statistics(&mut self, index: usize, statistics: &Statistics) -> Result<()> {
        let statistics = statistics.clone().counted_from(self.first_body);
        let done = match &mut self.statistics {
            Some(file) => timed(&mut self.spent.disk, || file.append(&statistics)),
            None => Ok(()),
        };
        if index == self.last {
            self.at_end = Some(statistics);
        }
        done
    }

    fn statistics_of_blocks(&mut self, _: usize, time: f64, blocks: &[Vec<Partial<f64>>]) -> Result<()> {
        let Some(file) = &mut self.blocks else { return Ok(()) };
        let line = timed(&mut self.spent.format, || BlocksLine::new(time, blocks, self.first_body).to_line());
        timed(&mut self.spent.disk, || file.write(line.as_bytes()))
    }

    fn histograms(&mut self, _: usize, histograms: &[HistogramCounts]) -> Result<()> {
        self.histograms.push(histograms.to_vec());
        Ok(())
    }

    fn events(&mut self, events: Vec<EventRecord>) -> Result<()> {
        self.events = events;
        Ok(())
    }
}

/// How much a run writes: of all tables of states, but for their headers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OutputSize {
    /// Rows, one a body and output time in each table.
    pub rows: u64,
    /// Bytes at the least: exact of arrays; of text if all numbers are short.
    pub least_bytes: u64,
    /// Bytes, of text as numbers mostly are.
    pub likely_bytes: u64,
}

impl OutputSize {
    /// What `output` asks of a run of `plan`.
    pub fn of(plan: &Plan<'_>, output: &Output) -> Self {
        let ensemble = plan.scene().ensemble();
        let times = output.snapshots as u64 * plan.times().len() as u64 + output.final_state as u64;
        let rows = times.saturating_mul(ensemble.len() as u64);
        let numbers = Layout::of_output(output, ensemble.translation().is_some(), None).columns.len() as u64;
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

/// Writes a plan ([`Plan::to_json`]) to a file, which appears as a whole and replaces any of its name.
///
/// # Errors
///
/// [`Error::File`].
pub fn write_plan(plan: &Plan<'_>, path: &Path) -> Result<()> {
    write_whole(path, plan.to_json().as_bytes())
}

/// Runs `plan` on `engine` and writes the tables that `output` asks for, `plan.json` and `report.json`, into `folder`, and, where
/// bodies have failed, a table `failed` of them ([`crate::record::FailedBody`]).
///
/// All files appear together when all are complete and on the disk; where anything fails or `observer` breaks, none appears.
/// Memory does not grow with the number of output times. `since` is when the work on the study began, for the report.
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
    run_files(engine, plan, study, output, (folder, None), since, observer)
}

/// As [`run_to_folder`], of a part of a study ([`Study::part`]), whose folder is that of `shard`. `document` is the plan that all parts
/// follow, which is written as it was read. Beside the tables stands what [`crate::run::merge`] needs to make those of the whole.
///
/// # Errors
///
/// As [`run_to_folder`], and [`Error::Setting`] where the study asks for quantiles, histograms, events or derived quantities.
pub fn run_shard_to_folder(
    engine: &dyn Backend,
    plan: &Plan<'_>,
    study: &Study,
    (shard, document): (Shard, &PlanDocument),
    folder: OutputFolder,
    since: Instant,
    observer: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Report> {
    if plan.scene().needs_states() {
        let value = plan.scene().observed().quantities().len() as f64;
        let expected =
            "quantiles, histograms, events and derived quantities are not merged from parts: run the study as a whole";
        return Err(Error::Setting { field: "quantities", value, expected });
    }
    run_files(engine, plan, Some(study), study.output(), (folder, Some((shard, document))), since, observer)
}

/// What files that have metadata say of a run: what it follows, and nothing that differs from one time to the next.
fn metadata(study: Option<&Study>, plan: &str) -> Metadata {
    let mut metadata = vec![("polhode.version".to_owned(), env!("CARGO_PKG_VERSION").to_owned())];
    if let Some(study) = study {
        metadata.extend(study.title().map(|title| ("polhode.title".to_owned(), title.to_owned())));
        metadata.push(("polhode.study".to_owned(), study.text().to_owned()));
        metadata.push(("polhode.seed".to_owned(), study.seed().to_string()));
    }
    metadata.push(("polhode.plan".to_owned(), plan.to_owned()));
    metadata
}

fn run_files(
    engine: &dyn Backend,
    plan: &Plan<'_>,
    study: Option<&Study>,
    output: &Output,
    (mut folder, shard): (OutputFolder, Option<(Shard, &PlanDocument)>),
    since: Instant,
    observer: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Report> {
    let study_seconds = since.elapsed().as_secs_f64();
    let design = study.and_then(Study::design);
    let cells = design.map(|design| design.cells());
    let plan_text = shard.map_or_else(|| plan.to_json(), |(_, document)| document.text().to_owned());
    let metadata = metadata(study, &plan_text);
    folder.set_metadata(metadata.clone());
    let layout = Layout::of_output(output, plan.scene().ensemble().translation().is_some(), cells);
    let columns = layout.columns.clone();
    let mut sink = FileSink::begin(&mut folder, output, layout, plan, shard.is_some())?;
    let mut initial_seconds = 0.0;
    timed(&mut initial_seconds, || {
        if let Some(design) = design {
            initial_file::write_cells(&mut folder, output.format, design, plan.scene().ensemble().len())?;
        }
        match output.initial {
            true => initial_file::write_initial(&mut folder, output.format, study, plan.scene()),
            false => Ok(()),
        }
    })?;
    let mut trust = run_into(engine, plan, &mut sink, observer)?;
    sink.finish()?;
    let (part, scene) = (plan.scene().part(), plan.scene());
    trust.failures.iter_mut().for_each(|failed| failed.body += part.first_body);
    trust.failed_bodies.iter_mut().for_each(|body| *body += part.first_body);
    if !trust.failures.is_empty() {
        failed_file::write(&mut folder, output.format, &trust.failures)?;
    }
    if !sink.events.is_empty() {
        write_events(&mut folder, output.format, &sink.events, plan.times(), cells)?;
    }
    if !sink.histograms.is_empty() {
        write_histograms(&mut folder, output.format, scene.wanted_histograms(), &sink.histograms)?;
    }
    folder.write(PLAN, plan_text.as_bytes())?;
    if let Some((shard, _)) = shard {
        let contents = PartFile::new(PartContents {
            shard,
            bodies: part.first_body..part.first_body + scene.ensemble().len(),
            body_count: part.of,
            columns: &columns,
            metadata,
            times: plan.times(),
            output,
            statistics: &scene.plain_statistics(),
            allowed_failures: study.map_or(0, Study::allowed_failures),
            failures: &trust.failures,
            files: folder.entries()?,
        });
        folder.write(PART, contents.to_json().as_bytes())?;
    }

    let study = study.map(StudyReport::of);
    let mut report = Report::new(study, plan, trust);
    report.statistics = sink.at_end.as_ref().map(StatisticsReport::from);
    report.events = sink.events.iter().map(|record| EventReport::new(record, scene.end())).collect();
    report.files = folder.names().to_vec();
    report.wall_time.study = (study_seconds - report.wall_time.plan).max(0.0);
    report.wall_time.format = sink.spent.format;
    report.wall_time.disk = sink.spent.disk + initial_seconds;
    report.wall_time.total = since.elapsed().as_secs_f64();
    let text = report.to_json();
    folder.write(REPORT, text.as_bytes())?;
    folder.commit()?;
    Ok(report)
}
