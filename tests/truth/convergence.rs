//! The observed order of each integrator, against golden data.

use crate::support;

use polhode::engine::Backend;
use polhode::engine::cpu::Cpu;
use polhode::math::Precision;
use polhode::math::Width;
use polhode::{Ensemble, Method, Plan, Scene};
use support::{attitude_error, fitted_order, golden};

/// How far an observed order may lie from the claimed one.
const ORDER_TOLERANCE: f64 = 0.1;

/// Times golden bodies are followed to: 10 to 27 rad.
const SPAN: f64 = 10.0;

/// The attitude error of a case at [`SPAN`], stepped in f64.
fn error_at_end(engine: &dyn Backend, case: &golden::Case, method: Method, dt: f64) -> f64 {
    let ensemble =
        Ensemble::from_columns(&[case.inertia], &[case.orientation], &[case.angular_velocity_body]).expect("valid");
    let scene = Scene::new(ensemble).until(SPAN).pinned(method, dt, Some(Precision::F64));
    let plan = Plan::new(&scene, engine).expect("valid");
    let record = polhode::run::run(engine, &plan).expect("runs");
    let reference = case.states.iter().find(|state| state.time == SPAN).expect("golden state at 10 s");
    attitude_error(record.final_state().orientation(0), reference.orientation)
}

/// Errors at dt = 2^-first … 2^-last, from the first that is in the asymptotic range to the last above `floor`.
fn errors(case: &golden::Case, method: Method, first: i32, last: i32, floor: f64) -> Vec<(f64, f64)> {
    let engine = Cpu::new(Width::Lanes);
    (first..=last)
        .map(|k| {
            let dt = 2.0_f64.powi(-k);
            (dt, error_at_end(&engine, case, method, dt))
        })
        .filter(|point| point.1 > floor)
        .collect()
}

#[test]
fn rk4_is_fourth_order_on_every_golden_asymmetric_body_down_to_1e_12() {
    // Rounding of the state, u √n, is 1e-14 at the smallest step; errors above 3e-13 follow the order.
    const FLOOR: f64 = 3e-13;
    for case in golden::load("free_asymmetric") {
        let points = errors(&case, Method::Rk4, 5, 10, FLOOR);
        assert!(points.len() >= 4, "{}: only {points:?} above {FLOOR:e}", case.name);
        let order = fitted_order(&points);
        assert!((order - 4.0).abs() <= ORDER_TOLERANCE, "{}: order {order:.3} from {points:?}", case.name);
    }
    let case = &golden::load("free_asymmetric")[1];
    let finest = error_at_end(&Cpu::new(Width::Lanes), case, Method::Rk4, 2.0_f64.powi(-9));
    assert!(finest <= 1e-12, "{} at dt = 2^-9: {finest:.2e}", case.name);
}

#[test]
fn dlm_is_second_order_on_every_golden_asymmetric_body() {
    for case in golden::load("free_asymmetric") {
        let points = errors(&case, Method::Dlm, 5, 10, 0.0);
        let order = fitted_order(&points);
        assert!((order - 2.0).abs() <= ORDER_TOLERANCE, "{}: order {order:.3} from {points:?}", case.name);
    }
}
