//! The bodies that an event has stopped, with their states.

use crate::bodies::{BodyState, Status};
use crate::record::OutputState;

/// The place of a body that is not stopped.
const MOVING: u32 = u32::MAX;

/// Bodies that an event has stopped, by their rows among those watched.
#[derive(Debug, Default)]
pub(in crate::run) struct Stops {
    /// By row: the place in `states`.
    places: Vec<u32>,
    states: Vec<OutputState>,
    /// By place: the own state of the torques.
    own: Vec<Vec<f64>>,
}

/// The most bytes that are kept for a body.
pub(super) const BYTES: usize = size_of::<u32>() + size_of::<OutputState>();

impl Stops {
    /// For `bodies` bodies, none of them stopped.
    pub fn new(bodies: usize) -> Self {
        Self { places: vec![MOVING; bodies], ..Self::default() }
    }

    /// Number of stopped bodies.
    pub fn count(&self) -> usize {
        self.states.len()
    }

    /// The state of a stopped body.
    pub fn state(&self, row: usize) -> Option<&OutputState> {
        self.states.get(*self.places.get(row)? as usize)
    }

    /// Whether a body is stopped.
    pub fn stands(&self, row: usize) -> bool {
        self.state(row).is_some()
    }

    /// The own state of the torques on a stopped body.
    pub fn own(&self, row: usize) -> Option<&[f64]> {
        self.own.get(*self.places.get(row)? as usize).map(Vec::as_slice)
    }

    /// Stops a body in a state of `time`, s, with the own state of its torques.
    pub fn stop(&mut self, row: usize, time: f64, (state, own): (OutputState, Vec<f64>)) {
        self.places[row] = self.states.len() as u32;
        let rotation = BodyState { status: Status::Stopped, ..state.rotation };
        self.states.push(OutputState { rotation, stopped_at: Some(time), ..state });
        self.own.push(own);
    }

    /// Writes the own state of all stopped bodies to their places, by number and row.
    pub fn hold_own(&self, columns: &mut [Vec<f64>]) {
        if self.states.is_empty() {
            return;
        }
        for (number, column) in columns.iter_mut().enumerate() {
            for (place, value) in self.places.iter().zip(column) {
                if let Some(held) = self.own.get(*place as usize).and_then(|own| own.get(number)) {
                    *value = *held;
                }
            }
        }
    }

    /// Writes the states of the stopped bodies from `first` on to their places.
    pub fn hold(&self, first: usize, states: &mut [OutputState]) {
        if self.states.is_empty() {
            return;
        }
        for (place, state) in self.places[first..].iter().zip(states) {
            if let Some(held) = self.states.get(*place as usize) {
                *state = *held;
            }
        }
    }
}
