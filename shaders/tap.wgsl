// Stores one evaluation of a step in place of the body's state: the inputs of the torques and their results. Twin: Tapped in
// src/verify/tapped.rs. Functions named `untapped_` are those of rigid_body.wgsl, torque/sum.wgsl and columns.wgsl (Source::tapped).

// Row i keeps view i % TAP_VIEWS of evaluation i / TAP_VIEWS; the views are listed in src/engine/tap.rs.
const TAP_VIEWS: u32 = 6u;
const MOTION_ARGUMENT: u32 = 0u;
const MOTION_RESULT: u32 = 1u;
const TORQUE_ARGUMENTS: u32 = 2u;
const TORQUE_RESULT: u32 = 3u;
const ORIENTATION_RATE: u32 = 4u;
const CALLS: u32 = 5u;

var<private> tap_evaluation: u32;
var<private> tap_view: u32;
// Number of calls in this dispatch.
var<private> tap_motions: u32;
var<private> tap_torques: u32;
var<private> tap_rates: u32;
// What is kept, in the order of the state's columns.
var<private> tap_first: quaternion;
var<private> tap_second: vector;

// Whether this invocation keeps a view of the call with this number.
fn keeps(view: u32, call: u32) -> bool {
    return tap_view == view && tap_evaluation == call;
}

fn load_torques(i: u32) {
    untapped_load_torques(i);
    tap_evaluation = i / TAP_VIEWS;
    tap_view = i % TAP_VIEWS;
}

fn motion(epoch: Epoch, body: Body, correction: Correction, m: vector) -> Motion {
    let found = untapped_motion(epoch, body, correction, m);
    if (keeps(MOTION_ARGUMENT, tap_motions)) {
        tap_second = m;
    }
    if (keeps(MOTION_RESULT, tap_motions)) {
        let omega = found.axes_rate;
        tap_first = quaternion(omega.x, omega.y, omega.z, 0.0);
        tap_second = found.gyroscopic_term;
    }
    tap_motions += 1u;
    return found;
}

fn torque(epoch: Epoch, body: Body, orientation: quaternion, angular_velocity_principal: vector) -> vector {
    let found = untapped_torque(epoch, body, orientation, angular_velocity_principal);
    if (keeps(TORQUE_ARGUMENTS, tap_torques)) {
        tap_first = orientation;
        tap_second = angular_velocity_principal;
    }
    if (keeps(TORQUE_RESULT, tap_torques)) {
        tap_first = quaternion(epoch.instant.elapsed, 0.0, 0.0, 0.0);
        tap_second = found;
    }
    tap_torques += 1u;
    return found;
}

fn orientation_rate(q: quaternion, angular_velocity: vector) -> quaternion {
    let found = untapped_orientation_rate(q, angular_velocity);
    if (keeps(ORIENTATION_RATE, tap_rates)) {
        tap_first = found;
    }
    tap_rates += 1u;
    return found;
}

fn store_state(state: State, i: u32) {
    if (tap_view == CALLS) {
        tap_second = vector(real(tap_motions), real(tap_torques), real(tap_rates));
    }
    let kept = State(
        TwoWordsQuaternion(tap_first, quaternion(0.0, 0.0, 0.0, 0.0)),
        TwoWordsVector(tap_second, vector(0.0, 0.0, 0.0)),
        state.status,
    );
    untapped_store_state(kept, i);
}
