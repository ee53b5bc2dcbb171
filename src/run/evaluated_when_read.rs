//! Torque-free bodies that are evaluated when they are read, without stored constants: regular precessions, and the
//! general closed form in a run with one output.

use std::ops::Range;

use super::OutputState;
use super::reading::{TASK, WriteState};
use super::session_rows::SessionRows;
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
    /// Passes the states at `time` of those bodies in some rows of the group that were not left out to `write`.
    pub fn each(&self, rows: Range<usize>, own: &SessionRows, time: f64, write: &mut WriteState<'_>) {
        self.form(rows, own, (time, false), |row, state, _| write(row, state));
    }

    /// The same at a time, s, with their initial states if these are wanted.
    fn form(
        &self,
        rows: Range<usize>,
        own: &SessionRows,
        at: (f64, bool),
        mut write: impl FnMut(usize, BodyState, Option<BodyState>),
    ) {
        let (ensemble, rows) = (self.ensemble, own.session_rows(&rows));
        let body = |first: usize| move |place| self.members.body(own.kept(first + place));
        let write = |kept, state, start| write(own.kept(kept), state, start);
        match self.motion {
            FreeForm::Precession { shape, span } => {
                let motion = |block: &mut PrecessionBlock, first, count| {
                    let axis = |frame: &BodyFrame, m| shape.axis_of(frame, m, span);
                    block.form(ensemble, count, body(first), (shape.rotations(), axis), at);
                };
                each_of(PrecessionBlock::new(), motion, rows, at.1, write);
            }
            FreeForm::ClosedForm { precision: Precision::F32, set_up, width } => {
                let form = |block: &mut FormedBlock<f32>, first, count| {
                    block.form(ensemble, count, body(first), set_up, at, width);
                };
                each_of(FormedBlock::new(), form, rows, at.1, write);
            }
            FreeForm::ClosedForm { precision: Precision::F64, set_up, width } => {
                let form = |block: &mut FormedBlock<f64>, first, count| {
                    block.form(ensemble, count, body(first), set_up, at, width);
                };
                each_of(FormedBlock::new(), form, rows, at.1, write);
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
    /// initial states, which are formed in the same pass, to their places in `initial`.
    pub fn read_both(
        &self,
        time: f64,
        own: &SessionRows,
        bodies: &Range<usize>,
        states: &mut [OutputState],
        initial: &mut [BodyState],
    ) {
        let tasks = states.chunks_mut(TASK).zip(initial.chunks_mut(TASK));
        parallel::for_each_task(tasks, |task, (states, initial)| {
            let first = bodies.start + task * TASK;
            let rows = self.members.rows(first..first + states.len());
            self.form(rows, own, (time, true), |row, state, start| {
                let place = self.members.body(row) - first;
                states[place] = OutputState::moving(state, None);
                start.into_iter().for_each(|start| initial[place] = start);
            });
        });
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
