//! A batch on a device whose bodies take steps of their own size.
//!
//! A dispatch advances a list of bodies by a bounded number of attempts and says of each how many it made and whether it is
//! still under way. Those that are make the list of the next dispatch, so that a finished body holds its workgroup no
//! longer than one dispatch. No body reads what another wrote, so that results depend neither on lists nor on cuts.

mod chunk;

use std::collections::HashMap;
use std::ops::Range;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::Instant;

use super::GpuOptions;
use super::buffers::{DeviceScalar, STAGING_BYTES, WORKGROUP_SIZE, buffer, chunk_capacity, require};
use super::device::{Device, Refusal};
use super::dispatch::Slicer;
use super::observe::{ObserveKernels, Reducer, reduces};
use super::reading::{read_block, read_single_rows};
use super::shader::Source;
use crate::bodies::BodyFrame;
use crate::bodies::columns::{StateWords, state_columns};
use crate::engine::adaptive_session::{AdaptiveSession, StepCounts};
use crate::engine::batch::Batch;
use crate::engine::reduction::{Marked, Reduce};
use crate::engine::{Observer, Progress, check_time};
use crate::error::{Error, Result};
use crate::kernel::method::Method;
use crate::kernel::method::rk8_adaptive::Controller;
use crate::kernel::observe::{Partial, Statistic};
use crate::math::Precision;
use crate::math::clock::Clock;
use crate::scene::AdaptiveSteps;
use chunk::{BINDINGS, Chunk, Interval, READ_ONLY, next_group, row_bytes, rows_in, staging_bytes};

/// The kernels' bindings, and their pipelines, made on first use.
#[derive(Debug, Default)]
pub(super) struct AdaptiveKernels {
    layout: OnceLock<wgpu::BindGroupLayout>,
    pipelines: Mutex<HashMap<super::shader::Key, wgpu::ComputePipeline>>,
}

struct GpuAdaptiveSession<T> {
    device: Arc<Device>,
    pipeline: wgpu::ComputePipeline,
    chunks: Vec<Chunk>,
    staging: Option<wgpu::Buffer>,
    body_count: usize,
    steps: AdaptiveSteps,
    /// The time that the state stands at.
    clock: Clock,
    slicer: Slicer,
    bytes_read: u64,
    /// Attempts so far, alone and with those that bodies waited.
    attempts: u64,
    held: u64,
    reducer: Reducer,
    scalar: std::marker::PhantomData<T>,
}

impl AdaptiveKernels {
    /// Uploads a batch; on an error nothing is left allocated. `tapped`: whether an attempt leaves evaluations in place of states.
    pub fn start<T: DeviceScalar>(
        &self,
        device: &Arc<Device>,
        batch: &Batch<T>,
        steps: AdaptiveSteps,
        tapped: bool,
        options: &GpuOptions,
        observe: &Arc<ObserveKernels>,
    ) -> Result<Box<dyn AdaptiveSession>> {
        let layout = self.layout.get_or_init(|| bind_group_layout(&device.device));
        let precision = if T::WORDS == 2 { Precision::F32 } else { Precision::F64 };
        let pipeline = self.pipeline(device, layout, Source::adaptive(precision, &batch.torques), tapped, options)?;
        let (widest, row) = row_bytes::<T>(batch.parameter_columns());
        let capacity = chunk_capacity(device, &options.chunk, widest)?;
        let needed = (batch.body_count as u64).saturating_mul(row as u64).saturating_add(STAGING_BYTES as u64);
        require(device, batch.body_count, needed, options.memory)?;
        let mut session = GpuAdaptiveSession {
            device: Arc::clone(device),
            pipeline,
            chunks: Vec::new(),
            staging: None,
            body_count: batch.body_count,
            steps,
            clock: batch.torques.clock(),
            slicer: Slicer::new(options.slice, batch.loops_of_a_step(Method::Rk8)),
            bytes_read: 0,
            attempts: 0,
            held: 0,
            reducer: Reducer::new(observe),
            scalar: std::marker::PhantomData,
        };
        // Dropped on an error, the session releases what it has.
        session.allocate(layout, batch, capacity).map_err(|refusal| match refusal {
            Refusal::OutOfMemory => {
                Error::DeviceMemory { adapter: device.info.name.clone(), bodies: batch.body_count, needed }
            }
            other => device.refused(other),
        })?;
        for chunk in &session.chunks {
            chunk.upload(device, batch)?;
        }
        Ok(Box::new(session))
    }

    fn pipeline(
        &self,
        device: &Device,
        layout: &wgpu::BindGroupLayout,
        source: Source,
        tapped: bool,
        options: &GpuOptions,
    ) -> Result<wgpu::ComputePipeline> {
        let with_tap = |source: Source| if tapped { source.tapped() } else { source };
        let key = with_tap(source.clone()).key();
        let mut pipelines = self.pipelines.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(pipeline) = pipelines.get(&key) {
            return Ok(pipeline.clone());
        }
        let source = with_tap(source.patched(&options.patches)?);
        let pipeline_layout = super::pipeline_layout(&device.device, layout);
        let pipeline = source.compile(&device.device, &pipeline_layout, Some(WORKGROUP_SIZE))?;
        pipelines.insert(key, pipeline.clone());
        Ok(pipeline)
    }
}

fn bind_group_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let entries: [_; BINDINGS] = std::array::from_fn(|binding| wgpu::BindGroupLayoutEntry {
        binding: binding as u32,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer {
            ty: match binding {
                0 => wgpu::BufferBindingType::Uniform,
                _ => wgpu::BufferBindingType::Storage { read_only: READ_ONLY[binding] },
            },
            has_dynamic_offset: false,
            min_binding_size: None,
        },
        count: None,
    });
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some("adaptive"), entries: &entries })
}

impl<T: DeviceScalar> GpuAdaptiveSession<T> {
    fn allocate(
        &mut self,
        layout: &wgpu::BindGroupLayout,
        batch: &Batch<T>,
        capacity: usize,
    ) -> std::result::Result<(), Refusal> {
        if batch.body_count == 0 {
            return Ok(());
        }
        let read = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let bytes = staging_bytes::<T>(batch.body_count, self.slicer.group_bodies());
        self.staging = Some(buffer(&self.device, "staging", bytes, read)?);
        for first in (0..batch.body_count).step_by(capacity) {
            let bodies = capacity.min(batch.body_count - first);
            self.chunks.push(Chunk::new::<T>(&self.device, layout, first, bodies, batch.parameter_columns())?);
        }
        Ok(())
    }

    /// One submission: at most `attempts` attempts of each body in the lists of a group of chunks. Gives the most attempts
    /// of a body and the number of bodies that have come to their end.
    fn run(&mut self, group: &[usize], interval: &Interval<T>, attempts: u32) -> Result<(u32, usize)> {
        let Some(staging) = &self.staging else { return Ok((0, 0)) };
        let device = Arc::clone(&self.device);
        let chunks = &mut self.chunks;
        let commands = device.scoped(|| {
            let label = Some("adaptive");
            let mut encoder = device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label });
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(&self.pipeline);
            for &index in group {
                chunks[index].set(&device.queue, interval, attempts);
                chunks[index].dispatch(&mut pass);
            }
            drop(pass);
            let mut offset = 0;
            for &index in group {
                chunks[index].copy_outcomes(&mut encoder, staging, offset);
                offset += chunks[index].outcome_bytes();
            }
            (encoder.finish(), offset)
        });
        let (commands, bytes) = commands.map_err(|refusal| device.refused(refusal))?;
        let tallies = device.read(commands, staging, 0..bytes, |view| {
            let mut outcomes: &[u32] = bytemuck::cast_slice(view);
            let mut tallies = Vec::with_capacity(group.len());
            for &index in group {
                let (own, others) = outcomes.split_at(chunks[index].list.len());
                tallies.push(chunks[index].compact(own));
                outcomes = others;
            }
            tallies
        })?;
        self.bytes_read += bytes;
        self.attempts += tallies.iter().map(|tally| tally.attempts).sum::<u64>();
        self.held += tallies.iter().map(|tally| tally.held).sum::<u64>();
        let longest = tallies.iter().map(|tally| tally.longest).max().unwrap_or(0);
        Ok((longest, tallies.iter().map(|tally| tally.finished).sum()))
    }
}

impl<T: DeviceScalar> AdaptiveSession for GpuAdaptiveSession<T> {
    fn body_count(&self) -> usize {
        self.body_count
    }

    fn advance_to(&mut self, time: f64, observer: &mut Observer<'_>) -> Result<()> {
        check_time(time)?;
        let end = self.clock.at(time.max(0.0));
        if end.now() <= self.clock.now() {
            return Ok(());
        }
        let interval = Interval::new(&self.clock, &end, &self.steps);
        self.chunks.iter_mut().for_each(Chunk::start_interval);
        let (total, mut done) = (self.body_count as u64, 0);
        loop {
            let lists = self.chunks.iter().map(|chunk| chunk.list.len());
            let group = next_group(lists, self.slicer.group_bodies());
            if group.is_empty() {
                break;
            }
            let bodies = group.iter().map(|&index| self.chunks[index].list.len()).sum();
            let fair = group.iter().map(|&index| self.chunks[index].next_attempts()).min().unwrap_or(1);
            let attempts = self.slicer.steps(bodies, u64::from(fair));
            let start = Instant::now();
            let (longest, finished) = self.run(&group, &interval, attempts)?;
            self.slicer.record(bodies, longest.max(1), start.elapsed());
            done += finished as u64;
            if done < total && observer(Progress { done, total }).is_break() {
                return Err(Error::Interrupted { steps: 0 });
            }
        }
        self.clock = end;
        // All is done, so there is nothing left to break off.
        let _ = observer(Progress { done, total });
        Ok(())
    }

    fn attempt(&mut self, end: f64, controllers: &mut [Controller<f64>]) -> Result<()> {
        check_time(end)?;
        let interval = Interval::new(&self.clock, &self.clock.at(end.max(0.0)), &self.steps);
        let before = self.counts()?;
        let device = Arc::clone(&self.device);
        for index in 0..self.chunks.len() {
            self.chunks[index].take_controllers::<T>(&device, controllers)?;
            self.run(&[index], &interval, 1)?;
            let Some(staging) = &self.staging else { continue };
            self.bytes_read += self.chunks[index].give_controllers::<T>(&device, staging, controllers)?;
        }
        for ((controller, before), after) in controllers.iter_mut().zip(before).zip(self.counts()?) {
            controller.accepted += (after.accepted - before.accepted) as f64;
            controller.rejected += (after.rejected - before.rejected) as f64;
        }
        Ok(())
    }

    fn read(&mut self, bodies: Range<usize>) -> Result<StateWords> {
        let mut words = StateWords::default();
        let Some(staging) = &self.staging else { return Ok(words) };
        let block = staging.size() as usize / (state_columns::<T>() * size_of::<T>());
        for chunk in &self.chunks {
            let rows = rows_in(chunk, &bodies);
            for first in rows.clone().step_by(block) {
                let rows = first..(first + block).min(rows.end);
                self.bytes_read +=
                    read_block::<T>(&self.device, &chunk.state, chunk.stride, staging, rows, &mut words)?;
            }
        }
        Ok(words)
    }

    fn counts(&mut self) -> Result<Vec<StepCounts>> {
        let mut counts = Vec::with_capacity(self.body_count);
        let Some(staging) = &self.staging else { return Ok(counts) };
        for chunk in &self.chunks {
            self.bytes_read += chunk.read_counts(&self.device, staging, &mut counts)?;
        }
        Ok(counts)
    }

    fn side_by_side(&self) -> usize {
        WORKGROUP_SIZE as usize
    }

    fn imbalance(&mut self) -> Result<f64> {
        Ok(if self.attempts > 0 { self.held as f64 / self.attempts as f64 } else { 1.0 })
    }

    fn bytes_read(&self) -> u64 {
        self.bytes_read + self.reducer.bytes_read
    }
}

reduces!(GpuAdaptiveSession, chunks, bytes_read);

impl<T> Drop for GpuAdaptiveSession<T> {
    fn drop(&mut self) {
        self.reducer.release();
        self.chunks.drain(..).for_each(|chunk| chunk.destroy());
        if let Some(staging) = self.staging.take() {
            staging.destroy();
        }
        self.device.release();
    }
}
