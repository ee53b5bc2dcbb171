// What gather.wgsl needs to know of states in 64 bits. This file and gather_f32.wgsl define the same names.

alias state_real = f64;

const STATUS_COLUMN: u32 = 7u;

// A component of the state of body i.
fn state_at(component: u32, i: u32) -> real {
    return state_columns[component * settings.stride + i];
}

// Whether the number in a column of the state is finite: the exponent's bits are looked at, in the upper word.
fn is_finite(column: u32, i: u32) -> bool {
    return (state_words[2u * (column * settings.stride + i) + 1u] & 0x7ff00000u) != 0x7ff00000u;
}
