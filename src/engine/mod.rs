//! Engines, which integrate a batch of bodies.
//!
//! An [`Engine`] opens a [`Session`] on a batch; the session advances all bodies and returns their raw state. Both
//! engines hold the same columns and run the same kernels, so a session of one can be compared with a session of the
//! other step by step ([`crate::verify`]).

use std::fmt;
use std::sync::Arc;

use crate::engine::batch::AnyBatch;
use crate::error::Result;
use crate::kernel::free_motion::AnyRows;
use crate::kernel::method::Method;
use crate::math::Precision;
use crate::math::Width;
use crate::scene::AdaptiveSteps;
use crate::torque::force::carried::Carried;

#[doc(hidden)]
pub mod batch;
pub(crate) mod checks;
pub(crate) mod controlled;
pub mod cpu;
mod devices;
mod fallback;
pub mod gpu;
#[doc(hidden)]
pub mod load_balance;
mod paired;
#[doc(hidden)]
pub mod projected;
#[doc(hidden)]
pub mod reduction;
mod session;
mod standby;
pub(crate) mod tap;
mod traffic;
#[doc(hidden)]
pub mod under_torques;
#[doc(hidden)]
pub mod watch;

pub use devices::{Adapter, AdapterLimits, Choice, Devices, devices, devices_async};
pub use fallback::{DeviceFault, Fallback};
pub use session::{End, Observer, Progress, Session, StepCounts, unobserved};
pub use traffic::{Link, Traffic};

use checks::{TAYLOR_ON_CPU, taylor_unavailable};
use cpu::Cpu;
use fallback::Guarded;
use gpu::{Arithmetic, Gpu, GpuOptions, wgpu};
use paired::Paired;

/// Whether an engine computes on a GPU or on the processor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EngineKind {
    /// Compute shaders through wgpu.
    Gpu,
    /// SIMD lanes on all cores.
    Cpu,
}

impl EngineKind {
    /// The name in tables and reports.
    pub fn name(self) -> &'static str {
        match self {
            EngineKind::Gpu => "gpu",
            EngineKind::Cpu => "cpu",
        }
    }
}

/// An engine's description of itself, for reports.
#[derive(Clone, Debug, PartialEq)]
pub struct Description {
    /// GPU or CPU.
    pub kind: EngineKind,
    /// The adapter's or the processor's instruction set and cores, in words.
    pub name: String,
    /// Driver and its version; empty on the CPU.
    pub driver: String,
    /// Whether a software adapter stands in for a GPU.
    pub software: bool,
    /// The results of the probe of the adapter's arithmetic; `None` on the CPU, whose arithmetic is that of IEEE 754.
    pub arithmetic: Option<Arithmetic>,
    /// For a GPU with the CPU beside it: what runs on the CPU, and why.
    pub on_host: Option<String>,
}

impl Description {
    /// The name without the number of threads, which does not affect results. Engines for which it is the same give the
    /// same bits.
    pub fn name_of_arithmetic(&self) -> String {
        let parts: Vec<&str> =
            self.name.split(", ").filter(|part| !part.ends_with(" threads") && *part != "1 thread").collect();
        parts.join(", ")
    }
}

/// An engine that is ready for work; copies share it.
///
/// ```
/// use polhode::engine::{Engine, EngineKind};
///
/// let engine = Engine::cpu();
/// assert_eq!(engine.description().kind, EngineKind::Cpu);
/// ```
#[derive(Clone)]
pub struct Engine {
    backend: Arc<dyn Backend>,
}

impl Engine {
    /// The CPU engine: all cores, the widest SIMD lanes of this processor.
    pub fn cpu() -> Self {
        Self { backend: Arc::new(Cpu::new(Width::Lanes)) }
    }

    /// The reference: the CPU, one body at a time, without fused multiply-add.
    pub fn cpu_scalar() -> Self {
        Self { backend: Arc::new(Cpu::new(Width::Scalar)) }
    }

    /// A GPU.
    ///
    /// # Errors
    ///
    /// [`crate::Error::NoAdapter`] where there is no such adapter; [`crate::Error::Device`] where it cannot be opened;
    /// [`crate::Error::Arithmetic`] where its arithmetic fits no kernel.
    pub fn gpu(options: GpuOptions) -> Result<Self> {
        pollster::block_on(Self::gpu_async(options))
    }

    /// As [`Engine::gpu`], for programs with an executor of their own.
    pub async fn gpu_async(options: GpuOptions) -> Result<Self> {
        Ok(Self { backend: Arc::new(Gpu::open(options).await?) })
    }

    /// A device and queue of the caller's; see [`Gpu::on`].
    ///
    /// # Errors
    ///
    /// As [`Engine::gpu`].
    pub fn gpu_on(device: wgpu::Device, queue: wgpu::Queue, options: GpuOptions) -> Result<Self> {
        Ok(Self { backend: Arc::new(Gpu::on(device, queue, options)?) })
    }

    /// An open GPU with the CPU beside it: work in an arithmetic that the GPU lacks, or is slower in than all threads of the CPU, runs
    /// on the CPU, and so do Taylor series. [`Description::on_host`] says what runs there; [`GpuOptions::on_host`] decides it without regard
    /// to speeds.
    ///
    /// This measures the speed of the GPU, which takes some tens of milliseconds, unless the options decide.
    pub fn paired(gpu: Gpu) -> Self {
        Self { backend: Arc::new(Paired::new(gpu)) }
    }

    /// The best real GPU that can be used, with the CPU beside it ([`Engine::paired`]), else the CPU engine; [`devices`] says which and
    /// why. A software adapter is slower than the CPU engine and never taken.
    ///
    /// # Errors
    ///
    /// None at present: a GPU that fails to open gives way to the CPU engine.
    pub fn auto() -> Result<Self> {
        Self::auto_with(GpuOptions::default())
    }

    /// As [`Engine::auto`], within these bounds; `options.adapter` and `options.software` are not read.
    pub fn auto_with(options: GpuOptions) -> Result<Self> {
        pollster::block_on(Self::auto_async(options))
    }

    /// As [`Engine::auto_with`], for programs with an executor of their own.
    pub async fn auto_async(options: GpuOptions) -> Result<Self> {
        let (_, backend) = devices::open_auto(options).await;
        Ok(Self { backend: backend.into() })
    }

    /// The same engine, whose runs continue as `fallback` says when its device is lost, hangs, has no memory left or
    /// fails otherwise: with [`Fallback::Cpu`] on the CPU, from the last output, under the same plan.
    /// [`crate::record::Trust::fallback`] reports it. After a fault the device is not used again, not even by later
    /// runs.
    ///
    /// To be ready for that, the host keeps a copy of all columns and reads the states at each output, even if the run
    /// needs none. An engine that computes on the CPU alone does not change.
    ///
    /// Runs in which a device moves centres of mass along bodies that are not rigid (under internal dissipation, or
    /// with moments that change) do not continue; they end with the error.
    ///
    /// ```
    /// use polhode::Engine;
    /// use polhode::engine::Fallback;
    ///
    /// let engine = Engine::auto()?.with_fallback(Fallback::Cpu);
    /// # Ok::<(), polhode::Error>(())
    /// ```
    #[must_use]
    pub fn with_fallback(self, fallback: Fallback) -> Self {
        match fallback {
            Fallback::None => self,
            Fallback::Cpu => Self { backend: Arc::new(Guarded::new(self.backend)) },
        }
    }

    /// The engine's description.
    pub fn description(&self) -> Description {
        self.backend.description()
    }

    /// Precisions that it can compute in.
    pub fn precisions(&self) -> &[Precision] {
        self.backend.precisions()
    }

    /// Starts a session that advances a batch by `method`.
    ///
    /// # Errors
    ///
    /// As [`Backend::start`].
    pub fn start(&self, batch: AnyBatch, method: Method) -> Result<Box<dyn Session>> {
        let mut session = self.backend.start(batch, method)?;
        session.ready()?;
        Ok(session)
    }

    /// Starts a session that evaluates the closed forms of torque-free bodies at any time.
    ///
    /// # Errors
    ///
    /// As [`Backend::start_free`].
    pub fn start_free(&self, rows: AnyRows) -> Result<Box<dyn Session>> {
        self.backend.start_free(rows)
    }
}

impl Backend for Engine {
    fn inner(&self) -> Option<&dyn Backend> {
        Some(&*self.backend)
    }

    fn description(&self) -> Description {
        self.backend.description()
    }

    fn precisions(&self) -> &[Precision] {
        self.backend.precisions()
    }

    fn start(&self, batch: AnyBatch, method: Method) -> Result<Box<dyn Session>> {
        self.backend.start(batch, method)
    }

    fn start_projected(&self, batch: AnyBatch, method: Method) -> Result<Box<dyn Session>> {
        self.backend.start_projected(batch, method)
    }

    fn start_free(&self, rows: AnyRows) -> Result<Box<dyn Session>> {
        self.backend.start_free(rows)
    }

    fn start_adaptive(&self, batch: AnyBatch, steps: AdaptiveSteps) -> Result<Box<dyn Session>> {
        self.backend.start_adaptive(batch, steps)
    }
}

impl fmt::Debug for Engine {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_tuple("Engine").field(&self.description()).finish()
    }
}

/// The implementation of an engine: one for the CPU, one for wgpu.
pub trait Backend: Send + Sync {
    /// The engine within this one, which does everything that this one does not override; `None` if there is none.
    fn inner(&self) -> Option<&dyn Backend> {
        None
    }

    /// The engine's description.
    fn description(&self) -> Description;

    /// Precisions that it can compute in.
    fn precisions(&self) -> &[Precision];

    /// Starts a session that advances a batch by `method`.
    ///
    /// # Errors
    ///
    /// [`crate::Error::PrecisionUnavailable`] or [`crate::Error::Arithmetic`] where the precision is not among
    /// [`Backend::precisions`]; [`crate::Error::TooManyBodies`] or [`crate::Error::DeviceMemory`] where memory does
    /// not suffice; [`crate::Error::Device`] where the device fails. Nothing is left allocated then.
    fn start(&self, batch: AnyBatch, method: Method) -> Result<Box<dyn Session>>;

    /// As [`Backend::start`], for torque-free bodies in `f64`, with the state projected after each step onto what they conserve
    /// (`kernel/method/projection.rs`). [`crate::Error::Projection`] as [`projected::check`].
    fn start_projected(&self, batch: AnyBatch, method: Method) -> Result<Box<dyn Session>>;

    /// Starts a session that evaluates the closed forms of torque-free bodies at any time.
    ///
    /// # Errors
    ///
    /// As [`Backend::start`].
    fn start_free(&self, rows: AnyRows) -> Result<Box<dyn Session>>;

    /// The number of steps in a precision that the engine does at a time, each taking as long as a core takes according
    /// to the table of costs ([`crate::plan::cost::COSTS`]); `None` if it is not known.
    fn speed(&self, precision: Precision) -> Option<f64> {
        self.inner()?.speed(precision)
    }

    /// How long it takes to reach the engine's device; `None` if there is none, or if it cannot be measured.
    fn link(&self) -> Option<Link> {
        self.inner()?.link()
    }

    /// [`Backend::speed`] of steps by Taylor series, in `f64`; `None` if the engine does not form them.
    fn speed_of_series(&self) -> Option<f64> {
        self.inner()?.speed_of_series()
    }

    /// The fault of its device after which the work continued on another engine; `None` without a fault, and for
    /// engines without a fallback.
    fn fault(&self) -> Option<DeviceFault> {
        self.inner()?.fault()
    }

    /// The traffic between the host and the engine's device since it was opened, by all of its sessions.
    fn traffic(&self) -> Traffic {
        self.inner().map(|inner| inner.traffic()).unwrap_or_default()
    }

    /// The width in which the engine evaluates closed forms on the host; `None` if it does not. For bodies whose states
    /// are read once, the constants are then formed at the reading and not kept.
    fn evaluates_on_host(&self) -> Option<Width> {
        self.inner()?.evaluates_on_host()
    }

    /// Whether shaders do the engine's work in a precision.
    fn runs_shaders(&self, precision: Precision) -> bool {
        self.inner().is_some_and(|inner| inner.runs_shaders(precision))
    }

    /// Starts a session that advances a batch in adaptive steps, by [`crate::kernel::method::rk8_adaptive`].
    ///
    /// # Errors
    ///
    /// As [`Backend::start`]; [`crate::Error::Setting`] as [`AdaptiveSteps::check`]; [`crate::Error::Torque`] where white
    /// noise acts.
    fn start_adaptive(&self, batch: AnyBatch, steps: AdaptiveSteps) -> Result<Box<dyn Session>>;

    /// The same by [`crate::kernel::method::taylor`], in `f64`.
    ///
    /// # Errors
    ///
    /// As [`Backend::start_adaptive`]; [`crate::Error::MethodUnavailable`] in `f32`, on an engine that does not form
    /// series, and for a torque without a series.
    fn start_taylor(&self, batch: AnyBatch, steps: AdaptiveSteps) -> Result<Box<dyn Session>> {
        self.inner().map_or_else(|| Err(taylor_unavailable(TAYLOR_ON_CPU)), |inner| inner.start_taylor(batch, steps))
    }

    /// The same with dense output: steps go beyond the times to which bodies are advanced, where states are those of their series. For
    /// bodies that are advanced to many times between two steps, and whose parameters do not change. It keeps 0.6 to 1.8 KB for each.
    /// [`crate::Error::MethodUnavailable`] where positions are part of the state.
    fn start_dense_taylor(&self, batch: AnyBatch, steps: AdaptiveSteps) -> Result<Box<dyn Session>> {
        let refused = || Err(taylor_unavailable(TAYLOR_ON_CPU));
        self.inner().map_or_else(refused, |inner| inner.start_dense_taylor(batch, steps))
    }

    /// As [`Backend::start`], for one step of bodies under torques that replaces each row's state by a view of one
    /// evaluation (`tap.rs`); `None` if the engine has no such kernels.
    fn start_tapped(&self, batch: AnyBatch, method: Method) -> Result<Option<Box<dyn Session>>> {
        self.inner().map_or(Ok(None), |inner| inner.start_tapped(batch, method))
    }

    /// The same for [`Backend::start_adaptive`] and one attempt.
    fn start_adaptive_tapped(&self, batch: AnyBatch, steps: AdaptiveSteps) -> Result<Option<Box<dyn Session>>> {
        self.inner().map_or(Ok(None), |inner| inner.start_adaptive_tapped(batch, steps))
    }

    /// Whether [`Backend::start_carrying`] moves centres of mass; if not, the host moves them along the rotation.
    fn carries_centres(&self) -> bool {
        self.inner().is_some_and(|inner| inner.carries_centres())
    }

    /// As [`Backend::start`], with the centres of mass of the batch's bodies, one for each row, which every step moves
    /// along ([`crate::torque::force::carried`]). `parts`: the most steps of a centre of mass in one step of the
    /// rotation.
    fn start_carrying(
        &self,
        batch: AnyBatch,
        method: Method,
        centres: &[Carried],
        parts: u32,
    ) -> Result<Box<dyn Session>> {
        match self.inner() {
            Some(inner) => inner.start_carrying(batch, method, centres, parts),
            None => self.start(batch, method),
        }
    }
}
