//! A batch on a device, advanced slice by slice.

use std::ops::Range;
use std::sync::Arc;
use std::time::Instant;

use glam::DVec3;

use super::buffers::{Chunk, Columns, DeviceScalar, Slice};
use super::device::Device;
use super::dispatch::{Slicer, next_group};
use super::observe::Reducer;
use super::pipelines::Kernel;
use super::reading::Reader;
use crate::bodies::columns::StateWords;
use crate::engine::controlled::Written;
use crate::engine::{Observer, Progress, Session, SteppedSession, check_step};
use crate::error::{Error, Result};
use crate::math::clock::Clock;

pub(super) struct GpuSession<T> {
    pub device: Arc<Device>,
    pub kernel: Kernel,
    pub columns: Columns,
    pub body_count: usize,
    /// The time of the state.
    pub clock: Clock,
    pub slicer: Slicer,
    /// Whether the session moves centres of mass.
    pub carries: bool,
    pub reducer: Reducer,
    pub scalar: std::marker::PhantomData<T>,
}

/// The methods by which a session reports its bodies, whose chunks and reader are in these fields.
macro_rules! bodies_in {
    ($($chunks:ident).+, $($reader:ident).+) => {
        fn body_count(&self) -> usize {
            self.body_count
        }

        fn read(&mut self, bodies: Range<usize>) -> Result<StateWords> {
            let places: Vec<_> = self.$($chunks).+.iter().map(|chunk| chunk.place()).collect();
            let reader = self.$($reader).+.as_mut();
            reader.map_or_else(|| Ok(StateWords::default()), |reader| reader.read::<T>(&self.device, &places, bodies))
        }

        fn read_rows(&mut self, rows: &[usize]) -> Result<StateWords> {
            let places: Vec<_> = self.$($chunks).+.iter().map(|chunk| chunk.place()).collect();
            $crate::engine::gpu::reading::read_single_rows::<T>(&self.device, &places, rows)
        }

        fn prefetch(&mut self, bodies: Range<usize>) -> Result<()> {
            let places: Vec<_> = self.$($chunks).+.iter().map(|chunk| chunk.place()).collect();
            self.$($reader).+.as_mut().map_or(Ok(()), |reader| reader.prefetch::<T>(&self.device, &places, &bodies))
        }

        fn watch(
            &mut self,
            statistics: &[$crate::kernel::observe::Statistic],
            frames: &[$crate::bodies::BodyFrame],
            blocks: &$crate::engine::reduction::BlockRows,
            fastest: f64,
        ) -> Result<()> {
            let places: Vec<_> = self.$($chunks).+.iter().map(|chunk| chunk.place()).collect();
            self.reducer.watch::<T>(&self.device, &places, (statistics, frames), blocks, fastest)
        }

        fn reduce(&mut self) -> Result<Vec<Vec<$crate::kernel::observe::Partial<f64>>>> {
            self.reducer.reduce::<T>(&self.device)
        }

        fn marked(&mut self) -> Result<$crate::engine::reduction::Marked> {
            self.reducer.marked(&self.device)
        }

        fn watch_quantities(
            &mut self,
            asked: &$crate::engine::reduction::AskedOfBodies<'_>,
            frames: &[$crate::bodies::BodyFrame],
            blocks: &$crate::engine::reduction::BlockRows,
        ) -> Result<bool> {
            let places: Vec<_> = self.$($chunks).+.iter().map(|chunk| chunk.place()).collect();
            self.reducer.watch_quantities::<T>(&self.device, &places, (asked, frames), blocks)
        }

        fn gather(&mut self, time: f64) -> Result<$crate::engine::reduction::Formed> {
            self.reducer.gather(&self.device, time)
        }
    };
}

pub(super) use bodies_in;

impl<T: DeviceScalar> Session for GpuSession<T> {
    bodies_in!(columns.chunks, columns.reader);

    fn write_parameters(&mut self, written: &Written) -> Result<()> {
        self.columns.write_parameters::<T>(&self.device, written)
    }

    fn keep(&mut self, bodies: &[usize]) -> Result<()> {
        self.columns.keep::<T>(&self.device, bodies)?;
        self.body_count = bodies.len();
        Ok(())
    }

    fn read_centres(&mut self, bodies: Range<usize>) -> Result<Vec<(DVec3, DVec3)>> {
        let places: Vec<_> = self.columns.chunks.iter().map(Chunk::place).collect();
        match &mut self.columns.reader {
            Some(reader) if self.carries => reader.read_centres::<T>(&self.device, &places, bodies),
            _ => Ok(Vec::new()),
        }
    }
}

impl<T: DeviceScalar> SteppedSession for GpuSession<T> {
    fn ready(&mut self) -> Result<()> {
        self.kernel.pipeline().map(drop)
    }

    fn advance(&mut self, dt: f64, steps: u64, observer: &mut Observer<'_>) -> Result<()> {
        check_step(dt, T::PRECISION)?;
        self.columns.reader.iter_mut().for_each(Reader::discard);
        let start_clock = self.clock;
        let dt_words = T::two_words(dt);
        let total = steps.saturating_mul(self.body_count as u64);
        let mut done = 0_u64;
        let pipeline = self.kernel.pipeline()?;
        let sizes: Vec<usize> = self.columns.chunks.iter().map(|chunk| chunk.bodies).collect();
        let mut left = vec![steps; sizes.len()];
        while let Some(group) = next_group(&sizes, &left, self.slicer.group_bodies()) {
            let bodies: usize = sizes[group.clone()].iter().sum();
            let first_step = steps - left[group.start];
            let count = self.slicer.steps(bodies, left[group.start]);
            let clock = start_clock.after(dt, first_step);
            let slice = Slice { first_step, steps: count, dt: dt_words, clock, units: clock.units(dt) };
            let start = Instant::now();
            run(&self.device, &pipeline, &self.columns.chunks[group.clone()], &slice)?;
            self.slicer.record(bodies, count, start.elapsed());
            left[group].iter_mut().for_each(|left| *left -= u64::from(count));
            done += u64::from(count) * bodies as u64;
            if done < total && observer(Progress { done, total }).is_break() {
                return Err(Error::Interrupted { steps: done / self.body_count as u64 });
            }
        }
        self.clock = start_clock.after(dt, steps);
        // All is done, so a break has nothing left to stop.
        let _ = observer(Progress { done, total });
        Ok(())
    }
}

impl<T> Drop for GpuSession<T> {
    fn drop(&mut self) {
        self.reducer.release();
        self.columns.release(&self.device);
    }
}

/// One submission: the steps of a slice for every chunk of a group.
fn run<T: DeviceScalar>(
    device: &Device,
    pipeline: &wgpu::ComputePipeline,
    group: &[Chunk],
    slice: &Slice<T>,
) -> Result<()> {
    let commands = device.scoped(|| {
        let mut encoder =
            device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("advance") });
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(pipeline);
        for chunk in group {
            chunk.set(device, slice);
            chunk.dispatch(device, &mut pass);
        }
        drop(pass);
        encoder.finish()
    });
    device.submit(Some(commands.map_err(|refusal| device.refused(refusal))?))
}
