//! Quantities of the bodies of a session, their moments and their histograms, formed on the device: of a million bodies some hundred kilobytes
//! come back.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, PoisonError};

use super::buffers::{DeviceScalar, Place, Upload, buffer};
use super::device::Device;
use super::observe::{parts_of, places_by_chunk};
use super::shader::{Key, Patch, Source};
use crate::bodies::BodyFrame;
use crate::engine::reduction::{AskedOfBodies, BlockRows, Formed};
use crate::error::Result;
use crate::expression::wgsl::{self, Argument, Signature, WgslError};
use crate::expression::{Graph, Input, InputKind, Node, Shape};
use crate::kernel::observe::{GROUP_BODIES, WORKGROUP};
use crate::math::power_of_two::power_of_two_factors;
use crate::math::{Moments, Precision};
use crate::scene::PARAMETERS;

/// Columns of a frame in `gather.wgsl`.
const FRAME_COLUMNS: usize = 11;

/// The kernels of the quantities that were asked for so far, by their text.
#[derive(Debug, Default)]
pub(super) struct GatherKernels {
    patches: Vec<Patch>,
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

/// What a binding of a kernel is.
#[derive(Clone, Copy)]
enum Binding {
    Uniform,
    Read,
    Written,
}

/// The bindings of `evaluate`, `reduce` and `count`.
const EVALUATE: &[(u32, Binding)] = &[
    (0, Binding::Uniform),
    (1, Binding::Read),
    (2, Binding::Read),
    (3, Binding::Read),
    (4, Binding::Read),
    (5, Binding::Written),
];
const REDUCE: &[(u32, Binding)] =
    &[(0, Binding::Uniform), (4, Binding::Read), (6, Binding::Read), (7, Binding::Read), (8, Binding::Written)];
const COUNT: &[(u32, Binding)] = &[
    (0, Binding::Uniform),
    (6, Binding::Read),
    (7, Binding::Read),
    (9, Binding::Read),
    (10, Binding::Read),
    (11, Binding::Written),
];

impl GatherKernels {
    pub fn new(patches: Vec<Patch>) -> Self {
        Self { patches, made: Mutex::default() }
    }

    /// The kernels whose `evaluate` is this source.
    fn get(&self, device: &Device, source: Source) -> Result<Arc<Kernels>> {
        let source = source.patched(&self.patches)?;
        let key = source.key();
        let mut made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, kernels)) = made.iter().find(|(other, _)| *other == key) {
            return Ok(Arc::clone(kernels));
        }
        let bound = |entry_point, bindings| -> Result<Bound> {
            let layout = layout(&device.device, bindings);
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

fn layout(device: &wgpu::Device, bindings: &[(u32, Binding)]) -> wgpu::BindGroupLayout {
    let entry = |&(binding, kind): &(u32, Binding)| {
        let ty = match kind {
            Binding::Uniform => wgpu::BufferBindingType::Uniform,
            Binding::Read => wgpu::BufferBindingType::Storage { read_only: true },
            Binding::Written => wgpu::BufferBindingType::Storage { read_only: false },
        };
        wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
            count: None,
        }
    };
    let entries: Vec<_> = bindings.iter().map(entry).collect();
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some("gather"), entries: &entries })
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
    histogram_count: u32,
    padding: u32,
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

/// What is formed of the bodies of one session.
pub(super) struct Gatherer {
    kernels: Arc<Kernels>,
    quantities: usize,
    /// Which of the quantities have moments.
    statistics: Vec<usize>,
    blocks: usize,
    chunks: Vec<Chunk>,
    /// How many counts each histogram has.
    histograms: Vec<usize>,
    counts: wgpu::Buffer,
    shared: [wgpu::Buffer; 2],
    staging: wgpu::Buffer,
}

/// Bodies of one chunk of the session.
struct Chunk {
    /// The places whose rows are in the chunk.
    places: Vec<u32>,
    /// The block of each piece, its first among the chunk's places and how many it has.
    pieces: Vec<(usize, usize, usize)>,
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

impl Gatherer {
    /// Makes ready what is asked of the bodies in some chunks; none where a formula has no text or a body's units are beyond `f64`.
    pub fn new<T: DeviceScalar>(
        device: &Device,
        kernels: &GatherKernels,
        chunks: &[Place<'_>],
        (asked, frames): (&AskedOfBodies<'_>, &[BodyFrame]),
        blocks: &BlockRows,
    ) -> Result<Option<Self>> {
        let precision = if T::WORDS == 2 { Precision::F32 } else { Precision::F64 };
        let columns = (FRAME_COLUMNS..).zip(asked.constants).map(|(column, &input)| (input, column));
        let Ok(source) = Source::gather(precision, (asked.graph, asked.outputs), &columns.collect::<Vec<_>>()) else {
            return Ok(None);
        };
        if !frames.iter().all(has_plain_units) {
            return Ok(None);
        }
        let kernels = kernels.get(device, source)?;
        let refused = |refusal| device.refused(refusal);
        let input = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        let output = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        let (mut table, mut edges, mut sizes) = (Vec::<u32>::new(), Vec::<f64>::new(), Vec::new());
        for &(quantity, own) in asked.histograms {
            let bins = own.len() - 1;
            let first_count: usize = sizes.iter().sum();
            table.extend([quantity as u32, bins as u32, edges.len() as u32, first_count as u32]);
            edges.extend_from_slice(own);
            sizes.push(bins + 2);
        }
        // Buffers are not empty.
        let bytes_of = |bytes: usize| bytes.max(16) as u64;
        let count_bytes = bytes_of(4 * sizes.iter().sum::<usize>());
        let counts = buffer(device, "counts", count_bytes, output).map_err(refused)?;
        let shared = [
            buffer(device, "histograms", bytes_of(4 * table.len()), input).map_err(refused)?,
            buffer(device, "edges", bytes_of(8 * edges.len()), input).map_err(refused)?,
        ];
        device.write(&shared[0], 0, bytemuck::cast_slice(&table));
        device.write(&shared[1], 0, bytemuck::cast_slice(&edges));
        let mut upload = Upload::new(device);
        let mut own = Vec::with_capacity(chunks.len());
        for (place, places) in chunks.iter().zip(places_by_chunk(chunks, blocks)) {
            let mut pieces = Vec::new();
            for (block, range) in parts_of(&places, blocks) {
                let of_piece = |first| (block, first, GROUP_BODIES.min(range.end - first));
                pieces.extend(range.clone().step_by(GROUP_BODIES).map(of_piece));
            }
            let mut order: Vec<u32> =
                pieces.iter().flat_map(|&(_, first, count)| [first as u32, count as u32]).collect();
            order.extend(places.iter().map(|&body| (blocks.row(body as usize) - place.first) as u32));
            let place_stride = places.len().next_multiple_of(WORKGROUP);
            let settings = Settings {
                stride: place.stride as u32,
                zero: 0,
                piece_count: pieces.len() as u32,
                place_count: places.len() as u32,
                place_stride: place_stride as u32,
                quantity_count: asked.outputs.len() as u32,
                histogram_count: asked.histograms.len() as u32,
                padding: 0,
                time: 0.0,
            };
            let number = size_of::<f64>();
            let column_bytes = (FRAME_COLUMNS + asked.constants.len()) * place_stride * number;
            let value_bytes = (asked.outputs.len() + 1) * place_stride * number;
            let moment_bytes = pieces.len() * asked.outputs.len() * size_of::<PieceMoments>();
            let uniform = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
            let uniform = buffer(device, "settings", size_of::<Settings>() as u64, uniform).map_err(refused)?;
            let columns = buffer(device, "frames", bytes_of(column_bytes), input).map_err(refused)?;
            let values = buffer(device, "quantities", bytes_of(value_bytes), input).map_err(refused)?;
            let moments = buffer(device, "moments", bytes_of(moment_bytes), output).map_err(refused)?;
            let order_bytes = bytes_of(4 * order.len());
            let of_order = buffer(device, "places", order_bytes, input).map_err(refused)?;
            device.write(&of_order, 0, bytemuck::cast_slice(&order));
            let numbers = columns_of(&places, frames, asked);
            upload.columns(&columns, place_stride, &numbers, places.len(), 0..places.len(), 0.0)?;
            let bound = |kernel: &Bound, bindings: &[(u32, Binding)]| {
                let entry = |&(binding, _): &(u32, Binding)| {
                    let buffer = match binding {
                        0 => &uniform,
                        1 | 2 => place.state,
                        3 => &columns,
                        4 => &of_order,
                        5..=7 => &values,
                        8 => &moments,
                        9 => &shared[0],
                        10 => &shared[1],
                        _ => &counts,
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
            let bind_groups = [
                bound(&kernels.evaluate, EVALUATE).map_err(refused)?,
                bound(&kernels.reduce, REDUCE).map_err(refused)?,
                bound(&kernels.count, COUNT).map_err(refused)?,
            ];
            let [evaluate, reduce, count] = bind_groups;
            let order = of_order;
            own.push(Chunk {
                places,
                pieces,
                settings,
                uniform,
                columns,
                order,
                values,
                moments,
                evaluate,
                reduce,
                count,
            });
        }
        upload.finish()?;
        let moments: u64 = own.iter().map(|chunk| chunk.moments.size()).sum();
        let read = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let staging = buffer(device, "gathered", moments + count_bytes, read).map_err(refused)?;
        Ok(Some(Self {
            kernels,
            quantities: asked.outputs.len(),
            statistics: asked.statistics.to_vec(),
            blocks: blocks.count(),
            chunks: own,
            histograms: sizes,
            counts,
            shared,
            staging,
        }))
    }

    /// What is asked of the bodies as their states stand, at `time`, s.
    pub fn gather(&mut self, device: &Device, time: f64) -> Result<Formed> {
        for chunk in &mut self.chunks {
            chunk.settings.time = time;
            device.write(&chunk.uniform, 0, bytemuck::bytes_of(&chunk.settings));
        }
        let commands = device.scoped(|| self.commands(device)).map_err(|refusal| device.refused(refusal))?;
        let mut formed = Formed {
            sound: 0,
            moments: vec![vec![Moments::default(); self.statistics.len()]; self.blocks],
            histograms: Vec::new(),
        };
        device.read(commands, &self.staging, 0..self.staging.size(), |view| {
            let mut rest = view;
            for chunk in &self.chunks {
                let (own, others) = rest.split_at(chunk.moments.size() as usize);
                rest = others;
                let of_piece = self.quantities * size_of::<PieceMoments>();
                for (own, &(block, ..)) in own.chunks_exact(of_piece).zip(&chunk.pieces) {
                    let of_quantity = |quantity: usize| -> PieceMoments {
                        let first = quantity * size_of::<PieceMoments>();
                        bytemuck::pod_read_unaligned(&own[first..first + size_of::<PieceMoments>()])
                    };
                    formed.sound += of_quantity(0).sound as usize;
                    for (&quantity, moments) in self.statistics.iter().zip(&mut formed.moments[block]) {
                        *moments = moments.merged(chunk.moments_of(of_quantity(quantity)));
                    }
                }
            }
            let mut counts = rest.chunks_exact(4).map(|bytes| u64::from(bytemuck::pod_read_unaligned::<u32>(bytes)));
            let of_histogram = |&size: &usize| counts.by_ref().take(size).collect();
            formed.histograms = self.histograms.iter().map(of_histogram).collect();
        })?;
        Ok(formed)
    }

    fn commands(&self, device: &Device) -> wgpu::CommandBuffer {
        let label = Some("gather");
        let mut encoder = device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label });
        encoder.clear_buffer(&self.counts, 0, None);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        let groups = |chunk: &Chunk| chunk.places.len().div_ceil(WORKGROUP) as u32;
        pass.set_pipeline(&self.kernels.evaluate.pipeline);
        for chunk in &self.chunks {
            pass.set_bind_group(0, &chunk.evaluate, &[]);
            device.dispatch(&mut pass, groups(chunk));
        }
        if !self.histograms.is_empty() {
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
        encoder.copy_buffer_to_buffer(&self.counts, 0, &self.staging, offset, self.counts.size());
        encoder.finish()
    }

    /// Gives the memory back.
    pub fn release(&self) {
        let of_chunk = |chunk: &Chunk| {
            let buffers = [&chunk.uniform, &chunk.columns, &chunk.order, &chunk.values, &chunk.moments];
            buffers.into_iter().for_each(wgpu::Buffer::destroy);
        };
        self.chunks.iter().for_each(of_chunk);
        self.shared.iter().chain([&self.counts, &self.staging]).for_each(wgpu::Buffer::destroy);
    }
}

impl Chunk {
    /// The moments of a piece, whose extremes are those of places of the session.
    fn moments_of(&self, found: PieceMoments) -> Moments {
        let PieceMoments { count, mean, squares, least, greatest, least_place, greatest_place, .. } = found;
        if count == 0 {
            return Moments::default();
        }
        let place = |index: u32| self.places[index as usize] as usize;
        // Zeros of both signs are one.
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

/// Whether the units of a body are numbers of one factor.
fn has_plain_units(frame: &BodyFrame) -> bool {
    exponents(frame).into_iter().all(|exponent| exponent.abs() < 1000)
}

/// The exponents of the units of angular velocity, angular momentum and energy.
fn exponents(frame: &BodyFrame) -> [i32; 3] {
    let BodyFrame { moment_exponent, rate_exponent, .. } = *frame;
    [rate_exponent, moment_exponent + rate_exponent, moment_exponent + 2 * rate_exponent]
}

/// The columns of the frames of some places, and behind them those of what else does not change in time.
fn columns_of(places: &[u32], frames: &[BodyFrame], asked: &AskedOfBodies<'_>) -> Vec<f64> {
    let mut columns = vec![0.0; (FRAME_COLUMNS + asked.constants.len()) * places.len()];
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

/// The text of the function that forms some quantities of a body, and of `quantities_of`, which hands it the body in a place.
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
