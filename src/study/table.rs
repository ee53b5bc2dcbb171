//! Tables of bodies in CSV files: a header, then one row for each body; or in Parquet files, by the extension.
//!
//! Columns (SI; body frame, positions and velocities in world axes), in any order: `mass`, `ixx iyy izz ixy ixz iyz`, `qx qy qz qw`, `wx wy
//! wz`, `x y z`, `vx vy vz`. `ixy` is the tensor's off-diagonal *element* −∫ρxy; missing off-diagonal columns are zero. A column `name` is
//! ignored. A table with `mass` excludes shapes, which have masses of their own. Lines that begin with `#` are comments. The last line must end
//! in a newline too, which shows that the table was not cut. A study's torques may use further columns of numbers, and those named here.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::Read;
use std::ops::Range;
use std::path::{Path, PathBuf};

use csv::StringRecord;
use glam::{DQuat, DVec3};

#[cfg(feature = "parquet")]
mod parquet;

use super::rows::{Rows, input_error};
use crate::bodies::inertia::InertiaTensor;
use crate::error::InputFault;
use crate::error::{Error, FileAction, Result};

/// All columns that a table may have.
const KNOWN: [&str; 21] = [
    NAME, "mass", "ixx", "iyy", "izz", "ixy", "ixz", "iyz", "qx", "qy", "qz", "qw", "wx", "wy", "wz", "x", "y", "z",
    "vx", "vy", "vz",
];

/// The columns of numbers, in the order in which a row is kept.
pub(crate) const NUMBERS: [&str; KNOWN.len() - 1] = {
    let [_, numbers @ ..] = KNOWN;
    numbers
};

/// The column of names.
pub(super) const NAME: &str = "name";

pub(super) const MASS: usize = 0;
pub(super) const INERTIA: usize = 1;
const PRODUCTS: usize = 4;
pub(super) const ORIENTATION: usize = 7;
pub(super) const ANGULAR_VELOCITY: usize = 11;
pub(super) const POSITION: usize = 14;
pub(super) const VELOCITY: usize = 17;

/// A table of bodies as read from its file, by column.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyTable {
    file: PathBuf,
    columns: [Option<Vec<f64>>; NUMBERS.len()],
    /// Further columns that a study's torques use, apart from those of [`NUMBERS`].
    extra: Vec<(String, Vec<f64>)>,
    /// Columns that are copied to the table of initial states unchanged.
    carried: Vec<(String, Vec<Box<str>>)>,
    /// The line of each row, from 1; for Parquet, the row number.
    lines: Vec<u64>,
}

impl BodyTable {
    /// Reads the first `most` rows of a file.
    ///
    /// # Errors
    ///
    /// [`Error::File`] if the file cannot be read; [`Error::Input`] with line and column if it is not a table of bodies, or its last line
    /// does not end in a newline, as if it was cut.
    pub fn read(path: &Path, most: usize) -> Result<Self> {
        Self::read_with(path, most, &BTreeSet::new(), &BTreeSet::new())
    }

    /// As [`BodyTable::read`], with further columns of numbers named in `extra`, and of text named in `carried`; all of them must
    /// exist, except `name`.
    pub(crate) fn read_with(
        path: &Path,
        most: usize,
        extra: &BTreeSet<String>,
        carried: &BTreeSet<String>,
    ) -> Result<Self> {
        let file = File::open(path).map_err(|error| Error::file(path, FileAction::Read, &error))?;
        if path.extension().is_some_and(|ending| ending == "parquet") {
            #[cfg(feature = "parquet")]
            return parquet::read(path, file, most, extra, carried);
            #[cfg(not(feature = "parquet"))]
            {
                let reason = "this build reads no Parquet: build it with the feature parquet, or expected a CSV file";
                return Err(input_error(path, 1, "", InputFault::Syntax { reason: reason.to_owned() }));
            }
        }
        Self::from_reader_with(path, file, most, extra, carried)
    }

    /// Reads the first `most` rows of `source`, whose name in messages is `path`.
    ///
    /// # Errors
    ///
    /// As [`BodyTable::read`].
    pub fn from_reader(path: &Path, source: impl Read, most: usize) -> Result<Self> {
        Self::from_reader_with(path, source, most, &BTreeSet::new(), &BTreeSet::new())
    }

    fn from_reader_with(
        path: &Path,
        source: impl Read,
        most: usize,
        extra: &BTreeSet<String>,
        carried: &BTreeSet<String>,
    ) -> Result<Self> {
        let mut rows = Rows::new(path, source)?;
        let (header, header_line) = (rows.header().clone(), rows.header_line());
        if header.is_empty() {
            let reason = "expected a header with the names of the columns".to_owned();
            return Err(input_error(path, header_line, "", InputFault::Syntax { reason }));
        }
        let places = header_places(path, &header, header_line, extra, carried)?;

        let mut table = Self::empty(path, &header, &places, extra, carried);
        let texts: Vec<usize> = (0..header.len()).filter(|&place| carried.contains(&header[place])).collect();
        let mut record = StringRecord::new();
        while table.lines.len() < most && rows.read(&mut record)? {
            for (field, column) in record.iter().zip(&places) {
                let Some(column) = *column else { continue };
                let number = field.parse().ok().filter(|x: &f64| x.is_finite()).ok_or_else(|| {
                    let value = if field.is_empty() { "(empty)".to_owned() } else { field.to_owned() };
                    let fault = InputFault::Value { value, expected: "expected a finite number".into() };
                    let name = NUMBERS.get(column).copied();
                    rows.refused(name.unwrap_or_else(|| &table.extra[column - NUMBERS.len()].0), fault)
                })?;
                if column >= NUMBERS.len() {
                    table.extra[column - NUMBERS.len()].1.push(number);
                } else if let Some(numbers) = &mut table.columns[column] {
                    numbers.push(number);
                }
            }
            for ((_, texts), &place) in table.carried.iter_mut().zip(&texts) {
                texts.push(record[place].into());
            }
            table.lines.push(rows.line());
        }
        rows.finish()?;
        Ok(table)
    }

    /// A table without rows, with the columns of a header.
    fn empty(
        path: &Path,
        header: &StringRecord,
        places: &[Option<usize>],
        extra: &BTreeSet<String>,
        carried: &BTreeSet<String>,
    ) -> Self {
        let mut columns: [Option<Vec<f64>>; NUMBERS.len()] = Default::default();
        for &column in places.iter().flatten().filter(|&&column| column < NUMBERS.len()) {
            columns[column] = Some(Vec::new());
        }
        let texts = header.iter().filter(|&name| carried.contains(name));
        Self {
            file: path.to_owned(),
            columns,
            extra: further(extra).map(|name| (name.clone(), Vec::new())).collect(),
            carried: texts.map(|name| (name.to_owned(), Vec::new())).collect(),
            lines: Vec::new(),
        }
    }

    /// Some of the rows.
    pub(super) fn part(self, rows: &Range<usize>) -> Self {
        let of = |numbers: Vec<f64>| numbers[rows.clone()].to_vec();
        Self {
            file: self.file,
            columns: self.columns.map(|column| column.map(of)),
            extra: self.extra.into_iter().map(|(name, numbers)| (name, of(numbers))).collect(),
            carried: self.carried.into_iter().map(|(name, texts)| (name, texts[rows.clone()].to_vec())).collect(),
            lines: self.lines[rows.clone()].to_vec(),
        }
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.lines.len()
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.lines.is_empty()
    }

    /// The numbers of a further column that was asked for by name.
    pub fn extra(&self, name: &str) -> Option<&[f64]> {
        match NUMBERS.iter().position(|known| *known == name) {
            Some(column) => self.columns[column].as_deref(),
            None => self.extra.iter().find(|(known, _)| known == name).map(|(_, numbers)| numbers.as_slice()),
        }
    }

    /// The names of the columns that are carried through, in the order of the file.
    pub fn carried(&self) -> impl Iterator<Item = &str> {
        self.carried.iter().map(|(name, _)| name.as_str())
    }

    /// The text in a row of the carried column with this index.
    pub(crate) fn carried_text(&self, column: usize, row: usize) -> &str {
        &self.carried[column].1[row]
    }

    /// Whether the table has the values of which this is the first column.
    pub(super) fn has(&self, column: usize) -> bool {
        self.columns[column].is_some()
    }

    /// One number; 0 if the table lacks the column.
    fn number(&self, row: usize, column: usize) -> f64 {
        self.columns[column].as_ref().map_or(0.0, |numbers| numbers[row])
    }

    pub(super) fn vector(&self, row: usize, column: usize) -> DVec3 {
        DVec3::new(self.number(row, column), self.number(row, column + 1), self.number(row, column + 2))
    }

    /// Mass of a row, kg.
    pub fn mass(&self, row: usize) -> f64 {
        self.number(row, MASS)
    }

    /// Inertia tensor of a row, body axes, kg m².
    pub fn inertia(&self, row: usize) -> InertiaTensor {
        InertiaTensor::from_array([0, 1, 2, 3, 4, 5].map(|index| self.number(row, INERTIA + index)))
    }

    /// Orientation of a row, as written.
    pub fn orientation(&self, row: usize) -> DQuat {
        let [x, y, z, w] = [0, 1, 2, 3].map(|index| self.number(row, ORIENTATION + index));
        DQuat::from_xyzw(x, y, z, w)
    }

    /// Angular velocity of a row, body axes, rad/s.
    pub fn angular_velocity(&self, row: usize) -> DVec3 {
        self.vector(row, ANGULAR_VELOCITY)
    }

    /// Position of a row, world axes, m.
    pub fn position(&self, row: usize) -> DVec3 {
        self.vector(row, POSITION)
    }

    /// Velocity of a row, world axes, m/s.
    pub fn velocity(&self, row: usize) -> DVec3 {
        self.vector(row, VELOCITY)
    }

    /// The error of a row's value, if `error` belongs to a body made from the row.
    pub(super) fn located(&self, error: Error, row: usize) -> Error {
        match error {
            Error::Body { field, value, expected, .. } if row < self.len() => input_error(
                &self.file,
                self.lines[row],
                field,
                InputFault::Value { value: format!("{value:?}"), expected: expected.into() },
            ),
            other => other,
        }
    }
}

/// The columns that are kept after those of [`NUMBERS`], of which a torque may read some too.
fn further(extra: &BTreeSet<String>) -> impl Iterator<Item = &String> {
    extra.iter().filter(|name| !NUMBERS.contains(&name.as_str()))
}

/// The kept column for every field of a row, `None` for names.
///
/// [`further`] columns follow those of [`NUMBERS`], in their order.
fn header_places(
    path: &Path,
    header: &StringRecord,
    line: u64,
    extra: &BTreeSet<String>,
    carried: &BTreeSet<String>,
) -> Result<Vec<Option<usize>>> {
    let mut places = Vec::with_capacity(header.len());
    for name in header {
        if !KNOWN.contains(&name) && !extra.contains(name) && !carried.contains(name) {
            let key = if name.is_empty() { "(empty)" } else { name };
            let fault = match header.len() == 1 && name.contains([';', '\t']) {
                true => InputFault::Syntax { reason: "expected commas between columns".to_owned() },
                false => InputFault::unused_column(name, &KNOWN),
            };
            return Err(input_error(path, line, key, fault));
        }
        let known = NUMBERS.iter().position(|known| *known == name);
        let place = known.or_else(|| Some(NUMBERS.len() + further(extra).position(|wanted| wanted == name)?));
        let is_twice = || header.iter().filter(|&found| found == name).count() > 1;
        if place.is_some() && places.contains(&place) || carried.contains(name) && is_twice() {
            let fault = InputFault::Syntax { reason: "this column occurs twice in the header".to_owned() };
            return Err(input_error(path, line, name, fault));
        }
        places.push(place);
    }
    for name in extra {
        if !header.iter().any(|found| found == name) {
            let expected = "a torque or a force of the study reads this column";
            return Err(input_error(path, line, name, InputFault::Missing { expected: expected.into() }));
        }
    }
    for name in carried {
        if name != NAME && !header.iter().any(|found| found == name) {
            let expected = "bodies.carry of the study names this column";
            return Err(input_error(path, line, name, InputFault::Missing { expected: expected.into() }));
        }
    }
    // Columns that make up one value must all be present or all be absent; off-diagonal elements may be omitted.
    let groups = [
        (INERTIA..PRODUCTS, "ixx, iyy and izz belong together"),
        (ORIENTATION..ANGULAR_VELOCITY, "qx, qy, qz and qw belong together"),
        (ANGULAR_VELOCITY..POSITION, "wx, wy and wz belong together"),
        (POSITION..VELOCITY, "x, y and z belong together"),
        (VELOCITY..NUMBERS.len(), "vx, vy and vz belong together"),
    ];
    let has = |column: usize| places.contains(&Some(column));
    for (group, expected) in groups {
        if let Some(missing) = group.clone().find(|&column| !has(column))
            && group.clone().any(has)
        {
            return Err(input_error(path, line, NUMBERS[missing], InputFault::Missing { expected: expected.into() }));
        }
    }
    if (PRODUCTS..ORIENTATION).any(has) && !has(INERTIA) {
        let expected = "off-diagonal elements need ixx, iyy and izz beside them";
        return Err(input_error(path, line, NUMBERS[INERTIA], InputFault::Missing { expected: expected.into() }));
    }
    Ok(places)
}
