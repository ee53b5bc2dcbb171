//! What a run has left in its table `snapshots`, reduced to what pictures need.
//!
//! The table is read once, from front to back, and only the states at one time are held: its size does not matter.

use std::path::{Path, PathBuf};

use glam::{DQuat, DVec3};

use crate::error::RowFault;
use crate::error::{Error, Result};
use crate::record::{ROTATION_COLUMNS, StateTable};
use crate::study::Format;

/// One row.
#[derive(Clone, Copy, Debug)]
pub(super) struct State {
    pub time: f64,
    pub orientation: DQuat,
    pub angular_velocity_body: DVec3,
    pub angular_momentum_world: DVec3,
    pub kinetic_energy: f64,
}

/// Parts of all bodies at or below which the bands' edges lie: 5, 25, 50, 75 and 95 %.
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
    /// Reads the table in `folder`; follows the bodies in `chosen` through time.
    pub fn read(folder: &Path, chosen: &[usize]) -> Result<Self> {
        let Some(path) = table(folder) else { return Ok(Self::default()) };
        let mut table = StateTable::open(&path)?;
        if let Some(missing) = ROTATION_COLUMNS.iter().find(|name| !table.columns().iter().any(|own| own == *name)) {
            let fault = RowFault::Csv(format!("has no column {missing}: pictures need all of output.columns"));
            return Err(Error::Rows { path, fault });
        }
        let mut snapshots = Self { tracks: chosen.iter().map(|&body| (body, Vec::new())).collect(), ..Self::default() };
        let mut gatherer = Gatherer::default();
        let mut next = 0;
        loop {
            let rows = table.read(next, ROWS)?;
            if rows.is_empty() {
                break;
            }
            next += rows.len() as u64;
            for row in rows {
                // Numbers of a body that has failed are NaN, which is drawn nowhere.
                let rotation = row.state.rotation;
                let state = State {
                    time: row.time,
                    orientation: rotation.orientation,
                    angular_velocity_body: rotation.angular_velocity_body,
                    angular_momentum_world: rotation.angular_momentum_world,
                    kinetic_energy: rotation.kinetic_energy,
                };
                if gatherer.now.last().is_some_and(|last| last.time != state.time) {
                    snapshots.take(&mut gatherer);
                }
                let body = gatherer.now.len();
                gatherer.now.push(state);
                if let Some((_, track)) = snapshots.tracks.iter_mut().find(|(chosen, _)| *chosen == body) {
                    track.push(state);
                }
            }
        }
        snapshots.take(&mut gatherer);
        if let Some(&(body, _)) = snapshots.tracks.iter().find(|(_, track)| track.is_empty()) {
            return Err(Error::Rows { path, fault: RowFault::NoBody { body, bodies: snapshots.bodies } });
        }
        Ok(snapshots)
    }

    /// Reduces the states of one time.
    fn take(&mut self, gatherer: &mut Gatherer) {
        let states = std::mem::take(&mut gatherer.now);
        let Some(time) = states.first().map(|state| state.time) else { return };
        if gatherer.first.is_empty() {
            gatherer.first = states.iter().map(|state| (state.kinetic_energy, state.angular_momentum_world)).collect();
            self.bodies = states.len();
        }
        // A body at rest has no drift; one whose numbers are none is left out.
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

/// Rows that are read at once.
const ROWS: usize = 1 << 14;

/// The table of all output times in a folder, where there is one.
pub(super) fn table(folder: &Path) -> Option<PathBuf> {
    let paths = Format::ALL.iter().map(|format| folder.join(format!("snapshots.{}", format.name())));
    paths.into_iter().find(|path| path.exists())
}

/// The least of sorted values with at least `part` of all at or below it; NaN where there are none.
fn rank(sorted: &[f64], part: f64) -> f64 {
    let index = (part * sorted.len() as f64).ceil() as usize;
    sorted.get(index.max(1) - 1).copied().unwrap_or(f64::NAN)
}
