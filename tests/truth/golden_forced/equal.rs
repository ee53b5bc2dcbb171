//! Equal steps of `rk4`.

use polhode::Method;
use polhode::engine::Backend;
use polhode::engine::cpu::Cpu;
use polhode::math::Precision;
use polhode::math::Width;

use super::support::stepped::{Tally, stepped, unit};
use super::{MEANINGLESS, common, difference, prepared};

/// Steps every case. Truncation is estimated from the same run at twice the step (Richardson: the error is the difference over 2⁴ − 1;
/// doubled for its own error), rounding of the state as in `golden.rs`.
fn check(engine: &dyn Backend, precision: Precision) {
    let unit = unit(precision);
    let mut tally = Tally::default();
    for prepared in prepared() {
        let (case, rate, dt) = (&prepared.case, prepared.rate, prepared.dt);
        let tested = stepped(engine, (Method::Rk4, precision), &prepared.torques, &[prepared.row()], &case.times(), dt);
        for (index, state) in case.states.iter().enumerate() {
            let rounding = match precision {
                Precision::F32 => unit * (4.0 + rate * state.time),
                Precision::F64 => unit * (8.0 + 4.0 * (state.time / dt).sqrt()),
            };
            let truncation = prepared.truncation[index];
            let noise = prepared.noise(index, rounding, precision);
            if noise > MEANINGLESS {
                continue;
            }
            let error = difference(tested[index][0], (state.orientation, state.angular_velocity_body), rate);
            tally.push(case, state.time, error, truncation + noise, || {
                let conditioning = prepared.conditioning[index];
                format!("truncation {truncation:.1e}, conditioning {conditioning:?} to the state and the torque")
            });
        }
    }
    tally.finish(&format!("rk4 in {precision}"), LEAST_CHECKED);
}

/// Golden states that can be followed in `f32`, and so in either precision.
const LEAST_CHECKED: usize = 155;

#[test]
fn cpu_f64_follows_the_golden_forced_bodies() {
    check(&Cpu::new(Width::Lanes), Precision::F64);
}

#[test]
fn scalar_f64_follows_the_golden_forced_bodies() {
    check(&Cpu::new(Width::Scalar), Precision::F64);
}

#[test]
fn cpu_f32_follows_the_golden_forced_bodies() {
    check(&Cpu::new(Width::Lanes), Precision::F32);
}

#[test]
fn gpu_f64_follows_the_golden_forced_bodies() {
    check(&common::gpu(), Precision::F64);
}

#[test]
fn gpu_f32_follows_the_golden_forced_bodies() {
    check(&common::gpu(), Precision::F32);
}
