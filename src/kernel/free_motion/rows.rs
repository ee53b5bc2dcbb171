//! Rows of constants for many bodies, by column, and their evaluation in SIMD lanes.

use glam::DVec3;

use crate::bodies::BodyFrame;
use crate::bodies::Ensemble;
use crate::bodies::Members;
use crate::bodies::columns::{STATE_COMPONENTS, STRIDE_UNIT, column_parts, stride_of};
use crate::error::Result;
use crate::kernel::free_motion::evaluation::{Instant, ROW_COLUMNS, Row, SHAPE_COLUMNS, evaluate};
use crate::kernel::free_motion::frame::scaled_body;
use crate::kernel::free_motion::number::Single;
use crate::kernel::free_motion::setup::{Constants, Initial, SetUp, separatrix_row, set_up};
use crate::kernel::free_motion::solution::{HEADROOM, Phases};
use crate::math::double_double::DoubleDouble;
use crate::math::elementary::Turns;
use crate::math::lanes::{LaneScalar, LaneTask};
use crate::math::parallel;
use crate::math::phase::{Rate, Time, phase_at, phase_turns};
use crate::math::quaternion::Quaternion;
use crate::math::real::{Real, Scalar};
use crate::math::vector::Vector;
use crate::math::{Precision, of_either};

/// Columns of the table of integers: low and high word of the polhode's rate, of the precession's, the polhode's phase
/// at the start, and the rates' unit with their signs.
pub const WORD_COLUMNS: usize = 6;

/// Bit of the last integer column: the polhode's phase decreases with time.
const POLHODE_NEGATIVE: u64 = 1 << 32;
/// Bit of the last integer column: the precession's phase decreases with time.
const PRECESSION_NEGATIVE: u64 = 1 << 33;

/// Number of bodies whose phases are formed together: a multiple of every lane count.
pub(super) const BLOCK: usize = STRIDE_UNIT;

/// Number of bodies that one task sets up or evaluates: some microseconds of evaluation.
const TASK: usize = 8 * BLOCK;

/// The torque-free motion of many bodies: a row of constants for each, from which the state at any time follows.
///
/// Column c of body i is at `c * stride + i` in both tables. Rows after the last body represent bodies at rest.
#[derive(Clone, Debug, PartialEq)]
pub struct FreeMotionRows<T> {
    /// Number of bodies.
    pub body_count: usize,
    /// Distance between the starts of two columns; at least `body_count`.
    pub stride: usize,
    /// Phases and their rates, shape `[WORD_COLUMNS, stride]`.
    pub words: Vec<u64>,
    /// Constants of the series, shape `[ROW_COLUMNS, stride]`.
    pub constants: Vec<T>,
    /// Rows before which engines that hold bodies in chunks may cut, ascending; if empty, they may cut anywhere.
    pub ends: Vec<usize>,
}

/// Rows of either precision.
#[derive(Clone, Debug, PartialEq)]
pub enum AnyRows {
    /// In `f32`.
    F32(FreeMotionRows<f32>),
    /// In `f64`.
    F64(FreeMotionRows<f64>),
}

impl AnyRows {
    /// Sets up every body of an ensemble, on all cores, and returns the frames that lead back to the user's axes.
    ///
    /// # Errors
    ///
    /// As [`FreeMotionRows::prepare`].
    pub fn prepare(ensemble: &Ensemble, precision: Precision) -> Result<(Vec<BodyFrame>, Self)> {
        Self::prepare_members(ensemble, &Members::All(ensemble.len()), precision, SetUp::TwoWords)
    }

    /// As [`AnyRows::prepare`], for some bodies of the ensemble, one row each, with constants formed as `set_up` says.
    pub fn prepare_members(
        ensemble: &Ensemble,
        members: &Members,
        precision: Precision,
        set_up: SetUp,
    ) -> Result<(Vec<BodyFrame>, Self)> {
        Ok(match precision {
            Precision::F32 => {
                let (frames, rows) = FreeMotionRows::prepare_members(ensemble, members, set_up)?;
                (frames, Self::F32(rows))
            }
            Precision::F64 => {
                let (frames, rows) = FreeMotionRows::prepare_members(ensemble, members, set_up)?;
                (frames, Self::F64(rows))
            }
        })
    }

    /// Sets where engines that hold bodies in chunks may cut.
    pub(crate) fn cut_at(&mut self, ends: Vec<usize>) {
        of_either!(Self, self, rows => rows.ends = ends)
    }

    /// Number of bodies.
    pub fn body_count(&self) -> usize {
        of_either!(Self, self, rows => rows.body_count)
    }

    /// The precision.
    pub fn precision(&self) -> Precision {
        match self {
            Self::F32(_) => Precision::F32,
            Self::F64(_) => Precision::F64,
        }
    }
}

impl<T: LaneScalar> FreeMotionRows<T> {
    /// Sets up every body of an ensemble, on all cores.
    ///
    /// The set-up is in double-double arithmetic whatever `T` is; only its result is rounded.
    ///
    /// # Errors
    ///
    /// [`crate::Error::TooManyBodies`] where the memory does not suffice.
    pub fn prepare(ensemble: &Ensemble) -> Result<(Vec<BodyFrame>, Self)> {
        Self::prepare_members(ensemble, &Members::All(ensemble.len()), SetUp::TwoWords)
    }

    /// As [`FreeMotionRows::prepare`], for some bodies of the ensemble, one row each, with constants formed as `set_up` says.
    pub fn prepare_members(ensemble: &Ensemble, members: &Members, set_up: SetUp) -> Result<(Vec<BodyFrame>, Self)> {
        let body_count = members.len();
        let row_bytes = WORD_COLUMNS * size_of::<u64>() + ROW_COLUMNS * size_of::<T>() + size_of::<BodyFrame>();
        crate::bodies::memory::require(
            body_count,
            body_count.saturating_mul(row_bytes),
            "the rows of the closed form",
        )?;
        let mut rows = Self::at_rest(body_count);
        let stride = rows.stride;
        let mut frames = parallel::rows(stride, 1, &|_| BodyFrame::UNIT);
        let words = column_parts(&mut rows.words, stride, 0..stride, TASK);
        let constants = column_parts(&mut rows.constants, stride, 0..stride, TASK);
        parallel::for_each_task(
            frames.chunks_mut(TASK).zip(words).zip(constants),
            |task, ((frames, mut words), mut constants)| {
                let mut initial = InitialBlock::at_rest();
                for block in (0..frames.len()).step_by(BLOCK) {
                    let start = task * TASK + block;
                    let frames = &mut frames[block..block + BLOCK];
                    let count = BLOCK.min(body_count.saturating_sub(start));
                    initial.fill(ensemble, &mut frames[..count], |offset| members.body(start + offset), set_up);
                    let (words, constants) = (&mut words, &mut constants);
                    f64::dispatch(SetUpBlock { initial: &initial, set_up, frames, words, constants, first: block });
                }
            },
        );
        frames.truncate(body_count);
        Ok((frames, rows))
    }

    /// Keeps some rows, ascending, which move to the front in their order.
    pub(crate) fn keep(&mut self, rows: &[usize]) {
        let mut kept = Self::at_rest(rows.len());
        let (own, all) = (kept.stride.max(1), self.stride.max(1));
        for (kept, column) in kept.words.chunks_exact_mut(own).zip(self.words.chunks_exact(all)) {
            kept.iter_mut().zip(rows).for_each(|(kept, &row)| *kept = column[row]);
        }
        for (kept, column) in kept.constants.chunks_exact_mut(own).zip(self.constants.chunks_exact(all)) {
            kept.iter_mut().zip(rows).for_each(|(kept, &row)| *kept = column[row]);
        }
        *self = kept;
    }

    /// The rows of bodies at rest.
    fn at_rest(body_count: usize) -> Self {
        let stride = stride_of(body_count);
        Self {
            body_count,
            stride,
            words: vec![0; WORD_COLUMNS * stride],
            constants: vec![T::default(); ROW_COLUMNS * stride],
            ends: Vec::new(),
        }
    }

    /// Writes the state at `time` seconds to the columns of [`crate::engine::batch::Batch::state`] (orientation x, y, z, w,
    /// angular momentum x, y, z, scaled), on all cores. Residue columns, if any, become zero.
    ///
    /// # Panics
    ///
    /// If `state` does not consist of whole columns of [`FreeMotionRows::stride`].
    pub fn evaluate(&self, time: f64, state: &mut [T]) {
        assert!(self.stride == 0 || state.len().is_multiple_of(self.stride), "expected whole columns");
        parallel::for_each_task(column_parts(state, self.stride, 0..self.stride, TASK), |task, mut columns| {
            T::dispatch(self.evaluation(task * TASK, time, &mut columns));
        });
    }

    /// As [`FreeMotionRows::evaluate`], one body after the other without fused multiply-add: the shader's twin.
    pub fn evaluate_one_by_one(&self, time: f64, state: &mut [T]) {
        assert!(self.stride == 0 || state.len().is_multiple_of(self.stride), "expected whole columns");
        for (task, mut columns) in column_parts(state, self.stride, 0..self.stride, TASK).into_iter().enumerate() {
            self.evaluation(task * TASK, time, &mut columns).run::<T>();
        }
    }

    fn evaluation<'a, 'b>(&'a self, start: usize, time: f64, state: &'a mut [&'b mut [T]]) -> EvaluatePart<'a, 'b, T> {
        EvaluatePart { words: &self.words, constants: &self.constants, stride: self.stride, start, time, state }
    }
}

/// Columns of the set-up's input: moments and angular velocity in two words each, and the orientation.
const INITIAL_COLUMNS: usize = 16;

/// What the set-up of one block reads.
pub(super) struct InitialBlock([[f64; BLOCK]; INITIAL_COLUMNS]);

impl InitialBlock {
    pub(super) fn at_rest() -> Self {
        let mut columns = [[0.0; BLOCK]; INITIAL_COLUMNS];
        for moment in 0..3 {
            columns[2 * moment].fill(1.0);
        }
        columns[INITIAL_COLUMNS - 1].fill(1.0);
        Self(columns)
    }

    /// Fills in as many bodies of an ensemble as there are frames, which it also computes; `body` names the bodies. Entries after the last
    /// one belong to other bodies, and their results are never read.
    pub(super) fn fill(
        &mut self,
        ensemble: &Ensemble,
        frames: &mut [BodyFrame],
        body: impl Fn(usize) -> usize,
        set_up: SetUp,
    ) {
        for (offset, frame) in frames.iter_mut().enumerate() {
            let (body_frame, row) = scaled_body(ensemble, body(offset), set_up);
            *frame = body_frame;
            self.set(offset, &row);
        }
    }

    fn set(&mut self, offset: usize, body: &Initial<f64>) {
        for axis in 0..3 {
            self.0[2 * axis][offset] = body.moments[axis].high;
            self.0[2 * axis + 1][offset] = body.moments[axis].low;
            self.0[6 + 2 * axis][offset] = body.angular_velocity[axis].high;
            self.0[7 + 2 * axis][offset] = body.angular_velocity[axis].low;
        }
        let q = body.orientation;
        for (column, component) in [q.x, q.y, q.z, q.w].into_iter().enumerate() {
            self.0[12 + column][offset] = component;
        }
    }

    /// The initial states of a lane group's bodies, scaled ([`crate::bodies::columns::StateWords`]).
    #[inline(always)]
    pub(super) fn state<R: Real<Scalar = f64>>(&self, offset: usize) -> (Quaternion<R>, Vector<R>) {
        let column = |c: usize| R::load(&self.0[c][offset..]);
        (
            Quaternion::new(column(12), column(13), column(14), column(15)),
            Vector::new(column(0) * column(6), column(2) * column(8), column(4) * column(10)),
        )
    }

    /// The scaled initial angular momentum of a body along its principal axes.
    pub(super) fn angular_momentum(&self, place: usize) -> DVec3 {
        DVec3::from_array(self.load::<f64>(place).angular_momentum().map(DoubleDouble::to_f64))
    }

    #[inline(always)]
    pub(super) fn load<R: Real<Scalar = f64>>(&self, offset: usize) -> Initial<R> {
        let column = |c: usize| R::load(&self.0[c][offset..]);
        let two = |c: usize| DoubleDouble { high: column(c), low: column(c + 1) };
        Initial {
            moments: [two(0), two(2), two(4)],
            angular_velocity: [two(6), two(8), two(10)],
            orientation: Quaternion::new(column(12), column(13), column(14), column(15)),
        }
    }
}

/// Sets one block up, lane group by lane group.
pub(super) struct SetUpBlock<'a, 'b, T> {
    pub initial: &'a InitialBlock,
    pub set_up: SetUp,
    pub frames: &'a [BodyFrame],
    pub words: &'a mut [&'b mut [u64]],
    pub constants: &'a mut [&'b mut [T]],
    /// Offset of the block in the columns.
    pub first: usize,
}

impl<T: Scalar> LaneTask<f64> for SetUpBlock<'_, '_, T> {
    type Output = ();

    #[inline(always)]
    fn run<R: Real<Scalar = f64>>(self) {
        // The widest lanes hold eight numbers.
        let mut lanes = [0.0_f64; 8];
        for offset in (0..BLOCK).step_by(R::LANES) {
            let initial = self.initial.load(offset);
            let found = match self.set_up {
                SetUp::OneWord => set_up::<R, Single<R>>(&initial),
                SetUp::TwoWords => set_up::<R, DoubleDouble<R>>(&initial),
            };
            let row = &found.row;
            let columns = row_columns(row);
            for (column, number) in columns.into_iter().enumerate() {
                number.store(&mut lanes);
                let target = &mut self.constants[column][self.first + offset..][..R::LANES];
                for (target, &lane) in target.iter_mut().zip(&lanes) {
                    *target = T::from_f64(lane);
                }
            }
            let separatrix = R::select(found.separatrix, R::splat(1.0), R::splat(0.0));
            let numbers = [
                found.polhode_rate.high,
                found.polhode_rate.low,
                found.precession_rate.high,
                found.precession_rate.low,
                found.polhode_start.high,
                found.polhode_start.low,
                separatrix,
            ];
            // One row a lane.
            let mut integers = [[0.0_f64; 7]; 8];
            for (column, number) in numbers.into_iter().enumerate() {
                number.store(&mut lanes);
                for (row, &lane) in integers.iter_mut().zip(&lanes) {
                    row[column] = lane;
                }
            }
            for (lane, row) in integers[..R::LANES].iter().enumerate() {
                let body = offset + lane;
                let two = |c: usize| DoubleDouble { high: row[c], low: row[c + 1] };
                let mut phases = Phases::from_turns(two(0), two(2), two(4), self.frames[body].rate_exponent);
                if row[6] > 0.5 {
                    let (row, start) = separatrix_body(&self.initial.load::<f64>(body));
                    phases.polhode_start = start;
                    for (column, number) in row_columns(&row).into_iter().enumerate() {
                        self.constants[column][self.first + body] = T::from_f64(number);
                    }
                }
                for (column, word) in phases.to_words().into_iter().enumerate() {
                    self.words[column][self.first + body] = word;
                }
            }
        }
    }
}

/// The row of a body on the separatrix and its phase at the start. Not inlined, as it is rare.
#[cold]
#[inline(never)]
fn separatrix_body(initial: &Initial<f64>) -> (Row<f64>, u64) {
    let mut constants: Constants<f64> = set_up::<_, DoubleDouble<f64>>(initial);
    separatrix_row(&mut constants, initial.orientation);
    (constants.row, Phases::new(&constants, 0).polhode_start)
}

/// The columns of a row, in the order of the table.
#[inline(always)]
fn row_columns<R: Real>(row: &Row<R>) -> [R; ROW_COLUMNS] {
    let (q, m) = (row.frame, row.amplitude);
    let mut columns = [row.axes; ROW_COLUMNS];
    columns[..SHAPE_COLUMNS].copy_from_slice(&row.shape);
    columns[SHAPE_COLUMNS..ROW_COLUMNS - 1].copy_from_slice(&[q.x, q.y, q.z, q.w, m.x, m.y, m.z]);
    columns
}

/// The row whose columns `column` loads.
#[inline(always)]
pub(crate) fn load_row<R: Real>(column: impl Fn(usize) -> R) -> Row<R> {
    const F: usize = SHAPE_COLUMNS;
    Row {
        shape: std::array::from_fn(&column),
        frame: Quaternion::new(column(F), column(F + 1), column(F + 2), column(F + 3)),
        amplitude: Vector::new(column(F + 4), column(F + 5), column(F + 6)),
        axes: column(F + 7),
    }
}

impl Phases {
    /// The integers as columns of the table.
    fn to_words(self) -> [u64; WORD_COLUMNS] {
        let (polhode, precession) = (self.polhode_rate, self.precession_rate);
        let mut unit = u64::from(polhode.exponent as u32);
        if polhode.negative {
            unit |= POLHODE_NEGATIVE;
        }
        if precession.negative {
            unit |= PRECESSION_NEGATIVE;
        }
        [
            polhode.fraction as u64,
            (polhode.fraction >> 64) as u64,
            precession.fraction as u64,
            (precession.fraction >> 64) as u64,
            self.polhode_start,
            unit,
        ]
    }

    /// The integers from columns of the table.
    #[inline(always)]
    fn from_words(words: [u64; WORD_COLUMNS]) -> Self {
        let unit = words[5];
        let rate = |low: u64, high: u64, sign: u64| Rate {
            fraction: u128::from(low) | (u128::from(high) << 64),
            exponent: unit as u32 as i32,
            negative: unit & sign != 0,
        };
        Self {
            polhode_rate: rate(words[0], words[1], POLHODE_NEGATIVE),
            polhode_start: words[4],
            precession_rate: rate(words[2], words[3], PRECESSION_NEGATIVE),
        }
    }
}

/// Evaluates the bodies of one task, lane group by lane group.
pub(super) struct EvaluatePart<'a, 'b, T> {
    pub words: &'a [u64],
    pub constants: &'a [T],
    /// Distance between the starts of two columns in both tables.
    pub stride: usize,
    pub start: usize,
    pub time: f64,
    pub state: &'a mut [&'b mut [T]],
}

impl<T: Scalar> LaneTask<T> for EvaluatePart<'_, '_, T> {
    type Output = ();

    #[inline(always)]
    fn run<R: Real<Scalar = T>>(self) {
        let stride = self.stride;
        let exact = Time::from_seconds(self.time);
        let (state, residues) = self.state.split_at_mut(STATE_COMPONENTS);
        let count = state[0].len();
        for block in (0..count).step_by(BLOCK) {
            let start = self.start + block;
            let words: [&[u64]; WORD_COLUMNS] = [
                &self.words[start..][..BLOCK],
                &self.words[stride + start..][..BLOCK],
                &self.words[2 * stride + start..][..BLOCK],
                &self.words[3 * stride + start..][..BLOCK],
                &self.words[4 * stride + start..][..BLOCK],
                &self.words[5 * stride + start..][..BLOCK],
            ];
            // Integer arithmetic, body by body.
            let (mut polhode, mut precession) = ([0_u64; BLOCK], [0_u64; BLOCK]);
            let mut times = [T::default(); BLOCK];
            for offset in 0..BLOCK {
                let phases = Phases::from_words([
                    words[0][offset],
                    words[1][offset],
                    words[2][offset],
                    words[3][offset],
                    words[4][offset],
                    words[5][offset],
                ]);
                polhode[offset] = phase_at(phases.polhode_start, phases.polhode_rate, exact);
                precession[offset] = phase_at(0, phases.precession_rate, exact);
                times[offset] = exact.scaled(phases.polhode_rate.exponent - HEADROOM);
            }
            let (polhode, precession) = (TurnsBlock::new(&polhode), TurnsBlock::new(&precession));
            // The series, in lanes.
            for offset in (0..BLOCK).step_by(R::LANES) {
                let row = load_row(|column| R::load(&self.constants[column * stride + start + offset..]));
                let instant = Instant {
                    polhode: polhode.load(offset),
                    precession: precession.load(offset),
                    time: R::load(&times[offset..]),
                };
                let found = evaluate(&row, &instant);
                let (q, m) = (found.orientation, found.angular_momentum_principal);
                for (column, number) in [q.x, q.y, q.z, q.w, m.x, m.y, m.z].into_iter().enumerate() {
                    number.store(&mut state[column][block + offset..]);
                }
            }
        }
        for residue in residues {
            residue.fill(T::default());
        }
    }
}

/// Reduced angles of one block.
pub(super) struct TurnsBlock<T> {
    quadrant: [T; BLOCK],
    residual: [T; BLOCK],
}

impl<T: Scalar> TurnsBlock<T> {
    #[inline(always)]
    pub(super) fn new(phases: &[u64; BLOCK]) -> Self {
        let mut block = Self { quadrant: [T::default(); BLOCK], residual: [T::default(); BLOCK] };
        for (offset, &phase) in phases.iter().enumerate() {
            let angle = phase_turns::<T>(phase);
            block.quadrant[offset] = angle.quadrant;
            block.residual[offset] = angle.residual;
        }
        block
    }

    #[inline(always)]
    pub(super) fn load<R: Real<Scalar = T>>(&self, offset: usize) -> Turns<R> {
        Turns { quadrant: R::load(&self.quadrant[offset..]), residual: R::load(&self.residual[offset..]) }
    }
}
