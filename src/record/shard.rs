//! Parts of a study that separate processes run, each into its own folder within one folder, and their state there.

use std::fmt;
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use super::folder::{self, REPORT, Residue};
use super::part_file::PartFile;
use crate::bodies::Blocks;
use crate::error::{Error, FileAction, Result};
use crate::plan::PlanDocument;
use crate::study::Study;

/// Which part of how many, counted from 1: `3/64`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Shard {
    index: usize,
    count: usize,
}

impl Shard {
    /// Part `index` of `count`, if it exists: `index` from 1 to `count`.
    pub fn new(index: usize, count: usize) -> Option<Self> {
        (1..=count).contains(&index).then_some(Self { index, count })
    }

    /// Its bodies out of `body_count`; `None` if there are fewer [`Blocks`] than parts.
    pub fn bodies(self, body_count: usize) -> Option<Range<usize>> {
        let blocks = Blocks::of(body_count);
        (self.count <= blocks.count()).then(|| blocks.bodies_of_part(self.index - 1, self.count))
    }

    /// The folder of its results within the folder of all.
    pub fn folder(self, all: &Path) -> PathBuf {
        all.join(format!("{PREFIX}{}{OF}{}", self.index, self.count))
    }

    /// The file that says why its run failed.
    fn note(self, all: &Path) -> PathBuf {
        all.join(format!("{PREFIX}{}{OF}{}.{FAILED}", self.index, self.count))
    }

    /// Notes in the folder of all why the run failed, for [`status`]; ignores errors.
    pub fn leave_failure(self, all: &Path, reason: &str) {
        let _ = fs::write(self.note(all), format!("{reason}\n"));
    }

    /// Removes the note of [`Shard::leave_failure`].
    pub fn forget_failure(self, all: &Path) {
        let _ = fs::remove_file(self.note(all));
    }

    /// The part in the name of a folder or file, and what follows it.
    fn named(name: &str) -> Option<(Self, &str)> {
        let (index, rest) = name.strip_prefix(PREFIX)?.split_once(OF)?;
        let digits = rest.find(|letter: char| !letter.is_ascii_digit()).unwrap_or(rest.len());
        let shard = Self::new(index.parse().ok()?, rest[..digits].parse().ok()?)?;
        // Names must be as written: without leading zeros.
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

/// The state of one part.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ShardState {
    /// Its results are there.
    Complete {
        /// How many of its bodies have failed.
        failed_bodies: usize,
    },
    /// A process that still runs has begun it.
    Running,
    /// Its run has failed, with this reason.
    Failed(String),
    /// Its results are there, but they are those of another plan or study: what differs.
    Foreign(String),
    /// A process that had begun it was killed.
    Incomplete,
    /// Nothing is there.
    Missing,
}

impl ShardState {
    /// Whether it must be run again: neither complete nor under way.
    pub fn is_due(&self) -> bool {
        !matches!(self, ShardState::Complete { .. } | ShardState::Running)
    }
}

/// The states of the parts in the folder of all, from 1 on. A part whose files are not those that it wrote has failed; their sums are compared
/// where they are merged. A part is foreign if it does not follow `plan` or is of another text than `study`, and if it cannot be merged with
/// the part that was written last of those which do.
///
/// # Errors
///
/// [`Error::File`] if the folder cannot be read; [`Error::Table`] if it has no parts, or parts of several divisions.
pub fn status(all: &Path, plan: Option<&PlanDocument>, study: Option<&Study>) -> Result<Vec<ShardState>> {
    let mut found = states(all)?;
    let (count, mut parts) = (found.len(), Vec::new());
    for (index, state) in (1..).zip(&mut found).filter(|(_, state)| matches!(state, ShardState::Complete { .. })) {
        let folder = Shard { index, count }.folder(all);
        match PartFile::read(&folder).and_then(|part| part.with_files(&folder)) {
            Err(error) => *state = ShardState::Failed(error.to_string()),
            Ok(part) => match part.mismatch(plan, study) {
                Some(what) => *state = ShardState::Foreign(what.to_owned()),
                None => {
                    let written = fs::metadata(folder.join(REPORT)).and_then(|report| report.modified()).ok();
                    parts.push((written, index, part));
                }
            },
        }
    }
    if let Some((_, last, of_last)) = parts.iter().max_by_key(|(written, index, _)| (*written, *index)) {
        for (_, index, part) in &parts {
            if let Some(what) = part.difference(of_last) {
                let reason = format!("it does not belong to part {last}, which was written last: {what}");
                found[index - 1] = ShardState::Foreign(reason);
            }
        }
    }
    Ok(found)
}

/// The states of the parts, whatever their files hold.
pub(crate) fn states(all: &Path) -> Result<Vec<ShardState>> {
    let failed = |error: std::io::Error| Error::file(all, FileAction::Read, &error);
    let wrong = |reason: String| Error::Table { path: all.to_owned(), reason };
    let mut counts: Vec<usize> = Vec::new();
    for entry in fs::read_dir(all).map_err(failed)? {
        let name = entry.map_err(failed)?.file_name().to_string_lossy().into_owned();
        // The names of running or killed runs begin with a point.
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

/// Whether a part of `study` is complete that follows `plan`, so that it need not be run again.
pub fn is_complete(shard: Shard, all: &Path, plan: &PlanDocument, study: &Study) -> bool {
    let folder = shard.folder(all);
    folder.join(REPORT).is_file()
        && PartFile::read(&folder).is_ok_and(|part| part.mismatch(Some(plan), Some(study)).is_none())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_are_named_and_read() {
        let shard: Shard = "3/64".parse().expect("a shard");
        assert_eq!((shard.index, shard.count, shard.to_string().as_str()), (3, 64, "3/64"));
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
        assert!(matches!(status(all, None, None), Err(Error::Table { .. })));
        let of = |index| Shard::new(index, 5).expect("a shard");
        fs::create_dir(of(1).folder(all)).expect("made");
        fs::write(of(1).folder(all).join(REPORT), "{}").expect("written");
        of(2).leave_failure(all, "no space");
        fs::create_dir(all.join(".shard-3-of-5.polhode-0123456789abcdef.partial")).expect("made");
        let running = super::super::OutputFolder::create(&of(4).folder(all), false).expect("a folder");
        let expected = [
            ShardState::Complete { failed_bodies: 0 },
            ShardState::Failed("no space".to_owned()),
            ShardState::Incomplete,
            ShardState::Running,
            ShardState::Missing,
        ];
        assert_eq!(states(all).expect("parts"), expected);
        assert_eq!(expected.each_ref().map(ShardState::is_due), [false, true, true, false, true]);
        // Its report is there, but not what a part writes.
        assert!(
            matches!(&status(all, None, None).expect("parts")[0], ShardState::Failed(why) if why.contains("part.json"))
        );
        drop(running);
        of(2).forget_failure(all);
        let now = status(all, None, None).expect("parts");
        assert_eq!((&now[1], &now[3]), (&ShardState::Missing, &ShardState::Missing));
        fs::create_dir(all.join("shard-1-of-7")).expect("made");
        assert!(status(all, None, None).is_err_and(|error| error.to_string().contains("of 5, of 7")));
    }
}
