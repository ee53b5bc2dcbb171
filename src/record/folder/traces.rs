//! The files and folders of an unfinished run, to be removed by whichever thread ends it.

use std::fs;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

use super::super::lock;

/// The files and folders of an unfinished run. They are removed by a process that ends without dropping its
/// [`super::OutputFolder`], as in a signal handler.
#[derive(Clone, Debug)]
pub struct Traces {
    /// The fate of the folder, set once by whichever thread decides first.
    pub(super) fate: Arc<AtomicU8>,
    pub(super) staging: PathBuf,
    pub(super) lock: PathBuf,
    /// Folders that were made to hold the target, inner ones first.
    pub(super) parents: Vec<PathBuf>,
}

/// Not decided yet.
const OPEN: u8 = 0;
/// The files are moved to their place.
pub(super) const PLACED: u8 = 1;
/// The run is given up.
const GIVEN_UP: u8 = 2;
/// The files could not be placed, and stay where they are.
const LEFT: u8 = 3;

impl Traces {
    /// Prevents the run from moving its files to their place, from any thread; returns whether that was in time. If not, the
    /// result is there, or will be at once.
    pub fn give_up(&self) -> bool {
        self.decide(GIVEN_UP)
    }

    /// Whether the run was given up.
    pub(super) fn is_given_up(&self) -> bool {
        self.fate.load(Ordering::SeqCst) == GIVEN_UP
    }

    /// Decides the fate of the folder; returns whether it was undecided, or decided the same way before.
    pub(super) fn decide(&self, fate: u8) -> bool {
        let decided = self.fate.compare_exchange(OPEN, fate, Ordering::SeqCst, Ordering::SeqCst);
        decided.is_ok() || decided == Err(fate)
    }

    /// Keeps the files, whatever has been decided.
    pub(super) fn leave(&self) {
        self.fate.store(LEFT, Ordering::SeqCst);
    }

    /// Removes everything except files that are to stay; what cannot be removed is left for the next run to find.
    pub fn remove(&self) {
        if self.fate.load(Ordering::SeqCst) != LEFT {
            let _ = fs::remove_dir_all(&self.staging);
        }
        lock::remove(&self.lock);
        remove_folders(&self.parents);
    }
}

/// Removes those that are empty.
pub(super) fn remove_folders(folders: &[PathBuf]) {
    for folder in folders {
        let _ = fs::remove_dir(folder);
    }
}
