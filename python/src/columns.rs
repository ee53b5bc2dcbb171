//! The states of a run, taken into columns as they come.

use glam::{DQuat, DVec3};
use numpy::Element;
use polhode::bodies::memory;
use polhode::record::{OutputState, Sink, Statistics};
use polhode::{Plan, Result};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;

use crate::arrays::{moved, moved_rows};

/// Takes states and statistics as they come. Each column is one piece of memory, which becomes an array as it is.
#[derive(Debug, Default)]
pub(crate) struct Columns {
    wanted: Wanted,
    bodies: usize,
    times: Vec<f64>,
    orientation: Vec<DQuat>,
    angular_velocity: Vec<DVec3>,
    angular_momentum: Vec<DVec3>,
    kinetic_energy: Vec<f64>,
    position: Vec<DVec3>,
    velocity: Vec<DVec3>,
    status: Vec<u8>,
    statistics: Vec<Statistics>,
}

/// Which states are kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Wanted {
    #[default]
    None,
    /// Those of the end.
    End,
    /// Those of all output times.
    All,
}

/// Bytes of one body at one output time: orientation, angular velocity, angular momentum, energy, status.
const ROW_BYTES: usize = 8 * (4 + 3 + 3 + 1) + 1;
/// Bytes of position and velocity.
const CENTRE_BYTES: usize = 8 * 6;
/// Bodies that one task takes.
const TASK: usize = 1 << 11;

impl Columns {
    /// Columns for the states of a plan's outputs.
    ///
    /// # Errors
    ///
    /// [`polhode::Error::TooManyBodies`] where the memory does not suffice.
    pub(crate) fn for_plan(plan: &Plan<'_>, wanted: Wanted) -> Result<Self> {
        let ensemble = plan.scene().ensemble();
        let bodies = ensemble.len();
        let outputs = match wanted {
            Wanted::None => 0,
            Wanted::End => 1,
            Wanted::All => plan.times().len(),
        };
        let rows = bodies.saturating_mul(outputs);
        let translates = ensemble.translation().is_some();
        let row_bytes = ROW_BYTES + if translates { CENTRE_BYTES } else { 0 };
        memory::require(bodies, rows.saturating_mul(row_bytes), "their states at all output times")?;
        let centres = if translates { rows } else { 0 };
        Ok(Self {
            wanted,
            bodies,
            orientation: Vec::with_capacity(rows),
            angular_velocity: Vec::with_capacity(rows),
            angular_momentum: Vec::with_capacity(rows),
            kinetic_energy: Vec::with_capacity(rows),
            position: Vec::with_capacity(centres),
            velocity: Vec::with_capacity(centres),
            status: Vec::with_capacity(rows),
            ..Self::default()
        })
    }

    /// The statistics of the end, where there are any.
    pub(crate) fn statistics_at_end(&self) -> Option<&Statistics> {
        self.statistics.last()
    }

    /// Arrays of shape `(outputs, bodies, …)`, and statistics of shape `(outputs,)`.
    pub(crate) fn into_arrays<'py>(self, py: Python<'py>, arrays: &Bound<'py, PyDict>) -> PyResult<()> {
        arrays.set_item("statistics", statistics(py, &self.statistics)?)?;
        let shape = [self.times.len(), self.bodies];
        arrays.set_item("times", moved(py, self.times, &shape[..1])?)?;
        if self.wanted == Wanted::None {
            return Ok(());
        }
        if !self.position.is_empty() {
            arrays.set_item("position", moved_rows(py, self.position, &shape)?)?;
            arrays.set_item("velocity", moved_rows(py, self.velocity, &shape)?)?;
        }
        arrays.set_item("orientation", moved_rows(py, self.orientation, &shape)?)?;
        arrays.set_item("angular_velocity", moved_rows(py, self.angular_velocity, &shape)?)?;
        arrays.set_item("angular_momentum", moved_rows(py, self.angular_momentum, &shape)?)?;
        arrays.set_item("kinetic_energy", moved(py, self.kinetic_energy, &shape)?)?;
        arrays.set_item("status", moved(py, self.status, &shape)?)
    }
}

impl Sink for Columns {
    fn wants(&mut self, index: usize, count: usize, time: f64) -> bool {
        let is_wanted = self.wanted == Wanted::All || (self.wanted == Wanted::End && index + 1 == count);
        if is_wanted {
            self.times.push(time);
        }
        is_wanted
    }

    fn bodies(&mut self, _: usize, _: f64, _: usize, states: &[OutputState]) -> Result<()> {
        let rows = || states.par_iter().with_min_len(TASK);
        let rotations = || rows().map(|state| &state.rotation);
        let Self { orientation, angular_velocity, angular_momentum, kinetic_energy, status, .. } = self;
        rayon::join(
            || {
                orientation.par_extend(rotations().map(|state| state.orientation));
                kinetic_energy.par_extend(rotations().map(|state| state.kinetic_energy));
                status.par_extend(rows().map(|state| state.status().number()));
            },
            || {
                angular_velocity.par_extend(rotations().map(|state| state.angular_velocity_body));
                angular_momentum.par_extend(rotations().map(|state| state.angular_momentum_world));
            },
        );
        // All bodies of an ensemble translate, or none.
        let centres = || states.iter().filter_map(|state| state.translation);
        self.position.extend(centres().map(|(position, _)| position));
        self.velocity.extend(centres().map(|(_, velocity)| velocity));
        Ok(())
    }

    fn statistics(&mut self, _: usize, statistics: &Statistics) -> Result<()> {
        self.statistics.push(statistics.clone());
        Ok(())
    }
}

/// Of each quantity its figures over the output times.
fn statistics<'py>(py: Python<'py>, found: &[Statistics]) -> PyResult<Option<Bound<'py, PyDict>>> {
    let Some(first) = found.first() else { return Ok(None) };
    fn column<'py, T: Element>(py: Python<'py>, numbers: impl Iterator<Item = T>) -> PyResult<Bound<'py, PyAny>> {
        let numbers: Vec<T> = numbers.collect();
        let shape = [numbers.len()];
        moved(py, numbers, &shape)
    }
    let body = |body: Option<usize>| body.map_or(-1, |body| body as i64);
    let all = PyDict::new(py);
    all.set_item("time", column(py, found.iter().map(|at| at.time))?)?;
    all.set_item("count", column(py, found.iter().map(|at| at.count as i64))?)?;
    let quantities = PyDict::new(py);
    for (place, summary) in first.summaries.iter().enumerate() {
        let over_time = || found.iter().map(|at| &at.summaries[place]);
        let figures = PyDict::new(py);
        figures.set_item("unit", summary.quantity.unit())?;
        figures.set_item("mean", column(py, over_time().map(|of| of.mean))?)?;
        figures.set_item("standard_deviation", column(py, over_time().map(|of| of.standard_deviation))?)?;
        figures.set_item("min", column(py, over_time().map(|of| of.min))?)?;
        figures.set_item("max", column(py, over_time().map(|of| of.max))?)?;
        figures.set_item("min_body", column(py, over_time().map(|of| body(of.min_body)))?)?;
        figures.set_item("max_body", column(py, over_time().map(|of| body(of.max_body)))?)?;
        quantities.set_item(summary.quantity.name(), figures)?;
    }
    all.set_item("quantities", quantities)?;
    Ok(Some(all))
}
