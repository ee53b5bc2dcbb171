//! The CPU engine: all cores, SIMD lanes chosen at run time.

use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use rayon::prelude::*;

use super::{Backend, Description, EngineKind, FreeSession, Observer, Progress, Session, check_step, check_time};
use crate::batch::{
    AnyBatch, Batch, Precision, StateWords, load_body, load_state, state_columns, store_state, two_words,
};
use crate::error::{Error, Result};
use crate::free_motion::{AnyRows, FreeMotionRows};
use crate::lanes::{LaneScalar, LaneTask};
use crate::method::{Method, Step, dlm::Dlm, rk4::Rk4};
use crate::real::{Real, Scalar};
use crate::torque::Free;
use crate::vector::TwoWords;

/// Whether the CPU engine runs in SIMD lanes or one body at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Width {
    /// The widest lanes of this processor, with fused multiply-add.
    Lanes,
    /// One body at a time without fused multiply-add: the reference in `f64`, the shader's twin in `f32`.
    Scalar,
}

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

impl Backend for Cpu {
    fn description(&self) -> Description {
        let lanes = match self.width {
            Width::Lanes => format!("{} lanes of f32, {} of f64", f32::lane_count(), f64::lane_count()),
            Width::Scalar => "one body at a time".to_owned(),
        };
        Description {
            kind: EngineKind::Cpu,
            name: format!("CPU, {} threads, {lanes}", rayon::current_num_threads()),
            driver: String::new(),
            software: false,
            arithmetic: None,
        }
    }

    fn precisions(&self) -> &[Precision] {
        &Precision::ALL
    }

    fn start(&self, batch: AnyBatch, method: Method) -> Result<Box<dyn Session>> {
        Ok(match batch {
            AnyBatch::F32(batch) => Box::new(CpuSession { batch, method, width: self.width }),
            AnyBatch::F64(batch) => Box::new(CpuSession { batch, method, width: self.width }),
        })
    }

    fn start_free(&self, rows: AnyRows) -> Result<Box<dyn FreeSession>> {
        Ok(match rows {
            AnyRows::F32(rows) => CpuFreeSession::start(rows, self.width),
            AnyRows::F64(rows) => CpuFreeSession::start(rows, self.width),
        })
    }
}

/// Rows of constants and the columns of the state that they were last evaluated to.
struct CpuFreeSession<T> {
    rows: FreeMotionRows<T>,
    columns: Batch<T>,
    width: Width,
}

impl<T: LaneScalar> CpuFreeSession<T> {
    fn start(rows: FreeMotionRows<T>, width: Width) -> Box<dyn FreeSession> {
        let state = vec![T::from_f64(f64::NAN); state_columns::<T>() * rows.stride];
        let columns = Batch { body_count: rows.body_count, stride: rows.stride, parameters: Vec::new(), state };
        Box::new(Self { rows, columns, width })
    }
}

impl<T: LaneScalar> FreeSession for CpuFreeSession<T> {
    fn body_count(&self) -> usize {
        self.rows.body_count
    }

    fn evaluate(&mut self, time: f64) -> Result<()> {
        check_time(time)?;
        match self.width {
            Width::Lanes => self.rows.evaluate(time, &mut self.columns.state),
            Width::Scalar => self.rows.evaluate_one_by_one(time, &mut self.columns.state),
        }
        Ok(())
    }

    fn read(&mut self, bodies: Range<usize>) -> Result<StateWords> {
        Ok(self.columns.read(bodies))
    }
}

struct CpuSession<T> {
    batch: Batch<T>,
    method: Method,
    width: Width,
}

/// Bodies that one task advances: a multiple of every lane count.
const BLOCK: usize = 64;

/// Steps between two looks at whether to go on; some milliseconds of work for one block.
const SLICE: u64 = 1 << 16;

impl<T: LaneScalar> Session for CpuSession<T> {
    fn body_count(&self) -> usize {
        self.batch.body_count
    }

    fn advance(&mut self, dt: f64, steps: u64, observer: &mut Observer<'_>) -> Result<()> {
        check_step(dt, if T::WORDS == 2 { Precision::F32 } else { Precision::F64 })?;
        match self.method {
            Method::Rk4 => self.advance_by::<Rk4>(dt, steps, observer),
            Method::Dlm => self.advance_by::<Dlm>(dt, steps, observer),
        }
    }

    fn read(&mut self, bodies: Range<usize>) -> Result<StateWords> {
        Ok(self.batch.read(bodies))
    }
}

impl<T: LaneScalar> CpuSession<T> {
    /// Blocks are independent, so each runs all its steps before the next begins and stays in registers meanwhile.
    /// The calling thread only watches: progress is a count that the workers raise.
    fn advance_by<M: Step>(&mut self, dt: f64, steps: u64, observer: &mut Observer<'_>) -> Result<()> {
        let Batch { body_count, stride, parameters, state } = &mut self.batch;
        let (body_count, stride, width) = (*body_count, *stride, self.width);
        let (done, stop) = (AtomicU64::new(0), AtomicBool::new(false));
        let total = steps.saturating_mul(body_count as u64);
        let dt = two_words::<T>(dt);
        let blocks = split_columns(state, stride, state_columns::<T>());
        let parameters = &*parameters;
        let work = || {
            blocks.into_par_iter().enumerate().for_each(|(index, mut columns)| {
                let start = index * BLOCK;
                let bodies = BLOCK.min(body_count.saturating_sub(start)) as u64;
                let mut left = steps;
                while left > 0 && !stop.load(Ordering::Relaxed) {
                    let slice = left.min(SLICE);
                    let task = AdvanceBlock::<T, M> {
                        parameters,
                        stride,
                        start,
                        state: &mut columns,
                        dt,
                        first_step: steps - left,
                        steps: slice,
                        method: std::marker::PhantomData,
                    };
                    match width {
                        Width::Lanes => T::dispatch(task),
                        Width::Scalar => task.run::<T>(),
                    }
                    left -= slice;
                    done.fetch_add(slice * bodies, Ordering::Relaxed);
                }
            });
        };
        watched(work, observer, &done, total, &stop);
        if stop.into_inner() {
            return Err(Error::Interrupted { steps: done.into_inner() / (body_count as u64).max(1) });
        }
        Ok(())
    }
}

/// Runs `work` on the pool while this thread reports progress, about ten times a second.
fn watched(work: impl FnOnce() + Send, observer: &mut Observer<'_>, done: &AtomicU64, total: u64, stop: &AtomicBool) {
    let (finished, wait) = std::sync::mpsc::channel::<()>();
    std::thread::scope(|scope| {
        scope.spawn(move || {
            work();
            drop(finished);
        });
        let pause = std::time::Duration::from_millis(100);
        while wait.recv_timeout(pause) == Err(std::sync::mpsc::RecvTimeoutError::Timeout) {
            let progress = Progress { done: done.load(Ordering::Relaxed), total };
            if observer(progress).is_break() {
                stop.store(true, Ordering::Relaxed);
            }
        }
    });
    let _ = observer(Progress { done: done.load(Ordering::Relaxed), total });
}

/// The parts of every column that belong to one block, for all blocks.
fn split_columns<T>(state: &mut [T], stride: usize, columns: usize) -> Vec<Vec<&mut [T]>> {
    let mut blocks: Vec<Vec<&mut [T]>> = (0..stride / BLOCK).map(|_| Vec::with_capacity(columns)).collect();
    if stride > 0 {
        for column in state.chunks_exact_mut(stride) {
            for (block, part) in blocks.iter_mut().zip(column.chunks_exact_mut(BLOCK)) {
                block.push(part);
            }
        }
    }
    blocks
}

/// Advances one block, lane group by lane group.
struct AdvanceBlock<'a, 'b, T, M> {
    parameters: &'a [T],
    stride: usize,
    start: usize,
    state: &'a mut [&'b mut [T]],
    dt: TwoWords<T>,
    first_step: u64,
    steps: u64,
    method: std::marker::PhantomData<M>,
}

impl<T: Scalar, M: Step> LaneTask<T> for AdvanceBlock<'_, '_, T, M> {
    type Output = ();

    #[inline(always)]
    fn run<R: Real<Scalar = T>>(self) {
        for offset in (0..BLOCK).step_by(R::LANES) {
            let (body, rate) =
                load_body(|column| R::load(&self.parameters[column * self.stride + self.start + offset..]));
            let dt = TwoWords {
                value: R::splat(self.dt.value.to_f64()) * rate,
                residue: R::splat(self.dt.residue.to_f64()) * rate,
            };
            let mut state = load_state(|column| R::load(&self.state[column][offset..]));
            for step in 0..self.steps {
                state = M::step(&body, &Free, self.first_step + step, dt, state);
            }
            store_state(&state, |column, number: R| number.store(&mut self.state[column][offset..]));
        }
    }
}
