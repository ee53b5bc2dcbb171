//! Torque-free bodies on a device, evaluated at any time.

use std::ops::Range;
use std::sync::{Arc, OnceLock};

use super::buffers::{DeviceScalar, INPUT_AND_OUTPUT, OUTPUT, Place, SETTINGS, Upload, WORKGROUP_SIZE, bind, buffer};
use super::device::{Device, Refusal};
use super::dispatch::GROUP_BODIES;
use super::observe::ObserveKernels;
use super::pipelines::{Kernel, Pipelines};
use super::reading::{Reader, keep_rows};
use super::session::{DeviceChunk, GpuSession, Kind, Start};
use super::shader::Source;
use super::{GpuOptions, READ, UNIFORM, WRITTEN, bindings};
use crate::bodies::columns::{STRIDE_UNIT, state_columns};
use crate::engine::checks::check_time;
use crate::engine::{End, Observer, Session};
use crate::error::Result;
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

impl DeviceChunk for Chunk {
    fn place(&self) -> Place<'_> {
        Place { first: self.first, bodies: self.bodies, stride: self.stride, state: &self.state }
    }

    fn move_rows<T: DeviceScalar>(&self, device: &Device, reader: &mut Reader, rows: &[usize]) -> Result<()> {
        let of = (self.stride, self.bodies);
        keep_rows::<u64>(device, &self.words, of, reader.staging(), rows)?;
        keep_rows::<T>(device, &self.constants, of, reader.staging(), rows)
    }

    fn set_bodies(&mut self, bodies: Range<usize>) {
        (self.first, self.bodies) = (bodies.start, bodies.len());
    }

    fn destroy(&self) {
        [&self.words, &self.constants, &self.state, &self.settings].into_iter().for_each(wgpu::Buffer::destroy);
    }
}

impl Chunk {
    fn new<T: DeviceScalar>(
        device: &Device,
        layout: &wgpu::BindGroupLayout,
        bodies: Range<usize>,
    ) -> Result<Self, Refusal> {
        let stride = bodies.len().next_multiple_of(STRIDE_UNIT);
        let [words, constants, state] = row_bytes::<T>().map(|row| (row * stride) as u64);
        let words = buffer(device, "words", words, INPUT_AND_OUTPUT)?;
        let constants = buffer(device, "constants", constants, INPUT_AND_OUTPUT)?;
        let state = buffer(device, "state", state, OUTPUT)?;
        let settings = buffer(device, "settings", size_of::<Settings>() as u64, SETTINGS)?;
        let bind_group = bind(device, "free motion", layout, [&settings, &words, &constants, &state])?;
        Ok(Self { first: bodies.start, bodies: bodies.len(), stride, words, constants, state, settings, bind_group })
    }

    fn upload<T: DeviceScalar>(&self, upload: &mut Upload<'_>, rows: &FreeMotionRows<T>) -> Result<()> {
        let bodies = self.first..self.first + self.bodies;
        upload.columns(&self.words, self.stride, &rows.words, rows.stride, bodies.clone(), u64::MAX)?;
        upload.columns(&self.constants, self.stride, &rows.constants, rows.stride, bodies, T::from_f64(f64::NAN))
    }
}

/// By closed forms, at any time.
struct Free;

impl Kind for Free {
    type Chunk = Chunk;
    const CHUNK_BODIES: usize = GROUP_BODIES;

    fn advance_to<T: DeviceScalar>(session: &mut GpuSession<T, Self>, end: End, _: &mut Observer<'_>) -> Result<()> {
        check_time(end.time)?;
        session.reader.iter_mut().for_each(Reader::discard);
        let exact = Time::from_seconds(end.time);
        let fraction = T::from_f64(exact.signed_fraction());
        let mut bytes = [0_u8; 8];
        bytes[..size_of::<T>()].copy_from_slice(bytemuck::bytes_of(&fraction));
        let pipeline = session.kernel.pipeline()?;
        let device = &session.device;
        let commands = device.encoded("free motion", |encoder| {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(&pipeline);
            for chunk in &session.chunks {
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
        })?;
        // Whatever reads the states waits.
        device.submit_only(Some(commands)).map(drop)
    }
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
    ) -> Result<Box<dyn Session>> {
        let layout =
            self.layout.get_or_init(|| bindings(&device.device, "free motion", &[UNIFORM, READ, READ, WRITTEN]));
        let kernel = self.kernel::<T>(device, layout, options)?;
        let bytes = row_bytes::<T>();
        let start = Start {
            device,
            options,
            observe,
            kernel,
            body_count: rows.body_count,
            ends: &rows.ends,
            row_bytes: (bytes.into_iter().max().unwrap_or(0), bytes.iter().sum()),
        };
        let new_chunk = |bodies| Chunk::new::<T>(device, layout, bodies);
        Ok(Box::new(start.session::<T, _>(Free, new_chunk, |chunk, upload| chunk.upload(upload, rows))?))
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
