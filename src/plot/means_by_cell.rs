//! Means of the cells of a study that sweeps: over time or, if there are many cells along one axis, at the end over that axis.

use std::path::Path;

use super::figure::{Axis, Figure, Item, Line, Panel, Style};
use super::run::{caption, titled};
use super::sweep::{MOST_NAMED, cell_labels, only_axis};
use super::time::over_time;
use crate::error::Result;
use crate::record;

const BLUE: [u8; 3] = [0, 114, 178];

const MEAN: Style = Style { colour: BLUE, line: Line::Solid, mark: None, width: 2 };
const BAND: Style = Style { colour: BLUE, line: Line::None, mark: None, width: 1 };

/// The table that is drawn.
pub(super) const TABLE: &str = "statistics_by_cell";

/// A quantity's column of means and of standard deviations, a row for each output time and cell.
struct Column<'r> {
    label: String,
    y: Axis,
    mean: std::borrow::Cow<'r, [f64]>,
    deviation: std::borrow::Cow<'r, [f64]>,
}

/// A panel for each quantity in the table at `path`, of the run in `folder`; `unit` gives their units.
///
/// # Errors
///
/// [`crate::Error::File`], [`crate::Error::Table`] and [`crate::Error::Rows`] if a table or `report.json` cannot be read.
pub(super) fn means_by_cell(folder: &Path, path: &Path, unit: &dyn Fn(&str) -> Option<String>) -> Result<Figure> {
    let rows = record::read(path)?;
    let (time, cell) = (rows.need("t")?, rows.need("cell")?);
    let count = cell.iter().copied().fold(0.0, f64::max) as usize + 1;
    let column = |quantity: &str| -> Option<Column<'_>> {
        let label = quantity.replace('_', " ");
        let y = Axis::linear(&unit(quantity).map_or(label.clone(), |unit| format!("{label} ({unit})")));
        let of = |figure: &str| rows.numbers(&format!("{quantity}_{figure}"));
        Some(Column { label, y, mean: of("mean")?, deviation: of("standard_deviation")? })
    };
    let columns: Vec<Column<'_>> = rows.names().filter_map(|name| column(name.strip_suffix("_mean")?)).collect();
    let axis = if count > MOST_NAMED { only_axis(folder)?.filter(|(_, values)| values.len() == count) } else { None };
    let (panels, legend): (Vec<Panel>, _) = match axis {
        Some((swept, values)) => {
            let mut order: Vec<usize> = (0..count).collect();
            order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
            // The rows of the last output time, by cell.
            let last = time.len() - count;
            let panel = |Column { label, y, mean, deviation }: Column<'_>| {
                let at = |cell: &usize| (values[*cell], mean[last + cell], deviation[last + cell]);
                let points = order.iter().map(at);
                let band = points.clone().map(|(x, mean, deviation)| (x, mean - deviation, mean + deviation));
                let curve = points.map(|(x, mean, _)| (x, mean));
                let items = vec![
                    Item::Band { points: band.collect(), style: BAND },
                    Item::Curve { points: curve.collect(), style: MEAN },
                ];
                Panel { title: label, x: swept.axis(), y, items, equal: false }
            };
            let legend = vec![("mean at the end; band: one standard deviation".to_owned(), MEAN)];
            (columns.into_iter().map(panel).collect(), legend)
        }
        None if count <= MOST_NAMED => {
            let panel = |Column { label, y, mean, .. }: Column<'_>| {
                let of_cell = |own: usize| Item::Curve {
                    points: (own..time.len()).step_by(count).map(|row| (time[row], mean[row])).collect(),
                    style: Style::nth(own),
                };
                over_time(label, y, (0..count).map(of_cell).collect())
            };
            let labels = cell_labels(folder, count)?.into_iter().enumerate();
            let legend = labels.map(|(cell, label)| (label, Style::nth(cell))).collect();
            (columns.into_iter().map(panel).collect(), legend)
        }
        None => {
            let panel = |Column { label, y, mean, .. }: Column<'_>| {
                let (mut band, mut curve) = (Vec::new(), Vec::new());
                for (means, time) in mean.chunks(count).zip(time.iter().step_by(count)) {
                    // Without a mean are cells whose bodies all lack the quantity.
                    let known = || means.iter().copied().filter(|mean| mean.is_finite());
                    if known().next().is_none() {
                        continue;
                    }
                    let (least, most) = known().fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), mean| {
                        (least.min(mean), most.max(mean))
                    });
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
    Ok(Figure {
        title: titled(folder, "Means by cell")?,
        caption: caption(folder)?.into_iter().take(1).collect(),
        columns: 2,
        panels,
        legend,
    })
}
