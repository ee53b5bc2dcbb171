//! The axes of a study that sweeps, and the values that belong to its cells.

use std::collections::BTreeMap;
use std::path::Path;

use super::figure::Axis;
use super::observed::table;
use super::run::{named, report};
use crate::error::Result;
use crate::record;

/// The table of the axes' values by cell.
pub(super) const CELLS: &str = "cells";

/// The most cells that a legend names.
pub(super) const MOST_NAMED: usize = 12;

/// The units of a sweep's axes, from the report.
pub(super) fn units(folder: &Path) -> Result<BTreeMap<String, String>> {
    let report = report(folder)?;
    let text = |value: &serde_json::Value| value.as_str().map(str::to_owned);
    let axes = report["study"]["sweep"].as_array().into_iter().flatten();
    Ok(axes.filter_map(|axis| text(&axis["name"]).zip(text(&axis["unit"]))).collect())
}

/// A number to so many digits, at most.
pub(super) fn short(value: f64, digits: usize) -> String {
    let rounded = format!("{value:.*e}", digits - 1).parse().unwrap_or(value);
    let is_plain = rounded == 0.0 || (1e-4..1e7).contains(&rounded.abs());
    if is_plain { format!("{rounded}") } else { format!("{rounded:e}") }
}

/// The only axis of a sweep that has one axis, of numbers, with its value in each cell.
pub(super) fn only_axis(folder: &Path) -> Result<Option<(Swept, Vec<f64>)>> {
    let Some(path) = table(folder, CELLS) else { return Ok(None) };
    let cells = record::read(&path)?;
    let names: Vec<&str> = cells.names().filter(|name| is_axis(name)).collect();
    let [name] = names[..] else { return Ok(None) };
    let values = cells.need(name)?;
    if values.iter().any(|value| value.is_nan()) {
        return Ok(None);
    }
    Ok(Some((Swept::new(name, units(folder)?.get(name), &values), values)))
}

/// Whether a column of the table of cells belongs to an axis.
pub(super) fn is_axis(column: &str) -> bool {
    !["cell", "bodies"].contains(&column)
}

/// The least ratio of the greatest value to the least for which an axis may be logarithmic.
const LEAST_RATIO: f64 = 10.0;

/// One axis of the sweep.
pub(super) struct Swept {
    label: String,
    /// In ascending order, each once.
    pub values: Vec<f64>,
    is_logarithmic: bool,
}

impl Swept {
    pub fn new(name: &str, unit: Option<&String>, cells: &[f64]) -> Self {
        let mut values = cells.to_vec();
        values.sort_by(f64::total_cmp);
        values.dedup();
        let label = named(&name.replace('_', " "), unit);
        // Equal ratios instead of equal differences, over a range in which these differ.
        let are_ratios = |[a, b, y, z]: [f64; 4]| {
            let (first, last) = ((b / a).ln(), (z / y).ln());
            a > 0.0 && z > LEAST_RATIO * a && (first - last).abs() / last < (b - a - (z - y)).abs() / (z - y)
        };
        let is_logarithmic = match values[..] {
            // Of three, the one in the middle belongs to both pairs.
            [a, b, z] => are_ratios([a, b, b, z]),
            [a, b, .., y, z] => are_ratios([a, b, y, z]),
            _ => false,
        };
        Self { label, values, is_logarithmic }
    }

    pub fn axis(&self) -> Axis {
        if self.is_logarithmic { Axis::log(&self.label) } else { Axis::linear(&self.label) }
    }

    pub fn place(&self, value: f64) -> Option<usize> {
        self.values.iter().position(|other| *other == value)
    }

    /// The extent of the bar of the `place`-th value: half-way to its neighbours.
    pub fn bar(&self, place: usize) -> (f64, f64) {
        let scaled = |place: usize| if self.is_logarithmic { self.values[place].ln() } else { self.values[place] };
        let last = self.values.len() - 1;
        let here = scaled(place);
        let below = if place > 0 { here - scaled(place - 1) } else { scaled(1) - here };
        let above = if place < last { scaled(place + 1) - here } else { here - scaled(place - 1) };
        let back = |scaled: f64| if self.is_logarithmic { scaled.exp() } else { scaled };
        (back(here - below / 2.0), back(here + above / 2.0))
    }
}

/// What distinguishes each of `count` cells: the values of the axes or, without their table, the number.
pub(super) fn cell_labels(folder: &Path, count: usize) -> Result<Vec<String>> {
    let mut labels = vec![String::new(); count];
    if let Some(path) = table(folder, CELLS) {
        let (cells, units) = (record::read(&path)?, units(folder)?);
        for name in cells.names().filter(|name| is_axis(name)) {
            let unit = units.get(name).map_or(String::new(), |unit| format!(" {unit}"));
            let numbers = cells.numbers(name);
            let number = |row: usize| {
                numbers.as_ref()?.get(row).copied().filter(|value| !value.is_nan()).map(|value| short(value, 6))
            };
            let text = |row: usize| cells.texts(name)?.get(row).cloned();
            for (row, label) in labels.iter_mut().enumerate() {
                let Some(value) = number(row).or_else(|| text(row)) else { continue };
                let separator = if label.is_empty() { "" } else { ", " };
                *label = format!("{label}{separator}{} = {value}{unit}", name.replace('_', " "));
            }
        }
    }
    labels.iter_mut().enumerate().filter(|(_, label)| label.is_empty()).for_each(|(cell, label)| {
        *label = format!("cell {cell}");
    });
    Ok(labels)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_axes_have_six_digits_at_most() {
        for (value, text) in [
            (0.0, "0"),
            (0.1 + 2e-17, "0.1"),
            (0.316_227_766_016_838, "0.316228"),
            (-1.234_567_89, "-1.23457"),
            (5.341e-50, "5.341e-50"),
            (3.986_004_418e14, "3.986e14"),
            (3.0, "3"),
        ] {
            assert_eq!(short(value, 6), text);
        }
    }
}
