//! Statistics of the state on a device: some hundred bytes are read back for a thousand bodies.

use std::ops::Range;
use std::sync::{Arc, OnceLock};

use super::buffers::{DeviceScalar, INPUT, OUTPUT, Place, SETTINGS, STAGING, Upload, bind, buffer};
use super::device::{Device, Refusal};
use super::gather::{GatherKernels, Gatherer};
use super::shader::{Patch, Source};
use super::{READ, UNIFORM, WRITTEN, bindings};
use crate::bodies::BodyFrame;
use crate::engine::reduction::{AskedOfBodies, BlockRows, Formed, Marked, merged};
use crate::error::Result;
use crate::kernel::observe::{Columns, Extreme, GROUP_BODIES, Partial, Statistic, WORKGROUP};
use crate::math::Precision;

/// The kernel's bindings, and its pipelines by precision, made on first use.
#[derive(Debug, Default)]
pub(super) struct ObserveKernels {
    patches: Vec<Patch>,
    /// The kernels of quantities, if these are formed on the device.
    gather: Option<GatherKernels>,
    layout: OnceLock<wgpu::BindGroupLayout>,
    f32: OnceLock<wgpu::ComputePipeline>,
    f64: OnceLock<wgpu::ComputePipeline>,
}

impl ObserveKernels {
    pub fn new(patches: Vec<Patch>, gather: Option<GatherKernels>) -> Self {
        Self { gather, patches, ..Self::default() }
    }

    /// A uniform block, four tables that are read, two that are written.
    fn layout(&self, device: &wgpu::Device) -> &wgpu::BindGroupLayout {
        self.layout.get_or_init(|| bindings(device, "observe", &[UNIFORM, READ, READ, READ, WRITTEN, WRITTEN, READ]))
    }

    fn pipeline<T: DeviceScalar>(&self, device: &Device) -> Result<wgpu::ComputePipeline> {
        let (cell, precision) = if T::WORDS == 2 { (&self.f32, Precision::F32) } else { (&self.f64, Precision::F64) };
        if let Some(pipeline) = cell.get() {
            return Ok(pipeline.clone());
        }
        let layout = super::pipeline_layout(&device.device, self.layout(&device.device));
        let pipeline = Source::observe(precision).patched(&self.patches)?.compile(device, &layout, None)?;
        Ok(cell.get_or_init(|| pipeline).clone())
    }
}

/// The uniform block of `observe.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Settings {
    stride: u32,
    zero: u32,
    statistic_count: u32,
    piece_count: u32,
    statistics: [u32; 4],
}

/// Reduces the state of one session.
#[derive(Default)]
pub(super) struct Reducer {
    kernels: Arc<ObserveKernels>,
    watched: Option<Watched>,
    gatherer: Option<Gatherer>,
}

/// The watched statistics, in the chunks of the session.
struct Watched {
    pipeline: wgpu::ComputePipeline,
    statistics: usize,
    blocks: usize,
    chunks: Vec<Chunk>,
    staging: Option<wgpu::Buffer>,
}

/// Bodies of one chunk.
struct Chunk {
    /// The places whose rows are in the chunk.
    places: Vec<u32>,
    pieces: Vec<Piece>,
    columns: wgpu::Buffer,
    partials: wgpu::Buffer,
    marks: wgpu::Buffer,
    order: wgpu::Buffer,
    settings: wgpu::Buffer,
    bind_group: wgpu::BindGroup,
    /// Whether the last reduction has marked any.
    has_marks: bool,
}

/// Places of one block that one workgroup reduces.
struct Piece {
    block: usize,
    /// Among the chunk's places.
    first: usize,
    count: usize,
    /// The reference of the exponents of each statistic.
    offsets: Vec<i32>,
}

/// Words of marks for as many bodies as a workgroup has lanes: one bit per body for failures, then one bit per body for
/// too fast a spin.
const MARKS: usize = 4;

impl Chunk {
    fn release(&self) {
        for buffer in [&self.columns, &self.partials, &self.marks, &self.order, &self.settings] {
            buffer.destroy();
        }
    }
}

impl Reducer {
    pub fn new(kernels: &Arc<ObserveKernels>) -> Self {
        Self { kernels: Arc::clone(kernels), watched: None, gatherer: None }
    }

    pub fn watch<T: DeviceScalar>(
        &mut self,
        device: &Device,
        chunks: &[Place<'_>],
        (statistics, frames): (&[Statistic], &[BodyFrame]),
        blocks: &BlockRows,
        fastest: f64,
    ) -> Result<()> {
        self.release();
        let refused = |refusal| device.refused(refusal);
        let mut watched = Watched {
            pipeline: self.kernels.pipeline::<T>(device)?,
            statistics: statistics.len(),
            blocks: blocks.count(),
            chunks: Vec::with_capacity(chunks.len()),
            staging: None,
        };
        let codes = std::array::from_fn(|index| statistics.get(index).map_or(0, |statistic| statistic.code()));
        let mut upload = Upload::new(device);
        for (place, places) in chunks.iter().zip(places_by_chunk(chunks, blocks)) {
            let parts = parts_of(&places, blocks);
            let ranges: Vec<Range<usize>> = parts.iter().map(|(_, range)| range.clone()).collect();
            let frame = |index: usize| &frames[places[index] as usize];
            let columns = Columns::<T>::new(statistics, places.len(), frame, &ranges, fastest);
            let mut pieces = Vec::new();
            for ((block, range), offsets) in parts.into_iter().zip(&columns.offsets) {
                pieces.extend(range.clone().step_by(GROUP_BODIES).map(|first| {
                    let count = GROUP_BODIES.min(range.end - first);
                    Piece { block, first, count, offsets: offsets.clone() }
                }));
            }
            let order = order_of(pieces.iter().map(|piece| (piece.first, piece.count)), &places, place, blocks);
            let settings = Settings {
                stride: place.stride as u32,
                zero: 0,
                statistic_count: statistics.len() as u32,
                piece_count: pieces.len() as u32,
                statistics: codes,
            };
            let rows = 0..places.len();
            let chunk = self.chunk::<T>(device, place, places, pieces, statistics.len()).map_err(refused)?;
            device.write(&chunk.settings, 0, bytemuck::bytes_of(&settings));
            device.write(&chunk.order, 0, bytemuck::cast_slice(&order));
            let nan = T::from_f64(f64::NAN);
            upload.columns(&chunk.columns, place.stride, &columns.columns, columns.stride, rows, nan)?;
            watched.chunks.push(chunk);
        }
        upload.finish()?;
        let pieces: usize = watched.chunks.iter().map(|chunk| chunk.pieces.len()).sum();
        let staging = (pieces * statistics.len() * partial_bytes::<T>()) as u64;
        if staging > 0 {
            watched.staging = Some(buffer(device, "statistics", staging, STAGING).map_err(refused)?);
        }
        self.watched = Some(watched);
        Ok(())
    }

    fn chunk<T: DeviceScalar>(
        &self,
        device: &Device,
        place: &Place<'_>,
        places: Vec<u32>,
        pieces: Vec<Piece>,
        statistics: usize,
    ) -> Result<Chunk, Refusal> {
        let column_bytes = (crate::kernel::observe::SCALE_COLUMN + statistics) * place.stride * size_of::<T>();
        let partial_bytes = pieces.len() * statistics.max(1) * partial_bytes::<T>();
        let mark_bytes = pieces.len() * GROUP_BODIES / WORKGROUP * MARKS * size_of::<u32>();
        let columns = buffer(device, "observed", column_bytes as u64, INPUT)?;
        let partials = buffer(device, "partials", partial_bytes as u64, OUTPUT)?;
        let marks = buffer(device, "marks", mark_bytes as u64, OUTPUT)?;
        let order = buffer(device, "places", ((2 * pieces.len() + places.len()) * size_of::<u32>()) as u64, INPUT)?;
        let settings = buffer(device, "settings", size_of::<Settings>() as u64, SETTINGS)?;
        let buffers = [&settings, place.state, place.state, &columns, &partials, &marks, &order];
        let bind_group = bind(device, "observe", self.kernels.layout(&device.device), buffers)?;
        Ok(Chunk { places, pieces, columns, partials, marks, order, settings, bind_group, has_marks: false })
    }

    /// Prepares for [`Reducer::gather`]; `false` if the device does not form the quantities.
    pub fn watch_quantities<T: DeviceScalar>(
        &mut self,
        device: &Device,
        chunks: &[Place<'_>],
        asked: (&AskedOfBodies<'_>, &[BodyFrame]),
        blocks: &BlockRows,
    ) -> Result<bool> {
        if let Some(kernels) = &self.kernels.gather {
            self.gatherer = Gatherer::new::<T>(device, kernels, chunks, asked, blocks)?;
        }
        Ok(self.gatherer.is_some())
    }

    pub fn gather(&mut self, device: &Device, time: f64) -> Result<Formed> {
        self.gatherer.as_mut().map_or_else(|| Ok(Formed::default()), |gatherer| gatherer.gather(device, time))
    }

    pub fn reduce<T: DeviceScalar>(&mut self, device: &Device) -> Result<Vec<Vec<Partial<f64>>>> {
        let Some(watched) = &mut self.watched else { return Ok(Vec::new()) };
        let mut found: Vec<Vec<Vec<Partial<f64>>>> = vec![Vec::new(); watched.blocks];
        if let Some(staging) = &watched.staging {
            let bytes = (watched.statistics * partial_bytes::<T>()) as u64;
            let commands = device.encoded("observe", |encoder| {
                let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
                pass.set_pipeline(&watched.pipeline);
                for chunk in &watched.chunks {
                    pass.set_bind_group(0, &chunk.bind_group, &[]);
                    device.dispatch(&mut pass, chunk.pieces.len() as u32);
                }
                drop(pass);
                let mut offset = 0;
                for chunk in &watched.chunks {
                    let bytes = bytes * chunk.pieces.len() as u64;
                    encoder.copy_buffer_to_buffer(&chunk.partials, 0, staging, offset, bytes);
                    offset += bytes;
                }
            })?;
            let chunks = &mut watched.chunks;
            device.read(commands, staging, 0..staging.size(), |view| {
                let mut views = view.chunks_exact(bytes as usize);
                for chunk in chunks.iter_mut() {
                    chunk.has_marks = false;
                    for (piece, view) in chunk.pieces.iter().zip(&mut views) {
                        let own = view.chunks_exact(partial_bytes::<T>()).map(partial::<T>).zip(&piece.offsets);
                        let own = own.map(|(partial, &offset)| {
                            chunk.has_marks |= (partial.count as usize) < piece.count || partial.faster > 0;
                            let mut wide = partial.widened(offset);
                            if wide.count > 0 {
                                let place = |index: u32| chunk.places[index as usize];
                                wide.least.body = place(wide.least.body);
                                wide.greatest.body = place(wide.greatest.body);
                            }
                            wide
                        });
                        found[piece.block].push(own.collect());
                    }
                }
            })?;
        }
        Ok(found.iter().map(|pieces| merged(pieces, watched.statistics)).collect())
    }

    pub fn marked(&mut self, device: &Device) -> Result<Marked> {
        let mut marked = Marked::default();
        let Some(watched) = &self.watched else { return Ok(marked) };
        for chunk in watched.chunks.iter().filter(|chunk| chunk.has_marks) {
            let bytes = chunk.marks.size();
            let staging = buffer(device, "marks", bytes, STAGING).map_err(|refusal| device.refused(refusal))?;
            let copy = |encoder: &mut wgpu::CommandEncoder| {
                encoder.copy_buffer_to_buffer(&chunk.marks, 0, &staging, 0, bytes);
            };
            let commands = device.encoded("marks", copy)?;
            let read = device.read(commands, &staging, 0..bytes, |view| {
                let words: &[u32] = bytemuck::cast_slice(view);
                for (words, piece) in words.chunks_exact(GROUP_BODIES / WORKGROUP * MARKS).zip(&chunk.pieces) {
                    let bit = |row: usize, kind: usize| {
                        words[MARKS * (row / WORKGROUP) + 2 * kind + row % WORKGROUP / 32] >> (row % 32) & 1 == 1
                    };
                    let place = |row: usize| chunk.places[piece.first + row] as usize;
                    marked.failed.extend((0..piece.count).filter(|&row| bit(row, 0)).map(place));
                    marked.faster.extend((0..piece.count).filter(|&row| bit(row, 1)).map(place));
                }
            });
            staging.destroy();
            read?;
        }
        Ok(marked)
    }

    /// Frees the memory.
    pub fn release(&mut self) {
        if let Some(watched) = self.watched.take() {
            watched.chunks.iter().for_each(Chunk::release);
            if let Some(staging) = watched.staging {
                staging.destroy();
            }
        }
        if let Some(gatherer) = self.gatherer.take() {
            gatherer.release();
        }
    }
}

/// For each chunk the places whose rows it holds, ascending.
pub(super) fn places_by_chunk(chunks: &[Place<'_>], blocks: &BlockRows) -> Vec<Vec<u32>> {
    let mut places: Vec<Vec<u32>> = chunks.iter().map(|chunk| Vec::with_capacity(chunk.bodies)).collect();
    for place in 0..blocks.len() {
        let row = blocks.row(place);
        let chunk = chunks.partition_point(|chunk| chunk.first <= row) - 1;
        places[chunk].push(place as u32);
    }
    places
}

/// The blocks that some places, ascending, belong to, each with the range of its places among them.
pub(super) fn parts_of(places: &[u32], blocks: &BlockRows) -> Vec<(usize, Range<usize>)> {
    let end = |block: usize| places.partition_point(|&place| (place as usize) < blocks.places(block).end);
    let mut first = 0;
    let part = |block: usize| {
        let range = first..end(block);
        first = range.end;
        (block, range)
    };
    (0..blocks.count()).map(part).filter(|(_, range)| !range.is_empty()).collect()
}

/// The contents of `places` in the shaders: the first place of each piece and the number of its places, then the row of
/// each place.
pub(super) fn order_of(
    pieces: impl Iterator<Item = (usize, usize)>,
    places: &[u32],
    chunk: &Place<'_>,
    blocks: &BlockRows,
) -> Vec<u32> {
    let pieces = pieces.flat_map(|(first, count)| [first as u32, count as u32]);
    pieces.chain(places.iter().map(|&place| (blocks.row(place as usize) - chunk.first) as u32)).collect()
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
