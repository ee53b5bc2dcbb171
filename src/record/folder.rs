//! A folder whose files appear together or not at all.
//!
//! A run writes into its own folder beside the target, `.NAME.polhode-RANDOM.partial`, which is renamed to the target when
//! every file in it is complete and on the disk. A former result is renamed to `.NAME.polhode-RANDOM.former` before that and
//! removed after it, so that the target is at any time one complete result, or none. Meanwhile the run holds a lock,
//! `.NAME.polhode-lock`; anything with these names that exists when another run has taken the lock is left over from a killed run.
//!
//! A folder that cannot be renamed (the current one, a mount point, one in a folder that cannot be written to) is filled in place: the same
//! names without `NAME` are used inside it. The complete result is first renamed to `NAME.polhode-RANDOM.kept` there, which nothing
//! removes; then a former report is removed, and the new one comes last. The lock of the current folder is nevertheless the one beside it,
//! so that runs from inside and from outside exclude each other.

use std::fs::{self, File};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use super::lock::{Lock, Refused};
use super::part_file::FileEntry;
use crate::error::{Error, FileAction, Result};

mod file;
mod leftovers;
mod names;
mod traces;

pub(crate) use file::{OutputFile, file_entry, write_whole};
pub(crate) use leftovers::{Residue, residue};
pub use names::{PLAN, REPORT};
pub use traces::Traces;

use names::{FORMER, KEPT, PARTIAL, is_result, prefix, random, with_suffix};
use traces::{PLACED, remove_folders};

/// Names and values.
pub(crate) type Metadata = Vec<(String, String)>;

/// The metadata of a folder, as they are when a file is finished: more may become known until then.
#[derive(Clone, Debug, Default)]
pub(crate) struct SharedMetadata(Arc<Mutex<Metadata>>);

impl SharedMetadata {
    #[cfg(feature = "parquet")]
    pub(crate) fn entries(&self) -> Metadata {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// A folder for the files of one run, which appear together when all are complete.
///
/// If dropped before that, it leaves nothing behind. Only one run at a time holds a folder.
#[derive(Debug)]
pub struct OutputFolder {
    /// The path as given, which messages use.
    path: PathBuf,
    /// The same with links resolved.
    target: PathBuf,
    /// Whether a former result is replaced.
    replace: bool,
    /// Whether the target is filled instead of replaced by another folder.
    in_place: bool,
    /// The prefix of the names of lock and temporary folders.
    prefix: PathBuf,
    traces: Traces,
    leftovers: Vec<PathBuf>,
    /// Names of files begun, in order.
    names: Vec<String>,
    metadata: SharedMetadata,
    /// Dropped last: until then no other run touches any of these names.
    _lock: Lock,
}

impl OutputFolder {
    /// Takes a folder that does not exist or is empty; with `replace`, also one that holds files. Those of a former run, pictures included,
    /// are replaced once this one is complete.
    ///
    /// Leftovers of killed runs are removed ([`OutputFolder::leftovers`]); a former result that one of them had moved aside is put back
    /// first.
    ///
    /// # Errors
    ///
    /// [`Error::File`] if the folder cannot be made or written to; [`Error::FolderNotEmpty`]; [`Error::FolderInUse`] if another run is
    /// writing there.
    pub fn create(path: &Path, replace: bool) -> Result<Self> {
        let failed = |error: io::Error| Error::file(path, FileAction::Create, &error);
        let (target, parents) = match fs::canonicalize(path) {
            Ok(target) => (target, Vec::new()),
            Err(error) if error.kind() == ErrorKind::NotFound => absent_target(path).map_err(failed)?,
            Err(error) => return Err(failed(error)),
        };
        let refused = |refused| match refused {
            Refused::InUse(holder) => Error::FolderInUse { path: path.to_owned(), holder },
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
        let (path, names, metadata) = (path.to_owned(), Vec::new(), SharedMetadata::default());
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

    /// The folder that the run writes to until it is complete; free space for the results is that of its disk.
    pub fn staging(&self) -> &Path {
        &self.traces.staging
    }

    /// The leftovers of killed runs in this folder, which were removed.
    pub fn leftovers(&self) -> &[PathBuf] {
        &self.leftovers
    }

    /// What must be removed if the process ends before this is dropped.
    pub fn traces(&self) -> &Traces {
        &self.traces
    }

    /// Names of the files begun so far.
    pub(crate) fn names(&self) -> &[String] {
        &self.names
    }

    /// Makes the folder that the run writes to, so that a failure shows before hours of work.
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

    /// Refuses a folder with the name of one of the result's files: it is not ours to remove.
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

    /// Adds metadata about the run for files that carry them. Files finished before do not change.
    pub(crate) fn add_metadata(&self, entries: Metadata) {
        self.metadata.0.lock().unwrap_or_else(PoisonError::into_inner).extend(entries);
    }

    #[cfg(feature = "parquet")]
    pub(crate) fn metadata(&self) -> SharedMetadata {
        self.metadata.clone()
    }

    /// Begins a file.
    pub(crate) fn begin(&mut self, name: &str) -> Result<OutputFile> {
        if self.traces.is_given_up() {
            return Err(Error::Interrupted { steps: 0 });
        }
        let file = OutputFile::create(&self.traces.staging.join(name), self.path.join(name))?;
        self.names.push(name.to_owned());
        Ok(file)
    }

    /// Writes a whole file.
    pub(crate) fn write(&mut self, name: &str, bytes: &[u8]) -> Result<()> {
        let mut file = self.begin(name)?;
        file.write(bytes)?;
        file.finish()
    }

    /// Sizes and checksums of the files so far, which must be finished.
    pub(crate) fn entries(&self) -> Result<Vec<FileEntry>> {
        let entry = |name: &String| file_entry(&self.traces.staging, name);
        self.names.iter().map(entry).collect()
    }

    /// Moves the files, which must all be finished, to their place.
    ///
    /// If that fails, they are kept under another name or, if nothing can be renamed, where they are; the error says so. They may be
    /// hours of work.
    pub(crate) fn commit(self) -> Result<()> {
        if !self.traces.decide(PLACED) {
            return Err(Error::Interrupted { steps: 0 });
        }
        let (staging, kept) = (&self.traces.staging, self.kept());
        let placed = sync_folder(staging).and_then(|()| if self.in_place { self.fill() } else { self.swap() });
        placed.map_err(|error| {
            // If files were moved one by one, it has that name already.
            let reason = if kept.is_dir() || fs::rename(staging, &kept).is_ok() {
                format!("{error}; the results are in {}", kept.display())
            } else if staging.is_dir() {
                self.traces.leave();
                format!("{error}; until another run into this folder the results are in {}", staging.display())
            } else {
                error.to_string()
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

    /// Renames the folder to the target, and removes the former target.
    fn swap(&self) -> io::Result<()> {
        let staging = &self.traces.staging;
        // An empty folder is replaced by the rename itself, except on some systems.
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

    /// Moves the files into the target, from which a former result is removed. The report is removed first and written last, so that a
    /// folder with a report is always complete. A process that ends in between leaves what it has not moved under a name that
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
        // It is empty now.
        let _ = fs::remove_dir(&kept);
        Ok(())
    }
}

impl Drop for OutputFolder {
    fn drop(&mut self) {
        self.traces.remove();
    }
}

/// The path of a folder that does not exist, with links resolved, and the folders that were made to hold it, inner ones first.
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
    // A result on the disk is lost if a folder above it is not on the disk.
    made.iter().try_for_each(|folder| sync_parent(folder))?;
    Ok((fs::canonicalize(parent)?.join(name), made))
}

/// Whether a folder should not be renamed because it is the current one: a shell in it would be left in a removed folder.
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

/// Flushes the names in a folder to the disk.
fn sync_folder(folder: &Path) -> io::Result<()> {
    // Elsewhere folders cannot be opened as files.
    if cfg!(unix) { File::open(folder)?.sync_all() } else { Ok(()) }
}

fn sync_parent(path: &Path) -> io::Result<()> {
    path.parent().map_or(Ok(()), sync_folder)
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
        // The folder in the way ends it after the first file, as a signal might; its handler then removes the traces of the run.
        folder.fill().expect_err("a folder is in the way");
        folder.traces.remove();
        let kept = folder.kept();
        let read = |folder: &Path, name: &str| fs::read(folder.join(name)).expect("a file");
        assert_eq!(read(&target, "final.csv"), b"new");
        assert_eq!((read(&kept, "snapshots.csv"), read(&kept, REPORT)), (b"new".to_vec(), b"new".to_vec()));
        assert!(!target.join(REPORT).exists(), "no report beside files of two results");
    }
}
