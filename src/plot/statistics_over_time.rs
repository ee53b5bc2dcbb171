//! Statistics of a run's ensemble over time.

use std::path::Path;

use super::figure::{Axis, BLUE, Figure, GREEN, Item, Line, Panel, Style};
use super::run::{self, named};
use super::time::over_time;
use crate::error::Result;
use crate::record;

const SPREAD: Style = Style { colour: BLUE, line: Line::None, mark: None, width: 1 };
const EXTREME: Style = Style { colour: BLUE, line: Line::Dotted, mark: None, width: 1 };
const MEAN: Style = Style { colour: BLUE, line: Line::Solid, mark: None, width: 2 };
const QUANTILE: Style = Style { colour: GREEN, line: Line::Dashed, mark: None, width: 1 };

/// The table that is drawn.
pub(super) const TABLE: &str = "statistics";

/// A panel for each quantity in the table at `path`, of the run in `folder`; `unit` gives their units.
pub(super) fn statistics(folder: &Path, path: &Path, unit: &dyn Fn(&str) -> Option<String>) -> Result<Figure> {
    let rows = record::read(path)?;
    let time = rows.need("t")?;
    let quantiles = quantiles_in(rows.names());
    let panel = |quantity: &str| -> Option<Panel> {
        let of = |figure: &str| rows.numbers(&format!("{quantity}_{figure}"));
        let (mean, deviation, min, max) = (of("mean")?, of("standard_deviation")?, of("min")?, of("max")?);
        let curve = |values: &[f64], style| Item::Curve {
            points: time.iter().copied().zip(values.iter().copied()).collect(),
            style,
        };
        let spread = time.iter().zip(mean.iter().zip(&*deviation));
        let spread = spread.map(|(&time, (mean, deviation))| (time, mean - deviation, mean + deviation)).collect();
        let mut items = vec![Item::Band { points: spread, style: SPREAD }, curve(&min, EXTREME), curve(&max, EXTREME)];
        let quantiles = rows.names().filter(|name| quantile_of(name) == Some(quantity));
        items.extend(quantiles.filter_map(|name| Some(curve(&rows.numbers(name)?, QUANTILE))));
        items.push(curve(&mean, MEAN));
        let label = quantity.replace('_', " ");
        let y = Axis::linear(&named(&label, unit(quantity)));
        Some(over_time(label, y, items))
    };
    let panels: Vec<Panel> = rows.names().filter_map(|name| panel(name.strip_suffix("_mean")?)).collect();
    let mut legend =
        vec![("mean; band: one standard deviation".to_owned(), MEAN), ("least and greatest".to_owned(), EXTREME)];
    legend.extend(quantiles.map(|quantiles| (quantiles, QUANTILE)));
    run::figure(folder, "Statistics over all bodies", panels, 2, legend)
}

/// A panel for each mean in the table at `path`, at its own scale, with its standard error.
pub(super) fn means(folder: &Path, path: &Path, unit: &dyn Fn(&str) -> Option<String>) -> Result<Figure> {
    let rows = record::read(path)?;
    let (time, count) = (rows.need("t")?, rows.need("count")?);
    let panel = |quantity: &str| -> Option<Panel> {
        let of = |figure: &str| rows.numbers(&format!("{quantity}_{figure}"));
        let (mean, deviation) = (of("mean")?, of("standard_deviation")?);
        // Of the bodies that have the quantity, where some may not.
        let own = of("count");
        let bodies = own.as_deref().unwrap_or(&count);
        let error = |row: usize| deviation[row] / bodies[row].sqrt();
        let band = (0..time.len()).map(|row| (time[row], mean[row] - error(row), mean[row] + error(row))).collect();
        let curve = time.iter().copied().zip(mean.iter().copied()).collect();
        let items = vec![Item::Band { points: band, style: SPREAD }, Item::Curve { points: curve, style: MEAN }];
        let label = quantity.replace('_', " ");
        let y = Axis::linear(&named(&label, unit(quantity)));
        Some(over_time(label, y, items))
    };
    let panels = rows.names().filter_map(|name| panel(name.strip_suffix("_mean")?)).collect();
    run::figure(folder, "Means over all bodies", panels, 2, vec![("mean; band: its standard error".to_owned(), MEAN)])
}

/// The quantity of which a column has a quantile.
pub(super) fn quantile_of(column: &str) -> Option<&str> {
    quantile(column).map(|(quantity, _)| quantity)
}

/// The quantity of which a column has a quantile, and which, in percent.
fn quantile(column: &str) -> Option<(&str, f64)> {
    let (quantity, figure) = column.rsplit_once('_')?;
    Some((quantity, figure.strip_prefix('q')?.parse().ok()?))
}

/// The quantiles among some columns, in words; `None` if there are none.
pub(super) fn quantiles_in<'n>(columns: impl Iterator<Item = &'n str>) -> Option<String> {
    let mut percents: Vec<f64> = columns.filter_map(|name| Some(quantile(name)?.1)).collect();
    percents.sort_by(f64::total_cmp);
    percents.dedup();
    let named: Vec<String> = percents.iter().map(f64::to_string).collect();
    (!named.is_empty()).then(|| format!("quantiles: {} %", named.join(", ")))
}
