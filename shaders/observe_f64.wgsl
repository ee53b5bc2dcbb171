// The part of observe.wgsl that depends on 64 bits. Twin: Kernel for f64 in src/kernel/observe.rs. This file and observe_f32.wgsl define
// the same names. The range of f64 covers all scales, so that all exponents of a column are equal; the host knows them, and they are 0
// here.

// Whether the number in a column of the state is finite. Shaders must not compare with NaN, as compilers may assume that there is none, so
// the exponent's bits in the upper word are tested.
fn is_finite(column: u32, i: u32) -> bool {
    return (state_words[2u * (column * settings.stride + i) + 1u] & 0x7ff00000u) != 0x7ff00000u;
}

// x in units of scale.
fn normalised(x: real, scale: real, exponent: i32) -> Scaled {
    return Scaled(x * scale, exponent);
}

// The exponent of the power of two that brings x near 1: it is near enough.
fn exponent_of(x: real) -> i32 {
    return 0;
}

// 2^n for n = 0.
fn power_of_two(n: i32) -> real {
    return 1.0;
}
