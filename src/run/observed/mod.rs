//! Gathers statistics, quantiles, histograms and events from the bodies' states as a run reads them.

mod bracket;
mod comparison;
mod distribution;
mod evaluator;
mod events;
mod locate;
mod reference;
mod stops;
mod unnoticed;

use std::ops::Range;

use crate::bodies::Members;
use crate::engine::Observer;
use crate::engine::reduction::AskedOfBodies;
use crate::error::Result;
use crate::plan::Plan;
use crate::record::{EventRecord, FailedBody, OutputState, Sink};
use crate::run::group_run::GroupRun;
use crate::scene::{Observed, Quantity, is_of_state};

pub(super) use comparison::Comparison;
use distribution::Distributions;
pub(super) use evaluator::Evaluator;
use evaluator::Values;
pub(super) use events::CentreAt;
use events::EventWatch;
pub(super) use reference::{compare_events, recomputed as recomputed_observation};
pub(super) use stops::Stops;

/// Gathers the results that a scene asks for from the states of its bodies as they are read.
pub(super) struct Observation<'p> {
    observed: &'p Observed,
    evaluator: Evaluator<'p>,
    /// The values of the bodies that were pushed last, if an event may stop them.
    values: Option<Values>,
    distributions: Distributions<'p>,
    events: Option<EventWatch<'p>>,
}

/// The own state of bodies in some rows, by number.
fn cut<'o>(own: &'o [Vec<f64>], rows: &Range<usize>) -> Vec<&'o [f64]> {
    own.iter().map(|numbers| &numbers[rows.clone()]).collect()
}

/// The index of a quantity among all of a scene.
fn number(quantities: &[Quantity], quantity: &Quantity) -> usize {
    quantities.iter().position(|other| other == quantity).unwrap_or(0)
}

impl<'p> Observation<'p> {
    /// For all bodies of a plan's scene; `None` if it asks for nothing that requires reading the states.
    pub fn new(plan: &'p Plan<'p>) -> Result<Option<Self>> {
        let scene = plan.scene();
        if !scene.needs_states() {
            return Ok(None);
        }
        let bodies = scene.ensemble().len();
        let events = scene.wanted_events().len();
        let of_body =
            events::BYTES * events + if events > 0 { 56 } else { 0 } + if scene.stops() { stops::BYTES } else { 0 };
        crate::bodies::memory::require(bodies, bodies.saturating_mul(of_body), "what is kept of them for events")?;
        Self::of(plan, Members::All(bodies)).map(Some)
    }

    fn of(plan: &'p Plan<'p>, members: Members) -> Result<Self> {
        let scene = plan.scene();
        let quantities = scene.observed().quantities();
        let of_event = |event: &crate::scene::Event| number(&quantities, event.quantity());
        let of_events: Vec<usize> = scene.wanted_events().iter().map(of_event).collect();
        Ok(Self {
            observed: scene.observed(),
            distributions: Distributions::new(scene, |quantity| number(&quantities, quantity)),
            events: (!of_events.is_empty()).then(|| EventWatch::new(plan, members, of_events)),
            evaluator: Evaluator::new(scene, &quantities)?,
            values: None,
        })
    }

    /// Prepares to form everything where the states are, for a scene whose results devices can form
    /// ([`crate::Scene::forms_on_devices`]). `false` if a group cannot, so that the states must be read.
    pub fn watch(&self, group_runs: &mut [GroupRun<'_>]) -> Result<bool> {
        let (graph, outputs) = Quantity::expression(&self.observed.quantities())?;
        let mut constants = graph.inputs(&outputs);
        constants.retain(|&input| !is_of_state(input));
        let asked = AskedOfBodies {
            graph: &graph,
            outputs: &outputs,
            constants: &constants,
            statistics: self.observed.statistics.len(),
            histograms: &self.distributions.histograms(),
            constant: &|input, body| self.evaluator.constant(input, body),
        };
        for group_run in group_runs {
            if !group_run.watch_quantities(&asked)? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Takes the results formed where the states are, after [`Observation::watch`].
    pub fn gather(&mut self, group_runs: &mut [GroupRun<'_>]) -> Result<()> {
        group_runs.iter_mut().try_for_each(|group_run| {
            self.distributions.take_formed(group_run.gather()?);
            Ok(())
        })
    }

    /// Whether the states at the start are wanted.
    pub fn wants_start(&self) -> bool {
        self.events.is_some()
    }

    /// Whether the bodies' states must come with the own state of torques: if a quantity reads it, or if an event stops
    /// bodies, which then keep it.
    pub fn wants_own_state(&self) -> bool {
        self.evaluator.reads_own_state() || self.stops().is_some()
    }

    /// Takes the initial states of the bodies from `first_body` on, with the own state of all bodies.
    pub fn begin(&mut self, first_body: usize, (states, own): (&[OutputState], &[Vec<f64>]), centre: &CentreAt<'_>) {
        let rows = first_body..first_body + states.len();
        let own = cut(own, &rows);
        let values = self.evaluator.values(first_body, 0.0, states, &own);
        if let Some(events) = &mut self.events {
            events.begin(rows, (states, &own), &values, centre);
        }
    }

    /// Takes the values that sampled torques hold for the bodies, before these advance to the next output: searches for
    /// events begin there.
    pub fn take_controls(&mut self, group_runs: &[GroupRun<'_>]) {
        let Some(events) = &mut self.events else { return };
        if group_runs.iter().any(|group_run| group_run.controls().is_some()) {
            events.take_controls(group_runs.iter().map(|group_run| group_run.controls().cloned()).collect());
        }
    }

    /// The stopped bodies, if an event stops bodies.
    pub fn stops(&self) -> Option<&Stops> {
        self.events.as_ref().and_then(EventWatch::stops)
    }

    /// Takes the states at `time`, s, of the bodies from `first_body` on, with the own state of all bodies; only events are sought in those of
    /// a check. If an event stops bodies, [`Observation::stop`] must follow.
    pub fn push(&mut self, (first_body, is_check): (usize, bool), time: f64, states: &[OutputState], own: &[Vec<f64>]) {
        let rows = first_body..first_body + states.len();
        let own = cut(own, &rows);
        let values = self.evaluator.values(first_body, time, states, &own);
        if let Some(events) = &mut self.events {
            events.push(rows, time, (states, &own), &values);
        }
        match self.stops() {
            Some(_) => self.values = Some(values),
            None if is_check => {}
            None => self.distributions.push(first_body, &values),
        }
    }

    /// Stops bodies that have had a stopping event, among those from `first_body` on whose states at `time`, s, were
    /// pushed last: their states become those of the stop, and so does their own state. `centre` gives the centres of
    /// mass.
    pub fn stop(
        &mut self,
        (first_body, is_check, time): (usize, bool, f64),
        (states, own): (&mut [OutputState], &mut [Vec<f64>]),
        centre: &CentreAt<'_>,
        observer: &mut Observer<'_>,
    ) -> Result<()> {
        let (Some(events), Some(mut values)) = (&mut self.events, self.values.take()) else { return Ok(()) };
        let stopped = events.locate(&self.evaluator, centre, observer)?;
        events.stops().into_iter().for_each(|stops| stops.hold(first_body, states));
        if is_check {
            return Ok(());
        }
        // The others were evaluated as they were pushed.
        for body in stopped {
            let place = body - first_body;
            let held = events.stops().and_then(|stops| stops.own(body)).unwrap_or_default();
            own.iter_mut().zip(held).for_each(|(column, held)| column[body] = *held);
            let own = cut(own, &(body..body + 1));
            values.set(place, &self.evaluator.values(body, time, &states[place..=place], &own));
        }
        self.distributions.push(first_body, &values);
        Ok(())
    }

    /// Passes on the results of output `index`, at `time`, s.
    pub fn finish_output(
        &mut self,
        index: usize,
        time: f64,
        sink: &mut dyn Sink,
        observer: &mut Observer<'_>,
    ) -> Result<()> {
        let gathered = self.distributions.take();
        let (statistics, histograms) = gathered.summed(self.observed, time);
        let by_cell = gathered.summed_by_cell(self.observed, time);
        sink.gathered(index, time, gathered)?;
        if !self.observed.statistics.is_empty() {
            sink.statistics(index, &statistics)?;
        }
        if !self.observed.histograms.is_empty() {
            sink.histograms(index, &histograms)?;
        }
        if !by_cell.is_empty() {
            sink.by_cell(index, by_cell)?;
        }
        self.finish_check(time, observer)
    }

    /// Finds the times of the events that the pushed bodies have met at `time`, s.
    pub fn finish_check(&mut self, time: f64, observer: &mut Observer<'_>) -> Result<()> {
        if let Some(events) = &mut self.events {
            // If an event stops bodies, events were located block by block.
            events.locate(&self.evaluator, &|_, _| None, observer)?;
            events.finish_output(time);
        }
        Ok(())
    }

    /// The events that were found in a run with these failed bodies, ascending.
    pub fn finish(self, failures: &[FailedBody]) -> Vec<EventRecord> {
        self.events.map(|events| events.finish(failures)).unwrap_or_default()
    }
}
