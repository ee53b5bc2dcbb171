//! Torque-free bodies of a run with one output: evaluated when they are read, with nothing kept.

use std::ops::Range;

use rayon::prelude::*;

use super::OutputState;
use super::reading::TASK;
use crate::bodies::BodyState;
use crate::bodies::Ensemble;
use crate::bodies::Members;
use crate::kernel::free_motion::{FORMED_BODIES, FormedBlock, SetUp};
use crate::math::Precision;
use crate::math::Width;
use crate::math::lanes::LaneScalar;

/// A group of bodies that is evaluated when it is read.
pub(super) struct EvaluatedWhenRead<'p> {
    pub ensemble: &'p Ensemble,
    pub members: &'p Members,
    pub precision: Precision,
    pub set_up: SetUp,
    pub width: Width,
}

impl EvaluatedWhenRead<'_> {
    /// Hands the states at `time` of the bodies in some rows of the group to `write`, with those in which they started where
    /// these are wanted.
    fn each(
        &self,
        rows: Range<usize>,
        time: f64,
        wants_start: bool,
        write: impl FnMut(usize, BodyState, Option<BodyState>),
    ) {
        match self.precision {
            Precision::F32 => self.each_in::<f32>(rows, time, wants_start, write),
            Precision::F64 => self.each_in::<f64>(rows, time, wants_start, write),
        }
    }

    /// Writes the states at `time` of those of its bodies that are in `bodies` to their places in `states`, and those in which they
    /// started to their places in `initial`.
    pub fn read(
        &self,
        time: f64,
        bodies: &Range<usize>,
        states: &mut [OutputState],
        initial: Option<&mut [BodyState]>,
    ) {
        let mut starts = initial.map(|initial| initial.chunks_mut(TASK));
        let next = |states| (states, starts.as_mut().and_then(Iterator::next));
        let tasks: Vec<_> = states.chunks_mut(TASK).map(next).collect();
        tasks.into_par_iter().enumerate().for_each(|(task, (states, mut initial))| {
            let first = bodies.start + task * TASK;
            let rows = self.members.rows(first..first + states.len());
            self.each(rows, time, initial.is_some(), |row, state, start| {
                let place = self.members.body(row) - first;
                states[place].rotation = state;
                if let (Some(initial), Some(start)) = (&mut initial, start) {
                    initial[place] = start;
                }
            });
        });
    }

    fn each_in<T: LaneScalar>(
        &self,
        rows: Range<usize>,
        time: f64,
        wants_start: bool,
        mut write: impl FnMut(usize, BodyState, Option<BodyState>),
    ) {
        if rows.is_empty() {
            return;
        }
        let mut block = FormedBlock::<T>::new();
        for first in rows.clone().step_by(FORMED_BODIES) {
            let count = FORMED_BODIES.min(rows.end - first);
            block.form(
                self.ensemble,
                count,
                |place| self.members.body(first + place),
                self.set_up,
                (time, wants_start),
                self.width,
            );
            for place in 0..count {
                write(first + place, block.state(place), wants_start.then(|| block.start(place)));
            }
        }
    }

    /// The states at `time` of the bodies in some rows.
    pub fn states(&self, rows: &Range<usize>, time: f64) -> Vec<BodyState> {
        let blocks = (0..rows.len().div_ceil(FORMED_BODIES)).into_par_iter();
        let of_block = |block: usize| {
            let first = rows.start + block * FORMED_BODIES;
            let mut states = Vec::with_capacity(FORMED_BODIES);
            self.each(first..rows.end.min(first + FORMED_BODIES), time, false, |_, state, _| states.push(state));
            states
        };
        blocks.flat_map_iter(of_block).collect()
    }
}
