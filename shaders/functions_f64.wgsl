// The constants of 64 bits for the elementary functions of formulas. Twin: the numbers of f64 in
// src/math/elementary/functions.rs, which describes them, and in src/math/real.rs.
// This file and functions_f32.wgsl define the same names.

const SPLITTER: real = 134217729.0;
const LARGEST: real = 1.7976931348623157e308;
const EXP_RANGE_LEAST: real = -708.3964185322641;
const EXP_RANGE_MOST: real = 709.782712893384;
const LOGARITHM_OF_2: real = 6.93147180369123816490e-01;
const LOGARITHM_OF_2_LOW: real = 1.90821492927058770002e-10;
const QUARTER_TURN: real = 1.5707963267948966;
const QUARTER_TURN_LOW: real = 6.123233995736766e-17;
const HALF_TURN: real = 3.141592653589793;
const HALF_TURN_LOW: real = 1.2246467991473532e-16;
const LARGEST_SINE: real = 1.00000000000000088817841970012523;
const LARGEST_EXPONENT: real = 1.1805916207174113e+21;
const FAR: real = 8.452712498170644e+270;
const REDUCTION: real = 8.673617379884035e-19;
const NEAR: real = 1.499696813895631e-241;
const ENLARGEMENT: real = 1.6069380442589903e+60;
const NOTHING: real = 1.240520129162012e-265;

// pi/2 in four words.
const RIGHT_ANGLE_1: real = 1.5707963267341256;
const RIGHT_ANGLE_2: real = 6.077100506303966e-11;
const RIGHT_ANGLE_3: real = 2.0222662487111665e-21;
const RIGHT_ANGLE_4: real = 8.4784276603689e-32;

// (e^x - 1 - x)/x^2 on |x| <= ln(2)/2.
fn exp_series(x: real) -> real {
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

// (artanh z / z - 1)/z^2.
fn logarithm_series(z2: real) -> real {
    var p: real = 1.0 / 13.0;
    p = mul_add(p, z2, 1.0 / 11.0);
    p = mul_add(p, z2, 1.0 / 9.0);
    p = mul_add(p, z2, 1.0 / 7.0);
    p = mul_add(p, z2, 1.0 / 5.0);
    return mul_add(p, z2, 1.0 / 3.0);
}

// (arctan t / t - 1)/t^2.
fn angle_series(t2: real) -> real {
    var p: real = 1.0 / 21.0;
    p = mul_add(p, t2, -1.0 / 19.0);
    p = mul_add(p, t2, 1.0 / 17.0);
    p = mul_add(p, t2, -1.0 / 15.0);
    p = mul_add(p, t2, 1.0 / 13.0);
    p = mul_add(p, t2, -1.0 / 11.0);
    p = mul_add(p, t2, 1.0 / 9.0);
    p = mul_add(p, t2, -1.0 / 7.0);
    p = mul_add(p, t2, 1.0 / 5.0);
    return mul_add(p, t2, -1.0 / 3.0);
}

// ln of the nearest of the points.
fn logarithm_expansion(mantissa: real) -> Expansion {
    var expansion = Expansion(0.75, -0.2876820724513891, -3.918237769963822e-13);
    expansion = expanded_beyond(expansion, 0.8125 < mantissa, Expansion(0.875, -0.13353139262471814, 1.9551393909415374e-13));
    expansion = expanded_beyond(expansion, 0.9375 < mantissa, Expansion(1.0, 0.0, 0.0));
    expansion = expanded_beyond(expansion, 1.0625 < mantissa, Expansion(1.125, 0.11778303565643, -4.654729747598445e-14));
    expansion = expanded_beyond(expansion, 1.1875 < mantissa, Expansion(1.25, 0.22314355131402408, 1.856757095979601e-13));
    return expanded_beyond(expansion, 1.3125 < mantissa, Expansion(1.375, 0.3184537311180975, 4.3712191957429144e-13));
}

// arctan of the nearest of the tangents.
fn angle_expansion(n: real, d: real) -> Expansion {
    var expansion = Expansion(0.0, 0.0, 0.0);
    expansion = expanded_beyond(expansion, d * 0.13 < n, Expansion(0.25, 0.24497866312686414, 1.0698755618734451e-17));
    expansion = expanded_beyond(expansion, d * 0.36 < n, Expansion(0.5, 0.4636476090008061, 2.2698777452961687e-17));
    return expanded_beyond(expansion, d * 0.72 < n, Expansion(1.0, 0.7853981633974483, 3.061616997868383e-17));
}

// value 2^n.
fn scaled(value: real, n: real) -> real {
    let negative = n < 0.0;
    var x = Resolved(value, abs(n));
    x = digit_taken(x, 512.0, select(real(1.3407807929942597e+154), real(7.458340731200207e-155), negative));
    x = digit_taken(x, 256.0, select(real(1.157920892373162e+77), real(8.636168555094445e-78), negative));
    x = digit_taken(x, 128.0, select(real(3.402823669209385e+38), real(2.938735877055719e-39), negative));
    x = digit_taken(x, 64.0, select(real(1.8446744073709552e19), real(5.421010862427522e-20), negative));
    x = digit_taken(x, 32.0, select(real(4294967296.0), real(2.3283064365386963e-10), negative));
    x = digit_taken(x, 16.0, select(real(65536.0), real(0.0000152587890625), negative));
    x = digit_taken(x, 8.0, select(real(256.0), real(0.00390625), negative));
    x = digit_taken(x, 4.0, select(real(16.0), real(0.0625), negative));
    x = digit_taken(x, 2.0, select(real(4.0), real(0.25), negative));
    x = digit_taken(x, 1.0, select(real(2.0), real(0.5), negative));
    x = digit_taken(x, 1.0, select(real(2.0), real(0.5), negative));
    return x.value;
}

// x as a mantissa in [1, 2) and an exponent.
fn resolved(number: real) -> Resolved {
    var x = Resolved(number, 0.0);
    x = raised(x, 1022.0, 4.49423283715579e+307);
    x = raised(x, 52.0, 4503599627370496.0);
    x = lowered(x, 512.0, 1.3407807929942597e+154, 7.458340731200207e-155);
    x = lowered(x, 256.0, 1.157920892373162e+77, 8.636168555094445e-78);
    x = lowered(x, 128.0, 3.402823669209385e+38, 2.938735877055719e-39);
    x = lowered(x, 64.0, 1.8446744073709552e19, 5.421010862427522e-20);
    x = lowered(x, 32.0, 4294967296.0, 2.3283064365386963e-10);
    x = lowered(x, 16.0, 65536.0, 0.0000152587890625);
    x = lowered(x, 8.0, 256.0, 0.00390625);
    x = lowered(x, 4.0, 16.0, 0.0625);
    x = lowered(x, 2.0, 4.0, 0.25);
    x = lowered(x, 1.0, 2.0, 0.5);
    return lowered(x, 1.0, 2.0, 0.5);
}
