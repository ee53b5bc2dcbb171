//! Forms quantities of the bodies of a session, their moments and their histograms on the device: for a million bodies
//! some hundred kilobytes are read back.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, PoisonError};

use super::buffers::{DeviceScalar, INPUT, INPUT_AND_OUTPUT, Place, SETTINGS, STAGING, Upload, buffer, require};
use super::device::{Device, Refusal};
use super::observe::{order_of, parts_of, places_by_chunk};
use super::shader::{Key, Patch, Source};
use super::{READ, UNIFORM, WRITTEN, numbered_bindings};
use crate::bodies::BodyFrame;
use crate::engine::reduction::{AskedOfBodies, BlockRows, Formed};
use crate::error::Result;
use crate::expression::wgsl::{self, Argument, Signature, WgslError};
use crate::expression::{Graph, Input, InputKind, Node, Shape};
use crate::kernel::observe::{GROUP_BODIES, WORKGROUP};
use crate::math::Moments;
use crate::math::power_of_two::power_of_two_factors;
use crate::scene::PARAMETERS;

/// Columns of a frame in `gather.wgsl`.
const FRAME_COLUMNS: usize = 11;

/// The kernels of the quantities wanted so far, by their text.
#[derive(Debug, Default)]
pub(super) struct GatherKernels {
    patches: Vec<Patch>,
    memory: Option<u64>,
    made: Mutex<Vec<(Key, Arc<Kernels>)>>,
}

/// The three kernels of some quantities, each with its bindings.
#[derive(Debug)]
struct Kernels {
    evaluate: Bound,
    reduce: Bound,
    count: Bound,
}

#[derive(Debug)]
struct Bound {
    pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
}

/// The bindings of a kernel, by number.
type Bindings = &'static [(u32, wgpu::BufferBindingType)];

const EVALUATE: Bindings = &[(0, UNIFORM), (1, READ), (2, READ), (3, READ), (4, READ), (5, WRITTEN)];
const REDUCE: Bindings = &[(0, UNIFORM), (4, READ), (6, READ), (7, READ), (8, WRITTEN)];
const COUNT: Bindings = &[(0, UNIFORM), (6, READ), (7, READ), (9, READ), (10, READ), (11, WRITTEN)];

impl GatherKernels {
    /// `memory`: the most bytes of device memory that a session may take for quantities, if that is bounded.
    pub fn new(patches: Vec<Patch>, memory: Option<u64>) -> Self {
        Self { patches, memory, made: Mutex::default() }
    }

    /// The kernels whose `evaluate` is this source.
    fn get(&self, device: &Device, source: Source) -> Result<Arc<Kernels>> {
        let source = source.patched(&self.patches)?;
        let key = source.key();
        let mut made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, kernels)) = made.iter().find(|(other, _)| *other == key) {
            return Ok(Arc::clone(kernels));
        }
        let bound = |entry_point, bindings: Bindings| -> Result<Bound> {
            let layout = numbered_bindings(&device.device, "gather", bindings.iter().copied());
            let of = super::pipeline_layout(&device.device, &layout);
            let pipeline = source.clone().entered_at(entry_point).compile(device, &of, None)?;
            Ok(Bound { pipeline, layout })
        };
        let kernels = Arc::new(Kernels {
            evaluate: bound("evaluate", EVALUATE)?,
            reduce: bound("reduce", REDUCE)?,
            count: bound("count", COUNT)?,
        });
        made.push((key, Arc::clone(&kernels)));
        Ok(kernels)
    }
}

/// The uniform block of `gather.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
struct Settings {
    stride: u32,
    zero: u32,
    piece_count: u32,
    place_count: u32,
    place_stride: u32,
    quantity_count: u32,
    moment_count: u32,
    histogram_count: u32,
    time: f64,
}

/// `PieceMoments` of `gather.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct PieceMoments {
    count: u32,
    sound: u32,
    least_place: u32,
    greatest_place: u32,
    mean: f64,
    squares: f64,
    least: f64,
    greatest: f64,
}

/// Forms the quantities of one session.
pub(super) struct Gatherer {
    kernels: Arc<Kernels>,
    /// How many of the quantities, from the first on, have statistics, and how many have moments.
    statistics: usize,
    moments: usize,
    blocks: usize,
    chunks: Vec<Chunk>,
    histograms: Histograms,
    staging: wgpu::Buffer,
}

/// The histograms on the device.
struct Histograms {
    /// The number of counts of each.
    sizes: Vec<usize>,
    table: wgpu::Buffer,
    edges: wgpu::Buffer,
    counts: wgpu::Buffer,
}

/// The block of a piece, the index of its first among the chunk's places, and their number.
type Piece = (usize, usize, usize);

/// Bodies of one chunk of the session.
struct Chunk {
    /// The places whose rows are in the chunk.
    places: Vec<u32>,
    pieces: Vec<Piece>,
    settings: Settings,
    uniform: wgpu::Buffer,
    columns: wgpu::Buffer,
    order: wgpu::Buffer,
    values: wgpu::Buffer,
    moments: wgpu::Buffer,
    evaluate: wgpu::BindGroup,
    reduce: wgpu::BindGroup,
    count: wgpu::BindGroup,
}

/// A buffer of `bytes`, at least 16, as none may be empty.
fn table(device: &Device, label: &str, bytes: usize, usage: wgpu::BufferUsages) -> Result<wgpu::Buffer, Refusal> {
    buffer(device, label, bytes.max(16) as u64, usage)
}

impl Histograms {
    fn new(device: &Device, asked: &AskedOfBodies<'_>) -> Result<Self, Refusal> {
        let (mut rows, mut all_edges, mut sizes) = (Vec::<u32>::new(), Vec::<f64>::new(), Vec::new());
        for &(quantity, edges) in asked.histograms {
            let first_count: usize = sizes.iter().sum();
            rows.extend([quantity, edges.len() - 1, all_edges.len(), first_count].map(|number| number as u32));
            all_edges.extend_from_slice(edges);
            sizes.push(edges.len() + 1);
        }
        let counts = table(device, "counts", 4 * sizes.iter().sum::<usize>(), INPUT_AND_OUTPUT)?;
        let table_of_all = table(device, "histograms", 4 * rows.len(), INPUT)?;
        let edges = table(device, "edges", 8 * all_edges.len(), INPUT)?;
        device.write(&table_of_all, 0, bytemuck::cast_slice(&rows));
        device.write(&edges, 0, bytemuck::cast_slice(&all_edges));
        Ok(Self { sizes, table: table_of_all, edges, counts })
    }
}

impl Gatherer {
    /// Prepares the quantities wanted of the bodies in some chunks. `None` if a formula has no text, a body's units are
    /// beyond `f64`, or the device has no room.
    pub fn new<T: DeviceScalar>(
        device: &Device,
        kernels: &GatherKernels,
        chunks: &[Place<'_>],
        (asked, frames): (&AskedOfBodies<'_>, &[BodyFrame]),
        blocks: &BlockRows,
    ) -> Result<Option<Self>> {
        let columns = (FRAME_COLUMNS..).zip(asked.constants).map(|(column, &input)| (input, column));
        let source = Source::gather(T::PRECISION, (asked.graph, asked.outputs), &columns.collect::<Vec<_>>());
        let of_body = size_of::<f64>() * (column_count(asked) + asked.outputs.len() + 1) + size_of::<u32>();
        let bodies: usize = chunks.iter().map(|chunk| chunk.bodies).sum();
        let has_room = require(device, bodies, (bodies * of_body) as u64, kernels.memory).is_ok();
        let Some(source) = source.ok().filter(|_| has_room && frames.iter().all(has_plain_units)) else {
            return Ok(None);
        };
        let kernels = kernels.get(device, source)?;
        let mut made = match Self::allocated(device, kernels, chunks, asked, blocks) {
            Ok(made) => made,
            Err(Refusal::OutOfMemory) => return Ok(None),
            Err(refusal) => return Err(device.refused(refusal)),
        };
        let mut upload = Upload::new(device);
        for (chunk, place) in made.chunks.iter_mut().zip(chunks) {
            let pieces = chunk.pieces.iter().map(|&(_, first, count)| (first, count));
            device.write(&chunk.order, 0, bytemuck::cast_slice(&order_of(pieces, &chunk.places, place, blocks)));
            let (count, stride) = (chunk.places.len(), chunk.settings.place_stride as usize);
            upload.columns(&chunk.columns, stride, &columns_of(&chunk.places, frames, asked), count, 0..count, 0.0)?;
        }
        upload.finish()?;
        Ok(Some(made))
    }

    fn allocated(
        device: &Device,
        kernels: Arc<Kernels>,
        chunks: &[Place<'_>],
        asked: &AskedOfBodies<'_>,
        blocks: &BlockRows,
    ) -> Result<Self, Refusal> {
        let histograms = Histograms::new(device, asked)?;
        // The moments of the first quantity count the bodies that have not failed.
        let moments = asked.statistics.max(1);
        let of_chunk = |(place, places): (&Place<'_>, Vec<u32>)| {
            Chunk::new(device, &kernels, (place, places), (asked, moments), &histograms, blocks)
        };
        let chunks: Vec<Chunk> =
            chunks.iter().zip(places_by_chunk(chunks, blocks)).map(of_chunk).collect::<Result<_, _>>()?;
        let bytes = chunks.iter().map(|chunk| chunk.moments.size()).sum::<u64>() + histograms.counts.size();
        if bytes > device.device.limits().max_buffer_size {
            return Err(Refusal::OutOfMemory);
        }
        let staging = buffer(device, "gathered", bytes, STAGING)?;
        Ok(Self { kernels, statistics: asked.statistics, moments, blocks: blocks.count(), chunks, histograms, staging })
    }

    /// The results for the bodies in their present states, at `time`, s.
    pub fn gather(&mut self, device: &Device, time: f64) -> Result<Formed> {
        for chunk in &mut self.chunks {
            chunk.settings.time = time;
            device.write(&chunk.uniform, 0, bytemuck::bytes_of(&chunk.settings));
        }
        let commands = device.encoded("gather", |encoder| self.encode(device, encoder))?;
        let mut formed = Formed {
            sound: 0,
            moments: vec![vec![Moments::default(); self.statistics]; self.blocks],
            histograms: Vec::new(),
        };
        device.read(commands, &self.staging, 0..self.staging.size(), |view| {
            let mut rest = view;
            for chunk in &self.chunks {
                let (own, others) = rest.split_at(chunk.moments.size() as usize);
                rest = others;
                let of_piece = self.moments * size_of::<PieceMoments>();
                for (own, &(block, ..)) in own.chunks_exact(of_piece).zip(&chunk.pieces) {
                    let of_quantity = |quantity: usize| -> PieceMoments {
                        let first = quantity * size_of::<PieceMoments>();
                        bytemuck::pod_read_unaligned(&own[first..first + size_of::<PieceMoments>()])
                    };
                    formed.sound += of_quantity(0).sound as usize;
                    for (quantity, moments) in formed.moments[block].iter_mut().enumerate() {
                        *moments = moments.merged(chunk.moments_of(of_quantity(quantity)));
                    }
                }
            }
            let mut counts = rest.chunks_exact(4).map(|bytes| u64::from(bytemuck::pod_read_unaligned::<u32>(bytes)));
            let of_histogram = |&size: &usize| counts.by_ref().take(size).collect();
            formed.histograms = self.histograms.sizes.iter().map(of_histogram).collect();
        })?;
        Ok(formed)
    }

    fn encode(&self, device: &Device, encoder: &mut wgpu::CommandEncoder) {
        let counts = &self.histograms.counts;
        encoder.clear_buffer(counts, 0, None);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        let groups = |chunk: &Chunk| chunk.places.len().div_ceil(WORKGROUP) as u32;
        pass.set_pipeline(&self.kernels.evaluate.pipeline);
        for chunk in &self.chunks {
            pass.set_bind_group(0, &chunk.evaluate, &[]);
            device.dispatch(&mut pass, groups(chunk));
        }
        if !self.histograms.sizes.is_empty() {
            pass.set_pipeline(&self.kernels.count.pipeline);
            for chunk in &self.chunks {
                pass.set_bind_group(0, &chunk.count, &[]);
                device.dispatch(&mut pass, groups(chunk));
            }
        }
        pass.set_pipeline(&self.kernels.reduce.pipeline);
        for chunk in &self.chunks {
            pass.set_bind_group(0, &chunk.reduce, &[]);
            device.dispatch(&mut pass, chunk.pieces.len() as u32);
        }
        drop(pass);
        let mut offset = 0;
        for chunk in &self.chunks {
            encoder.copy_buffer_to_buffer(&chunk.moments, 0, &self.staging, offset, chunk.moments.size());
            offset += chunk.moments.size();
        }
        encoder.copy_buffer_to_buffer(counts, 0, &self.staging, offset, counts.size());
    }

    /// Frees the memory.
    pub fn release(&self) {
        let of_chunk = |chunk: &Chunk| {
            let buffers = [&chunk.uniform, &chunk.columns, &chunk.order, &chunk.values, &chunk.moments];
            buffers.into_iter().for_each(wgpu::Buffer::destroy);
        };
        self.chunks.iter().for_each(of_chunk);
        let Histograms { table, edges, counts, .. } = &self.histograms;
        [table, edges, counts, &self.staging].into_iter().for_each(wgpu::Buffer::destroy);
    }
}

impl Chunk {
    fn new(
        device: &Device,
        kernels: &Kernels,
        (place, places): (&Place<'_>, Vec<u32>),
        (asked, moment_count): (&AskedOfBodies<'_>, usize),
        histograms: &Histograms,
        blocks: &BlockRows,
    ) -> Result<Self, Refusal> {
        let mut pieces = Vec::new();
        for (block, range) in parts_of(&places, blocks) {
            let of_piece = |first| (block, first, GROUP_BODIES.min(range.end - first));
            pieces.extend(range.clone().step_by(GROUP_BODIES).map(of_piece));
        }
        let place_stride = places.len().next_multiple_of(WORKGROUP);
        let settings = Settings {
            stride: place.stride as u32,
            zero: 0,
            piece_count: pieces.len() as u32,
            place_count: places.len() as u32,
            place_stride: place_stride as u32,
            quantity_count: asked.outputs.len() as u32,
            moment_count: moment_count as u32,
            histogram_count: asked.histograms.len() as u32,
            time: 0.0,
        };
        let column_bytes = |count: usize| count * place_stride * size_of::<f64>();
        let widest = column_bytes(column_count(asked).max(asked.outputs.len() + 1));
        if widest as u64 > device.device.limits().max_storage_buffer_binding_size {
            return Err(Refusal::OutOfMemory);
        }
        let uniform = buffer(device, "settings", size_of::<Settings>() as u64, SETTINGS)?;
        let columns = table(device, "frames", column_bytes(column_count(asked)), INPUT)?;
        let values = table(device, "quantities", column_bytes(asked.outputs.len() + 1), INPUT)?;
        let moments =
            table(device, "moments", pieces.len() * moment_count * size_of::<PieceMoments>(), INPUT_AND_OUTPUT)?;
        let order = table(device, "places", (2 * pieces.len() + places.len()) * size_of::<u32>(), INPUT)?;
        let bound = |kernel: &Bound, bindings: Bindings| {
            let entry = |&(binding, _): &(u32, wgpu::BufferBindingType)| {
                let buffer = match binding {
                    0 => &uniform,
                    1 | 2 => place.state,
                    3 => &columns,
                    4 => &order,
                    5..=7 => &values,
                    8 => &moments,
                    9 => &histograms.table,
                    10 => &histograms.edges,
                    _ => &histograms.counts,
                };
                wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() }
            };
            let entries: Vec<_> = bindings.iter().map(entry).collect();
            device.scoped(|| {
                device.device.create_bind_group(&wgpu::BindGroupDescriptor {
                    label: Some("gather"),
                    layout: &kernel.layout,
                    entries: &entries,
                })
            })
        };
        let evaluate = bound(&kernels.evaluate, EVALUATE)?;
        let reduce = bound(&kernels.reduce, REDUCE)?;
        let count = bound(&kernels.count, COUNT)?;
        Ok(Self { places, pieces, settings, uniform, columns, order, values, moments, evaluate, reduce, count })
    }

    /// The moments of a piece, whose extremes name places of the session.
    fn moments_of(&self, found: PieceMoments) -> Moments {
        let PieceMoments { count, mean, squares, least, greatest, least_place, greatest_place, .. } = found;
        if count == 0 {
            return Moments::default();
        }
        let place = |index: u32| self.places[index as usize] as usize;
        // Both zeros count as one.
        let (least, greatest) = (least + 0.0, greatest + 0.0);
        Moments {
            count: u64::from(count),
            mean,
            squares,
            least: (least, place(least_place)),
            greatest: (greatest, place(greatest_place)),
        }
    }
}

/// The number of columns of constants.
fn column_count(asked: &AskedOfBodies<'_>) -> usize {
    FRAME_COLUMNS + asked.constants.len()
}

/// Whether each unit of a body is a single `f64`.
fn has_plain_units(frame: &BodyFrame) -> bool {
    exponents(frame).into_iter().all(|exponent| exponent.abs() < 1000)
}

/// The exponents of the units of angular velocity, angular momentum and energy.
fn exponents(frame: &BodyFrame) -> [i32; 3] {
    let BodyFrame { moment_exponent, rate_exponent, .. } = *frame;
    [rate_exponent, moment_exponent + rate_exponent, moment_exponent + 2 * rate_exponent]
}

/// The columns of the frames of some places, followed by those of the other constants.
fn columns_of(places: &[u32], frames: &[BodyFrame], asked: &AskedOfBodies<'_>) -> Vec<f64> {
    let mut columns = vec![0.0; column_count(asked) * places.len()];
    for (index, &place) in places.iter().enumerate() {
        let frame = &frames[place as usize];
        let [i, j, k] = frame.scaled_moments.to_array();
        let [x, y, z, w] = frame.principal_to_body.to_array();
        let [a, b, c] = exponents(frame).map(|exponent| power_of_two_factors(exponent).iter().product());
        let own = [i, j, k, x, y, z, w, a, b, c, f64::from(u8::from(frame.is_linear_rotor))];
        let others = asked.constants.iter().map(|&input| (asked.constant)(input, place as usize));
        for (column, number) in own.into_iter().chain(others).enumerate() {
            columns[column * places.len() + index] = number;
        }
    }
    columns
}

/// The text of the function that forms some quantities of a body, and of `quantities_of`, which passes it the body in a
/// place.
pub(super) fn quantities(
    graph: &Graph,
    outputs: &[Node],
    constants: &[(Input, usize)],
    declared: &BTreeSet<String>,
) -> std::result::Result<String, WgslError> {
    let inputs = |kind, count| (0..count).map(move |index| Input { kind, index });
    let number = |kind, index| [Input { kind, index }];
    let mut parameters = vec![
        Argument::new("orientation", Shape::Quaternion, inputs(InputKind::Orientation, 4)),
        Argument::new("angular_velocity", Shape::Vector, inputs(InputKind::AngularVelocity, 3)),
        Argument::new("momentum_world", Shape::Vector, inputs(InputKind::Parameter, 3)),
        Argument::new("kinetic_energy", Shape::Number, number(InputKind::Parameter, 3)),
        Argument::new("time", Shape::Number, number(InputKind::Time, 0)),
    ];
    let mut arguments: Vec<String> = [
        "state.orientation",
        "state.angular_velocity",
        "state.momentum_world",
        "state.kinetic_energy",
        "settings.time",
    ]
    .map(str::to_owned)
    .to_vec();
    for &(input, column) in constants {
        let name = match input.kind {
            InputKind::Inertia => {
                format!("inertia_{}", ["xx", "yy", "zz", "xy", "xz", "yz"][usize::from(input.index) % 6])
            }
            _ => PARAMETERS[usize::from(input.index) % PARAMETERS.len()].to_owned(),
        };
        parameters.push(Argument::new(name, Shape::Number, [input]));
        arguments.push(format!("column_at({column}u, place)"));
    }
    let comment = vec!["What is asked of a body.".to_owned()];
    let signature = Signature { name: "quantities".to_owned(), comment, parameters };
    let mut text = wgsl::function_beside(graph, outputs, &signature, declared)?;
    let array = wgsl::array_type(outputs.len());
    text += &format!("\nfn quantities_of(state: UserState, place: u32) -> {array} {{\n");
    text += &format!("    let found = quantities(\n        {},\n    );\n", arguments.join(",\n        "));
    text += &match outputs.len() {
        1 => format!("    return {array}(found);\n"),
        3 => format!("    return {array}(found.x, found.y, found.z);\n"),
        4 => format!("    return {array}(found.x, found.y, found.z, found.w);\n"),
        _ => "    return found;\n".to_owned(),
    };
    text += "}\n";
    Ok(text)
}
