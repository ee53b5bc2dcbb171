// The constants of 32 bits for the elementary functions. Twin: the constants of src/math/real.rs for f32.
// This file and elementary_f64.wgsl define the same names.

// A number that vanishes next to 1, and one whose fourth power does.
const NEGLIGIBLE: real = 4.656612873077393e-10;
const FOURTH_POWER_NEGLIGIBLE: real = 0.00390625;

// ln 2 in two words, the first with trailing zeros, so that a product by a small integer is exact.
const LN_2_1: real = 0.693359375;
const LN_2_2: real = -2.121944400546905827679e-4;

// (e^x - 1 - x)/x^2 on |x| <= ln(2)/2: Taylor's sum, the first term left out below 2^-27 of e^x.
fn exp_tail(x: real) -> real {
    var p: real = 1.0 / 5040.0;
    p = mul_add(p, x, 1.0 / 720.0);
    p = mul_add(p, x, 1.0 / 120.0);
    p = mul_add(p, x, 1.0 / 24.0);
    p = mul_add(p, x, 1.0 / 6.0);
    return mul_add(p, x, 0.5);
}

// A signed integer of 64 bits (low word, high word) times 2^-64: from the upper word.
fn from_fixed_point(words: vec2<u32>) -> real {
    return f32(bitcast<i32>(words.y)) * 2.3283064365386963e-10;
}

// 2^n for |n| <= 60.
fn power_of_two(n: i32) -> real {
    return bitcast<f32>(u32(127 + n) << 23u);
}
