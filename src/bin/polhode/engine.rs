//! The engine that the arguments ask for.

use polhode::Precision;
use polhode::engine::Backend;
use polhode::engine::cpu::{Cpu, Width};

use crate::arguments::{EngineArguments, PrecisionName};
use crate::output::Failure;

/// Opens the engine that the arguments ask for.
pub fn open(_arguments: &EngineArguments, _quiet: bool) -> Result<Box<dyn Backend>, Failure> {
    Ok(Box::new(Cpu::new(Width::Lanes)))
}

/// Opens the engine that the arguments ask for.
pub fn open_for_verify(_arguments: &EngineArguments) -> Result<Box<dyn Backend>, Failure> {
    Ok(Box::new(Cpu::new(Width::Lanes)))
}

/// The arithmetic that the arguments ask for.
pub fn precision(arguments: &EngineArguments) -> Option<Precision> {
    match arguments.precision {
        PrecisionName::Auto => None,
        PrecisionName::F32 => Some(Precision::F32),
        PrecisionName::F64 => Some(Precision::F64),
    }
}
