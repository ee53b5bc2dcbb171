//! Values of a sample of a run's bodies, for comparison with those of more accurate motions.

use super::reference::Recomputed;
use super::stops::Stops;
use crate::bodies::BodyState;
use crate::error::Result;
use crate::plan::Plan;
use crate::plan::own_state::{OwnOfBodies, OwnStates};
use crate::plan::statistical::{SampleValues, compared_outputs, statistic_errors, worst_times};
use crate::plan::{SEED, Stratified, for_statistics};
use crate::record::{EventRecord, StatisticalSample};
use crate::run::group_run::GroupRun;
use crate::scene::{QuantityEvaluator, StatisticalAccuracy, StatisticalTarget};
use crate::torque::Torque;

/// One body in `ONE_IN` is compared, at least and at most these numbers, or all if there are fewer, as far as time allows: the scatter of
/// differences falls with the root of their number.
const ONE_IN: usize = 20;
const LEAST_BODIES: usize = 64;
const MOST_BODIES: usize = 1000;

/// Gathers the values of a sample's bodies in the course of a run.
pub(in crate::run) struct Comparison<'p> {
    plan: &'p Plan<'p>,
    wanted: StatisticalAccuracy,
    bodies: Vec<u32>,
    /// The indices of the outputs at which values are taken.
    outputs: Vec<usize>,
    evaluator: QuantityEvaluator<'p>,
    own_states: OwnStates,
    quantities: usize,
    values: SampleValues,
    /// By place in the sample: whether it has failed.
    lost: Vec<bool>,
}

impl<'p> Comparison<'p> {
    /// The comparison of a plan; `None` if it asks for no errors of statistics.
    pub fn new(plan: &'p Plan<'p>) -> Result<Option<Self>> {
        let scene = plan.scene();
        let Some(wanted) = scene.wanted_statistical_accuracy().filter(|_| plan.recomputes()) else { return Ok(None) };
        let count = scene.ensemble().len();
        let usual = (count / ONE_IN).clamp(LEAST_BODIES, MOST_BODIES);
        let wanted_bodies = scene.wanted_recomputed().unwrap_or_else(|| plan.compared_bodies(usual));
        let Stratified { bodies, weights } =
            for_statistics(scene, (count, &|body| body), wanted_bodies.min(count), SEED);
        let quantities = scene.observed().quantities();
        Ok(Some(Self {
            plan,
            wanted,
            lost: vec![false; bodies.len()],
            bodies,
            outputs: compared_outputs(plan.times().len()),
            evaluator: QuantityEvaluator::new(scene, &quantities)?,
            own_states: OwnStates::of(scene.torques()),
            quantities: quantities.len(),
            values: SampleValues { weights, ..SampleValues::default() },
        }))
    }

    /// The sample, ascending.
    pub fn bodies(&self) -> &[u32] {
        &self.bodies
    }

    /// The outputs at which values are compared.
    pub fn outputs(&self) -> &[usize] {
        &self.outputs
    }

    /// Takes the values at output `index`, at `time` s, if it is one of those compared.
    pub fn take(
        &mut self,
        index: usize,
        time: f64,
        group_runs: &mut [GroupRun<'_>],
        stops: Option<&Stops>,
    ) -> Result<()> {
        if self.outputs.binary_search(&index).is_err() {
            return Ok(());
        }
        let mut values = vec![vec![f64::NAN; self.bodies.len()]; self.quantities];
        let mut is_lost = vec![true; self.bodies.len()];
        for (group, group_run) in self.plan.groups().iter().zip(group_runs) {
            let own = match self.evaluator.reads_own_state() {
                true => self.own_states.of_all((group.class.torques, group_run.controls()), time),
                false => OwnOfBodies::default(),
            };
            for (body, state) in group_run.read_bodies(&self.bodies)? {
                let place = self.bodies.partition_point(|&other| (other as usize) < body);
                is_lost[place] = !state.is_sound();
                set_values(&self.evaluator, &mut values, place, (body, time), (&state, own.of(body)));
            }
        }
        for (place, &body) in self.bodies.iter().enumerate() {
            if let Some(state) = stops.and_then(|stops| stops.state(body as usize)) {
                is_lost[place] = false;
                let at = (body as usize, state.time(time));
                let own = stops.and_then(|stops| stops.own(body as usize)).unwrap_or_default();
                set_values(&self.evaluator, &mut values, place, at, (&state.rotation, own));
            }
        }
        self.lost.iter_mut().zip(is_lost).for_each(|(lost, is_lost)| *lost |= is_lost);
        self.values.times.push(time);
        self.values.values.push(values);
        Ok(())
    }

    /// Compares the run's results with the recomputed ones; `failed` of all its bodies have failed.
    pub fn finish(
        self,
        events: &[EventRecord],
        recomputed: Option<&Recomputed>,
        has_failed: impl Fn(usize) -> bool,
        failed: usize,
    ) -> StatisticalSample {
        let Self { plan, wanted, bodies, mut values, mut lost, .. } = self;
        let scene = plan.scene();
        lost.iter_mut().zip(&bodies).for_each(|(lost, &body)| *lost |= has_failed(body as usize));
        values.event_times = event_times(events, &bodies, &lost, scene.end());
        let random = scene.torques().iter().any(Torque::is_random);
        let all = scene.ensemble().len();
        let (mut errors, mut diverged) = (Vec::new(), 0);
        if let Some(recomputed) = recomputed {
            let Recomputed { events: reference, values: accurate, lost: not_recomputed, .. } = recomputed;
            let resolutions = recomputed.resolutions(plan, events, &bodies);
            let mut accurate = accurate.clone();
            accurate.event_times = event_times(reference, &bodies, not_recomputed, scene.end());
            values.uncertain = recomputed.uncertain(scene.wanted_events(), &bodies);
            errors = worst_times(statistic_errors(scene, &wanted, (&values, &accurate), (all, scene.end())));
            // A missed event is no scatter of the integration, however few bodies of the sample missed it.
            for error in errors.iter_mut().filter(|error| error.target == StatisticalTarget::EventTime) {
                let own = events.iter().zip(&resolutions).find(|(record, _)| record.event.name() == error.name);
                let (unnoticed, resolution) = own.map_or((0, 0.0), |(own, &rough)| (own.errors.unnoticed, rough));
                (error.unnoticed, error.resolution) = (unnoticed, resolution);
            }
            diverged = not_recomputed.iter().zip(&lost).filter(|(reference, own)| **reference && !**own).count();
        }
        let lost = lost.into_iter().filter(|lost| *lost).count();
        StatisticalSample::new(wanted, (bodies.len(), lost, diverged), (failed, all), random, errors)
    }
}

/// Sets the quantities of a body of the sample.
fn set_values(
    evaluator: &QuantityEvaluator<'_>,
    values: &mut [Vec<f64>],
    place: usize,
    (body, time): (usize, f64),
    (state, own): (&BodyState, &[f64]),
) {
    for (quantity, values) in values.iter_mut().enumerate() {
        values[place] = if state.is_sound() { evaluator.value(quantity, body, time, (state, own)) } else { f64::NAN };
    }
}

/// The time of each event of each of some bodies, s: the end if it did not occur, NaN if the body was lost.
fn event_times(events: &[EventRecord], bodies: &[u32], lost: &[bool], end: f64) -> Vec<Vec<f64>> {
    let of_event = |record: &EventRecord| {
        let mut times: Vec<f64> = lost.iter().map(|&lost| if lost { f64::NAN } else { end }).collect();
        for occurrence in &record.occurrences {
            if let Ok(place) = bodies.binary_search(&(occurrence.body as u32))
                && !lost[place]
            {
                times[place] = occurrence.time;
            }
        }
        times
    };
    events.iter().map(of_event).collect()
}
