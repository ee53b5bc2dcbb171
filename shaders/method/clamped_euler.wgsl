// clamped_euler: an explicit step of the gyroscopic term after which |m| is restored, a baseline. Twin:
// src/kernel/method/clamped_euler.rs, which describes the method.

fn step(body: Body, prepared: Prepared, step_index: u32, dt: TwoWordsReal, state: State) -> State {
    let h = dt.value;
    let q = state.orientation.value;
    let inverse = body.inverse_moments.value;
    let before = state.angular_momentum_principal.value;
    let turned = axpy_vector(cross_vector(before, inverse * before), h, before);
    let tiny: real = 1e-36;
    var m = turned * sqrt((dot_vector(before, before) + tiny) / (dot_vector(turned, turned) + tiny));
    if (!FREE) {
        m = axpy_vector(torque(epoch(step_index, 0.0), body, q, inverse * before), h, m);
    }
    let omega = inverse * m;
    return State(
        plainly_normalised(q + product(q, exponential_less_one(omega * h))),
        plain_vector(m),
        state.status,
    );
}
