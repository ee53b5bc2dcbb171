//! Maps of a study that sweeps over two axes: for each event the share of each cell that had it by the end and the mean time, and for each
//! quantity with statistics its mean at the end.

use std::path::Path;

use super::figure::{Figure, Item, Line, Panel, Style};
use super::means_by_cell;
use super::observed::{SURVIVAL, distinct, table};
use super::run;
use super::scale::extent;
use super::sweep::{self, CELLS, Swept};
use super::time::TimeUnit;
use crate::error::Result;
use crate::record;

/// The table of events by body.
const EVENTS: &str = "events";

/// Colours from the least to the greatest value, increasingly dark, so that they can be read in black and white too.
const SHADES: [[u8; 3]; 8] = [
    [253, 247, 222],
    [243, 222, 160],
    [228, 190, 122],
    [205, 150, 110],
    [171, 112, 112],
    [128, 80, 113],
    [82, 52, 104],
    [37, 26, 76],
];
/// The colour of a cell without data.
const NOTHING: [u8; 3] = [215, 228, 236];

/// Two panels for each event and one for each quantity, in the units of `unit`; `None` if the study does not sweep over a full grid of two axes.
pub(super) fn map(folder: &Path, unit: &dyn Fn(&str) -> Option<String>) -> Result<Option<Figure>> {
    let of_events = table(folder, SURVIVAL).zip(table(folder, EVENTS));
    let statistics = table(folder, means_by_cell::TABLE);
    let Some(cells) = table(folder, CELLS).filter(|_| of_events.is_some() || statistics.is_some()) else {
        return Ok(None);
    };
    let cells = record::read(&cells)?;
    let names: Vec<&str> = cells.names().filter(|name| sweep::is_axis(name)).collect();
    let [first, second] = names[..] else { return Ok(None) };
    let units = sweep::units(folder)?;
    let columns = [cells.need(first)?, cells.need(second)?];
    let [x, y] =
        [(first, &columns[0]), (second, &columns[1])].map(|(name, values)| Swept::new(name, units.get(name), values));
    let count = columns[0].len();
    if x.values.len() < 2 || y.values.len() < 2 || x.values.len() * y.values.len() != count {
        return Ok(None);
    }

    let panel = |title: String, part: &dyn Fn(usize) -> f64| {
        let bar = |index: usize| {
            let ((low_x, high_x), (low_y, high_y)) =
                (x.bar(x.place(columns[0][index])?), y.bar(y.place(columns[1][index])?));
            Some(Item::Bar { low: (low_x, low_y), high: (high_x, high_y), style: shade(part(index)) })
        };
        Panel { title, x: x.axis(), y: y.axis(), items: (0..count).filter_map(bar).collect(), equal: false }
    };
    let (mut panels, has_events) = (Vec::new(), of_events.is_some());
    if let Some((survival, events)) = of_events {
        let survival = record::read(&survival)?;
        let (names, cell) = (survival.words("event")?, survival.need("cell")?);
        let (times, share) = (survival.need("t")?, survival.need("share")?);
        let last = times.iter().copied().fold(0.0, f64::max);
        let events = record::read(&events)?;
        let (had, when, of_cell) = (events.words("event")?, events.need("t")?, events.need("cell")?);
        for name in distinct(&names) {
            let mut shares = vec![f64::NAN; count];
            for row in (0..names.len()).filter(|&row| names[row] == name && times[row] == last) {
                let place = shares.get_mut(cell[row] as usize);
                place.into_iter().for_each(|place| *place = 1.0 - share[row]);
            }
            panels.push(panel(format!("{name}: share by the end"), &|index| shares[index]));
            let mut sums = vec![(0.0, 0.0); count];
            for row in (0..had.len()).filter(|&row| had[row] == name) {
                let Some((sum, bodies)) = sums.get_mut(of_cell[row] as usize) else { continue };
                (*sum, *bodies) = (*sum + when[row], *bodies + 1.0);
            }
            let means: Vec<f64> = sums.iter().map(|(sum, bodies)| sum / bodies).collect();
            let scale = Scale::of(&means);
            let [least, greatest] = scale.ends.map(|time| TimeUnit::of(scale.ends[1]).text(time));
            let range = if scale.is_known() { format!(", {least} to {greatest}") } else { String::new() };
            panels.push(panel(format!("{name}: mean time of those{range}"), &|index| scale.part(means[index])));
        }
    }
    if let Some(path) = statistics {
        let rows = record::read(&path)?;
        for name in rows.names().filter_map(|name| name.strip_suffix("_mean")) {
            let means = rows.need(&format!("{name}_mean"))?;
            // Those of the last output time.
            let Some(means) = means.len().checked_sub(count).map(|first| &means[first..]) else { continue };
            let scale = Scale::of(means);
            let title = if scale.is_known() {
                let unit = unit(name).filter(|unit| unit != "1").map_or(String::new(), |unit| format!(" {unit}"));
                let [least, greatest] = scale.ends.map(|mean| sweep::short(mean, 4));
                format!("{}: mean at the end, {least} to {greatest}{unit}", name.replace('_', " "))
            } else {
                format!("{}: no body has a value at the end", name.replace('_', " "))
            };
            panels.push(panel(title, &|index| scale.part(means[index])));
        }
    }
    run::figure(folder, "Maps by cell", panels, 2, legend(has_events)).map(Some)
}

/// The colour of a fraction from 0 to 1.
fn shade(part: f64) -> Style {
    let index = ((part * SHADES.len() as f64) as usize).min(SHADES.len() - 1);
    let colour = if part.is_finite() { SHADES[index] } else { NOTHING };
    Style { colour, line: Line::Solid, mark: None, width: 1 }
}

/// The least and the greatest of some values, which have the first and the last shade.
struct Scale {
    ends: [f64; 2],
}

impl Scale {
    fn of(values: &[f64]) -> Self {
        Self { ends: extent(values.iter().copied().filter(|value| value.is_finite())).into() }
    }

    /// Whether there is any value.
    fn is_known(&self) -> bool {
        self.ends[0] <= self.ends[1]
    }

    /// The place of a value between the ends, from 0 to 1.
    fn part(&self, value: f64) -> f64 {
        let [least, greatest] = self.ends;
        // Where all are equal, none is less than the others.
        (value - least) / if greatest > least { greatest - least } else { 1.0 }
    }
}

/// What the shades mean: shares where there are events, and the range of means and times, whose ends are in the titles.
fn legend(has_events: bool) -> Vec<(String, Style)> {
    let wide = |(text, colour): (String, [u8; 3])| (text, Style { colour, line: Line::Solid, mark: None, width: 8 });
    let [first, .., last] = SHADES;
    let of_range = if has_events { "time or mean" } else { "mean" };
    let share = |(index, &colour): (usize, &[u8; 3])| {
        let part = |index: usize| 100.0 * index as f64 / SHADES.len() as f64;
        let also = match colour {
            _ if colour == first => format!("; the least {of_range}"),
            _ if colour == last => format!("; the greatest {of_range}"),
            _ => String::new(),
        };
        (format!("{} % to {} %{also}", part(index), part(index + 1)), colour)
    };
    let shades: Vec<_> = match has_events {
        true => SHADES.iter().enumerate().map(share).collect(),
        false => vec![(format!("the least {of_range}"), first), (format!("the greatest {of_range}"), last)],
    };
    let nothing = if has_events { "no body had it, or has a value" } else { "no body has a value" };
    shades.into_iter().chain([(nothing.to_owned(), NOTHING)]).map(wide).collect()
}
