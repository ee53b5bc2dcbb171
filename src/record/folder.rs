//! A folder whose files appear together, or not at all.
//!
//! A run writes into a folder of its own beside the target, `.NAME.polhode-RANDOM.partial`, which gets the target's name when
//! every file in it is complete and on the disk. A former result is renamed to `.NAME.polhode-RANDOM.former` before that and
//! removed after it, so that the target is at any time one result as a whole, or none. Meanwhile the run holds a lock,
//! `.NAME.polhode-lock`; whatever of these names lies there when another run has taken the lock, a killed one has left.
//!
//! A folder that cannot get another name (the current one, the place where a file system is mounted, one in a folder that
//! cannot be written to) is filled in place: the same names without `NAME` lie in it. The complete result is first renamed to
//! `NAME.polhode-RANDOM.kept` there, which nothing removes; then a former report is removed, and the new one comes last. The lock of
//! the current folder is the one beside it all the same, so that runs from inside and from outside exclude each other.

use std::collections::hash_map::RandomState;
use std::fs::{self, File};
use std::hash::{BuildHasher, Hasher};
use std::io::{self, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

use super::lock::{self, Lock, Refused};
use super::shard::{BLOCKS, FileEntry, PART};
use crate::error::{Error, FileAction, Result};

/// The file that appears last, when a run is complete.
pub const REPORT: &str = "report.json";
/// The file that repeats a run.
pub const PLAN: &str = "plan.json";

/// Stems of the tables that a run may write.
const TABLES: [&str; 9] =
    ["final", "snapshots", "statistics", "failed", "events", "survival", "histograms", "initial", "cells"];
/// Endings of tables.
const TABLE_ENDINGS: [&str; 3] = ["csv", "npz", "parquet"];
/// Stems of the pictures that are drawn of a run.
const PICTURES: [&str; 7] = ["run", "final", "statistics", "means", "histograms", "survival", "map"];
/// What stands before the number of a body in the stem of its pictures.
const PICTURE_OF_BODY: &str = "run-body-";
/// Endings of pictures.
const PICTURE_ENDINGS: [&str; 2] = ["svg", "png"];

/// The ending of the folder that a run writes to.
const PARTIAL: &str = "partial";
/// The ending of the folder of a former result while it is replaced.
const FORMER: &str = "former";
/// The ending of a complete result that could not get its name.
const KEPT: &str = "kept";

/// Whether a file of this name is a run's, or a picture of one, and gives way with it.
fn is_result(name: &str) -> bool {
    let Some((stem, ending)) = name.rsplit_once('.') else { return false };
    let body = stem.strip_prefix(PICTURE_OF_BODY).unwrap_or_default();
    let of_body = !body.is_empty() && body.bytes().all(|digit| digit.is_ascii_digit());
    [PLAN, REPORT, PART, BLOCKS].contains(&name)
        || TABLES.contains(&stem) && TABLE_ENDINGS.contains(&ending)
        || (PICTURES.contains(&stem) || of_body) && PICTURE_ENDINGS.contains(&ending)
}

/// Names and values.
pub(crate) type Metadata = Vec<(String, String)>;

/// A folder for the files of one run, which appear together when all are complete.
///
/// Dropped before that, it leaves nothing. Only one run at a time has a folder.
#[derive(Debug)]
pub struct OutputFolder {
    /// As it was given: messages call it so.
    path: PathBuf,
    /// The same with links resolved.
    target: PathBuf,
    /// Whether a former result gives way.
    replace: bool,
    /// Whether the target is filled instead of replaced by another folder.
    in_place: bool,
    /// What the names of lock and temporary folders begin with.
    prefix: PathBuf,
    traces: Traces,
    leftovers: Vec<PathBuf>,
    /// Names of files begun, in order.
    names: Vec<String>,
    metadata: Metadata,
    /// Dropped last: until then nobody else touches any of these names.
    _lock: Lock,
}

/// What a run under way has in the file system. To remove it is for a process that ends without dropping its
/// [`OutputFolder`], as in a signal's handler.
#[derive(Clone, Debug)]
pub struct Traces {
    /// What becomes of the folder: whoever comes first decides.
    fate: Arc<AtomicU8>,
    staging: PathBuf,
    lock: PathBuf,
    /// Folders that were made to hold the target, inner ones first.
    parents: Vec<PathBuf>,
}

/// Nothing is decided yet.
const OPEN: u8 = 0;
/// The files are given their place.
const PLACED: u8 = 1;
/// The run is given up.
const GIVEN_UP: u8 = 2;

impl Traces {
    /// Keeps the run from giving its files their place, from whatever thread; says whether that was in time. Where it was not, the
    /// result is there, or will be at once.
    pub fn give_up(&self) -> bool {
        self.decide(GIVEN_UP)
    }

    /// Whether the run was given up.
    fn is_given_up(&self) -> bool {
        self.fate.load(Ordering::SeqCst) == GIVEN_UP
    }

    fn decide(&self, fate: u8) -> bool {
        let decided = self.fate.compare_exchange(OPEN, fate, Ordering::SeqCst, Ordering::SeqCst);
        decided.is_ok() || decided == Err(fate)
    }

    /// Removes all of it; what cannot be removed stays, for the next run to find.
    pub fn remove(&self) {
        let _ = fs::remove_dir_all(&self.staging);
        lock::remove(&self.lock);
        remove_folders(&self.parents);
    }
}

/// Removes those that are empty.
fn remove_folders(folders: &[PathBuf]) {
    for folder in folders {
        let _ = fs::remove_dir(folder);
    }
}

impl OutputFolder {
    /// Takes a folder that does not exist or is empty; with `replace`, also one that holds files, of which those of a former
    /// run, pictures included, give way once this one is complete.
    ///
    /// What runs that were killed have left here is removed ([`OutputFolder::leftovers`]); a former result that one of them had
    /// moved aside is put back first.
    ///
    /// # Errors
    ///
    /// [`Error::File`] where the folder cannot be made or written to; [`Error::FolderNotEmpty`]; [`Error::FolderInUse`] where
    /// another run is writing there.
    pub fn create(path: &Path, replace: bool) -> Result<Self> {
        let failed = |error: io::Error| Error::file(path, FileAction::Create, &error);
        let (target, parents) = match fs::canonicalize(path) {
            Ok(target) => (target, Vec::new()),
            Err(error) if error.kind() == ErrorKind::NotFound => absent_target(path).map_err(failed)?,
            Err(error) => return Err(failed(error)),
        };
        let refused = |refused| match refused {
            Refused::Held(holder) => Error::FolderInUse { path: path.to_owned(), holder },
            Refused::Failed(error) => failed(error),
        };
        let is_root = target.parent().is_none() || is_mounted(&target);
        let mut in_place = is_root || is_current(&target);
        let mut lock_path = with_suffix(&prefix(&target, is_root), "lock");
        let mut lock = Lock::take(&lock_path);
        if !is_root
            && target.is_dir()
            && let Err(Refused::Failed(error)) = &lock
            && [ErrorKind::PermissionDenied, ErrorKind::ReadOnlyFilesystem].contains(&error.kind())
        {
            in_place = true;
            lock_path = with_suffix(&prefix(&target, in_place), "lock");
            lock = Lock::take(&lock_path);
        }
        let prefix = prefix(&target, in_place);
        let lock = lock.map_err(refused).inspect_err(|_| remove_folders(&parents))?;
        let staging = with_suffix(&prefix, &format!("{}.{PARTIAL}", random()));
        let traces = Traces { fate: Arc::default(), staging, lock: lock_path, parents };
        let (path, names, metadata) = (path.to_owned(), Vec::new(), Metadata::new());
        let mut folder = Self {
            path,
            target,
            replace,
            in_place,
            prefix,
            traces,
            leftovers: Vec::new(),
            names,
            metadata,
            _lock: lock,
        };
        folder.leftovers = folder.clear_leftovers().map_err(failed_at(&folder.path))?;
        folder.begin_staging()?;
        Ok(folder)
    }

    /// The folder's path as it was given.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The folder that the run writes to until it is complete; what is free on its disk is there for the results.
    pub fn staging(&self) -> &Path {
        &self.traces.staging
    }

    /// What killed runs had left of this folder, and is removed.
    pub fn leftovers(&self) -> &[PathBuf] {
        &self.leftovers
    }

    /// What to remove where the process ends before this is dropped.
    pub fn traces(&self) -> &Traces {
        &self.traces
    }

    /// Names of the files begun so far.
    pub(crate) fn names(&self) -> &[String] {
        &self.names
    }

    /// Makes the folder that the run writes to: one that cannot be made is found out before hours of work.
    fn begin_staging(&self) -> Result<()> {
        let failed = failed_at(&self.path);
        let staging = &self.traces.staging;
        match fs::read_dir(&self.target) {
            Ok(mut entries) => {
                let is_own = |entry: &fs::DirEntry| entry.path() == self.traces.lock;
                if !self.replace && entries.any(|entry| !entry.is_ok_and(|entry| is_own(&entry))) {
                    return Err(Error::FolderNotEmpty { path: self.path.clone() });
                }
                self.refuse_folders_in_the_way().map_err(&failed)?;
                fs::create_dir(staging).map_err(&failed)?;
                // Whoever could read the former result can read this one.
                let permissions = fs::metadata(&self.target).map(|found| found.permissions());
                permissions.and_then(|permissions| fs::set_permissions(staging, permissions)).map_err(failed)
            }
            Err(error) if error.kind() == ErrorKind::NotFound => fs::create_dir(staging).map_err(failed),
            Err(error) => Err(failed(error)),
        }
    }

    /// A folder with the name of one of a result's files is not ours to remove.
    fn refuse_folders_in_the_way(&self) -> io::Result<()> {
        for entry in fs::read_dir(&self.target)? {
            let entry = entry?;
            let name = entry.file_name().to_string_lossy().into_owned();
            if entry.file_type()?.is_dir() && is_result(&name) {
                return Err(io::Error::other(format!("the folder {name} in it has the name of a result's file")));
            }
        }
        Ok(())
    }

    /// Removes what killed runs have left beside the target and in it, all of which lies still: this run has the lock.
    fn clear_leftovers(&self) -> io::Result<Vec<PathBuf>> {
        let mut found = self.clear_leftovers_of(&self.prefix)?;
        let inner = prefix(&self.target, true);
        if inner != self.prefix && self.target.is_dir() {
            found.extend(self.clear_leftovers_of(&inner)?);
        }
        found.sort();
        Ok(found)
    }

    /// The same of names with one prefix.
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
                // Killed between two renames: the target was away.
                FORMER if is_random && fs::symlink_metadata(&self.target).is_err() => fs::rename(&path, &self.target)?,
                FORMER if is_random => self.dissolve(&path),
                _ => continue,
            }
            found.push(path);
        }
        Ok(found)
    }

    /// What files that have metadata say of the run that they are of. Of files begun before, nothing changes.
    pub(crate) fn set_metadata(&mut self, metadata: Metadata) {
        self.metadata = metadata;
    }

    #[cfg(feature = "parquet")]
    pub(crate) fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    /// Begins a file.
    pub(crate) fn begin(&mut self, name: &str) -> Result<OutputFile> {
        if self.traces.is_given_up() {
            return Err(Error::Interrupted { steps: 0 });
        }
        let target = self.path.join(name);
        let file = File::create_new(self.traces.staging.join(name))
            .map_err(|error| Error::file(&target, FileAction::Write, &error))?;
        self.names.push(name.to_owned());
        Ok(OutputFile { file, target, position: 0 })
    }

    /// Writes a whole file.
    pub(crate) fn write(&mut self, name: &str, bytes: &[u8]) -> Result<()> {
        let mut file = self.begin(name)?;
        file.write(bytes)?;
        file.finish()
    }

    /// Sizes and checksums of the files so far, all of which are finished.
    pub(crate) fn entries(&self) -> Result<Vec<FileEntry>> {
        let entry = |name: &String| file_entry(&self.traces.staging, name);
        self.names.iter().map(entry).collect()
    }

    /// Gives the files, which are all finished, their place.
    ///
    /// Where that fails, they stay under another name, which the error says: they may be hours of work.
    pub(crate) fn commit(self) -> Result<()> {
        if !self.traces.decide(PLACED) {
            return Err(Error::Interrupted { steps: 0 });
        }
        let (staging, kept) = (&self.traces.staging, self.kept());
        let placed = sync_folder(staging).and_then(|()| if self.in_place { self.fill() } else { self.swap() });
        placed.map_err(|error| {
            // Where files were moved one by one, it has that name already.
            let reason = match kept.is_dir() || fs::rename(staging, &kept).is_ok() {
                true => format!("{error}; the results are in {}", kept.display()),
                false => error.to_string(),
            };
            Error::File { path: self.path.clone(), action: FileAction::Write, kind: error.kind(), reason }
        })
    }

    /// The name of a complete result that is not in its place.
    fn kept(&self) -> PathBuf {
        let stem = self.traces.staging.file_stem();
        let number = stem.and_then(|stem| stem.to_str()?.rsplit_once('-')).map_or("", |(_, number)| number);
        let name = self.target.file_name().unwrap_or_default().to_string_lossy();
        self.prefix.with_file_name(format!("{name}.polhode-{number}.{KEPT}"))
    }

    /// Gives the folder the target's name, and removes what had it.
    fn swap(&self) -> io::Result<()> {
        let staging = &self.traces.staging;
        // An empty folder gives way by itself, except on some systems.
        let Err(error) = fs::rename(staging, &self.target) else { return sync_parent(&self.target) };
        let is_folder = fs::symlink_metadata(&self.target).is_ok_and(|found| found.is_dir());
        if !is_folder || !(self.replace || is_empty(&self.target)) {
            return Err(error);
        }
        let former = staging.with_extension(FORMER);
        if fs::rename(&self.target, &former).is_err() {
            return self.fill();
        }
        if let Err(error) = fs::rename(staging, &self.target) {
            fs::rename(&former, &self.target)?;
            return Err(error);
        }
        sync_parent(&self.target)?;
        self.dissolve(&former);
        Ok(())
    }

    /// Removes the result in a folder that was moved aside, and moves back what was not part of it. What can be neither
    /// removed nor moved stays there.
    fn dissolve(&self, former: &Path) {
        for entry in fs::read_dir(former).into_iter().flatten().flatten() {
            let back = self.target.join(entry.file_name());
            if is_replaceable(&entry) {
                let _ = fs::remove_file(entry.path());
            } else if fs::symlink_metadata(&back).is_err() {
                let _ = fs::rename(entry.path(), back);
            }
        }
        let _ = fs::remove_dir(former);
    }

    /// Moves the files into the target, of which a former result is removed. The report goes first and comes last, so that a
    /// folder with a report is always complete. A process that ends on the way leaves what it has not moved under a name that
    /// nothing removes, as the former result may be gone by then.
    fn fill(&self) -> io::Result<()> {
        let kept = self.kept();
        fs::rename(&self.traces.staging, &kept)?;
        sync_parent(&kept)?;
        let missing_is_fine = |done: io::Result<()>| match done {
            Err(error) if error.kind() != ErrorKind::NotFound => Err(error),
            _ => Ok(()),
        };
        missing_is_fine(fs::remove_file(self.target.join(REPORT)))?;
        sync_folder(&self.target)?;
        for entry in fs::read_dir(&self.target)? {
            let entry = entry?;
            if is_replaceable(&entry) {
                missing_is_fine(fs::remove_file(entry.path()))?;
            }
        }
        let (report, others): (Vec<_>, Vec<_>) = self.names.iter().partition(|name| *name == REPORT);
        for names in [others, report] {
            names.iter().try_for_each(|name| fs::rename(kept.join(name), self.target.join(name)))?;
            sync_folder(&self.target)?;
        }
        // Nothing is left in it.
        let _ = fs::remove_dir(&kept);
        Ok(())
    }
}

impl Drop for OutputFolder {
    fn drop(&mut self) {
        self.traces.remove();
    }
}

/// The path of a folder that does not exist, links resolved, and the folders that were made to hold it, inner ones first.
fn absent_target(path: &Path) -> io::Result<(PathBuf, Vec<PathBuf>)> {
    if fs::symlink_metadata(path).is_ok() {
        return Err(io::Error::new(ErrorKind::AlreadyExists, "it is a symbolic link that leads nowhere"));
    }
    let name = path.file_name().ok_or(ErrorKind::InvalidInput)?;
    let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let made: Vec<PathBuf> = parent
        .ancestors()
        .take_while(|folder| !folder.as_os_str().is_empty() && !folder.exists())
        .map(Path::to_owned)
        .collect();
    fs::create_dir_all(parent)?;
    let made = made.into_iter().map(fs::canonicalize).collect::<io::Result<Vec<_>>>()?;
    // A result on the disk is lost with a folder above it that is not.
    made.iter().try_for_each(|folder| sync_parent(folder))?;
    Ok((fs::canonicalize(parent)?.join(name), made))
}

/// What a run that has not finished has left of a folder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Residue {
    /// Its process has the lock.
    Running,
    /// Its process is gone.
    Killed,
}

/// What a run that has not finished has left of `target`, which need not exist.
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

/// What the names of lock and temporary folders of a target begin with.
fn prefix(target: &Path, in_place: bool) -> PathBuf {
    let name = target.file_name().unwrap_or_default();
    if in_place {
        return target.join(".polhode");
    }
    let mut prefix = std::ffi::OsString::from(".");
    prefix.push(name);
    prefix.push(".polhode");
    target.with_file_name(prefix)
}

fn with_suffix(prefix: &Path, suffix: &str) -> PathBuf {
    let mut path = prefix.as_os_str().to_owned();
    path.push("-");
    path.push(suffix);
    path.into()
}

const RANDOM_DIGITS: usize = 16;

/// A number that no other run has, in any container: the seed of the standard library's hash maps.
fn random() -> String {
    format!("{:016x}", RandomState::new().build_hasher().finish())
}

/// Whether a folder should not get another name, as a shell whose current folder was replaced stands in a removed one.
fn is_current(target: &Path) -> bool {
    std::env::current_dir().and_then(fs::canonicalize).is_ok_and(|current| current == target)
}

#[cfg(unix)]
fn is_mounted(target: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let device = |path: &Path| fs::metadata(path).map(|found| found.dev()).ok();
    if device(target) != target.parent().and_then(device) && target.exists() {
        return true;
    }
    // A part of a file system may be mounted elsewhere in it; Linux lists the places, with these characters as octal numbers.
    let mut place = target.to_string_lossy().into_owned();
    for (letter, octal) in [("\\", "\\134"), (" ", "\\040"), ("\t", "\\011"), ("\n", "\\012")] {
        place = place.replace(letter, octal);
    }
    let mounts = fs::read_to_string("/proc/self/mountinfo").unwrap_or_default();
    mounts.lines().any(|line| line.split(' ').nth(4) == Some(place.as_str()))
}

#[cfg(not(unix))]
fn is_mounted(_: &Path) -> bool {
    false
}

/// Size and checksum of a file as it is.
pub(crate) fn file_entry(folder: &Path, name: &str) -> Result<FileEntry> {
    let path = folder.join(name);
    let mut checksum = crc32fast::Hasher::new();
    let mut read = || -> io::Result<u64> {
        let (mut file, mut buffer, mut bytes) = (File::open(&path)?, vec![0; 1 << 20], 0);
        loop {
            match file.read(&mut buffer)? {
                0 => return Ok(bytes),
                count => {
                    checksum.update(&buffer[..count]);
                    bytes += count as u64;
                }
            }
        }
    };
    let bytes = read().map_err(|error| Error::file(&path, FileAction::Read, &error))?;
    Ok(FileEntry { name: name.to_owned(), bytes, checksum: checksum.finalize() })
}

/// Whether an entry of a folder is a file of a result; a link is removed rather than followed.
fn is_replaceable(entry: &fs::DirEntry) -> bool {
    let is_folder = entry.file_type().is_ok_and(|kind| kind.is_dir());
    !is_folder && is_result(&entry.file_name().to_string_lossy())
}

fn is_empty(folder: &Path) -> bool {
    fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_none())
}

fn failed_at(path: &Path) -> impl Fn(io::Error) -> Error {
    move |error| Error::file(path, FileAction::Create, &error)
}

/// Brings the names in a folder to the disk.
fn sync_folder(folder: &Path) -> io::Result<()> {
    // Elsewhere folders cannot be opened as files.
    if cfg!(unix) { File::open(folder)?.sync_all() } else { Ok(()) }
}

fn sync_parent(path: &Path) -> io::Result<()> {
    path.parent().map_or(Ok(()), sync_folder)
}

/// Writes a file that appears as a whole and replaces any file of its name; a link is replaced, not followed.
pub(crate) fn write_whole(path: &Path, bytes: &[u8]) -> Result<()> {
    let mut name = std::ffi::OsString::from(".");
    name.push(path.file_name().unwrap_or_default());
    name.push(format!(".{}.{PARTIAL}", random()));
    let temporary = path.with_file_name(name);
    let written = File::create_new(&temporary)
        .and_then(|mut file| file.write_all(bytes).and_then(|()| file.sync_all()))
        .and_then(|()| fs::rename(&temporary, path));
    written.map_err(|error| {
        let _ = fs::remove_file(&temporary);
        Error::file(path, FileAction::Write, &error)
    })
}

/// A file of a result under way; errors call it by its final name.
#[derive(Debug)]
pub(crate) struct OutputFile {
    file: File,
    target: PathBuf,
    position: u64,
}

/// What libraries that encode files write into.
#[cfg(feature = "parquet")]
impl Write for OutputFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = Write::write(&mut self.file, bytes)?;
        self.position += count as u64;
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl OutputFile {
    /// Its final name.
    #[cfg(feature = "parquet")]
    pub(crate) fn path(&self) -> &Path {
        &self.target
    }

    fn failed(&self, error: &io::Error) -> Error {
        Error::file(&self.target, FileAction::Write, error)
    }

    /// Appends bytes.
    pub(crate) fn write(&mut self, bytes: &[u8]) -> Result<()> {
        self.file.write_all(bytes).map_err(|error| self.failed(&error))?;
        self.position += bytes.len() as u64;
        Ok(())
    }

    /// Writes bytes at an offset.
    pub(crate) fn write_at(&mut self, offset: u64, bytes: &[u8]) -> Result<()> {
        use std::io::{Seek, SeekFrom};
        if offset != self.position {
            self.file.seek(SeekFrom::Start(offset)).map_err(|error| self.failed(&error))?;
            self.position = offset;
        }
        self.write(bytes)
    }

    /// Waits until all is on the disk: what the system could not write is known by then, at the latest.
    pub(crate) fn finish(self) -> Result<()> {
        self.file.sync_all().map_err(|error| self.failed(&error))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_survive_a_process_that_ends_while_files_are_moved_into_place() {
        let desk = tempfile::tempdir().expect("a folder");
        let target = desk.path().join("out");
        fs::create_dir_all(target.join("snapshots.csv")).expect("made");
        fs::write(target.join(REPORT), "former").expect("written");
        let mut folder = OutputFolder::create(&desk.path().join("new"), true).expect("a folder");
        for name in ["final.csv", "snapshots.csv", REPORT] {
            folder.write(name, b"new").expect("written");
        }
        folder.target = target.clone();
        // The folder in the way ends it after the first file, as a signal might; its handler removes what is left of the run.
        folder.fill().expect_err("a folder is in the way");
        folder.traces.remove();
        let kept = folder.kept();
        let read = |folder: &Path, name: &str| fs::read(folder.join(name)).expect("a file");
        assert_eq!(read(&target, "final.csv"), b"new");
        assert_eq!((read(&kept, "snapshots.csv"), read(&kept, REPORT)), (b"new".to_vec(), b"new".to_vec()));
        assert!(!target.join(REPORT).exists(), "no report beside files of two results");
    }
}
