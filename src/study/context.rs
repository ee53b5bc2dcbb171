//! Named references of a study's values while it is read: the axes of its sweep, and groups of correlated variables.

use std::cell::{Cell, OnceCell, RefCell};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::distribution::Correlated;
use super::sweep::Design;
use super::torque::StudyParameter;
use crate::error::Result;

/// A file and the names of columns in it.
type NamedColumns = (PathBuf, Vec<String>);

/// What is known while a file is read.
#[derive(Debug, Default)]
pub(super) struct Context {
    design: OnceCell<Arc<Design>>,
    correlated: OnceCell<BTreeMap<String, Arc<Correlated>>>,
    /// The elements of the orbit that the study states once, by their names in models.
    orbit: OnceCell<Vec<(String, StudyParameter)>>,
    /// The cell for which values are read, if they are read cell by cell.
    cell: Cell<Option<usize>>,
    orbit_used: Cell<bool>,
    /// The numbers of files that rows are drawn from, by file and names of columns: row after row.
    rows: RefCell<BTreeMap<NamedColumns, Arc<[f64]>>>,
    /// The names that were used.
    used: RefCell<BTreeSet<String>>,
}

impl Context {
    /// Sets the axes; only the first call has an effect.
    pub fn set_design(&self, design: Arc<Design>) {
        let _ = self.design.set(design);
    }

    /// Sets the groups of variables; only the first call has an effect.
    pub fn set_correlated(&self, groups: BTreeMap<String, Arc<Correlated>>) {
        let _ = self.correlated.set(groups);
    }

    pub fn design(&self) -> Option<&Design> {
        self.design.get().map(|design| &**design)
    }

    pub fn correlated(&self, name: &str) -> Option<&Arc<Correlated>> {
        self.correlated.get()?.get(name)
    }

    /// The names of all correlated variables, each prefixed by its group's.
    pub fn correlated_names(&self) -> Vec<String> {
        let groups = self.correlated.get().into_iter().flatten();
        groups.flat_map(|(name, group)| group.variables().map(move |variable| format!("{name}.{variable}"))).collect()
    }

    /// Sets the study's orbit; only the first call has an effect.
    pub fn set_orbit(&self, orbit: Vec<(String, StudyParameter)>) {
        let _ = self.orbit.set(orbit);
    }

    pub fn orbit(&self) -> Option<&[(String, StudyParameter)]> {
        self.orbit.get().map(Vec::as_slice)
    }

    pub fn cell(&self) -> Option<usize> {
        self.cell.get()
    }

    /// The result of `read` for one cell.
    pub fn for_cell<T>(&self, cell: usize, read: impl FnOnce() -> T) -> T {
        let before = self.cell.replace(Some(cell));
        let value = read();
        self.cell.set(before);
        value
    }

    /// The numbers of some columns of a file, by `read` only if no key before has named the same.
    pub fn rows(&self, file: &Path, columns: &[&str], read: impl FnOnce() -> Result<Arc<[f64]>>) -> Result<Arc<[f64]>> {
        let key = (file.to_owned(), columns.iter().map(|&name| name.to_owned()).collect());
        if let Some(rows) = self.rows.borrow().get(&key) {
            return Ok(rows.clone());
        }
        let rows = read()?;
        self.rows.borrow_mut().insert(key, rows.clone());
        Ok(rows)
    }

    pub fn note_use(&self, name: &str) {
        let mut used = self.used.borrow_mut();
        if !used.contains(name) {
            used.insert(name.to_owned());
        }
    }

    pub fn note_orbit_use(&self) {
        self.orbit_used.set(true);
    }

    pub fn is_orbit_used(&self) -> bool {
        self.orbit_used.get()
    }

    pub fn is_used(&self, name: &str) -> bool {
        self.used.borrow().contains(name)
    }
}
