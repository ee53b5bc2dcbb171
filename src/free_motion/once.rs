//! Torque-free bodies whose states are wanted once: what leads to them stays in the cache and is not kept.

use std::array::from_fn;

use crate::batch::{BodyFrame, BodyState, STATE_COMPONENTS};
use crate::engine::cpu::Width;
use crate::ensemble::Ensemble;
use crate::free_motion::SetUp;
use crate::free_motion::evaluation::ROW_COLUMNS;
use crate::free_motion::rows::{BLOCK, EvaluatePart, InitialBlock, SetUpBlock, WORD_COLUMNS};
use crate::lanes::{LaneScalar, LaneTask};

/// Bodies of a [`FormedBlock`].
pub(crate) const FORMED_BODIES: usize = BLOCK;

/// Some bodies of an ensemble at one time, to the bit as [`crate::free_motion::FreeMotionRows`] gives them.
pub(crate) struct FormedBlock<T> {
    initial: InitialBlock,
    frames: [BodyFrame; BLOCK],
    words: [[u64; BLOCK]; WORD_COLUMNS],
    constants: [[T; BLOCK]; ROW_COLUMNS],
    state: [[T; BLOCK]; STATE_COMPONENTS],
}

impl<T: LaneScalar> FormedBlock<T> {
    /// A block without bodies.
    pub fn new() -> Self {
        Self {
            initial: InitialBlock::at_rest(),
            frames: [BodyFrame::UNIT; BLOCK],
            words: [[0; BLOCK]; WORD_COLUMNS],
            constants: [[T::default(); BLOCK]; ROW_COLUMNS],
            state: [[T::default(); BLOCK]; STATE_COMPONENTS],
        }
    }

    /// Brings `count` bodies, which `body` names and of which there may be [`FORMED_BODIES`], to `time` seconds after their
    /// initial states.
    pub fn form(
        &mut self,
        ensemble: &Ensemble,
        count: usize,
        body: impl Fn(usize) -> usize,
        set_up: SetUp,
        time: f64,
        width: Width,
    ) {
        let Self { initial, frames, words, constants, state } = self;
        initial.fill(ensemble, &mut frames[..count], body, set_up);
        f64::dispatch(SetUpBlock {
            initial,
            set_up,
            frames: &*frames,
            words: &mut words.each_mut().map(|column| &mut column[..]),
            constants: &mut constants.each_mut().map(|column| &mut column[..]),
            first: 0,
        });
        let evaluation = EvaluatePart {
            words: words.as_flattened(),
            constants: constants.as_flattened(),
            stride: BLOCK,
            start: 0,
            time,
            state: &mut state.each_mut().map(|column| &mut column[..]),
        };
        match width {
            Width::Lanes => T::dispatch(evaluation),
            Width::Scalar => evaluation.run::<T>(),
        }
    }

    /// The state in which one of the bodies starts, in the user's axes and units.
    pub fn start(&self, place: usize) -> BodyState {
        self.frames[place].body_state(self.initial.state(place))
    }

    /// The state of one of the bodies in the user's axes and units.
    pub fn state(&self, place: usize) -> BodyState {
        self.frames[place].body_state(from_fn(|component| self.state[component][place].to_f64()))
    }
}
