//! Event times and quantities of a sample of bodies, recomputed more accurately.

use std::collections::BTreeMap;

use super::evaluator::Evaluator;
use super::unnoticed::FoundUnnoticed;
use super::{EventWatch, number};
use crate::bodies::{BodyState, Members};
use crate::engine::Observer;
use crate::engine::cpu::Cpu;
use crate::error::Result;
use crate::kernel::free_motion::SetUp;
use crate::kernel::method::Method;
use crate::math::{Precision, Width};
use crate::plan::own_state::{OwnOfBodies, OwnStates};
use crate::plan::statistical::SampleValues;
use crate::plan::{Group, Plan, Treatment};
use crate::record::{EventErrors, EventOccurrence, EventRecord, EventTime, OutputState, WallTime};
use crate::run::group_run::GroupRun;
use crate::scene::Event;
use crate::torque::Torque;

/// The recomputed results of a sample's bodies.
pub(in crate::run) struct Recomputed {
    /// Their events.
    pub events: Vec<EventRecord>,
    /// Their quantities at some output times, without event times.
    pub values: SampleValues,
    /// By place in the sample: whether it could not be followed.
    pub lost: Vec<bool>,
    /// The final states of bodies that no event has stopped, by body.
    pub states: BTreeMap<usize, BodyState>,
    /// By event: what a run does not notice.
    unnoticed: Vec<FoundUnnoticed>,
}

impl Recomputed {
    /// By event: the part of the span by which the times of a run's bodies, of which these are a sample, may be off on average because they are
    /// known to an output only, in either motion, or because events may have gone unnoticed.
    pub fn resolutions(&self, plan: &Plan<'_>, of_run: &[EventRecord], sample: &[u32]) -> Vec<f64> {
        let end = plan.scene().end();
        // The interval that ends at an output or check.
        let interval = |time: f64| {
            let times = plan.advance_times();
            let place = times.partition_point(|&other| other < time);
            time - if place > 0 { times[place - 1] } else { 0.0 }
        };
        let of_event = |((run, own), unnoticed): ((&EventRecord, &EventRecord), &FoundUnnoticed)| {
            let is_rough = |occurrence: &&EventOccurrence| {
                let is_sampled = sample.binary_search(&(occurrence.body as u32)).is_ok();
                occurrence.known_to == EventTime::Output && is_sampled
            };
            let rough = run.occurrences.iter().chain(&own.occurrences).filter(is_rough);
            let by_body: BTreeMap<usize, f64> =
                rough.map(|occurrence| (occurrence.body, interval(occurrence.time))).collect();
            let rough: f64 = by_body.values().sum();
            let rough = if rough > 0.0 { rough / (sample.len() as f64 * end) } else { 0.0 };
            rough + unnoticed.open
        };
        of_run.iter().zip(&self.events).zip(&self.unnoticed).map(of_event).collect()
    }
}

impl Recomputed {
    /// By body of the sample: from when on, s, it may be where the run does not have it, as one of the `events` that stop bodies has gone
    /// unnoticed, or may have; infinite for most. Empty if no event stops bodies.
    pub fn uncertain(&self, events: &[Event], sample: &[u32]) -> Vec<f64> {
        if !events.iter().any(Event::stops) {
            return Vec::new();
        }
        let mut from = vec![f64::INFINITY; sample.len()];
        for (_, found) in events.iter().zip(&self.unnoticed).filter(|(event, _)| event.stops()) {
            let missed = found.bodies.iter().map(|&body| (body, 0.0));
            for (body, since) in missed.chain(found.since.iter().copied()) {
                if let Ok(place) = sample.binary_search(&body) {
                    from[place] = since.min(from[place]);
                }
            }
        }
        from
    }
}

/// Writes the errors of event times into the events of a run of `end` seconds, by comparison with those of a sample of its bodies.
pub(in crate::run) fn compare_events(records: &mut [EventRecord], sample: &[u32], recomputed: &Recomputed, end: f64) {
    let references = recomputed.events.iter().zip(&recomputed.unnoticed);
    for (record, (reference, FoundUnnoticed { bodies: unnoticed, searched, .. })) in records.iter_mut().zip(references)
    {
        let by_body = |times: &mut dyn Iterator<Item = (usize, f64)>| {
            let is_own = |(body, _): &(usize, f64)| sample.binary_search(&(*body as u32)).is_ok();
            times.filter(is_own).collect::<BTreeMap<usize, f64>>()
        };
        let own = by_body(&mut record.occurrences.iter().map(|occurrence| (occurrence.body, occurrence.time)));
        let censored = by_body(&mut record.censored.iter().map(|censored| (censored.body, censored.time)));
        let (mut times, mut compared, mut missed) = (Vec::new(), 0, 0);
        for occurrence in &reference.occurrences {
            let own = own.get(&occurrence.body);
            // A body that the run has lost or stopped before could not have it.
            let is_left = censored.get(&occurrence.body).is_some_and(|&censored| censored <= occurrence.time);
            let is_later = own.is_none_or(|&own| own > occurrence.time) && !is_left;
            let is_missed = is_later && unnoticed.binary_search(&(occurrence.body as u32)).is_ok();
            compared += usize::from(own.is_some());
            missed += usize::from(is_missed);
            match own {
                Some(own) => times.push((own - occurrence.time).abs()),
                None if is_missed => times.push(end - occurrence.time),
                None => {}
            }
        }
        times.sort_by(f64::total_cmp);
        let differing = own.len() + reference.occurrences.len() - 2 * compared;
        let (bodies, unnoticed, searched) = (sample.len(), missed, *searched);
        record.errors = EventErrors { bodies, compared, differing, unnoticed, searched, times };
    }
}

/// The events of some bodies, as a run of them alone would find them, and their quantities at `outputs`: in closed form or in the steps
/// of [`Plan::recomputing_treatment`]. `None` if random torques act. Events that come and go between two outputs are found too
/// ([`super::unnoticed`]). Bodies that are not left, as the run has lost them, are not followed.
pub(in crate::run) fn recomputed(
    plan: &Plan<'_>,
    (sample, is_left): (&[u32], &dyn Fn(u32) -> bool),
    outputs: &[usize],
    observer: &mut Observer<'_>,
) -> Result<Option<Recomputed>> {
    let scene = plan.scene();
    if scene.torques().iter().any(Torque::is_random) {
        return Ok(None);
    }
    let own = |group: &Group| {
        let is_own = |&body: &u32| is_left(body) && !group.members.rows(body as usize..body as usize + 1).is_empty();
        let members: Vec<u32> = sample.iter().copied().filter(is_own).collect();
        let torques = group.class.torques.of(scene.torques());
        let treatment = match group.treatment {
            Treatment::RegularPrecession => group.treatment,
            Treatment::ClosedForm { .. } => closed_form(),
            _ if torques.is_empty() => closed_form(),
            _ => plan.recomputing_treatment(group, &torques),
        };
        let is_dense = treatment.method() == Some(Method::Taylor) && plan.may_be_dense(&torques);
        Group { members: Members::Some(members), treatment, is_dense, ..group.clone() }
    };
    let groups: Vec<Group> = plan.groups().iter().map(own).filter(|group| !group.members.is_empty()).collect();
    let quantities = scene.observed().quantities();
    let of_events: Vec<usize> =
        scene.wanted_events().iter().map(|event| number(&quantities, event.quantity())).collect();
    let has_events = !of_events.is_empty();
    let evaluator = Evaluator::new(scene, &quantities)?;
    let mut watch = EventWatch::of_sample(plan, sample, of_events);
    let engine = Cpu::new(Width::Lanes);
    let mut wall_time = WallTime::default();
    let start = |group| GroupRun::start(&engine, scene, group, false, &mut wall_time);
    let mut runs: Vec<GroupRun<'_>> = groups.iter().map(start).collect::<Result<_>>()?;
    // The bodies of a group are not adjacent, and events are searched body by body in the sample's order.
    let place = |body: usize| sample.partition_point(|&other| (other as usize) < body);
    // Events depend on the rotation alone, so no centre of mass is read.
    let nowhere = |_: usize, _: f64| None;
    let own_states = OwnStates::of(scene.torques());
    let own_at = |runs: &[GroupRun<'_>], time: f64| {
        let mut all = OwnOfBodies::default();
        let of = |(run, group): (&GroupRun<'_>, &Group)| own_states.of_all((group.class.torques, run.controls()), time);
        runs.iter().zip(&groups).map(of).for_each(|own| all.extend(own));
        all
    };
    let mut found = SampleValues::default();
    let mut lost = vec![false; sample.len()];
    let mut states = vec![OutputState::moving(BodyState::UNKNOWN, None); sample.len()];
    if has_events {
        let own = own_at(&runs, 0.0);
        for (run, group) in runs.iter().zip(&groups) {
            for (row, state) in initial_states(run, group).iter().enumerate() {
                let body = group.members.body(row);
                let (states, own) = (std::slice::from_ref(state), by_number(own.of(body)));
                let values = evaluator.values(body, 0.0, states, &own);
                watch.begin(place(body)..place(body) + 1, (states, &own), &values, &nowhere);
            }
        }
        watch.finish_output(0.0);
    }
    let mut last = 0.0;
    let mut done = 0;
    for (index, &time) in plan.advance_times().iter().enumerate() {
        let is_output = plan.is_output(index);
        let is_compared = is_output && outputs.binary_search(&done).is_ok();
        done += usize::from(is_output);
        // Without events there is nothing to search for between the compared outputs, but steps end at breaks.
        let is_read = has_events || is_compared || index + 1 == plan.advance_times().len();
        if !is_read && !plan.is_break(time) {
            continue;
        }
        let span = time - std::mem::replace(&mut last, time);
        if has_events {
            watch.take_controls(runs.iter().map(|run| run.controls().cloned()).collect());
        }
        for run in &mut runs {
            run.advance(time, span, is_read, observer)?;
        }
        if !is_read {
            continue;
        }
        for (run, group) in runs.iter_mut().zip(&groups) {
            for (row, state) in run.output_states(&|_| None)?.into_iter().enumerate() {
                states[place(group.members.body(row))] = state;
            }
        }
        let own = own_at(&runs, time);
        if has_events {
            watch.hold(&mut states);
            let columns = columns(&own, sample);
            let columns: Vec<&[f64]> = columns.iter().map(|column| &column[..]).collect();
            let values = evaluator.values_of(&|row| sample[row] as usize, time, &states, &columns);
            watch.push(0..sample.len(), time, (&states, &columns), &values);
            watch.locate(&evaluator, &nowhere, observer)?;
            watch.finish_output(time);
            watch.hold(&mut states);
        }
        lost.iter_mut().zip(&states).for_each(|(lost, state)| *lost |= !state.rotation.is_sound());
        if is_compared {
            let mut values = vec![vec![f64::NAN; sample.len()]; quantities.len()];
            for (quantity, values) in values.iter_mut().enumerate() {
                let sound = states.iter().enumerate().filter(|(_, state)| state.rotation.is_sound());
                for (row, state) in sound {
                    let body = sample[row] as usize;
                    let held = watch.stops().and_then(|stops| stops.own(row));
                    let own = held.unwrap_or_else(|| own.of(body));
                    values[row] = evaluator.value(quantity, body, state.time(time), (&state.rotation, own));
                }
            }
            found.times.push(time);
            found.values.push(values);
        }
    }
    let unnoticed = watch.take_unnoticed();
    let moving =
        sample.iter().zip(&states).filter(|(_, state)| state.rotation.is_sound() && state.stopped_at.is_none());
    let states = moving.map(|(&body, state)| (body as usize, state.rotation)).collect();
    Ok(Some(Recomputed { events: watch.finish(&[]), values: found, lost, states, unnoticed }))
}

/// The own state of a sample's bodies by number; NaN for bodies without.
fn columns(own: &OwnOfBodies, sample: &[u32]) -> Vec<Vec<f64>> {
    let of_all: Vec<&[f64]> = sample.iter().map(|&body| own.of(body as usize)).collect();
    let numbers = of_all.iter().map(|own| own.len()).max().unwrap_or(0);
    let column = |number: usize| of_all.iter().map(|own| own.get(number).copied().unwrap_or(f64::NAN)).collect();
    (0..numbers).map(column).collect()
}

/// The own state of one body as columns of one row.
fn by_number(own: &[f64]) -> Vec<&[f64]> {
    own.chunks(1).collect()
}

fn closed_form() -> Treatment {
    Treatment::ClosedForm { precision: Precision::F64, set_up: SetUp::TwoWords }
}

fn initial_states(run: &GroupRun<'_>, group: &Group) -> Vec<OutputState> {
    let state = |row: usize| {
        let body = group.members.body(row);
        let mut states = [BodyState::UNKNOWN];
        run.read_initial(&(body..body + 1), &mut states);
        OutputState::moving(states[0], None)
    };
    (0..group.members.len()).map(state).collect()
}
