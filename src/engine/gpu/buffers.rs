//! Columns on the device, in chunks that fit its limits.

use std::collections::VecDeque;
use std::ops::Range;

use super::device::{Device, Refusal, Submission};
use super::entries;
use super::reading::{Reader, keep_rows};
use super::session::DeviceChunk;
use crate::bodies::columns::STRIDE_UNIT;
use crate::bodies::memory;
use crate::engine::batch::Batch;
use crate::engine::controlled::Written;
use crate::error::{Error, Result};
use crate::kernel::observe::Kernel;
use crate::math::clock::Clock;
use crate::math::real::Scalar;

/// Bounds of one chunk. The device's own limits hold for those that are not given; a given bound can only lower them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ChunkLimits {
    /// Bytes of one storage binding.
    pub binding_bytes: Option<u64>,
    /// Bytes of one buffer.
    pub buffer_bytes: Option<u64>,
    /// Workgroups of one dispatch.
    pub workgroups: Option<u32>,
}

/// Bodies that one workgroup advances, and the unit that chunks are cut by.
pub(super) const WORKGROUP_SIZE: u32 = STRIDE_UNIT as u32;

/// The most bodies in one chunk: few enough that a slow adapter can take chunks one by one, and that sixteen of them,
/// dispatched in one submission without barriers between, fill any GPU.
pub(super) const CHUNK_BODIES: usize = 1 << 16;

/// Bytes that are in flight between host and device at a time; also the size of the buffer for reading.
pub(super) const STAGING_BYTES: usize = 4 << 20;

/// Usages: of what the host writes, of what it reads, of both, of a uniform block, and of what it maps to read.
pub(super) const INPUT: wgpu::BufferUsages = wgpu::BufferUsages::STORAGE.union(wgpu::BufferUsages::COPY_DST);
pub(super) const OUTPUT: wgpu::BufferUsages = wgpu::BufferUsages::STORAGE.union(wgpu::BufferUsages::COPY_SRC);
pub(super) const INPUT_AND_OUTPUT: wgpu::BufferUsages = INPUT.union(OUTPUT);
pub(super) const SETTINGS: wgpu::BufferUsages = wgpu::BufferUsages::UNIFORM.union(wgpu::BufferUsages::COPY_DST);
pub(super) const STAGING: wgpu::BufferUsages = wgpu::BufferUsages::MAP_READ.union(wgpu::BufferUsages::COPY_DST);

/// The uniform block of `advance.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct SettingsF32 {
    body_count: u32,
    stride: u32,
    steps: u32,
    zero: u32,
    dt: [f32; 2],
    first_step: u32,
    padding: u32,
    clock: [u32; 4],
    clock_step: [u32; 4],
    run_step: [u32; 2],
    inverse_root_dt: f32,
    tail: u32,
}

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct SettingsF64 {
    body_count: u32,
    stride: u32,
    steps: u32,
    zero: u32,
    dt: [f64; 2],
    first_step: u32,
    // The block's vectors of four words are aligned to 16 bytes.
    padding: [u32; 3],
    clock: [u32; 4],
    clock_step: [u32; 4],
    run_step: [u32; 2],
    inverse_root_dt: f64,
}

/// The steps of one submission.
pub(super) struct Slice<T> {
    /// Index within the interval of the first step.
    pub first_step: u64,
    /// Number of steps.
    pub steps: u32,
    /// Step size in seconds, in two words.
    pub dt: (T, T),
    /// The time at the first step.
    pub clock: Clock,
    /// A step in the clock's units.
    pub units: u128,
}

/// The words of a number, lowest first.
fn words(x: u128) -> [u32; 4] {
    std::array::from_fn(|word| (x >> (32 * word)) as u32)
}

/// A number type of the shaders, with the layout of its uniform block.
pub(super) trait DeviceScalar: Kernel {
    const SETTINGS_BYTES: u64;
    fn settings(body_count: u32, stride: u32, slice: &Slice<Self>) -> Vec<u8>;
}

macro_rules! device_scalar {
    ($scalar:ident, $settings:ident) => {
        impl DeviceScalar for $scalar {
            const SETTINGS_BYTES: u64 = size_of::<$settings>() as u64;
            fn settings(body_count: u32, stride: u32, slice: &Slice<Self>) -> Vec<u8> {
                let (steps, dt) = (slice.steps, [slice.dt.0, slice.dt.1]);
                let first_step = slice.first_step as u32;
                let step = slice.clock.step();
                let settings = $settings {
                    body_count,
                    stride,
                    steps,
                    zero: 0,
                    dt,
                    first_step,
                    clock: words(slice.clock.now()),
                    clock_step: words(slice.units),
                    run_step: [step as u32, (step >> 32) as u32],
                    inverse_root_dt: $scalar::from_f64(1.0 / slice.dt.0.to_f64().sqrt()),
                    ..bytemuck::Zeroable::zeroed()
                };
                bytemuck::bytes_of(&settings).to_vec()
            }
        }
    };
}

device_scalar!(f32, SettingsF32);
device_scalar!(f64, SettingsF64);

/// Some bodies in buffers of their own.
pub(super) struct Chunk {
    /// Index of the first body.
    pub first: usize,
    /// Number of bodies.
    pub bodies: usize,
    pub stride: usize,
    parameters: wgpu::Buffer,
    pub state: wgpu::Buffer,
    settings: wgpu::Buffer,
    bind_group: wgpu::BindGroup,
}

/// Where the state of some bodies is.
pub(super) struct Place<'a> {
    /// Index of the first body.
    pub first: usize,
    /// Number of bodies.
    pub bodies: usize,
    /// Distance between the starts of two columns.
    pub stride: usize,
    /// The columns.
    pub state: &'a wgpu::Buffer,
}

impl Place<'_> {
    /// The rows of those bodies of a range that it holds.
    pub fn rows(&self, bodies: &Range<usize>) -> Range<usize> {
        let start = bodies.start.max(self.first);
        let end = bodies.end.min(self.first + self.bodies).max(start);
        start - self.first..end - self.first
    }
}

impl DeviceChunk for Chunk {
    fn place(&self) -> Place<'_> {
        Place { first: self.first, bodies: self.bodies, stride: self.stride, state: &self.state }
    }

    fn move_rows<T: DeviceScalar>(&self, device: &Device, reader: &mut Reader, rows: &[usize]) -> Result<()> {
        let of = (self.stride, self.bodies);
        keep_rows::<T>(device, &self.parameters, of, reader.staging(), rows)?;
        keep_rows::<T>(device, &self.state, of, reader.staging(), rows)
    }

    fn set_bodies(&mut self, bodies: Range<usize>) {
        (self.first, self.bodies) = (bodies.start, bodies.len());
    }

    fn write_parameters<T: DeviceScalar>(&self, device: &Device, written: &Written) -> Result<()> {
        write_parameters::<T>(device, &self.parameters, &self.place(), written)
    }

    fn destroy(&self) {
        [&self.parameters, &self.state, &self.settings].into_iter().for_each(wgpu::Buffer::destroy);
    }
}

impl Chunk {
    /// Room for some bodies of a batch.
    pub fn new<T: DeviceScalar>(
        device: &Device,
        layout: &wgpu::BindGroupLayout,
        bodies: Range<usize>,
        batch: &Batch<T>,
    ) -> Result<Self, Refusal> {
        let stride = bodies.len().next_multiple_of(STRIDE_UNIT);
        let bytes = |columns: usize| (columns * stride * size_of::<T>()) as u64;
        let parameters = buffer(device, "parameters", bytes(batch.parameter_columns()), INPUT_AND_OUTPUT)?;
        let state = buffer(device, "state", bytes(batch.all_state_columns()), INPUT_AND_OUTPUT)?;
        let settings = buffer(device, "settings", T::SETTINGS_BYTES, SETTINGS)?;
        let bind_group = bind(device, "chunk", layout, [&settings, &parameters, &state])?;
        Ok(Self { first: bodies.start, bodies: bodies.len(), stride, parameters, state, settings, bind_group })
    }

    /// Uploads the bodies' parameters and states; rows that are no bodies are NaN.
    pub fn upload<T: DeviceScalar>(&self, upload: &mut Upload<'_>, batch: &Batch<T>) -> Result<()> {
        upload_batch(upload, batch, &self.parameters, &self.place())
    }

    /// Sets the uniform block for the next submission.
    pub fn set<T: DeviceScalar>(&self, device: &Device, slice: &Slice<T>) {
        device.write(&self.settings, 0, &T::settings(self.bodies as u32, self.stride as u32, slice));
    }

    /// Adds the chunk's dispatch to a pass.
    pub fn dispatch(&self, device: &Device, pass: &mut wgpu::ComputePass<'_>) {
        pass.set_bind_group(0, &self.bind_group, &[]);
        device.dispatch(pass, (self.bodies as u32).div_ceil(WORKGROUP_SIZE));
    }
}

/// Uploads parameters and states of those bodies of a batch that are in a place; rows that are no bodies are NaN.
pub(super) fn upload_batch<T: Scalar>(
    upload: &mut Upload<'_>,
    batch: &Batch<T>,
    parameters: &wgpu::Buffer,
    place: &Place<'_>,
) -> Result<()> {
    let rows = place.first..place.first + place.bodies;
    let nan = T::from_f64(f64::NAN);
    upload.columns(parameters, place.stride, &batch.parameters, batch.stride, rows.clone(), nan)?;
    upload.columns(place.state, place.stride, &batch.state, batch.stride, rows, nan)
}

/// Writes columns of parameters of those bodies that are in a place.
pub(super) fn write_parameters<T: Scalar>(
    device: &Device,
    parameters: &wgpu::Buffer,
    place: &Place<'_>,
    written: &Written,
) -> Result<()> {
    let own = place.rows(&(written.first_row..written.first_row + written.columns.first().map_or(0, Vec::len)));
    if own.is_empty() {
        return Ok(());
    }
    let from = place.first + own.start - written.first_row;
    device.checked(|| {
        for (index, column) in written.columns.iter().enumerate() {
            let numbers: Vec<T> = column[from..from + own.len()].iter().map(|&number| T::from_f64(number)).collect();
            let offset = ((written.first_column + index) * place.stride + own.start) * size_of::<T>();
            device.write(parameters, offset as u64, bytemuck::cast_slice(&numbers));
        }
    })
}

/// The number of bodies that one chunk can hold, at most `most`.
///
/// `row`: bytes of a body in the widest buffer.
pub(super) fn chunk_capacity(device: &Device, limits: &ChunkLimits, row: usize, most: usize) -> Result<usize> {
    let own = device.device.limits();
    let binding = own.max_storage_buffer_binding_size.min(limits.binding_bytes.unwrap_or(u64::MAX));
    let buffer = own.max_buffer_size.min(limits.buffer_bytes.unwrap_or(u64::MAX));
    let workgroups = own.max_compute_workgroups_per_dimension.min(limits.workgroups.unwrap_or(u32::MAX));
    let row = row as u64;
    let unit = STRIDE_UNIT as u64;
    let units = (binding.min(buffer) / (row * unit)).min(u64::from(workgroups)).min(most as u64 / unit);
    if units == 0 {
        let expected = "expected room for the columns of 64 bodies and one workgroup";
        return Err(Error::Setting { field: "chunk bytes", value: binding.min(buffer) as f64, expected });
    }
    Ok((units * unit) as usize)
}

/// Refuses more bodies than the caller's bound allows, or than the host's memory holds if the device shares it.
pub(super) fn require(device: &Device, bodies: usize, needed: u64, bound: Option<u64>) -> Result<()> {
    if let Some(available) = bound.filter(|&bound| needed > bound) {
        return Err(Error::TooManyBodies { bodies, purpose: "the columns on the device", needed, available });
    }
    if device.kind() == super::AdapterKind::Software {
        memory::require(bodies, usize::try_from(needed).unwrap_or(usize::MAX), "the columns on the device")?;
    }
    Ok(())
}

pub(super) fn buffer(
    device: &Device,
    label: &str,
    size: u64,
    usage: wgpu::BufferUsages,
) -> Result<wgpu::Buffer, Refusal> {
    device.scoped(|| {
        device.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size,
            usage,
            mapped_at_creation: false,
        })
    })
}

/// Whole buffers for the bindings of a layout, in their order.
pub(super) fn bind<const N: usize>(
    device: &Device,
    label: &str,
    layout: &wgpu::BindGroupLayout,
    buffers: [&wgpu::Buffer; N],
) -> Result<wgpu::BindGroup, Refusal> {
    device.scoped(|| {
        let entries = &entries(buffers);
        device.device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some(label), layout, entries })
    })
}

/// Transfers columns to the device, a bounded number of bytes at a time: while some are copied, the next are submitted.
pub(super) struct Upload<'a> {
    device: &'a Device,
    /// Bytes since the last submission.
    unsubmitted: usize,
    submitted: VecDeque<Submission>,
}

/// Submissions of [`STAGING_BYTES`] that may be in flight.
const UPLOADS: usize = 4;

impl<'a> Upload<'a> {
    pub fn new(device: &'a Device) -> Self {
        Self { device, unsubmitted: 0, submitted: VecDeque::new() }
    }

    /// Writes the rows of every column, and `pad` up to the stride.
    pub fn columns<T: bytemuck::Pod>(
        &mut self,
        target: &wgpu::Buffer,
        stride: usize,
        source: &[T],
        source_stride: usize,
        rows: Range<usize>,
        pad: T,
    ) -> Result<()> {
        let (size, part) = (size_of::<T>(), STAGING_BYTES / size_of::<T>());
        let pad = vec![pad; stride - rows.len()];
        for (column, numbers) in source.chunks_exact(source_stride).enumerate() {
            let mut row = column * stride;
            for piece in numbers[rows.clone()].chunks(part).chain(std::iter::once(pad.as_slice())) {
                if piece.is_empty() {
                    continue;
                }
                let offset = (row * size) as u64;
                let device = self.device;
                device.checked(|| device.write(target, offset, bytemuck::cast_slice(piece)))?;
                row += piece.len();
                self.unsubmitted += size_of_val(piece);
                if self.unsubmitted >= STAGING_BYTES {
                    self.submit()?;
                }
            }
        }
        Ok(())
    }

    fn submit(&mut self) -> Result<()> {
        self.unsubmitted = 0;
        self.submitted.push_back(self.device.submit_only(None)?);
        if self.submitted.len() > UPLOADS
            && let Some(first) = self.submitted.pop_front()
        {
            self.device.wait(first)?;
        }
        Ok(())
    }

    /// Waits until all data are on the device, so that their memory on the host is free.
    pub fn finish(mut self) -> Result<()> {
        self.submit()?;
        self.submitted.pop_back().map_or(Ok(()), |last| self.device.wait(last))
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use super::super::{opened_for_a_test, shader::Source};
    use super::*;
    use crate::engine::{End, Session};
    use crate::kernel::method::Method;
    use crate::math::Precision;

    #[test]
    fn rows_that_are_no_bodies_stay_nan_and_touch_nothing() {
        let gpu = opened_for_a_test();
        let bodies = 67;
        let batch = Batch::<f32>::at_rest(bodies);
        let kernel = gpu.kernel(Source::advance(Precision::F32, Method::Rk4)).expect("no patches");
        let mut session = gpu.session(&batch, kernel, 0, false).expect("uploaded");
        session.advance_to(End::of_steps(0.01, 3), &mut |_| ControlFlow::Continue(())).expect("advanced");
        // The same buffers, read as if the rows up to the stride were bodies too.
        let chunk = &mut session.chunks[0];
        assert_eq!(chunk.stride, 128);
        chunk.bodies = chunk.stride;
        let words = session.read(0..128).expect("read");
        for (body, value) in words.value.iter().enumerate() {
            let residue = words.residue_of(body);
            let unwritten = value.iter().chain(&residue).filter(|x| x.to_bits() & !(1 << 63) > f64::INFINITY.to_bits());
            assert_eq!(unwritten.count(), if body < bodies { 0 } else { 14 }, "row {body}");
        }
    }
}
