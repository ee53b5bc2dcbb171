//! Stepped integrators against the golden cases of torque-free bodies, up to 60 rad of rotation.

use crate::common;
use crate::support;

use glam::DVec3;
use polhode::bodies::Status;
use polhode::engine::batch::prepare_with;
use polhode::engine::cpu::Cpu;
use polhode::engine::{Backend, End, unobserved};
use polhode::math::Precision;
use polhode::math::Width;
use polhode::scene::AdaptiveSteps;
use polhode::{Ensemble, Method};
use support::stepped::{Tally, larger, stepped, unit};
use support::{attitude_error, golden, relative_error};

/// Rotation angle |ω| t up to which cases are stepped.
const LARGEST_ANGLE: f64 = 60.0;

/// |ω| dt, with which rk4 in f64 comes to 1e-11 over 60 rad.
const ANGLE_OF_A_STEP: f64 = 1.0 / 256.0;

/// Relative size of the perturbations that measure a case's conditioning: large against rounding (1e-14 by the end) and
/// small against every case's distance from the separatrix that can be followed for 60 rad.
const PERTURBATION: f64 = 1e-11;

/// A bound above this is none. The cases that it leaves out stand under "Do not expect" in the golden data's own notes.
const MEANINGLESS: f64 = 1e-2;

/// How strongly the state at each of `times` answers to a small relative change of ω at any earlier one of them.
///
/// Changes at the start alone would not do: next to the separatrix, at distance ε, the time of the next flip answers as
/// 1/ε to a change at the start of a flip and as 1/ε² to one, by rounding say, in its middle.
fn conditioning(engine: &dyn Backend, case: &golden::Case, times: &[f64], dt: f64) -> Vec<f64> {
    let mut largest = vec![1.0_f64; times.len()];
    for (first, state) in case.states[..times.len()].iter().enumerate() {
        let omega = state.angular_velocity_body;
        let mut rows = vec![(case.inertia, state.orientation, omega)];
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            rows.push((case.inertia, state.orientation, omega + axis * (omega.length() * PERTURBATION)));
        }
        let later: Vec<f64> = times[first..].iter().map(|time| time - state.time).collect();
        for (offset, bodies) in
            stepped(engine, (Method::Rk4, Precision::F64), &[], &rows, &later, dt).iter().enumerate()
        {
            let (q, omega) = bodies[0];
            for &(neighbour_q, neighbour_omega) in &bodies[1..] {
                let response = attitude_error(neighbour_q, q).max(relative_error(neighbour_omega, omega));
                largest[first + offset] = largest[first + offset].max(response / PERTURBATION);
            }
        }
    }
    largest
}

/// Steps every case and holds the error against a bound made of three parts: truncation, estimated from the same run
/// at twice the step (Richardson: the error is the difference over 2⁴ − 1; doubled for its own error); rounding, u per
/// step of the state in f64 (independent, four standard deviations) and u of each increment in f32 (where the state
/// is compensated, so that at worst u ω t adds up), magnified by the case's conditioning; and the golden digits.
fn check(engine: &dyn Backend, precision: Precision) {
    let reference = Cpu::new(Width::Lanes);
    let unit = unit(precision);
    let mut tally = Tally::default();
    for case in golden::load_free() {
        let rate = case.angular_velocity_body.length();
        let times: Vec<f64> =
            case.states.iter().map(|state| state.time).filter(|time| rate * time <= LARGEST_ANGLE).collect();
        let rows = [(case.inertia, case.orientation, case.angular_velocity_body)];
        let dt = if rate > 0.0 { ANGLE_OF_A_STEP / rate } else { 1.0 };
        let fine = stepped(&reference, (Method::Rk4, Precision::F64), &[], &rows, &times, dt);
        let coarse = stepped(&reference, (Method::Rk4, Precision::F64), &[], &rows, &times, 2.0 * dt);
        let tested = stepped(engine, (Method::Rk4, precision), &[], &rows, &times, dt);
        let conditioning = conditioning(&reference, &case, &times, 2.0 * dt);
        for (index, state) in case.states[..times.len()].iter().enumerate() {
            let (q, omega) = tested[index][0];
            let (fine_q, fine_omega) = fine[index][0];
            let conditioning = conditioning[index];
            let (coarse_q, coarse_omega) = coarse[index][0];
            let truncation =
                2.0 / 15.0 * attitude_error(coarse_q, fine_q).max(relative_error(coarse_omega, fine_omega));
            let angle = rate * state.time;
            let steps = angle / ANGLE_OF_A_STEP;
            let rounding = match precision {
                Precision::F32 => unit * (4.0 + angle),
                Precision::F64 => unit * (8.0 + 4.0 * steps.sqrt()),
            };
            let bound = truncation + conditioning * rounding;
            let attitude = attitude_error(q, state.orientation);
            let spin = relative_error(omega, state.angular_velocity_body);
            // Beyond this a bound says nothing: the case's own growth has eaten all digits.
            if conditioning * rounding > MEANINGLESS {
                continue;
            }
            tally.push(&case, state.time, larger(attitude, spin), bound, || {
                format!("truncation {truncation:.1e}, conditioning {conditioning:.1e}")
            });
        }
    }
    tally.finish(&format!("rk4 in {precision}"), 230);
}

/// As [`check`], in adaptive steps up to each golden time. An accepted step is off by at most √7 of the tolerance in the
/// quaternion and in the angular momentum ([`polhode::kernel::method::rk8_adaptive`]; 7 components in its mean square), the angle by
/// twice that, and the case's conditioning magnifies what each step leaves.
fn check_adaptive(engine: &dyn Backend, precision: Precision, tolerance: f64) {
    let reference = Cpu::new(Width::Lanes);
    let unit = unit(precision);
    let steps = AdaptiveSteps { tolerance, least_step: None };
    let mut tally = Tally::default();
    for case in golden::load_free() {
        let rate = case.angular_velocity_body.length();
        let times: Vec<f64> =
            case.states.iter().map(|state| state.time).filter(|time| rate * time <= LARGEST_ANGLE).collect();
        let dt = if rate > 0.0 { ANGLE_OF_A_STEP / rate } else { 1.0 };
        let conditioning = conditioning(&reference, &case, &times, 2.0 * dt);
        let ensemble = Ensemble::from_columns(&[case.inertia], &[case.orientation], &[case.angular_velocity_body])
            .expect("golden bodies are valid");
        let (frames, batch) = prepare_with(&ensemble, &[], times[times.len() - 1], precision).expect("prepared");
        let mut session = engine.start_adaptive(batch, steps).expect("started");
        for (index, state) in case.states[..times.len()].iter().enumerate() {
            session.advance_to(End::at(state.time), &mut unobserved).expect("advanced");
            let words = session.read(0..1).expect("read");
            assert_eq!(words.status[0], Status::Valid, "{} at t = {}", case.name, state.time);
            let accepted = session.counts().expect("counted")[0].accepted as f64;
            let rounding = match precision {
                Precision::F32 => unit * (4.0 + rate * state.time),
                // The state is rounded once a step; 12 stages weigh the roundings of their slopes by up to 43.
                Precision::F64 => unit * (8.0 + 4.0 * 12.0 * accepted.sqrt()),
            };
            let bound = conditioning[index] * (2.0 * 7.0_f64.sqrt() * tolerance * accepted + rounding);
            if bound > MEANINGLESS {
                continue;
            }
            let reached = frames[0].body_state(words.combined(0));
            let attitude = attitude_error(reached.orientation, state.orientation);
            let spin = relative_error(reached.angular_velocity_body, state.angular_velocity_body);
            tally.push(&case, state.time, larger(attitude, spin), bound, || {
                format!("{accepted} steps, conditioning {:.1e}", conditioning[index])
            });
        }
    }
    tally.finish(&format!("adaptive rk8 in {precision} at {tolerance:e}"), LEAST_CHECKED_ADAPTIVE);
}

/// Golden states that can be followed in `f32` with a tolerance of 1e-6, and so in either precision.
const LEAST_CHECKED_ADAPTIVE: usize = 200;

#[test]
fn adaptive_cpu_f64_follows_the_golden_free_bodies() {
    check_adaptive(&Cpu::new(Width::Lanes), Precision::F64, 1e-12);
}

#[test]
fn adaptive_gpu_f64_follows_the_golden_free_bodies() {
    check_adaptive(&common::gpu(), Precision::F64, 1e-12);
}

#[test]
fn adaptive_gpu_f32_follows_the_golden_free_bodies() {
    check_adaptive(&common::gpu(), Precision::F32, 1e-6);
}

#[test]
fn cpu_f64_follows_the_golden_free_bodies() {
    check(&Cpu::new(Width::Lanes), Precision::F64);
}

#[test]
fn scalar_f64_follows_the_golden_free_bodies() {
    check(&Cpu::new(Width::Scalar), Precision::F64);
}

#[test]
fn cpu_f32_follows_the_golden_free_bodies() {
    check(&Cpu::new(Width::Lanes), Precision::F32);
}

#[test]
fn gpu_f32_follows_the_golden_free_bodies() {
    check(&common::gpu(), Precision::F32);
}

#[test]
fn gpu_f64_follows_the_golden_free_bodies() {
    check(&common::gpu(), Precision::F64);
}
