//! Runs a study some bodies at a time: finished pieces are kept, and a run that has ended early continues from there.
//!
//! Bodies do not act on each other, so a run can be divided by bodies. Each piece of consecutive blocks of bodies
//! ([`crate::bodies::Blocks`]) is run from start to end and written into a folder of its own, which appears when all of
//! it is on the disk, like that of a part. When all pieces are finished, they are merged. Results do not depend on the
//! division, so the tables are those of one run, byte for byte, however often it was stopped; and the run takes the
//! memory of one piece.

use std::fs;
use std::io::ErrorKind;
use std::ops::{ControlFlow, Range};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde_json::Value;

use super::files::{PartOf, run_files, write_plan};
use super::merge::{MergedReport, check_files, merge_folders};
use super::state_tables::TableFile;
use crate::bodies::{Blocks, memory};
use crate::engine::{Backend, Progress};
use crate::error::{Error, FileAction, Result};
use crate::plan::{Plan, PlanDocument};
use crate::record::column::Layout;
use crate::record::folder::{file_entry, write_whole};
use crate::record::npz_file::Times;
use crate::record::part_file::{PartFile, STUDY_TEXT};
use crate::record::report::StudyReport;
use crate::record::{OutputFolder, PLAN, REPORT, Traces};
use crate::study::Study;
use crate::study::text::read_text;

/// The start of the name of a piece's folder, such as `bodies-0-4095`.
const PIECE: &str = "bodies-";

/// The name of the plan in a folder whose pieces are being removed: such a folder counts as empty.
const REMOVED: &str = "plan.json.removed";

/// The file that says which results the run was to replace: size and sum of their report, or nothing if there was none.
const REPLACES: &str = "replaces.txt";

/// The file that says how far apart checkpoints were asked to be: wall-clock seconds.
const INTERVAL: &str = "interval.txt";

/// The most bodies of a piece: the data that a run keeps of them take less than a gigabyte.
const MOST_BODIES: usize = 1 << 21;

/// The same if pieces have no tables of states: columns of at most 2 MB, whose memory the next piece reuses. Allocators
/// return larger blocks to the system, which then clears each page again.
const MOST_WITHOUT_STATES: usize = 1 << 18;

/// The most bodies from which a plan is made: a sample if all are drawn alike.
const MOST_PLANNED: usize = 1 << 20;

/// The least number of bodies per cell from which a plan is made.
const LEAST_OF_CELL: usize = 16;

/// The first piece takes this fraction of the time between two checkpoints, as the plan's expectation is not measured.
const FIRST: f64 = 0.25;

/// A piece has at most this many times the bodies of the one before.
const GROWTH: usize = 4;

/// If neither an expected nor a measured time is known, a piece has one in `ONE_IN` bodies, and at least
/// `LEAST_BODIES`.
const ONE_IN: usize = 64;
const LEAST_BODIES: usize = 64;

/// The finished part of a run: a folder of finished pieces, and the plan that they follow.
#[derive(Debug)]
pub struct Checkpoint {
    folder: PathBuf,
    plan: PlanDocument,
    /// The finished pieces, in the order of their bodies.
    pieces: Vec<Range<usize>>,
    /// What was found damaged or missing among them.
    lost: Vec<LostPiece>,
    pace: Pace,
    /// The most bodies of a piece.
    most: usize,
    final_states: FinalStates,
}

/// Bodies whose piece was found damaged, or missing before other pieces: [`Checkpoint::advance`] computes them again.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LostPiece {
    /// The bodies.
    pub bodies: Range<usize>,
    /// What is wrong, with the path.
    pub reason: String,
}

/// Where the final states of a run in pieces go.
#[derive(Debug)]
enum FinalStates {
    /// To the tables of its pieces.
    Pieces,
    /// To the table of all bodies.
    Table(TableFile),
    /// The table of all bodies is of no use, as a piece ended early and may have left rows in it.
    Lost,
}

/// Called with the bodies of a piece before it is computed, and with its traces in the file system; breaks to stop
/// there.
pub type PieceObserver<'o> = dyn FnMut(&Checkpoint, Range<usize>, &Traces) -> ControlFlow<()> + 'o;

/// The speed of the computation.
#[derive(Clone, Copy, Debug)]
enum Pace {
    Unknown,
    /// Bodies per second that the plan expects.
    Expected(f64),
    /// Bodies per second of the last piece.
    Measured(f64),
}

impl Pace {
    /// From the wall times in the report of a piece. Opening and closing files takes equally long for a piece of any
    /// size, so it does not count.
    fn measured(bodies: usize, wall_time: &Value) -> Self {
        const OF_BODIES: [&str; 8] =
            ["study", "prepare", "start", "compute", "read", "observe", "format", "recomputed_sample"];
        let seconds: f64 = OF_BODIES.iter().filter_map(|phase| wall_time[phase].as_f64()).sum();
        if seconds > 0.0 { Self::Measured(bodies as f64 / seconds) } else { Self::Unknown }
    }
}

/// Why a piece cannot be taken up.
enum Fault {
    /// It is not as it was written.
    Damaged(Error),
    /// It belongs to another run, or cannot be read.
    Foreign(Error),
}

impl Fault {
    /// The fault that an error in reading a piece tells of.
    fn of(error: Error) -> Self {
        match error {
            Error::Table { .. } => Self::Damaged(error),
            Error::File { kind: ErrorKind::NotFound | ErrorKind::InvalidData | ErrorKind::UnexpectedEof, .. } => {
                Self::Damaged(error)
            }
            _ => Self::Foreign(error),
        }
    }
}

impl Checkpoint {
    /// The checkpoint folder of a folder of results: its name with `.checkpoint` appended.
    pub fn folder_of(results: &Path) -> PathBuf {
        let mut name = results.file_name().unwrap_or_default().to_owned();
        name.push(".checkpoint");
        results.with_file_name(name)
    }

    /// The checkpoint that a run of `study` has left in a folder; `None` if there is no such folder, or nothing in it
    /// from which a run can continue.
    ///
    /// # Errors
    ///
    /// [`Error::File`] where it cannot be read; [`Error::PlanFormat`] and [`Error::Table`] where it holds no plan of
    /// this release, or a piece is of another release, follows another plan, or belongs to another text of the study. A
    /// piece that is damaged or missing is no error ([`Checkpoint::lost`]).
    pub fn find(folder: &Path, study: &Study) -> Result<Option<Self>> {
        let entries = match fs::read_dir(folder) {
            Ok(entries) => entries,
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(Error::file(folder, FileAction::Read, &error)),
        };
        let mut pieces = Vec::new();
        for entry in entries {
            let entry = entry.map_err(|error| Error::file(folder, FileAction::Read, &error))?;
            pieces.extend(bodies_of(&entry.file_name().to_string_lossy()));
        }
        // A checkpoint that was stopped before it had a plan, or while it was being removed.
        if pieces.is_empty() && !folder.join(PLAN).exists() || folder.join(REMOVED).exists() {
            return Ok(None);
        }
        let plan = PlanDocument::read(&folder.join(PLAN))?;
        pieces.sort_by_key(|bodies: &Range<usize>| bodies.start);
        let folder = folder.to_owned();
        let mut found = Self::of(folder, plan, Pace::Unknown);
        Ok(found.check(pieces, study)?.then_some(found))
    }

    /// A checkpoint without pieces.
    fn of(folder: PathBuf, plan: PlanDocument, pace: Pace) -> Self {
        let (pieces, lost) = (Vec::new(), Vec::new());
        Self { folder, plan, pieces, lost, pace, most: MOST_BODIES, final_states: FinalStates::Pieces }
    }

    /// Takes up pieces that are as they were written, and notes which are not, and the speed of the last one; returns
    /// false if their states went to a table that is lost.
    fn check(&mut self, pieces: Vec<Range<usize>>, study: &Study) -> Result<bool> {
        let mut next = 0;
        for bodies in pieces {
            let path = self.piece(&bodies);
            if bodies.start < next || bodies.end > self.body_count() {
                let reason = "expected bodies of the study, behind those of the piece before".to_owned();
                return Err(Error::Table { path, reason });
            }
            if bodies.start > next {
                let reason = format!("{}: no piece has them", self.folder.display());
                self.lost.push(LostPiece { bodies: next..bodies.start, reason });
            }
            next = bodies.end;
            match self.check_piece(&bodies, study) {
                Ok(false) => return Ok(false),
                Ok(true) => self.pieces.push(bodies),
                Err(Fault::Damaged(error)) => self.lost.push(LostPiece { bodies, reason: error.to_string() }),
                Err(Fault::Foreign(error)) => return Err(error),
            }
        }
        if let Some(last) = self.pieces.last() {
            let report: Value = serde_json::from_str(&read_text(&self.piece(last).join(REPORT))?).unwrap_or_default();
            self.pace = Pace::measured(last.len(), &report["wall_time"]);
        }
        Ok(true)
    }

    /// Compares a piece with what was written; returns false if its states went to a table that is lost.
    fn check_piece(&self, bodies: &Range<usize>, study: &Study) -> std::result::Result<bool, Fault> {
        let path = self.piece(bodies);
        let foreign =
            |reason: &str| Err(Fault::Foreign(Error::Table { path: path.clone(), reason: reason.to_owned() }));
        if let Some(error) = PartFile::other_release(&path) {
            return Err(Fault::Foreign(error));
        }
        let part = PartFile::read(&path).map_err(Fault::of)?;
        if (part.first_body, part.bodies) != (bodies.start, bodies.len()) {
            return foreign("expected the bodies that its name says");
        }
        if part.entry(STUDY_TEXT) != Some(study.text()) {
            return foreign("it was begun with another text of the study");
        }
        if part.tables().0 != study.output().final_state {
            return Ok(false);
        }
        check_files(&part, &path).map_err(Fault::of)?;
        if read_text(&path.join(PLAN)).map_err(Fault::of)? != self.plan.text() {
            return foreign("its plan is not that of the checkpoint");
        }
        Ok(true)
    }

    /// The pieces that were found damaged, and the bodies that no piece has although later ones are there: they are
    /// computed again.
    pub fn lost(&self) -> &[LostPiece] {
        &self.lost
    }

    /// The bodies of a study from which the plan of all is made ([`Study::part`]): the first 2^20 if there are more and
    /// all are drawn alike, so that not all need to be in memory together. If each is a row of a table, all bodies.
    pub fn planned_bodies(study: &Study) -> Range<usize> {
        let all = study.bodies().count;
        let cells = study.design().map_or(1, |design| design.cells());
        let is_sample = study.bodies().table.is_none() && cells.saturating_mul(LEAST_OF_CELL) <= MOST_PLANNED;
        0..if is_sample { all.min(MOST_PLANNED) } else { all }
    }

    /// Begins the checkpoint of a run of `plan`, made from all bodies or from [`Checkpoint::planned_bodies`]. It
    /// creates the folder and removes what a finished run has left in it.
    ///
    /// # Errors
    ///
    /// [`Error::File`].
    pub fn begin(folder: &Path, plan: &Plan<'_>) -> Result<Self> {
        if folder.join(REMOVED).exists() {
            Self::remove(folder);
        }
        fs::create_dir_all(folder).map_err(|error| Error::file(folder, FileAction::Create, &error))?;
        let path = folder.join(PLAN);
        write_plan(plan, &path).inspect_err(|_| Self::remove(folder))?;
        let bodies = plan.scene().ensemble().len() as f64;
        let pace = plan
            .explain()
            .seconds()
            .filter(|seconds| *seconds > 0.0)
            .map_or(Pace::Unknown, |s| Pace::Expected(bodies / s));
        let plan = PlanDocument::read(&path)?;
        Ok(Self::of(folder.to_owned(), plan, pace))
    }

    /// Makes final states go directly to their table in `results`, the folder for [`Checkpoint::finish`], instead of to
    /// the pieces first: each row is written once instead of twice. The run then cannot continue once a piece has ended
    /// early or this value is dropped. `plan` is that of [`Checkpoint::begin`]. If `study` asks for snapshots, whose
    /// rows come in another order, nothing changes; if it asks for no states at all, pieces are smaller.
    ///
    /// # Errors
    ///
    /// [`Error::File`].
    pub fn write_through(&mut self, study: &Study, plan: &Plan<'_>, results: &mut OutputFolder) -> Result<()> {
        let (output, scene) = (study.output(), plan.scene());
        if output.snapshots || !self.pieces.is_empty() {
            return Ok(());
        }
        self.most = MOST_WITHOUT_STATES;
        if output.final_state {
            let cells = study.design().map(|design| design.cells());
            let layout = Layout::of_output(output, scene, cells);
            let (of, bodies) = (("final", output.format), 0..self.body_count());
            let table = TableFile::begin(results, of, bodies, &layout, Times::One(scene.end()))?;
            self.final_states = FinalStates::Table(table);
        }
        Ok(())
    }

    /// Notes that the run replaces what is in the folder `results`, so that it still does when it is continued
    /// ([`Checkpoint::replaces`]).
    ///
    /// # Errors
    ///
    /// [`Error::File`].
    pub fn note_replaced(&self, results: &Path) -> Result<()> {
        write_whole(&self.folder.join(REPLACES), report_mark(results).as_bytes())
    }

    /// Whether the run that has left a checkpoint in `folder` was to replace what is in the folder `results`: not if
    /// another run has put its results there since.
    pub fn replaces(folder: &Path, results: &Path) -> bool {
        let is_whole = folder.join(PLAN).exists() && !folder.join(REMOVED).exists();
        is_whole && fs::read_to_string(folder.join(REPLACES)).is_ok_and(|noted| noted == report_mark(results))
    }

    /// Notes the time between two checkpoints that was asked for, so that the run keeps it when it is continued
    /// ([`Checkpoint::interval`]). It replaces an earlier one.
    ///
    /// # Errors
    ///
    /// [`Error::File`].
    pub fn note_interval(&self, every: Duration) -> Result<()> {
        write_whole(&self.folder.join(INTERVAL), format!("{:?}\n", every.as_secs_f64()).as_bytes())
    }

    /// The time between two checkpoints that the run which has left a checkpoint in `folder` was asked for; `None` if
    /// nobody has asked, or there is no checkpoint.
    pub fn interval(folder: &Path) -> Option<Duration> {
        let is_whole = folder.join(PLAN).exists() && !folder.join(REMOVED).exists();
        let noted = is_whole.then(|| fs::read_to_string(folder.join(INTERVAL)).ok()).flatten()?;
        let seconds = noted.trim_end().parse::<f64>().ok().filter(|seconds| *seconds > 0.0)?;
        Duration::try_from_secs_f64(seconds).ok()
    }

    /// The report in the folder `results`, if a finished run of this text of `study` has left it there: with the bodies, arithmetic and
    /// skipping of its plan, and all files that it names.
    pub fn finished(results: &Path, study: &Study, may_skip: bool) -> Option<Value> {
        let report: Value = serde_json::from_str(&read_text(&results.join(REPORT)).ok()?).ok()?;
        let plan = PlanDocument::read(&results.join(PLAN)).ok()?;
        let is_there = |name: &Value| name.as_str().is_some_and(|name| results.join(name).is_file());
        let is_of_text = report["study"]["sum"] == StudyReport::of(study).sum;
        if !(is_of_text && report["files"].as_array()?.iter().all(is_there)) {
            return None;
        }
        // Files that the text names may have changed.
        let planned = Self::planned_bodies(study);
        let study = if planned.is_empty() { study.clone() } else { study.clone().part(planned) };
        plan.is_for(&study.scene().ok()?.skipping(may_skip)).then_some(report)
    }

    /// Whether a run can continue from the finished pieces.
    pub fn is_kept(&self) -> bool {
        matches!(self.final_states, FinalStates::Pieces) && !self.pieces.is_empty()
    }

    /// The plan that all bodies follow.
    pub fn plan(&self) -> &PlanDocument {
        &self.plan
    }

    /// Number of bodies in finished pieces.
    pub fn bodies_done(&self) -> usize {
        self.pieces.iter().map(Range::len).sum()
    }

    /// Number of all bodies.
    pub fn body_count(&self) -> usize {
        self.plan.body_count()
    }

    fn piece(&self, bodies: &Range<usize>) -> PathBuf {
        self.folder.join(format!("{PIECE}{}-{}", bodies.start, bodies.end - 1))
    }

    /// The first bodies that are in no piece, up to the next piece.
    fn first_gap(&self) -> Range<usize> {
        let mut start = 0;
        for piece in &self.pieces {
            if piece.start > start {
                return start..piece.start;
            }
            start = piece.end;
        }
        start..self.body_count()
    }

    /// The bodies of the next piece, which take about `every` and at most half of the available memory.
    fn next_bodies(&self, study: &Study, every: Duration) -> Range<usize> {
        let (gap, all) = (self.first_gap(), self.body_count());
        let size = Blocks::of(all).size();
        let wanted = match self.pace {
            Pace::Unknown => (all / ONE_IN).max(LEAST_BODIES),
            Pace::Expected(rate) => (rate * FIRST * every.as_secs_f64()) as usize,
            Pace::Measured(rate) => (rate * every.as_secs_f64()) as usize,
        };
        let room = memory::available().map_or(usize::MAX, |bytes| bytes as usize / (2 * study.bytes_of_body()));
        let growth = self.pieces.last().map_or(usize::MAX, |last| last.len().saturating_mul(GROWTH));
        let blocks = (wanted.min(growth).min(room).min(self.most) / size).max(1);
        gap.start..gap.start.saturating_add(blocks * size).min(gap.end)
    }

    /// Computes the rest of `study` on `engine` in pieces that take about `every`; damaged pieces are removed first. `begun`
    /// is called before each piece with its bodies and with its traces in the file system until it is finished. If `begun`
    /// breaks, nothing is lost; if `observer` breaks, the current piece is lost.
    ///
    /// # Errors
    ///
    /// As [`crate::run::run_to_folder`] and [`Plan::repeated`]; finished pieces are kept, unless states are written
    /// through: then the run must start again, and [`Error::Table`] says so. [`Error::Interrupted`] where either
    /// breaks.
    pub fn advance(
        &mut self,
        engine: &dyn Backend,
        study: &Study,
        every: Duration,
        begun: &mut PieceObserver<'_>,
        observer: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<()> {
        self.check_final_states()?;
        for LostPiece { bodies, .. } in std::mem::take(&mut self.lost) {
            let damaged = self.piece(&bodies);
            let removed = fs::remove_dir_all(&damaged).or_else(|_| fs::remove_file(&damaged));
            if let Err(error) = removed.or_else(|error| match error.kind() {
                ErrorKind::NotFound => Ok(()),
                _ => Err(error),
            }) {
                return Err(Error::file(&damaged, FileAction::Remove, &error));
            }
        }
        let (first, mut done) = (self.bodies_done(), 0_u64);
        while self.bodies_done() < self.body_count() {
            let since = Instant::now();
            let bodies = self.next_bodies(study, every);
            let folder = OutputFolder::create(&self.piece(&bodies), false)?;
            if begun(self, bodies.clone(), folder.traces()).is_break() {
                return Err(Error::Interrupted { steps: 0 });
            }
            let study = study.clone().part(bodies.clone());
            let scene = study.scene()?.skipping(self.plan.may_skip());
            let plan = Plan::repeated(&scene, engine, &self.plan)?;
            // Estimates the total from the pieces so far.
            let left = (self.body_count() - first) as f64 / (self.bodies_done() + bodies.len() - first) as f64;
            let mut of_piece = 0;
            let mut of_all = |progress: Progress| {
                of_piece = progress.total;
                let total = ((done + progress.total) as f64 * left) as u64;
                observer(Progress { done: done + progress.done, total })
            };
            let final_states = match &mut self.final_states {
                FinalStates::Table(table) => Some(table),
                FinalStates::Pieces | FinalStates::Lost => None,
            };
            let (part_of, of) = (PartOf { document: &self.plan, final_states }, (Some(&study), study.output()));
            let report = run_files(engine, &plan, of, folder, Some(part_of), since, &mut of_all);
            if report.is_err() && matches!(self.final_states, FinalStates::Table(_)) {
                self.final_states = FinalStates::Lost;
            }
            let report = report?;
            done += of_piece;
            self.pace = Pace::measured(bodies.len(), &serde_json::to_value(report.wall_time).unwrap_or_default());
            let place = self.pieces.partition_point(|piece| piece.start < bodies.start);
            self.pieces.insert(place, bodies);
        }
        Ok(())
    }

    /// Merges all pieces into `folder`, as [`crate::run::merge`] does with parts, and removes them.
    ///
    /// # Errors
    ///
    /// As [`crate::run::merge`]; the pieces are then kept. [`Error::Table`] where states that were written through are
    /// lost.
    pub fn finish(
        self,
        folder: OutputFolder,
        observer: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<MergedReport> {
        self.check_final_states()?;
        let name = |bodies: &Range<usize>| format!("bodies {} to {}", bodies.start, bodies.end - 1);
        let folders: Vec<_> = self.pieces.iter().map(|bodies| (name(bodies), self.piece(bodies))).collect();
        let final_states = match self.final_states {
            FinalStates::Table(table) => Some(table),
            FinalStates::Pieces | FinalStates::Lost => None,
        };
        let report = merge_folders(&self.folder, &folders, folder, final_states, observer)?;
        Self::remove(&self.folder);
        Ok(report)
    }

    fn check_final_states(&self) -> Result<()> {
        match self.final_states {
            FinalStates::Lost => {
                let reason = "a piece ended early, whose final states are in part in the table of all: begin anew";
                Err(Error::Table { path: self.folder.clone(), reason: reason.to_owned() })
            }
            FinalStates::Pieces | FinalStates::Table(_) => Ok(()),
        }
    }

    /// Removes what runs have left in a folder, and the folder if nothing else is in it. Entries that cannot be removed
    /// stay.
    pub fn remove(folder: &Path) {
        // What is begun here later may replace no results unless it says so itself.
        let _ = fs::remove_file(folder.join(REPLACES));
        let _ = fs::remove_file(folder.join(INTERVAL));
        // If the process is killed meanwhile, the remaining pieces belong to no plan.
        let _ = fs::rename(folder.join(PLAN), folder.join(REMOVED));
        for begins_with in [PIECE, PLAN, REPLACES, INTERVAL] {
            for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
                let name = entry.file_name().to_string_lossy().into_owned();
                if name.strip_prefix('.').unwrap_or(&name).starts_with(begins_with) {
                    let _ = fs::remove_dir_all(entry.path()).or_else(|_| fs::remove_file(entry.path()));
                }
            }
        }
        let _ = fs::remove_dir(folder);
    }
}

/// Size and sum of the report in a folder of results; empty if there is none.
fn report_mark(results: &Path) -> String {
    file_entry(results, REPORT).map_or(String::new(), |entry| format!("{} {:08x}", entry.bytes, entry.checksum))
}

/// The bodies of a piece, by the name of its folder.
fn bodies_of(name: &str) -> Option<Range<usize>> {
    let (first, last) = name.strip_prefix(PIECE)?.split_once('-')?;
    let (first, last) = (first.parse::<usize>().ok()?, last.parse::<usize>().ok()?);
    (format!("{PIECE}{first}-{last}") == name && first <= last).then(|| first..last + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_are_named_by_their_bodies() {
        assert_eq!(bodies_of("bodies-0-4095"), Some(0..4096));
        for wrong in ["bodies-4-3", "bodies-04-5", "bodies-4", ".bodies-0-1.polhode-lock", "plan.json", "bodies-0-1x"] {
            assert_eq!(bodies_of(wrong), None, "{wrong}");
        }
        assert_eq!(Checkpoint::folder_of(Path::new("a/study.out")), Path::new("a/study.out.checkpoint"));
    }

    #[test]
    fn only_the_results_that_a_run_was_to_replace_are_replaced() {
        let desk = tempfile::tempdir().expect("a folder");
        let (place, results) = (desk.path().join("out.checkpoint"), desk.path().join("out"));
        let is_replaced = || Checkpoint::replaces(&place, &results);
        [&place, &results].iter().for_each(|folder| fs::create_dir(folder).expect("made"));
        fs::write(results.join(REPORT), "former").expect("written");
        fs::write(place.join(PLAN), "{}").expect("written");
        assert!(!is_replaced(), "no run has noted it");
        fs::write(place.join(REPLACES), report_mark(&results)).expect("written");
        assert!(is_replaced());
        fs::write(results.join(REPORT), "another").expect("written");
        assert!(!is_replaced(), "results of another run");
        fs::write(results.join(REPORT), "former").expect("written");
        Checkpoint::remove(&place);
        assert!(!place.exists(), "nothing is left");
    }
}
