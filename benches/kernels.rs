//! The hot functions and one step of each method, by criterion.
//!
//! ```text
//! cargo bench --bench kernels                        # everything
//! cargo bench --bench kernels -- --quick             # a fast look
//! cargo bench --bench kernels -- 'step/cpu/rk4'      # some of it
//! ```
//!
//! A GPU, a software adapter too, is measured where there is one. Errors of the methods are `polhode bench accuracy`'s.

use std::hint::black_box;
use std::time::Duration;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use polhode::bodies::columns::STATE_COMPONENTS;
use polhode::engine::batch::prepare;
use polhode::engine::gpu::GpuOptions;
use polhode::engine::{End, unobserved};
use polhode::kernel::free_motion::FreeMotionRows;
use polhode::math::elementary::exp_negative;
use polhode::math::real::sin_cos;
use polhode::study::problem;
use polhode::{Engine, Method};

const BODIES: usize = 4096;
/// Steps in one measured call: enough that loading, storing and submitting do not show.
const STEPS: u64 = 64;
const DT: f64 = 1.0 / 64.0;

/// Scalar functions on 4,096 arguments.
fn functions(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("function");
    group.throughput(Throughput::Elements(BODIES as u64));
    let arguments: Vec<f64> = (0..BODIES).map(|i| 0.01 * i as f64).collect();
    let narrow: Vec<f32> = arguments.iter().map(|x| *x as f32).collect();
    group.bench_function("sin_cos/f64", |b| b.iter(|| arguments.iter().map(|x| sin_cos(black_box(*x)).0).sum::<f64>()));
    group.bench_function("sin_cos/f32", |b| b.iter(|| narrow.iter().map(|x| sin_cos(black_box(*x)).0).sum::<f32>()));
    group.bench_function("exp_negative/f64", |b| {
        b.iter(|| arguments.iter().map(|x| exp_negative(black_box(-*x))).sum::<f64>());
    });
    group.finish();
}

/// The closed form of 4,096 bodies at one time, in lanes, and its set-up.
fn free_motion(criterion: &mut Criterion) {
    let ensemble = problem::free(BODIES, 1).expect("enough memory");
    let mut group = criterion.benchmark_group("free_motion");
    group.throughput(Throughput::Elements(BODIES as u64));
    group.bench_function("prepare/f64", |b| {
        b.iter(|| FreeMotionRows::<f64>::prepare(black_box(&ensemble)).expect("prepared"));
    });
    let (_, rows) = FreeMotionRows::<f64>::prepare(&ensemble).expect("prepared");
    let mut state = vec![0.0_f64; (STATE_COMPONENTS + 1) * rows.stride];
    group.bench_function("evaluate/f64", |b| b.iter(|| rows.evaluate(black_box(1e3), &mut state)));
    let (_, rows) = FreeMotionRows::<f32>::prepare(&ensemble).expect("prepared");
    let mut state = vec![0.0_f32; (2 * STATE_COMPONENTS + 1) * rows.stride];
    group.bench_function("evaluate/f32", |b| b.iter(|| rows.evaluate(black_box(1e3), &mut state)));
    group.finish();
}

/// Steps of each method, on each engine there is.
fn steps(criterion: &mut Criterion) {
    let ensemble = problem::free(BODIES, 1).expect("enough memory");
    let mut engines = vec![("cpu", Engine::cpu())];
    engines.extend(Engine::gpu(GpuOptions { software: true, ..GpuOptions::default() }).ok().map(|gpu| ("gpu", gpu)));
    let mut group = criterion.benchmark_group("step");
    group.throughput(Throughput::Elements(BODIES as u64 * STEPS));
    group.sample_size(10).measurement_time(Duration::from_secs(2)).warm_up_time(Duration::from_millis(500));
    for (name, engine) in &engines {
        for method in Method::ALL {
            for &precision in engine.precisions() {
                let (_, batch) = prepare(&ensemble, precision).expect("enough memory");
                let mut session = engine.start(batch, method).expect("started");
                let id = BenchmarkId::new(*name, format!("{method}/{precision}"));
                group.bench_function(id, |b| {
                    b.iter(|| session.advance_to(End::of_steps(DT, STEPS), &mut unobserved).expect("advanced"));
                });
            }
        }
    }
    group.finish();
}

criterion_group!(kernels, functions, free_motion, steps);
criterion_main!(kernels);
