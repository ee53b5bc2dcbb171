//! Tables of statistics: one row for each output time, or for each output time and cell.

use super::column::CELL;
use super::folder::{OutputFile, OutputFolder};
use super::npz_file::{Archive, npy_header};
#[cfg(feature = "parquet")]
use super::parquet_file::{Cells, Field, Kind, ParquetFile};
use super::{Statistics, Summary};
use crate::error::Result;
use crate::scene::Observed;
use crate::study::Format;

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Content {
    Number,
    Count,
    Body,
}

/// A column, with the unit of its numbers.
#[derive(Debug)]
struct Column<'q> {
    name: String,
    content: Content,
    #[cfg_attr(not(feature = "parquet"), expect(dead_code, reason = "only Parquet files name units"))]
    unit: &'q str,
}

/// What stands in a column at an output time.
#[derive(Clone, Copy)]
enum Cell {
    Number(f64),
    Count(usize),
    Body(Option<usize>),
}

#[cfg(feature = "parquet")]
impl Cell {
    fn number(&self) -> Option<f64> {
        if let Self::Number(value) = *self { Some(value) } else { None }
    }

    fn count(&self) -> Option<i64> {
        if let Self::Count(count) = *self { Some(count as i64) } else { None }
    }

    fn body(&self) -> Option<Option<i64>> {
        if let Self::Body(body) = *self { Some(body.map(|body| body as i64)) } else { None }
    }
}

/// All columns: the time, the cell if the table has cells, the bodies that have not failed, and those of each quantity, to whose name theirs
/// are appended.
fn columns(observed: &Observed, has_cells: bool) -> Vec<Column<'_>> {
    let column = |name: &str, content, unit| Column { name: name.to_owned(), content, unit };
    let mut columns = vec![column("t", Content::Number, "")];
    columns.extend(has_cells.then(|| column(CELL, Content::Count, "")));
    columns.push(column("count", Content::Count, ""));
    for quantity in &observed.statistics {
        let mut add = |figure: &str, content, unit| {
            columns.push(column(&format!("{quantity}_{figure}"), content, unit));
        };
        if quantity.may_be_undefined() {
            add("count", Content::Count, "");
        }
        for figure in ["mean", "standard_deviation", "min", "max"] {
            add(figure, Content::Number, quantity.unit());
        }
        for figure in ["min_body", "max_body"] {
            add(figure, Content::Body, "");
        }
        for percent in &observed.quantiles {
            add(&format!("q{percent}"), Content::Number, quantity.unit());
        }
    }
    columns
}

/// The row of an output time, in the order of [`columns`].
fn cells(statistics: &Statistics, cell: Option<usize>) -> Vec<Cell> {
    let mut cells = vec![Cell::Number(statistics.time)];
    cells.extend(cell.map(Cell::Count));
    cells.push(Cell::Count(statistics.count));
    for summary in &statistics.summaries {
        let &Summary { count, mean, standard_deviation, min, max, min_body, max_body, .. } = summary;
        cells.extend(summary.quantity.may_be_undefined().then_some(Cell::Count(count)));
        cells.extend([mean, standard_deviation, min, max].map(Cell::Number));
        cells.extend([min_body, max_body].map(Cell::Body));
        cells.extend(summary.quantiles.iter().copied().map(Cell::Number));
    }
    cells
}

/// The tables of statistics that a scene asks for: of all bodies, and of those of each cell.
#[derive(Debug)]
pub(crate) struct StatisticsFiles {
    all: Option<StatisticsFile>,
    by_cell: Option<StatisticsFile>,
}

impl StatisticsFiles {
    pub fn begin(folder: &mut OutputFolder, format: Format, observed: &Observed, outputs: usize) -> Result<Self> {
        let has_statistics = !observed.statistics.is_empty();
        let mut begin = |of_cells| StatisticsFile::begin(folder, format, observed, outputs, of_cells);
        Ok(Self {
            all: has_statistics.then(|| begin(None)).transpose()?,
            by_cell: observed.cells.filter(|_| has_statistics).map(|cells| begin(Some(cells))).transpose()?,
        })
    }

    /// Appends the row of an output time.
    pub fn append(&mut self, statistics: &Statistics) -> Result<()> {
        self.all.as_mut().map_or(Ok(()), |file| file.append_rows(&[cells(statistics, None)]))
    }

    /// Appends the rows of an output time, cell by cell.
    pub fn append_cells<'s>(&mut self, all: impl Iterator<Item = &'s Statistics>) -> Result<()> {
        let Some(file) = &mut self.by_cell else { return Ok(()) };
        let rows: Vec<Vec<Cell>> = all.enumerate().map(|(cell, statistics)| cells(statistics, Some(cell))).collect();
        file.append_rows(&rows)
    }

    pub fn finish(self) -> Result<()> {
        self.all.into_iter().chain(self.by_cell).try_for_each(StatisticsFile::finish)
    }
}

/// A table being written.
///
/// If there is no body, comma-separated values leave it empty, arrays of shape `[outputs]` have −1, and Parquet null.
#[derive(Debug)]
enum StatisticsFile {
    Csv(OutputFile),
    Npz(Box<Archive>),
    #[cfg(feature = "parquet")]
    Parquet(Box<ParquetFile>),
}

impl StatisticsFile {
    /// The statistics of all bodies, a row for each of `outputs` output times, or of the bodies of each of so many cells, a row for each output
    /// time and cell. Each quantile is a column, such as `q5`, of every quantity.
    fn begin(
        folder: &mut OutputFolder,
        format: Format,
        observed: &Observed,
        outputs: usize,
        of_cells: Option<usize>,
    ) -> Result<Self> {
        let stem = if of_cells.is_some() { "statistics_by_cell" } else { "statistics" };
        let file_name = format!("{stem}.{}", format.name());
        let columns = columns(observed, of_cells.is_some());
        let rows = outputs * of_cells.unwrap_or(1);
        match format {
            Format::Csv => {
                let mut file = folder.begin(&file_name)?;
                let names: Vec<&str> = columns.iter().map(|column| &column.name[..]).collect();
                file.write((names.join(",") + "\n").as_bytes())?;
                Ok(Self::Csv(file))
            }
            Format::Npz => {
                let mut archive = Archive::new(folder.begin(&file_name)?);
                let header = |column: &Column<'_>| {
                    let element = match column.content {
                        Content::Number => "<f8",
                        Content::Count => "<u8",
                        Content::Body => "<i8",
                    };
                    npy_header(element, &[rows])
                };
                for column in &columns {
                    archive.reserve(format!("{}.npy", column.name), (header(column).len() + 8 * rows) as u64);
                }
                for (place, column) in columns.iter().enumerate() {
                    archive.append(place, &header(column))?;
                }
                Ok(Self::Npz(Box::new(archive)))
            }
            #[cfg(feature = "parquet")]
            Format::Parquet => {
                let field = |column: &Column<'_>| {
                    let kind = match column.content {
                        Content::Number => Kind::Number,
                        Content::Count => Kind::Whole,
                        Content::Body => Kind::Optional,
                    };
                    Field { unit: column.unit.to_owned(), ..Field::new(&column.name, kind) }
                };
                let fields: Vec<Field> = columns.iter().map(field).collect();
                Ok(Self::Parquet(Box::new(ParquetFile::begin(folder, stem, &fields)?)))
            }
        }
    }

    fn append_rows(&mut self, rows: &[Vec<Cell>]) -> Result<()> {
        // A column of the rows.
        let column = |place: usize| rows.iter().map(move |row| &row[place]);
        let columns = 0..rows.first().map_or(0, Vec::len);
        match self {
            Self::Csv(file) => {
                let text = |cell: &Cell| match *cell {
                    Cell::Number(value) => number(value),
                    Cell::Count(count) => count.to_string(),
                    Cell::Body(body) => body.map_or(String::new(), |body| body.to_string()),
                };
                let line = |row: &Vec<Cell>| row.iter().map(text).collect::<Vec<_>>().join(",") + "\n";
                file.write(rows.iter().map(line).collect::<String>().as_bytes())
            }
            Self::Npz(archive) => {
                let bytes = |cell: &Cell| match *cell {
                    Cell::Number(value) => value.to_le_bytes(),
                    Cell::Count(count) => (count as u64).to_le_bytes(),
                    Cell::Body(body) => body.map_or(-1, |body| body as i64).to_le_bytes(),
                };
                for place in columns {
                    archive.append(place, &column(place).flat_map(bytes).collect::<Vec<u8>>())?;
                }
                Ok(())
            }
            #[cfg(feature = "parquet")]
            Self::Parquet(file) => {
                // All cells of a column hold the same.
                let of = |place: usize| match rows[0][place] {
                    Cell::Number(_) => Cells::Numbers(column(place).filter_map(Cell::number).collect()),
                    Cell::Count(_) => Cells::Whole(column(place).filter_map(Cell::count).collect()),
                    Cell::Body(_) => Cells::Optional(column(place).filter_map(Cell::body).collect()),
                };
                file.append(&columns.map(of).collect::<Vec<_>>())
            }
        }
    }

    fn finish(self) -> Result<()> {
        match self {
            Self::Csv(file) => file.finish(),
            Self::Npz(archive) => archive.finish(),
            #[cfg(feature = "parquet")]
            Self::Parquet(file) => file.finish(),
        }
    }
}

/// The text with the fewest digits that read back to the same bits.
fn number(x: f64) -> String {
    zmij::Buffer::new().format(x).to_owned()
}
