//! Finds the events of bodies from output to output.

use std::collections::BTreeMap;
use std::ops::Range;

use glam::{DQuat, DVec3};

use super::evaluator::{BLOCK, Evaluator, Values};
use super::locate::{Located, Locator, Passage, Unseen, may_come_nearer, may_pass};
use super::stops::Stops;
use super::unnoticed::{FoundUnnoticed, Unnoticed};
use crate::bodies::{BodyState, Members};
use crate::engine::Observer;
use crate::engine::controlled::Controls;
use crate::error::Result;
use crate::math::parallel;
use crate::plan::Plan;
use crate::record::{Censored, EventErrors, EventOccurrence, EventRecord, EventTime, FailedBody, KnownTo, OutputState};
use crate::scene::Event;

/// The progress of a body towards an event.
#[derive(Clone, Copy, Debug, Default)]
struct Track {
    /// How much more than its share the search for what goes unnoticed has taken ([`Unnoticed::part`]).
    lead: f64,
    /// Whether it was last beyond the level; `None` if its quantity has had no value yet, or at the start is the level.
    side: Option<bool>,
    /// Whether it starts on the level: which way it leaves shows when it is followed.
    starts_on_level: bool,
    /// The last distance from the level, and its last change: negative if it has come nearer; NaN if there is none yet.
    distance: f64,
    change: f64,
    /// The ends, s, of the first interval in which the quantity may have passed the level and come back while nobody looked, and of the last one, of
    /// which that shows by where it goes from there; 0 if there is none.
    open: f64,
    pending: f64,
    /// Whether the search has ended: the body has had the event, has failed, or was stopped.
    closed: bool,
    /// How often the condition was met.
    count: u32,
}

/// Bytes that are kept of a body for each event.
pub(super) const BYTES: usize = size_of::<Track>();

/// The start of a search: the attitude and angular momentum of a body at the output before.
#[derive(Clone, Copy, Debug)]
pub(super) struct Start {
    pub orientation: DQuat,
    pub angular_momentum_world: DVec3,
}

/// Looks for a scene's events among some of its bodies.
pub(super) struct EventWatch<'p> {
    events: &'p [Event],
    /// The indices of their quantities.
    quantities: Vec<usize>,
    members: Members,
    /// By event, then by member.
    tracks: Vec<Vec<Track>>,
    /// By member, at the last output.
    starts: Vec<Start>,
    time: f64,
    /// The time, s, of the states that were pushed last.
    pushed: f64,
    occurrences: Vec<Vec<EventOccurrence>>,
    censored: Vec<Vec<Censored>>,
    passages: Vec<Passage>,
    locator: Locator<'p>,
    /// The stopped bodies, if an event stops bodies.
    stops: Option<Stops>,
    /// If the members are a sample: what a run does not notice of them.
    unnoticed: Option<Unnoticed>,
}

/// Position (m) and velocity (m/s) of a body at a time, s, if it translates.
pub(in crate::run) type CentreAt<'a> = dyn Fn(usize, f64) -> Option<(DVec3, DVec3)> + 'a;

impl<'p> EventWatch<'p> {
    /// For these members of a plan's scene.
    pub fn new(plan: &'p Plan<'p>, members: Members, quantities: Vec<usize>) -> Self {
        let events = plan.scene().wanted_events();
        let start = Start { orientation: DQuat::NAN, angular_momentum_world: DVec3::NAN };
        Self {
            stops: events.iter().any(Event::stops).then(|| Stops::new(members.len())),
            tracks: vec![vec![Track::default(); members.len()]; events.len()],
            starts: vec![start; members.len()],
            time: 0.0,
            pushed: 0.0,
            occurrences: vec![Vec::new(); events.len()],
            censored: vec![Vec::new(); events.len()],
            passages: Vec::new(),
            locator: Locator::new(plan),
            unnoticed: None,
            events,
            quantities,
            members,
        }
    }

    /// The same for a sample of bodies, which are followed between all outputs, whether or not a quantity has changed sides.
    pub fn of_sample(plan: &'p Plan<'p>, sample: &[u32], quantities: Vec<usize>) -> Self {
        let unnoticed = Some(Unnoticed::new(plan, sample.len()));
        Self { unnoticed, ..Self::new(plan, Members::Some(sample.to_vec()), quantities) }
    }

    /// What a search for unnoticed events has found in a sample, by event.
    pub fn take_unnoticed(&mut self) -> Vec<FoundUnnoticed> {
        let mut found = self.unnoticed.take().map(Unnoticed::finish).unwrap_or_default();
        for (index, (found, tracks)) in found.iter_mut().zip(&self.tracks).enumerate() {
            let ends = self.occurrences[index].iter().map(|occurrence| (occurrence.body, occurrence.time));
            let ends = ends.chain(self.censored[index].iter().map(|censored| (censored.body, censored.time)));
            let ends: BTreeMap<usize, f64> = ends.collect();
            let mut left = 0.0;
            for (row, track) in tracks.iter().enumerate() {
                let (body, since) = (self.members.body(row), if track.open > 0.0 { track.open } else { track.pending });
                let until = ends.get(&body).copied().unwrap_or(self.time);
                if since > 0.0 && until > since {
                    left += until - since;
                    found.since.push((body as u32, since));
                }
            }
            found.open = if left > 0.0 { left / (tracks.len() as f64 * self.time) } else { 0.0 };
        }
        found
    }

    /// Takes the values that sampled torques hold for the bodies of each group, before they advance to the next output.
    pub fn take_controls(&mut self, controls: Vec<Option<Controls>>) {
        self.locator.take_controls(controls);
    }

    /// The stopped bodies, if an event stops bodies.
    pub fn stops(&self) -> Option<&Stops> {
        self.stops.as_ref()
    }

    /// Takes the initial states of the members in some rows, with their own state, and the values of all quantities.
    pub fn begin(
        &mut self,
        rows: Range<usize>,
        (states, own): (&[OutputState], &[&[f64]]),
        values: &Values,
        centre: &CentreAt<'_>,
    ) {
        let mut stopped = Vec::new();
        for (index, event) in self.events.iter().enumerate() {
            let condition = event.condition();
            for (first, values) in values.of(self.quantities[index]) {
                for (row, value) in values.iter().enumerate() {
                    let place = first + row;
                    let track = &mut self.tracks[index][rows.start + place];
                    let excess = value - condition.level();
                    (track.side, track.distance, track.change) =
                        (condition.side_at_start(excess), excess.abs(), f64::NAN);
                    track.starts_on_level = track.side.is_none() && !excess.is_nan();
                    if track.side.is_some_and(|side| condition.is_met_at_start(side)) {
                        track.count = 1;
                        if event.nth() == 1 {
                            track.closed = true;
                            let body = self.members.body(rows.start + place);
                            let state = &states[place].rotation;
                            self.occurrences[index].push(occurrence(body, 0.0, EventTime::Start, state));
                            if event.stops() {
                                stopped.push(place);
                            }
                        }
                    }
                }
            }
        }
        for place in stopped {
            let body = self.members.body(rows.start + place);
            let state = OutputState::moving(states[place].rotation, centre(body, 0.0));
            self.stop(rows.start + place, 0.0, (state, own_of_row(own, place)));
        }
        self.keep(&rows, states);
    }

    /// Takes the states at `time`, s, of the members in some rows, with their own state, and the values of all quantities.
    pub fn push(&mut self, rows: Range<usize>, time: f64, (states, own): (&[OutputState], &[&[f64]]), values: &Values) {
        let (members, starts, span) = (&self.members, &self.starts, self.time..time);
        let (unnoticed, locator) = (self.unnoticed.as_ref(), &self.locator);
        for (index, event) in self.events.iter().enumerate() {
            let condition = event.condition();
            let blocks: Vec<(usize, &[f64])> = values.of(self.quantities[index]).collect();
            let tracks = &mut self.tracks[index][rows.clone()];
            let of_block = |(tracks, (first, values)): (&mut [Track], &(usize, &[f64]))| {
                let mut passages = Vec::new();
                for (row, (track, &value)) in tracks.iter_mut().zip(*values).enumerate() {
                    if track.closed {
                        continue;
                    }
                    let (place, state) = (first + row, &states[first + row].rotation);
                    let Track { side: before, starts_on_level, distance: last, change: last_change, count, .. } =
                        *track;
                    let passage = |span: Range<f64>, is_followed: bool| Passage {
                        event: index,
                        row: rows.start + place,
                        body: members.body(rows.start + place),
                        start: starts[rows.start + place],
                        span,
                        left: event.nth() - count,
                        end: *state,
                        end_own: own_of_row(own, place),
                        side: before,
                        is_followed,
                        starts_on_level,
                        fails: false,
                        unseen: Unseen::None,
                    };
                    // A body that has failed has no value either.
                    if value.is_nan() && !state.is_sound() {
                        passages.push(Passage { fails: true, ..passage(span.clone(), false) });
                        continue;
                    }
                    // A body without a value, as one at rest has no dynamic moment of inertia, stays on its side.
                    let excess = value - condition.level();
                    let side = match starts_on_level {
                        true => condition.side_at_start(excess),
                        false => condition.side(excess).or(before),
                    };
                    track.starts_on_level = starts_on_level && side.is_none();
                    track.distance = excess.abs();
                    track.change = if before == side { track.distance - last } else { -(last + track.distance) };
                    // Where it comes nearer after an interval, it had not turned back within.
                    let pending = std::mem::take(&mut track.pending);
                    let comes_nearer = track.change < 0.0;
                    if track.open == 0.0 && !comes_nearer {
                        track.open = pending;
                    }
                    if condition.is_met_between(before, side) {
                        passages.push(passage(span.clone(), true));
                    } else if starts_on_level {
                        passages.push(passage(span.clone(), false));
                    } else if let Some(unnoticed) = unnoticed {
                        // To be beyond the level in between, it would have to change faster than it does here and did before.
                        let change = last_change.abs().max(track.change.abs());
                        let may_pass =
                            before != side || may_pass((last, track.distance), change) && may_come_nearer(last_change);
                        let rate = state.angular_velocity_body.length();
                        let part = unnoticed.part(&span, rate, may_pass && !value.is_nan(), &mut track.lead);
                        let is_followed = locator.follows(members.body(rows.start + place));
                        let is_searched = is_followed && part.as_ref().is_some_and(|part| unnoticed.ends(part, &span));
                        if !value.is_nan() && may_pass && !is_searched && span.end > span.start {
                            track.pending = span.end;
                        }
                        passages.extend(part.map(|part| passage(part, false)));
                    }
                    track.side = side;
                }
                passages
            };
            let found = parallel::map_tasks(tracks.chunks_mut(BLOCK).zip(&blocks), |_, block| of_block(block));
            self.passages.extend(found.into_iter().flatten());
        }
        self.pushed = time;
        self.keep(&rows, states);
    }

    fn keep(&mut self, rows: &Range<usize>, states: &[OutputState]) {
        parallel::for_each_mut(&mut self.starts[rows.clone()], BLOCK, |row, start| {
            let BodyState { orientation, angular_momentum_world, .. } = states[row].rotation;
            *start = Start { orientation, angular_momentum_world };
        });
    }

    /// Finds the times of the events that the pushed members have met since the last output, stops those members that
    /// an event stops, and returns their rows.
    pub fn locate(
        &mut self,
        evaluator: &Evaluator<'_>,
        centre: &CentreAt<'_>,
        observer: &mut Observer<'_>,
    ) -> Result<Vec<usize>> {
        let passages = std::mem::take(&mut self.passages);
        let located = self.locator.located(passages, &self.quantities, evaluator, observer)?;
        // For each stopped row the earliest stop; of two at the same time, either.
        let mut stopped: BTreeMap<usize, (f64, BodyState, Vec<f64>)> = BTreeMap::new();
        for (passage, located) in &located {
            if let Located::At { time, state, own, .. } = located
                && self.events[passage.event].stops()
                && stopped.get(&passage.row).is_none_or(|earliest| *time < earliest.0)
            {
                stopped.insert(passage.row, (*time, *state, own.clone()));
            }
        }
        let interval = self.time..self.pushed;
        let alike = self.locator.alike();
        for (passage, located) in located {
            let track = &mut self.tracks[passage.event][passage.row];
            let stop = stopped.get(&passage.row).map_or(f64::INFINITY, |(stop, ..)| *stop);
            if let Some(unnoticed) = &mut self.unnoticed {
                unnoticed.take(&passage, (&interval, self.locator.follows(passage.body)), &located);
                match passage.unseen {
                    _ if passage.is_of_run() => {}
                    Unseen::None => {}
                    Unseen::AtEnd => track.pending = interval.end,
                    Unseen::Within if track.open > 0.0 => {}
                    Unseen::Within => track.open = interval.end,
                }
            }
            match located {
                // Events after the stop do not occur. Those at the stop do, although they are found a little later.
                Located::At { time, .. } if stop + alike < time => {}
                Located::At { time, known_to, state, .. } => {
                    track.closed = true;
                    self.unnoticed.iter_mut().for_each(|unnoticed| unnoticed.occurred(&passage));
                    self.occurrences[passage.event].push(occurrence(passage.body, time.min(stop), known_to, &state));
                }
                // The body has failed; if it was stopped before, that ends the search.
                Located::Counted(_) if passage.fails && !stopped.contains_key(&passage.row) => {
                    track.closed = true;
                    let censored = Censored { body: passage.body, time: self.pushed, stopped: false };
                    self.censored[passage.event].push(censored);
                }
                Located::Counted(times) => track.count += times,
            }
        }
        let rows = stopped.keys().copied().collect();
        for (row, (time, state, own)) in stopped {
            let body = self.members.body(row);
            self.stop(row, time, (OutputState::moving(state, centre(body, time)), own));
        }
        Ok(rows)
    }

    /// Stops a member at `time`, s, unless it is already stopped, and ends its searches.
    fn stop(&mut self, row: usize, time: f64, state: (OutputState, Vec<f64>)) {
        let body = self.members.body(row);
        if let Some(stops) = self.stops.as_mut().filter(|stops| !stops.stands(row)) {
            stops.stop(row, time, state);
            for (tracks, censored) in self.tracks.iter_mut().zip(&mut self.censored) {
                if !std::mem::replace(&mut tracks[row].closed, true) {
                    censored.push(Censored { body, time, stopped: true });
                }
            }
        }
    }

    /// Writes the states of all stopped members to their places.
    pub fn hold(&self, states: &mut [OutputState]) {
        self.stops.iter().for_each(|stops| stops.hold(0, states));
    }

    /// Notes that all members have reached `time`, s.
    pub fn finish_output(&mut self, time: f64) {
        self.time = time;
    }

    /// The events found; `failures` are all failed bodies, ascending. Until then a body counts as one that may have the event: until it
    /// failed, or was last known to be sound.
    pub fn finish(mut self, failures: &[FailedBody]) -> Vec<EventRecord> {
        let bodies = self.members.len();
        for censored in self.censored.iter_mut().flatten().filter(|censored| !censored.stopped) {
            let failed = failures.binary_search_by_key(&censored.body, |failed| failed.body);
            if let Some(FailedBody { time, known_to, last_good_time, .. }) = failed.ok().map(|place| &failures[place]) {
                censored.time = if *known_to == KnownTo::Step { *time } else { *last_good_time };
            }
        }
        // What would have happened after a failure has not.
        for (occurrences, censored) in self.occurrences.iter_mut().zip(&mut self.censored) {
            occurrences.retain(|occurrence| {
                let failed = failures.binary_search_by_key(&occurrence.body, |failed| failed.body);
                let later = failed.ok().map(|place| &failures[place]).filter(|failed| failed.time < occurrence.time);
                censored.extend(later.map(|failed| Censored { body: failed.body, time: failed.time, stopped: false }));
                later.is_none()
            });
        }
        let found = self.events.iter().zip(self.occurrences).zip(self.censored);
        let record = |((event, mut occurrences), mut censored): ((&Event, Vec<EventOccurrence>), Vec<Censored>)| {
            censored.sort_by(|a, b| a.time.total_cmp(&b.time).then(a.body.cmp(&b.body)));
            occurrences.sort_by(|a, b| a.time.total_cmp(&b.time).then(a.body.cmp(&b.body)));
            EventRecord { event: event.clone(), bodies, occurrences, censored, errors: EventErrors::default() }
        };
        found.map(record).collect()
    }
}

/// The own state of a row; empty if none is known.
fn own_of_row(own: &[&[f64]], row: usize) -> Vec<f64> {
    own.iter().map(|numbers| numbers[row]).collect()
}

fn occurrence(body: usize, time: f64, known_to: EventTime, state: &BodyState) -> EventOccurrence {
    let BodyState { orientation, angular_velocity_body, .. } = *state;
    EventOccurrence { body, time, known_to, orientation, angular_velocity_body }
}
