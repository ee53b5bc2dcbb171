// The number type of the kernels, in 64 bits. Twin: src/math/real.rs and src/math/vector.rs for f64.
// This file, with one of separated_*.wgsl, and real_f32.wgsl define the same names; no other file knows the precision.

alias real = f64;
alias vector = vec3<f64>;
alias quaternion = vec4<f64>; // x, y, z, then the scalar part

// Words that a state and a parameter are carried in.
const WORDS: u32 = 1u;

// A quantity in one word; the residue is zero and not stored.
struct TwoWordsReal {
    value: real,
    residue: real,
}
struct TwoWordsVector {
    value: vector,
    residue: vector,
}
struct TwoWordsQuaternion {
    value: quaternion,
    residue: quaternion,
}

// In 64 bits no rounding error of the state is ever needed.
fn rounded(x: real) -> real {
    return x;
}
fn rounded_vector(x: vector) -> vector {
    return x;
}
fn rounded_quaternion(x: quaternion) -> quaternion {
    return x;
}

fn mul_add(a: real, b: real, c: real) -> real {
    return fma(a, b, c);
}

// The plain sum.
fn accumulate_vector(sum: TwoWordsVector, increment: vector) -> TwoWordsVector {
    return TwoWordsVector(sum.value + increment, sum.residue);
}
fn accumulate_quaternion(sum: TwoWordsQuaternion, increment: quaternion) -> TwoWordsQuaternion {
    return TwoWordsQuaternion(sum.value + increment, sum.residue);
}

// a - b; the second word is not carried.
fn two_difference(a: vector, b: vector) -> TwoWordsVector {
    return TwoWordsVector(a - b, vector(0.0, 0.0, 0.0));
}

// x, or `otherwise` if x is infinite or NaN. WGSL has no bits of f64; adapters that have f64 compare exactly.
fn finite_or(x: real, otherwise: real) -> real {
    return select(otherwise, x, abs(x) <= 1.7976931348623157e308);
}

// 2/pi and pi/2 in words of 33, 33 and 53 bits (fdlibm, e_rem_pio2.c), so that a product by a small integer is exact.
const TWO_OVER_PI: real = 0.63661977236758134308;
const HALF_PI_1: real = 1.57079632673412561417e+00;
const HALF_PI_2: real = 6.07710050630396597660e-11;
const HALF_PI_3: real = 2.02226624879595063154e-21;

// x minus n quarter turns.
fn reduced_by_quarters(x: real, n: real) -> real {
    return mul_add(n, -HALF_PI_3, mul_add(n, -HALF_PI_2, mul_add(n, -HALF_PI_1, x)));
}

// Sine and cosine on |x| <= pi/4: Moshier, Cephes 2.8, sin.c; below 2^-56 of the result before rounding.
fn sin_eighth(x: real) -> real {
    let x2 = x * x;
    var p: real = 1.58962301576546568060e-10;
    p = mul_add(p, x2, -2.50507477628578072866e-8);
    p = mul_add(p, x2, 2.75573136213857245213e-6);
    p = mul_add(p, x2, -1.98412698295895385996e-4);
    p = mul_add(p, x2, 8.33333333332211858878e-3);
    p = mul_add(p, x2, -1.66666666666666307295e-1);
    return mul_add(p * x2, x, x);
}
fn cos_eighth(x: real) -> real {
    let x2 = x * x;
    var p: real = -1.13585365213876817300e-11;
    p = mul_add(p, x2, 2.08757008419747316778e-9);
    p = mul_add(p, x2, -2.75573141792967388112e-7);
    p = mul_add(p, x2, 2.48015872888517045348e-5);
    p = mul_add(p, x2, -1.38888888888730564116e-3);
    p = mul_add(p, x2, 4.16666666666665929218e-2);
    return mul_add(p * x2, x2, 1.0 - 0.5 * x2);
}
