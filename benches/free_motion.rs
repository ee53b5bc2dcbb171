//! Speed of the closed form, with the error beside it: `cargo bench --bench free_motion`.

use std::hint::black_box;
use std::time::Instant;

use glam::{DQuat, DVec3};
use polhode::Ensemble;
use polhode::bodies::BodyFrame;
use polhode::bodies::columns::STATE_COMPONENTS;
use polhode::kernel::free_motion::{FreeMotion, FreeMotionRows, ROW_COLUMNS, WORD_COLUMNS};
use polhode::math::real::Scalar;

/// splitmix64 (G. L. Steele, D. Lea, C. H. Flood 2014), as numbers in [0, 1).
struct Draws(u64);

impl Draws {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 * (-53.0_f64).exp2()
    }
    fn normal(&mut self) -> f64 {
        (-2.0 * (1.0 - self.next()).ln()).sqrt() * (std::f64::consts::TAU * self.next()).cos()
    }
}

/// Bodies of the *free* ensemble: moments b + c, c + a, a + b, angular velocity normal, orientation uniform.
fn bodies(count: usize) -> Ensemble {
    let mut draws = Draws(42);
    let rows: Vec<_> = (0..count)
        .map(|_| {
            let mut part = || 0.2 + 0.8 * draws.next();
            let (a, b, c) = (part(), part(), part());
            let mut normal = || draws.normal();
            let omega = DVec3::new(normal(), normal(), normal());
            let q = DQuat::from_xyzw(normal(), normal(), normal(), normal()).normalize();
            (DVec3::new(b + c, c + a, a + b), q, omega)
        })
        .collect();
    Ensemble::from_fn(count, |i| rows[i]).expect("the bodies are valid")
}

/// The least time of some runs of `work`, s.
fn least_time(runs: usize, mut work: impl FnMut()) -> f64 {
    (0..runs)
        .map(|_| {
            let clock = Instant::now();
            work();
            clock.elapsed().as_secs_f64()
        })
        .fold(f64::INFINITY, f64::min)
}

/// Bytes per second that all cores read and write together when they copy arrays that fit no cache.
fn memory_bandwidth() -> f64 {
    let threads = std::thread::available_parallelism().map_or(1, |threads| threads.get());
    let words = (1 << 25) / threads;
    let mut arrays: Vec<_> = (0..threads).map(|_| (vec![1.0_f64; words], vec![0.0_f64; words])).collect();
    let seconds = least_time(8, || {
        std::thread::scope(|scope| {
            for (from, to) in &mut arrays {
                scope.spawn(|| black_box(to).copy_from_slice(black_box(from)));
            }
        });
    });
    (2 * threads * words * size_of::<f64>()) as f64 / seconds
}

/// The largest attitude error of some bodies, rad, against the scalar closed form in `f64`, which the golden tests hold
/// to 2e-14 rad.
fn largest_error<T: Scalar>(ensemble: &Ensemble, frames: &[BodyFrame], columns: &[T], stride: usize, time: f64) -> f64 {
    let error = |body: usize| {
        let row = std::array::from_fn(|column: usize| columns[column * stride + body].to_f64());
        let expected = FreeMotion::of_body(ensemble, body).at(time).orientation;
        let between = frames[body].body_state(row).orientation.conjugate() * expected;
        2.0 * between.xyz().length().atan2(between.w.abs())
    };
    (0..ensemble.len()).step_by(97).map(error).fold(0.0, f64::max)
}

macro_rules! evaluations {
    ($scalar:ident, $label:expr, $ensemble:expr, $time:expr, $bandwidth:expr) => {{
        let (frames, rows) = FreeMotionRows::<$scalar>::prepare($ensemble).expect("there is memory");
        let mut columns = vec![0.0; STATE_COMPONENTS * rows.stride];
        let repeats = (1 << 22) / rows.body_count;
        let seconds = least_time(9, || {
            for _ in 0..repeats {
                rows.evaluate(black_box($time), black_box(&mut columns));
            }
        });
        let evaluations = (repeats * rows.body_count) as f64;
        let bytes = WORD_COLUMNS * size_of::<u64>() + (ROW_COLUMNS + STATE_COMPONENTS) * size_of::<$scalar>();
        let rate = evaluations * bytes as f64 / seconds;
        println!(
            "evaluation, {}, {:>9}, t = {:>7} s: {:.2e} bodies/s, {:>5.1} GB/s ({:.2} of a copy), attitude error {:.1e} rad",
            stringify!($scalar),
            $label,
            $time,
            evaluations / seconds,
            rate / 1e9,
            rate / $bandwidth,
            largest_error($ensemble, &frames, &columns, rows.stride, $time)
        );
    }};
}

fn main() {
    let count = 1 << 17;
    let ensemble = bodies(count);
    for time in [10.0, 1e6] {
        let mut error = 0.0;
        let seconds = least_time(9, || {
            let (frames, rows) = FreeMotionRows::<f64>::prepare(&ensemble).expect("there is memory");
            let mut columns = vec![0.0; STATE_COMPONENTS * rows.stride];
            rows.evaluate(time, &mut columns);
            if error == 0.0 {
                error = largest_error(&ensemble, &frames, &columns, rows.stride, time);
            }
        });
        println!(
            "set-up and one evaluation, f64, t = {time:>7} s: {:.2e} bodies/s, attitude error {error:.1e} rad",
            count as f64 / seconds
        );
    }
    let bandwidth = memory_bandwidth();
    println!("copying memory: {:.1} GB/s", bandwidth / 1e9);
    for (label, count) in [("in cache", 1 << 12), ("streamed", 1 << 20)] {
        let ensemble = bodies(count);
        for time in [10.0, 1e6] {
            evaluations!(f64, label, &ensemble, time, bandwidth);
            evaluations!(f32, label, &ensemble, time, bandwidth);
        }
    }
}
