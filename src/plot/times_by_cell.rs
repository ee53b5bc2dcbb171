//! Times by which parts of the bodies had an event, over the only axis of a study that sweeps.

use std::path::Path;

use super::figure::{Axis, BLUE, Figure, GREEN, Item, Line, Mark, Outline, Panel, Style};
use super::observed::distinct;
use super::run;
use super::sweep::only_axis;
use super::time::TimeUnit;
use crate::error::Result;
use crate::record;

const HALF: Style =
    Style { colour: BLUE, line: Line::Solid, mark: Some(Mark { outline: Outline::Circle, filled: true }), width: 1 };
const INTERVAL: Style = Style { colour: BLUE, line: Line::None, mark: None, width: 1 };
const TENTHS: Style = Style { colour: GREEN, line: Line::Dashed, mark: None, width: 1 };

/// The table that is drawn.
pub(super) const TABLE: &str = "times";

/// The fewest cells of which a line is drawn.
const FEWEST: usize = 3;

/// A panel for each event in the table at `path`, of the run in `folder`; `None` if the study has not one axis, of three values at least.
pub(super) fn times_by_cell(folder: &Path, path: &Path) -> Result<Option<Figure>> {
    let rows = record::read(path)?;
    let Some((swept, values)) = only_axis(folder)?.filter(|(_, values)| values.len() >= FEWEST) else {
        return Ok(None);
    };
    let (events, cells) = (rows.words("event")?, rows.need("cell")?);
    let column = |name: &str| rows.need(name);
    let [t10, t50, t90] = [column("t10")?, column("t50")?, column("t90")?];
    let [low, high] = [column("t50_low")?, column("t50_high")?];
    let names = distinct(&events);
    let panel = |name: &&str| {
        // The rows of the event, by the value of its cell.
        let is_own = |row: &usize| events[*row] == *name && (cells[*row] as usize) < values.len();
        let mut own: Vec<usize> = (0..events.len()).filter(is_own).collect();
        own.sort_by(|&a, &b| values[cells[a] as usize].total_cmp(&values[cells[b] as usize]));
        let value = |row: usize| values[cells[row] as usize];
        let known =
            |times: &[f64]| own.iter().map(|&row| times[row]).filter(|time| time.is_finite()).fold(0.0, f64::max);
        let unit = TimeUnit::of([&t10, &t50, &t90, &high].into_iter().map(|times| known(times)).fold(0.0, f64::max));
        let mut items = Vec::new();
        // Times that are not reached leave a gap.
        let runs = |times: &[f64]| -> Vec<Vec<usize>> {
            own.split(|&row| times[row].is_nan()).filter(|rows| !rows.is_empty()).map(<[usize]>::to_vec).collect()
        };
        for rows in runs(&t50) {
            let or_half = |bound: &[f64], row: usize| if bound[row].is_nan() { t50[row] } else { bound[row] };
            let band = |&row: &usize| (value(row), unit.number(or_half(&low, row)), unit.number(or_half(&high, row)));
            items.push(Item::Band { points: rows.iter().map(band).collect(), style: INTERVAL });
        }
        for (times, style) in [(&t10, TENTHS), (&t90, TENTHS), (&t50, HALF)] {
            for rows in runs(times) {
                let points = rows.iter().map(|&row| (value(row), unit.number(times[row]))).collect();
                items.push(Item::Curve { points, style });
            }
        }
        let y = Axis { include: vec![0.0], ..Axis::linear(&format!("time ({})", unit.name())) };
        Panel { title: (*name).to_owned(), x: swept.axis(), y, items, equal: false }
    };
    let legend = vec![
        ("when half of the bodies had it; band: 95 % confidence interval".to_owned(), HALF),
        ("when 10 % and 90 % had it".to_owned(), TENTHS),
    ];
    let panels = names.iter().map(panel).collect();
    run::figure(folder, "Times by cell", panels, names.len().clamp(1, 2), legend).map(Some)
}
