//! Gravity gradients on orbits whose inclination, node, pericentre and mean anomaly are all away from zero, of bodies with a full tensor
//! (`golden/forced_gg_inclined.py`): every method that follows them to rounding, and the order of `rk4`.

use polhode::Method;
use polhode::engine::Backend;
use polhode::engine::cpu::Cpu;
use polhode::math::Precision;
use polhode::math::Width;

use super::support::fitted_order;
use super::support::golden::number;
use super::support::stepped::{Tally, stepped, unit};
use super::{Prepared, adaptive, common, difference, prepared};

/// Golden states: 4 bodies at 6 times.
const STATES: usize = 24;

fn cases() -> impl Iterator<Item = &'static Prepared> {
    prepared().iter().filter(|prepared| prepared.case.name.starts_with("gg_inclined"))
}

#[test]
fn the_cases_are_as_general_as_they_claim() {
    for Prepared { case, .. } in cases() {
        for element in ["inclination", "ascending_node", "pericentre", "mean_anomaly"] {
            let angle = number(&case.record["model"][element]);
            assert!(angle.sin().abs() > 0.05 && angle.cos().abs() > 0.05, "{}: {element} {angle}", case.name);
        }
        assert!(case.record["min_digits_agree"].as_f64().expect("a number") >= 29.0, "{}", case.name);
    }
    assert_eq!(cases().map(|prepared| prepared.case.states.len()).sum::<usize>(), STATES);
    assert_eq!(cases().filter(|prepared| number(&prepared.case.record["model"]["e"]) > 0.2).count(), 2);
}

#[test]
fn adaptive_rk8_follows_inclined_orbits() {
    for engine in [&Cpu::new(Width::Lanes) as &dyn Backend, &common::gpu()] {
        adaptive::check(engine, Method::Rk8, Precision::F64, 1e-13, cases(), STATES);
    }
}

#[test]
fn taylor_follows_inclined_orbits() {
    adaptive::check(&Cpu::new(Width::Lanes), Method::Taylor, Precision::F64, 1e-13, cases(), STATES);
}

/// Rate times step size of `rk8`, whose truncation is then below 1e-13 over 20 s.
const ANGLE_OF_A_STEP: f64 = 1.0 / 32.0;

/// Roundings of a step: of the state, and of 12 slopes that are weighed by up to 6, in units of roundoff of the step's increment.
const STEP_ROUNDINGS: f64 = 4.0;

#[test]
fn equal_steps_of_rk8_follow_inclined_orbits() {
    for engine in [&Cpu::new(Width::Lanes) as &dyn Backend, &common::gpu()] {
        let mut tally = Tally::default();
        for prepared in cases() {
            let (case, rate) = (&prepared.case, prepared.rate);
            let dt = ANGLE_OF_A_STEP / rate;
            let run = |dt: f64| {
                let (torques, rows) = (&prepared.torques, [prepared.row()]);
                stepped(engine, (Method::Rk8, Precision::F64), torques, &rows, &case.times(), dt)
            };
            let (tested, coarse) = (run(dt), run(2.0 * dt));
            for (index, state) in case.states.iter().enumerate() {
                // Richardson: the error is the difference over 2⁸ − 1; doubled for its own error.
                let truncation = 2.0 / 255.0 * difference(coarse[index][0], tested[index][0], rate);
                let steps = (state.time / dt).sqrt();
                let rounding = unit(Precision::F64) * (8.0 + STEP_ROUNDINGS * steps);
                let bound = truncation + prepared.noise(index, rounding, Precision::F64);
                let error = difference(tested[index][0], (state.orientation, state.angular_velocity_body), rate);
                tally.push(case, state.time, error, bound, || format!("truncation {truncation:.1e}"));
            }
        }
        tally.finish(&engine.description().name, STATES);
    }
}

/// How far an observed order may lie from 4.
const ORDER_TOLERANCE: f64 = 0.1;

#[test]
fn rk4_is_fourth_order_on_inclined_orbits() {
    for engine in [&Cpu::new(Width::Lanes) as &dyn Backend, &common::gpu()] {
        for prepared in cases() {
            let (case, rate) = (&prepared.case, prepared.rate);
            let index = case.states.iter().position(|state| state.time == 10.0).expect("a state at 10 s");
            let truth = (case.states[index].orientation, case.states[index].angular_velocity_body);
            // Rounding after 1e4 steps is 1e-14 times the conditioning.
            let errors: Vec<(f64, f64)> = (5..=10)
                .map(|k| {
                    let dt = 2.0_f64.powi(-k);
                    let found = stepped(
                        engine,
                        (Method::Rk4, Precision::F64),
                        &prepared.torques,
                        &[prepared.row()],
                        &[10.0],
                        dt,
                    );
                    (dt, difference(found[0][0], truth, rate))
                })
                .collect();
            let order = fitted_order(&errors);
            println!("{}: order {order:.3} from {errors:?}", case.name);
            assert!((order - 4.0).abs() <= ORDER_TOLERANCE, "{}: order {order:.3} from {errors:?}", case.name);
        }
    }
}
