// explicit_euler: Euler's explicit method, a baseline. Twin: src/kernel/method/explicit_euler.rs, which describes the method.

fn step(body: Body, prepared: Prepared, step_index: u32, dt: TwoWordsReal, state: State) -> State {
    let h = dt.value;
    let q = state.orientation.value;
    let m = state.angular_momentum_principal.value;
    let omega = body.inverse_moments.value * m;
    var m_rate = cross_vector(m, omega);
    if (!FREE) {
        m_rate = m_rate + torque(epoch(step_index, 0.0), body, q, omega);
    }
    return State(
        plainly_normalised(axpy_quaternion(orientation_rate(q, omega), h, q)),
        plain_vector(axpy_vector(m_rate, h, m)),
        state.status,
    );
}
