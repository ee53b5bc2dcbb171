//! Events that a run does not notice: the quantity passes its level and is back by the next time at which the run seeks events.

use std::ops::Range;

use super::locate::{Located, Passage};
use crate::plan::Plan;

/// The angle, rad, that an interval counts for at least: it begins with a step of its own, and a search in its series.
const ANGLE_OF_INTERVAL: f64 = 2.0;

/// The bodies of the recomputed sample: at least this many, and of more than 64,000 bodies one in a thousand.
const LEAST_BODIES: usize = 64;
const ONE_IN: usize = 1000;

/// A passage this near an output, as a part of the span, is not sought in the interval before: rounding may put it on either side.
const NEAR: f64 = 1e-9;

/// How far the search for a body has come.
#[derive(Clone, Copy, Debug, Default)]
struct Searched {
    /// The time searched, and the time over which the run sought the event, s.
    time: f64,
    of: f64,
    /// Whether a passage has gone unnoticed.
    missed: bool,
}

/// Searches a sample for what goes unnoticed, between all times at which a run seeks events.
///
/// How much of a body's motion is searched depends on the body alone, so that parts of a study find what a run of all bodies finds.
#[derive(Debug)]
pub(super) struct Unnoticed {
    /// The angle that a body may turn by, as a rate over the whole span, rad/s.
    rate: f64,
    /// The end of the span, s, and the least distance from outputs.
    end: f64,
    near: f64,
    /// By event, then by row of the sample.
    searched: Vec<Vec<Searched>>,
    /// By event: the bodies whose event goes unnoticed, or is noticed later.
    bodies: Vec<Vec<u32>>,
}

impl Unnoticed {
    /// In a sample of `rows` bodies of a plan, as far as that says.
    pub fn new(plan: &Plan<'_>, rows: usize) -> Self {
        let scene = plan.scene();
        let (events, end) = (scene.wanted_events().len(), scene.end());
        // The sample of the whole study, in a part of it too. Where statistics are compared, each part has its own.
        let of_study = match scene.wanted_statistical_accuracy() {
            Some(_) => rows,
            None => plan.recomputation().bodies,
        };
        let sample = of_study.max(LEAST_BODIES).max(scene.part().of / ONE_IN);
        Self {
            rate: plan.recomputation().searched / (sample * events.max(1)) as f64 / end,
            end,
            near: NEAR * end,
            searched: vec![vec![Searched::default(); rows]; events],
            bodies: vec![Vec::new(); events],
        }
    }

    /// The part of an interval, s, that is searched for a body that turns at `rate` rad/s; `None` if it is too short to tell anything, or
    /// if the interval is left out as others are searched: where there are so many that each would get less than
    /// [`ANGLE_OF_INTERVAL`], some are searched so far and others not, those first in which the quantity `may_pass` its level. `lead` is how
    /// much more the body has been searched so far than it may be, in intervals, 0 at first.
    pub fn part(&self, interval: &Range<f64>, rate: f64, may_pass: bool, lead: &mut f64) -> Option<Range<f64>> {
        let length = interval.end - interval.start;
        // An output at the start ends an interval without length.
        if length <= 0.0 {
            return None;
        }
        // What those that follow may take, if they are as long.
        let share = self.share(interval);
        let later = share * (self.end - interval.start) / length;
        let is_due = *lead <= if may_pass { later - 1.0 } else { 0.0 };
        let angle = (self.rate * length).max(ANGLE_OF_INTERVAL);
        *lead += f64::from(u8::from(is_due)) - share;
        let part = (angle / (rate * length)).min(1.0) * length;
        let end = interval.start + part.min(length - self.near);
        (is_due && end > interval.start).then_some(interval.start..end)
    }

    /// Whether a part of an interval, s, is all of it.
    pub fn ends(&self, part: &Range<f64>, interval: &Range<f64>) -> bool {
        part.end + 2.0 * self.near >= interval.end
    }

    /// The share of the intervals like this one that are searched.
    fn share(&self, interval: &Range<f64>) -> f64 {
        (self.rate * (interval.end - interval.start) / ANGLE_OF_INTERVAL).min(1.0)
    }

    /// Takes the result of a search between two times at which the run seeks events, s, if the body could be followed.
    pub fn take(&mut self, passage: &Passage, (interval, is_followed): (&Range<f64>, bool), located: &Located) {
        let share = self.share(interval);
        let length = interval.end - interval.start;
        // A passage that the run follows is sought in every interval; others stand for those that are left out.
        let is_of_run = passage.is_of_run();
        let is_whole = self.ends(&passage.span, interval);
        let searched = &mut self.searched[passage.event][passage.row];
        searched.of += if is_of_run { length } else { length / share };
        let part = if is_whole { length } else { passage.span.end - passage.span.start };
        searched.time += if is_followed { part } else { 0.0 };
        let is_found = !matches!(located, Located::Counted(0));
        searched.missed |= !is_of_run && is_found;
    }

    /// Notes that a body has had an event.
    pub fn occurred(&mut self, passage: &Passage) {
        if self.searched[passage.event][passage.row].missed {
            self.bodies[passage.event].push(passage.body as u32);
        }
    }

    /// What was found, by event.
    pub fn finish(self) -> Vec<FoundUnnoticed> {
        let least = |all: &[Searched]| {
            let parts = all.iter().filter(|searched| searched.of > 0.0).map(|searched| searched.time / searched.of);
            parts.fold(1.0, f64::min)
        };
        let found = self.bodies.into_iter().zip(&self.searched);
        found
            .map(|(mut bodies, searched)| {
                bodies.sort_unstable();
                FoundUnnoticed { bodies, searched: least(searched), ..FoundUnnoticed::default() }
            })
            .collect()
    }
}

/// What a search for unnoticed events has found.
#[derive(Debug, Default)]
pub(super) struct FoundUnnoticed {
    /// The bodies whose event goes unnoticed, or is noticed later, ascending.
    pub bodies: Vec<u32>,
    /// The least part of the time for which a body was followed.
    pub searched: f64,
    /// The part of the span, on average, from where the event may have gone unnoticed to where it was found, or to the end: in an interval
    /// that was not searched the quantity changed by more than a third of its distances from the level at both ends, or had done so before.
    pub open: f64,
    /// The bodies of which that is so, each with the time, s, from which it is.
    pub since: Vec<(u32, f64)>,
}
