//! Torque-free bodies evaluated at a single time: their constants stay in the cache and are not kept.

use crate::bodies::Ensemble;
use crate::bodies::columns::STATE_COMPONENTS;
use crate::bodies::user_axes::{UserAxes, UserColumns};
use crate::bodies::{BodyFrame, BodyState};
use crate::kernel::free_motion::SetUp;
use crate::kernel::free_motion::evaluation::ROW_COLUMNS;
use crate::kernel::free_motion::rows::{BLOCK, EvaluatePart, InitialBlock, SetUpBlock, WORD_COLUMNS};
use crate::math::Width;
use crate::math::lanes::{LaneScalar, LaneTask};
use crate::math::quaternion::Quaternion;
use crate::math::real::{Real, Scalar};
use crate::math::vector::Vector;

/// Bodies of a [`FormedBlock`].
pub(crate) const FORMED_BODIES: usize = BLOCK;

/// Bodies evaluated together, in the user's axes and units.
pub(crate) trait Formed {
    /// The states at the time asked for, and those at the start if these were wanted.
    fn columns(&self) -> [&UserColumns; 2];

    /// The state of one of them.
    fn state(&self, place: usize) -> BodyState {
        self.columns()[0].state(place)
    }

    /// The initial state of one of them; NaN if it was not wanted.
    fn start(&self, place: usize) -> BodyState {
        self.columns()[1].state(place)
    }
}

impl<T> Formed for FormedBlock<T> {
    fn columns(&self) -> [&UserColumns; 2] {
        [&self.end, &self.start]
    }
}

/// Some bodies of an ensemble at one time, bit for bit as [`crate::kernel::free_motion::FreeMotionRows`] gives them.
pub(crate) struct FormedBlock<T> {
    initial: InitialBlock,
    frames: [BodyFrame; BLOCK],
    words: [[u64; BLOCK]; WORD_COLUMNS],
    constants: [[T; BLOCK]; ROW_COLUMNS],
    state: [[T; BLOCK]; STATE_COMPONENTS],
    end: UserColumns,
    start: UserColumns,
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
            end: UserColumns::UNKNOWN,
            start: UserColumns::UNKNOWN,
        }
    }

    /// Evaluates `count` bodies (at most [`FORMED_BODIES`]), which `body` names, at `time` seconds after their initial states, and
    /// transforms the initial states too if `wants_start`.
    pub fn form(
        &mut self,
        ensemble: &Ensemble,
        count: usize,
        body: impl Fn(usize) -> usize,
        set_up: SetUp,
        (time, wants_start): (f64, bool),
        width: Width,
    ) {
        let Self { initial, frames, words, constants, state, end, start } = self;
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
        f64::dispatch(ToUserAxes { frames, initial, state, end, start: wants_start.then_some(start) });
    }
}

/// Transforms the states of a block, and the initial ones, to the user's axes and units.
struct ToUserAxes<'a, T> {
    frames: &'a [BodyFrame; BLOCK],
    initial: &'a InitialBlock,
    state: &'a [[T; BLOCK]; STATE_COMPONENTS],
    end: &'a mut UserColumns,
    start: Option<&'a mut UserColumns>,
}

impl<T: Scalar> LaneTask<f64> for ToUserAxes<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<R: Real<Scalar = f64>>(mut self) {
        for offset in (0..BLOCK).step_by(R::LANES) {
            let axes = UserAxes::<R>::new(|lane| &self.frames[offset + lane]);
            if let Some(start) = &mut self.start {
                let (q, m) = self.initial.state::<R>(offset);
                start.store(offset, axes.components(q, m));
            }
            let column = |c: usize| R::from_lanes(|lane| self.state[c][offset + lane].to_f64());
            let (q, m) = (
                Quaternion::new(column(0), column(1), column(2), column(3)),
                Vector::new(column(4), column(5), column(6)),
            );
            self.end.store(offset, axes.components(q, m));
        }
    }
}
