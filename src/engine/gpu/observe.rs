//! Statistics of the state on a device, of which some hundred bytes a chunk come back.

use std::sync::{Arc, OnceLock};

use super::buffers::{DeviceScalar, Place, Upload, buffer};
use super::device::{Device, Refusal};
use super::shader::{Patch, Source};
use crate::bodies::BodyFrame;
use crate::engine::reduction::Marked;
use crate::error::Result;
use crate::kernel::observe::{Columns, Extreme, GROUP_BODIES, Partial, Statistic, WORKGROUP, merge};
use crate::math::Precision;

/// The kernels' bindings, and their pipelines by precision, made on first use.
#[derive(Debug, Default)]
pub(super) struct ObserveKernels {
    patches: Vec<Patch>,
    layout: OnceLock<wgpu::BindGroupLayout>,
    f32: OnceLock<[wgpu::ComputePipeline; 2]>,
    f64: OnceLock<[wgpu::ComputePipeline; 2]>,
}

impl ObserveKernels {
    pub fn new(patches: Vec<Patch>) -> Self {
        Self { patches, ..Self::default() }
    }

    /// A uniform block, three tables that are read, two that are written.
    fn layout(&self, device: &wgpu::Device) -> &wgpu::BindGroupLayout {
        let entry = |binding, ty| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
            count: None,
        };
        let storage = |read_only| wgpu::BufferBindingType::Storage { read_only };
        self.layout.get_or_init(|| {
            device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
                label: Some("observe"),
                entries: &[
                    entry(0, wgpu::BufferBindingType::Uniform),
                    entry(1, storage(true)),
                    entry(2, storage(true)),
                    entry(3, storage(true)),
                    entry(4, storage(false)),
                    entry(5, storage(false)),
                ],
            })
        })
    }

    fn pipelines<T: DeviceScalar>(&self, device: &Device) -> Result<[wgpu::ComputePipeline; 2]> {
        let (cell, precision) = if T::WORDS == 2 { (&self.f32, Precision::F32) } else { (&self.f64, Precision::F64) };
        if let Some(pipelines) = cell.get() {
            return Ok(pipelines.clone());
        }
        let layout = super::pipeline_layout(&device.device, self.layout(&device.device));
        let [observe, combine] = Source::observe(precision);
        let compile = |source: Source| source.patched(&self.patches)?.compile(&device.device, &layout, None);
        let pipelines = [compile(observe)?, compile(combine)?];
        Ok(cell.get_or_init(|| pipelines).clone())
    }
}

/// The uniform block of `observe.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Settings {
    body_count: u32,
    stride: u32,
    zero: u32,
    statistic_count: u32,
    statistics: [u32; 4],
}

/// Reduces the state of one session.
#[derive(Default)]
pub(super) struct Reducer {
    kernels: Arc<ObserveKernels>,
    watched: Option<Watched>,
}

/// What is watched, in the chunks of the session.
struct Watched {
    pipelines: [wgpu::ComputePipeline; 2],
    statistics: usize,
    /// What the exponents of each statistic are relative to.
    offsets: Vec<i32>,
    chunks: Vec<Chunk>,
    staging: Option<wgpu::Buffer>,
}

/// Bodies of one chunk.
struct Chunk {
    first: usize,
    bodies: usize,
    columns: wgpu::Buffer,
    partials: wgpu::Buffer,
    marks: wgpu::Buffer,
    settings: wgpu::Buffer,
    bind_group: wgpu::BindGroup,
    /// Whether the last reduction has marked any.
    has_marks: bool,
}

/// Words of marks for as many bodies as a workgroup has lanes: a bit a body that failed, then a bit a body that spins too fast.
const MARKS: usize = 4;

impl Chunk {
    fn groups(&self) -> usize {
        self.bodies.div_ceil(GROUP_BODIES)
    }

    fn release(&self) {
        for buffer in [&self.columns, &self.partials, &self.marks, &self.settings] {
            buffer.destroy();
        }
    }
}

impl Reducer {
    pub fn new(kernels: &Arc<ObserveKernels>) -> Self {
        Self { kernels: Arc::clone(kernels), watched: None }
    }

    pub fn watch<T: DeviceScalar>(
        &mut self,
        device: &Device,
        places: &[Place<'_>],
        statistics: &[Statistic],
        frames: &[BodyFrame],
        fastest: f64,
    ) -> Result<()> {
        self.release();
        let columns = Columns::<T>::new(statistics, frames, fastest);
        let staging = (places.len() * statistics.len() * partial_bytes::<T>()) as u64;
        let read = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let refused = |refusal| device.refused(refusal);
        let mut watched = Watched {
            pipelines: self.kernels.pipelines::<T>(device)?,
            statistics: statistics.len(),
            offsets: columns.offsets.clone(),
            chunks: Vec::with_capacity(places.len()),
            staging: (staging > 0).then(|| buffer(device, "statistics", staging, read)).transpose().map_err(refused)?,
        };
        let codes = std::array::from_fn(|index| statistics.get(index).map_or(0, |statistic| statistic.code()));
        let mut upload = Upload::new(device);
        for place in places {
            let chunk = self.chunk::<T>(device, place, statistics.len()).map_err(refused)?;
            let rows = place.first..place.first + place.bodies;
            let settings = Settings {
                body_count: place.bodies as u32,
                stride: place.stride as u32,
                zero: 0,
                statistic_count: statistics.len() as u32,
                statistics: codes,
            };
            device.write(&chunk.settings, 0, bytemuck::bytes_of(&settings));
            let nan = T::from_f64(f64::NAN);
            upload.columns(&chunk.columns, place.stride, &columns.columns, columns.stride, rows, nan)?;
            watched.chunks.push(chunk);
        }
        upload.finish()?;
        self.watched = Some(watched);
        Ok(())
    }

    fn chunk<T: DeviceScalar>(&self, device: &Device, place: &Place<'_>, statistics: usize) -> Result<Chunk, Refusal> {
        let groups = place.bodies.div_ceil(GROUP_BODIES);
        let column_bytes = (crate::kernel::observe::SCALE_COLUMN + statistics) * place.stride * size_of::<T>();
        let partial_bytes = (1 + groups) * statistics * partial_bytes::<T>();
        let input = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        let output = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        let uniform = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let columns = buffer(device, "observed", column_bytes as u64, input)?;
        let partials = buffer(device, "partials", partial_bytes as u64, output)?;
        let marks =
            buffer(device, "marks", (groups * GROUP_BODIES / WORKGROUP * MARKS * size_of::<u32>()) as u64, output)?;
        let settings = buffer(device, "settings", size_of::<Settings>() as u64, uniform)?;
        let buffers = [&settings, place.state, place.state, &columns, &partials, &marks];
        let entries: [_; 6] = std::array::from_fn(|binding| wgpu::BindGroupEntry {
            binding: binding as u32,
            resource: buffers[binding].as_entire_binding(),
        });
        let bind_group = device.scoped(|| {
            device.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("observe"),
                layout: self.kernels.layout(&device.device),
                entries: &entries,
            })
        })?;
        let (first, bodies) = (place.first, place.bodies);
        Ok(Chunk { first, bodies, columns, partials, marks, settings, bind_group, has_marks: false })
    }

    pub fn reduce<T: DeviceScalar>(&mut self, device: &Device) -> Result<Vec<Partial<f64>>> {
        let Some(watched) = &mut self.watched else { return Ok(Vec::new()) };
        let mut total = vec![Partial::none(); watched.statistics];
        let Some(staging) = &watched.staging else { return Ok(total) };
        let bytes = (watched.statistics * partial_bytes::<T>()) as u64;
        let commands = device.scoped(|| {
            let label = Some("observe");
            let mut encoder = device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label });
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            let [observe, combine] = &watched.pipelines;
            pass.set_pipeline(observe);
            for chunk in &watched.chunks {
                pass.set_bind_group(0, &chunk.bind_group, &[]);
                device.dispatch(&mut pass, chunk.groups() as u32);
            }
            pass.set_pipeline(combine);
            for chunk in &watched.chunks {
                pass.set_bind_group(0, &chunk.bind_group, &[]);
                device.dispatch(&mut pass, watched.statistics as u32);
            }
            drop(pass);
            for (index, chunk) in watched.chunks.iter().enumerate() {
                encoder.copy_buffer_to_buffer(&chunk.partials, 0, staging, index as u64 * bytes, bytes);
            }
            encoder.finish()
        });
        let commands = commands.map_err(|refusal| device.refused(refusal))?;
        let (chunks, offsets) = (&mut watched.chunks, &watched.offsets);
        let range = 0..bytes * chunks.len() as u64;
        device.read(commands, staging, range, |view| {
            for (chunk, view) in chunks.iter_mut().zip(view.chunks_exact(bytes as usize)) {
                let partials = view.chunks_exact(partial_bytes::<T>()).map(partial::<T>);
                for (index, found) in partials.enumerate() {
                    chunk.has_marks = (found.count as usize) < chunk.bodies || found.faster > 0;
                    total[index] = merge(total[index], found.widened(chunk.first as u32, offsets[index]));
                }
            }
        })?;
        Ok(total)
    }

    pub fn marked(&mut self, device: &Device) -> Result<Marked> {
        let mut marked = Marked::default();
        let Some(watched) = &self.watched else { return Ok(marked) };
        for chunk in watched.chunks.iter().filter(|chunk| chunk.has_marks) {
            let bytes = chunk.marks.size();
            let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
            let staging = buffer(device, "marks", bytes, usage).map_err(|refusal| device.refused(refusal))?;
            let label = Some("marks");
            let mut encoder = device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label });
            encoder.copy_buffer_to_buffer(&chunk.marks, 0, &staging, 0, bytes);
            let commands = device.scoped(|| encoder.finish()).map_err(|refusal| device.refused(refusal))?;
            let read = device.read(commands, &staging, 0..bytes, |view| {
                let words: &[u32] = bytemuck::cast_slice(view);
                let bit = |row: usize, kind: usize| {
                    words[MARKS * (row / WORKGROUP) + 2 * kind + row % WORKGROUP / 32] >> (row % 32) & 1 == 1
                };
                let rows = || 0..chunk.bodies;
                marked.failed.extend(rows().filter(|&row| bit(row, 0)).map(|row| chunk.first + row));
                marked.faster.extend(rows().filter(|&row| bit(row, 1)).map(|row| chunk.first + row));
            });
            staging.destroy();
            read?;
        }
        Ok(marked)
    }

    /// Gives the memory back.
    pub fn release(&mut self) {
        if let Some(watched) = self.watched.take() {
            watched.chunks.iter().for_each(Chunk::release);
            if let Some(staging) = watched.staging {
                staging.destroy();
            }
        }
    }
}

/// Bytes of a `Partial` of the shader: four words, three numbers, and twice a number and two words.
const fn partial_bytes<T>() -> usize {
    32 + 5 * size_of::<T>()
}

/// A `Partial` of the shader from its bytes.
fn partial<T: DeviceScalar>(bytes: &[u8]) -> Partial<T> {
    let size = size_of::<T>();
    let word = |at: usize| -> u32 { bytemuck::pod_read_unaligned(&bytes[at..at + 4]) };
    let number = |at: usize| -> T { bytemuck::pod_read_unaligned(&bytes[at..at + size]) };
    let extreme =
        |at: usize| Extreme { mantissa: number(at), exponent: word(at + size) as i32, body: word(at + size + 4) };
    let extremes = 16 + 3 * size;
    Partial {
        count: word(0),
        faster: word(4),
        exponent: word(8) as i32,
        mean: number(16),
        residue: number(16 + size),
        squares: number(16 + 2 * size),
        least: extreme(extremes),
        greatest: extreme(extremes + size + 8),
    }
}

/// Reductions of a session whose chunks and reader are in these fields.
macro_rules! reduces {
    ($session:ident, $($chunks:ident).+, $($reader:ident).+) => {
        impl<T: DeviceScalar> Reduce for $session<T> {
            fn watch(&mut self, statistics: &[Statistic], frames: &[BodyFrame], fastest: f64) -> Result<()> {
                let places: Vec<_> = self.$($chunks).+.iter().map(|chunk| chunk.place()).collect();
                self.reducer.watch::<T>(&self.device, &places, statistics, frames, fastest)
            }

            fn reduce(&mut self) -> Result<Vec<Partial<f64>>> {
                self.reducer.reduce::<T>(&self.device)
            }

            fn marked(&mut self) -> Result<Marked> {
                self.reducer.marked(&self.device)
            }

            fn prefetch(&mut self, bodies: Range<usize>) -> Result<()> {
                let places: Vec<_> = self.$($chunks).+.iter().map(|chunk| chunk.place()).collect();
                self.$($reader).+.as_mut().map_or(Ok(()), |reader| reader.prefetch::<T>(&self.device, &places, &bodies))
            }

            fn read_rows(&mut self, rows: &[usize]) -> Result<StateWords> {
                let places: Vec<_> = self.$($chunks).+.iter().map(|chunk| chunk.place()).collect();
                read_single_rows::<T>(&self.device, &places, rows)
            }
        }
    };
}

pub(super) use reduces;
