//! What is asked of bodies beside their states, and what comes of it: statistics with quantiles, histograms, events.

use glam::DVec3;
use numpy::Element;
use polhode::record::{EventRecord, HistogramCounts, Statistics, Survival};
use polhode::scene::{Condition, Event, Histogram};
use polhode::{Quantity, Scene};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::arrays::{moved, moved_rows};
use crate::errors;

/// A quantity as Python has it: by its name alone, by a formula, or by an axis and a direction.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct AskedQuantity {
    name: String,
    unit: Option<String>,
    formula: Option<String>,
    axis: Option<[f64; 3]>,
    direction: Option<[f64; 3]>,
}

impl AskedQuantity {
    /// `place` says where it stands, for messages.
    fn quantity(&self, py: Python<'_>, place: &str) -> PyResult<Quantity> {
        let Self { name, unit, formula, axis, direction } = self;
        if let Some(text) = formula {
            let unit = unit.as_deref().unwrap_or("1");
            return Quantity::formula(name, unit, text).map_err(|error| errors::of_formula(py, &error));
        }
        if let (Some(axis), Some(direction)) = (axis, direction) {
            let found = Quantity::axis_angle(name, DVec3::from_array(*axis), DVec3::from_array(*direction));
            return found.map_err(|error| errors::of_library(py, &error));
        }
        Quantity::NAMED.iter().find(|quantity| quantity.name() == name).cloned().ok_or_else(|| {
            let known: Vec<&str> = Quantity::NAMED.iter().map(Quantity::name).collect();
            errors::input(py, format!("{place}: {name:?}: expected {}, or a polhode.Quantity", known.join(", ")))
        })
    }
}

/// A histogram as Python has it.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct AskedHistogram {
    quantity: AskedQuantity,
    low: f64,
    high: f64,
    bins: usize,
    logarithmic: bool,
}

/// An event as Python has it.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct AskedEvent {
    name: String,
    quantity: AskedQuantity,
    condition: String,
    level: f64,
    occurrence: u32,
    action: String,
}

/// All of it.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Asked {
    statistics: Vec<AskedQuantity>,
    quantiles: Vec<f64>,
    histograms: Vec<AskedHistogram>,
    events: Vec<AskedEvent>,
}

impl Asked {
    pub(crate) fn applied_to(&self, py: Python<'_>, scene: Scene) -> PyResult<Scene> {
        let of_library = |error: polhode::Error| errors::of_library(py, &error);
        let statistics =
            self.statistics.iter().map(|asked| asked.quantity(py, "statistics")).collect::<PyResult<Vec<_>>>()?;
        let mut scene = scene.statistics(statistics).quantiles(&self.quantiles).map_err(of_library)?;
        for AskedHistogram { quantity, low, high, bins, logarithmic } in &self.histograms {
            let quantity = quantity.quantity(py, "quantity of a histogram")?;
            let made = match logarithmic {
                true => Histogram::logarithmic(quantity, *low, *high, *bins),
                false => Histogram::linear(quantity, *low, *high, *bins),
            };
            scene = scene.histogram(made.map_err(of_library)?);
        }
        for AskedEvent { name, quantity, condition, level, occurrence, action } in &self.events {
            let Some(condition) = Condition::ALL.iter().find(|known| known.name() == condition) else {
                return Err(errors::input(py, format!("event {name:?}: unknown condition {condition:?}")));
            };
            let quantity = quantity.quantity(py, &format!("quantity of the event {name:?}"))?;
            let event = Event::new(name, quantity, condition.with_level(*level));
            let event = event.and_then(|event| event.occurrence(*occurrence)).map_err(of_library)?;
            scene = scene.event(if action == "stop" { event.stopping() } else { event });
        }
        Ok(scene)
    }
}

fn column<'py, T: Element>(py: Python<'py>, numbers: impl Iterator<Item = T>) -> PyResult<Bound<'py, PyAny>> {
    let numbers: Vec<T> = numbers.collect();
    let shape = [numbers.len()];
    moved(py, numbers, &shape)
}

/// Of each quantity its figures over the output times; `quantiles` in percent, as they were asked for.
pub(crate) fn statistics<'py>(
    py: Python<'py>,
    found: &[Statistics],
    quantiles: &[f64],
) -> PyResult<Option<Bound<'py, PyDict>>> {
    let Some(first) = found.first() else { return Ok(None) };
    let body = |body: Option<usize>| body.map_or(-1, |body| body as i64);
    let all = PyDict::new(py);
    all.set_item("time", column(py, found.iter().map(|at| at.time))?)?;
    all.set_item("count", column(py, found.iter().map(|at| at.count as i64))?)?;
    let quantities = PyDict::new(py);
    for (place, summary) in first.summaries.iter().enumerate() {
        let over_time = || found.iter().map(|at| &at.summaries[place]);
        let figures = PyDict::new(py);
        figures.set_item("unit", summary.quantity.unit())?;
        figures.set_item("_may_be_undefined", summary.quantity.may_be_undefined())?;
        figures.set_item("count", column(py, over_time().map(|of| of.count as i64))?)?;
        figures.set_item("mean", column(py, over_time().map(|of| of.mean))?)?;
        figures.set_item("standard_deviation", column(py, over_time().map(|of| of.standard_deviation))?)?;
        figures.set_item("min", column(py, over_time().map(|of| of.min))?)?;
        figures.set_item("max", column(py, over_time().map(|of| of.max))?)?;
        figures.set_item("min_body", column(py, over_time().map(|of| body(of.min_body)))?)?;
        figures.set_item("max_body", column(py, over_time().map(|of| body(of.max_body)))?)?;
        let by_percent = PyDict::new(py);
        for (place, percent) in quantiles.iter().enumerate() {
            by_percent.set_item(percent, column(py, over_time().map(|of| of.quantiles[place]))?)?;
        }
        figures.set_item("quantiles", by_percent)?;
        quantities.set_item(summary.quantity.name(), figures)?;
    }
    all.set_item("quantities", quantities)?;
    Ok(Some(all))
}

/// Each histogram with its counts over the output times: `counts` has a row an output.
pub(crate) fn histograms<'py>(
    py: Python<'py>,
    asked: &[Histogram],
    counts: &[Vec<HistogramCounts>],
) -> PyResult<Bound<'py, PyList>> {
    let all = PyList::empty(py);
    for (place, histogram) in asked.iter().enumerate() {
        let over_time = || counts.iter().map(|at| &at[place]);
        let bins: Vec<i64> = over_time().flat_map(|at| at.bins().iter().map(|&count| count as i64)).collect();
        let found = PyDict::new(py);
        found.set_item("quantity", histogram.quantity().name())?;
        found.set_item("unit", histogram.quantity().unit())?;
        found.set_item("edges", column(py, histogram.edges().iter().copied())?)?;
        found.set_item("times", column(py, over_time().map(|at| at.time))?)?;
        found.set_item("counts", moved(py, bins, &[counts.len(), histogram.bins()])?)?;
        found.set_item("below", column(py, over_time().map(|at| at.below() as i64))?)?;
        found.set_item("above", column(py, over_time().map(|at| at.above() as i64))?)?;
        all.append(found)?;
    }
    Ok(all)
}

/// Each event with who had it, and the shares that have not at the start and at the output times; these cell by cell where a study sweeps.
pub(crate) fn events<'py>(
    py: Python<'py>,
    records: &[EventRecord],
    times: &[f64],
    cells: Option<usize>,
) -> PyResult<Bound<'py, PyList>> {
    let with_start: Vec<f64> = [0.0].into_iter().chain(times.iter().copied().filter(|&time| time > 0.0)).collect();
    let all = PyList::empty(py);
    for record in records {
        let (had, event) = (&record.occurrences, &record.event);
        let censored = |stopped: bool| record.censored.iter().filter(move |of| of.stopped == stopped);
        let found = PyDict::new(py);
        found.set_item("event", event.name())?;
        found.set_item("quantity", event.quantity().name())?;
        found.set_item("unit", event.quantity().unit())?;
        found.set_item("condition", event.condition().name())?;
        found.set_item("level", event.condition().level())?;
        found.set_item("occurrence", event.nth())?;
        found.set_item("action", event.action())?;
        found.set_item("bodies", record.bodies)?;
        found.set_item("body", column(py, had.iter().map(|of| of.body as i64))?)?;
        found.set_item("time", column(py, had.iter().map(|of| of.time))?)?;
        found.set_item("known_to", had.iter().map(|of| of.known_to.name()).collect::<Vec<_>>())?;
        found.set_item("orientation", moved_rows(py, had.iter().map(|of| of.orientation).collect(), &[had.len()])?)?;
        let rates = had.iter().map(|of| of.angular_velocity_body).collect();
        found.set_item("angular_velocity_body", moved_rows(py, rates, &[had.len()])?)?;
        found.set_item("failed_body", column(py, censored(false).map(|of| of.body as i64))?)?;
        found.set_item("failed_time", column(py, censored(false).map(|of| of.time))?)?;
        found.set_item("stopped_body", column(py, censored(true).map(|of| of.body as i64))?)?;
        found.set_item("stopped_time", column(py, censored(true).map(|of| of.time))?)?;
        found.set_item("median", record.median())?;
        let of_cells: Vec<Vec<Survival>> = match cells {
            Some(cells) => record.by_cell(cells).map(|own| own.survival(&with_start)).collect(),
            None => vec![record.survival(&with_start)],
        };
        let of_cell = |(cell, rows): (usize, Vec<Survival>)| rows.into_iter().map(move |row| (row, cell));
        let rows: Vec<(Survival, usize)> = of_cells.into_iter().enumerate().flat_map(of_cell).collect();
        let survival = PyDict::new(py);
        survival.set_item("t", column(py, rows.iter().map(|(row, _)| row.time))?)?;
        survival.set_item("remaining", column(py, rows.iter().map(|(row, _)| row.remaining as i64))?)?;
        survival.set_item("share", column(py, rows.iter().map(|(row, _)| row.share))?)?;
        survival.set_item("low", column(py, rows.iter().map(|(row, _)| row.low))?)?;
        survival.set_item("high", column(py, rows.iter().map(|(row, _)| row.high))?)?;
        if cells.is_some() {
            survival.set_item("cell", column(py, rows.iter().map(|(_, cell)| *cell as i64))?)?;
        }
        found.set_item("survival", survival)?;
        all.append(found)?;
    }
    Ok(all)
}
