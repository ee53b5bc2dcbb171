//! The table `snapshots` of a run, reduced to what pictures need.
//!
//! The table is read once, from front to back, and only the states of one time are held: its size does not matter.

use std::path::Path;

use glam::{DQuat, DVec3};

use crate::error::RowFault;
use crate::error::{Error, Result};
use crate::record::{ROTATION_COLUMNS, StateRow, StateTable};

/// One row.
#[derive(Clone, Copy, Debug)]
pub(super) struct State {
    pub time: f64,
    pub orientation: DQuat,
    pub angular_velocity_body: DVec3,
    pub angular_momentum_world: DVec3,
    pub kinetic_energy: f64,
}

impl State {
    pub fn of(row: &StateRow) -> Self {
        let state = &row.state.rotation;
        Self {
            time: row.time,
            orientation: state.orientation,
            angular_velocity_body: state.angular_velocity_body,
            angular_momentum_world: state.angular_momentum_world,
            kinetic_energy: state.kinetic_energy,
        }
    }
}

/// Whether a table has all numbers that pictures need; also true for one that cannot be read, which is reported when it is drawn.
pub(super) fn is_complete(path: &Path) -> bool {
    let has_all = |table: StateTable| ROTATION_COLUMNS.iter().all(|name| table.columns().iter().any(|own| own == name));
    StateTable::open(path).map_or(true, has_all)
}

/// Number of rows read at once.
const BLOCK: usize = 1 << 14;

/// Passes every row of a table of states to `take`.
pub(super) fn each(table: &mut StateTable, mut take: impl FnMut(&StateRow)) -> Result<()> {
    let mut first = 0;
    loop {
        let rows = table.read(first, BLOCK)?;
        if rows.is_empty() {
            return Ok(());
        }
        rows.iter().for_each(&mut take);
        first += rows.len() as u64;
    }
}

/// The fractions of all bodies at or below the bands' edges: 5, 25, 50, 75 and 95 %.
pub(super) const PARTS: [f64; 5] = [0.05, 0.25, 0.5, 0.75, 0.95];

/// All bodies at one time.
#[derive(Clone, Debug)]
pub(super) struct Moment {
    pub time: f64,
    /// |T − T₀|/T₀: median, 99th percentile, maximum.
    pub energy_drift: [f64; 3],
    /// |L − L₀|/|L₀|: median, 99th percentile, maximum.
    pub momentum_drift: [f64; 3],
    /// Quantiles of the spin rate, rad/s, at [`PARTS`].
    pub spin: [f64; 5],
    /// Quantiles of T/T₀ − 1 of the rotational kinetic energy, at [`PARTS`].
    pub energy: [f64; 5],
}

/// A run's outputs.
#[derive(Clone, Debug, Default)]
pub(super) struct Snapshots {
    pub bodies: usize,
    pub moments: Vec<Moment>,
    /// Spin rates at the first and last time, rad/s.
    pub spins: [Vec<f64>; 2],
    /// The chosen bodies over time.
    pub tracks: Vec<(usize, Vec<State>)>,
}

/// The states of all bodies at one time, and at the first.
#[derive(Default)]
struct Gatherer {
    first: Vec<(f64, DVec3)>,
    now: Vec<State>,
}

impl Snapshots {
    /// Reads the table at `path`; follows the bodies in `chosen` over time.
    pub fn read(path: &Path, chosen: &[usize]) -> Result<Self> {
        let mut snapshots = Self { tracks: chosen.iter().map(|&body| (body, Vec::new())).collect(), ..Self::default() };
        let mut gatherer = Gatherer::default();
        each(&mut StateTable::open(path)?, |row| snapshots.add(&mut gatherer, State::of(row)))?;
        snapshots.take(&mut gatherer);
        if let Some(&(body, _)) = snapshots.tracks.iter().find(|(_, track)| track.is_empty()) {
            let path = path.to_owned();
            return Err(Error::Rows { path, fault: RowFault::NoBody { body, bodies: snapshots.bodies } });
        }
        Ok(snapshots)
    }

    /// The next row.
    fn add(&mut self, gatherer: &mut Gatherer, state: State) {
        if gatherer.now.last().is_some_and(|last| last.time != state.time) {
            self.take(gatherer);
        }
        let body = gatherer.now.len();
        gatherer.now.push(state);
        if let Some((_, track)) = self.tracks.iter_mut().find(|(chosen, _)| *chosen == body) {
            track.push(state);
        }
    }

    /// Reduces the states of one time.
    fn take(&mut self, gatherer: &mut Gatherer) {
        let states = std::mem::take(&mut gatherer.now);
        let Some(time) = states.first().map(|state| state.time) else { return };
        if gatherer.first.is_empty() {
            gatherer.first = states.iter().map(|state| (state.kinetic_energy, state.angular_momentum_world)).collect();
            self.bodies = states.len();
        }
        // A body at rest has no drift; a body whose numbers are NaN is left out.
        let relative = |change: f64, scale: f64| if scale == 0.0 && change == 0.0 { 0.0 } else { change / scale };
        let of_bodies = |value: &dyn Fn(&State, &(f64, DVec3)) -> f64| -> Vec<f64> {
            let mut values: Vec<f64> = states
                .iter()
                .zip(&gatherer.first)
                .map(|(state, first)| value(state, first))
                .filter(|value| value.is_finite())
                .collect();
            values.sort_by(f64::total_cmp);
            values
        };
        let energy_drift = of_bodies(&|state, first| relative((state.kinetic_energy - first.0).abs(), first.0));
        let momentum_drift =
            of_bodies(&|state, first| relative((state.angular_momentum_world - first.1).length(), first.1.length()));
        let spin = of_bodies(&|state, _| state.angular_velocity_body.length());
        let energy =
            of_bodies(&|state, first| if first.0 > 0.0 { state.kinetic_energy / first.0 - 1.0 } else { f64::NAN });
        self.moments.push(Moment {
            time,
            energy_drift: [0.5, 0.99, 1.0].map(|part| rank(&energy_drift, part)),
            momentum_drift: [0.5, 0.99, 1.0].map(|part| rank(&momentum_drift, part)),
            spin: PARTS.map(|part| rank(&spin, part)),
            energy: PARTS.map(|part| rank(&energy, part)),
        });
        self.spins[usize::from(self.moments.len() > 1)] = spin;
    }
}

/// The least of sorted values with at least `part` of all at or below it; NaN if there are none.
fn rank(sorted: &[f64], part: f64) -> f64 {
    let index = (part * sorted.len() as f64).ceil() as usize;
    sorted.get(index.max(1) - 1).copied().unwrap_or(f64::NAN)
}
