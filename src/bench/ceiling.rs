//! What the machine gives at most: multiply-adds and memory traffic, measured rather than quoted.

use std::hint::black_box;
use std::time::Instant;

use crate::engine::gpu::{adapters, wgpu};
use crate::engine::{Description, EngineKind};
use crate::error::{Error, Result};
use crate::math::Precision;
use crate::math::lanes::{LaneScalar, LaneTask};
use crate::math::real::{Real, Scalar};

/// Ceilings of one engine in one precision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ceiling {
    /// Floating-point operations a second, two for each multiply-add.
    pub flops: f64,
    /// Bytes a second read and written together.
    pub bandwidth: f64,
}

/// The best of so many tries counts: whatever disturbs a try makes it slower.
const TRIES: usize = 7;

/// Measures the ceilings of the engine that says `description` of itself, on the threads of the current pool.
///
/// # Errors
///
/// [`Error::Device`] where the GPU cannot be opened or fails.
pub fn ceiling(description: &Description, precision: Precision) -> Result<Ceiling> {
    match (description.kind, precision) {
        (EngineKind::Cpu, Precision::F32) => Ok(processor::<f32>()),
        (EngineKind::Cpu, Precision::F64) => Ok(processor::<f64>()),
        (EngineKind::Gpu, _) => pollster::block_on(graphics(description, precision)),
    }
}

/// Independent chains of multiply-adds in flight: enough to hide the latency of two pipes of four cycles each.
const CHAINS: usize = 12;

/// Links of each chain: a try takes some tenths of a millisecond, less than a time slice.
const LINKS: u32 = 1 << 16;

/// Tries of a thread.
const SHORT_TRIES: usize = 200;

struct Chains;

impl<T: Scalar> LaneTask<T> for Chains {
    /// Operations done, and a number that depends on all of them.
    type Output = (f64, T);

    #[inline(always)]
    fn run<R: Real<Scalar = T>>(self) -> (f64, T) {
        let (factor, addend) = (R::splat(black_box(0.999_999)), R::splat(black_box(1e-6)));
        let mut chains = [R::splat(0.5); CHAINS];
        for _ in 0..LINKS {
            for chain in &mut chains {
                *chain = chain.mul_add(factor, addend);
            }
        }
        let mut sum = R::splat(0.0);
        for chain in chains {
            sum = sum + chain;
        }
        let mut lanes = [T::from_f64(0.0); 64];
        sum.store(&mut lanes);
        (2.0 * f64::from(LINKS) * (CHAINS * R::LANES) as f64, lanes[0])
    }
}

fn processor<T: LaneScalar + Send>() -> Ceiling {
    // Each thread by itself: the best of its tries is one that nothing disturbed, even on a busy machine.
    let best = || {
        let rate = |_| {
            let clock = Instant::now();
            black_box(T::dispatch(Chains)).0 / clock.elapsed().as_secs_f64()
        };
        (0..SHORT_TRIES).map(rate).fold(0.0, f64::max)
    };
    let flops = rayon::broadcast(|_| best()).into_iter().sum();
    // 256 MiB from and as many to, which fit no cache.
    let threads = rayon::current_num_threads();
    let words = (1 << 25) / threads;
    let mut arrays: Vec<_> = (0..threads).map(|_| (vec![1.0_f64; words], vec![0.0_f64; words])).collect();
    let bytes = (2 * threads * words * size_of::<f64>()) as f64;
    let bandwidth = fastest(|| {
        let clock = Instant::now();
        rayon::scope(|scope| {
            for (from, to) in &mut arrays {
                scope.spawn(|_| black_box(to).copy_from_slice(black_box(from)));
            }
        });
        bytes / clock.elapsed().as_secs_f64()
    });
    Ceiling { flops, bandwidth }
}

fn fastest(mut measure: impl FnMut() -> f64) -> f64 {
    (0..TRIES).map(|_| measure()).fold(0.0, f64::max)
}

/// Invocations of one dispatch.
const INVOCATIONS: u32 = 1 << 16;
/// Iterations of an invocation's loop; software adapters leave a shader's loops after 65,535.
const ITERATIONS: u32 = 1 << 12;
/// Numbers that the copying kernel reads and writes: 64 MiB of `f32`.
const COPIED: u32 = 1 << 24;

/// Eight independent chains of four lanes, once with `fma`, which adapters without the instruction emulate at great cost,
/// and once with a product and a sum, which compilers may fuse; every invocation copies its share with the stride of all,
/// as kernels do.
const SHADER: &str = "
@group(0) @binding(0) var<storage, read> source: array<real>;
@group(0) @binding(1) var<storage, read_write> target_: array<real>;

@compute @workgroup_size(64)
fn fused(@builtin(global_invocation_id) id: vec3<u32>) {
    let factor = vec4<real>(source[0]);
    let addend = vec4<real>(source[1]);
    var a = vec4<real>(source[id.x]);
    var b = a + addend; var c = b + addend; var d = c + addend;
    var e = d + addend; var f = e + addend; var g = f + addend; var h = g + addend;
    for (var i = 0u; i < ITERATIONSu; i += 1u) {
        a = fma(a, factor, addend); b = fma(b, factor, addend); c = fma(c, factor, addend); d = fma(d, factor, addend);
        e = fma(e, factor, addend); f = fma(f, factor, addend); g = fma(g, factor, addend); h = fma(h, factor, addend);
    }
    let sum = a + b + c + d + e + f + g + h;
    target_[id.x] = sum.x + sum.y + sum.z + sum.w;
}

@compute @workgroup_size(64)
fn separate(@builtin(global_invocation_id) id: vec3<u32>) {
    let factor = vec4<real>(source[0]);
    let addend = vec4<real>(source[1]);
    var a = vec4<real>(source[id.x]);
    var b = a + addend; var c = b + addend; var d = c + addend;
    var e = d + addend; var f = e + addend; var g = f + addend; var h = g + addend;
    for (var i = 0u; i < ITERATIONSu; i += 1u) {
        a = a * factor + addend; b = b * factor + addend; c = c * factor + addend; d = d * factor + addend;
        e = e * factor + addend; f = f * factor + addend; g = g * factor + addend; h = h * factor + addend;
    }
    let sum = a + b + c + d + e + f + g + h;
    target_[id.x] = sum.x + sum.y + sum.z + sum.w;
}

@compute @workgroup_size(64)
fn copy(@builtin(global_invocation_id) id: vec3<u32>) {
    for (var i = id.x; i < arrayLength(&source); i += INVOCATIONSu) { target_[i] = source[i]; }
}
";

async fn graphics(description: &Description, precision: Precision) -> Result<Ceiling> {
    let failed = |reason: String| Error::Device { adapter: description.name.clone(), reason };
    let adapter = adapters().await.into_iter().find(|adapter| adapter.get_info().name == description.name);
    let adapter = adapter.ok_or_else(|| failed("is no longer there".to_owned()))?;
    let descriptor = wgpu::DeviceDescriptor {
        required_features: adapter.features() & wgpu::Features::SHADER_F64,
        required_limits: adapter.limits(),
        ..Default::default()
    };
    let (device, queue) = adapter.request_device(&descriptor).await.map_err(|error| failed(error.to_string()))?;
    let (alias, word) = match precision {
        Precision::F32 => ("alias real = f32;", size_of::<f32>()),
        Precision::F64 => ("alias real = f64;", size_of::<f64>()),
    };
    let text = format!("{alias}{SHADER}");
    let text =
        text.replace("ITERATIONSu", &format!("{ITERATIONS}u")).replace("INVOCATIONSu", &format!("{INVOCATIONS}u"));
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("ceilings"),
        source: wgpu::ShaderSource::Wgsl(text.into()),
    });
    // As many numbers as one binding takes.
    let numbers = u64::from(COPIED).min(device.limits().max_storage_buffer_binding_size / word as u64);
    let buffer = || {
        device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("ceilings"),
            size: numbers * word as u64,
            usage: wgpu::BufferUsages::STORAGE,
            mapped_at_creation: false,
        })
    };
    let buffers = [buffer(), buffer()];
    let entry = |binding, read_only| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Storage { read_only },
            has_dynamic_offset: false,
            min_binding_size: None,
        },
        count: None,
    };
    let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("ceilings"),
        entries: &[entry(0, true), entry(1, false)],
    });
    let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        bind_group_layouts: &[Some(&layout)],
        ..Default::default()
    });
    let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("ceilings"),
        layout: &layout,
        entries: &std::array::from_fn::<_, 2, _>(|binding| wgpu::BindGroupEntry {
            binding: binding as u32,
            resource: buffers[binding].as_entire_binding(),
        }),
    });
    let seconds = |entry_point: &str| -> Result<f64> {
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(entry_point),
            layout: Some(&pipeline_layout),
            module: &module,
            entry_point: Some(entry_point),
            compilation_options: Default::default(),
            cache: None,
        });
        let mut least = f64::INFINITY;
        for _ in 0..TRIES {
            let mut encoder = device.create_command_encoder(&Default::default());
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(0, &group, &[]);
            pass.dispatch_workgroups(INVOCATIONS / 64, 1, 1);
            drop(pass);
            let commands = encoder.finish();
            let clock = Instant::now();
            queue.submit([commands]);
            device.poll(wgpu::PollType::wait_indefinitely()).map_err(|error| failed(error.to_string()))?;
            least = least.min(clock.elapsed().as_secs_f64());
        }
        Ok(least)
    };
    // Eight chains of four lanes, two operations each.
    let operations = 2.0 * 8.0 * 4.0 * f64::from(ITERATIONS) * f64::from(INVOCATIONS);
    let flops = operations / seconds("fused")?.min(seconds("separate")?);
    let bandwidth = 2.0 * numbers as f64 * word as f64 / seconds("copy")?;
    Ok(Ceiling { flops, bandwidth })
}
