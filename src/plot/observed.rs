//! Events and histograms of a run.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::figure::{Axis, BLUE, Figure, Item, Line, Panel, Style, VERMILION};
use super::run::{self, named};
use super::sweep::{MOST_NAMED, cell_labels};
use super::time::{TimeUnit, over_time};
use crate::error::Result;
use crate::record;
use crate::study::Format;

const SHARE: Style = Style { colour: BLUE, line: Line::Solid, mark: None, width: 2 };
const INTERVAL: Style = Style { colour: BLUE, line: Line::None, mark: None, width: 1 };
const FIRST: Style = Style { colour: VERMILION, line: Line::Dotted, mark: None, width: 2 };
const LAST: Style = SHARE;

/// The tables that are drawn.
pub(super) const SURVIVAL: &str = "survival";
pub(super) const HISTOGRAMS: &str = "histograms";

/// A table of a run, in whichever format it has.
pub(super) fn table(folder: &Path, stem: &str) -> Option<PathBuf> {
    let paths = Format::ALL.iter().map(|format| folder.join(format!("{stem}.{}", format.name())));
    paths.into_iter().find(|path| path.is_file())
}

/// Each word once, in the order of first occurrence.
pub(super) fn distinct<'t>(words: &[&'t str]) -> Vec<&'t str> {
    let mut found: Vec<&str> = Vec::new();
    for word in words {
        if !found.contains(word) {
            found.push(word);
        }
    }
    found
}

/// A panel for each event in the table at `path`, of the run in `folder`: the share of bodies that have not had it.
pub(super) fn survival(folder: &Path, path: &Path) -> Result<Figure> {
    let rows = record::read(path)?;
    let (events, times) = (rows.words("event")?, rows.need("t")?);
    let (shares, lows, highs) = (rows.need("share")?, rows.need("low")?, rows.need("high")?);
    let names = distinct(&events);
    let cells: Vec<usize> = rows.numbers("cell").unwrap_or_default().iter().map(|&cell| cell as usize).collect();
    let count = cells.iter().max().map_or(1, |last| last + 1);
    let mut rows_of: Vec<Vec<usize>> = vec![Vec::new(); count];
    (0..events.len()).for_each(|row| rows_of[cells.get(row).copied().unwrap_or(0)].push(row));
    let panel = |name: &&str| {
        let own = |cell: usize| rows_of[cell].iter().copied().filter(|&row| events[row] == *name);
        let curve = |cell: usize, style: Style| Item::Curve {
            points: steps(own(cell).map(|row| (times[row], shares[row]))),
            style,
        };
        let items = match count {
            1 => {
                let [low, high] = [&lows, &highs].map(|bound| steps(own(0).map(|row| (times[row], bound[row]))));
                let band = low.into_iter().zip(high).map(|((time, low), (_, high))| (time, low, high)).collect();
                vec![Item::Band { points: band, style: INTERVAL }, curve(0, SHARE)]
            }
            // Bands of several cells would hide each other.
            2..=MOST_NAMED => (0..count).map(|cell| curve(cell, Style::nth(cell))).collect(),
            _ => {
                let mut all: Vec<(f64, f64, f64, f64)> =
                    own(0).map(|row| (times[row], f64::INFINITY, f64::NEG_INFINITY, 0.0)).collect();
                for cell in 0..count {
                    for ((_, least, most, sum), row) in all.iter_mut().zip(own(cell)) {
                        let share = shares[row];
                        (*least, *most, *sum) = (least.min(share), most.max(share), *sum + share);
                    }
                }
                let band = all.iter().map(|&(time, least, most, _)| (time, least, most)).collect();
                let mean = all.iter().map(|&(time, .., sum)| (time, sum / count as f64)).collect();
                vec![Item::Band { points: band, style: INTERVAL }, Item::Curve { points: mean, style: SHARE }]
            }
        };
        let y = Axis { include: vec![0.0, 1.0], ..Axis::linear("share of bodies without it yet") };
        over_time((*name).to_owned(), y, items)
    };
    let legend = match count {
        1 => vec![("Kaplan-Meier estimate".to_owned(), SHARE), ("band: 95 % confidence interval".to_owned(), INTERVAL)],
        2..=MOST_NAMED => {
            let labels = cell_labels(folder, count)?;
            labels.into_iter().enumerate().map(|(cell, label)| (label, Style::nth(cell))).collect()
        }
        _ => vec![(format!("mean of {count} cells; band: the least and the greatest"), SHARE)],
    };
    run::figure(folder, "Events", names.iter().map(panel).collect(), names.len().clamp(1, 2), legend)
}

/// The corners of a function that keeps each value until the next time.
fn steps(points: impl Iterator<Item = (f64, f64)>) -> Vec<(f64, f64)> {
    let mut corners: Vec<(f64, f64)> = Vec::new();
    for (time, value) in points {
        corners.extend(corners.last().map(|&(_, before)| (time, before)));
        corners.push((time, value));
    }
    corners
}

/// A panel for each histogram in the table at `path`, of the run in `folder`, at the first and the last output time.
pub(super) fn histograms(folder: &Path, path: &Path, unit: &dyn Fn(&str) -> Option<String>) -> Result<Figure> {
    let rows = record::read(path)?;
    let (times, numbers, quantities) = (rows.need("t")?, rows.need("histogram")?, rows.words("quantity")?);
    let (lows, highs, counts) = (rows.need("low")?, rows.need("high")?, rows.need("count")?);
    let (first, last) = (times.first().copied().unwrap_or(0.0), times.last().copied().unwrap_or(0.0));
    let unit_of_time = TimeUnit::of(last);
    let mut panels: BTreeMap<u64, (&str, Vec<usize>)> = BTreeMap::new();
    for row in (0..times.len()).filter(|&row| lows[row].is_finite() && highs[row].is_finite()) {
        panels.entry(numbers[row] as u64).or_insert((quantities[row], Vec::new())).1.push(row);
    }
    let outside = |number: u64, time: f64| {
        let own = |&row: &usize| numbers[row] as u64 == number && times[row] == time;
        let is_outside = |row: &usize| lows[*row].is_infinite() || highs[*row].is_infinite();
        (0..times.len()).filter(own).filter(is_outside).map(|row| counts[row]).sum::<f64>()
    };
    let panel = |(&number, (quantity, rows)): (&u64, &(&str, Vec<usize>))| {
        let bars = |time: f64, style: Style| {
            let own: Vec<usize> = rows.iter().copied().filter(|&row| times[row] == time).collect();
            let corners = |&row: &usize| [(lows[row], counts[row]), (highs[row], counts[row])];
            Item::Curve { points: own.iter().flat_map(corners).collect(), style }
        };
        let is_logarithmic = match rows[..] {
            [a, b, ..] => lows[a] > 0.0 && (highs[a] - lows[a]) * 1.000_001 < highs[b] - lows[b],
            _ => false,
        };
        let label = quantity.replace('_', " ");
        let named = named(&label, unit(quantity));
        let x = if is_logarithmic { Axis::log(&named) } else { Axis::linear(&named) };
        let mut items = vec![bars(last, LAST)];
        if first < last {
            items.insert(0, bars(first, FIRST));
        }
        let y = Axis { include: vec![0.0], ..Axis::linear("bodies in a bin") };
        let title = match [outside(number, first), outside(number, last)] {
            [0.0, 0.0] => label,
            [_, at_end] if first == last => format!("{label}; {at_end} bodies outside"),
            [at_start, at_end] => format!("{label}; {at_start} and {at_end} bodies outside"),
        };
        Panel { title, x, y, items, equal: false }
    };
    let legend = [(first, FIRST), (last, LAST)];
    let legend = legend.map(|(time, style)| (format!("at {}", unit_of_time.text(time)), style)).into();
    let (columns, panels) = (panels.len().clamp(1, 2), panels.iter().map(panel).collect());
    run::figure(folder, "Distributions over all bodies", panels, columns, legend)
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_share_keeps_its_value_until_the_next_time() {
        let corners = super::steps([(0.0, 1.0), (2.0, 0.5), (3.0, 0.5)].into_iter());
        assert_eq!(corners, [(0.0, 1.0), (2.0, 1.0), (2.0, 0.5), (3.0, 0.5), (3.0, 0.5)]);
    }
}
