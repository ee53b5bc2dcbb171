//! Tables of statistics: one row for each output time, or for each output time and cell.

use super::column::CELL;
use super::folder::OutputFolder;
use super::table_file::{RowsFile, TableColumn};
use super::{Statistics, Summary};
use crate::error::Result;
use crate::scene::Observed;
use crate::study::Format;

type Figure = (&'static str, fn(&Summary) -> f64);

const FIGURES: [Figure; 4] = [
    ("mean", |summary| summary.mean),
    ("standard_deviation", |summary| summary.standard_deviation),
    ("min", |summary| summary.min),
    ("max", |summary| summary.max),
];

/// All columns: the time, the cell if the table has cells, the bodies that have not failed, and those of each quantity, to whose name theirs
/// are appended. Each quantile is a column, such as `q5`, of every quantity.
fn columns<'a>(observed: &'a Observed, has_cells: bool, rows: &'a [&Statistics]) -> Vec<TableColumn<'a>> {
    let mut columns = vec![TableColumn::number("t", |row| rows[row].time).within("")];
    columns.extend(has_cells.then(|| TableColumn::whole(CELL, |row| row as u64).within("")));
    columns.push(TableColumn::whole("count", |row| rows[row].count as u64));
    for (place, quantity) in observed.statistics.iter().enumerate() {
        let (unit, name) = (quantity.unit(), |figure: &str| format!("{quantity}_{figure}"));
        let of = move |row: usize| &rows[row].summaries[place];
        if quantity.may_be_undefined() {
            columns.push(TableColumn::whole(name("count"), move |row| of(row).count as u64));
        }
        let number =
            |(figure, value): Figure| TableColumn::number(name(figure), move |row| value(of(row))).within(unit);
        columns.extend(FIGURES.map(number));
        columns.push(TableColumn::optional(name("min_body"), move |row| of(row).min_body));
        columns.push(TableColumn::optional(name("max_body"), move |row| of(row).max_body));
        for (index, percent) in observed.quantiles.iter().enumerate() {
            let name = name(&format!("q{percent}"));
            columns.push(TableColumn::number(name, move |row| of(row).quantiles[index]).within(unit));
        }
    }
    columns
}

/// The tables of statistics that a scene asks for: of all bodies, a row for each output time, and of those of each cell, a row for each output
/// time and cell.
#[derive(Debug)]
pub(crate) struct StatisticsFiles {
    observed: Observed,
    all: Option<RowsFile>,
    by_cell: Option<RowsFile>,
}

impl StatisticsFiles {
    pub fn begin(folder: &mut OutputFolder, format: Format, observed: &Observed, outputs: usize) -> Result<Self> {
        let has_statistics = !observed.statistics.is_empty();
        let mut begin = |stem: &str, rows: usize, has_cells: bool| {
            RowsFile::begin(folder, stem, format, rows, &columns(observed, has_cells, &[]))
        };
        let all = has_statistics.then(|| begin("statistics", outputs, false)).transpose()?;
        let cells = observed.cells.filter(|_| has_statistics);
        let by_cell = cells.map(|cells| begin("statistics_by_cell", outputs * cells, true)).transpose()?;
        Ok(Self { observed: observed.clone(), all, by_cell })
    }

    /// Appends the row of an output time.
    pub fn append(&mut self, statistics: &Statistics) -> Result<()> {
        let Some(file) = &mut self.all else { return Ok(()) };
        file.append(0..1, &columns(&self.observed, false, &[statistics]))
    }

    /// Appends the rows of an output time, cell by cell.
    pub fn append_cells<'s>(&mut self, all: impl Iterator<Item = &'s Statistics>) -> Result<()> {
        let Some(file) = &mut self.by_cell else { return Ok(()) };
        let rows: Vec<&Statistics> = all.collect();
        file.append(0..rows.len(), &columns(&self.observed, true, &rows))
    }

    pub fn finish(self) -> Result<()> {
        self.all.into_iter().chain(self.by_cell).try_for_each(RowsFile::finish)
    }
}
