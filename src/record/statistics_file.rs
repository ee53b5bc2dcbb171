//! Tables of statistics: one row for each output time.

use super::folder::{OutputFile, OutputFolder};
use super::npz_file::{Archive, npy_header};
#[cfg(feature = "parquet")]
use super::parquet_file::{Cells, Field, Kind, ParquetFile};
use super::{Statistics, Summary};
use crate::error::Result;
use crate::scene::Quantity;
use crate::study::Format;

/// Columns of a quantity, appended to its name.
const COLUMNS: [&str; 6] = ["mean", "standard_deviation", "min", "max", "min_body", "max_body"];

/// Number of columns of a quantity that hold indices of bodies: the last ones of these.
const BODY_COLUMNS: usize = 2;

/// Number of columns of a quantity before those.
const NUMBERS: usize = COLUMNS.len() - BODY_COLUMNS;

/// A table being written.
///
/// If there is no body, comma-separated values leave it empty, arrays of shape `[outputs]` have −1, and Parquet null.
#[derive(Debug)]
pub(crate) enum StatisticsFile {
    Csv(OutputFile),
    Npz(Box<Archive>),
    #[cfg(feature = "parquet")]
    Parquet(Box<ParquetFile>),
}

impl StatisticsFile {
    /// `quantiles` are in percent; each is a column, such as `q5`, of every quantity.
    pub fn begin(
        folder: &mut OutputFolder,
        format: Format,
        statistics: &[Quantity],
        quantiles: &[f64],
        outputs: usize,
    ) -> Result<Self> {
        let file_name = format!("statistics.{}", format.name());
        let columns = || {
            let quantiles = quantiles.iter().map(|percent| format!("q{percent}"));
            COLUMNS.map(str::to_owned).into_iter().chain(quantiles)
        };
        let width = columns().count();
        let names = statistics.iter().flat_map(|quantity| columns().map(move |column| format!("{quantity}_{column}")));
        let names: Vec<String> = ["t".to_owned(), "count".to_owned()].into_iter().chain(names).collect();
        match format {
            Format::Csv => {
                let mut file = folder.begin(&file_name)?;
                file.write((names.join(",") + "\n").as_bytes())?;
                Ok(Self::Csv(file))
            }
            Format::Npz => {
                let mut archive = Archive::new(folder.begin(&file_name)?);
                let element = |column: usize| match column {
                    0 => "<f8",
                    1 => "<u8",
                    _ if (NUMBERS..COLUMNS.len()).contains(&((column - 2) % width)) => "<i8",
                    _ => "<f8",
                };
                let header = |column: usize| npy_header(element(column), &[outputs]);
                for (column, name) in names.iter().enumerate() {
                    archive.reserve(format!("{name}.npy"), (header(column).len() + 8 * outputs) as u64);
                }
                for column in 0..names.len() {
                    archive.append(column, &header(column))?;
                }
                Ok(Self::Npz(Box::new(archive)))
            }
            #[cfg(feature = "parquet")]
            Format::Parquet => {
                let mut fields = vec![Field::new("t", Kind::Number), Field::new("count", Kind::Whole)];
                let quantity = |column: usize| &statistics[(column - 2) / width];
                fields.extend((2..names.len()).map(|column| match (column - 2) % width {
                    part if (NUMBERS..COLUMNS.len()).contains(&part) => Field::new(&names[column], Kind::Optional),
                    _ => Field { unit: quantity(column).unit().to_owned(), ..Field::new(&names[column], Kind::Number) },
                }));
                Ok(Self::Parquet(Box::new(ParquetFile::begin(folder, "statistics", &fields)?)))
            }
        }
    }

    pub fn append(&mut self, statistics: &Statistics) -> Result<()> {
        match self {
            Self::Csv(file) => {
                let mut row = format!("{},{}", number(statistics.time), statistics.count);
                for summary in &statistics.summaries {
                    for value in figures(summary) {
                        row += &format!(",{}", number(value));
                    }
                    for body in [summary.min_body, summary.max_body] {
                        row += &body.map_or(",".to_owned(), |body| format!(",{body}"));
                    }
                    for &value in &summary.quantiles {
                        row += &format!(",{}", number(value));
                    }
                }
                row.push('\n');
                file.write(row.as_bytes())
            }
            Self::Npz(archive) => {
                archive.append(0, &statistics.time.to_le_bytes())?;
                archive.append(1, &(statistics.count as u64).to_le_bytes())?;
                let mut column = 2;
                for summary in &statistics.summaries {
                    for value in figures(summary) {
                        archive.append(column, &value.to_le_bytes())?;
                        column += 1;
                    }
                    for body in [summary.min_body, summary.max_body] {
                        archive.append(column, &body.map_or(-1, |body| body as i64).to_le_bytes())?;
                        column += 1;
                    }
                    for value in &summary.quantiles {
                        archive.append(column, &value.to_le_bytes())?;
                        column += 1;
                    }
                }
                Ok(())
            }
            #[cfg(feature = "parquet")]
            Self::Parquet(file) => {
                let mut row = vec![Cells::Numbers(vec![statistics.time]), Cells::Whole(vec![statistics.count as i64])];
                for summary in &statistics.summaries {
                    row.extend(figures(summary).map(|value| Cells::Numbers(vec![value])));
                    let bodies = [summary.min_body, summary.max_body];
                    row.extend(bodies.map(|body| Cells::Optional(vec![body.map(|body| body as i64)])));
                    row.extend(summary.quantiles.iter().map(|&value| Cells::Numbers(vec![value])));
                }
                file.append(&row)
            }
        }
    }

    pub fn finish(self) -> Result<()> {
        match self {
            Self::Csv(file) => file.finish(),
            Self::Npz(archive) => archive.finish(),
            #[cfg(feature = "parquet")]
            Self::Parquet(file) => file.finish(),
        }
    }
}

fn figures(summary: &Summary) -> [f64; NUMBERS] {
    [summary.mean, summary.standard_deviation, summary.min, summary.max]
}

/// The text with the fewest digits that read back to the same bits.
fn number(x: f64) -> String {
    zmij::Buffer::new().format(x).to_owned()
}
