// dlm: splitting into rotations about the principal axes. Twin: src/kernel/method/dlm.rs, which describes the method.

fn step(body: Body, prepared: Prepared, step_index: u32, dt: TwoWordsReal, initial: State) -> State {
    let half = TwoWordsReal(dt.value * 0.5, dt.residue * 0.5);
    var state = kick(body, epoch(step_index, 0.0), half, initial, 2u);
    state = rotate_x(body, half, state);
    state = rotate_y(body, half, state);
    state = rotate_z(body, dt, state);
    state = rotate_y(body, half, state);
    state = rotate_x(body, half, state);
    state.orientation = accumulate_quaternion(state.orientation, norm_correction(state.orientation.value));
    return kick(body, epoch(step_index, 1.0), half, state, 2u);
}

// sin t, 1 - cos t, sin t/2 and 1 - cos t/2, all from one sine and cosine of t/4.
struct Angles {
    sin: real,
    versine: real,
    half_sin: real,
    half_versine: real,
}

// t = h m/I for one axis, first-order terms of the second words included.
fn angles(h: TwoWordsReal, inverse_moment: TwoWordsReal, m: TwoWordsReal) -> Angles {
    let rate = mul_add(
        inverse_moment.value,
        m.value,
        mul_add(inverse_moment.value, m.residue, inverse_moment.residue * m.value),
    );
    let angle = mul_add(h.value, rate, h.residue * rate);
    let quarter = sin_cos(angle * 0.25);
    let half_sin = 2.0 * quarter.sin * quarter.cos;
    let half_versine = 2.0 * quarter.sin * quarter.sin;
    let sin = 2.0 * half_sin * (1.0 - half_versine);
    let versine = 2.0 * half_sin * half_sin;
    return Angles(sin, versine, half_sin, half_versine);
}

struct Turned {
    j: real,
    k: real,
}

// The change of (m_j, m_k) in a rotation by -t.
fn turned(angles: Angles, j: real, k: real) -> Turned {
    return Turned(
        mul_add(angles.sin, k, -(angles.versine * j)),
        -(mul_add(angles.sin, j, angles.versine * k)),
    );
}

fn rotate_x(body: Body, h: TwoWordsReal, state: State) -> State {
    let m = state.angular_momentum_principal;
    let i = body.inverse_moments;
    let a = angles(h, TwoWordsReal(i.value.x, i.residue.x), TwoWordsReal(m.value.x, m.residue.x));
    let t = turned(a, m.value.y, m.value.z);
    let q = state.orientation.value;
    return apply(state, quaternion(q.w, q.z, -q.y, -q.x), a, vector(0.0, t.j, t.k));
}

fn rotate_y(body: Body, h: TwoWordsReal, state: State) -> State {
    let m = state.angular_momentum_principal;
    let i = body.inverse_moments;
    let a = angles(h, TwoWordsReal(i.value.y, i.residue.y), TwoWordsReal(m.value.y, m.residue.y));
    let t = turned(a, m.value.z, m.value.x);
    let q = state.orientation.value;
    return apply(state, quaternion(-q.z, q.w, q.x, -q.y), a, vector(t.k, 0.0, t.j));
}

fn rotate_z(body: Body, h: TwoWordsReal, state: State) -> State {
    let m = state.angular_momentum_principal;
    let i = body.inverse_moments;
    let a = angles(h, TwoWordsReal(i.value.z, i.residue.z), TwoWordsReal(m.value.z, m.residue.z));
    let t = turned(a, m.value.x, m.value.y);
    let q = state.orientation.value;
    return apply(state, quaternion(q.y, -q.x, q.w, -q.z), a, vector(t.j, t.k, 0.0));
}

// Adds to q the change by the factor (cos t/2, sin t/2 e), with `turn` = q e, and to m its own increment.
fn apply(state: State, turn: quaternion, angles: Angles, m_increment: vector) -> State {
    let q = state.orientation.value;
    let q_increment = axpy_quaternion(turn, angles.half_sin, q * (-angles.half_versine));
    return State(
        accumulate_quaternion(state.orientation, q_increment),
        accumulate_vector(state.angular_momentum_principal, m_increment),
        state.status,
    );
}
