// What a scene's torques share: their columns, random torques, and the rotation of bodies that are not rigid. Twin: src/torque/sum.rs.
// The torques themselves and their sum, `torque_terms`, are recorded from the formulas under src/torque
// (src/torque/shader.rs) and follow this text, which contains only those of the scene.

const FREE: bool = false;

// Whether there are only torques that are constant in body axes, and linear drag.
override torques_are_common: bool = false;

override constant_body_count: u32 = 0u;
override constant_body_first: u32 = 0u;
override linear_drag_count: u32 = 0u;
override linear_drag_first: u32 = 0u;
override white_noise_count: u32 = 0u;
override white_noise_first: u32 = 0u;
override internal_dissipation_count: u32 = 0u;
override internal_dissipation_first: u32 = 0u;
override inertia_ramp_count: u32 = 0u;
override inertia_ramp_first: u32 = 0u;
override inertia_oscillation_count: u32 = 0u;
override inertia_oscillation_first: u32 = 0u;
override inertia_formula_count: u32 = 0u;
override inertia_formula_first: u32 = 0u;

// VelocityDependence in src/kernel/torque_kernel.rs.
const NO_DEPENDENCE: u32 = 0u;
const LINEAR_DRAG: u32 = 1u;
const GENERAL_DEPENDENCE: u32 = 2u;

override torque_velocity_dependence: u32 = 0u;

fn velocity_dependence() -> u32 {
    return torque_velocity_dependence;
}

// The coefficient c of the part -c omega; read only for LINEAR_DRAG.
fn drag_coefficient() -> real {
    return torque_drag;
}

// Columns of one instance of white noise.
const WHITE_NOISE_COLUMNS: u32 = 10u;

// Columns of the parameters of one instance, before its phase.
const INERTIA_RAMP_PARAMETERS: u32 = 13u;
const INERTIA_OSCILLATION_PARAMETERS: u32 = 12u;
// The one that holds ramps per tick.
const PER_TICK: u32 = 12u;

// The body of this invocation, and what is read once rather than at every evaluation: the torques that most scenes have.
var<private> torque_body: u32;
var<private> torque_constant: vector;
var<private> torque_drag: real;

fn load_torques(i: u32) {
    torque_body = i;
    torque_constant = vector(0.0, 0.0, 0.0);
    torque_drag = 0.0;
    if (constant_body_count > 0u) {
        torque_constant = torque_vector(constant_body_first);
    }
    if (linear_drag_count > 0u) {
        torque_drag = torque_column(linear_drag_first);
    }
}

fn torque_column(column: u32) -> real {
    return parameter_at(column, torque_body);
}

fn torque_vector(column: u32) -> vector {
    return vector(torque_column(column), torque_column(column + 1u), torque_column(column + 2u));
}

fn torque_quaternion(column: u32) -> quaternion {
    return quaternion(
        torque_column(column), torque_column(column + 1u), torque_column(column + 2u), torque_column(column + 3u));
}

// A time, the random torque that is constant over the step containing it, and how far the moments of inertia have changed by then.
struct Epoch {
    instant: Instant,
    noise: vector,
    change: ChangeAt,
}

// Whether moments of inertia change in time.
fn moments_change() -> bool {
    return inertia_ramp_count + inertia_oscillation_count + inertia_formula_count > 0u;
}

// How far the moments of inertia have changed.
fn change_at(instant: Instant) -> ChangeAt {
    let none = vector(0.0, 0.0, 0.0);
    if (!moments_change()) {
        return ChangeAt(none, none);
    }
    if (inertia_formula_count > 0u) {
        let share = formula_share(instant);
        return ChangeAt(share, gained_differences(torque_vector(inertia_formula_first + 9u), share));
    }
    let done = change_done(instant);
    return ChangeAt(change_share(change(), done), torque_vector(change_first() + 9u) * done);
}

// The part of a change by a law that is done.
fn change_done(instant: Instant) -> real {
    if (inertia_ramp_count > 0u) {
        let c = inertia_ramp_first + INERTIA_RAMP_PARAMETERS;
        let start = vec2<u32>(word_at(c), word_at(c + 2u));
        let progress = ticks_since(instant.ticks, start) * torque_column(inertia_ramp_first + PER_TICK);
        return inertia_ramp(ramp_progress(progress, torque_column(c + RATE_DIGITS), instant.elapsed));
    }
    if (inertia_oscillation_count > 0u) {
        let c = inertia_oscillation_first + INERTIA_OSCILLATION_PARAMETERS;
        return inertia_oscillation(phase(c, torque_body, instant));
    }
    return 0.0;
}

// Its first column.
fn change_first() -> u32 {
    let of_law = select(inertia_oscillation_first, inertia_ramp_first, inertia_ramp_count > 0u);
    return select(of_law, inertia_formula_first, inertia_formula_count > 0u);
}

// The principal moments relative to those at the start.
fn moment_ratio(share: vector) -> vector {
    let ones = vector(1.0, 1.0, 1.0);
    return ones / fma(torque_vector(change_first()) - ones, share, ones);
}

// 3 n^2 times the differences of the moments, for the gravity gradient with columns from c on.
fn gradient_coefficients(c: u32, gained: vector) -> vector {
    return axpy_vector(gained, torque_column(c + 9u), torque_vector(c));
}

// The change given by the columns.
fn change() -> Change {
    let first = change_first();
    return Change(torque_vector(first), TwoWordsVector(torque_vector(first + 3u), torque_vector(first + 6u)));
}

// Two digits of 16 bits as a word.
fn word_at(column: u32) -> u32 {
    return u32(torque_column(column)) | (u32(torque_column(column + 1u)) << 16u);
}

fn torque(epoch: Epoch, body: Body, orientation: quaternion, angular_velocity_principal: vector) -> vector {
    if (torques_are_common) {
        return axpy_vector(angular_velocity_principal, -torque_drag, torque_constant);
    }
    return torque_terms(epoch, orientation, angular_velocity_principal);
}

// The rotation of a body at an angular momentum m.
struct Motion {
    // omega = m / I, which torques read, in principal axes.
    angular_velocity: vector,
    // The rate at which its axes turn.
    axes_rate: vector,
    // m x the rate of the axes.
    gyroscopic_term: vector,
}

fn motion(epoch: Epoch, body: Body, correction: Correction, m: vector) -> Motion {
    var omega = angular_velocity(body, m, correction);
    var gyroscopic = gyroscopic_term(body, m, correction);
    if (moments_change()) {
        let changed = changed_by(body, change(), epoch.change.share);
        let carried = carried_correction(changed.body, body, correction, changed.ratio, m);
        omega = angular_velocity(changed.body, m, carried);
        gyroscopic = gyroscopic_term(changed.body, m, carried);
    }
    if (internal_dissipation_count == 0u) {
        return Motion(omega, omega, gyroscopic);
    }
    let slip = internal_dissipation(torque_column(internal_dissipation_first), m, omega);
    return Motion(omega, omega + slip, gyroscopic + cross_vector(m, slip));
}
