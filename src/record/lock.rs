//! A lock file: of several processes that take it one holds it, until it ends, however it ends.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Read, Write};
use std::path::Path;

use super::date;

/// The most bytes that are read of what a holder writes about itself.
const MOST_WORDS: u64 = 120;

/// A lock that this process holds. The system releases it when the process ends.
#[derive(Debug)]
pub(super) struct Lock {
    _file: File,
}

/// Why a lock could not be taken.
#[derive(Debug)]
pub(super) enum Refused {
    /// Another process holds it; it describes itself in this text.
    InUse(String),
    /// The file cannot be made or opened.
    Failed(io::Error),
}

impl Lock {
    /// Takes the lock at `path`, or fails at once.
    pub(super) fn take(path: &Path) -> Result<Self, Refused> {
        loop {
            let Some((mut file, made)) = open(path).map_err(Refused::Failed)? else { continue };
            match file.try_lock() {
                Ok(()) => {}
                // On a file system without locks the file itself is the lock, held by the process that made it.
                Err(TryLockError::Error(_)) if made => {}
                Err(_) => return Err(Refused::InUse(holder(&file))),
            }
            // A holder removes the file when it is done: the file opened here may be gone, and another in its place.
            if is_at(&file, path) {
                let words = format!("process {}, since {}", std::process::id(), date::now());
                // The lock works without this text; another process only cannot name the holder.
                let _ = file.set_len(0).and_then(|()| file.write_all(words.as_bytes()));
                return Ok(Self { _file: file });
            }
        }
    }
}

/// Whether another process holds the lock at `path`.
pub(super) fn is_held(path: &Path) -> bool {
    let opened = OpenOptions::new().read(true).write(true).open(path);
    // It is released at once; whoever left it behind removes it.
    opened.is_ok_and(|file| matches!(file.try_lock(), Err(TryLockError::WouldBlock)))
}

/// The file at `path`, and whether it was made here; `None` if it vanished in between. A link is not followed.
fn open(path: &Path) -> io::Result<Option<(File, bool)>> {
    let mut options = OpenOptions::new();
    options.read(true).write(true);
    match options.clone().create_new(true).open(path) {
        Ok(file) => return Ok(Some((file, true))),
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
        Err(error) => return Err(error),
    }
    let opened = fs::symlink_metadata(path).and_then(|found| match found.is_file() {
        true => options.open(path),
        false => Err(io::Error::other(format!("{} is not a regular file", path.display()))),
    });
    match opened {
        Ok(file) => Ok(Some((file, false))),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error),
    }
}

fn holder(file: &File) -> String {
    let mut words = String::new();
    match file.take(MOST_WORDS).read_to_string(&mut words) {
        Ok(_) if !words.is_empty() => words,
        // It has only just taken the lock, or locks prevent reading.
        _ => "which does not say its process".to_owned(),
    }
}

#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let place = |found: fs::Metadata| (found.dev(), found.ino());
    let (opened, there) = (file.metadata().map(place), fs::symlink_metadata(path).map(place));
    opened.is_ok_and(|opened| there.is_ok_and(|there| opened == there))
}

/// Elsewhere lock files stay where they are ([`remove`]).
#[cfg(not(unix))]
fn is_at(_: &File, _: &Path) -> bool {
    true
}

/// Removes the file of a lock that this process holds.
pub(super) fn remove(path: &Path) {
    // A file left behind is harmless: nobody has it locked. If it cannot be determined whether a file was replaced by another
    // after it was opened, it stays.
    if cfg!(unix) {
        let _ = fs::remove_file(path);
    }
}
