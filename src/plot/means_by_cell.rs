//! Means of the cells of a study that sweeps: over time or, if there are many cells along one axis or one output time, at the end over that
//! axis.

use std::borrow::Cow;
use std::path::Path;

use super::figure::{Axis, BLUE, COLOURS, Figure, GREEN, Item, Line, Mark, Outline, Panel, Style};
use super::run::{self, named};
use super::scale::extent;
use super::statistics_over_time::{quantile_of, quantiles_in};
use super::sweep::{MOST_NAMED, cell_labels, only_axis};
use super::time::over_time;
use crate::error::{Error, Result};
use crate::record;

const MEAN: Style = Style { colour: BLUE, line: Line::Solid, mark: None, width: 2 };
const OF_CELL: Style =
    Style { mark: Some(Mark { outline: Outline::Circle, filled: true }), ..Style { width: 1, ..MEAN } };
const QUANTILE: Style = Style { colour: GREEN, line: Line::Dashed, mark: None, width: 1 };
const BAND: Style = Style { colour: BLUE, line: Line::None, mark: None, width: 1 };

/// The table that is drawn.
pub(super) const TABLE: &str = "statistics_by_cell";

/// A quantity's columns, with a row for each output time and cell.
struct Columns<'r> {
    label: String,
    y: Axis,
    mean: Cow<'r, [f64]>,
    deviation: Cow<'r, [f64]>,
    least: Cow<'r, [f64]>,
    greatest: Cow<'r, [f64]>,
    quantiles: Vec<Cow<'r, [f64]>>,
}

/// The most points of a line with marks.
const MOST_MARKED: usize = 25;

/// The `index`-th line of `points`.
fn line(index: usize, points: usize) -> Style {
    const LINES: [Line; 3] = [Line::Solid, Line::Dashed, Line::Dotted];
    let style = Style::nth(index);
    match points {
        ..=MOST_MARKED => style,
        _ => Style { mark: None, width: 2, line: LINES[index / COLOURS.len() % LINES.len()], ..style },
    }
}

/// A panel for each quantity in the table at `path`, of the run in `folder`; `unit` gives their units. `None` if there is only one cell.
pub(super) fn means_by_cell(
    folder: &Path,
    path: &Path,
    unit: &dyn Fn(&str) -> Option<String>,
) -> Result<Option<Figure>> {
    let rows = record::read(path)?;
    let (time, cell) = (rows.need("t")?, rows.need("cell")?);
    let count = (cell.iter().copied().fold(0.0, f64::max) as usize).saturating_add(1);
    if count == 1 {
        return Ok(None);
    }
    let is_in_turn = cell.iter().enumerate().all(|(row, cell)| *cell == (row % count) as f64);
    if !is_in_turn || time.len() % count != 0 {
        let reason = "expected a row for each cell at each output time".to_owned();
        return Err(Error::Table { path: path.to_owned(), reason });
    }
    let of_quantity = |quantity: &str| -> Option<Columns<'_>> {
        let label = quantity.replace('_', " ");
        let y = Axis::linear(&named(&label, unit(quantity)));
        let of = |figure: &str| rows.numbers(&format!("{quantity}_{figure}"));
        let quantiles = rows.names().filter(|name| quantile_of(name) == Some(quantity));
        let quantiles = quantiles.filter_map(|name| rows.numbers(name)).collect();
        let (mean, deviation, least, greatest) = (of("mean")?, of("standard_deviation")?, of("min")?, of("max")?);
        Some(Columns { label, y, mean, deviation, least, greatest, quantiles })
    };
    let columns: Vec<Columns<'_>> = rows.names().filter_map(|name| of_quantity(name.strip_suffix("_mean")?)).collect();
    let outputs = time.len() / count;
    let axis = match count > MOST_NAMED || outputs == 1 {
        true => only_axis(folder)?.filter(|(_, values)| values.len() == count),
        false => None,
    };
    let (panels, legend): (Vec<Panel>, _) = match axis {
        Some((swept, values)) => {
            let mut order: Vec<usize> = (0..count).collect();
            order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
            // The rows of the last output time, by cell.
            let last = time.len() - count;
            let quantiles = quantiles_in(rows.names());
            let panel = |of: Columns<'_>| {
                let mut items = Vec::new();
                // Cells without a mean leave a gap.
                for cells in order.split(|cell| of.mean[last + cell].is_nan()).filter(|cells| !cells.is_empty()) {
                    let curve = |numbers: &[f64], style| Item::Curve {
                        points: cells.iter().map(|cell| (values[*cell], numbers[last + cell])).collect(),
                        style,
                    };
                    let band = cells.iter().map(|cell| {
                        let (row, value) = (last + cell, values[*cell]);
                        let (low, high) = (of.mean[row] - of.deviation[row], of.mean[row] + of.deviation[row]);
                        (value, low.max(of.least[row]), high.min(of.greatest[row]))
                    });
                    items.push(Item::Band { points: band.collect(), style: BAND });
                    items.extend(of.quantiles.iter().map(|numbers| curve(numbers, QUANTILE)));
                    items.push(curve(&of.mean, OF_CELL));
                }
                Panel { title: of.label, x: swept.axis(), y: of.y, items, equal: false }
            };
            let mut legend = vec![("mean at the end; band: one standard deviation".to_owned(), OF_CELL)];
            legend.extend(quantiles.map(|quantiles| (quantiles, QUANTILE)));
            (columns.into_iter().map(panel).collect(), legend)
        }
        None if count <= MOST_NAMED => {
            let panel = |Columns { label, y, mean, .. }: Columns<'_>| {
                let of_cell = |own: usize| Item::Curve {
                    points: (own..time.len()).step_by(count).map(|row| (time[row], mean[row])).collect(),
                    style: line(own, outputs),
                };
                over_time(label, y, (0..count).map(of_cell).collect())
            };
            let labels = cell_labels(folder, count)?.into_iter().enumerate();
            let legend = labels.map(|(cell, label)| (label, line(cell, outputs))).collect();
            (columns.into_iter().map(panel).collect(), legend)
        }
        None => {
            let panel = |Columns { label, y, mean, .. }: Columns<'_>| {
                let (mut band, mut curve) = (Vec::new(), Vec::new());
                for (means, time) in mean.chunks(count).zip(time.iter().step_by(count)) {
                    // Without a mean are cells whose bodies all lack the quantity.
                    let known = || means.iter().copied().filter(|mean| mean.is_finite());
                    if known().next().is_none() {
                        continue;
                    }
                    let (least, most) = extent(known());
                    band.push((*time, least, most));
                    curve.push((*time, known().sum::<f64>() / known().count() as f64));
                }
                let items = vec![Item::Band { points: band, style: BAND }, Item::Curve { points: curve, style: MEAN }];
                over_time(label, y, items)
            };
            let legend = vec![(format!("mean of {count} cells; band: the least and the greatest of a cell"), MEAN)];
            (columns.into_iter().map(panel).collect(), legend)
        }
    };
    let columns = panels.len().clamp(1, 2);
    run::figure(folder, "Means by cell", panels, columns, legend).map(Some)
}
