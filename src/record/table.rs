//! Tables written by a run, read as a whole.

use std::borrow::Cow;
use std::fs::File;
use std::path::{Path, PathBuf};

use super::state_table::{Values, columns};
use crate::error::{Error, FileAction, Result};
use crate::study::Format;
use crate::study::text::{CUT, Lines};

/// A table written by a run, in memory, by column.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    path: PathBuf,
    /// All of one length.
    columns: Vec<(String, Values)>,
}

/// Reads any table that a run writes, in any of its formats, as a whole: `final`, `snapshots`, `statistics`, `events`,
/// `survival`, `times`, `histograms`, `initial`, `cells` and `failed`. Numbers are those that were written, to the bit.
/// [`StateTable`](super::StateTable) reads states row by row, without holding all in memory.
///
/// ```no_run
/// let table = polhode::record::read("tumbling/statistics.parquet".as_ref())?;
/// let (times, rates) = (table.numbers("t"), table.numbers("spin_rate_mean"));
/// # let _ = (times, rates);
/// # Ok::<(), polhode::Error>(())
/// ```
///
/// # Errors
///
/// [`Error::File`] if the file cannot be read; [`Error::Table`] if it is not such a table, or is cut off.
pub fn read(path: &Path) -> Result<Table> {
    let columns = match path.extension().is_some_and(|ending| ending == Format::Csv.name()) {
        true => texts(path)?,
        false => with_rows(columns(path)?).ok_or_else(|| Error::Table {
            path: path.to_owned(),
            reason: "its columns have no common rows".to_owned(),
        })?,
    };
    Ok(Table { path: path.to_owned(), columns })
}

/// The cells of comma-separated values.
fn texts(path: &Path) -> Result<Vec<(String, Values)>> {
    let no_table = |reason: String| Error::Table { path: path.to_owned(), reason };
    let file = File::open(path).map_err(|error| Error::file(path, FileAction::Read, &error))?;
    let mut reader = csv::Reader::from_reader(Lines::new(file));
    let header = reader.headers().map_err(|error| no_table(error.to_string()))?.clone();
    let mut texts = vec![Vec::new(); header.len()];
    for row in reader.records() {
        let row = row.map_err(|error| no_table(error.to_string()))?;
        texts.iter_mut().zip(&row).for_each(|(column, cell)| column.push(cell.to_owned()));
    }
    if reader.get_ref().are_cut() {
        return Err(no_table(format!("line {}: {CUT}", reader.position().line())));
    }
    Ok(header.iter().map(str::to_owned).zip(texts.into_iter().map(Values::Texts)).collect())
}

/// Expands arrays of states, which have an axis of time and one of bodies (`t`, `body` and `cell` have only one), to one value for each
/// row.
/// `None` if they do not fit together.
fn with_rows(mut columns: Vec<(String, Values)>) -> Option<Vec<(String, Values)>> {
    let rows = columns.iter().map(|(_, values)| values.len()).max().unwrap_or(0);
    let bodies = columns.iter().find(|(name, _)| name == "body").map_or(rows, |(_, values)| values.len());
    for (name, values) in &mut columns {
        if let Values::Numbers(numbers) = values
            && numbers.len() < rows
        {
            let is_time = name == "t";
            let (times, own) = if is_time { (numbers.len(), bodies) } else { (rows / bodies.max(1), numbers.len()) };
            if own != bodies || bodies.checked_mul(times) != Some(rows) {
                return None;
            }
            *numbers = (0..rows).map(|row| numbers[if is_time { row / bodies } else { row % bodies }]).collect();
        }
    }
    columns.iter().all(|(_, values)| values.len() == rows).then_some(columns)
}

impl Table {
    /// The names of the columns, in their order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.columns.iter().map(|(name, _)| name.as_str())
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.columns.first().map_or(0, |(_, values)| values.len())
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    fn values(&self, name: &str) -> Option<&Values> {
        self.columns.iter().find(|(column, _)| column == name).map(|(_, values)| values)
    }

    /// A column of numbers, of shape `[rows]`; NaN if a cell holds none. `None` if there is no such column.
    pub fn numbers(&self, name: &str) -> Option<Cow<'_, [f64]>> {
        Some(match self.values(name)? {
            Values::Numbers(numbers) => numbers.into(),
            Values::Texts(texts) => texts.iter().map(|text| text.parse().unwrap_or(f64::NAN)).collect(),
        })
    }

    /// A column of texts, of shape `[rows]`; for comma-separated values the cells as written. `None` if there is no such column.
    pub fn texts(&self, name: &str) -> Option<&[String]> {
        match self.values(name)? {
            Values::Texts(texts) => Some(texts),
            Values::Numbers(_) => None,
        }
    }

    #[cfg(feature = "plot")]
    fn lacks(&self, name: &str) -> Error {
        Error::Table { path: self.path.clone(), reason: format!("it has no column {name}") }
    }

    /// A required column of numbers.
    #[cfg(feature = "plot")]
    pub(crate) fn need(&self, name: &str) -> Result<Vec<f64>> {
        self.numbers(name).map(Cow::into_owned).ok_or_else(|| self.lacks(name))
    }

    /// A required column of words.
    #[cfg(feature = "plot")]
    pub(crate) fn words(&self, name: &str) -> Result<Vec<&str>> {
        let texts = self.texts(name).ok_or_else(|| self.lacks(name))?;
        Ok(texts.iter().map(String::as_str).collect())
    }
}
