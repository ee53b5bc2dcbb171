// The number type of the kernels, in 32 bits. Twin: src/math/real.rs and src/math/vector.rs for f32.
// This file and real_f64.wgsl, with one of separated_*.wgsl, define the same names; no other file knows the precision.

alias real = f32;
alias vector = vec3<f32>;
alias quaternion = vec4<f32>; // x, y, z, then the scalar part

// Words that a state and a parameter are carried in.
const WORDS: u32 = 2u;

// A quantity in two words, value + residue, the residue below half an ulp of the value.
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

// x itself, rounded. Drivers may contract and re-associate sums, and then a sum's rounding error comes out as zero;
// no compiler can see through an exclusive-or with a zero that is read at run time.
fn rounded(x: real) -> real {
    return bitcast<f32>(bitcast<u32>(x) ^ settings.zero);
}
fn rounded_vector(x: vector) -> vector {
    return bitcast<vec3<f32>>(bitcast<vec3<u32>>(x) ^ vec3<u32>(settings.zero));
}
fn rounded_quaternion(x: quaternion) -> quaternion {
    return bitcast<vec4<f32>>(bitcast<vec4<u32>>(x) ^ vec4<u32>(settings.zero));
}

// A rounded intermediate of a sum that is carried in two words in either precision.
fn separated(x: real) -> real {
    return rounded(x);
}

fn mul_add(a: real, b: real, c: real) -> real {
    return fma(a, b, c);
}

// Adds to a sum carried in two words (Kahan 1965). Without `rounded` drivers see that `taken` is `corrected`, and the residue comes out as
// zero. It is enough there: what else they may contract or re-associate changes the result by a rounding of the increment.
fn accumulate_vector(sum: TwoWordsVector, increment: vector) -> TwoWordsVector {
    let corrected = increment + sum.residue;
    let value = rounded_vector(sum.value + corrected);
    let taken = value - sum.value;
    return TwoWordsVector(value, corrected - taken);
}
fn accumulate_quaternion(sum: TwoWordsQuaternion, increment: quaternion) -> TwoWordsQuaternion {
    let corrected = increment + sum.residue;
    let value = rounded_quaternion(sum.value + corrected);
    let taken = value - sum.value;
    return TwoWordsQuaternion(value, corrected - taken);
}

// a - b and its rounding error, exactly (Knuth, TAOCP vol. 2, 4.2.2, theorem B).
fn two_difference(a: vector, b: vector) -> TwoWordsVector {
    let difference = rounded_vector(a - b);
    let b_taken = rounded_vector(a - difference);
    let a_taken = rounded_vector(difference + b_taken);
    return TwoWordsVector(difference, rounded_vector(a - a_taken) - rounded_vector(b - b_taken));
}

// x, or `otherwise` if x is infinite or NaN. The bits are tested, as compilers may assume that comparisons see only numbers (Metal's fast
// arithmetic).
fn finite_or(x: real, otherwise: real) -> real {
    return select(x, otherwise, (bitcast<u32>(x) & 0x7f800000u) == 0x7f800000u);
}

// 2/pi and pi/2 in words with trailing zeros, so that a product by a small integer is exact.
const TWO_OVER_PI: real = 0.63661977236758134308;
const HALF_PI_1: real = 1.5703125;
const HALF_PI_2: real = 4.837512969970703125e-4;
const HALF_PI_3: real = 7.549789954892e-8;

// x minus n quarter turns.
fn reduced_by_quarters(x: real, n: real) -> real {
    let first = rounded(mul_add(n, -HALF_PI_1, x));
    return mul_add(n, -HALF_PI_3, rounded(mul_add(n, -HALF_PI_2, first)));
}

// Sine and cosine on |x| <= pi/4: Moshier, Cephes 2.8, sinf.c; below 2^-27 of the result before rounding.
fn sin_eighth(x: real) -> real {
    let x2 = x * x;
    var p: real = -1.9515295891e-4;
    p = mul_add(p, x2, 8.3321608736e-3);
    p = mul_add(p, x2, -1.6666654611e-1);
    return mul_add(p * x2, x, x);
}
fn cos_eighth(x: real) -> real {
    let x2 = x * x;
    var p: real = 2.443315711809948e-5;
    p = mul_add(p, x2, -1.388731625493765e-3);
    p = mul_add(p, x2, 4.166664568298827e-2);
    return mul_add(p * x2, x2, 1.0 - 0.5 * x2);
}
