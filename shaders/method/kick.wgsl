// The flow of the torque alone, at a frozen attitude and time. Twin: src/kernel/method/kick.rs, which describes it.

// `state` after the torque alone has acted for h, with an error of order `order` + 1 in h at most.
fn kick(body: Body, epoch: Epoch, h: TwoWordsReal, state: State, order: u32) -> State {
    if (FREE) {
        return state;
    }
    let c = correction(body, state);
    let q = state.orientation.value;
    let m = state.angular_momentum_principal.value;
    var increment = vector(0.0, 0.0, 0.0);
    if (velocity_dependence() == NO_DEPENDENCE) {
        increment = timed(acting(body, epoch, c, q, m), h);
    } else if (velocity_dependence() == LINEAR_DRAG) {
        increment = timed(acting(body, epoch, c, q, m), h) * damping(body, drag_coefficient(), h);
    } else if (order <= 4u) {
        increment = increment_of_order_4(body, epoch, c, q, h, m);
    } else {
        increment = increment_of_order_6(body, epoch, c, q, h, m);
    }
    return State(
        state.orientation,
        accumulate_vector(state.angular_momentum_principal, increment),
        state.status,
    );
}

// The torque at m, at the frozen attitude.
fn acting(body: Body, epoch: Epoch, correction: Correction, q: quaternion, m: vector) -> vector {
    return torque(epoch, body, q, angular_velocity(body, m, correction));
}

// v h, both words of h; rounded, so that the words are not added before the product.
fn timed(v: vector, h: TwoWordsReal) -> vector {
    return axpy_vector(v, h.value, rounded_vector(v * h.residue));
}

// E(-h c/I), axis by axis.
fn damping(body: Body, coefficient: real, h: TwoWordsReal) -> vector {
    let rate = body.inverse_moments.value * (-(coefficient * h.value));
    return vector(relative_growth(rate.x), relative_growth(rate.y), relative_growth(rate.z));
}

// E(y) = (exp y - 1)/y for y <= 32, to ten roundings.
fn relative_growth(y: real) -> real {
    let steep = y < -32.0;
    let x = select(y, real(-32.0), steep) * (1.0 / 64.0);
    var e: real = 1.0;
    e = mul_add(e, x * (1.0 / 12.0), 1.0);
    e = mul_add(e, x * (1.0 / 11.0), 1.0);
    e = mul_add(e, x * (1.0 / 10.0), 1.0);
    e = mul_add(e, x * (1.0 / 9.0), 1.0);
    e = mul_add(e, x * (1.0 / 8.0), 1.0);
    e = mul_add(e, x * (1.0 / 7.0), 1.0);
    e = mul_add(e, x * (1.0 / 6.0), 1.0);
    e = mul_add(e, x * (1.0 / 5.0), 1.0);
    e = mul_add(e, x * (1.0 / 4.0), 1.0);
    e = mul_add(e, x * (1.0 / 3.0), 1.0);
    e = mul_add(e, x * (1.0 / 2.0), 1.0);
    // Unrolled six times instead of a loop: lavapipe counts the iterations of a dispatch.
    e = doubled(x, e);
    e = doubled(x * 2.0, e);
    e = doubled(x * 4.0, e);
    e = doubled(x * 8.0, e);
    e = doubled(x * 16.0, e);
    e = doubled(x * 32.0, e);
    return select(e, -1.0 / y, steep);
}

// E(2 y) from E(y).
fn doubled(y: real, e: real) -> real {
    return e * mul_add(y * 0.5, e, 1.0);
}

// The classical Runge-Kutta method on dm/dt = torque(m).
fn increment_of_order_4(
    body: Body, epoch: Epoch, c: Correction, q: quaternion, h: TwoWordsReal, m: vector
) -> vector {
    let half = h.value * 0.5;
    let sixth = sixth_of(h);
    let k1 = acting(body, epoch, c, q, m);
    let k2 = acting(body, epoch, c, q, axpy_vector(k1, half, m));
    let k3 = acting(body, epoch, c, q, axpy_vector(k2, half, m));
    let k4 = acting(body, epoch, c, q, axpy_vector(k3, h.value, m));
    return axpy_vector(axpy_vector(k2 + k3, 2.0, k1 + k4), sixth.value, k2 * sixth.residue);
}

// Butcher's method of order 6 in seven stages on dm/dt = torque(m).
fn increment_of_order_6(
    body: Body, epoch: Epoch, c: Correction, q: quaternion, h: TwoWordsReal, m: vector
) -> vector {
    let dt = h.value;
    let k1 = acting(body, epoch, c, q, m);
    let k2 = acting(body, epoch, c, q, axpy_vector(k1 * (1.0 / 3.0), dt, m));
    let k3 = acting(body, epoch, c, q, axpy_vector(k2 * (2.0 / 3.0), dt, m));
    let k4 = acting(body, epoch, c, q, axpy_vector(
        axpy_vector(k1, 1.0 / 12.0, axpy_vector(k2, 1.0 / 3.0, k3 * (-1.0 / 12.0))), dt, m));
    let k5 = acting(body, epoch, c, q, axpy_vector(
        axpy_vector(k1, -1.0 / 16.0,
            axpy_vector(k2, 9.0 / 8.0, axpy_vector(k3, -3.0 / 16.0, k4 * (-3.0 / 8.0)))), dt, m));
    let k6 = acting(body, epoch, c, q, axpy_vector(
        axpy_vector(k2, 9.0 / 8.0,
            axpy_vector(k3, -3.0 / 8.0, axpy_vector(k4, -3.0 / 4.0, k5 * (1.0 / 2.0)))), dt, m));
    let k7 = acting(body, epoch, c, q, axpy_vector(
        axpy_vector(k1, 9.0 / 44.0,
            axpy_vector(k2, -9.0 / 11.0,
                axpy_vector(k3, 63.0 / 44.0, axpy_vector(k4, 18.0 / 11.0, k6 * (-16.0 / 11.0))))), dt, m));
    let ends = (k1 - k5) + (k7 - k5);
    let thirds = (k3 - k5) + (k4 - k5);
    let slope = k5 + axpy_vector(ends, 11.0 / 120.0, axpy_vector(thirds, 27.0 / 40.0, (k6 - k5) * (-4.0 / 15.0)));
    return timed(slope, h);
}
