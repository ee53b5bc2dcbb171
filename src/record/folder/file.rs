//! Files of a result: written piece by piece or as a whole, with sizes and checksums.

use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::thread::{self, JoinHandle};

use super::super::part_file::FileEntry;
use super::names::{PARTIAL, random};
use crate::error::{Error, FileAction, Result};

/// A file of a result being written; errors use its final name.
#[derive(Debug)]
pub(crate) struct OutputFile {
    file: File,
    target: PathBuf,
    position: u64,
    /// Bytes since the last flush to the disk.
    waiting: u64,
    /// The thread that waits for the flush.
    syncing: Option<JoinHandle<io::Result<()>>>,
}

/// This many bytes are flushed to the disk while others are formatted: systems start by themselves only after some gigabytes, or half a
/// minute, and a run would wait for all of them at its end.
const AT_ONCE: u64 = 1 << 24;

/// For libraries that encode files.
#[cfg(feature = "parquet")]
impl Write for OutputFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = Write::write(&mut self.file, bytes)?;
        self.written(count)?;
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl OutputFile {
    /// Begins a file that does not exist and will be called `target`.
    pub(super) fn create(path: &Path, target: PathBuf) -> Result<Self> {
        let file = File::create_new(path).map_err(|error| Error::file(&target, FileAction::Write, &error))?;
        Ok(Self { file, target, position: 0, waiting: 0, syncing: None })
    }

    /// Its final name.
    #[cfg(feature = "parquet")]
    pub(crate) fn path(&self) -> &Path {
        &self.target
    }

    fn failed(&self, error: &io::Error) -> Error {
        Error::file(&self.target, FileAction::Write, error)
    }

    /// Counts bytes that were written, and flushes from time to time.
    fn written(&mut self, count: usize) -> io::Result<()> {
        self.position += count as u64;
        self.waiting += count as u64;
        if self.waiting < AT_ONCE || self.syncing.as_ref().is_some_and(|thread| !thread.is_finished()) {
            return Ok(());
        }
        self.synced()?;
        self.waiting = 0;
        let file = self.file.try_clone()?;
        // Without a thread the bytes are flushed at the end.
        self.syncing = thread::Builder::new().spawn(move || file.sync_data()).ok();
        Ok(())
    }

    /// Waits for the thread that flushes. Its error is reported only once.
    fn synced(&mut self) -> io::Result<()> {
        let joined = self.syncing.take().map(JoinHandle::join);
        joined.map_or(Ok(()), |done| done.unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
    }

    /// Appends bytes.
    pub(crate) fn write(&mut self, bytes: &[u8]) -> Result<()> {
        let written = self.file.write_all(bytes).and_then(|()| self.written(bytes.len()));
        written.map_err(|error| self.failed(&error))
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

    /// Waits until everything is on the disk: errors of the system are known by then at the latest.
    pub(crate) fn finish(mut self) -> Result<()> {
        let synced = self.synced().and_then(|()| self.file.sync_all());
        synced.map_err(|error| self.failed(&error))
    }
}

/// Writes a file that appears as a whole and replaces any file with its name; a link is replaced, not followed.
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
