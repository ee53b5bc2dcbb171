//! Iterates over the outputs of a run, in memory.

use std::ops::ControlFlow;

use super::Run;
use crate::error::Result;
use crate::record::{HistogramCounts, OfCell, OutputState, Sink, Snapshot, Statistics};
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

/// The sink of one output time.
struct Taken {
    keeps_states: bool,
    states: Snapshot,
    statistics: Option<Statistics>,
    histograms: Vec<HistogramCounts>,
    by_cell: Vec<OfCell>,
}

impl Sink for Taken {
    fn wants(&mut self, _: usize, _: usize, _: f64) -> bool {
        self.keeps_states
    }

    fn bodies(&mut self, _: usize, _: f64, _: usize, states: &[OutputState]) -> Result<()> {
        self.states.extend(states);
        Ok(())
    }

    fn statistics(&mut self, _: usize, statistics: &Statistics) -> Result<()> {
        self.statistics = Some(statistics.clone());
        Ok(())
    }

    fn histograms(&mut self, _: usize, histograms: &[HistogramCounts]) -> Result<()> {
        self.histograms = histograms.to_vec();
        Ok(())
    }

    fn by_cell(&mut self, _: usize, cells: Vec<OfCell>) -> Result<()> {
        self.by_cell = cells;
        Ok(())
    }
}

impl Iterator for Run<'_> {
    type Item = Result<Output>;

    /// The next output; `None` after the last one and after an error.
    fn next(&mut self) -> Option<Self::Item> {
        let time = *self.plan.times().get(self.outputs).filter(|_| !self.has_failed)?;
        let scene = self.plan.scene();
        let keeps_states = scene.keeps_states();
        let bodies = if keeps_states { scene.ensemble().len() } else { 0 };
        let states = Snapshot::with_capacity(time, bodies);
        let mut taken = Taken { keeps_states, states, statistics: None, histograms: Vec::new(), by_cell: Vec::new() };
        let done = self.output_into(&mut taken, &mut |_| ControlFlow::Continue(()));
        let Taken { states, statistics, histograms, by_cell, .. } = taken;
        let own_state = named(&self.own_states, self.own_columns(time));
        Some(done.map(|()| Output { time, states, statistics, histograms, by_cell, own_state }))
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        let left = if self.has_failed { 0 } else { self.plan.times().len() - self.outputs };
        (left, Some(left))
    }
}
