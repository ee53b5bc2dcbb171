//! Mirror: the shaders against their twins on the CPU, step by step, and the engines against each other.

mod adaptive_engines;
mod adaptive_parity;
#[path = "../common/mod.rs"]
mod common;
mod determinism;
mod devices;
mod expression_gpu;
mod free_motion_parity;
#[path = "../support/fused.rs"]
mod fused;
mod gathered;
mod layout;
mod paired;
mod parity;
mod planted_faults;
mod shader;
mod statistics;
mod statistics_of_runs;
mod step_parity;
mod torque_parity;
mod translation_gpu;
mod verify;
#[path = "../support/workspace.rs"]
mod workspace;
