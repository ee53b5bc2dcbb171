// Entry point: the closed-form torque-free motion at a time. Twin: EvaluatePart in src/kernel/free_motion/rows.rs; component
// c of body i is at c * stride + i in every table.

override workgroup_size: u32 = 64u;

struct Settings {
    body_count: u32,
    stride: u32,
    // Always 0, which no compiler knows; see `rounded` in real_f32.wgsl.
    zero: u32,
    padding: u32,
    // The time, and its mantissa as a signed fraction in [1/2, 1).
    time: Time,
    fraction: real,
}

@group(0) @binding(0) var<uniform> settings: Settings;
@group(0) @binding(1) var<storage, read> words: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read> constants: array<real>;
@group(0) @binding(3) var<storage, read_write> state_columns: array<real>;

// Bits of the mantissa of an f64, and the binary places by which rates are kept below one turn per unit of time.
const MANTISSA_BITS: i32 = 53;
const HEADROOM: i32 = 3;

fn word_at(column: u32, i: u32) -> vec2<u32> {
    return words[column * settings.stride + i];
}

fn constant_at(column: u32, i: u32) -> real {
    return constants[column * settings.stride + i];
}

fn load_row(i: u32) -> Row {
    var row: Row;
    for (var column = 0u; column < 13u; column += 1u) {
        row.shape[column] = constant_at(column, i);
    }
    row.frame = quaternion(constant_at(13u, i), constant_at(14u, i), constant_at(15u, i), constant_at(16u, i));
    row.amplitude = vector(constant_at(17u, i), constant_at(18u, i), constant_at(19u, i));
    row.axes = constant_at(20u, i);
    return row;
}

fn load_rate(column: u32, exponent: i32, negative: bool, i: u32) -> Rate {
    return Rate(vec4<u32>(word_at(column, i), word_at(column + 1u, i)), exponent, negative);
}

@compute @workgroup_size(workgroup_size)
fn free_motion(@builtin(global_invocation_id) id: vec3<u32>) {
    let i = id.x;
    if (i >= settings.body_count) {
        return;
    }
    let unit = word_at(5u, i);
    let exponent = bitcast<i32>(unit.x);
    let time = settings.time;
    let polhode = phase_at(word_at(4u, i), load_rate(0u, exponent, (unit.y & 1u) != 0u, i), time);
    let precession = phase_at(vec2<u32>(0u, 0u), load_rate(2u, exponent, (unit.y & 2u) != 0u, i), time);
    let scale = clamp(time.exponent + MANTISSA_BITS + exponent - HEADROOM, -60, 60);
    let instant =
        Instant(phase_turns(polhode), phase_turns(precession), settings.fraction * power_of_two(scale));
    let state = evaluate(load_row(i), instant);
    let stride = settings.stride;
    state_columns[i] = state.orientation.x;
    state_columns[stride + i] = state.orientation.y;
    state_columns[2u * stride + i] = state.orientation.z;
    state_columns[3u * stride + i] = state.orientation.w;
    state_columns[4u * stride + i] = state.angular_momentum_principal.x;
    state_columns[5u * stride + i] = state.angular_momentum_principal.y;
    state_columns[6u * stride + i] = state.angular_momentum_principal.z;
    if (WORDS == 2u) {
        for (var column = 7u; column < 14u; column += 1u) {
            state_columns[column * stride + i] = 0.0;
        }
    }
    // The closed form never fails: status 0.
    state_columns[7u * WORDS * stride + i] = 0.0;
}
