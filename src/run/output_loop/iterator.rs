//! Iterates over the outputs of a run, in memory.

use std::ops::ControlFlow;

use super::Run;
use crate::error::Result;
use crate::record::{HistogramCounts, Memory, OfCell, Snapshot, Statistics};
use crate::run::own_state::{OwnState, named};

/// The output of a run at an output time.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Output {
    /// The time, s.
    pub time: f64,
    /// The states of all bodies; empty if the scene keeps no states ([`crate::Scene::without_states`]).
    pub states: Snapshot,
    /// Statistics, if the scene asks for any.
    pub statistics: Option<Statistics>,
    /// Histograms, in the order in which the scene asks for them.
    pub histograms: Vec<HistogramCounts>,
    /// The same of the bodies of each cell, if the scene asks for them ([`crate::Scene::by_cell`]).
    pub by_cell: Vec<OfCell>,
    /// Numbers of the own state of sampled torques.
    pub own_state: Vec<OwnState>,
}

impl Iterator for Run<'_> {
    type Item = Result<Output>;

    /// The next output; `None` after the last one and after an error.
    fn next(&mut self) -> Option<Self::Item> {
        let time = *self.plan.times().get(self.outputs).filter(|_| !self.has_failed)?;
        let scene = self.plan.scene();
        let keeps_states = scene.keeps_states();
        let mut memory = Memory { keeps_states, body_count: scene.ensemble().len(), ..Memory::default() };
        let done = self.output_into(&mut memory, &mut |_| ControlFlow::Continue(()));
        Some(done.map(|()| Output {
            time,
            // None were passed on where none are kept, or without bodies.
            states: memory.snapshots.pop().unwrap_or_else(|| Snapshot::with_capacity(time, 0)),
            statistics: memory.statistics.pop(),
            histograms: memory.histograms.pop().unwrap_or_default(),
            by_cell: memory.by_cell.pop().unwrap_or_default(),
            own_state: named(self.plan.scene().torques(), &self.own_states, self.own_columns(time)),
        }))
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        let left = if self.has_failed { 0 } else { self.plan.times().len() - self.outputs };
        (left, Some(left))
    }
}
