// No torque. Twin: Free in src/kernel/torque_kernel.rs.

const FREE: bool = true;

// VelocityDependence in src/kernel/torque_kernel.rs.
const NO_DEPENDENCE: u32 = 0u;
const LINEAR_DRAG: u32 = 1u;
const GENERAL_DEPENDENCE: u32 = 2u;

fn velocity_dependence() -> u32 {
    return NO_DEPENDENCE;
}

// The coefficient c of the part -c omega; read only for LINEAR_DRAG.
fn drag_coefficient() -> real {
    return 0.0;
}

struct Epoch {
    unused: u32,
}

fn load_torques(i: u32) {
}

fn epoch(step: u32, fraction: real) -> Epoch {
    return Epoch(0u);
}

struct Start {
    unused: u32,
}

fn start_at(time: TwoWordsReal) -> Start {
    return Start(0u);
}

fn epoch_after(start: Start, elapsed: real) -> Epoch {
    return Epoch(0u);
}

fn torque(epoch: Epoch, body: Body, orientation: quaternion, angular_velocity_principal: vector) -> vector {
    return vector(0.0, 0.0, 0.0);
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
    let omega = angular_velocity(body, m, correction);
    return Motion(omega, omega, gyroscopic_term(body, m, correction));
}
