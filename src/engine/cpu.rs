//! The CPU engine: all cores, SIMD lanes chosen at run time.

use std::marker::PhantomData;

use super::checks::{
    TAYLOR_ADAPTS, TAYLOR_IN_F64, check_equal_steps, check_step, check_time, check_torques, check_uncoupled,
    taylor_unavailable,
};
use super::projected::conserving;
use super::standby::{Reached, Standby};
use super::watch::{Job, Watch, watched};
use super::{Backend, Description, End, EngineKind, Observer, Session, unobserved};
use crate::bodies::columns::{StateWords, column_parts, state_columns};
use crate::engine::batch::{AnyBatch, Batch, load_body, load_invariants, load_state, store_state};
use crate::engine::controlled::Written;
use crate::error::{Error, Result};
use crate::kernel::free_motion::{AnyRows, FreeMotionRows};
use crate::kernel::method::cf4::Cf4;
use crate::kernel::method::clamped_euler::ClampedEuler;
use crate::kernel::method::dlm::Dlm;
use crate::kernel::method::explicit_euler::ExplicitEuler;
use crate::kernel::method::gyro_newton::GyroNewton;
use crate::kernel::method::implicit_midpoint::ImplicitMidpoint;
use crate::kernel::method::rk4::Rk4;
use crate::kernel::method::rk8::Rk8;
use crate::kernel::method::spiral::Spiral;
use crate::kernel::method::splitting::Splitting;
use crate::kernel::method::{Method, Step};
use crate::kernel::observe::Kernel;
use crate::kernel::torque_kernel::TorqueKernel;
use crate::math::clock::{Clock, MOST_LANES};
use crate::math::equal_steps::Interval;
use crate::math::lanes::{LaneScalar, LaneTask};
use crate::math::parallel;
use crate::math::real::{Real, Scalar};
use crate::math::vector::TwoWords;
use crate::math::vector::two_words;
use crate::math::{Precision, Width, of_either};
use crate::scene::AdaptiveSteps;
use crate::torque::TorqueTable;
use crate::torque::sum::Source;

mod adaptive;
mod observe;
mod seats;
mod taylor;
mod tile;
mod torque_kernels;
mod trials;

use adaptive::CpuAdaptiveSession;
use observe::{Reducer, bodies_in};
pub(crate) use taylor::kept_bytes;
use tile::TileStep;
use torque_kernels::{AllTorques, CommonTorques, LaneTorques, Nothing, Projected};
pub(crate) use trials::Trials;

/// Integrates on the processor.
#[derive(Clone, Copy, Debug)]
pub struct Cpu {
    width: Width,
}

impl Cpu {
    /// The engine in lanes or one body at a time.
    pub fn new(width: Width) -> Self {
        Self { width }
    }
}

/// Sessions that can continue from where those of a device stopped.
impl Cpu {
    pub(super) fn stand_by(&self, batch: AnyBatch, method: Method) -> Result<Box<dyn Standby>> {
        check_equal_steps(method)?;
        check_uncoupled(&batch, method)?;
        Ok(of_either!(AnyBatch, batch, batch => Box::new(CpuSession::new(batch, method, self.width))))
    }

    pub(super) fn stand_by_projected(&self, batch: AnyBatch, method: Method) -> Result<Box<dyn Standby>> {
        let batch = conserving(batch, method)?;
        let clock = batch.torques.clock();
        Ok(Box::new(CpuSession { batch, method, width: self.width, clock, projected: true, reducer: None }))
    }

    pub(super) fn stand_by_adaptive(&self, batch: AnyBatch, steps: AdaptiveSteps) -> Result<Box<dyn Standby>> {
        steps.check(batch.precision())?;
        check_torques(&batch)?;
        check_uncoupled(&batch, Method::Rk8)?;
        Ok(of_either!(AnyBatch, batch, batch => Box::new(CpuAdaptiveSession::new(batch, steps, self.width))))
    }

    fn by_series(&self, batch: AnyBatch, steps: AdaptiveSteps, is_dense: bool) -> Result<Box<dyn Session>> {
        steps.check_series()?;
        check_torques(&batch)?;
        match batch {
            AnyBatch::F32(_) => Err(taylor_unavailable(TAYLOR_IN_F64)),
            AnyBatch::F64(batch) => Ok(Box::new(CpuAdaptiveSession::by_series(batch, steps, self.width, is_dense)?)),
        }
    }

    pub(super) fn stand_by_free(&self, rows: AnyRows) -> Box<dyn Standby> {
        of_either!(AnyRows, rows, rows => Box::new(CpuFreeSession::new(rows, self.width)))
    }
}

impl Backend for Cpu {
    fn description(&self) -> Description {
        let lanes = match self.width {
            Width::Lanes => format!("{} lanes of f32, {} of f64", f32::lane_count(), f64::lane_count()),
            Width::Scalar => "one body at a time".to_owned(),
        };
        let threads = match rayon::current_num_threads() {
            1 => "1 thread".to_owned(),
            threads => format!("{threads} threads"),
        };
        Description {
            kind: EngineKind::Cpu,
            name: format!("CPU, {threads}, {lanes}"),
            driver: String::new(),
            software: false,
            arithmetic: None,
            on_host: None,
        }
    }

    fn precisions(&self) -> &[Precision] {
        &Precision::ALL
    }

    fn start(&self, batch: AnyBatch, method: Method) -> Result<Box<dyn Session>> {
        Ok(self.stand_by(batch, method)?)
    }

    fn start_projected(&self, batch: AnyBatch, method: Method) -> Result<Box<dyn Session>> {
        Ok(self.stand_by_projected(batch, method)?)
    }

    fn speed(&self, _precision: Precision) -> Option<f64> {
        Some(rayon::current_num_threads() as f64)
    }

    fn speed_of_series(&self) -> Option<f64> {
        self.speed(Precision::F64)
    }

    fn start_adaptive(&self, batch: AnyBatch, steps: AdaptiveSteps) -> Result<Box<dyn Session>> {
        Ok(self.stand_by_adaptive(batch, steps)?)
    }

    fn start_taylor(&self, batch: AnyBatch, steps: AdaptiveSteps) -> Result<Box<dyn Session>> {
        self.by_series(batch, steps, false)
    }

    fn start_dense_taylor(&self, batch: AnyBatch, steps: AdaptiveSteps) -> Result<Box<dyn Session>> {
        check_uncoupled(&batch, Method::Taylor)?;
        self.by_series(batch, steps, true)
    }

    fn evaluates_on_host(&self) -> Option<Width> {
        Some(self.width)
    }

    fn start_free(&self, rows: AnyRows) -> Result<Box<dyn Session>> {
        Ok(self.stand_by_free(rows))
    }
}

/// Rows of constants and the columns of the state that they were last evaluated to.
struct CpuFreeSession<T> {
    rows: FreeMotionRows<T>,
    columns: Batch<T>,
    width: Width,
    reducer: Option<Reducer<T>>,
    /// What the device has reached for which this session stands by.
    followed: Option<End>,
}

impl<T: LaneScalar + Kernel> CpuFreeSession<T> {
    fn new(rows: FreeMotionRows<T>, width: Width) -> Self {
        let state = vec![T::from_f64(f64::NAN); state_columns::<T>() * rows.stride];
        let columns = Batch {
            body_count: rows.body_count,
            stride: rows.stride,
            parameters: Vec::new(),
            state,
            torques: TorqueTable::none(0.0),
            ends: Vec::new(),
        };
        Self { rows, columns, width, reducer: None, followed: None }
    }
}

impl<T: LaneScalar + Kernel> Session for CpuFreeSession<T> {
    bodies_in!(columns);

    fn advance_to(&mut self, end: End, _: &mut Observer<'_>) -> Result<()> {
        check_time(end.time)?;
        match self.width {
            Width::Lanes => self.rows.evaluate(end.time, &mut self.columns.state),
            Width::Scalar => self.rows.evaluate_one_by_one(end.time, &mut self.columns.state),
        }
        Ok(())
    }

    fn keep(&mut self, bodies: &[usize]) -> Result<()> {
        self.followed = None;
        self.rows.keep(bodies);
        let (body_count, stride) = (self.rows.body_count, self.rows.stride);
        let state = vec![T::from_f64(f64::NAN); state_columns::<T>() * stride];
        self.columns = Batch { body_count, stride, state, ..std::mem::replace(&mut self.columns, Batch::at_rest(0)) };
        Ok(())
    }
}

impl<T: LaneScalar + Kernel> Standby for CpuFreeSession<T> {
    fn has_states(&self) -> bool {
        false
    }

    fn follow(&mut self, _: &Reached, end: End) {
        self.followed = Some(end);
    }

    fn take_over(&mut self) -> Result<()> {
        self.followed.map_or(Ok(()), |end| self.advance_to(end, &mut unobserved))
    }
}

struct CpuSession<T> {
    batch: Batch<T>,
    method: Method,
    width: Width,
    /// The time of the state.
    clock: Clock,
    /// Whether the batch has the columns of combinations, onto which states are projected.
    projected: bool,
    reducer: Option<Reducer<T>>,
}

/// The most bodies that one task advances; more in tiles, which share the numbers that follow from the time.
const BLOCK: usize = 64;
const BLOCK_OF_TILES: usize = 512;
/// As many body-steps take less time than waking a thread: the calling thread takes them by itself.
const FEW_BODY_STEPS: u64 = 256;
/// The approximate number of tasks for each thread, if there are enough bodies.
const TASKS: usize = 4;

/// The number of bodies that one task advances, out of `bodies` and at most `most`: a multiple of every lane count.
fn block_of(bodies: usize, most: usize) -> usize {
    bodies.div_ceil(TASKS * rayon::current_num_threads()).next_multiple_of(MOST_LANES).clamp(MOST_LANES, most)
}

/// Body-steps between two checks whether to continue: tens to hundreds of milliseconds of work for one block.
const SLICE: u64 = 1 << 22;

impl<T: LaneScalar + Kernel> Session for CpuSession<T> {
    bodies_in!(batch);

    fn advance_to(&mut self, end: End, observer: &mut Observer<'_>) -> Result<()> {
        let bodies = self.batch.body_count as u64;
        watched(self.work(end.steps)?, end.steps.steps.saturating_mul(bodies), observer)
            .map_err(|done| Error::Interrupted { steps: done / bodies.max(1) })
    }

    fn job_to(&mut self, end: End) -> Result<Option<Job<'_>>> {
        self.work(end.steps).map(Some)
    }

    fn has_jobs(&self) -> bool {
        true
    }

    fn write_parameters(&mut self, written: &Written) -> Result<()> {
        self.batch.write_parameters(written);
        Ok(())
    }

    fn keep(&mut self, bodies: &[usize]) -> Result<()> {
        self.batch.keep(bodies);
        Ok(())
    }
}

impl<T: LaneScalar + Kernel> Standby for CpuSession<T> {
    fn follow(&mut self, reached: &Reached, end: End) {
        self.batch.set_states(&reached.states);
        let Interval { steps, dt } = end.steps;
        self.clock = self.clock.after(dt, steps);
    }
}

impl<T: LaneScalar> CpuSession<T> {
    fn new(mut batch: Batch<T>, method: Method, width: Width) -> Self {
        if method.reads_invariants() && batch.torques.is_empty() {
            batch.append_invariants();
        }
        let clock = batch.torques.clock();
        Self { batch, method, width, clock, projected: false, reducer: None }
    }

    /// The job of some steps of all bodies.
    fn work(&mut self, Interval { steps, dt }: Interval) -> Result<Job<'_>> {
        check_step(dt, T::PRECISION)?;
        // The first condition is known at compile time, so no projected kernels are compiled for f32.
        if T::WORDS == 1 && self.projected {
            return Ok(match self.method {
                Method::Rk4 => self.advance_in::<Rk4, Projected>(dt, steps),
                Method::Rk8 => self.advance_in::<Rk8, Projected>(dt, steps),
                Method::Cf4 => self.advance_in::<Cf4, Projected>(dt, steps),
                _ => self.advance_in::<Splitting<2>, Projected>(dt, steps),
            });
        }
        Ok(match self.method {
            Method::Rk4 => self.advance_by_tiles::<Rk4, tile::Rk4>(dt, steps),
            Method::Rk8 => self.advance_by_tiles::<Rk8, tile::Rk8>(dt, steps),
            Method::Cf4 => self.advance_by_tiles::<Cf4, tile::Cf4>(dt, steps),
            // Without torque the three are one free flow, so one kernel serves them.
            Method::Splitting2 | Method::Splitting4 | Method::Splitting6 if self.batch.torques.is_empty() => {
                self.advance_in::<Splitting<2>, Nothing>(dt, steps)
            }
            Method::Splitting2 => self.advance_forced_by::<Splitting<2>>(dt, steps),
            Method::Splitting4 => self.advance_forced_by::<Splitting<4>>(dt, steps),
            Method::Splitting6 => self.advance_forced_by::<Splitting<6>>(dt, steps),
            Method::ImplicitMidpoint => self.advance_by::<ImplicitMidpoint>(dt, steps),
            Method::Dlm => self.advance_by::<Dlm>(dt, steps),
            Method::ExplicitEuler => self.advance_singly_by::<ExplicitEuler>(dt, steps),
            Method::GyroNewton => self.advance_singly_by::<GyroNewton>(dt, steps),
            Method::ClampedEuler => self.advance_singly_by::<ClampedEuler>(dt, steps),
            Method::Spiral => self.advance_singly_by::<Spiral>(dt, steps),
            Method::Taylor => return Err(taylor_unavailable(TAYLOR_ADAPTS)),
        })
    }

    /// Compiles a method's loop with and without torques: a scene without them has none in its loop.
    fn advance_by<M: Step>(&mut self, dt: f64, steps: u64) -> Job<'_> {
        if self.batch.torques.is_empty() {
            self.advance_in::<M, Nothing>(dt, steps)
        } else {
            self.advance_forced_by::<M>(dt, steps)
        }
    }

    /// The same for bodies on which torques act. In lanes these methods have one loop for all torques, as plans do not choose them.
    fn advance_forced_by<M: Step>(&mut self, dt: f64, steps: u64) -> Job<'_> {
        if self.width.has_lanes::<T>() {
            self.advance_blocks(dt, steps, in_lanes::<T, M, AllTorques>)
        } else {
            self.advance_singly::<M>(dt, steps)
        }
    }

    /// One body at a time.
    fn advance_singly<M: Step>(&mut self, dt: f64, steps: u64) -> Job<'_> {
        if self.batch.torques.is_common() {
            self.advance_blocks(dt, steps, one_by_one::<T, M, CommonTorques>)
        } else {
            self.advance_blocks(dt, steps, one_by_one::<T, M, AllTorques>)
        }
    }

    /// As [`Self::advance_by`], with driven bodies in tiles: for the methods that plans choose.
    fn advance_by_tiles<M: Step, I: TileStep>(&mut self, dt: f64, steps: u64) -> Job<'_> {
        let torques = &self.batch.torques;
        if torques.is_empty() {
            self.advance_in::<M, Nothing>(dt, steps)
        } else if !self.width.has_lanes::<T>() {
            self.advance_singly::<M>(dt, steps)
        } else if torques.is_common() {
            self.advance_blocks(dt, steps, in_lanes::<T, M, CommonTorques>)
        } else {
            self.advance_blocks_of(BLOCK_OF_TILES, dt, steps, tile::in_tiles::<T, I>)
        }
    }

    /// Always one body at a time: for the methods of other programs, where speed does not matter and a kernel for each
    /// instruction set would only make the library larger.
    fn advance_singly_by<M: Step>(&mut self, dt: f64, steps: u64) -> Job<'_> {
        if self.batch.torques.is_empty() {
            self.advance_blocks(dt, steps, one_by_one::<T, M, Nothing>)
        } else {
            self.advance_blocks(dt, steps, one_by_one::<T, M, AllTorques>)
        }
    }

    /// In lanes or one by one, according to the session's width.
    fn advance_in<M: Step, S: LaneTorques>(&mut self, dt: f64, steps: u64) -> Job<'_> {
        let kernel = if self.width.has_lanes::<T>() { in_lanes::<T, M, S> } else { one_by_one::<T, M, S> };
        self.advance_blocks(dt, steps, kernel)
    }

    /// Blocks are independent, so each runs all its steps before the next begins and stays in registers meanwhile.
    ///
    /// The kernel is a value, so that hundreds of kernels share one loop over blocks.
    fn advance_blocks(&mut self, dt: f64, steps: u64, kernel: fn(Block<'_, '_, T>)) -> Job<'_> {
        self.advance_blocks_of(BLOCK, dt, steps, kernel)
    }

    /// The same in blocks of at most so many bodies.
    fn advance_blocks_of(&mut self, most: usize, dt: f64, steps: u64, kernel: fn(Block<'_, '_, T>)) -> Job<'_> {
        let Self { batch, clock, .. } = self;
        let start = *clock;
        let Batch { body_count, stride, parameters, state, torques, .. } = batch;
        let (body_count, stride) = (*body_count, *stride);
        let source = Source { table: torques, parameters, stride, clock: start, dt };
        let dt_words = two_words::<T>(dt);
        let block = block_of(body_count, most);
        let blocks = column_parts(state, stride, 0..stride, block);
        Box::new(move |watch: &Watch| {
            let advance = |index: usize, mut columns: Vec<&mut [T]>| {
                let first = index * block;
                let bodies = block.min(body_count.saturating_sub(first));
                let mut left = steps;
                while left > 0 && watch.goes_on() {
                    let slice = left.min(SLICE / block as u64);
                    kernel(Block {
                        source,
                        first,
                        state: &mut columns,
                        dt_words,
                        bodies,
                        first_step: steps - left,
                        steps: slice,
                    });
                    left -= slice;
                    watch.add(slice * bodies as u64);
                }
            };
            if steps.saturating_mul(body_count as u64) <= FEW_BODY_STEPS {
                blocks.into_iter().enumerate().for_each(|(index, columns)| advance(index, columns));
            } else {
                parallel::for_each_task(blocks, advance);
            }
            *clock = start.after(dt, steps);
        })
    }
}

/// Some steps of one block.
struct Block<'a, 'b, T> {
    source: Source<'a, T>,
    /// Its first body.
    first: usize,
    state: &'a mut [&'b mut [T]],
    /// A step in s.
    dt_words: TwoWords<T>,
    /// Bodies in the block; lane groups without bodies are skipped.
    bodies: usize,
    first_step: u64,
    steps: u64,
}

fn in_lanes<T: LaneScalar, M: Step, S: LaneTorques>(block: Block<'_, '_, T>) {
    T::dispatch(Advance::<T, M, S>(block, PhantomData));
}

fn one_by_one<T: Scalar, M: Step, S: LaneTorques>(block: Block<'_, '_, T>) {
    Advance::<T, M, S>(block, PhantomData).run::<T>();
}

/// Advances a block, lane group by lane group.
struct Advance<'a, 'b, T, M, S>(Block<'a, 'b, T>, PhantomData<(M, S)>);

impl<T: Scalar, M: Step, S: LaneTorques> LaneTask<T> for Advance<'_, '_, T, M, S> {
    type Output = ();
    const IN_LANES_ONLY: bool = true;

    #[inline(always)]
    fn run<R: Real<Scalar = T>>(self) {
        let Self(block, _) = self;
        let workspace = block.source.workspace();
        for offset in (0..block.bodies).step_by(R::LANES) {
            let columns = block.source.group(block.first + offset, &workspace);
            let (body, rate) = load_body(|column| columns.column(column));
            let torques = S::at(columns);
            let dt = block.dt_words.times(rate);
            let wanted = M::INVARIANTS && <S::At<'_, R> as TorqueKernel<R>>::FREE;
            let invariants = load_invariants(wanted, |column| columns.column(column));
            let mut state = load_state(|column| R::load(&block.state[column][offset..]));
            let prepared = M::prepare::<R, S::At<'_, R>>(&body, &invariants, dt);
            for step in 0..block.steps {
                state = M::step(&body, &prepared, &torques, block.first_step + step, dt, state);
                state = torques.projected(&body, state);
            }
            store_state(&state, |column, number: R| number.store(&mut block.state[column][offset..]));
        }
    }
}
