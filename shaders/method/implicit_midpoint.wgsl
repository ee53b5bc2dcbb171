// implicit_midpoint: the implicit midpoint rule on the rotation group. Twin: src/kernel/method/implicit_midpoint.rs, which
// describes the method.

const ITERATIONS: u32 = 32u;

// The torque at the midpoint momentum z, from which the rotation to the midpoint follows.
fn torque_midway(
    body: Body, middle: Epoch, correction: Correction, half: real, q: quaternion, z: vector
) -> vector {
    if (FREE) {
        return vector(0.0, 0.0, 0.0);
    }
    let omega = angular_velocity(body, z, correction);
    return torque(middle, body, halfway(q, omega * half), omega);
}

fn step(body: Body, prepared: Prepared, step_index: u32, dt: TwoWordsReal, state: State) -> State {
    let half = dt.value * 0.5;
    let q = state.orientation.value;
    let m = state.angular_momentum_principal.value;
    let c = correction(body, state);
    let middle = epoch(step_index, 0.5);

    // The explicit half step is a good start if the step is short, and useless if it is long.
    let half_step = (gyroscopic_term(body, m, c) + torque_midway(body, middle, c, half, q, m)) * half;
    let scale = max(scale_of(m), largest(half_step));
    let tolerance = newton_tolerance() * scale;
    let short = largest(half_step) < 0.25 * scale_of(m);
    var z = select(m, m + half_step, short);
    var z_torque = torque_midway(body, middle, c, half, q, z);
    var unsolved = true;
    for (var n = 0u; n < ITERATIONS; n += 1u) {
        let z_rate = gyroscopic_term(body, z, c) + z_torque;
        let residual = axpy_vector(z_rate, half, m - z);
        var a = jacobian(body, half, z);
        if (!FREE) {
            let change = tolerance;
            let factor = half / change;
            let x = z + vector(change, 0.0, 0.0);
            let y = z + vector(0.0, change, 0.0);
            let w = z + vector(0.0, 0.0, change);
            a.x = a.x - (torque_midway(body, middle, c, half, q, x) - z_torque) * factor;
            a.y = a.y - (torque_midway(body, middle, c, half, q, y) - z_torque) * factor;
            a.z = a.z - (torque_midway(body, middle, c, half, q, w) - z_torque) * factor;
        }
        let correction = solve(a, residual);
        z = z + correction;
        z_torque = torque_midway(body, middle, c, half, q, z);
        unsolved = !(largest(correction) < tolerance);
        if (!unsolved) {
            break;
        }
    }

    let omega = angular_velocity(body, z, c);
    let kappa = half * half * dot_vector(omega, omega);
    let norm = sqrt(1.0 + kappa);
    let lost = -(kappa / (norm * (1.0 + norm)));
    let q_increment = cayley_increment(q, omega, dt, lost, lost) + norm_correction(q);
    let z_rate = gyroscopic_term(body, z, c) + z_torque;
    let m_increment = axpy_vector(z_rate, dt.value, rounded_vector(z_rate * dt.residue));
    return State(
        accumulate_quaternion(state.orientation, q_increment),
        accumulate_vector(state.angular_momentum_principal, m_increment),
        flagged(state.status, unsolved, NOT_CONVERGED),
    );
}

// q rotated by half of the Cayley rotation (1, c)/|.|: along q (|(1, c)| + 1, c).
fn halfway(q: quaternion, c: vector) -> quaternion {
    let norm = sqrt(1.0 + dot_vector(c, c));
    let scalar = norm + 1.0;
    let length = sqrt(2.0 * norm * scalar);
    return product_vector(q, c * (1.0 / length)) + q * (scalar / length);
}
