//! Tables of states written by a run, read back row by row.

use std::fs::File;

use std::path::{Path, PathBuf};

use glam::{DQuat, DVec3};

use super::OutputState;
use super::column::{self, MOST_COLUMNS, ROTATION_COLUMNS, StateRows};
use crate::bodies::{BodyState, Status};
use crate::error::{Error, FileAction, Result};
use crate::study::Format;

mod csv_table;
mod npz_table;
#[cfg(feature = "parquet")]
mod parquet_table;

use csv_table::CsvTable;
use npz_table::NpzTable;
#[cfg(feature = "parquet")]
use parquet_table::ParquetTable;

/// One row of a table of states.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StateRow {
    /// Index of the body.
    pub body: usize,
    /// Time, s.
    pub time: f64,
    /// The state. What tables do not hold ([`BodyState::norm_error`], columns that were not asked for) is NaN.
    pub state: OutputState,
}

/// A table of states, `final` or `snapshots`, in any of the formats that runs write. No file is kept open between calls.
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
    /// Names of the columns between `t` and `status`.
    names: Vec<String>,
    has_cells: bool,
    source: Source,
}

#[derive(Debug)]
enum Source {
    Csv(CsvTable),
    Npz(NpzTable),
    #[cfg(feature = "parquet")]
    Parquet(ParquetTable),
}

/// The values of a column of any table.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Values {
    Numbers(Vec<f64>),
    Texts(Vec<String>),
}

impl Values {
    pub fn len(&self) -> usize {
        match self {
            Self::Numbers(numbers) => numbers.len(),
            Self::Texts(texts) => texts.len(),
        }
    }
}

/// All columns of a table written by a run, by name, except for comma-separated values.
pub(crate) fn columns(path: &Path) -> Result<Vec<(String, Values)>> {
    match Format::of(path) {
        #[cfg(feature = "parquet")]
        Some(Format::Parquet) => parquet_table::columns(path, open(path)?),
        Some(Format::Csv | Format::Npz) | None => npz_table::columns(path),
    }
}

/// Some rows as they stand in a table.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct TableRows {
    pub bodies: Vec<usize>,
    pub times: Vec<f64>,
    pub rows: StateRows,
}

impl StateTable {
    /// Opens a table by the extension of its name: `csv`, `npz` or, with the feature `parquet`, `parquet`.
    ///
    /// # Errors
    ///
    /// [`Error::File`] if the file cannot be read; [`Error::Table`] if it holds no states.
    pub fn open(path: &Path) -> Result<Self> {
        Self::opened(path, NpzTable::open)
    }

    /// As [`StateTable::open`], for a file whose bytes are known to be unchanged: an archive's own checksums are not verified.
    pub(crate) fn open_known(path: &Path) -> Result<Self> {
        Self::opened(path, NpzTable::listed)
    }

    fn opened(path: &Path, archive: fn(&Path, &mut File) -> Result<NpzTable>) -> Result<Self> {
        let mut file = open(path)?;
        let source = match Format::of(path) {
            Some(Format::Csv) => Source::Csv(CsvTable::open(path, &mut file)?),
            Some(Format::Npz) => Source::Npz(archive(path, &mut file)?),
            #[cfg(feature = "parquet")]
            Some(Format::Parquet) => Source::Parquet(ParquetTable::open(path, file)?),
            None => return Err(wrong(path, format!("expected a file that ends in {ENDINGS}"))),
        };
        let names = match &source {
            Source::Csv(table) => table.names(),
            Source::Npz(table) => table.names(),
            #[cfg(feature = "parquet")]
            Source::Parquet(table) => table.names(),
        };
        let not_states = || wrong(path, "expected the columns of states that a run writes");
        let [body, time, names @ ..] = names else { return Err(not_states()) };
        let (names, has_cells) = match names {
            [names @ .., status, cell] if status == column::STATUS && cell == column::CELL => (names, true),
            // Arrays with one value for each body come first.
            [cell, names @ .., status] if status == column::STATUS && cell == column::CELL => (names, true),
            [names @ .., status] if status == column::STATUS => (names, false),
            _ => return Err(not_states()),
        };
        if body != "body" || time != "t" {
            return Err(not_states());
        }
        let names = names.to_vec();
        Ok(Self { path: path.to_owned(), names, has_cells, source })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The names of the columns of numbers, in their order: of states ([`crate::record::ROTATION_COLUMNS`],
    /// [`crate::record::TRANSLATION_COLUMNS`]) and of derived quantities.
    pub fn columns(&self) -> &[String] {
        &self.names
    }

    /// Whether there are positions or velocities.
    pub fn translates(&self) -> bool {
        self.names.iter().filter_map(|name| column::place(name)).any(|place| place >= ROTATION_COLUMNS.len())
    }

    /// Some rows, counted from 0; fewer if the table ends before. In comma-separated values, rows before those of the last call are
    /// searched from the start.
    ///
    /// # Errors
    ///
    /// [`Error::File`], [`Error::Table`].
    pub fn read(&mut self, first: u64, count: usize) -> Result<Vec<StateRow>> {
        let found = self.read_rows(first, count)?;
        let translates = self.translates();
        let places: Vec<Option<usize>> = self.names.iter().map(|name| column::place(name)).collect();
        let stopped_at = self.names.iter().position(|name| name == column::STOPPED_AT);
        let row = |(row, (body, time)): (usize, (usize, f64))| {
            let mut numbers = [f64::NAN; MOST_COLUMNS];
            for (place, column) in places.iter().zip(&found.rows.numbers) {
                if let Some(place) = place {
                    numbers[*place] = column[row];
                }
            }
            let is_known = ROTATION_COLUMNS.iter().all(|name| self.names.iter().any(|known| known == name));
            let state = state_of(&numbers, translates, found.rows.status[row], is_known);
            let stopped_at = stopped_at.map(|place| found.rows.numbers[place][row]).filter(|time| !time.is_nan());
            StateRow { body, time, state: OutputState { stopped_at, ..state } }
        };
        let rows = found.bodies.iter().copied().zip(found.times.iter().copied());
        Ok(rows.enumerate().map(row).collect())
    }

    /// The numbers of some rows, as [`StateTable::read`].
    pub(crate) fn read_rows(&mut self, first: u64, count: usize) -> Result<TableRows> {
        let (path, mut file) = (&self.path, open(&self.path)?);
        let shape = Shape { columns: self.names.len(), has_cells: self.has_cells };
        match &mut self.source {
            Source::Csv(table) => table.read(path, &mut file, (first, count), shape),
            Source::Npz(table) => table.read(path, &mut file, (first, count), shape),
            #[cfg(feature = "parquet")]
            Source::Parquet(table) => table.read(path, file, (first, count), shape),
        }
    }
}

#[cfg(feature = "parquet")]
const ENDINGS: &str = ".csv, .npz or .parquet";
#[cfg(not(feature = "parquet"))]
const ENDINGS: &str = ".csv or .npz (this build reads no Parquet)";

/// The columns of a table.
#[derive(Clone, Copy, Debug)]
struct Shape {
    /// Number of columns between `t` and `status`.
    columns: usize,
    has_cells: bool,
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

/// The state of a row from its numbers, in the order of [`column::place`]; `is_known` says whether all numbers of the rotation are there.
fn state_of(numbers: &[f64; MOST_COLUMNS], translates: bool, status: u8, is_known: bool) -> OutputState {
    let [x, y, z, w, wx, wy, wz, lx, ly, lz, kinetic_energy, ..] = *numbers;
    let vector = |first: usize| DVec3::new(numbers[first], numbers[first + 1], numbers[first + 2]);
    let orientation = DQuat::from_xyzw(x, y, z, w);
    let status = match Status::from_code(f64::from(status)) {
        // The rotation is then good as long as its numbers are finite.
        Status::CentreNotFinite if orientation.is_finite() || !is_known => Status::Valid,
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
    OutputState::moving(rotation, translates.then(|| (vector(first), vector(first + 3))))
}
