//! One million bodies, 100 steps in f32 (memory does not depend on their number), final state only, on the GPU engine: the peak memory of this process. With a
//! software adapter the device's memory is the process's own and is counted too.

mod common;
#[path = "support/peak_memory.rs"]
mod peak_memory;

#[test]
fn a_million_bodies_take_less_than_600_mb_on_the_gpu_engine() {
    peak_memory::check(&common::gpu(), 100);
}
