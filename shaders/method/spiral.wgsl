// spiral: two rotations per step by omega and its rate, a baseline. Twin: src/kernel/method/spiral.rs, which describes the method.

// dm/dt with the torque at the start.
fn rate(body: Body, start: Epoch, q: quaternion, m: vector) -> vector {
    let omega = body.inverse_moments.value * m;
    var m_rate = cross_vector(m, omega);
    if (!FREE) {
        m_rate = m_rate + torque(start, body, q, omega);
    }
    return m_rate;
}

fn step(body: Body, prepared: Prepared, step_index: u32, dt: TwoWordsReal, state: State) -> State {
    let h = dt.value;
    let q = state.orientation.value;
    let inverse = body.inverse_moments.value;
    let m = state.angular_momentum_principal.value;
    let start = epoch(step_index, 0.0);
    let m1 = rate(body, start, q, m);
    let m2 = rate(body, start, q, axpy_vector(m1, h, m));
    let m3 = rate(body, start, q, axpy_vector(m1 + m2, h * 0.25, m));

    let omega = inverse * m;
    let acceleration = inverse * m1;
    let once = q + product(q, exponential_less_one(omega * h));
    let twice = once + product(once, exponential_less_one(acceleration * (h * h * 0.5)));
    return State(
        plainly_normalised(twice),
        plain_vector(axpy_vector(axpy_vector(m3, 4.0, m1 + m2), h * (1.0 / 6.0), m)),
        state.status,
    );
}
