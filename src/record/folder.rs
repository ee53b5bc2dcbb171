//! A folder whose files appear complete or not at all.

use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};

use crate::error::{Error, FileAction, Result};

/// The file that appears last, when a run is complete.
pub const REPORT: &str = "report.json";
/// The file that repeats a run.
pub const PLAN: &str = "plan.json";

/// Stems of the tables that a run may write.
const TABLES: [&str; 4] = ["final", "snapshots", "statistics", "events"];
/// Endings of tables.
const ENDINGS: [&str; 3] = ["csv", "npz", "parquet"];

/// A folder for the files of one run.
///
/// Files are written under temporary names, and renamed when all are complete, the report last. Dropped before that, the
/// folder removes them again, and itself where it made it.
#[derive(Debug)]
pub struct OutputFolder {
    path: PathBuf,
    made: bool,
    /// Names of files begun, in order.
    names: Vec<String>,
}

impl OutputFolder {
    /// Makes the folder, or takes an empty one; with `replace`, also one that holds files, of which those of a former
    /// run give way once this one is complete.
    ///
    /// # Errors
    ///
    /// [`Error::File`] where the folder cannot be made or written to; [`Error::FolderNotEmpty`].
    pub fn create(path: &Path, replace: bool) -> Result<Self> {
        let failed = |error: &std::io::Error| Error::file(path, FileAction::Create, error);
        let made = match fs::read_dir(path) {
            Ok(mut entries) => {
                if !replace && entries.next().is_some() {
                    return Err(Error::FolderNotEmpty { path: path.to_owned() });
                }
                false
            }
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                fs::create_dir_all(path).map_err(|error| failed(&error))?;
                true
            }
            Err(error) => return Err(failed(&error)),
        };
        let folder = Self { path: path.to_owned(), made, names: Vec::new() };
        // A folder that cannot be written to is found out now rather than after hours of work.
        let probe = folder.temporary("probe");
        File::create(&probe).and_then(|_| fs::remove_file(&probe)).map_err(|error| failed(&error))?;
        Ok(folder)
    }

    /// Whether the folder was not there before.
    pub fn is_new(&self) -> bool {
        self.made
    }

    /// The folder's path as it was given.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Names of the files begun so far.
    pub(super) fn names(&self) -> &[String] {
        &self.names
    }

    fn temporary(&self, name: &str) -> PathBuf {
        self.path.join(format!(".{name}.{}.partial", std::process::id()))
    }

    /// Begins the file `name` under its temporary name.
    pub(super) fn begin(&mut self, name: &str) -> Result<OutputFile> {
        let target = self.path.join(name);
        let file =
            File::create(self.temporary(name)).map_err(|error| Error::file(&target, FileAction::Create, &error))?;
        self.names.push(name.to_owned());
        Ok(OutputFile { file, target, position: 0 })
    }

    /// Gives all files their names. Files of a former run that this one did not write are removed, so that none is
    /// taken for a part of this run.
    pub(super) fn commit(mut self) -> Result<()> {
        let former = TABLES.iter().flat_map(|stem| ENDINGS.map(|ending| format!("{stem}.{ending}")));
        for name in former.chain([PLAN.to_owned(), REPORT.to_owned()]) {
            let path = self.path.join(&name);
            // The report goes first and comes last, so that a folder with a report is always complete.
            if (name == REPORT || !self.names.contains(&name)) && path.exists() {
                fs::remove_file(&path).map_err(|error| Error::file(&path, FileAction::Write, &error))?;
            }
        }
        let names = std::mem::take(&mut self.names);
        for (index, name) in names.iter().enumerate() {
            let target = self.path.join(name);
            if let Err(error) = fs::rename(self.temporary(name), &target) {
                self.names = names[index..].to_vec();
                return Err(Error::file(&target, FileAction::Write, &error));
            }
        }
        self.made = false;
        Ok(())
    }
}

impl Drop for OutputFolder {
    fn drop(&mut self) {
        // Nothing more can be done about a file that cannot be removed; its name says that it is partial.
        for name in &self.names {
            let _ = fs::remove_file(self.temporary(name));
        }
        if self.made {
            let _ = fs::remove_dir(&self.path);
        }
    }
}

/// A file under its temporary name; errors call it by its final one.
#[derive(Debug)]
pub(super) struct OutputFile {
    file: File,
    target: PathBuf,
    position: u64,
}

impl OutputFile {
    /// Appends bytes.
    pub(super) fn write(&mut self, bytes: &[u8]) -> Result<()> {
        self.file.write_all(bytes).map_err(|error| Error::file(&self.target, FileAction::Write, &error))?;
        self.position += bytes.len() as u64;
        Ok(())
    }

    /// Writes bytes at an offset.
    pub(super) fn write_at(&mut self, offset: u64, bytes: &[u8]) -> Result<()> {
        use std::io::{Seek, SeekFrom};
        if offset != self.position {
            self.file
                .seek(SeekFrom::Start(offset))
                .map_err(|error| Error::file(&self.target, FileAction::Write, &error))?;
            self.position = offset;
        }
        self.write(bytes)
    }
}
