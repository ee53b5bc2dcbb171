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
const GRAVITY_GRADIENT_COLUMNS: u32 = 18u;
const GRAVITY_GRADIENT_KEPLER_COLUMNS: u32 = 20u;
const HEAVY_TOP_COLUMNS: u32 = 6u;
const MAGNETIC_DIPOLE_COLUMNS: u32 = 6u;
const ORBITING_DIPOLE_COLUMNS: u32 = 32u;
const EDDY_CURRENT_COLUMNS: u32 = 4u;
const SPRING_COLUMNS: u32 = 5u;
const WHITE_NOISE_COLUMNS: u32 = 10u;

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

// A time, and the random torque that is constant over the step that it belongs to.
struct Epoch {
    instant: Instant,
    noise: vector,
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
        let turn = phase(c + 9u, torque_body, instant);
        sum = sum + gravity_gradient(torque_vector(c), torque_vector(c + 3u), torque_vector(c + 6u), turn, q);
    }
    for (var k = 0u; k < gravity_gradient_kepler_count; k += 1u) {
        let c = gravity_gradient_kepler_first + k * GRAVITY_GRADIENT_KEPLER_COLUMNS;
        let turn = phase(c + 11u, torque_body, instant);
        let x = torque_vector(c + 3u);
        let y = torque_vector(c + 6u);
        let eccentricity = torque_column(c + 9u);
        let start = torque_column(c + 10u);
        sum = sum + gravity_gradient_kepler(torque_vector(c), x, y, eccentricity, start, turn, q);
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
    let omega = angular_velocity(body, m, correction);
    let gyroscopic = gyroscopic_term(body, m, correction);
    if (internal_dissipation_count == 0u) {
        return Motion(omega, gyroscopic);
    }
    let slip = internal_dissipation(torque_column(internal_dissipation_first), m, omega);
    return Motion(omega + slip, gyroscopic + cross_vector(m, slip));
}
