//! Arguments that choose an engine, shared by the commands that compute.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

/// Which engine computes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum EngineName {
    /// A real GPU if there is one, else the CPU.
    Auto,
    /// A GPU, or a software adapter if there is no real one.
    Gpu,
    /// All cores of the processor.
    Cpu,
}

/// Which arithmetic is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum PrecisionName {
    /// What the study says, else what its accuracy needs.
    Auto,
    /// 32-bit floating point with compensated states.
    F32,
    /// 64-bit floating point.
    F64,
}

/// What happens to a run after a fault of its device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum FallbackName {
    /// It ends with an error.
    None,
    /// It continues on the CPU.
    Cpu,
}

/// The choice of an engine, for every command that computes.
#[derive(Debug, Args)]
pub struct EngineArguments {
    /// Engine that computes.
    #[arg(long, value_enum, default_value = "auto", value_name = "ENGINE")]
    pub engine: EngineName,
    /// GPU adapter, by its index in `polhode devices`.
    #[arg(long, value_name = "INDEX")]
    pub adapter: Option<usize>,
    /// Seconds without an answer after which a GPU counts as hung and the command ends.
    #[arg(long, value_name = "SECONDS", default_value = "120", value_parser = clap::value_parser!(u64).range(1..))]
    pub device_timeout: u64,
    /// Arithmetic.
    #[arg(long, value_enum, default_value = "auto", value_name = "PRECISION")]
    pub precision: PrecisionName,
    #[command(flatten)]
    pub cache: CacheArguments,
}

impl EngineArguments {
    /// What chooses engine and arithmetic, as it is written, each with a blank before it; nothing for what is left to the command.
    pub fn chosen(&self) -> String {
        let mut written = String::new();
        let engine = (self.engine != EngineName::Auto).then(|| self.engine.to_possible_value()).flatten();
        let precision = (self.precision != PrecisionName::Auto).then(|| self.precision.to_possible_value()).flatten();
        let adapter = self.adapter.map(|index| index.to_string());
        let engine = engine.map(|value| value.get_name().to_owned());
        let precision = precision.map(|value| value.get_name().to_owned());
        for (option, value) in [("engine", engine), ("adapter", adapter), ("precision", precision)] {
            written.extend(value.map(|value| format!(" --{option} {value}")));
        }
        written
    }
}

/// The cache of devices between runs.
#[derive(Debug, Args)]
pub struct CacheArguments {
    /// Folder that keeps compiled pipelines and measured speeds of GPUs between runs; none: nothing is kept
    /// [default: the user's folder for caches].
    #[arg(long, value_name = "DIR", env = "POLHODE_DEVICE_CACHE", hide_env_values = true)]
    pub device_cache: Option<PathBuf>,
}
