// The sum of a scene's torques. Twin: src/torque/sum.rs. Each kind has as many instances as its `count` says, whose
// parameters are in columns from its `first` on; what a scene does not have is folded away when the pipeline is made.

const FREE: bool = false;

// Whether there is nothing but a constant torque in body axes and linear drag.
override torques_are_common: bool = false;

override constant_body_count: u32 = 0u;
override constant_body_first: u32 = 0u;
override linear_drag_count: u32 = 0u;
override linear_drag_first: u32 = 0u;
override constant_world_count: u32 = 0u;
override constant_world_first: u32 = 0u;
override matrix_drag_count: u32 = 0u;
override matrix_drag_first: u32 = 0u;
override quadratic_drag_count: u32 = 0u;
override quadratic_drag_first: u32 = 0u;
override sinusoidal_count: u32 = 0u;
override sinusoidal_first: u32 = 0u;
override gravity_gradient_count: u32 = 0u;
override gravity_gradient_first: u32 = 0u;
override gravity_gradient_kepler_count: u32 = 0u;
override gravity_gradient_kepler_first: u32 = 0u;
override heavy_top_count: u32 = 0u;
override heavy_top_first: u32 = 0u;
override magnetic_dipole_count: u32 = 0u;
override magnetic_dipole_first: u32 = 0u;
override orbiting_dipole_count: u32 = 0u;
override orbiting_dipole_first: u32 = 0u;
override eddy_current_count: u32 = 0u;
override eddy_current_first: u32 = 0u;
override sine_spring_count: u32 = 0u;
override sine_spring_first: u32 = 0u;
override log_spring_count: u32 = 0u;
override log_spring_first: u32 = 0u;
override white_noise_count: u32 = 0u;
override white_noise_first: u32 = 0u;
override internal_dissipation_count: u32 = 0u;
override internal_dissipation_first: u32 = 0u;
override inertia_ramp_count: u32 = 0u;
override inertia_ramp_first: u32 = 0u;
override inertia_oscillation_count: u32 = 0u;
override inertia_oscillation_first: u32 = 0u;
override linear_rotor_count: u32 = 0u;
override linear_rotor_first: u32 = 0u;

// VelocityDependence in src/torque/mod.rs.
const NO_DEPENDENCE: u32 = 0u;
const LINEAR_DRAG: u32 = 1u;
const GENERAL_DEPENDENCE: u32 = 2u;

fn velocity_dependence() -> u32 {
    if (matrix_drag_count + quadratic_drag_count + eddy_current_count > 0u) {
        return GENERAL_DEPENDENCE;
    }
    return select(NO_DEPENDENCE, LINEAR_DRAG, linear_drag_count > 0u);
}

// The coefficient c of the part -c omega; asked for with LINEAR_DRAG only.
fn drag_coefficient() -> real {
    return torque_drag;
}

// Columns of one instance, phases included.
const SINUSOIDAL_COLUMNS: u32 = 15u;
const GRAVITY_GRADIENT_COLUMNS: u32 = 19u;
const GRAVITY_GRADIENT_KEPLER_COLUMNS: u32 = 21u;
const HEAVY_TOP_COLUMNS: u32 = 6u;
const MAGNETIC_DIPOLE_COLUMNS: u32 = 6u;
const ORBITING_DIPOLE_COLUMNS: u32 = 32u;
const EDDY_CURRENT_COLUMNS: u32 = 4u;
const SPRING_COLUMNS: u32 = 5u;
const WHITE_NOISE_COLUMNS: u32 = 10u;

// Columns of the parameters of one instance, before its phase.
const INERTIA_RAMP_PARAMETERS: u32 = 13u;
const INERTIA_OSCILLATION_PARAMETERS: u32 = 12u;
// The one that holds ramps per tick.
const PER_TICK: u32 = 12u;

// The body of this invocation, and what is read once rather than at every evaluation: the set that most scenes have.
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

// A time, the random torque that is constant over the step that it belongs to, and the part of the change of the moments of
// inertia that is done by then; 0 where they do not change.
struct Epoch {
    instant: Instant,
    noise: vector,
    change_done: real,
}

// The part of the change of the moments of inertia that is done.
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
    return select(inertia_oscillation_first, inertia_ramp_first, inertia_ramp_count > 0u);
}

// 3 n^2 times the differences of the moments, of the gravity gradient with columns from c on.
fn gradient_coefficients(c: u32, change_done: real) -> vector {
    let coefficients = torque_vector(c);
    if (inertia_ramp_count + inertia_oscillation_count == 0u) {
        return coefficients;
    }
    return axpy_vector(torque_vector(change_first() + 9u), torque_column(c + 9u) * change_done, coefficients);
}

// What the columns say of the change.
fn change() -> Change {
    let first = change_first();
    return Change(torque_vector(first), TwoWordsVector(torque_vector(first + 3u), torque_vector(first + 6u)));
}

// Two digits of 16 bits as a word.
fn word_at(column: u32) -> u32 {
    return u32(torque_column(column)) | (u32(torque_column(column + 1u)) << 16u);
}

fn torque(epoch: Epoch, body: Body, orientation: quaternion, angular_velocity_principal: vector) -> vector {
    let q = orientation;
    let omega = angular_velocity_principal;
    let instant = epoch.instant;
    if (torques_are_common) {
        return axpy_vector(omega, -torque_drag, torque_constant);
    }
    var sum = epoch.noise;
    if (constant_body_count > 0u) {
        sum = sum + constant_body(torque_constant);
    }
    if (linear_drag_count > 0u) {
        sum = sum + linear_drag(torque_drag, omega);
    }
    if (constant_world_count > 0u) {
        sum = sum + constant_world(torque_vector(constant_world_first), q);
    }
    if (matrix_drag_count > 0u) {
        let c = matrix_drag_first;
        sum = sum + matrix_drag(torque_vector(c), torque_vector(c + 3u), omega);
    }
    if (quadratic_drag_count > 0u) {
        sum = sum + quadratic_drag(torque_column(quadratic_drag_first), omega);
    }
    for (var k = 0u; k < sinusoidal_count; k += 1u) {
        let c = sinusoidal_first + k * SINUSOIDAL_COLUMNS;
        let turn = phase(c + 6u, torque_body, instant);
        sum = sum + sinusoidal(torque_vector(c), torque_vector(c + 3u), turn);
    }
    for (var k = 0u; k < gravity_gradient_count; k += 1u) {
        let c = gravity_gradient_first + k * GRAVITY_GRADIENT_COLUMNS;
        let turn = phase(c + 10u, torque_body, instant);
        let coefficients = gradient_coefficients(c, epoch.change_done);
        sum = sum + gravity_gradient(coefficients, torque_vector(c + 3u), torque_vector(c + 6u), turn, q);
    }
    for (var k = 0u; k < gravity_gradient_kepler_count; k += 1u) {
        let c = gravity_gradient_kepler_first + k * GRAVITY_GRADIENT_KEPLER_COLUMNS;
        let turn = phase(c + 12u, torque_body, instant);
        let x = torque_vector(c + 3u);
        let y = torque_vector(c + 6u);
        let eccentricity = torque_column(c + 10u);
        let start = torque_column(c + 11u);
        let coefficients = gradient_coefficients(c, epoch.change_done);
        sum = sum + gravity_gradient_kepler(coefficients, x, y, eccentricity, start, turn, q);
    }
    for (var k = 0u; k < heavy_top_count; k += 1u) {
        let c = heavy_top_first + k * HEAVY_TOP_COLUMNS;
        sum = sum + heavy_top(torque_vector(c), torque_vector(c + 3u), q);
    }
    for (var k = 0u; k < magnetic_dipole_count; k += 1u) {
        let c = magnetic_dipole_first + k * MAGNETIC_DIPOLE_COLUMNS;
        sum = sum + magnetic_dipole(torque_vector(c), torque_vector(c + 3u), q);
    }
    for (var k = 0u; k < orbiting_dipole_count; k += 1u) {
        let c = orbiting_dipole_first + k * ORBITING_DIPOLE_COLUMNS;
        let field = DipoleField(
            torque_vector(c + 3u),
            torque_vector(c + 6u),
            torque_column(c + 9u),
            torque_column(c + 10u),
            torque_column(c + 11u),
            torque_column(c + 12u),
            torque_column(c + 13u),
        );
        let orbit_phase = phase(c + 14u, torque_body, instant);
        let rotation_phase = phase(c + 15u + RATE_DIGITS, torque_body, instant);
        sum = sum + orbiting_dipole(torque_vector(c), field, orbit_phase, rotation_phase, q);
    }
    for (var k = 0u; k < eddy_current_count; k += 1u) {
        let c = eddy_current_first + k * EDDY_CURRENT_COLUMNS;
        sum = sum + eddy_current(torque_column(c), torque_vector(c + 1u), q, omega);
    }
    for (var k = 0u; k < sine_spring_count; k += 1u) {
        let c = sine_spring_first + k * SPRING_COLUMNS;
        sum = sum + sine_spring(torque_column(c), torque_quaternion(c + 1u), q);
    }
    for (var k = 0u; k < log_spring_count; k += 1u) {
        let c = log_spring_first + k * SPRING_COLUMNS;
        sum = sum + log_spring(torque_column(c), torque_quaternion(c + 1u), q);
    }
    if (linear_rotor_count > 0u) {
        sum = across_axis(torque_column(linear_rotor_first), sum);
    }
    return sum;
}

// How a body turns at an angular momentum m.
struct Motion {
    // The rate at which its axes turn, in principal axes.
    angular_velocity: vector,
    // m x that rate.
    gyroscopic_term: vector,
}

fn motion(epoch: Epoch, body: Body, correction: Correction, m: vector) -> Motion {
    var omega = angular_velocity(body, m, correction);
    var gyroscopic = gyroscopic_term(body, m, correction);
    if (inertia_ramp_count + inertia_oscillation_count > 0u) {
        let changed = changed_body(body, change(), epoch.change_done);
        let carried = carried_correction(changed.body, body, correction, changed.ratio, m);
        omega = angular_velocity(changed.body, m, carried);
        gyroscopic = gyroscopic_term(changed.body, m, carried);
    }
    if (internal_dissipation_count == 0u) {
        return Motion(omega, gyroscopic);
    }
    let slip = internal_dissipation(torque_column(internal_dissipation_first), m, omega);
    return Motion(omega + slip, gyroscopic + cross_vector(m, slip));
}
