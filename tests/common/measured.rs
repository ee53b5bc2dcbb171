//! What stands beside a derived bound: the largest difference that was measured.
//!
//! A bound holds in the worst case, on any adapter. Where an engine rounds as those that were measured, a difference beyond
//! [`MEASURED_TIMES`] the largest over [`SEEDS`] draws says that something has changed.

use polhode::engine::{Engine, EngineKind};
use polhode::math::Precision;

/// Draws that a measured figure is of.
pub const SEEDS: u64 = 100;
/// What a difference may come to, in units of the largest that was measured.
pub const MEASURED_TIMES: f64 = 4.0;

/// Whether an engine rounds as those that were measured: the CPU's, and adapters that round products and sums apart, as the twin does.
pub fn is_measured(engine: &Engine, precision: Precision) -> bool {
    engine.description().kind == EngineKind::Cpu || super::rounds_like_scalar_twin(engine, precision)
}

/// Fails where a difference is beyond what was measured, both in units of the derived bound or both in ulps.
pub fn stays_within_measured(engine: &Engine, precision: Precision, what: &str, largest: f64, measured: f64) {
    println!("{what} in {precision}: {largest:.2e}, {measured:.2e} measured");
    let allowed = MEASURED_TIMES * measured;
    assert!(
        !is_measured(engine, precision) || largest <= allowed,
        "{what} in {precision}: {largest}, {allowed} allowed"
    );
}

/// The largest over [`SEEDS`] seeds.
pub fn over_seeds(of_seed: impl Fn(u64) -> f64) -> f64 {
    (0..SEEDS).map(of_seed).fold(0.0, f64::max)
}
