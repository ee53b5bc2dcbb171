//! `rk8` with adaptive steps: golden bodies, ends that are hit, refusals that are counted, steps that are too small.

use crate::support;

use polhode::bodies::Status;
use polhode::engine::load_balance::{imbalance, order};
use polhode::kernel::method::rk8_adaptive::{Controller, Limits, advance};
use polhode::kernel::rigid_body::State;
use polhode::kernel::torque_kernel::Free;
use polhode::math::real::Real;
use support::attitude_error;
use support::torque_kernel::{Acting, Moving, Torque, attitude, case, start_of, two_words};

const CASES: [(&str, &str); 6] = [
    ("free_asymmetric", "asym_p12"),
    ("forced_top", "heavy_asym0_p"),
    ("forced_torque", "sin_torque0_p"),
    ("forced_gg", "gg_circ_tumble0_p"),
    ("forced_drag", "lin_drag0_p"),
    ("forced_drag", "quad_drag1_p"),
];

const SPAN: f64 = 10.0;

/// Limits that no well-posed case comes near.
fn limits(tolerance: f64) -> Limits<f64> {
    Limits { tolerance, least_step: 1e-6 }
}

/// The state after [`SPAN`], in as many intervals as `ends` says.
fn run(file: &str, name: &str, limits: &Limits<f64>, ends: &[f64]) -> (State<f64>, Controller<f64>) {
    let case = case(file, name);
    let moving = start_of::<f64>(&case);
    let (mut state, mut controller) = (moving.state, Controller::new());
    let mut start = 0.0;
    for &end in ends {
        let acting = Acting { start, ..Acting::new(Torque::of(&case), 1.0) };
        let span = two_words::<f64>(end - start);
        (state, controller) = advance(&moving.body, &acting, span, limits, u32::MAX, controller.over(span), state);
        start = end;
    }
    (state, controller)
}

/// A torque-free body after [`SPAN`].
fn freely<R: Real>(moving: &Moving<R>, limits: &Limits<R>, controller: Controller<R>) -> (State<R>, Controller<R>) {
    let span = two_words(SPAN);
    advance(&moving.body, &Free, span, limits, u32::MAX, controller.over(span), moving.state)
}

fn error(file: &str, name: &str, state: &State<f64>) -> f64 {
    let case = case(file, name);
    let golden = case.states.iter().find(|state| state.time == SPAN).expect("a state at 10 s");
    attitude_error(attitude(state), golden.orientation)
}

#[test]
fn the_error_follows_the_tolerance() {
    // The error of one step is what is bounded; over 10 s, some tens of steps and the problem's own growth come in.
    const GROWTH: f64 = 300.0;
    for (file, name) in CASES {
        let mut last = f64::INFINITY;
        for tolerance in [1e-4, 1e-7, 1e-10] {
            let (state, controller) = run(file, name, &limits(tolerance), &[SPAN]);
            let error = error(file, name, &state);
            println!(
                "{name} at {tolerance:e}: {error:.1e}, {} steps, {} refused",
                controller.accepted, controller.rejected
            );
            assert!(error <= GROWTH * tolerance, "{name} at {tolerance:e}: {error:e}");
            assert!(error < 0.1 * last, "{name}: {error:e} at {tolerance:e} after {last:e}");
            assert_eq!(Status::from_code(state.status), Status::Valid);
            last = error;
        }
    }
}

#[test]
fn ends_of_intervals_are_hit_exactly() {
    // Were an end missed by one rounding of the time, 1e-15 s, nothing would show; by a thousandth of a step, 1e-3 rad would.
    for (file, name) in CASES {
        let (state, _) = run(file, name, &limits(1e-11), &[0.1, 0.100001, 3.7, 9.999999, SPAN]);
        let error = error(file, name, &state);
        assert!(error <= 1e-9, "{name}: {error:e}");
    }
}

#[test]
fn cuts_between_attempts_change_nothing() {
    for (file, name) in CASES {
        let case = case(file, name);
        let moving = start_of::<f64>(&case);
        let acting = Acting::new(Torque::of(&case), 1.0);
        let (span, limits) = (two_words::<f64>(SPAN), limits(1e-8));
        let eager = Controller { step: 2.0, ..Controller::new() }.over(span);
        let whole = advance(&moving.body, &acting, span, &limits, u32::MAX, eager, moving.state);
        let (mut state, mut controller) = (moving.state, eager);
        while controller.under_way(&state) {
            (state, controller) = advance(&moving.body, &acting, span, &limits, 1, controller, state);
        }
        assert!(controller.rejected > 0.0, "{name}: no attempt was refused");
        assert_eq!(controller, whole.1, "{name}");
        assert_eq!(state.orientation, whole.0.orientation, "{name}");
        assert_eq!(state.angular_momentum_principal, whole.0.angular_momentum_principal, "{name}");
    }
}

#[test]
fn a_step_that_is_far_too_long_is_refused_and_counted() {
    let case = case("free_asymmetric", "asym_p12");
    let moving = start_of::<f64>(&case);
    let eager = Controller { step: SPAN, ..Controller::new() };
    let (state, controller) = freely(&moving, &limits(1e-9), eager);
    assert!(controller.rejected >= 2.0, "{controller:?}");
    assert!(error("free_asymmetric", "asym_p12", &state) <= 1e-7);
}

#[test]
fn a_body_that_would_need_a_step_below_the_limit_is_flagged() {
    let case = case("free_asymmetric", "asym_p12");
    let moving = start_of::<f64>(&case);
    // Below rounding, so that no step is ever good enough.
    let limits = Limits { tolerance: 1e-25, least_step: 1e-4 };
    let (state, controller) = freely(&moving, &limits, Controller::new());
    assert_eq!(Status::from_code(state.status), Status::StepBelowLimit);
    assert!(controller.rejected < 200.0, "{controller:?}");
    // Flagged, it is left alone.
    let (later, idle) = freely(&Moving { state, ..moving }, &limits, controller);
    assert_eq!(later.orientation, state.orientation);
    assert_eq!((idle.step, idle.accepted, idle.rejected), (controller.step, controller.accepted, controller.rejected));
}

#[test]
fn f32_meets_tolerances_down_to_1e_5() {
    let case = case("free_asymmetric", "asym_p12");
    let moving = start_of::<f32>(&case);
    let golden = case.states.iter().find(|state| state.time == SPAN).expect("a state at 10 s");
    for tolerance in [1e-4_f32, 1e-5] {
        let limits = Limits { tolerance, least_step: 1e-4 };
        let (state, controller) = freely(&moving, &limits, Controller::new());
        let error = attitude_error(attitude(&state), golden.orientation);
        println!("f32 at {tolerance:e}: {error:.1e}, {controller:?}");
        assert!(error <= 30.0 * f64::from(tolerance), "{tolerance:e}: {error:e}");
    }
}

#[test]
fn order_by_expected_work_balances_neighbours() {
    let case = case("free_asymmetric", "asym_p12");
    let moving = start_of::<f64>(&case);
    // Spins from 1 to 8, in an order that mixes them.
    let spins: Vec<f64> = (0..64).map(|body| 1.0 + f64::from((body * 37) % 64) / 9.0).collect();
    let work: Vec<u64> = spins
        .iter()
        .map(|spin| {
            let mut state = moving.state;
            let m = state.angular_momentum_principal.value;
            state.angular_momentum_principal.value = m * *spin;
            let (_, controller) = freely(&Moving { state, ..moving }, &limits(1e-9), Controller::new());
            (controller.accepted + controller.rejected) as u64
        })
        .collect();
    let ordered: Vec<u64> = order(&spins).into_iter().map(|body| work[body]).collect();
    let (before, after) = (imbalance(&work, 8), imbalance(&ordered, 8));
    println!("imbalance {before:.3} as they come, {after:.3} in order");
    assert!(before > 1.4 && after < 1.15, "{before:.3}, {after:.3}");
}
