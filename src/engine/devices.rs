//! Which engines this machine has, and which one [`crate::engine::Engine::auto`] takes.

use super::cpu::Cpu;
use super::gpu::{AdapterKind, Arithmetic, Gpu, GpuOptions, adapters, driver_of, wgpu};
use super::paired::Paired;
use super::{Backend, Description};
use crate::error::{Error, Result};
use crate::math::Precision;
use crate::math::Width;

/// An adapter's limits as far as they bound an ensemble.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "study", derive(serde::Serialize))]
pub struct AdapterLimits {
    /// Bytes of one storage binding.
    pub binding_bytes: u64,
    /// Bytes of one buffer.
    pub buffer_bytes: u64,
    /// Workgroups of one dispatch dimension.
    pub workgroups: u32,
    /// Invocations of one workgroup.
    pub workgroup_invocations: u32,
}

/// An adapter's description of itself, and the results of the probe.
#[derive(Clone, Debug, PartialEq)]
pub struct Adapter {
    /// Index by which it is asked for.
    pub index: usize,
    /// The driver's name for it.
    pub name: String,
    /// Graphics interface: vulkan, metal or dx12.
    pub backend: String,
    /// Driver and its version.
    pub driver: String,
    /// Kind of hardware.
    pub kind: AdapterKind,
    /// Limits that bound an ensemble.
    pub limits: AdapterLimits,
    /// Whether it reports 64-bit floating point.
    pub float64: bool,
    /// Whether it reports 64-bit integers.
    pub int64: bool,
    /// What the probe found, or why the adapter could not be opened.
    pub arithmetic: Result<Arithmetic>,
}

impl Adapter {
    /// Precisions that it can be used in.
    pub fn precisions(&self) -> Vec<Precision> {
        self.arithmetic.as_ref().map(Arithmetic::precisions).unwrap_or_default()
    }
}

/// The engine that is taken if none is named.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Choice {
    /// The best real GPU that can be used.
    Gpu {
        /// Its index.
        index: usize,
        /// Its kind.
        kind: AdapterKind,
    },
    /// The CPU: there is no adapter at all.
    CpuNoAdapter,
    /// The CPU: software adapters are slower than it and taken only when asked for.
    CpuOnlySoftware,
    /// The CPU: there are real GPUs, but none can be used.
    CpuUnusable {
        /// The reason for the first of them.
        reason: Error,
    },
}

impl std::fmt::Display for Choice {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Choice::Gpu { index, kind } => write!(formatter, "adapter {index}, a {kind}"),
            Choice::CpuNoAdapter => formatter.write_str("CPU: there is no adapter"),
            Choice::CpuOnlySoftware => formatter
                .write_str("CPU: no adapter is a real GPU, and a software adapter is taken only when asked for"),
            Choice::CpuUnusable { reason } => write!(formatter, "CPU: no GPU can be used: {reason}"),
        }
    }
}

/// The engines of this machine.
#[derive(Clone, Debug, PartialEq)]
pub struct Devices {
    /// All adapters, by index.
    pub adapters: Vec<Adapter>,
    /// The CPU engine.
    pub cpu: Description,
    /// What [`crate::engine::Engine::auto`] takes.
    pub auto: Choice,
}

/// Lists the engines of this machine; opens and probes every adapter.
pub fn devices() -> Devices {
    pollster::block_on(devices_async())
}

/// As [`devices`], for programs with an executor of their own.
pub async fn devices_async() -> Devices {
    let mut listed = Vec::new();
    for (index, adapter) in adapters().await.iter().enumerate() {
        let opened = Gpu::open_adapter(adapter, GpuOptions::default()).await;
        listed.push(describe(index, adapter, opened.map(|gpu| *gpu.arithmetic())));
    }
    let kinds: Vec<_> = listed.iter().map(|adapter| adapter.kind).collect();
    let mut unusable = None;
    let auto = candidates(&kinds)
        .find(|&index| match &listed[index].arithmetic {
            Ok(_) => true,
            Err(error) => {
                unusable.get_or_insert_with(|| error.clone());
                false
            }
        })
        .map(|index| Choice::Gpu { index, kind: kinds[index] });
    let auto = auto.unwrap_or_else(|| cpu_choice(&kinds, unusable));
    Devices { adapters: listed, cpu: Cpu::new(Width::Lanes).description(), auto }
}

/// Opens the engine that is taken if none is named.
pub(super) async fn open_auto(options: GpuOptions) -> (Choice, Box<dyn Backend>) {
    let adapters = adapters().await;
    let kinds: Vec<AdapterKind> = adapters.iter().map(|adapter| adapter.get_info().device_type.into()).collect();
    let mut unusable = None;
    for index in candidates(&kinds) {
        match Gpu::open_adapter(&adapters[index], options.clone()).await {
            Ok(gpu) => return (Choice::Gpu { index, kind: kinds[index] }, Box::new(Paired::new(gpu))),
            Err(error) => {
                unusable.get_or_insert(error);
            }
        }
    }
    (cpu_choice(&kinds, unusable), Box::new(Cpu::new(Width::Lanes)))
}

/// Indices of the real GPUs, the most promising first.
fn candidates(kinds: &[AdapterKind]) -> impl Iterator<Item = usize> {
    let mut indices: Vec<usize> = (0..kinds.len()).filter(|&index| kinds[index].is_real()).collect();
    indices.sort_by_key(|&index| kinds[index].rank());
    indices.into_iter()
}

/// The reason for taking the CPU.
fn cpu_choice(kinds: &[AdapterKind], unusable: Option<Error>) -> Choice {
    match unusable {
        Some(reason) => Choice::CpuUnusable { reason },
        None if kinds.is_empty() => Choice::CpuNoAdapter,
        None => Choice::CpuOnlySoftware,
    }
}

fn describe(index: usize, adapter: &wgpu::Adapter, arithmetic: Result<Arithmetic>) -> Adapter {
    let (info, limits, features) = (adapter.get_info(), adapter.limits(), adapter.features());
    Adapter {
        index,
        name: info.name.clone(),
        backend: info.backend.to_string(),
        driver: driver_of(&info),
        kind: info.device_type.into(),
        limits: AdapterLimits {
            binding_bytes: limits.max_storage_buffer_binding_size,
            buffer_bytes: limits.max_buffer_size,
            workgroups: limits.max_compute_workgroups_per_dimension,
            workgroup_invocations: limits.max_compute_invocations_per_workgroup,
        },
        float64: features.contains(wgpu::Features::SHADER_F64),
        int64: features.contains(wgpu::Features::SHADER_INT64),
        arithmetic,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn auto_tries_real_gpus_only_and_the_discrete_first() {
        use AdapterKind::{Discrete, Integrated, Other, Software, Virtual};
        let order = |kinds: &[AdapterKind]| candidates(kinds).collect::<Vec<_>>();
        assert_eq!(order(&[Software, Virtual, Other, Integrated, Discrete, Discrete]), [4, 5, 3, 1]);
        assert_eq!(order(&[Software, Other]), [0; 0]);
        assert_eq!(cpu_choice(&[Software], None), Choice::CpuOnlySoftware);
        assert_eq!(cpu_choice(&[], None), Choice::CpuNoAdapter);
    }
}
