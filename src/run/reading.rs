//! Converts the states of sessions to the user's axes and units, in lanes and on all cores.

use std::borrow::Cow;
use std::ops::Range;

use crate::bodies::Members;
use crate::bodies::Status;
use crate::bodies::columns::STATE_COMPONENTS;
use crate::bodies::user_axes::{USER_BODIES, UserBlock};
use crate::bodies::{BodyFrame, BodyState};
use crate::math::parallel;
use crate::torque::Torque;

/// Bodies that one task writes.
pub(super) const TASK: usize = 1 << 10;

/// Takes the state of the body in a row of a group.
pub(super) type WriteState<'a> = dyn FnMut(usize, BodyState) + 'a;

/// Forms the states in a range of rows of a group, in their order.
pub(super) type FormStates<'a> = dyn Fn(Range<usize>, &mut WriteState<'_>) + Sync + 'a;

/// Forms the frames of a group's bodies at a time.
pub(super) struct FramesAt<'a> {
    pub members: &'a Members,
    pub torques: &'a [Torque],
    /// Whether moments of inertia change in time.
    pub varies: bool,
    /// s.
    pub time: f64,
}

impl FramesAt<'_> {
    /// The frame of the body in a row of the group, whose frame at the start is `frame`.
    #[inline]
    pub fn frame<'f>(&self, frame: &'f BodyFrame, row: usize) -> Cow<'f, BodyFrame> {
        match self.varies {
            true => Cow::Owned(frame.at(self.torques, self.members.body(row), self.time)),
            false => Cow::Borrowed(frame),
        }
    }
}

/// Converts the states of the bodies in some rows to the user's axes and units: `given` gives the frame of each, its
/// numbers as [`UserBlock::set`] takes them, and its status.
pub(super) fn each_in_lanes<'f>(
    rows: Range<usize>,
    start: bool,
    given: impl Fn(usize) -> (Cow<'f, BodyFrame>, [f64; STATE_COMPONENTS], Status),
    write: &mut WriteState<'_>,
) {
    if rows.is_empty() {
        return;
    }
    let mut block = UserBlock::new();
    for first in rows.clone().step_by(USER_BODIES) {
        let count = USER_BODIES.min(rows.end - first);
        for place in 0..count {
            let (frame, numbers, status) = given(first + place);
            block.set(place, &frame, numbers, status);
        }
        block.form(start);
        (0..count).for_each(|place| write(first + place, block.state(place)));
    }
}

/// Fills the places of those of the bodies in `rows` that are in `bodies`.
pub(super) fn scatter<T: Send>(
    members: &Members,
    bodies: &Range<usize>,
    rows: &Range<usize>,
    places: &mut [T],
    form: &FormStates<'_>,
    write: impl Fn(&mut T, BodyState) + Sync,
) {
    parallel::for_each_chunk(places, TASK, |task, places| {
        let first = bodies.start + task * TASK;
        let own = members.rows(first..first + places.len());
        let own = own.start.max(rows.start)..own.end.min(rows.end);
        form(own, &mut |row, state| write(&mut places[members.body(row) - first], state));
    });
}
