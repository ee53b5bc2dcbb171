//! The GPU engine: compute shaders through wgpu.
//!
//! All steps between two reads run in as few dispatches as their length allows ([`SliceLimits`]); an ensemble larger
//! than a binding or a dispatch is cut into chunks ([`ChunkLimits`]). Cuts fall between steps and between bodies, and
//! both words of the state stay on the device, so results do not depend on them. An adapter's arithmetic is probed when
//! it is opened ([`Arithmetic`]), and a precision whose kernels would go wrong there is refused.

use std::path::PathBuf;
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

/// The graphics library, for programs that bring their own device.
pub use wgpu;

mod adaptive;
mod buffers;
mod device;
mod disk_cache;
mod dispatch;
mod free_motion;
mod gather;
mod observe;
mod pipelines;
mod probe;
pub(crate) mod rates;
mod reading;
mod session;
#[doc(hidden)]
pub mod shader;

pub use buffers::ChunkLimits;
pub use device::AdapterKind;
pub use disk_cache::clear_cache;
pub use dispatch::SliceLimits;
pub use probe::{Arithmetic, Fusing, Probe};
pub use shader::Patch;

pub(crate) use device::{Device, adapters, driver_of};

use super::projected::conserving;
use super::{Backend, Description, EngineKind, Link, Session, Traffic};
use crate::engine::batch::{AnyBatch, Batch};
use crate::engine::checks::{check_equal_steps, check_torques, check_uncoupled};
use crate::error::{Error, Result};
use crate::kernel::free_motion::AnyRows;
use crate::kernel::method::Method;
use crate::math::{Precision, of_either};
use crate::scene::AdaptiveSteps;
use crate::torque::force::carried::Carried;
use adaptive::AdaptiveKernels;
use buffers::{Chunk, DeviceScalar, WORKGROUP_SIZE};
use disk_cache::DiskCache;
use dispatch::Slicer;
use free_motion::FreeMotionKernels;
use gather::GatherKernels;
use observe::ObserveKernels;
use pipelines::{Kernel, Pipelines};
use session::{Equal, GpuSession, Start};
use shader::Source;

/// What to open, and within which bounds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GpuOptions {
    /// Index of the adapter as [`crate::engine::devices`] lists them, of whatever kind; `None`: the best real GPU.
    pub adapter: Option<usize>,
    /// Whether a software adapter will do where no index is given and there is no real GPU.
    pub software: bool,
    /// The most bytes of device memory that one session may take; `None`: what the driver gives.
    pub memory: Option<u64>,
    /// Bounds of one chunk.
    pub chunk: ChunkLimits,
    /// Bounds of one submission.
    pub slice: SliceLimits,
    /// Folder of what is kept of devices between runs, one file each: compiled pipelines, where the back end gives them out (Vulkan), and
    /// measured speeds. It is made where it is not there; files that cannot be read or written are passed over. `None`: nothing is kept.
    pub cache: Option<PathBuf>,
    /// Whether quantities, their statistics and their histograms are formed on the device, where it computes in `f64`. `None`: on GPUs, but
    /// not on a software adapter, which takes longer for it than the host's SIMD lanes.
    pub forms_quantities: Option<bool>,
    /// Precisions whose work runs on the CPU beside the GPU ([`crate::Engine::paired`]), however fast the adapter is; work in any other that
    /// the adapter has then runs on the adapter, however slow that is. `None`: those in which the adapter is slower than the CPU.
    pub on_host: Option<Vec<Precision>>,
    /// Changes of shader text: planted faults, by which checks prove that they find faults.
    pub patches: Vec<Patch>,
}

/// Integrates on a GPU.
#[derive(Debug)]
pub struct Gpu {
    device: Arc<Device>,
    arithmetic: Arithmetic,
    precisions: Vec<Precision>,
    options: GpuOptions,
    layout: wgpu::BindGroupLayout,
    pipeline_layout: wgpu::PipelineLayout,
    pipelines: Pipelines,
    free_motion: FreeMotionKernels,
    adaptive: AdaptiveKernels,
    observe: Arc<ObserveKernels>,
    /// In `f32` and `f64`; measured on first use, or kept from another run.
    speeds: [OnceLock<Option<f64>>; 2],
    /// The same of the way to it.
    link: OnceLock<Option<Link>>,
}

/// Floating-point operations a second of the core whose times the table of costs has, in `f32` and `f64` (`polhode bench throughput`).
const CORE_FLOPS: [f64; 2] = [1.16e11, 5.8e10];

/// Dispatches by which a device's speed is measured, and how long each takes, s.
const SPEED_TRIES: usize = 3;
const SPEED_SECONDS: f64 = 2e-3;

/// How long a GPU works before a speed is measured that is kept between runs.
const WARM_UP: Duration = Duration::from_millis(250);

/// A software adapter with the usual options, opened for one test.
#[cfg(test)]
fn opened_for_a_test() -> Gpu {
    let options = GpuOptions { software: true, ..GpuOptions::default() };
    pollster::block_on(Gpu::open(options)).expect("tests need a Vulkan driver")
}

impl Gpu {
    /// Opens the adapter that `options` ask for and probes its arithmetic.
    ///
    /// # Errors
    ///
    /// [`Error::NoAdapter`] where there is none such; [`Error::Device`] where it cannot be opened;
    /// [`Error::Arithmetic`] where its arithmetic fits no kernel.
    pub async fn open(options: GpuOptions) -> Result<Self> {
        let adapters = adapters().await;
        let found = adapters.len();
        let adapter = match options.adapter {
            Some(index) => adapters.into_iter().nth(index),
            None => {
                let kind = |adapter: &wgpu::Adapter| AdapterKind::from(adapter.get_info().device_type);
                adapters
                    .into_iter()
                    .filter(|adapter| kind(adapter).is_real() || options.software)
                    .min_by_key(|adapter| kind(adapter).rank())
            }
        };
        let Some(adapter) = adapter else {
            let wanted = match options.adapter {
                Some(index) => format!("with index {index}"),
                None if options.software => "of any kind".to_owned(),
                None => "in hardware".to_owned(),
            };
            return Err(Error::NoAdapter { wanted, found });
        };
        Self::open_adapter(&adapter, options).await
    }

    pub(crate) async fn open_adapter(adapter: &wgpu::Adapter, options: GpuOptions) -> Result<Self> {
        Self::new(Device::open(adapter, options.cache.as_deref()).await?, options)
    }

    /// Uses a device of the caller's. `f64` needs its feature [`wgpu::Features::SHADER_F64`]; the device's limits
    /// hold, and for compiled pipelines to be kept its feature [`wgpu::Features::PIPELINE_CACHE`]. Its callbacks are left alone, and
    /// `options.adapter` and `options.software` are not read.
    ///
    /// # Errors
    ///
    /// As [`Gpu::open`].
    pub fn on(device: wgpu::Device, queue: wgpu::Queue, options: GpuOptions) -> Result<Self> {
        let mut device = Device::borrowed(device, queue);
        device.cache_in(options.cache.as_deref());
        Self::new(device, options)
    }

    fn new(mut device: Device, options: GpuOptions) -> Result<Self> {
        device.longest_wait = options.slice.longest_wait;
        let arithmetic = probe::probe(&device)?;
        let precisions = arithmetic.precisions();
        if precisions.is_empty() {
            // Every adapter has f32, so it is f32 that has a fault.
            return Err(unavailable(&device, &arithmetic, Precision::F32));
        }
        let layout = bind_group_layout(&device.device);
        let pipeline_layout = pipeline_layout(&device.device, &layout);
        let is_faster = device.kind() != AdapterKind::Software;
        let forms_quantities = options.forms_quantities.unwrap_or(is_faster) && precisions.contains(&Precision::F64);
        let gather = forms_quantities.then(|| GatherKernels::new(options.patches.clone(), options.memory));
        let observe = Arc::new(ObserveKernels::new(options.patches.clone(), gather));
        Ok(Self {
            device: Arc::new(device),
            arithmetic,
            precisions,
            options,
            layout,
            pipeline_layout,
            pipelines: Pipelines::default(),
            free_motion: FreeMotionKernels::default(),
            adaptive: AdaptiveKernels::default(),
            observe,
            speeds: Default::default(),
            link: OnceLock::new(),
        })
    }

    /// What the probe found.
    pub fn arithmetic(&self) -> &Arithmetic {
        &self.arithmetic
    }

    /// What it was opened with.
    pub(super) fn options(&self) -> &GpuOptions {
        &self.options
    }

    /// Refuses a precision that is not offered.
    fn require(&self, precision: Precision) -> Result<()> {
        let is_offered = self.precisions.contains(&precision);
        if is_offered { Ok(()) } else { Err(unavailable(&self.device, &self.arithmetic, precision)) }
    }

    /// The kernel of a source, compiled on first use.
    fn kernel(&self, source: Source) -> Result<Kernel> {
        Ok(self.kernel_of(source.key(), source.patched(&self.options.patches)?))
    }

    /// The kernel of a source with its patches, by the key of what it is without them.
    fn kernel_of(&self, key: shader::Key, source: Source) -> Kernel {
        let layout = self.pipeline_layout.clone();
        self.pipelines.get(&self.device, key, move |device| source.compile(device, &layout, Some(WORKGROUP_SIZE)))
    }

    fn start_batch<T: DeviceScalar>(
        &self,
        mut batch: Batch<T>,
        method: Method,
        carried: Option<(&[Carried], u32)>,
    ) -> Result<Box<dyn Session>> {
        self.require(T::PRECISION)?;
        if method.reads_invariants() && batch.torques.is_empty() {
            batch.append_invariants();
        }
        let forces_first = carried.map(|_| batch.parameter_columns() as u32);
        let source = Source::advance_with_forces(T::PRECISION, method, &batch.torques, forces_first);
        let kernel = self.kernel(source)?;
        let mut loops = batch.loops_of_a_step(method);
        if let Some((centres, parts)) = carried {
            batch.append_centres(centres);
            // One more for the comparison that ends their loop.
            loops = loops.saturating_add(parts).saturating_add(1);
        }
        Ok(Box::new(self.session(&batch, kernel, loops, carried.is_some())?))
    }

    fn start_adaptive_batch(&self, batch: &AnyBatch, steps: AdaptiveSteps, tapped: bool) -> Result<Box<dyn Session>> {
        let precision = batch.precision();
        self.require(precision)?;
        steps.check(precision)?;
        check_torques(batch)?;
        check_uncoupled(batch, Method::Rk8)?;
        let Self { device, options, observe, .. } = self;
        of_either!(AnyBatch, batch, batch => self.adaptive.start(device, batch, steps, tapped, options, observe))
    }

    /// A session whose step leaves evaluations in place of states.
    fn start_tapped_batch<T: DeviceScalar>(&self, batch: &Batch<T>, method: Method) -> Result<Box<dyn Session>> {
        self.require(T::PRECISION)?;
        let source = Source::advance_under(T::PRECISION, method, &batch.torques);
        let patched = source.clone().patched(&self.options.patches)?;
        let kernel = self.kernel_of(source.tapped().key(), patched.tapped());
        Ok(Box::new(self.session(batch, kernel, batch.loops_of_a_step(method), false)?))
    }

    /// A session on columns that are complete; a step takes at most `loops` iterations.
    fn session<T: DeviceScalar>(
        &self,
        batch: &Batch<T>,
        kernel: Kernel,
        loops: u32,
        carries: bool,
    ) -> Result<GpuSession<T, Equal>> {
        let columns = [batch.parameter_columns(), batch.all_state_columns()].map(|columns| columns * size_of::<T>());
        let start = Start {
            device: &self.device,
            options: &self.options,
            observe: &self.observe,
            kernel,
            body_count: batch.body_count,
            ends: &batch.ends,
            row_bytes: (columns[0].max(columns[1]), columns[0] + columns[1]),
        };
        let slicer = Slicer::new(self.options.slice, loops);
        start.session(
            Equal { clock: batch.torques.clock(), slicer, carries },
            |bodies| Chunk::new(&self.device, &self.layout, bodies, batch),
            |chunk, upload| chunk.upload(upload, batch),
        )
    }
}

impl Backend for Gpu {
    fn description(&self) -> Description {
        Description {
            kind: EngineKind::Gpu,
            name: self.device.info.name.clone(),
            driver: self.device.driver(),
            software: self.device.kind() == AdapterKind::Software,
            arithmetic: Some(self.arithmetic),
            on_host: None,
        }
    }

    fn precisions(&self) -> &[Precision] {
        &self.precisions
    }

    fn runs_shaders(&self, precision: Precision) -> bool {
        self.precisions.contains(&precision)
    }

    fn speed(&self, precision: Precision) -> Option<f64> {
        if !self.precisions.contains(&precision) {
            return None;
        }
        let place = usize::from(precision == Precision::F64);
        *self.speeds[place].get_or_init(|| {
            let cache = self.device.disk_cache();
            if let Some(speed) = cache.and_then(|cache| cache.speed(place)) {
                return Some(speed);
            }
            if cache.is_some() && self.device.kind().is_real() {
                let clock = Instant::now();
                rates::warm_up(&self.device, |_| clock.elapsed() >= WARM_UP).ok()?;
            }
            let flops = rates::flops(&self.device, precision, SPEED_TRIES, SPEED_SECONDS).ok()?;
            let speed = flops / CORE_FLOPS[place];
            cache.inspect(|cache| cache.set_speed(place, speed));
            Some(speed)
        })
    }

    fn link(&self) -> Option<Link> {
        *self.link.get_or_init(|| {
            let cache = self.device.disk_cache();
            if let Some(link) = cache.and_then(DiskCache::link) {
                return Some(link);
            }
            let link = rates::link(&self.device).ok()?;
            cache.inspect(|cache| cache.set_link(link));
            Some(link)
        })
    }

    fn traffic(&self) -> Traffic {
        self.device.traffic()
    }

    fn start(&self, batch: AnyBatch, method: Method) -> Result<Box<dyn Session>> {
        check_equal_steps(method)?;
        check_uncoupled(&batch, method)?;
        of_either!(AnyBatch, batch, batch => self.start_batch(batch, method, None))
    }

    fn carries_centres(&self) -> bool {
        true
    }

    fn start_carrying(
        &self,
        batch: AnyBatch,
        method: Method,
        centres: &[Carried],
        parts: u32,
    ) -> Result<Box<dyn Session>> {
        check_uncoupled(&batch, method)?;
        of_either!(AnyBatch, batch, batch => self.start_batch(batch, method, Some((centres, parts))))
    }

    fn start_projected(&self, batch: AnyBatch, method: Method) -> Result<Box<dyn Session>> {
        let batch = conserving(batch, method)?;
        self.require(Precision::F64)?;
        let source = Source::advance_projected(Precision::F64, method);
        let kernel = self.kernel(source)?;
        Ok(Box::new(self.session(&batch, kernel, batch.loops_of_a_step(method), false)?))
    }

    fn start_adaptive(&self, batch: AnyBatch, steps: AdaptiveSteps) -> Result<Box<dyn Session>> {
        self.start_adaptive_batch(&batch, steps, false)
    }

    fn start_tapped(&self, batch: AnyBatch, method: Method) -> Result<Option<Box<dyn Session>>> {
        check_equal_steps(method)?;
        if batch.torques().is_empty() {
            return Ok(None);
        }
        of_either!(AnyBatch, batch, batch => self.start_tapped_batch(&batch, method)).map(Some)
    }

    fn start_adaptive_tapped(&self, batch: AnyBatch, steps: AdaptiveSteps) -> Result<Option<Box<dyn Session>>> {
        if batch.torques().is_empty() {
            return Ok(None);
        }
        self.start_adaptive_batch(&batch, steps, true).map(Some)
    }

    fn start_free(&self, rows: AnyRows) -> Result<Box<dyn Session>> {
        self.require(rows.precision())?;
        of_either!(AnyRows, rows, rows => self.free_motion.start(&self.device, &rows, &self.options, &self.observe))
    }
}

/// Why a precision is not offered.
fn unavailable(device: &Device, arithmetic: &Arithmetic, precision: Precision) -> Error {
    let adapter = device.info.name.clone();
    match arithmetic.probe(precision).and_then(|probe| probe.fault(precision)) {
        Some(fault) => Error::Arithmetic { adapter, precision, fault },
        None => Error::PrecisionUnavailable { adapter, precision },
    }
}

const UNIFORM: wgpu::BufferBindingType = wgpu::BufferBindingType::Uniform;
const READ: wgpu::BufferBindingType = wgpu::BufferBindingType::Storage { read_only: true };
const WRITTEN: wgpu::BufferBindingType = wgpu::BufferBindingType::Storage { read_only: false };

/// Bindings of these types, in their order from 0 on.
fn bindings(device: &wgpu::Device, label: &str, types: &[wgpu::BufferBindingType]) -> wgpu::BindGroupLayout {
    numbered_bindings(device, label, (0..).zip(types.iter().copied()))
}

/// Bindings of these numbers and types.
fn numbered_bindings(
    device: &wgpu::Device,
    label: &str,
    types: impl Iterator<Item = (u32, wgpu::BufferBindingType)>,
) -> wgpu::BindGroupLayout {
    let entry = |(binding, ty)| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
        count: None,
    };
    let entries: Vec<_> = types.map(entry).collect();
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries })
}

/// The bindings that most kernels have: a uniform block, columns that are read, columns that are written.
fn bind_group_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    bindings(device, "columns", &[UNIFORM, READ, WRITTEN])
}

/// Whole buffers for [`bindings`], in their order.
fn entries<const N: usize>(buffers: [&wgpu::Buffer; N]) -> [wgpu::BindGroupEntry<'_>; N] {
    std::array::from_fn(|binding| wgpu::BindGroupEntry {
        binding: binding as u32,
        resource: buffers[binding].as_entire_binding(),
    })
}

fn pipeline_layout(device: &wgpu::Device, layout: &wgpu::BindGroupLayout) -> wgpu::PipelineLayout {
    device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("columns"),
        bind_group_layouts: &[Some(layout)],
        ..Default::default()
    })
}
