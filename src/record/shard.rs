//! Parts of a study that separate processes run, each into a folder of its own in one folder, and what is known of them there.

use std::fmt;
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::column::{Layout, Named};
use super::failed::KnownTo;
use super::folder::{self, Metadata, PLAN, REPORT, Residue};
use super::{FailedBody, Statistics};
use crate::bodies::{Blocks, Status};
use crate::error::{Error, FileAction, Result};
use crate::kernel::observe::{Partial, Statistic};
use crate::study::text::read_text;
use crate::study::{Format, Output};

/// What says of a part whose it is.
pub(crate) const PART: &str = "part.json";

/// The statistics of each block of a part's bodies, a line an output.
pub(crate) const BLOCKS: &str = "blocks.jsonl";

/// The layout of both.
const FORMAT: u32 = 2;

/// Which part of how many, counted from 1: `3/64`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Shard {
    index: usize,
    count: usize,
}

impl Shard {
    /// Part `index` of `count`, where there is one: `index` from 1 to `count`.
    pub fn new(index: usize, count: usize) -> Option<Self> {
        (1..=count).contains(&index).then_some(Self { index, count })
    }

    /// Which part, from 1.
    pub fn index(self) -> usize {
        self.index
    }

    /// How many parts there are.
    pub fn count(self) -> usize {
        self.count
    }

    /// Its bodies of `body_count`; `None` where there are fewer [`Blocks`] than parts.
    pub fn bodies(self, body_count: usize) -> Option<Range<usize>> {
        let blocks = Blocks::of(body_count);
        (self.count <= blocks.count()).then(|| blocks.bodies_of_part(self.index - 1, self.count))
    }

    /// The folder of its results in the folder of all.
    pub fn folder(self, all: &Path) -> PathBuf {
        all.join(format!("{PREFIX}{}{OF}{}", self.index, self.count))
    }

    /// The file that says why its run failed.
    fn note(self, all: &Path) -> PathBuf {
        all.join(format!("{PREFIX}{}{OF}{}.{FAILED}", self.index, self.count))
    }

    /// Leaves word in the folder of all of why the run has failed, for [`status`]; where it cannot, it does not.
    pub fn leave_failure(self, all: &Path, reason: &str) {
        let _ = fs::write(self.note(all), format!("{reason}\n"));
    }

    /// Takes back what [`Shard::leave_failure`] has left.
    pub fn forget_failure(self, all: &Path) {
        let _ = fs::remove_file(self.note(all));
    }

    /// The part of a folder's or file's name, and what follows it.
    fn named(name: &str) -> Option<(Self, &str)> {
        let (index, rest) = name.strip_prefix(PREFIX)?.split_once(OF)?;
        let digits = rest.find(|letter: char| !letter.is_ascii_digit()).unwrap_or(rest.len());
        let shard = Self::new(index.parse().ok()?, rest[..digits].parse().ok()?)?;
        // Names are those that are written: without zeros before them.
        (shard.folder(Path::new("")).to_str()? == &name[..name.len() - (rest.len() - digits)])
            .then_some((shard, &rest[digits..]))
    }
}

const PREFIX: &str = "shard-";
const OF: &str = "-of-";
const FAILED: &str = "failed";

impl fmt::Display for Shard {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}/{}", self.index, self.count)
    }
}

impl FromStr for Shard {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        const EXPECTED: &str = "expected INDEX/COUNT, such as 3/64, with INDEX from 1 to COUNT";
        let (index, count) = text.split_once('/').ok_or(EXPECTED)?;
        let number = |text: &str| text.parse::<usize>().map_err(|_| EXPECTED);
        Self::new(number(index)?, number(count)?).ok_or(EXPECTED)
    }
}

/// What stands in [`PART`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PartFile {
    format: u32,
    polhode: String,
    pub index: usize,
    pub count: usize,
    pub first_body: usize,
    pub bodies: usize,
    /// Of all parts.
    pub body_count: usize,
    /// The columns of tables of states between `t` and `status`.
    columns: Vec<ColumnEntry>,
    /// What files that have metadata say of the run.
    pub metadata: Vec<(String, String)>,
    /// Output times, s.
    pub times: Vec<f64>,
    final_state: bool,
    snapshots: bool,
    output_format: String,
    statistics: Vec<String>,
    /// How many bodies of all parts may fail.
    pub allowed_failures: u64,
    pub failures: Vec<FailureEntry>,
    pub files: Vec<FileEntry>,
}

/// A column of a table of states.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ColumnEntry {
    name: String,
    unit: String,
    meaning: String,
}

/// A file of a part as it was written.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct FileEntry {
    pub name: String,
    pub bytes: u64,
    /// CRC-32, as ZIP archives have it.
    pub checksum: u32,
}

/// A body that has failed ([`FailedBody`]), counted as in the whole.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct FailureEntry {
    body: usize,
    reason: u8,
    time: f64,
    known_to_step: bool,
    last_good_time: f64,
    orientation: [f64; 4],
    angular_velocity_body: [f64; 3],
}

impl From<&FailedBody> for FailureEntry {
    fn from(failed: &FailedBody) -> Self {
        Self {
            body: failed.body,
            reason: failed.reason.number(),
            time: failed.time,
            known_to_step: failed.known_to == KnownTo::Step,
            last_good_time: failed.last_good_time,
            orientation: failed.orientation.to_array(),
            angular_velocity_body: failed.angular_velocity_body.to_array(),
        }
    }
}

impl From<&FailureEntry> for FailedBody {
    fn from(entry: &FailureEntry) -> Self {
        Self {
            body: entry.body,
            reason: Status::from_code(f64::from(entry.reason)),
            time: entry.time,
            known_to: if entry.known_to_step { KnownTo::Step } else { KnownTo::Output },
            last_good_time: entry.last_good_time,
            orientation: glam::DQuat::from_array(entry.orientation),
            angular_velocity_body: glam::DVec3::from_array(entry.angular_velocity_body),
        }
    }
}

/// The bodies of a part, and what is written of them.
pub(crate) struct PartContents<'a> {
    pub shard: Shard,
    pub bodies: Range<usize>,
    pub body_count: usize,
    pub columns: &'a [Named],
    pub metadata: Metadata,
    pub times: &'a [f64],
    pub output: &'a Output,
    pub statistics: &'a [Statistic],
    pub allowed_failures: u64,
    pub failures: &'a [FailedBody],
    pub files: Vec<FileEntry>,
}

impl PartFile {
    pub fn new(contents: PartContents<'_>) -> Self {
        let PartContents { shard, bodies, body_count, columns, times, output, statistics, .. } = contents;
        let column = |Named { name, unit, meaning }: Named| ColumnEntry { name, unit, meaning };
        Self {
            format: FORMAT,
            polhode: env!("CARGO_PKG_VERSION").to_owned(),
            index: shard.index,
            count: shard.count,
            first_body: bodies.start,
            bodies: bodies.len(),
            body_count,
            columns: columns.iter().cloned().map(column).collect(),
            metadata: contents.metadata,
            times: times.to_vec(),
            final_state: output.final_state,
            snapshots: output.snapshots,
            output_format: output.format.name().to_owned(),
            statistics: statistics.iter().map(|statistic| statistic.name().to_owned()).collect(),
            allowed_failures: contents.allowed_failures,
            failures: contents.failures.iter().map(FailureEntry::from).collect(),
            files: contents.files,
        }
    }

    pub fn to_json(&self) -> String {
        // Fixed keys, finite numbers and strings: there is nothing to fail on.
        serde_json::to_string(self).unwrap_or_default() + "\n"
    }

    /// Reads that of a part's folder.
    pub fn read(folder: &Path) -> Result<Self> {
        #[derive(Deserialize)]
        struct Head {
            format: u32,
            polhode: String,
        }
        let path = folder.join(PART);
        let text = read_text(&path)?;
        let wrong = |reason: String| Error::Table { path: path.clone(), reason };
        let release = env!("CARGO_PKG_VERSION");
        let cut = |error: serde_json::Error| wrong(format!("expected what `polhode run --shard` writes: {error}"));
        let head: Head = serde_json::from_str(&text).map_err(cut)?;
        if head.format != FORMAT || head.polhode != release {
            return Err(wrong(format!("it is of polhode {}, this is {release}: run the part again", head.polhode)));
        }
        serde_json::from_str(&text).map_err(cut)
    }

    /// The tables that were asked for: those of the end, and those of all output times.
    pub fn tables(&self) -> (bool, bool) {
        (self.final_state, self.snapshots)
    }

    /// Their format; `None` of one that this build does not write.
    pub fn output_format(&self) -> Option<Format> {
        Format::ALL.iter().copied().find(|format| format.name() == self.output_format)
    }

    /// The columns of tables of states between `t` and `status`.
    pub fn layout(&self) -> Layout {
        let column = |ColumnEntry { name, unit, meaning }: ColumnEntry| Named { name, unit, meaning };
        Layout::of_columns(self.columns.iter().cloned().map(column).collect())
    }

    /// The statistics that were asked for.
    pub fn statistics(&self) -> Vec<Statistic> {
        let named = |name: &String| Statistic::ALL.into_iter().find(|statistic| statistic.name() == name);
        self.statistics.iter().filter_map(named).collect()
    }

    /// What two parts of one run have in common but does not show in their plan; the first that differs, by name.
    pub fn difference(&self, other: &Self) -> Option<&'static str> {
        let same = [
            (self.body_count == other.body_count, "the number of bodies"),
            (self.times == other.times, "output times"),
            (self.tables() == other.tables() && self.output_format == other.output_format, "[output]"),
            (self.columns == other.columns, "output.columns"),
            (self.metadata == other.metadata, "the text of the study"),
            (self.statistics == other.statistics, "output.statistics"),
            (self.allowed_failures == other.allowed_failures, "failures.allow"),
        ];
        same.into_iter().find(|(same, _)| !same).map(|(_, name)| name)
    }
}

/// The statistics of a part's blocks at an output time: a line of [`BLOCKS`].
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct BlocksLine {
    pub time: f64,
    pub blocks: Vec<Vec<Partial<f64>>>,
}

impl BlocksLine {
    /// From a part whose first body has an index in the whole.
    pub fn new(time: f64, blocks: &[Vec<Partial<f64>>], first_body: usize) -> Self {
        let mut blocks = blocks.to_vec();
        for partial in blocks.iter_mut().flatten().filter(|partial| partial.count > 0) {
            partial.least.body += first_body as u32;
            partial.greatest.body += first_body as u32;
        }
        Self { time, blocks }
    }

    pub fn to_line(&self) -> String {
        serde_json::to_string(self).unwrap_or_default() + "\n"
    }
}

impl Statistics {
    /// The same with bodies counted as in the whole that they are a part of.
    pub(crate) fn counted_from(mut self, first_body: usize) -> Self {
        for summary in &mut self.summaries {
            summary.min_body = summary.min_body.map(|body| first_body + body);
            summary.max_body = summary.max_body.map(|body| first_body + body);
        }
        self
    }
}

/// What is known of one part.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ShardState {
    /// Its results are there.
    Complete {
        /// How many of its bodies have failed.
        failed_bodies: usize,
    },
    /// A process that still runs has begun it.
    Running,
    /// Its run has failed, and has said why.
    Failed(String),
    /// A process that has begun it was killed.
    Incomplete,
    /// Nothing is there.
    Missing,
}

impl ShardState {
    /// Whether it is to be run again: neither there nor under way.
    pub fn is_due(&self) -> bool {
        !matches!(self, ShardState::Complete { .. } | ShardState::Running)
    }
}

/// The parts in the folder of all, from 1 on.
///
/// # Errors
///
/// [`Error::File`] where the folder cannot be read; [`Error::Table`] where it has no parts, or parts of several cuts.
pub fn status(all: &Path) -> Result<Vec<ShardState>> {
    let failed = |error: std::io::Error| Error::file(all, FileAction::Read, &error);
    let wrong = |reason: String| Error::Table { path: all.to_owned(), reason };
    let mut counts: Vec<usize> = Vec::new();
    for entry in fs::read_dir(all).map_err(failed)? {
        let name = entry.map_err(failed)?.file_name().to_string_lossy().into_owned();
        // What a run under way or killed has left begins with a point.
        if let Some((shard, _)) = Shard::named(name.strip_prefix('.').unwrap_or(&name)) {
            counts.push(shard.count);
        }
    }
    counts.sort_unstable();
    counts.dedup();
    match counts[..] {
        [] => Err(wrong("expected a folder of parts, as `polhode run --shard` leaves them: there are none".to_owned())),
        [count] => (1..=count).map(|index| state(all, Shard { index, count })).collect(),
        _ => {
            let counts: Vec<String> = counts.iter().map(usize::to_string).collect();
            Err(wrong(format!("expected parts of one cut: there are parts of {}", counts.join(", of "))))
        }
    }
}

fn state(all: &Path, shard: Shard) -> Result<ShardState> {
    let folder = shard.folder(all);
    if folder.join(REPORT).is_file() {
        let failed_bodies = PartFile::read(&folder).map_or(0, |part| part.failures.len());
        return Ok(ShardState::Complete { failed_bodies });
    }
    let note = fs::read_to_string(shard.note(all)).ok().map(|note| note.trim().to_owned());
    Ok(match (folder::residue(&folder), note) {
        (Some(Residue::Running), _) => ShardState::Running,
        (_, Some(note)) => ShardState::Failed(note),
        (Some(Residue::Killed), None) => ShardState::Incomplete,
        (None, None) => ShardState::Missing,
    })
}

/// Whole numbers, ascending, as array launchers take them: `3,7-9`.
///
/// ```
/// use polhode::record::ranges;
///
/// assert_eq!(ranges(&[3, 7, 8, 9, 12]), "3,7-9,12");
/// ```
pub fn ranges(numbers: &[usize]) -> String {
    let parts = numbers.chunk_by(|a, b| a + 1 == *b).map(|part| match part {
        [first, .., last] => format!("{first}-{last}"),
        part => part.iter().map(usize::to_string).collect(),
    });
    parts.collect::<Vec<_>>().join(",")
}

/// Whether a part is there that follows this plan, so that it need not be run again.
pub fn is_complete(shard: Shard, all: &Path, plan: &str) -> bool {
    let folder = shard.folder(all);
    folder.join(REPORT).is_file()
        && PartFile::read(&folder).is_ok()
        && fs::read_to_string(folder.join(PLAN)).is_ok_and(|found| found == plan)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_are_named_and_read() {
        let shard: Shard = "3/64".parse().expect("a shard");
        assert_eq!((shard.index(), shard.count(), shard.to_string().as_str()), (3, 64, "3/64"));
        for wrong in ["", "3", "0/4", "5/4", "-1/4", "1/0", "a/4", "1/4/4", "1 /4"] {
            assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
        }
        let folder = shard.folder(Path::new("out"));
        assert_eq!(folder, Path::new("out/shard-3-of-64"));
        assert_eq!(Shard::named("shard-3-of-64"), Some((shard, "")));
        assert_eq!(Shard::named("shard-3-of-64.polhode-lock"), Some((shard, ".polhode-lock")));
        for wrong in ["shard-03-of-64", "shard-65-of-64", "shard-3-of-", "shard-3", "final.csv", "shard-+3-of-64"] {
            assert_eq!(Shard::named(wrong), None, "{wrong}");
        }
        assert_eq!(shard.bodies(64), Some(2..3));
        assert_eq!(shard.bodies(63), None);
    }

    #[test]
    fn lists_are_those_that_array_launchers_take() {
        for (numbers, text) in [(&[][..], ""), (&[5], "5"), (&[1, 2], "1-2"), (&[1, 3, 4, 6], "1,3-4,6")] {
            assert_eq!(ranges(numbers), text);
        }
    }

    #[test]
    fn a_folder_of_parts_is_told_from_others_and_each_part_by_what_has_become_of_it() {
        let desk = tempfile::tempdir().expect("a folder");
        let all = desk.path();
        assert!(matches!(status(all), Err(Error::Table { .. })));
        let of = |index| Shard::new(index, 5).expect("a shard");
        fs::create_dir(of(1).folder(all)).expect("made");
        fs::write(of(1).folder(all).join(REPORT), "{}").expect("written");
        of(2).leave_failure(all, "no space");
        fs::create_dir(all.join(".shard-3-of-5.polhode-0123456789abcdef.partial")).expect("made");
        let running = super::super::OutputFolder::create(&of(4).folder(all), false).expect("a folder");
        let states = [
            ShardState::Complete { failed_bodies: 0 },
            ShardState::Failed("no space".to_owned()),
            ShardState::Incomplete,
            ShardState::Running,
            ShardState::Missing,
        ];
        assert_eq!(status(all).expect("parts"), states);
        assert_eq!(states.each_ref().map(ShardState::is_due), [false, true, true, false, true]);
        drop(running);
        of(2).forget_failure(all);
        let now = status(all).expect("parts");
        assert_eq!((&now[1], &now[3]), (&ShardState::Missing, &ShardState::Missing));
        fs::create_dir(all.join("shard-1-of-7")).expect("made");
        assert!(status(all).is_err_and(|error| error.to_string().contains("of 5, of 7")));
    }
}
