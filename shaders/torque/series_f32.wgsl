// Constants and series of the torques, in 32 bits. Twin: ARTANH_TERMS of f32 in src/math/real.rs.

const TAU: real = 6.28318530717958647693;
const SQRT_2: real = 1.41421356237309504880;
const LN_2: real = 0.693147180559945309417;

// sum of z2^n / (2n + 1).
fn artanh_series(z2: real) -> real {
    var sum: real = 1.0 / 9.0;
    sum = mul_add(sum, z2, 1.0 / 7.0);
    sum = mul_add(sum, z2, 1.0 / 5.0);
    sum = mul_add(sum, z2, 1.0 / 3.0);
    return mul_add(sum, z2, 1.0);
}

// 32 bits after the point, truncated to the mantissa of a number in [1, 2).
fn fraction_of_word(fraction: u32) -> real {
    return real(fraction >> 9u) * (1.0 / 8388608.0);
}
