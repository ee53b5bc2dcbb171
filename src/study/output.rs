//! `[output]`: which files a run writes, and what is in them.

use std::path::Path;
use std::sync::LazyLock;

use super::observed::StudyObserved;
use super::reader::{Node, Table};
use crate::bodies::state_columns;
use crate::error::{Result, nearest};
use crate::scene::Quantity;

/// `[output]`: which files a run writes.
#[derive(Clone, Debug, PartialEq)]
pub struct Output {
    /// All bodies at the end.
    pub final_state: bool,
    /// All bodies at all output times.
    pub snapshots: bool,
    /// Initial values: moments, parameters and state of all bodies at t = 0.
    pub initial: bool,
    /// The columns of tables of states between `t` and `status`; `None` for all numbers of a state.
    pub columns: Option<Vec<OutputColumn>>,
    /// The format of all tables.
    pub format: Format,
}

impl Default for Output {
    /// States at the end, with all numbers, as comma-separated values.
    fn default() -> Self {
        Self { final_state: true, snapshots: false, initial: false, columns: None, format: Format::Csv }
    }
}

/// A column of numbers in a table of states.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum OutputColumn {
    /// A number of the state, one of [`crate::record::ROTATION_COLUMNS`] or, if bodies translate,
    /// [`crate::record::TRANSLATION_COLUMNS`].
    State(&'static str),
    /// A derived quantity.
    Quantity(Quantity),
}

impl OutputColumn {
    /// Its name in tables.
    pub fn name(&self) -> &str {
        match self {
            Self::State(name) => name,
            Self::Quantity(quantity) => quantity.name(),
        }
    }
}

/// A format of output tables. What else a new one needs: `docs/extending.md`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Format {
    /// Comma-separated values, one row for each body and output time.
    Csv,
    /// An archive of NumPy arrays, one for each column.
    Npz,
    /// Apache Parquet, one row for each body and output time.
    #[cfg(feature = "parquet")]
    Parquet,
}

impl Format {
    /// All formats that this build writes.
    pub const ALL: &[Self] = &[
        Format::Csv,
        Format::Npz,
        #[cfg(feature = "parquet")]
        Format::Parquet,
    ];

    /// The name in study files and the extension of files.
    pub fn name(self) -> &'static str {
        match self {
            Format::Csv => "csv",
            Format::Npz => "npz",
            #[cfg(feature = "parquet")]
            Format::Parquet => "parquet",
        }
    }

    /// The format of a file, by the extension of its name; `None` if this build has no such format.
    pub(crate) fn of(path: &Path) -> Option<Self> {
        let ending = path.extension()?;
        Self::ALL.iter().copied().find(|format| ending == format.name())
    }
}

pub(super) fn table<'a>(node: &Node<'a>) -> Result<Table<'a>> {
    let keys = ["final", "snapshots", "initial", "columns", "statistics", "quantiles", "by_cell", "format"];
    node.table("expected a table [output]", &keys)
}

/// Reads the table; `translates` says whether the bodies have positions.
pub(super) fn read(table: &Table<'_>, observed: &StudyObserved, translates: bool) -> Result<Output> {
    let flag = |key: &str, default: bool| {
        let node = table.find(key);
        node.map(|node| node.boolean("expected true or false")).transpose().map(|flag| flag.unwrap_or(default))
    };
    let (final_state, snapshots, initial) = (flag("final", true)?, flag("snapshots", false)?, flag("initial", false)?);
    let columns = match table.find("columns") {
        Some(node) if !final_state && !snapshots => {
            return Err(node.refuse("expected final = true or snapshots = true too: columns are those of their tables"));
        }
        Some(node) => Some(columns(&node, observed, translates)?),
        None => None,
    };
    Ok(Output { final_state, snapshots, initial, columns, format: format(table)? })
}

fn format(table: &Table<'_>) -> Result<Format> {
    let Some(node) = table.find("format") else { return Ok(Format::Csv) };
    if cfg!(not(feature = "parquet")) && node.string("expected a format").is_ok_and(|name| name == "parquet") {
        return Err(
            node.refuse("this build writes no Parquet: build it with the feature parquet, or expected csv or npz")
        );
    }
    static NAMES: LazyLock<Vec<&'static str>> = LazyLock::new(|| Format::ALL.iter().map(|of| of.name()).collect());
    let name = node.choice(&NAMES)?;
    Ok(Format::ALL.iter().copied().find(|format| format.name() == name).unwrap_or(Format::Csv))
}

fn columns(node: &Node<'_>, observed: &StudyObserved, translates: bool) -> Result<Vec<OutputColumn>> {
    const LIST: &str = "expected a list of columns, such as [\"qx\", \"qy\", \"qz\", \"qw\", \"spin_rate\"]";
    let elements = node.elements().filter(|elements| !elements.is_empty()).ok_or_else(|| node.refuse(LIST))?;
    let mut found: Vec<OutputColumn> = Vec::with_capacity(elements.len());
    for element in elements {
        let name = element.string("expected the name of a column")?;
        let state = state_columns::names(translates).find(|column| *column == name).map(OutputColumn::State);
        let column = state.or_else(|| observed.quantity(name).cloned().map(OutputColumn::Quantity));
        let column = column.ok_or_else(|| {
            if !translates && state_columns::names(true).any(|column| column == name) {
                return element.refuse("expected a column of the rotation: these bodies have no positions");
            }
            let mut known: Vec<&str> = state_columns::names(translates).collect();
            known.extend(
                observed.quantity_names().filter(|name| !state_columns::names(translates).any(|own| own == *name)),
            );
            let suggestion = nearest(name, &known).map(|near| format!("did you mean {near}? ")).unwrap_or_default();
            element.refuse(format!("{suggestion}expected a column: {}", known.join(", ")))
        })?;
        if matches!(column, OutputColumn::Quantity(Quantity::OwnState(_))) {
            return Err(element.refuse("tables of states always include the own state of torques: leave it out"));
        }
        if found.contains(&column) {
            return Err(element.refuse("expected each column once"));
        }
        found.push(column);
    }
    Ok(found)
}
