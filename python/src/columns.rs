//! The states of a run, taken into columns as they come.

use glam::{DQuat, DVec3};
use polhode::bodies::memory;
use polhode::record::{EventRecord, HistogramCounts, OutputState, Sink, Statistics};
use polhode::scene::Histogram;
use polhode::{Plan, Result};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;

use crate::arrays::{moved, moved_rows};
use crate::observed;

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
    /// Empty where no event stops bodies.
    stopped_at: Vec<f64>,
    stops: bool,
    statistics: Vec<Statistics>,
    /// In percent, as they were asked for.
    quantiles: Vec<f64>,
    asked_histograms: Vec<Histogram>,
    /// By output.
    histograms: Vec<Vec<HistogramCounts>>,
    events: Vec<EventRecord>,
    /// Of all outputs, s.
    output_times: Vec<f64>,
    /// Cells of the study's design, where it has one.
    cells: Option<usize>,
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
    pub(crate) fn for_plan(plan: &Plan<'_>, wanted: Wanted, cells: Option<usize>) -> Result<Self> {
        let ensemble = plan.scene().ensemble();
        let bodies = ensemble.len();
        let outputs = match wanted {
            Wanted::None => 0,
            Wanted::End => 1,
            Wanted::All => plan.times().len(),
        };
        let rows = bodies.saturating_mul(outputs);
        let translates = ensemble.translation().is_some();
        let of_stops = if plan.scene().stops() { size_of::<f64>() } else { 0 };
        let row_bytes = ROW_BYTES + of_stops + if translates { CENTRE_BYTES } else { 0 };
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
            stops: plan.scene().stops(),
            quantiles: plan.scene().wanted_quantiles().to_vec(),
            asked_histograms: plan.scene().wanted_histograms().to_vec(),
            output_times: plan.times().to_vec(),
            cells,
            ..Self::default()
        })
    }

    /// The events.
    pub(crate) fn events(&self) -> &[EventRecord] {
        &self.events
    }

    /// The statistics of each output time, where there are any.
    pub(crate) fn statistics(&self) -> &[Statistics] {
        &self.statistics
    }

    /// Arrays of shape `(outputs, bodies, …)`, and statistics of shape `(outputs,)`.
    pub(crate) fn into_arrays<'py>(self, py: Python<'py>, arrays: &Bound<'py, PyDict>) -> PyResult<()> {
        arrays.set_item("statistics", observed::statistics(py, &self.statistics, &self.quantiles)?)?;
        arrays.set_item("histograms", observed::histograms(py, &self.asked_histograms, &self.histograms)?)?;
        arrays.set_item("events", observed::events(py, &self.events, &self.output_times, self.cells)?)?;
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
        if self.stops {
            arrays.set_item("stopped_at", moved(py, self.stopped_at, &shape)?)?;
        }
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
        if self.stops {
            self.stopped_at.par_extend(rows().map(|state| state.stopped_at.unwrap_or(f64::NAN)));
        }
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

    fn histograms(&mut self, _: usize, histograms: &[HistogramCounts]) -> Result<()> {
        self.histograms.push(histograms.to_vec());
        Ok(())
    }

    fn events(&mut self, events: Vec<EventRecord>) -> Result<()> {
        self.events = events;
        Ok(())
    }
}
