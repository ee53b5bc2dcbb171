//! The ceilings of the machine, multiply-adds and memory traffic, measured rather than quoted.

use std::hint::black_box;
use std::time::{Duration, Instant};

use crate::engine::gpu::{Device, adapters, rates};
use crate::engine::{Description, EngineKind};
use crate::error::{Error, Result};
use crate::math::Precision;
use crate::math::lanes::{LaneScalar, LaneTask};
use crate::math::real::{Real, Scalar};

/// Ceilings of one engine in one precision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ceiling {
    /// Floating-point operations a second, two for each multiply-add.
    pub flops: f64,
    /// Bytes a second read and written together.
    pub bandwidth: f64,
}

/// Number of tries, of which the best counts: any disturbance makes a try slower.
const TRIES: usize = 7;

/// Measures the ceilings of the engine with this `description`, on the threads of the current pool.
///
/// # Errors
///
/// [`Error::Device`] where the GPU cannot be opened or fails.
pub fn ceiling(description: &Description, precision: Precision) -> Result<Ceiling> {
    match (description.kind, precision) {
        (EngineKind::Cpu, Precision::F32) => Ok(processor::<f32>()),
        (EngineKind::Cpu, Precision::F64) => Ok(processor::<f64>()),
        (EngineKind::Gpu, _) => pollster::block_on(graphics(description, precision)),
    }
}

/// Independent chains of multiply-adds in flight: enough to hide the latency of two pipes of four cycles each.
const CHAINS: usize = 12;

/// Links of each chain: a try takes some tenths of a millisecond, less than a time slice.
const LINKS: u32 = 1 << 16;

/// Number of tries of a thread.
const SHORT_TRIES: usize = 200;

struct Chains;

impl<T: Scalar> LaneTask<T> for Chains {
    /// The number of operations, and a number that depends on all of them.
    type Output = (f64, T);

    #[inline(always)]
    fn run<R: Real<Scalar = T>>(self) -> (f64, T) {
        let (factor, addend) = (R::splat(black_box(0.999_999)), R::splat(black_box(1e-6)));
        let mut chains = [R::splat(0.5); CHAINS];
        for _ in 0..LINKS {
            for chain in &mut chains {
                *chain = chain.mul_add(factor, addend);
            }
        }
        let mut sum = R::splat(0.0);
        for chain in chains {
            sum = sum + chain;
        }
        let mut lanes = [T::from_f64(0.0); 64];
        sum.store(&mut lanes);
        (2.0 * f64::from(LINKS) * (CHAINS * R::LANES) as f64, lanes[0])
    }
}

fn processor<T: LaneScalar + Send>() -> Ceiling {
    // Each thread separately: the best of its tries was not disturbed, even on a busy machine.
    let best = || {
        let rate = |_| {
            let clock = Instant::now();
            black_box(T::dispatch(Chains)).0 / clock.elapsed().as_secs_f64()
        };
        (0..SHORT_TRIES).map(rate).fold(0.0, f64::max)
    };
    let flops = rayon::broadcast(|_| best()).into_iter().sum();
    // 256 MiB are read and as many written, which fit no cache.
    let threads = rayon::current_num_threads();
    let words = (1 << 25) / threads;
    let mut arrays: Vec<_> = (0..threads).map(|_| (vec![1.0_f64; words], vec![0.0_f64; words])).collect();
    let bytes = (2 * threads * words * size_of::<f64>()) as f64;
    let bandwidth = fastest(|| {
        let clock = Instant::now();
        rayon::scope(|scope| {
            for (from, to) in &mut arrays {
                scope.spawn(|_| black_box(to).copy_from_slice(black_box(from)));
            }
        });
        bytes / clock.elapsed().as_secs_f64()
    });
    Ceiling { flops, bandwidth }
}

fn fastest(mut measure: impl FnMut() -> f64) -> f64 {
    (0..TRIES).map(|_| measure()).fold(0.0, f64::max)
}

/// How long a dispatch takes, s, and how long a GPU works before, so that its clocks are up.
const DISPATCH: f64 = 0.02;
pub(super) const WARM_UP: Duration = Duration::from_millis(400);

async fn graphics(description: &Description, precision: Precision) -> Result<Ceiling> {
    let device = open(description).await?;
    if !description.software {
        let clock = Instant::now();
        rates::warm_up(&device, |_| clock.elapsed() >= WARM_UP)?;
    }
    let flops = rates::flops(&device, precision, TRIES, DISPATCH)?;
    Ok(Ceiling { flops, bandwidth: rates::bandwidth(&device, precision, TRIES)? })
}

/// The adapter with this description, opened once more.
pub(super) async fn open(description: &Description) -> Result<Device> {
    let gone = || Error::Device { adapter: description.name.clone(), reason: "is no longer there".to_owned() };
    let adapter = adapters().await.into_iter().find(|adapter| adapter.get_info().name == description.name);
    Device::open(&adapter.ok_or_else(gone)?, None).await
}
