//! Speed of the closed form, with the error beside it: `cargo bench --bench free_motion`.

use std::hint::black_box;
use std::time::Instant;

use glam::{DQuat, DVec3};
use polhode::Ensemble;
use polhode::free_motion::{FreeMotion, FreeMotionRows};

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

fn main() {
    let count = 1 << 17;
    let ensemble = bodies(count);
    let mut rows = None;
    let seconds = least_time(5, || {
        let (_, made) = FreeMotionRows::<f64>::prepare(&ensemble).expect("there is memory");
        let mut state = vec![0.0; 7 * made.stride];
        made.evaluate(10.0, &mut state);
        rows = Some(black_box((made, state)));
    });
    println!("set-up and one evaluation, f64: {:.3e} bodies/s", count as f64 / seconds);

    for (label, count) in [("in cache", 1 << 12), ("streamed", 1 << 20)] {
        let ensemble = bodies(count);
        for time in [10.0, 1e6] {
            let (frames, rows) = FreeMotionRows::<f64>::prepare(&ensemble).expect("there is memory");
            let mut state = vec![0.0; 7 * rows.stride];
            let repeats = (1 << 22) / count;
            let seconds = least_time(5, || {
                for _ in 0..repeats {
                    rows.evaluate(black_box(time), &mut state);
                }
            });
            let mut worst = 0.0_f64;
            for body in (0..count).step_by(97) {
                let words: [f64; 7] = std::array::from_fn(|c| state[c * rows.stride + body]);
                let found = frames[body].body_state(words);
                let exact = FreeMotion::of_body(&ensemble, body).at(time);
                let between = found.orientation.conjugate() * exact.orientation;
                worst = worst.max(2.0 * between.xyz().length());
            }
            println!(
                "evaluation, f64, {label}, t = {time} s: {:.3e} bodies/s, {:.1} GB/s, attitude error against the scalar {worst:.1e} rad",
                (repeats * count) as f64 / seconds,
                (repeats * count) as f64 * (27.0 + 7.0) * 8.0 / seconds / 1e9
            );
            let (frames, rows) = FreeMotionRows::<f32>::prepare(&ensemble).expect("there is memory");
            let mut state = vec![0.0_f32; 14 * rows.stride];
            let seconds = least_time(5, || {
                for _ in 0..repeats {
                    rows.evaluate(black_box(time), &mut state[..7 * rows.stride]);
                }
            });
            let mut worst = 0.0_f64;
            for body in (0..count).step_by(97) {
                let words: [f64; 7] = std::array::from_fn(|c| f64::from(state[c * rows.stride + body]));
                let found = frames[body].body_state(words);
                let exact = FreeMotion::of_body(&ensemble, body).at(time);
                let between = found.orientation.conjugate() * exact.orientation;
                worst = worst.max(2.0 * between.xyz().length());
            }
            println!(
                "evaluation, f32, {label}, t = {time} s: {:.3e} bodies/s, {:.1} GB/s, attitude error against the scalar f64 {worst:.1e} rad",
                (repeats * count) as f64 / seconds,
                (repeats * count) as f64 * (48.0 + 28.0 * 4.0) / seconds / 1e9
            );
        }
    }
}
