//! The axes of a study that sweeps, and the values that belong to its cells.

use std::collections::BTreeMap;
use std::path::Path;

use super::observed::table;
use super::run::report;
use crate::error::Result;
use crate::record;

/// The table of the axes' values by cell.
pub(super) const CELLS: &str = "cells";

/// The units of a sweep's axes, from the report.
pub(super) fn units(folder: &Path) -> Result<BTreeMap<String, String>> {
    let report = report(folder)?;
    let text = |value: &serde_json::Value| value.as_str().map(str::to_owned);
    let axes = report["study"]["sweep"].as_array().into_iter().flatten();
    Ok(axes.filter_map(|axis| text(&axis["name"]).zip(text(&axis["unit"]))).collect())
}

/// Whether a column of the table of cells belongs to an axis.
pub(super) fn is_axis(column: &str) -> bool {
    !["cell", "bodies"].contains(&column)
}

/// What distinguishes each of `count` cells: the values of the axes or, without their table, the number.
pub(super) fn cell_labels(folder: &Path, count: usize) -> Result<Vec<String>> {
    let mut labels = vec![String::new(); count];
    if let Some(path) = table(folder, CELLS) {
        let (cells, units) = (record::read(&path)?, units(folder)?);
        for name in cells.names().filter(|name| is_axis(name)) {
            let unit = units.get(name).map_or(String::new(), |unit| format!(" {unit}"));
            let numbers = cells.numbers(name);
            let number = |row: usize| numbers.as_ref().and_then(|all| all.get(row)).map(|value| format!("{value}"));
            let text = |row: usize| cells.texts(name).and_then(|all| all.get(row)).cloned();
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
