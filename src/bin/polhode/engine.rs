//! Opens the engine that the arguments ask for.

use std::path::{Path, PathBuf};
use std::time::Duration;

use etcetera::BaseStrategy as _;
use polhode::Precision;
use polhode::engine::gpu::{GpuOptions, SliceLimits};
use polhode::engine::{Engine, EngineKind, Fallback};
use polhode::plan::Costs;
use polhode::study::Study;

use crate::arguments::RunArguments;
use crate::engine_arguments::{CacheArguments, EngineArguments, EngineName, FallbackName, PrecisionName};
use crate::output::{self, Failure};

/// Opens the engine that the arguments ask for; if the choice was free and fell on the CPU, says so unless `quiet`.
pub fn open(arguments: &EngineArguments, quiet: bool) -> Result<Engine, Failure> {
    match (arguments.engine, arguments.adapter) {
        (EngineName::Cpu, Some(_)) => {
            Err(Failure::Input("--adapter excludes --engine cpu: give one of them".to_owned()))
        }
        (EngineName::Cpu, None) => Ok(Engine::cpu()),
        (EngineName::Auto, None) => {
            let engine = Engine::auto_with(options(arguments))?;
            if engine.description().kind == EngineKind::Cpu && !quiet {
                output::note("no GPU to use: the CPU engine computes (`polhode devices` says why)");
            }
            Ok(engine)
        }
        (EngineName::Auto | EngineName::Gpu, _) => Ok(gpu(arguments)?),
    }
}

/// As [`open`], for a run, which may continue on the CPU after a fault of a GPU.
pub fn open_for_run(arguments: &RunArguments) -> Result<Engine, Failure> {
    let fallback = match arguments.fallback {
        FallbackName::None => Fallback::None,
        FallbackName::Cpu => Fallback::Cpu,
    };
    Ok(open(&arguments.engine, arguments.quiet)?.with_fallback(fallback))
}

/// As [`open`], but if the choice is free a software adapter is better than none, as the shaders are to be checked. The CPU
/// engine is opened only on request.
pub fn open_for_verify(arguments: &EngineArguments) -> Result<Engine, Failure> {
    let opened = match (arguments.engine, arguments.adapter) {
        (EngineName::Auto, None) => gpu(arguments).map_err(Failure::from),
        _ => open(arguments, false),
    };
    match opened {
        Err(Failure::Library(polhode::Error::NoAdapter { .. })) if arguments.adapter.is_none() => {
            Err(Failure::NoShader)
        }
        opened => opened,
    }
}

fn gpu(arguments: &EngineArguments) -> polhode::Result<Engine> {
    Engine::gpu(GpuOptions { software: true, ..options(arguments) })
}

fn options(arguments: &EngineArguments) -> GpuOptions {
    let longest_wait = Duration::from_secs(arguments.device_timeout);
    let slice = SliceLimits { longest_wait, ..SliceLimits::default() };
    if let Some(folder) = &arguments.cache.device_cache
        && folder != Path::new("none")
        && let Err(error) = std::fs::create_dir_all(folder)
    {
        output::note(&format!("warning: nothing is kept in --device-cache {}: {error}", folder.display()));
    }
    GpuOptions { adapter: arguments.adapter, slice, cache: cache_folder(&arguments.cache), ..GpuOptions::default() }
}

/// The folder of the device cache; `None` if there is none, on request or because the user has no cache folder.
pub fn cache_folder(arguments: &CacheArguments) -> Option<PathBuf> {
    match &arguments.device_cache {
        Some(folder) if folder == Path::new("none") => None,
        Some(folder) => Some(folder.clone()),
        None => Some(etcetera::choose_base_strategy().ok()?.cache_dir().join("polhode")),
    }
}

/// The arithmetic that the arguments ask for.
pub fn precision(arguments: &EngineArguments) -> Option<Precision> {
    match arguments.precision {
        PrecisionName::Auto => None,
        PrecisionName::F32 => Some(Precision::F32),
        PrecisionName::F64 => Some(Precision::F64),
    }
}

/// The study in the arithmetic that the arguments ask for, if any.
pub fn in_precision(study: Study, arguments: &EngineArguments) -> Study {
    match precision(arguments) {
        Some(precision) => study.with_precision(precision),
        None => study,
    }
}

/// The costs of steps on `engine`: measured ones if a folder is named, otherwise the shipped ones.
pub fn costs(folder: Option<&Path>, engine: &Engine) -> polhode::Result<Costs> {
    folder.map_or_else(|| Ok(Costs::shipped()), |folder| Costs::measured(folder, &engine.description()))
}
