// What gather.wgsl needs to know of states in two words of 32 bits. This file and gather_f64.wgsl define the same names.

alias state_real = f32;

const STATUS_COLUMN: u32 = 14u;

// A component of the state of body i, both words together.
fn state_at(component: u32, i: u32) -> real {
    let value = state_columns[component * settings.stride + i];
    let residue = state_columns[(component + 7u) * settings.stride + i];
    return real(value) + real(residue);
}

// Whether the number in a column of the state is finite: the exponent's bits are looked at.
fn is_finite(column: u32, i: u32) -> bool {
    return (state_words[column * settings.stride + i] & 0x7f800000u) != 0x7f800000u;
}
