//! Adaptive steps of `rk8`, and of `taylor`.

use polhode::bodies::Status;
use polhode::engine::batch::prepare_with;
use polhode::engine::cpu::Cpu;
use polhode::engine::{Backend, End, unobserved};
use polhode::math::Precision;
use polhode::math::Width;
use polhode::scene::AdaptiveSteps;
use polhode::{Ensemble, Method};

use super::support::stepped::{Tally, unit};
use super::{MEANINGLESS, Prepared, common, difference, prepared};

/// Adaptive steps against all cases.
fn check_adaptive(engine: &dyn Backend, precision: Precision, tolerance: f64) {
    check(engine, Method::Rk8, precision, tolerance, prepared().iter(), LEAST_CHECKED_ADAPTIVE);
}

/// An accepted step is off by at most √7 of the tolerance in the quaternion and in the angular momentum's direction and magnitude
/// ([`polhode::kernel::method::rk8_adaptive`]; 7 components in its mean square; of `taylor` each is below the tolerance), the angle by twice that, and
/// the case's conditioning magnifies what each step leaves. At least `least` golden states must have been compared.
pub fn check<'a>(
    engine: &dyn Backend,
    method: Method,
    precision: Precision,
    tolerance: f64,
    cases: impl Iterator<Item = &'a Prepared>,
    least: usize,
) {
    let unit = unit(precision);
    let steps = AdaptiveSteps { tolerance, least_step: None };
    let mut tally = Tally::default();
    for prepared in cases {
        let (case, rate) = (&prepared.case, prepared.rate);
        let ensemble = Ensemble::from_fn(1, |_| prepared.row()).expect("golden bodies are valid");
        let times = case.times();
        let (frames, batch) =
            prepare_with(&ensemble, &prepared.torques, times[times.len() - 1], precision).expect("prepared");
        let session = match method {
            Method::Taylor => engine.start_taylor(batch, steps),
            _ => engine.start_adaptive(batch, steps),
        };
        let mut session = session.expect("started");
        for (index, state) in case.states.iter().enumerate() {
            session.advance_to(End::at(state.time), &mut unobserved).expect("advanced");
            let words = session.read(0..1).expect("read");
            assert_eq!(words.status[0], Status::Valid, "{} at t = {}", case.name, state.time);
            let counts = session.counts().expect("counted")[0];
            let rounding = match precision {
                Precision::F32 => unit * (4.0 + rate * state.time),
                // The torques are evaluated and the state is rounded once a step; 12 stages weigh their roundings by up to 43.
                Precision::F64 => unit * (8.0 + 4.0 * 12.0 * (counts.accepted as f64).sqrt()),
            };
            let (to_state, _) = prepared.conditioning[index];
            let noise = prepared.noise(index, rounding, precision);
            let bound = to_state * 2.0 * 7.0_f64.sqrt() * tolerance * counts.accepted as f64 + noise;
            if bound > MEANINGLESS {
                continue;
            }
            let reached = frames[0].body_state(words.combined(0));
            let reached = (reached.orientation, reached.angular_velocity_body);
            let error = difference(reached, (state.orientation, state.angular_velocity_body), rate);
            tally.push(case, state.time, error, bound, || {
                format!("{counts:?}, conditioning {:?}", prepared.conditioning[index])
            });
        }
    }
    tally.finish(&format!("{method} in {precision} at {tolerance:e}"), least);
}

/// Golden states that can be followed in `f32` with a tolerance of 1e-6, and so in either precision.
const LEAST_CHECKED_ADAPTIVE: usize = 140;

#[test]
fn adaptive_cpu_f64_follows_the_golden_forced_bodies() {
    check_adaptive(&Cpu::new(Width::Lanes), Precision::F64, 1e-12);
}

#[test]
fn adaptive_scalar_f64_follows_the_golden_forced_bodies() {
    check_adaptive(&Cpu::new(Width::Scalar), Precision::F64, 1e-9);
}

#[test]
fn adaptive_cpu_f32_follows_the_golden_forced_bodies() {
    check_adaptive(&Cpu::new(Width::Lanes), Precision::F32, 1e-6);
}

#[test]
fn adaptive_gpu_f64_follows_the_golden_forced_bodies() {
    check_adaptive(&common::gpu(), Precision::F64, 1e-12);
}

#[test]
fn adaptive_gpu_f32_follows_the_golden_forced_bodies() {
    check_adaptive(&common::gpu(), Precision::F32, 1e-6);
}
