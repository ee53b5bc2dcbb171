// Entry point: loads a body, runs its steps, stores it. Twin: AdvanceBlock in src/engine/cpu.rs; the columns are those
// of src/batch.rs, component c of body i at c * stride + i.

override workgroup_size: u32 = 64u;

struct Settings {
    body_count: u32,
    stride: u32,
    steps: u32,
    // Always 0, which no compiler knows; see `rounded` in real_f32.wgsl.
    zero: u32,
    // Step size in seconds, in two words.
    dt_value: real,
    dt_residue: real,
    // Index within the interval of the first of these steps, modulo 2^32.
    first_step: u32,
    padding: u32,
    // Time at that step, and a step, in units of 2^-64 tick, low word first; see src/clock.rs.
    clock: vec4<u32>,
    clock_step: vec4<u32>,
    // That step counted from the initial state, low word first.
    run_step: vec2<u32>,
    // 1 / sqrt(dt), 1/sqrt(s).
    inverse_root_dt: real,
}

@group(0) @binding(0) var<uniform> settings: Settings;
@group(0) @binding(1) var<storage, read> parameters: array<real>;
@group(0) @binding(2) var<storage, read_write> state_columns: array<real>;

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

// The invariants of a torque-free body, where the method has columns for them.
fn load_invariants(i: u32) -> Invariants {
    let first = 4u + 3u * (WORDS - 1u);
    if (!FREE || arrayLength(&parameters) <= first * settings.stride) {
        return Invariants(0.0, 0.0);
    }
    return Invariants(parameter_at(first, i), parameter_at(first + 1u, i));
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

@compute @workgroup_size(workgroup_size)
fn advance(@builtin(global_invocation_id) id: vec3<u32>) {
    let i = id.x;
    if (i >= settings.body_count) {
        return;
    }
    let body = load_body(i);
    load_torques(i);
    load_combinations(i);
    // In units of the body's own scale: the rate is a power of two, so that both products are exact.
    let rate = parameter_at(3u, i);
    let dt = TwoWordsReal(settings.dt_value * rate, settings.dt_residue * rate);
    let prepared = prepare(body, load_invariants(i), dt);
    var state = load_state(i);
    for (var n = 0u; n < settings.steps; n += 1u) {
        state = projected(body, step(body, prepared, settings.first_step + n, dt, state));
    }
    store_state(state, i);
}
