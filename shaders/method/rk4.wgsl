// rk4: the classical Runge-Kutta method on (q, m). Twin: src/kernel/method/rk4.rs, which describes the method.

fn step(body: Body, prepared: Prepared, step_index: u32, dt: TwoWordsReal, state: State) -> State {
    let half = dt.value * 0.5;
    let sixth = sixth_of(dt);
    let q = state.orientation.value;
    let m = state.angular_momentum_principal.value;
    let c = correction(body, state);
    let start = epoch(step_index, 0.0);
    let middle = epoch(step_index, 0.5);
    let end = epoch(step_index, 1.0);

    let k1 = rates(body, start, c, q, m);
    let k2 = rates(body, middle, c, axpy_quaternion(k1.q, half, q), axpy_vector(k1.m, half, m));
    let k3 = rates(body, middle, c, axpy_quaternion(k2.q, half, q), axpy_vector(k2.m, half, m));
    let k4 = rates(body, end, c, axpy_quaternion(k3.q, dt.value, q), axpy_vector(k3.m, dt.value, m));

    let q_sum = axpy_quaternion(k2.q + k3.q, 2.0, k1.q + k4.q);
    let m_sum = axpy_vector(k2.m + k3.m, 2.0, k1.m + k4.m);
    let restoring = norm_correction_of_step(q, axpy_quaternion(q_sum, sixth.value, q));
    let q_increment = axpy_quaternion(
        q_sum, sixth.value, axpy_quaternion(k2.q, sixth.residue, restoring));
    let m_increment = axpy_vector(m_sum, sixth.value, k2.m * sixth.residue);

    return State(
        accumulate_quaternion(state.orientation, q_increment),
        accumulate_vector(state.angular_momentum_principal, m_increment),
        state.status,
    );
}
