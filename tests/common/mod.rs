//! What the test files share: engines, ensembles, one-line kernels on the GPU, and the comparator.
#![allow(dead_code, reason = "each test file uses its part")]

pub mod compare;
pub mod kernel;
pub mod measured;
pub mod random;
pub mod sizes;
pub mod torques;
pub mod tree;

use std::sync::OnceLock;

use glam::{DQuat, DVec3};
use polhode::bodies::Ensemble;
use polhode::engine::batch::{AnyBatch, prepare};
use polhode::engine::gpu::{ChunkLimits, GpuOptions, SliceLimits};
use polhode::engine::{End, Engine, unobserved};
use polhode::kernel::method::Method;
use polhode::math::Precision;
use polhode::record::{OutputState, Sink};
use random::Random;

/// Asks for every state and drops it.
pub struct Nowhere;

impl Sink for Nowhere {
    fn wants(&mut self, _: usize, _: usize, _: f64) -> bool {
        true
    }

    fn bodies(&mut self, _: usize, _: f64, _: usize, _: &[OutputState]) -> polhode::Result<()> {
        Ok(())
    }
}

/// The options by which tests open an adapter: any kind will do, and none is a failure of the test.
pub fn any_adapter() -> GpuOptions {
    GpuOptions { software: true, ..GpuOptions::default() }
}

/// Says that a test, or a part of one, has nothing to look at on this machine; tests/run.sh lists and counts what was skipped.
pub fn skipped(test: &str, reason: &str) {
    println!("SKIPPED {test}: {reason}");
    if let Some(list) = std::env::var_os("POLHODE_SKIPPED") {
        let mut list =
            std::fs::OpenOptions::new().create(true).append(true).open(list).expect("the list of skipped tests");
        std::io::Write::write_all(&mut list, format!("{test}: {reason}\n").as_bytes()).expect("written");
    }
}

/// The GPU engine on the best adapter there is, which the tests of a binary share: it compiles each kernel once.
pub fn gpu() -> Engine {
    static SHARED: OnceLock<Engine> = OnceLock::new();
    SHARED.get_or_init(own_gpu).clone()
}

/// The same for a test that counts what its device does.
pub fn own_gpu() -> Engine {
    gpu_with(any_adapter())
}

/// The GPU engine with options.
pub fn gpu_with(options: GpuOptions) -> Engine {
    Engine::gpu(options).unwrap_or_else(|error| panic!("tests need a Vulkan driver (Mesa's lavapipe will do): {error}"))
}

/// Options under which a chunk holds `bodies` bodies and a dispatch takes at most `steps` steps.
pub fn cut_options(bodies: u32, steps: u32) -> GpuOptions {
    GpuOptions {
        chunk: ChunkLimits { workgroups: Some(bodies / 64), ..ChunkLimits::default() },
        slice: SliceLimits { steps, ..SliceLimits::default() },
        ..any_adapter()
    }
}

/// Whether an engine rounds products and sums separately, as the scalar twins do: then both agree to the bit.
pub fn rounds_like_scalar_twin(engine: &Engine, precision: Precision) -> bool {
    use polhode::engine::gpu::Fusing::Separate;
    let arithmetic = engine.description().arithmetic.expect("a GPU has been probed");
    let probe = arithmetic.probe(precision).expect("the precision is there");
    probe.fma == Separate && probe.product_and_sum == Separate && probe.subnormals
}

/// The engine of the CPU that rounds products and sums as the shaders do on an adapter: in lanes, which fuse them where the processor can,
/// or one body at a time, which does not.
pub fn twin(engine: &Engine, precision: Precision) -> Engine {
    if fuses(engine, precision) && lanes_fuse() { Engine::cpu() } else { Engine::cpu_scalar() }
}

/// Whether an adapter's multiply-add has one rounding.
pub fn fuses(engine: &Engine, precision: Precision) -> bool {
    let arithmetic = engine.description().arithmetic.expect("a GPU has been probed");
    arithmetic.probe(precision).expect("the precision is there").fma == polhode::engine::gpu::Fusing::Fused
}

/// Whether the lanes of this processor have a multiply-add with one rounding.
fn lanes_fuse() -> bool {
    #[cfg(target_arch = "x86_64")]
    return std::arch::is_x86_feature_detected!("fma");
    #[cfg(not(target_arch = "x86_64"))]
    return cfg!(target_arch = "aarch64");
}

/// Asymmetric bodies whose tensors, orientations and spins are drawn from `seed`: moments b + c, c + a, a + b with
/// a, b, c uniform in [0.2, 1], orientation uniform, spin normal, scaled by ten to a power drawn from −3 to 3.
pub fn asymmetric_ensemble(count: usize, seed: u64) -> Ensemble {
    Ensemble::from_fn(count, |body| {
        let mut random = Random::new(seed.wrapping_mul(0x2545_f491_4f6c_dd1d).wrapping_add(body as u64));
        let [a, b, c] = [(); 3].map(|()| random.between(0.2, 1.0));
        let scale = 10f64.powf(random.between(-3.0, 3.0));
        let q = DQuat::from_array([(); 4].map(|()| random.normal()));
        let omega = DVec3::from_array([(); 3].map(|()| random.normal()));
        (DVec3::new(b + c, c + a, a + b) * scale, q.normalize(), omega)
    })
    .expect("valid bodies")
}

/// The batch of [`asymmetric_ensemble`].
pub fn asymmetric_batch(count: usize, seed: u64, precision: Precision) -> AnyBatch {
    prepare(&asymmetric_ensemble(count, seed), precision).expect("enough memory").1
}

/// The state of all bodies after `steps` steps.
pub fn advanced(
    engine: &Engine,
    batch: &AnyBatch,
    method: Method,
    dt: f64,
    steps: u64,
) -> polhode::bodies::columns::StateWords {
    let count = batch.body_count();
    let mut session = engine.start(batch.clone(), method).expect("started");
    session.advance_to(End::of_steps(dt, steps), &mut unobserved).expect("advanced");
    session.read(0..count).expect("read")
}
