// gyro_newton: one Newton step on the implicit gyroscopic term, a baseline. Twin: src/kernel/method/gyro_newton.rs, which
// describes the method.

fn step(body: Body, prepared: Prepared, step_index: u32, dt: TwoWordsReal, state: State) -> State {
    let h = dt.value;
    let q = state.orientation.value;
    let inverse = body.inverse_moments.value;
    let moments = vector(1.0 / inverse.x, 1.0 / inverse.y, 1.0 / inverse.z);
    var m = state.angular_momentum_principal.value;
    if (!FREE) {
        m = axpy_vector(torque(epoch(step_index, 0.0), body, q, inverse * m), h, m);
    }
    let before = inverse * m;
    let residual = cross_vector(before, m) * h;
    // I + h ([omega]x I - [I omega]x), by columns.
    let a = Matrix(
        vector(moments.x, h * (before.z * moments.x - m.z), -(h * (before.y * moments.x - m.y))),
        vector(-(h * (before.z * moments.y - m.z)), moments.y, h * (before.x * moments.y - m.x)),
        vector(h * (before.y * moments.z - m.y), -(h * (before.x * moments.z - m.x)), moments.z),
    );
    let omega = before - solve(a, residual);
    return State(
        plainly_normalised(axpy_quaternion(orientation_rate(q, omega), h, q)),
        plain_vector(moments * omega),
        state.status,
    );
}
