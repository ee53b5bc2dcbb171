//! Plans: what is chosen, skipped and refused, and whether the accuracy that was asked for is met.

mod accuracy;
mod adaptive;
mod adaptive_scene;
#[path = "../common/mod.rs"]
mod common;
mod damped;
mod dense;
mod device_costs;
mod forces;
mod iterator;
mod outliers;
mod plan;
mod progress;
mod replay;
mod rounding;
mod sample;
mod sample_size;
mod skips;
mod statistical;
mod status;
#[path = "../support/mod.rs"]
mod support;
mod survey;
mod switches;
