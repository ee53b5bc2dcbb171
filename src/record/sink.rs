//! What receives the results of a run as they come.

use super::{EventRecord, Gathered, HistogramCounts, OfCell, OutputState, Statistics};
use crate::error::Result;
use crate::kernel::observe::Partial;

/// Receives the states of a run as they are computed, some bodies at a time, so that memory stays bounded. An error of any of its
/// functions ends the run.
pub trait Sink {
    /// Whether the sink wants output `index` of `count`, at `time` seconds; the last output is always computed.
    fn wants(&mut self, index: usize, count: usize, time: f64) -> bool;

    /// The states of the bodies from `first_body` on at output `index`. Called in the order of outputs and bodies.
    fn bodies(&mut self, index: usize, time: f64, first_body: usize, states: &[OutputState]) -> Result<()>;

    /// The same, for states that the sink may keep. The next ones are written into the vector that the sink leaves in their place, whatever
    /// it contains; a sink that leaves a vector it no longer needs saves the run an allocation. Runs call this method; its default passes
    /// the states to [`Sink::bodies`].
    fn take_bodies(&mut self, index: usize, time: f64, first_body: usize, states: &mut Vec<OutputState>) -> Result<()> {
        self.bodies(index, time, first_body, states)
    }

    /// The own state of sampled torques ([`crate::torque::SampledLaw`]) of the bodies whose states come next, if any act: by number, then
    /// by body; NaN for a body that has failed, and for one that was stopped the value at its stop. The default ignores it.
    fn own_state(&mut self, numbers: Vec<Vec<f64>>) -> Result<()> {
        let _ = numbers;
        Ok(())
    }

    /// The statistics of output `index`, if the scene asks for any ([`crate::Scene::statistics`]). Called in the order of
    /// outputs, for every one of them. The default ignores them.
    fn statistics(&mut self, index: usize, statistics: &Statistics) -> Result<()> {
        let _ = (index, statistics);
        Ok(())
    }

    /// The histograms of output `index`, in the order in which the scene asks for them; otherwise as [`Sink::statistics`].
    fn histograms(&mut self, index: usize, histograms: &[HistogramCounts]) -> Result<()> {
        let _ = (index, histograms);
        Ok(())
    }

    /// The statistics and the histograms of the bodies of each cell at output `index`, cell by cell, if the scene asks for them
    /// ([`crate::Scene::by_cell`]). Called after [`Sink::statistics`] and [`Sink::histograms`], for every output. The default ignores them.
    fn by_cell(&mut self, index: usize, cells: Vec<OfCell>) -> Result<()> {
        let _ = (index, cells);
        Ok(())
    }

    /// The events, in the order in which the scene asks for them, once at the end. The default ignores them.
    fn events(&mut self, events: Vec<EventRecord>) -> Result<()> {
        let _ = events;
        Ok(())
    }

    /// The statistics of each [block](crate::bodies::Blocks) of bodies at output `index`, at `time` seconds; those of all bodies are merged
    /// from them in this order. Extremes name bodies of the scene. Called before [`Sink::statistics`], if only kinetic energy, spin rate
    /// and angular momentum are asked for. The default ignores them.
    fn statistics_of_blocks(&mut self, index: usize, time: f64, blocks: &[Vec<Partial<f64>>]) -> Result<()> {
        let _ = (index, time, blocks);
        Ok(())
    }

    /// The data from which statistics, quantiles and histograms at output `index`, at `time` seconds, are computed, if they are computed
    /// from states that were read. The default ignores them.
    #[doc(hidden)]
    fn gathered(&mut self, index: usize, time: f64, gathered: Gathered) -> Result<()> {
        let _ = (index, time, gathered);
        Ok(())
    }
}
