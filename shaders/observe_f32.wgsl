// The part of observe.wgsl that depends on 32 bits. Twin: Kernel for f32 in src/kernel/observe.rs.
// This file and observe_f64.wgsl define the same names.

// Whether the number in a column of the state is finite. Shaders must not compare with NaN, as compilers may assume that there is none, so
// the exponent's bits are tested.
fn is_finite(column: u32, i: u32) -> bool {
    return (state_words[column * settings.stride + i] & 0x7f800000u) != 0x7f800000u;
}

// x in units of 2^scale and of 2^exponent: the mantissa in [1, 2).
fn normalised(x: real, scale: real, exponent: i32) -> Scaled {
    let bits = bitcast<u32>(x);
    let field = (bits >> 23u) & 0xffu;
    if (field == 0u) {
        return Scaled(0.0, ZERO_EXPONENT);
    }
    let mantissa = bitcast<f32>((bits & 0x007fffffu) | 0x3f800000u);
    return Scaled(mantissa, i32(field) - 127 + exponent + i32(scale));
}

// The exponent of the power of two that brings x near 1.
fn exponent_of(x: real) -> i32 {
    let field = (bitcast<u32>(x) >> 23u) & 0xffu;
    return clamp(i32(field) - 127, -126, 126);
}

// 2^n for n <= 126; 0 if that is below the range.
fn power_of_two(n: i32) -> real {
    let power = bitcast<f32>(u32(max(n, -126) + 127) << 23u);
    return select(power, 0.0, n < -126);
}
