//! Body-steps per second of the stepping methods on the free problem, with the attitude error beside each figure.
//!
//! ```text
//! cargo bench --bench throughput                          # all cores, and every GPU adapter there is
//! RAYON_NUM_THREADS=1 cargo bench --bench throughput      # the CPU engine on one core
//! ```
//!
//! 4,096 asymmetric bodies, 10 s; the truth is the closed form of torque-free motion in f64. Each figure is the median
//! of five repeats of the integration alone (no set-up, no reading back).

use std::time::Instant;

use glam::DQuat;
use polhode::engine::batch::prepare;
use polhode::engine::gpu::GpuOptions;
use polhode::engine::{End, unobserved};
use polhode::kernel::free_motion::FreeMotion;
use polhode::math::Precision;
use polhode::math::Quantiles;
use polhode::study::problem;
use polhode::{Engine, Ensemble, Method, Result};

const BODIES: usize = 4096;
const SPAN: f64 = 10.0;
const REPEATS: usize = 5;
/// Powers of two, so that all of them end at the span exactly.
const STEPS_PER_SECOND: [u32; 3] = [32, 64, 256];

fn main() -> Result<()> {
    let ensemble = problem::free(BODIES, 1)?;
    let truth: Vec<DQuat> = (0..BODIES).map(|body| FreeMotion::of_body(&ensemble, body).at(SPAN).orientation).collect();
    let cores = std::env::var("RAYON_NUM_THREADS")
        .ok()
        .and_then(|count| count.parse().ok())
        .unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));

    let mut engines = vec![(Engine::cpu(), Some(cores))];
    match Engine::gpu(GpuOptions { software: true, ..GpuOptions::default() }) {
        Ok(engine) => engines.push((engine, None)),
        Err(error) => println!("no GPU adapter is measured: {error}"),
    }
    for (engine, cores) in engines {
        let description = engine.description();
        let kind = if description.software { " (a software adapter)" } else { "" };
        println!("\n{}{kind} {}", description.name, description.driver);
        println!(
            "{:<18} {:<9} {:>6} {:>13} {:>13} {:>9} {:>9} {:>9}",
            "method", "precision", "1/dt", "steps/s", "per core", "median", "p99", "max"
        );
        for method in [Method::Rk4, Method::Dlm] {
            for &precision in engine.precisions() {
                for steps_per_second in STEPS_PER_SECOND {
                    let (rate, error) = measure(&engine, &ensemble, &truth, method, precision, steps_per_second)?;
                    let per_core = cores.map_or("-".to_owned(), |cores| format!("{:.3e}", rate / cores as f64));
                    println!(
                        "{:<18} {:<9} {steps_per_second:>6} {rate:>13.3e} {per_core:>13} {:>9.1e} {:>9.1e} {:>9.1e}",
                        method.name(),
                        precision.name(),
                        error.median,
                        error.p99,
                        error.max
                    );
                }
            }
        }
    }
    Ok(())
}

/// Median body-steps per second, and the attitude errors at the end, rad.
fn measure(
    engine: &Engine,
    ensemble: &Ensemble,
    truth: &[DQuat],
    method: Method,
    precision: Precision,
    steps_per_second: u32,
) -> Result<(f64, Quantiles)> {
    let dt = 1.0 / f64::from(steps_per_second);
    let steps = (SPAN / dt) as u64;
    let mut seconds = Vec::new();
    let mut errors = Vec::new();
    for _ in 0..REPEATS {
        let (frames, batch) = prepare(ensemble, precision)?;
        let mut session = engine.start(batch, method)?;
        // One step that is not counted, so that shaders are compiled and threads awake; then the rest.
        session.advance_to(End::of_steps(dt, 1), &mut unobserved)?;
        let clock = Instant::now();
        session.advance_to(End::of_steps(dt, steps - 1), &mut unobserved)?;
        seconds.push(clock.elapsed().as_secs_f64());
        let states = session.read(0..BODIES)?;
        errors = (0..BODIES)
            .map(|body| {
                let between = truth[body].conjugate() * frames[body].body_state(states.combined(body)).orientation;
                2.0 * between.xyz().length().atan2(between.w.abs())
            })
            .collect();
    }
    seconds.sort_by(f64::total_cmp);
    Ok(((steps - 1) as f64 * BODIES as f64 / seconds[REPEATS / 2], Quantiles::of(&mut errors)))
}
