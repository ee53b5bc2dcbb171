//! One-line kernels: a function of the shaders, called on a GPU for every row of a table.

use std::sync::OnceLock;

use polhode::engine::gpu::shader::{Chunk, Source};
use polhode::engine::gpu::wgpu;
use polhode::kernel::method::Method;
use polhode::math::Precision;
use polhode::math::real::Scalar;

/// What a one-line kernel is wrapped in: `r`, `v` and `q` read a real, a vector or a quaternion from a column on,
/// `put_r`, `put_v` and `put_q` write one.
const FRAME: &str = "
struct Settings { count: u32, zero: u32 }
@group(0) @binding(0) var<uniform> settings: Settings;
@group(0) @binding(1) var<storage, read> inputs: array<real>;
@group(0) @binding(2) var<storage, read_write> outputs: array<real>;
var<private> row: u32;
fn r(column: u32) -> real { return inputs[column * settings.count + row]; }
fn v(column: u32) -> vector { return vector(r(column), r(column + 1u), r(column + 2u)); }
fn q(column: u32) -> quaternion { return quaternion(r(column), r(column + 1u), r(column + 2u), r(column + 3u)); }
fn put_r(column: u32, x: real) { outputs[column * settings.count + row] = x; }
fn put_v(column: u32, x: vector) { put_r(column, x.x); put_r(column + 1u, x.y); put_r(column + 2u, x.z); }
fn put_q(column: u32, x: quaternion) { put_v(column, x.xyz); put_r(column + 3u, x.w); }
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    row = id.x;
    if (row >= settings.count) { return; }
";

/// A raw device with what the adapter has of 64-bit arithmetic.
pub struct Harness {
    device: wgpu::Device,
    queue: wgpu::Queue,
}

impl Harness {
    pub fn new() -> Self {
        let (device, queue) = open_device(wgpu::Features::SHADER_F64 | wgpu::Features::SHADER_INT64);
        Self { device, queue }
    }

    /// Runs `line` for every row of `rows` and gives `outputs` numbers a row. Outputs start as NaN.
    pub fn run<T: Scalar>(&self, chunks: &[Chunk], line: &str, rows: &[Vec<T>], outputs: usize) -> Vec<Vec<f64>> {
        let mut text: String = chunks.iter().map(|chunk| chunk.text.as_ref()).collect();
        text.push_str(FRAME);
        text.push_str(line);
        text.push_str("\n}\n");
        let (count, columns) = (rows.len(), rows[0].len());
        let inputs: Vec<T> = (0..columns).flat_map(|column| rows.iter().map(move |row| row[column])).collect();
        let nan = vec![T::from_f64(f64::NAN); outputs * count];
        let bytes = size_of_val(nan.as_slice()) as u64;
        let make = |size: u64, usage| {
            let usage = usage | wgpu::BufferUsages::COPY_DST;
            self.device.create_buffer(&wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false })
        };
        let settings = make(8, wgpu::BufferUsages::UNIFORM);
        let input = make(size_of_val(inputs.as_slice()) as u64, wgpu::BufferUsages::STORAGE);
        let output = make(bytes, wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC);
        let staging = make(bytes, wgpu::BufferUsages::MAP_READ);
        self.queue.write_buffer(&settings, 0, bytemuck::bytes_of(&[count as u32, 0]));
        self.queue.write_buffer(&input, 0, bytemuck::cast_slice(&inputs));
        self.queue.write_buffer(&output, 0, bytemuck::cast_slice(&nan));
        let module = self.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: None,
            source: wgpu::ShaderSource::Wgsl(text.into()),
        });
        // The layout is stated: one found from the shader would lack the bindings that a line does not read.
        let entry = |binding, ty| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
            count: None,
        };
        let layout = self.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: None,
            entries: &[
                entry(0, wgpu::BufferBindingType::Uniform),
                entry(1, wgpu::BufferBindingType::Storage { read_only: true }),
                entry(2, wgpu::BufferBindingType::Storage { read_only: false }),
            ],
        });
        let pipeline_layout = self.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            bind_group_layouts: &[Some(&layout)],
            ..Default::default()
        });
        let pipeline = self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: None,
            layout: Some(&pipeline_layout),
            module: &module,
            entry_point: Some("main"),
            compilation_options: Default::default(),
            cache: None,
        });
        let buffers = [&settings, &input, &output];
        let group = self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &layout,
            entries: &std::array::from_fn::<_, 3, _>(|binding| wgpu::BindGroupEntry {
                binding: binding as u32,
                resource: buffers[binding].as_entire_binding(),
            }),
        });
        let mut encoder = self.device.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.dispatch_workgroups((count as u32).div_ceil(64), 1, 1);
        drop(pass);
        encoder.copy_buffer_to_buffer(&output, 0, &staging, 0, bytes);
        self.queue.submit([encoder.finish()]);
        staging.map_async(wgpu::MapMode::Read, .., |result| result.expect("mapped"));
        self.device.poll(wgpu::PollType::wait_indefinitely()).expect("waited");
        let view = staging.get_mapped_range(..).expect("mapped");
        let numbers: &[T] = bytemuck::cast_slice(&view);
        (0..count).map(|row| (0..outputs).map(|column| numbers[column * count + row].to_f64()).collect()).collect()
    }
}

/// The chunks that every kernel shares, and one method's.
pub fn chunks(precision: Precision, method: Method) -> Vec<Chunk> {
    let source = Source::advance(precision, method);
    source.chunks().iter().filter(|chunk| !matches!(chunk.file, "columns.wgsl" | "advance.wgsl")).cloned().collect()
}

/// A device of the best adapter, as a caller of the library would open one, with those of `features` that it has.
pub fn open_device(features: wgpu::Features) -> (wgpu::Device, wgpu::Queue) {
    // One for all tests of a process: NVIDIA's driver takes no more than some thirty.
    static INSTANCE: OnceLock<wgpu::Instance> = OnceLock::new();
    let instance = INSTANCE.get_or_init(|| wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle()));
    pollster::block_on(async {
        let adapter = instance.request_adapter(&Default::default()).await.expect("tests need a Vulkan driver");
        let descriptor = wgpu::DeviceDescriptor {
            required_features: adapter.features() & features,
            required_limits: adapter.limits(),
            ..Default::default()
        };
        adapter.request_device(&descriptor).await.expect("a device")
    })
}
