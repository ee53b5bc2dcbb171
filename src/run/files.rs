//! A run whose outputs go to files.

use std::ops::ControlFlow;
use std::time::Instant;

use crate::engine::{Backend, Progress};
use crate::error::Result;
use crate::plan::Plan;
use crate::record::column;
use crate::record::csv_file::{self, CsvFile};
use crate::record::failed_file;
use crate::record::folder::{OutputFolder, PLAN, REPORT};
use crate::record::npz_file::{NpzFile, Times};
use crate::record::report::{Report, StatisticsReport, StudyReport};
use crate::record::statistics_file::StatisticsFile;
use crate::record::{OutputState, Sink, Statistics};
use crate::run::{initial_file, run_into};
use crate::study::{Format, Output, Study};

/// Wall time of writing tables, s.
#[derive(Clone, Copy, Debug, Default)]
struct WriteTime {
    format: f64,
    disk: f64,
}

/// What `work` returns; the time that it takes is added to `seconds`.
fn timed<T>(seconds: &mut f64, work: impl FnOnce() -> T) -> T {
    let clock = Instant::now();
    let done = work();
    *seconds += clock.elapsed().as_secs_f64();
    done
}

/// A table under way in either format.
#[derive(Debug)]
enum TableFile {
    Csv(CsvFile),
    Npz(NpzFile),
}

impl TableFile {
    fn begin(
        folder: &mut OutputFolder,
        stem: &str,
        output: Output,
        cells: Option<usize>,
        plan: &Plan<'_>,
        times: Times<'_>,
    ) -> Result<Self> {
        let file = folder.begin(&format!("{stem}.{}", output.format.name()))?;
        let ensemble = plan.scene().ensemble();
        let translates = ensemble.translation().is_some();
        Ok(match output.format {
            Format::Csv => TableFile::Csv(CsvFile::begin(file, translates, cells)?),
            Format::Npz => TableFile::Npz(NpzFile::begin(file, ensemble.len(), times, translates, cells)?),
        })
    }

    /// Appends the states of the bodies from `first_body` on.
    fn append(&mut self, time: f64, first_body: usize, states: &[OutputState], spent: &mut WriteTime) -> Result<()> {
        match self {
            TableFile::Csv(file) => {
                let rows = timed(&mut spent.format, || file.format(time, first_body, states));
                timed(&mut spent.disk, || file.write(&rows))
            }
            TableFile::Npz(file) => {
                let columns = timed(&mut spent.format, || file.format(states));
                timed(&mut spent.disk, || file.write(&columns))
            }
        }
    }

    fn finish(self) -> Result<()> {
        match self {
            TableFile::Csv(file) => file.finish(),
            TableFile::Npz(file) => file.finish(),
        }
    }
}

/// Writes the states and statistics that a study asks for as they come.
#[derive(Debug)]
struct FileSink {
    statistics: Option<StatisticsFile>,
    /// Those of the end.
    at_end: Option<Statistics>,
    final_state: Option<TableFile>,
    snapshots: Option<TableFile>,
    last: usize,
    spent: WriteTime,
}

impl FileSink {
    /// `cells`: of the study's design, where it has one.
    fn begin(folder: &mut OutputFolder, output: Output, cells: Option<usize>, plan: &Plan<'_>) -> Result<Self> {
        let times = plan.times();
        let mut table = |wanted: bool, stem: &str, times: Times<'_>| {
            wanted.then(|| TableFile::begin(folder, stem, output, cells, plan, times)).transpose()
        };
        let (final_state, snapshots) = (
            table(output.final_state, "final", Times::One(plan.scene().end()))?,
            table(output.snapshots, "snapshots", Times::Many(times))?,
        );
        let wanted = plan.scene().wanted_statistics();
        let statistics = (!wanted.is_empty())
            .then(|| StatisticsFile::begin(folder, output.format, wanted, times.len()))
            .transpose()?;
        Ok(Self {
            statistics,
            at_end: None,
            final_state,
            snapshots,
            last: times.len() - 1,
            spent: WriteTime::default(),
        })
    }

    fn finish(&mut self) -> Result<()> {
        let mut tables = self.final_state.take().into_iter().chain(self.snapshots.take());
        let statistics = self.statistics.take();
        timed(&mut self.spent.disk, || {
            tables.try_for_each(TableFile::finish)?;
            statistics.map_or(Ok(()), StatisticsFile::finish)
        })
    }
}

impl Sink for FileSink {
    fn wants(&mut self, index: usize, _: usize, _: f64) -> bool {
        self.snapshots.is_some() || (index == self.last && self.final_state.is_some())
    }

    fn bodies(&mut self, index: usize, time: f64, first_body: usize, states: &[OutputState]) -> Result<()> {
        let at_end = index == self.last;
        let tables = self.snapshots.iter_mut().chain(self.final_state.iter_mut().filter(|_| at_end));
        for table in tables {
            table.append(time, first_body, states, &mut self.spent)?;
        }
        Ok(())
    }

    fn statistics(&mut self, index: usize, statistics: &Statistics) -> Result<()> {
        if index == self.last {
            self.at_end = Some(statistics.clone());
        }
        let Some(file) = &mut self.statistics else { return Ok(()) };
        timed(&mut self.spent.disk, || file.append(statistics))
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
    pub fn of(plan: &Plan<'_>, output: Output) -> Self {
        let ensemble = plan.scene().ensemble();
        let times = output.snapshots as u64 * plan.times().len() as u64 + output.final_state as u64;
        let rows = times.saturating_mul(ensemble.len() as u64);
        let numbers = column::names(ensemble.translation().is_some()).count() as u64;
        let (least, likely) = match output.format {
            Format::Csv => {
                let status = csv_file::STATUS_BYTES;
                (csv_file::LEAST_BYTES * numbers + status, csv_file::LIKELY_BYTES * numbers + status)
            }
            Format::Npz => (8 * numbers + 1, 8 * numbers + 1),
        };
        let initial = if output.initial { ensemble.len() as u64 } else { 0 };
        let in_all = |bytes: u64, of_number: u64| {
            rows.saturating_mul(bytes).saturating_add(initial.saturating_mul(of_number * initial_file::LEAST_NUMBERS))
        };
        let (least_number, likely_number) = match output.format {
            Format::Csv => (csv_file::LEAST_BYTES, csv_file::LIKELY_BYTES),
            Format::Npz => (8, 8),
        };
        Self {
            rows: rows + initial,
            least_bytes: in_all(least, least_number),
            likely_bytes: in_all(likely, likely_number),
        }
    }
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
    output: Output,
    mut folder: OutputFolder,
    since: Instant,
    observer: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Report> {
    let study_seconds = since.elapsed().as_secs_f64();
    let design = study.and_then(Study::design);
    let mut sink = FileSink::begin(&mut folder, output, design.map(|design| design.cells()), plan)?;
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
    let trust = run_into(engine, plan, &mut sink, observer)?;
    sink.finish()?;
    if !trust.failures.is_empty() {
        failed_file::write(&mut folder, output.format, &trust.failures)?;
    }
    folder.write(PLAN, plan.to_json().as_bytes())?;

    let study = study.map(|study| StudyReport {
        file: study.file().display().to_string(),
        title: study.title().map(str::to_owned),
        seed: study.seed(),
    });
    let mut report = Report::new(study, plan, trust);
    report.statistics = sink.at_end.as_ref().map(StatisticsReport::from);
    report.files = folder.names().to_vec();
    report.wall_time.plan = plan.planning_time().as_secs_f64();
    report.wall_time.study = (study_seconds - report.wall_time.plan).max(0.0);
    report.wall_time.format = sink.spent.format;
    report.wall_time.disk = sink.spent.disk + initial_seconds;
    report.wall_time.total = since.elapsed().as_secs_f64();
    let text = report.to_json();
    folder.write(REPORT, text.as_bytes())?;
    folder.commit()?;
    Ok(report)
}
