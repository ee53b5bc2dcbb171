//! Adaptive steps in lanes.

use std::marker::PhantomData;
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use glam::DVec3;

use super::block_of;
use super::observe::{Reducer, bodies_in};
use super::taylor::{TaylorMotion, keep_rows as keep_series, steps_in_tiles, steps_one_by_one};
use super::tile::attempts_in_tiles;
use crate::bodies::Status;
use crate::bodies::columns::{RATE_COLUMN, StateWords, column_parts, keep_rows, state_columns, status_column};
use crate::engine::batch::{Batch, load_body, load_state, store_state};
use crate::engine::checks::check_time;
use crate::engine::controlled::Written;
use crate::engine::cpu::torque_kernels::{AllTorques, CommonTorques, LaneTorques, Nothing};
use crate::engine::load_balance::imbalance;
use crate::engine::standby::{Reached, Standby};
use crate::engine::watch::{Job, Pace, Watch};
use crate::engine::{End, Observer, Session, StepCounts};
use crate::error::{Error, Result};
use crate::kernel::method::rk8_adaptive::{Controller, advance};
use crate::kernel::observe;
use crate::math::Width;
use crate::math::clock::Clock;
use crate::math::lanes::{LaneScalar, LaneTask};
use crate::math::parallel;
use crate::math::real::{Real, Scalar};
use crate::math::vector::{TwoWords, two_words_of};
use crate::scene::AdaptiveSteps;
use crate::torque::sum::Source;

/// Columns of a [`Controller`]: step, left (two words), retried, accepted, rejected.
pub(super) const CONTROLLER_COLUMNS: usize = 6;
pub(super) const LEFT: Range<usize> = 1..3;
const ACCEPTED: usize = 4;
const REJECTED: usize = 5;

/// Attempts of a body between two checks whether to continue: at most some hundred milliseconds of work for one block.
/// The counts of one slice are exact in every element type.
const SLICE: u32 = 1 << 13;

/// The most bodies that one task advances: more than fill its lanes, so that others can replace those that arrive.
const MOST_BODIES: usize = 512;

pub(super) struct CpuAdaptiveSession<T> {
    pub(super) batch: Batch<T>,
    pub(super) reducer: Option<Reducer<T>>,
    /// Shape `[CONTROLLER_COLUMNS, stride]`; after these columns those that the series keep between slices.
    controllers: Vec<T>,
    counts: Vec<StepCounts>,
    steps: AdaptiveSteps,
    /// Bodies that make more attempts are given up.
    most_attempts: u64,
    pub(super) width: Width,
    /// The time of the state.
    clock: Clock,
    /// Attempts of all lanes, including those without a body, by the kernels that count them.
    slots: AtomicU64,
    /// The time that the last job took on all threads together.
    last_job: Duration,
    pace: Pace,
    /// Attempts of bodies that the session no longer keeps.
    left_out: u64,
    /// Attempts that another engine has made, which are in the counts.
    elsewhere: u64,
    /// The motion and the kernel of steps by Taylor series; `None` for `rk8`.
    series: Option<(TaylorMotion, Kernel<T>)>,
    dense: Option<Dense<T>>,
}

/// Advances a slice of a block; returns whether any body is still under way.
type Kernel<T> = fn(Block<'_, '_, T>) -> bool;

/// What dense output keeps of the bodies.
struct Dense<T> {
    /// The states where their last steps end, shape `[state_columns, stride]`; those of the batch are at the session's time.
    ahead: Vec<T>,
    /// The series of these steps.
    kept: Vec<T>,
    /// Numbers that are kept for each body.
    columns: usize,
}

impl CpuAdaptiveSession<f64> {
    /// Steps by [`crate::kernel::method::taylor`]. With dense output they go beyond the times to which bodies are advanced.
    pub fn by_series(batch: Batch<f64>, steps: AdaptiveSteps, width: Width, is_dense: bool) -> Result<Self> {
        let motion = TaylorMotion::new(&batch.torques, steps, is_dense)?;
        let kernel = if width.has_lanes::<f64>() { steps_in_tiles::<f64> } else { steps_one_by_one::<f64> };
        let mut session = Self::new(batch, steps, width);
        session.controllers.resize((CONTROLLER_COLUMNS + motion.columns()) * session.batch.stride, 0.0);
        if is_dense {
            let (columns, stride) = (motion.kept_columns(), session.batch.stride);
            let ahead = session.batch.state[..state_columns::<f64>() * stride].to_vec();
            session.dense = Some(Dense { ahead, kept: vec![0.0; columns * stride], columns });
        }
        session.series = Some((motion, kernel));
        Ok(session)
    }
}

impl<T: LaneScalar> CpuAdaptiveSession<T> {
    pub fn new(batch: Batch<T>, steps: AdaptiveSteps, width: Width) -> Self {
        Self {
            reducer: None,
            controllers: vec![T::default(); CONTROLLER_COLUMNS * batch.stride],
            counts: vec![StepCounts::default(); batch.body_count],
            clock: batch.torques.clock(),
            slots: AtomicU64::new(0),
            last_job: Duration::MAX,
            pace: Pace::default(),
            left_out: 0,
            elsewhere: 0,
            series: None,
            dense: None,
            most_attempts: u64::MAX,
            batch,
            steps,
            width,
        }
    }

    /// Bodies in a lane group.
    fn lanes(&self) -> usize {
        match self.width {
            Width::Lanes => T::lane_count(),
            Width::Scalar => 1,
        }
    }

    /// The job of advancing to `time`, s.
    fn work(&mut self, time: f64) -> Result<Job<'_>> {
        check_time(time)?;
        let end = self.clock.at(time.max(0.0));
        Ok(if end.now() <= self.clock.now() {
            // All bodies have arrived already.
            let bodies = self.batch.body_count as u64;
            Box::new(move |watch: &Watch| watch.add(bodies))
        } else {
            self.advance_blocks(end, self.kernel(), None)
        })
    }

    /// The kernel of attempts: in lanes or one by one, according to the session's width, and without torques that the
    /// scene does not have.
    fn kernel(&self) -> Kernel<T> {
        let has_lanes = self.width.has_lanes::<T>();
        match &self.series {
            Some((_, kernel)) => *kernel,
            None if self.batch.torques.is_empty() && has_lanes => in_lanes::<T, Nothing>,
            None if self.batch.torques.is_empty() => one_by_one::<T, Nothing>,
            None if self.batch.torques.is_common() && has_lanes => in_lanes::<T, CommonTorques>,
            None if self.batch.torques.is_common() => one_by_one::<T, CommonTorques>,
            None if has_lanes => attempts_in_tiles::<T>,
            None => one_by_one::<T, AllTorques>,
        }
    }

    /// All attempts from the start of the interval to its end, or `some` attempts of each body from where its
    /// controller is.
    fn advance_blocks(&mut self, end: Clock, kernel: Kernel<T>, some: Option<u32>) -> Job<'_> {
        let most_attempts = self.most_attempts;
        let steps = self.steps.over(self.clock.seconds_until(&end).0, end.seconds());
        let block = match some {
            None => block_of(self.batch.body_count, MOST_BODIES),
            // As many bodies as every kernel takes at once, so that none waits until another has arrived.
            Some(_) => LEAST_GROUPS * self.lanes(),
        };
        let Self { batch, clock, controllers, counts, slots, last_job, series, dense, .. } = self;
        let (slots, motion) = (&*slots, series.as_ref().map(|(motion, _)| motion));
        let start = *clock;
        let (value, residue) = start.seconds_until(&end);
        let span = two_words_of::<T>(value, residue);
        let Batch { stride, parameters, state, torques, .. } = batch;
        let stride = *stride;
        let source = Source { table: torques, parameters, stride, clock: start, dt: 0.0 };
        let (states, beside) = match dense {
            None => (column_parts(state, stride, 0..stride, block), Vec::new()),
            Some(Dense { ahead, kept, columns }) => {
                let outputs = column_parts(state, stride, 0..stride, block);
                let kept = kept.chunks_mut((block * *columns).max(1));
                (column_parts(ahead, stride, 0..stride, block), outputs.into_iter().zip(kept).collect())
            }
        };
        let mut beside = beside.into_iter();
        let of_blocks = std::iter::repeat_with(move || beside.next().unwrap_or_default());
        let controllers = column_parts(controllers, stride, 0..stride, block);
        Box::new(move |watch: &Watch| {
            let advance = |index: usize, parts: (Parts<'_, T>, Beside<'_, T>), counts: &mut [StepCounts]| {
                let ((mut state, mut controllers), (mut outputs, kept)) = parts;
                let first = index * block;
                let mut starts = some.is_none();
                let mut under_way = true;
                while under_way && watch.goes_on() {
                    under_way = kernel(Block {
                        source,
                        first,
                        state: &mut state,
                        controllers: &mut controllers,
                        outputs: &mut outputs,
                        kept: &mut *kept,
                        span,
                        steps,
                        starts,
                        attempts: some.unwrap_or(SLICE),
                        is_single: some.is_some(),
                        slots,
                        motion,
                        bodies: counts.len(),
                    });
                    starts = false;
                    if some.is_some() {
                        break;
                    }
                    take_counts(&mut controllers, counts);
                    give_up(state[status_column::<T>()], counts, most_attempts);
                }
                watch.add(counts.len() as u64);
            };
            let are_few = states.len() <= FEW_BLOCKS;
            let blocks = states.into_iter().zip(controllers).zip(of_blocks).zip(counts.chunks_mut(block));
            // A few attempts take less time than waking a thread.
            if are_few && (some.is_some() || *last_job < WAKING) {
                let begun = Instant::now();
                blocks.enumerate().for_each(|(index, (parts, counts))| advance(index, parts, counts));
                *last_job = begun.elapsed();
            } else {
                let nanoseconds = AtomicU64::new(0);
                parallel::for_each_task(blocks, |index, (parts, counts)| {
                    let begun = Instant::now();
                    advance(index, parts, counts);
                    nanoseconds.fetch_add(begun.elapsed().as_nanos() as u64, Ordering::Relaxed);
                });
                *last_job = Duration::from_nanos(nanoseconds.into_inner());
            }
            *clock = end;
        })
    }
}

/// Lane groups that every kernel advances at once.
const LEAST_GROUPS: usize = 2;

/// The most blocks that the calling thread advances by itself, for single attempts or if the last job took less than [`WAKING`].
const FEW_BLOCKS: usize = 8;
/// Less work than this takes longer on several threads than on one, as these have to be woken.
const WAKING: Duration = Duration::from_micros(100);

/// The columns of a block: its state and its controllers.
type Parts<'a, T> = (Vec<&'a mut [T]>, Vec<&'a mut [T]>);

/// What dense output has beside them: the columns of the state at the session's time, and what is kept.
type Beside<'a, T> = (Vec<&'a mut [T]>, &'a mut [T]);

impl<T: LaneScalar + observe::Kernel> Session for CpuAdaptiveSession<T> {
    bodies_in!(batch);

    fn advance_to(&mut self, end: End, observer: &mut Observer<'_>) -> Result<()> {
        let (bodies, span) = (self.batch.body_count as u64, end.time - self.clock.seconds());
        let mut pace = self.pace;
        let finished = pace.watched(span, self.work(end.time)?, bodies, observer);
        self.pace = pace;
        finished.map_err(|_| Error::Interrupted { steps: 0 })
    }

    fn limit_attempts(&mut self, most: u64) {
        self.most_attempts = most;
    }

    fn job_to(&mut self, end: End) -> Result<Option<Job<'_>>> {
        self.work(end.time).map(Some)
    }

    fn has_jobs(&self) -> bool {
        true
    }

    fn read_centres(&mut self, bodies: Range<usize>) -> Result<Vec<(DVec3, DVec3)>> {
        Ok(self.batch.integrated_centres(bodies))
    }

    fn write_parameters(&mut self, written: &Written) -> Result<()> {
        assert!(self.dense.is_none(), "bodies that are ahead have taken their steps with the parameters before");
        self.batch.write_parameters(written);
        Ok(())
    }

    fn keep(&mut self, bodies: &[usize]) -> Result<()> {
        keep_rows(&mut self.controllers, self.batch.stride, bodies);
        let attempts = |counts: &[StepCounts]| -> u64 { counts.iter().map(StepCounts::attempts).sum() };
        if let Some(Dense { ahead, kept, columns }) = &mut self.dense {
            keep_rows(ahead, self.batch.stride, bodies);
            keep_series(kept, *columns, bodies);
        }
        let before = attempts(&self.counts);
        self.counts = bodies.iter().map(|&body| self.counts[body]).collect();
        self.left_out += before - attempts(&self.counts);
        self.batch.keep(bodies);
        Ok(())
    }

    fn attempt(&mut self, end: f64, controllers: &mut [Controller<f64>]) -> Result<()> {
        check_time(end)?;
        let (stride, start, bodies) = (self.batch.stride, self.clock, self.batch.body_count);
        for (body, controller) in controllers[..bodies].iter().enumerate() {
            store_controller(controller, |column, number: f64| {
                self.controllers[column * stride + body] = T::from_f64(number);
            });
        }
        let kernel = self.kernel();
        self.advance_blocks(start.at(end.max(0.0)), kernel, Some(1))(&Watch::default());
        self.clock = start;
        for (body, controller) in controllers[..bodies].iter_mut().enumerate() {
            *controller = load_controller(|column| self.controllers[column * stride + body].to_f64());
        }
        Ok(())
    }

    fn reached(&self) -> Option<Vec<f64>> {
        let Batch { body_count, stride, parameters, .. } = &self.batch;
        let left = |row: usize| {
            let word = |column: usize| self.controllers[column * stride + row].to_f64();
            let rate = parameters[RATE_COLUMN * stride + row].to_f64();
            (word(LEFT.start) + word(LEFT.start + 1)) / rate
        };
        let end = self.clock.seconds();
        Some((0..*body_count).map(|row| (end - left(row)).max(0.0)).collect())
    }

    fn counts(&mut self) -> Result<Vec<StepCounts>> {
        Ok(self.counts.clone())
    }

    fn imbalance(&mut self) -> Result<f64> {
        let attempts = self.left_out + self.counts.iter().map(StepCounts::attempts).sum::<u64>() - self.elsewhere;
        let slots = self.slots.load(Ordering::Relaxed);
        if slots > 0 && attempts > 0 {
            return Ok(slots as f64 / attempts as f64);
        }
        let attempts: Vec<u64> = self.counts.iter().map(StepCounts::attempts).collect();
        Ok(imbalance(&attempts, self.lanes()))
    }

    fn side_by_side(&self) -> usize {
        self.lanes()
    }
}

impl<T: LaneScalar + observe::Kernel> Standby for CpuAdaptiveSession<T> {
    fn follow(&mut self, reached: &Reached, end: End) {
        self.batch.set_states(&reached.states);
        self.counts.copy_from_slice(&reached.counts);
        self.elsewhere = self.left_out + reached.counts.iter().map(StepCounts::attempts).sum::<u64>();
        let end = self.clock.at(end.time.max(0.0));
        if end.now() > self.clock.now() {
            self.clock = end;
        }
    }
}

/// Moves the counts of a block's controllers to integers, which do not run out of digits.
fn take_counts<T: Scalar>(controllers: &mut [&mut [T]], counts: &mut [StepCounts]) {
    for (row, counts) in counts.iter_mut().enumerate() {
        counts.accepted += controllers[ACCEPTED][row].to_f64() as u64;
        counts.rejected += controllers[REJECTED][row].to_f64() as u64;
        controllers[ACCEPTED][row] = T::default();
        controllers[REJECTED][row] = T::default();
    }
}

/// Flags those of a block's bodies that have made more than `most` attempts, those that have arrived with the last of them too: which bodies are
/// given up does not depend on where slices end.
fn give_up<T: Scalar>(status: &mut [T], counts: &[StepCounts], most: u64) {
    for (status, counts) in status.iter_mut().zip(counts) {
        if counts.attempts() > most && status.to_f64() == Status::Valid.code() {
            *status = T::from_f64(Status::StepBelowLimit.code());
        }
    }
}

/// A slice of attempts of one block.
pub(super) struct Block<'a, 'b, T> {
    pub source: Source<'a, T>,
    /// Its first body.
    pub first: usize,
    pub state: &'a mut [&'b mut [T]],
    pub controllers: &'a mut [&'b mut [T]],
    /// With dense output, the state at the end of the interval, while [`Block::state`] may be ahead of it; and the series that are kept.
    pub outputs: &'a mut [&'b mut [T]],
    pub kept: &'a mut [T],
    /// Length of the interval, s.
    pub span: TwoWords<T>,
    pub steps: AdaptiveSteps,
    /// Whether the interval starts here.
    pub starts: bool,
    /// The most attempts of a body.
    pub attempts: u32,
    /// Whether states and controllers must be complete after the attempts, without the columns kept between slices.
    pub is_single: bool,
    /// The count of the lanes' attempts.
    pub slots: &'a AtomicU64,
    /// The series of the motion, for steps by series.
    pub motion: Option<&'a TaylorMotion>,
    /// Bodies in the block; lane groups without bodies are skipped.
    pub bodies: usize,
}

fn in_lanes<T: LaneScalar, S: LaneTorques>(block: Block<'_, '_, T>) -> bool {
    T::dispatch(Advance::<T, S>(block, PhantomData))
}

fn one_by_one<T: Scalar, S: LaneTorques>(block: Block<'_, '_, T>) -> bool {
    Advance::<T, S>(block, PhantomData).run::<T>()
}

/// Advances a block, lane group by lane group; returns whether any body is still under way.
struct Advance<'a, 'b, T, S>(Block<'a, 'b, T>, PhantomData<S>);

impl<T: Scalar, S: LaneTorques> LaneTask<T> for Advance<'_, '_, T, S> {
    type Output = bool;
    const IN_LANES_ONLY: bool = true;

    #[inline(always)]
    fn run<R: Real<Scalar = T>>(self) -> bool {
        let Self(block, _) = self;
        let mut any_under_way = false;
        let workspace = block.source.workspace();
        for offset in (0..block.bodies).step_by(R::LANES) {
            let columns = block.source.group(block.first + offset, &workspace);
            let (body, rate) = load_body(|column| columns.column(column));
            let torques = S::at(columns);
            // Rows without a body have the rate 0, so that nothing is left to do in them.
            let (span, limits) = (block.span.times(rate), block.steps.limits(rate));
            let state = load_state(|column| R::load(&block.state[column][offset..]));
            let controller = load_controller(|column| R::load(&block.controllers[column][offset..]));
            let controller = if block.starts { controller.over(span) } else { controller };
            let (state, controller) = advance(&body, &torques, span, &limits, block.attempts, controller, state);
            any_under_way |= R::any(controller.under_way(&state));
            store_state(&state, |column, number: R| number.store(&mut block.state[column][offset..]));
            store_controller(&controller, |column, number: R| number.store(&mut block.controllers[column][offset..]));
        }
        any_under_way
    }
}

#[inline(always)]
pub(super) fn load_controller<R: Real>(column: impl Fn(usize) -> R) -> Controller<R> {
    Controller {
        step: column(0),
        left: TwoWords { value: column(LEFT.start), residue: column(LEFT.start + 1) },
        retried: column(3),
        accepted: column(ACCEPTED),
        rejected: column(REJECTED),
    }
}

#[inline(always)]
pub(super) fn store_controller<R: Real>(controller: &Controller<R>, mut store: impl FnMut(usize, R)) {
    let Controller { step, left, retried, accepted, rejected } = *controller;
    for (column, number) in [step, left.value, left.residue, retried, accepted, rejected].into_iter().enumerate() {
        store(column, number);
    }
}
