//! What a run under way has in the file system, for whichever thread ends it.

use std::fs;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

use super::super::lock;

/// What a run under way has in the file system. To remove it is for a process that ends without dropping its
/// [`super::OutputFolder`], as in a signal's handler.
#[derive(Clone, Debug)]
pub struct Traces {
    /// What becomes of the folder: whoever comes first decides.
    pub(super) fate: Arc<AtomicU8>,
    pub(super) staging: PathBuf,
    pub(super) lock: PathBuf,
    /// Folders that were made to hold the target, inner ones first.
    pub(super) parents: Vec<PathBuf>,
}

/// Nothing is decided yet.
const OPEN: u8 = 0;
/// The files are given their place.
pub(super) const PLACED: u8 = 1;
/// The run is given up.
const GIVEN_UP: u8 = 2;
/// The files have no place, and stay where they are.
const LEFT: u8 = 3;

impl Traces {
    /// Keeps the run from giving its files their place, from whatever thread; says whether that was in time. Where it was not, the
    /// result is there, or will be at once.
    pub fn give_up(&self) -> bool {
        self.decide(GIVEN_UP)
    }

    /// Whether the run was given up.
    pub(super) fn is_given_up(&self) -> bool {
        self.fate.load(Ordering::SeqCst) == GIVEN_UP
    }

    /// Decides what becomes of the folder; says whether that was open, or so decided before.
    pub(super) fn decide(&self, fate: u8) -> bool {
        let decided = self.fate.compare_exchange(OPEN, fate, Ordering::SeqCst, Ordering::SeqCst);
        decided.is_ok() || decided == Err(fate)
    }

    /// Keeps the files, whatever has been decided.
    pub(super) fn leave(&self) {
        self.fate.store(LEFT, Ordering::SeqCst);
    }

    /// Removes all of it, but for files that stay where they are; what cannot be removed stays, for the next run to find.
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
