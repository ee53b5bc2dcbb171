//! Bodies that fail during a run: marked when states are read, and kept with their last good states.

use std::collections::BTreeMap;

use glam::{DQuat, DVec3};

use super::reading::TASK;
use super::states::make_room;
use crate::bodies::BodyState;
use crate::bodies::Ensemble;
use crate::bodies::Status;
use crate::bodies::memory;
use crate::error::Result;
use crate::math::parallel;
use crate::record::{FailedBody, KnownTo, OutputState};

/// The bodies that have failed so far.
pub(super) struct Failures<'p> {
    ensemble: &'p Ensemble,
    found: BTreeMap<usize, FailedBody>,
    /// The states at the last output that was read, by body; NaN for failed bodies. Empty if they are not kept.
    earlier: Vec<GoodState>,
    /// The time of that output, s.
    earlier_time: Option<f64>,
}

/// The kept part of a good state.
#[derive(Clone, Copy)]
struct GoodState {
    orientation: DQuat,
    angular_velocity_body: DVec3,
}

impl GoodState {
    const NONE: Self = Self { orientation: DQuat::NAN, angular_velocity_body: DVec3::NAN };

    fn is_some(&self) -> bool {
        !self.orientation.w.is_nan()
    }
}

impl<'p> Failures<'p> {
    pub fn new(ensemble: &'p Ensemble) -> Self {
        Self { ensemble, found: BTreeMap::new(), earlier: Vec::new(), earlier_time: None }
    }

    /// Keeps the states of each output that is read from now on until the next one.
    ///
    /// # Errors
    ///
    /// [`crate::Error::TooManyBodies`] where memory does not suffice.
    pub fn keep_states(&mut self) -> Result<()> {
        let body_count = self.ensemble.len();
        if self.earlier.len() == body_count {
            return Ok(());
        }
        memory::require(body_count, body_count.saturating_mul(size_of::<GoodState>()), "the bodies' last good states")?;
        make_room(&mut self.earlier, body_count, GoodState::NONE);
        Ok(())
    }

    /// Notes which of the bodies from `first_body` on have failed by `time`, s, and makes their numbers NaN.
    pub fn mark(&mut self, time: f64, first_body: usize, states: &mut [OutputState]) {
        let is_first = self.earlier_time.is_none();
        let own = first_body..(first_body + states.len()).min(self.earlier.len());
        let mut earlier = self.earlier.get_mut(own).map(|earlier| earlier.chunks_mut(TASK));
        let next = |states| (states, earlier.as_mut().and_then(Iterator::next));
        let failed = |(task, (states, mut earlier)): (usize, (&mut [OutputState], Option<&mut [GoodState]>))| {
            let mut failed = Vec::new();
            for (place, state) in states.iter().enumerate() {
                let good = earlier.as_mut().map(|earlier| &mut earlier[place]);
                let status = state.status();
                if status.is_good() && (is_first || good.as_ref().is_none_or(|good| good.is_some())) {
                    let BodyState { orientation, angular_velocity_body, .. } = state.rotation;
                    good.into_iter().for_each(|good| *good = GoodState { orientation, angular_velocity_body });
                    continue;
                }
                let before = good.map(|good| std::mem::replace(good, GoodState::NONE)).filter(|_| !is_first);
                failed.push((first_body + task * TASK + place, status, before));
            }
            failed
        };
        let failed = parallel::map_tasks(states.chunks_mut(TASK).map(next), |task, of_task| failed((task, of_task)));
        for (body, status, before) in failed.into_iter().flatten() {
            let reason = self.note(body, status, time, before);
            blank(&mut states[body - first_body], reason);
        }
    }

    /// Takes back that bodies from `first_body` on have failed which an event has stopped before.
    pub fn withdraw(&mut self, first_body: usize, states: &[OutputState]) {
        let own = first_body..first_body + states.len();
        let stopped = |body: &usize| states[body - first_body].stopped_at.is_some();
        let failed: Vec<usize> = self.found.range(own).map(|(body, _)| *body).filter(stopped).collect();
        for body in failed {
            self.found.remove(&body);
            let BodyState { orientation, angular_velocity_body, .. } = states[body - first_body].rotation;
            let stop = GoodState { orientation, angular_velocity_body };
            self.earlier.get_mut(body).into_iter().for_each(|earlier| *earlier = stop);
        }
    }

    /// Notes that all bodies of the output at `time`, s, have been marked.
    pub fn end_output(&mut self, time: f64) {
        self.earlier_time = Some(time);
    }

    /// Notes a body that has failed by `time`, s, if states were not read.
    pub fn push(&mut self, body: usize, reason: Status, time: f64) {
        let before = self.earlier.get(body).copied().filter(|_| self.earlier_time.is_some());
        self.note(body, reason, time, before);
    }

    /// Notes a body that has failed, and returns the reason that was noted first.
    fn note(&mut self, body: usize, reason: Status, time: f64, before: Option<GoodState>) -> Status {
        let ensemble = self.ensemble;
        let found = self.found.entry(body).or_insert_with(|| {
            let start = || GoodState {
                orientation: ensemble.orientation()[body],
                angular_velocity_body: ensemble.angular_velocity_body()[body],
            };
            let last_good_time = before.and(self.earlier_time).unwrap_or(0.0);
            let GoodState { orientation, angular_velocity_body } = before.unwrap_or_else(start);
            let known_to = KnownTo::Output;
            FailedBody { body, reason, time, known_to, last_good_time, orientation, angular_velocity_body, cause: None }
        });
        found.reason
    }

    /// The number of bodies that have failed for a reason.
    pub fn count(&self, reason: Status) -> usize {
        self.found.values().filter(|failed| failed.reason == reason).count()
    }

    /// All failed bodies, by index.
    pub fn finish(self) -> Vec<FailedBody> {
        self.found.into_values().collect()
    }
}

/// Makes the numbers of a body that has failed NaN: all of them, or those of its centre of mass if only that is lost.
fn blank(state: &mut OutputState, reason: Status) {
    if reason != Status::CentreNotFinite || !state.rotation.is_sound() {
        state.rotation = BodyState { status: reason, ..BodyState::UNKNOWN };
    }
    state.translation = state.translation.map(|_| (DVec3::NAN, DVec3::NAN));
}
