//! Tables of states that a run has left, read again row by row.

use std::fs::File;
use std::path::{Path, PathBuf};

use glam::{DQuat, DVec3};

use super::OutputState;
use super::column::{self, CELL, MOST_COLUMNS, ROTATION_COLUMNS};
use crate::bodies::{BodyState, Status};
use crate::error::{Error, FileAction, Result};

mod csv_table;
mod npz_table;

#[cfg(feature = "plot")]
pub(crate) use npz_table::{Values, columns};

use csv_table::CsvTable;
use npz_table::NpzTable;

/// One row of a table of states.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StateRow {
    /// Index of the body.
    pub body: usize,
    /// Time, s.
    pub time: f64,
    /// The state. What tables do not hold ([`BodyState::norm_error`]) is NaN.
    pub state: OutputState,
}

/// A table of states, `final` or `snapshots`, in any of the formats that runs write. Between two calls no file is open.
///
/// ```no_run
/// use std::path::Path;
///
/// use polhode::record::StateTable;
///
/// let mut table = StateTable::open(Path::new("tumbling/final.npz"))?;
/// for row in table.read(0, 10)? {
///     println!("{} {:?}", row.body, row.state.rotation.orientation);
/// }
/// # Ok::<(), polhode::Error>(())
/// ```
#[derive(Debug)]
pub struct StateTable {
    path: PathBuf,
    translates: bool,
    source: Source,
}

#[derive(Debug)]
enum Source {
    Csv(CsvTable),
    Npz(NpzTable),
}

impl StateTable {
    /// Opens a table by the ending of its name: `csv` or `npz`.
    ///
    /// # Errors
    ///
    /// [`Error::File`] where the file cannot be read; [`Error::Table`] where it holds no states.
    pub fn open(path: &Path) -> Result<Self> {
        let mut file = open(path)?;
        let source = match path.extension().and_then(|ending| ending.to_str()) {
            Some("csv") => Source::Csv(CsvTable::open(path, &mut file)?),
            Some("npz") => Source::Npz(NpzTable::open(path, &mut file)?),
            _ => return Err(wrong(path, "expected a file that ends in .csv or .npz")),
        };
        let names = match &source {
            Source::Csv(table) => table.names(),
            Source::Npz(table) => table.names(),
        };
        let is = |translates: bool| {
            let columns = ["body", "t"].into_iter().chain(column::names(translates)).chain([column::STATUS]);
            columns.eq(names.iter().map(String::as_str).filter(|name| *name != CELL))
        };
        let translates = is(true);
        if !translates && !is(false) {
            return Err(wrong(path, "expected the columns of states that a run writes"));
        }
        Ok(Self { path: path.to_owned(), translates, source })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether there are positions and velocities.
    pub fn translates(&self) -> bool {
        self.translates
    }

    /// Some rows, counted from 0; fewer where the table ends before. Rows of comma-separated values that lie before those of the last
    /// call are looked for from the start.
    ///
    /// # Errors
    ///
    /// [`Error::File`], [`Error::Table`].
    pub fn read(&mut self, first: u64, count: usize) -> Result<Vec<StateRow>> {
        let (path, mut file) = (&self.path, open(&self.path)?);
        let columns = column::names(self.translates).count();
        match &mut self.source {
            Source::Csv(table) => table.read(path, &mut file, (first, count), columns),
            Source::Npz(table) => table.read(path, &mut file, (first, count), columns),
        }
    }
}

fn open(path: &Path) -> Result<File> {
    File::open(path).map_err(|error| read_failed(path, &error))
}

fn read_failed(path: &Path, error: &std::io::Error) -> Error {
    Error::file(path, FileAction::Read, error)
}

fn wrong(path: &Path, reason: impl Into<String>) -> Error {
    Error::Table { path: path.to_owned(), reason: reason.into() }
}

/// The state of a row from its numbers, in the order of [`column::names`].
fn state_of(numbers: &[f64; MOST_COLUMNS], translates: bool, status: u8) -> OutputState {
    let [x, y, z, w, wx, wy, wz, lx, ly, lz, kinetic_energy, ..] = *numbers;
    let vector = |first: usize| DVec3::new(numbers[first], numbers[first + 1], numbers[first + 2]);
    let orientation = DQuat::from_xyzw(x, y, z, w);
    let status = match Status::from_code(f64::from(status)) {
        // Then the rotation is good as long as its numbers are.
        Status::CentreNotFinite if orientation.is_finite() => Status::Valid,
        status => status,
    };
    let rotation = BodyState {
        orientation,
        angular_velocity_body: DVec3::new(wx, wy, wz),
        angular_momentum_world: DVec3::new(lx, ly, lz),
        kinetic_energy,
        norm_error: f64::NAN,
        status,
    };
    let first = ROTATION_COLUMNS.len();
    OutputState { rotation, translation: translates.then(|| (vector(first), vector(first + 3))) }
}
