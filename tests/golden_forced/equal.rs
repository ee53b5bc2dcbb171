//! Equal steps of `rk4`.

use polhode::batch::Precision;
use polhode::engine::Backend;
use polhode::engine::cpu::{Cpu, Width};

use super::{MEANINGLESS, common, difference, prepared, stepped, unit};

/// Steps every case. Truncation is estimated from the same run at twice the step (Richardson: the error is the difference over 2⁴ − 1;
/// doubled for its own error), rounding of the state as in `golden.rs`.
fn check(engine: &dyn Backend, precision: Precision) {
    let unit = unit(precision);
    let mut failures = Vec::new();
    let mut checked = 0;
    for prepared in prepared() {
        let (case, rate, dt) = (&prepared.case, prepared.rate, prepared.dt);
        let tested = stepped(engine, &prepared.torques, &[prepared.row()], &case.times(), dt, precision);
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
            checked += 1;
            let bound = truncation + noise;
            let error = difference(tested[index][0], (state.orientation, state.angular_velocity_body), rate);
            if error.is_nan() || error > bound {
                failures.push(format!(
                    "{} at t = {}: error {error:.2e}, bound {bound:.2e} (truncation {truncation:.1e}, conditioning {:?} to the state and the torque)",
                    case.name, state.time, prepared.conditioning[index]
                ));
            }
        }
    }
    println!("{checked} golden states");
    assert!(checked >= LEAST_CHECKED, "only {checked} golden states were compared");
    assert!(failures.is_empty(), "{} of {checked} states:\n{}", failures.len(), failures.join("\n"));
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
