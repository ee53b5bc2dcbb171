//! Bodies on a device: what sessions of all kinds share, and batches in equal steps, advanced slice by slice.

use std::marker::PhantomData;
use std::ops::Range;
use std::sync::Arc;
use std::time::Instant;

use glam::DVec3;

use super::GpuOptions;
use super::buffers::{CHUNK_BODIES, Chunk, DeviceScalar, Place, STAGING_BYTES, Slice, Upload, chunk_capacity, require};
use super::device::{Device, Refusal};
use super::dispatch::{Slicer, next_group};
use super::observe::{ObserveKernels, Reducer};
use super::pipelines::Kernel;
use super::reading::{Reader, keep_bodies, read_single_rows};
use crate::bodies::BodyFrame;
use crate::bodies::blocks::cut;
use crate::bodies::columns::StateWords;
use crate::engine::checks::check_step;
use crate::engine::controlled::Written;
use crate::engine::reduction::{AskedOfBodies, BlockRows, Formed, Marked};
use crate::engine::{End, Observer, Progress, Session, StepCounts};
use crate::error::{Error, Result};
use crate::kernel::method::rk8_adaptive::Controller;
use crate::kernel::observe::{Partial, Statistic};
use crate::math::clock::Clock;
use crate::math::equal_steps::Interval;

/// Some bodies in buffers of their own.
pub(super) trait DeviceChunk: Send {
    /// Where the state is.
    fn place(&self) -> Place<'_>;

    /// Moves some of the rows, ascending, to the front.
    fn move_rows<T: DeviceScalar>(&self, device: &Device, reader: &mut Reader, rows: &[usize]) -> Result<()>;

    /// From now on its first rows are these bodies of the session, and no other row is a body.
    fn set_bodies(&mut self, bodies: Range<usize>);

    /// Writes columns of parameters of those bodies that it has.
    fn write_parameters<T: DeviceScalar>(&self, _: &Device, _: &Written) -> Result<()> {
        Ok(())
    }

    /// Frees the memory.
    fn destroy(&self);
}

/// How the bodies of a session are brought to a time.
pub(super) trait Kind: Send + Sized {
    type Chunk: DeviceChunk;

    /// The most bodies of a chunk.
    const CHUNK_BODIES: usize;

    /// The least number of bytes that can be read at a time.
    const READ_BYTES: u64 = 0;

    /// Whether centres of mass are moved.
    fn carries(&self) -> bool {
        false
    }

    /// [`Session::advance_to`].
    fn advance_to<T: DeviceScalar>(
        session: &mut GpuSession<T, Self>,
        end: End,
        observer: &mut Observer<'_>,
    ) -> Result<()>;

    /// [`Session::attempt`].
    fn attempt<T: DeviceScalar>(_: &mut GpuSession<T, Self>, _end: f64, _: &mut [Controller<f64>]) -> Result<()> {
        Ok(())
    }

    /// [`Session::counts`].
    fn counts<T: DeviceScalar>(_: &mut GpuSession<T, Self>) -> Result<Vec<StepCounts>> {
        Ok(Vec::new())
    }

    /// [`Session::side_by_side`].
    fn side_by_side(&self) -> usize {
        1
    }

    /// [`Session::imbalance`].
    fn imbalance(&self) -> f64 {
        1.0
    }
}

/// Bodies on a device.
pub(super) struct GpuSession<T, K: Kind> {
    pub device: Arc<Device>,
    pub kernel: Kernel,
    pub chunks: Vec<K::Chunk>,
    /// `None` without bodies.
    pub reader: Option<Reader>,
    pub body_count: usize,
    pub reducer: Reducer,
    pub kind: K,
    scalar: PhantomData<T>,
}

/// What a session begins with.
pub(super) struct Start<'a> {
    pub device: &'a Arc<Device>,
    pub options: &'a GpuOptions,
    pub observe: &'a Arc<ObserveKernels>,
    pub kernel: Kernel,
    pub body_count: usize,
    /// Where chunks are best cut.
    pub ends: &'a [usize],
    /// Bytes of a body's row in the widest buffer, and in all of them.
    pub row_bytes: (usize, usize),
}

impl Start<'_> {
    /// Allocates chunks and uploads their bodies; on an error nothing is left allocated.
    ///
    /// The rows between a chunk's last body and its stride are NaN, so that a result that depends on them is noticed.
    pub fn session<T: DeviceScalar, K: Kind>(
        self,
        kind: K,
        new_chunk: impl Fn(Range<usize>) -> Result<K::Chunk, Refusal>,
        upload_chunk: impl Fn(&K::Chunk, &mut Upload<'_>) -> Result<()>,
    ) -> Result<GpuSession<T, K>> {
        let Self { device, options, observe, kernel, body_count, ends, row_bytes: (widest, all) } = self;
        let capacity = chunk_capacity(device, &options.chunk, widest, K::CHUNK_BODIES)?;
        let needed = (body_count as u64).saturating_mul(all as u64).saturating_add(STAGING_BYTES as u64);
        require(device, body_count, needed, options.memory)?;
        // Dropped on an error, the session releases what it has.
        let mut session = GpuSession {
            device: Arc::clone(device),
            kernel,
            chunks: Vec::new(),
            reader: None,
            body_count,
            reducer: Reducer::new(observe),
            kind,
            scalar: PhantomData,
        };
        let mut allocate = || {
            if body_count > 0 {
                session.reader = Some(Reader::new::<T>(device, body_count, K::READ_BYTES)?);
            }
            for bodies in cut(body_count, capacity, ends) {
                session.chunks.push(new_chunk(bodies)?);
            }
            Ok(())
        };
        allocate().map_err(|refusal| match refusal {
            Refusal::OutOfMemory => {
                Error::DeviceMemory { adapter: device.info.name.clone(), bodies: body_count, needed }
            }
            other => device.refused(other),
        })?;
        let mut upload = Upload::new(device);
        session.chunks.iter().try_for_each(|chunk| upload_chunk(chunk, &mut upload))?;
        upload.finish()?;
        Ok(session)
    }
}

fn places<C: DeviceChunk>(chunks: &[C]) -> Vec<Place<'_>> {
    chunks.iter().map(DeviceChunk::place).collect()
}

impl<T: DeviceScalar, K: Kind> Session for GpuSession<T, K> {
    fn body_count(&self) -> usize {
        self.body_count
    }

    fn ready(&mut self) -> Result<()> {
        self.kernel.pipeline().map(drop)
    }

    fn advance_to(&mut self, end: End, observer: &mut Observer<'_>) -> Result<()> {
        K::advance_to(self, end, observer)
    }

    fn attempt(&mut self, end: f64, controllers: &mut [Controller<f64>]) -> Result<()> {
        K::attempt(self, end, controllers)
    }

    fn counts(&mut self) -> Result<Vec<StepCounts>> {
        K::counts(self)
    }

    fn side_by_side(&self) -> usize {
        self.kind.side_by_side()
    }

    fn imbalance(&mut self) -> Result<f64> {
        Ok(self.kind.imbalance())
    }

    fn read(&mut self, bodies: Range<usize>) -> Result<StateWords> {
        let places = places(&self.chunks);
        let reader = self.reader.as_mut();
        reader.map_or_else(|| Ok(StateWords::default()), |reader| reader.read::<T>(&self.device, &places, bodies))
    }

    fn read_rows(&mut self, rows: &[usize]) -> Result<StateWords> {
        read_single_rows::<T>(&self.device, &places(&self.chunks), rows)
    }

    fn prefetch(&mut self, bodies: Range<usize>) -> Result<()> {
        let places = places(&self.chunks);
        self.reader.as_mut().map_or(Ok(()), |reader| reader.prefetch::<T>(&self.device, &places, &bodies))
    }

    fn read_centres(&mut self, bodies: Range<usize>) -> Result<Vec<(DVec3, DVec3)>> {
        let places = places(&self.chunks);
        match &mut self.reader {
            Some(reader) if self.kind.carries() => reader.read_centres::<T>(&self.device, &places, bodies),
            _ => Ok(Vec::new()),
        }
    }

    fn watch(
        &mut self,
        statistics: &[Statistic],
        frames: &[BodyFrame],
        blocks: &BlockRows,
        fastest: f64,
    ) -> Result<()> {
        let places = places(&self.chunks);
        self.reducer.watch::<T>(&self.device, &places, (statistics, frames), blocks, fastest)
    }

    fn reduce(&mut self) -> Result<Vec<Vec<Partial<f64>>>> {
        self.reducer.reduce::<T>(&self.device)
    }

    fn marked(&mut self) -> Result<Marked> {
        self.reducer.marked(&self.device)
    }

    fn watch_quantities(
        &mut self,
        asked: &AskedOfBodies<'_>,
        frames: &[BodyFrame],
        blocks: &BlockRows,
    ) -> Result<bool> {
        let places = places(&self.chunks);
        self.reducer.watch_quantities::<T>(&self.device, &places, (asked, frames), blocks)
    }

    fn gather(&mut self, time: f64) -> Result<Formed> {
        self.reducer.gather(&self.device, time)
    }

    fn write_parameters(&mut self, written: &Written) -> Result<()> {
        self.chunks.iter().try_for_each(|chunk| chunk.write_parameters::<T>(&self.device, written))
    }

    fn keep(&mut self, bodies: &[usize]) -> Result<()> {
        let Some(reader) = &mut self.reader else { return Ok(()) };
        keep_bodies::<T, _>(&self.device, reader, &mut self.chunks, bodies)?;
        self.body_count = bodies.len();
        Ok(())
    }
}

impl<T, K: Kind> Drop for GpuSession<T, K> {
    /// Frees the memory at once, not only when wgpu next polls.
    fn drop(&mut self) {
        self.reducer.release();
        self.chunks.drain(..).for_each(|chunk| chunk.destroy());
        self.reader.iter_mut().for_each(Reader::release);
        self.device.release();
    }
}

/// Steps of equal length.
pub(super) struct Equal {
    /// The time of the state.
    pub clock: Clock,
    pub slicer: Slicer,
    /// Whether the session moves centres of mass.
    pub carries: bool,
}

impl Kind for Equal {
    type Chunk = Chunk;
    const CHUNK_BODIES: usize = CHUNK_BODIES;

    fn carries(&self) -> bool {
        self.carries
    }

    fn advance_to<T: DeviceScalar>(
        session: &mut GpuSession<T, Self>,
        end: End,
        observer: &mut Observer<'_>,
    ) -> Result<()> {
        let Interval { steps, dt } = end.steps;
        check_step(dt, T::PRECISION)?;
        session.reader.iter_mut().for_each(Reader::discard);
        let start_clock = session.kind.clock;
        let dt_words = T::two_words(dt);
        let total = steps.saturating_mul(session.body_count as u64);
        let mut done = 0_u64;
        let pipeline = session.kernel.pipeline()?;
        let sizes: Vec<usize> = session.chunks.iter().map(|chunk| chunk.bodies).collect();
        let mut left = vec![steps; sizes.len()];
        while let Some(group) = next_group(&sizes, &left, session.kind.slicer.group_bodies()) {
            let bodies: usize = sizes[group.clone()].iter().sum();
            let first_step = steps - left[group.start];
            let count = session.kind.slicer.steps(bodies, left[group.start]);
            let clock = start_clock.after(dt, first_step);
            let slice = Slice { first_step, steps: count, dt: dt_words, clock, units: clock.units(dt) };
            let start = Instant::now();
            run(&session.device, &pipeline, &session.chunks[group.clone()], &slice)?;
            session.kind.slicer.record(bodies, count, start.elapsed());
            left[group].iter_mut().for_each(|left| *left -= u64::from(count));
            done += u64::from(count) * bodies as u64;
            if done < total && observer(Progress { done, total }).is_break() {
                return Err(Error::Interrupted { steps: done / session.body_count as u64 });
            }
        }
        session.kind.clock = start_clock.after(dt, steps);
        // All is done, so a break has nothing left to stop.
        let _ = observer(Progress { done, total });
        Ok(())
    }
}

/// One submission: the steps of a slice for every chunk of a group.
fn run<T: DeviceScalar>(
    device: &Device,
    pipeline: &wgpu::ComputePipeline,
    group: &[Chunk],
    slice: &Slice<T>,
) -> Result<()> {
    let commands = device.encoded("advance", |encoder| {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(pipeline);
        for chunk in group {
            chunk.set(device, slice);
            chunk.dispatch(device, &mut pass);
        }
    })?;
    device.submit(Some(commands))
}
