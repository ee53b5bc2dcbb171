// Entry point: loads a body, runs its steps, stores it. Twin: Advance in src/engine/cpu.rs.

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
    // Time at that step, and a step, in units of 2^-64 tick, low word first; see src/math/clock.rs.
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

// Loads the invariants of a torque-free body, if the method has columns for them.
fn load_invariants(i: u32) -> Invariants {
    let first = 4u + 3u * (WORDS - 1u);
    if (!FREE || arrayLength(&parameters) <= first * settings.stride) {
        return Invariants(0.0, 0.0);
    }
    return Invariants(parameter_at(first, i), parameter_at(first + 1u, i));
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
    let rate = parameter_at(RATE_COLUMN, i);
    let dt = TwoWordsReal(settings.dt_value * rate, settings.dt_residue * rate);
    let prepared = prepare(body, load_invariants(i), dt);
    var state = load_state(i);
    var translation = load_translation(i, body, settings.first_step, dt, state);
    for (var n = 0u; n < settings.steps; n += 1u) {
        state = projected(body, step(body, prepared, settings.first_step + n, dt, state));
        translation = advance_translation(translation, body, settings.first_step + n, dt, state);
    }
    store_state(state, i);
    store_translation(translation, i);
}
