// The constants of 64 bits for the elementary functions. Twin: the constants of src/math/real.rs for f64.
// This file and elementary_f32.wgsl define the same names.

// A number that vanishes next to 1, and one whose fourth power does.
const NEGLIGIBLE: real = 8.673617379884035e-19;
const FOURTH_POWER_NEGLIGIBLE: real = 0.00006103515625;

// ln 2 in words of 33 and 53 bits (fdlibm, e_exp.c), so that a product by a small integer is exact.
const LN_2_1: real = 6.93147180369123816490e-01;
const LN_2_2: real = 1.90821492927058770002e-10;

// (e^x - 1 - x)/x^2 on |x| <= ln(2)/2: Taylor's sum, the first term left out below 2^-57 of e^x.
fn exp_tail(x: real) -> real {
    var p: real = 1.0 / 6227020800.0;
    p = mul_add(p, x, 1.0 / 479001600.0);
    p = mul_add(p, x, 1.0 / 39916800.0);
    p = mul_add(p, x, 1.0 / 3628800.0);
    p = mul_add(p, x, 1.0 / 362880.0);
    p = mul_add(p, x, 1.0 / 40320.0);
    p = mul_add(p, x, 1.0 / 5040.0);
    p = mul_add(p, x, 1.0 / 720.0);
    p = mul_add(p, x, 1.0 / 120.0);
    p = mul_add(p, x, 1.0 / 24.0);
    p = mul_add(p, x, 1.0 / 6.0);
    return mul_add(p, x, 0.5);
}

// A signed integer of 64 bits (low word, high word) times 2^-64, rounded once: each word's product is exact.
fn from_fixed_point(words: vec2<u32>) -> real {
    return f64(bitcast<i32>(words.y)) * 2.3283064365386963e-10 + f64(words.x) * 5.421010862427522e-20;
}

// 2^n for |n| <= 60; without 64-bit integers the bits of an f64 cannot be formed from integers.
fn power_of_two(n: i32) -> real {
    return f64(bitcast<f32>(u32(127 + n) << 23u));
}
