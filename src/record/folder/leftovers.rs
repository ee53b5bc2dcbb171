//! Leftovers of killed runs.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::super::lock;
use super::OutputFolder;
use super::names::{FORMER, PARTIAL, RANDOM_DIGITS, prefix, with_suffix};

impl OutputFolder {
    /// Removes what killed runs left beside the target and in it; nothing of it is in use, as this run has the lock.
    pub(super) fn clear_leftovers(&self) -> io::Result<Vec<PathBuf>> {
        let mut found = self.clear_leftovers_of(&self.prefix)?;
        let inner = prefix(&self.target, true);
        if inner != self.prefix && self.target.is_dir() {
            found.extend(self.clear_leftovers_of(&inner)?);
        }
        found.sort();
        Ok(found)
    }

    /// The same for names with one prefix.
    fn clear_leftovers_of(&self, prefix: &Path) -> io::Result<Vec<PathBuf>> {
        let (Some(place), Some(prefix)) = (prefix.parent(), prefix.file_name()) else {
            return Ok(Vec::new());
        };
        let mut found = Vec::new();
        for entry in fs::read_dir(place)? {
            let path = entry?.path();
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let rest = name.strip_prefix(&*prefix.to_string_lossy()).and_then(|rest| rest.strip_prefix('-'));
            let Some((number, ending)) = rest.and_then(|rest| rest.split_once('.')) else { continue };
            let is_random = number.len() == RANDOM_DIGITS && number.bytes().all(|digit| digit.is_ascii_hexdigit());
            match ending {
                PARTIAL if is_random => fs::remove_dir_all(&path)?,
                // Killed between two renames, while the target was moved aside.
                FORMER if is_random && fs::symlink_metadata(&self.target).is_err() => fs::rename(&path, &self.target)?,
                FORMER if is_random => self.dissolve(&path),
                _ => continue,
            }
            found.push(path);
        }
        Ok(found)
    }
}

/// The trace of an unfinished run in a folder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Residue {
    /// Its process holds the lock.
    Running,
    /// Its process is gone.
    Killed,
}

/// The trace of an unfinished run for `target`, which need not exist.
pub(crate) fn residue(target: &Path) -> Option<Residue> {
    let prefix = prefix(target, false);
    if lock::is_held(&with_suffix(&prefix, "lock")) {
        return Some(Residue::Running);
    }
    let own = prefix.file_name()?.to_string_lossy().into_owned() + "-";
    let is_partial = |name: &str| name.strip_prefix(&own).is_some_and(|rest| rest.ends_with(PARTIAL));
    let mut names = fs::read_dir(target.parent()?).ok()?.flatten().map(|entry| entry.file_name());
    names.any(|name| is_partial(&name.to_string_lossy())).then_some(Residue::Killed)
}
