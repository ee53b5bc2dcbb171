// The columns of bodies: component c of body i at c * stride + i. Twin: src/bodies/columns.rs. The entry point's chunk declares
// `settings`, `parameters` and `state_columns`.

// The parameter column of the body's reference rate, a power of two, rad/s.
const RATE_COLUMN: u32 = 3u;

fn parameter_at(column: u32, i: u32) -> real {
    return parameters[column * settings.stride + i];
}

fn state_at(column: u32, i: u32) -> real {
    return state_columns[column * settings.stride + i];
}

fn load_body(i: u32) -> Body {
    let value = vector(parameter_at(0u, i), parameter_at(1u, i), parameter_at(2u, i));
    var residue = vector(0.0, 0.0, 0.0);
    if (WORDS == 2u) {
        residue = vector(parameter_at(4u, i), parameter_at(5u, i), parameter_at(6u, i));
    }
    return body_new(TwoWordsVector(value, residue));
}

fn load_orientation(first: u32, i: u32) -> quaternion {
    return quaternion(state_at(first, i), state_at(first + 1u, i), state_at(first + 2u, i), state_at(first + 3u, i));
}

fn load_angular_momentum(first: u32, i: u32) -> vector {
    return vector(state_at(first + 4u, i), state_at(first + 5u, i), state_at(first + 6u, i));
}

fn load_state(i: u32) -> State {
    var q_residue = quaternion(0.0, 0.0, 0.0, 0.0);
    var m_residue = vector(0.0, 0.0, 0.0);
    if (WORDS == 2u) {
        q_residue = load_orientation(7u, i);
        m_residue = load_angular_momentum(7u, i);
    }
    return State(
        TwoWordsQuaternion(load_orientation(0u, i), q_residue),
        TwoWordsVector(load_angular_momentum(0u, i), m_residue),
        state_at(7u * WORDS, i),
    );
}

fn store_words(first: u32, i: u32, q: quaternion, m: vector) {
    let stride = settings.stride;
    state_columns[first * stride + i] = q.x;
    state_columns[(first + 1u) * stride + i] = q.y;
    state_columns[(first + 2u) * stride + i] = q.z;
    state_columns[(first + 3u) * stride + i] = q.w;
    state_columns[(first + 4u) * stride + i] = m.x;
    state_columns[(first + 5u) * stride + i] = m.y;
    state_columns[(first + 6u) * stride + i] = m.z;
}

fn store_state(state: State, i: u32) {
    store_words(0u, i, state.orientation.value, state.angular_momentum_principal.value);
    if (WORDS == 2u) {
        store_words(7u, i, state.orientation.residue, state.angular_momentum_principal.residue);
    }
    state_columns[7u * WORDS * settings.stride + i] = state.status;
}
