//! One million bodies, 1,000 steps in f32, final state only, on the CPU engine: the peak memory of this process.

#[path = "support/peak_memory.rs"]
mod peak_memory;

#[test]
fn a_million_bodies_take_less_than_600_mb_on_the_cpu_engine() {
    peak_memory::check(&polhode::Engine::cpu(), 1_000);
}
