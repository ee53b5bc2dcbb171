//! Torque-free bodies on a device, evaluated at any time.

use std::ops::Range;
use std::sync::{Arc, OnceLock};

use super::buffers::{DeviceScalar, Place, STAGING_BYTES, Upload, WORKGROUP_SIZE, buffer, chunk_capacity, require};
use super::device::{Device, Refusal};
use super::dispatch::GROUP_BODIES;
use super::observe::{ObserveKernels, Reducer};
use super::pipelines::{Kernel, Pipelines};
use super::reading::{Reader, keep_bodies, keep_rows};
use super::session::bodies_in;
use super::shader::Source;
use super::{GpuOptions, READ, UNIFORM, WRITTEN, bindings, entries};
use crate::bodies::blocks::cut;
use crate::bodies::columns::{STRIDE_UNIT, StateWords, state_columns};
use crate::engine::{FreeSession, Session, check_time};
use crate::error::{Error, Result};
use crate::kernel::free_motion::{FreeMotionRows, ROW_COLUMNS, WORD_COLUMNS};
use crate::math::phase::Time;

/// The kernels' bindings, and the kernels by precision, made on first use.
#[derive(Debug, Default)]
pub(super) struct FreeMotionKernels {
    layout: OnceLock<wgpu::BindGroupLayout>,
    kernels: Pipelines,
}

/// The uniform block of `free_motion.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Settings {
    body_count: u32,
    stride: u32,
    zero: u32,
    padding: u32,
    mantissa: [u32; 2],
    exponent: i32,
    negative: u32,
    /// A `real`, in its first bytes.
    fraction: [u32; 2],
}

/// Some bodies in buffers of their own.
struct Chunk {
    first: usize,
    bodies: usize,
    stride: usize,
    words: wgpu::Buffer,
    constants: wgpu::Buffer,
    state: wgpu::Buffer,
    settings: wgpu::Buffer,
    bind_group: wgpu::BindGroup,
}

impl Chunk {
    /// Where its state is.
    fn place(&self) -> Place<'_> {
        Place { first: self.first, bodies: self.bodies, stride: self.stride, state: &self.state }
    }

    /// Keeps only some of its rows, ascending, whose bodies are then those of the session from `first` on.
    fn keep<T: DeviceScalar>(
        &mut self,
        device: &Device,
        reader: &mut Reader,
        first: usize,
        rows: &[usize],
    ) -> Result<()> {
        if rows.len() < self.bodies {
            let of = (self.stride, self.bodies);
            keep_rows::<u64>(device, &self.words, of, reader.staging(), rows)?;
            keep_rows::<T>(device, &self.constants, of, reader.staging(), rows)?;
        }
        (self.first, self.bodies) = (first, rows.len());
        Ok(())
    }

    /// Frees its memory.
    fn destroy(&self) {
        [&self.words, &self.constants, &self.state, &self.settings].into_iter().for_each(wgpu::Buffer::destroy);
    }
}

struct GpuFreeSession<T> {
    device: Arc<Device>,
    kernel: Kernel,
    chunks: Vec<Chunk>,
    reader: Option<Reader>,
    body_count: usize,
    reducer: Reducer,
    scalar: std::marker::PhantomData<T>,
}

/// Bytes of a body's row in each of the three tables.
fn row_bytes<T: DeviceScalar>() -> [usize; 3] {
    [WORD_COLUMNS * size_of::<u64>(), ROW_COLUMNS * size_of::<T>(), state_columns::<T>() * size_of::<T>()]
}

impl FreeMotionKernels {
    /// Uploads rows; on an error nothing is left allocated.
    pub fn start<T: DeviceScalar>(
        &self,
        device: &Arc<Device>,
        rows: &FreeMotionRows<T>,
        options: &GpuOptions,
        observe: &Arc<ObserveKernels>,
    ) -> Result<Box<dyn FreeSession>> {
        let layout =
            self.layout.get_or_init(|| bindings(&device.device, "free motion", &[UNIFORM, READ, READ, WRITTEN]));
        let kernel = self.kernel::<T>(device, layout, options)?;
        let bytes = row_bytes::<T>();
        let capacity = chunk_capacity(device, &options.chunk, bytes.into_iter().max().unwrap_or(0), GROUP_BODIES)?;
        let needed = (rows.body_count as u64).saturating_mul(bytes.iter().sum::<usize>() as u64);
        require(device, rows.body_count, needed.saturating_add(STAGING_BYTES as u64), options.memory)?;
        let mut session = GpuFreeSession {
            device: Arc::clone(device),
            kernel,
            chunks: Vec::new(),
            reader: None,
            body_count: rows.body_count,
            reducer: Reducer::new(observe),
            scalar: std::marker::PhantomData,
        };
        // Dropped on an error, the session releases what it has.
        session.allocate(layout, rows, capacity).map_err(|refusal| match refusal {
            Refusal::OutOfMemory => {
                Error::DeviceMemory { adapter: device.info.name.clone(), bodies: rows.body_count, needed }
            }
            other => device.refused(other),
        })?;
        session.upload(rows)?;
        Ok(Box::new(session))
    }

    fn kernel<T: DeviceScalar>(
        &self,
        device: &Arc<Device>,
        layout: &wgpu::BindGroupLayout,
        options: &GpuOptions,
    ) -> Result<Kernel> {
        let source = Source::free_motion(T::PRECISION);
        let key = source.key();
        let source = source.patched(&options.patches)?;
        let layout = super::pipeline_layout(&device.device, layout);
        Ok(self.kernels.get(device, key, move |device| source.compile(device, &layout, Some(WORKGROUP_SIZE))))
    }
}

impl<T: DeviceScalar> GpuFreeSession<T> {
    fn allocate(
        &mut self,
        layout: &wgpu::BindGroupLayout,
        rows: &FreeMotionRows<T>,
        capacity: usize,
    ) -> Result<(), Refusal> {
        if rows.body_count == 0 {
            return Ok(());
        }
        let device = Arc::clone(&self.device);
        self.reader = Some(Reader::new::<T>(&device, rows.body_count, 0)?);
        for Range { start: first, end } in cut(rows.body_count, capacity, &rows.ends) {
            let bodies = end - first;
            let stride = bodies.next_multiple_of(STRIDE_UNIT);
            let [words, constants, state] = row_bytes::<T>().map(|row| (row * stride) as u64);
            let input = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
            let output = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
            let uniform = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
            let words = buffer(&device, "words", words, input | output)?;
            let constants = buffer(&device, "constants", constants, input | output)?;
            let state = buffer(&device, "state", state, output)?;
            let settings = buffer(&device, "settings", size_of::<Settings>() as u64, uniform)?;
            let bind_group = device.scoped(|| {
                device.device.create_bind_group(&wgpu::BindGroupDescriptor {
                    label: Some("free motion"),
                    layout,
                    entries: &entries([&settings, &words, &constants, &state]),
                })
            })?;
            self.chunks.push(Chunk { first, bodies, stride, words, constants, state, settings, bind_group });
        }
        Ok(())
    }

    fn upload(&self, rows: &FreeMotionRows<T>) -> Result<()> {
        let mut upload = Upload::new(&self.device);
        for chunk in &self.chunks {
            let bodies = chunk.first..chunk.first + chunk.bodies;
            upload.columns(&chunk.words, chunk.stride, &rows.words, rows.stride, bodies.clone(), u64::MAX)?;
            let nan = T::from_f64(f64::NAN);
            upload.columns(&chunk.constants, chunk.stride, &rows.constants, rows.stride, bodies, nan)?;
        }
        upload.finish()
    }
}

impl<T: DeviceScalar> Session for GpuFreeSession<T> {
    bodies_in!(chunks, reader);

    fn keep(&mut self, bodies: &[usize]) -> Result<()> {
        let Some(reader) = &mut self.reader else { return Ok(()) };
        keep_bodies(&mut self.chunks, bodies, (Chunk::place, Chunk::destroy), |chunk, first, rows| {
            chunk.keep::<T>(&self.device, reader, first, rows)
        })?;
        self.body_count = bodies.len();
        Ok(())
    }
}

impl<T: DeviceScalar> FreeSession for GpuFreeSession<T> {
    fn evaluate(&mut self, time: f64) -> Result<()> {
        check_time(time)?;
        self.reader.iter_mut().for_each(Reader::discard);
        let exact = Time::from_seconds(time);
        let fraction = T::from_f64(exact.signed_fraction());
        let mut bytes = [0_u8; 8];
        bytes[..size_of::<T>()].copy_from_slice(bytemuck::bytes_of(&fraction));
        let pipeline = self.kernel.pipeline()?;
        let device = &self.device;
        let commands = device.scoped(|| {
            let label = Some("free motion");
            let mut encoder = device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label });
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(&pipeline);
            for chunk in &self.chunks {
                let settings = Settings {
                    body_count: chunk.bodies as u32,
                    stride: chunk.stride as u32,
                    zero: 0,
                    padding: 0,
                    mantissa: [exact.mantissa as u32, (exact.mantissa >> 32) as u32],
                    exponent: exact.exponent,
                    negative: u32::from(exact.negative),
                    fraction: bytemuck::cast(bytes),
                };
                device.write(&chunk.settings, 0, bytemuck::bytes_of(&settings));
                pass.set_bind_group(0, &chunk.bind_group, &[]);
                device.dispatch(&mut pass, (chunk.bodies as u32).div_ceil(WORKGROUP_SIZE));
            }
            drop(pass);
            encoder.finish()
        });
        device.submit(Some(commands.map_err(|refusal| device.refused(refusal))?))
    }
}

impl<T> Drop for GpuFreeSession<T> {
    fn drop(&mut self) {
        self.reducer.release();
        self.chunks.drain(..).for_each(|chunk| chunk.destroy());
        self.reader.iter_mut().for_each(Reader::release);
        self.device.release();
    }
}
