// cf4: the commutator-free Lie-group method of order 4. Twin: src/kernel/method/cf4.rs, which describes the method.

struct Turning {
    omega: vector,
    m: vector,
}

// omega and dm/dt.
fn turning(body: Body, epoch: Epoch, correction: Correction, q: quaternion, m: vector) -> Turning {
    let motion = motion(epoch, body, correction, m);
    var m_rate = motion.gyroscopic_term;
    if (!FREE) {
        m_rate = m_rate + torque(epoch, body, q, motion.angular_velocity);
    }
    return Turning(motion.axes_rate, m_rate);
}

// q exp(v).
fn rotated(q: quaternion, rotation_vector: vector) -> quaternion {
    return q + product(q, exponential_less_one(rotation_vector));
}

fn step(body: Body, prepared: Prepared, step_index: u32, dt: TwoWordsReal, state: State) -> State {
    let half = dt.value * 0.5;
    let sixth = sixth_of(dt);
    let q = state.orientation.value;
    let m = state.angular_momentum_principal.value;
    let c = correction(body, state);
    let start = epoch(step_index, 0.0);
    let middle = epoch(step_index, 0.5);
    let end = epoch(step_index, 1.0);

    var q2 = q;
    var q3 = q;
    var q4 = q;
    let k1 = turning(body, start, c, q, m);
    if (!FREE) {
        q2 = rotated(q, k1.omega * half);
    }
    let k2 = turning(body, middle, c, q2, axpy_vector(k1.m, half, m));
    if (!FREE) {
        q3 = rotated(q, k2.omega * half);
    }
    let k3 = turning(body, middle, c, q3, axpy_vector(k2.m, half, m));
    if (!FREE) {
        q4 = rotated(q2, k3.omega * dt.value - k1.omega * half);
    }
    let k4 = turning(body, end, c, q4, axpy_vector(k3.m, dt.value, m));

    let twelfth = sixth.value * 0.5;
    let middles = (k2.omega + k3.omega) * 2.0;
    let tail = rounded_vector(k2.omega * (sixth.residue * 0.5));
    let first = axpy_vector(axpy_vector(k1.omega, 3.0, middles) - k4.omega, twelfth, tail);
    let second = axpy_vector(axpy_vector(k4.omega, 3.0, middles) - k1.omega, twelfth, tail);
    let a = exponential_less_one(first);
    let b = exponential_less_one(second);
    // (1 + a)(1 + b) - 1.
    let q_increment = product(q, product(a, b) + (a + b)) + norm_correction(q);
    let m_sum = axpy_vector(k2.m + k3.m, 2.0, k1.m + k4.m);
    let m_increment = axpy_vector(m_sum, sixth.value, k2.m * sixth.residue);

    return State(
        accumulate_quaternion(state.orientation, q_increment),
        accumulate_vector(state.angular_momentum_principal, m_increment),
        state.status,
    );
}
