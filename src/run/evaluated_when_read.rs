//! Torque-free bodies that are evaluated when they are read, without stored constants: regular precessions, and the
//! general closed form in a run with one output.

use std::ops::Range;

use super::OutputState;
use super::kept::Kept;
use super::reading::TASK;
use crate::bodies::Ensemble;
use crate::bodies::Members;
use crate::bodies::{BodyFrame, BodyState};
use crate::kernel::free_motion::{FORMED_BODIES, Formed, FormedBlock, PrecessionBlock, SetUp};
use crate::math::Precision;
use crate::math::Width;
use crate::math::parallel;
use crate::plan::Shape;

/// A group of bodies that is evaluated when it is read.
pub(super) struct EvaluatedWhenRead<'p> {
    pub ensemble: &'p Ensemble,
    pub members: &'p Members,
    pub motion: FreeForm,
}

/// The form in which a motion is evaluated.
pub(super) enum FreeForm {
    /// Two uniform rotations, about an axis that follows from the body's class and the span, s.
    Precession { shape: Shape, span: f64 },
    /// By elliptic functions.
    ClosedForm { precision: Precision, set_up: SetUp, width: Width },
}

impl EvaluatedWhenRead<'_> {
    /// Passes the states at `time` of the bodies in some rows of the group to `write`, with their initial states if
    /// these are wanted.
    fn each(
        &self,
        rows: Range<usize>,
        time: f64,
        wants_start: bool,
        write: impl FnMut(usize, BodyState, Option<BodyState>),
    ) {
        self.each_of_rows(rows, &|row| row, time, wants_start, write);
    }

    /// The same for rows in another numbering: `row` gives the group's row of each.
    fn each_of_rows(
        &self,
        rows: Range<usize>,
        row: &dyn Fn(usize) -> usize,
        time: f64,
        wants_start: bool,
        write: impl FnMut(usize, BodyState, Option<BodyState>),
    ) {
        let (ensemble, at) = (self.ensemble, (time, wants_start));
        let body = |first: usize| move |place| self.members.body(row(first + place));
        match self.motion {
            FreeForm::Precession { shape, span } => {
                let motion = |block: &mut PrecessionBlock, first, count| {
                    let axis = |frame: &BodyFrame, m| shape.axis_of(frame, m, span);
                    block.form(ensemble, count, body(first), (shape.rotations(), axis), at);
                };
                each_of(PrecessionBlock::new(), motion, rows, wants_start, write);
            }
            FreeForm::ClosedForm { precision: Precision::F32, set_up, width } => {
                let form = |block: &mut FormedBlock<f32>, first, count| {
                    block.form(ensemble, count, body(first), set_up, at, width);
                };
                each_of(FormedBlock::new(), form, rows, wants_start, write);
            }
            FreeForm::ClosedForm { precision: Precision::F64, set_up, width } => {
                let form = |block: &mut FormedBlock<f64>, first, count| {
                    block.form(ensemble, count, body(first), set_up, at, width);
                };
                each_of(FormedBlock::new(), form, rows, wants_start, write);
            }
        }
    }

    /// The arithmetic in which the bodies' frames are formed.
    pub fn set_up(&self) -> SetUp {
        match self.motion {
            FreeForm::Precession { .. } => SetUp::TwoWords,
            FreeForm::ClosedForm { set_up, .. } => set_up,
        }
    }

    /// Writes the states at `time` of those of its bodies that are in `bodies` to their places in `states`, and their
    /// initial states to their places in `initial`.
    pub fn read(
        &self,
        time: f64,
        bodies: &Range<usize>,
        states: &mut [OutputState],
        initial: Option<&mut [BodyState]>,
    ) {
        let mut starts = initial.map(|initial| initial.chunks_mut(TASK));
        let next = |states| (states, starts.as_mut().and_then(Iterator::next));
        parallel::for_each_task(states.chunks_mut(TASK).map(next), |task, (states, mut initial)| {
            let first = bodies.start + task * TASK;
            let rows = self.members.rows(first..first + states.len());
            self.each(rows, time, initial.is_some(), |row, state, start| {
                let place = self.members.body(row) - first;
                states[place] = OutputState::moving(state, None);
                if let (Some(initial), Some(start)) = (&mut initial, start) {
                    initial[place] = start;
                }
            });
        });
    }

    /// As [`EvaluatedWhenRead::read`], for the kept rows only.
    pub fn read_kept(&self, time: f64, kept: &Kept, bodies: &Range<usize>, states: &mut [OutputState]) {
        parallel::for_each_chunk(states, TASK, |task, states| {
            let first = bodies.start + task * TASK;
            let rows = kept.session_rows(&self.members.rows(first..first + states.len()));
            self.each_of_rows(rows, &|row| kept.row(row), time, false, |row, state, _| {
                states[self.members.body(kept.row(row)) - first] = OutputState::moving(state, None);
            });
        });
    }

    /// The states at `time` of the bodies in some rows.
    pub fn states(&self, rows: &Range<usize>, time: f64) -> Vec<BodyState> {
        let of_block = |block: usize| {
            let first = rows.start + block * FORMED_BODIES;
            let mut states = Vec::with_capacity(FORMED_BODIES);
            self.each(first..rows.end.min(first + FORMED_BODIES), time, false, |_, state, _| states.push(state));
            states
        };
        parallel::map(rows.len().div_ceil(FORMED_BODIES), of_block).concat()
    }
}

/// Forms the bodies in some rows block by block: `form` receives the first row of each block and its number of rows.
fn each_of<B: Formed>(
    mut block: B,
    form: impl Fn(&mut B, usize, usize),
    rows: Range<usize>,
    wants_start: bool,
    mut write: impl FnMut(usize, BodyState, Option<BodyState>),
) {
    for first in rows.clone().step_by(FORMED_BODIES) {
        let count = FORMED_BODIES.min(rows.end - first);
        form(&mut block, first, count);
        for place in 0..count {
            write(first + place, block.state(place), wants_start.then(|| block.start(place)));
        }
    }
}
