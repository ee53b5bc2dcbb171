// The constants of 32 bits for the elementary functions of formulas. Twin: the numbers of f32 in
// src/math/elementary/functions.rs, which describes them, and in src/math/real.rs.
// This file and functions_f64.wgsl define the same names.

const SPLITTER: real = 4097.0;
const LARGEST: real = 3.40282346638528859812e+38;
const EXP_RANGE_LEAST: real = -87.33654022216797;
const EXP_RANGE_MOST: real = 88.72283172607422;
const LOGARITHM_OF_2: real = 0.693359375;
const LOGARITHM_OF_2_LOW: real = -2.121944400546905827679e-4;
const QUARTER_TURN: real = 1.5707963705062866;
const QUARTER_TURN_LOW: real = -4.371138828673793e-08;
const HALF_TURN: real = 3.1415927410125732;
const HALF_TURN_LOW: real = -8.742277657347586e-08;
const LARGEST_SINE: real = 1.000000476837158203125;
const LARGEST_EXPONENT: real = 1099511627776.0;
const FAR: real = 1.2676506002282294e30;
const REDUCTION: real = 9.313225746154785e-10;
const NEAR: real = 8.077935669463161e-28;
const ENLARGEMENT: real = 1152921504606846976.0;
const NOTHING: real = 7.888609052210118e-31;

// pi/2 in four words.
const RIGHT_ANGLE_1: real = 1.5706787109375;
const RIGHT_ANGLE_2: real = 0.00011761486530303955;
const RIGHT_ANGLE_3: real = 9.920313459588215e-10;
const RIGHT_ANGLE_4: real = 6.223371969669989e-14;

// (e^x - 1 - x)/x^2 on |x| <= ln(2)/2.
fn exp_series(x: real) -> real {
    var p: real = 1.0 / 5040.0;
    p = mul_add(p, x, 1.0 / 720.0);
    p = mul_add(p, x, 1.0 / 120.0);
    p = mul_add(p, x, 1.0 / 24.0);
    p = mul_add(p, x, 1.0 / 6.0);
    return mul_add(p, x, 0.5);
}

// (artanh z / z - 1)/z^2.
fn logarithm_series(z2: real) -> real {
    var p: real = 1.0 / 7.0;
    p = mul_add(p, z2, 1.0 / 5.0);
    return mul_add(p, z2, 1.0 / 3.0);
}

// (arctan t / t - 1)/t^2.
fn angle_series(t2: real) -> real {
    var p: real = 1.0 / 9.0;
    p = mul_add(p, t2, -1.0 / 7.0);
    p = mul_add(p, t2, 1.0 / 5.0);
    return mul_add(p, t2, -1.0 / 3.0);
}

// ln of the nearest of the points.
fn logarithm_expansion(mantissa: real) -> Expansion {
    var expansion = Expansion(0.75, -0.287689208984375, 7.136532531148987e-06);
    expansion = expanded_beyond(expansion, 0.8125 < mantissa, Expansion(0.875, -0.1335296630859375, -1.72953855326341e-06));
    expansion = expanded_beyond(expansion, 0.9375 < mantissa, Expansion(1.0, 0.0, 0.0));
    expansion = expanded_beyond(expansion, 1.0625 < mantissa, Expansion(1.125, 0.1177825927734375, 4.428829356584174e-07));
    expansion = expanded_beyond(expansion, 1.1875 < mantissa, Expansion(1.25, 0.22314453125, -9.799357485462679e-07));
    return expanded_beyond(expansion, 1.3125 < mantissa, Expansion(1.375, 0.318450927734375, 2.8033841772412416e-06));
}

// arctan of the nearest of the tangents.
fn angle_expansion(n: real, d: real) -> Expansion {
    var expansion = Expansion(0.0, 0.0, 0.0);
    expansion = expanded_beyond(expansion, d * 0.13 < n, Expansion(0.25, 0.244978666305542, -3.1786777654474463e-09));
    expansion = expanded_beyond(expansion, d * 0.36 < n, Expansion(0.5, 0.46364760398864746, 5.01215868808913e-09));
    return expanded_beyond(expansion, d * 0.72 < n, Expansion(1.0, 0.7853981852531433, -2.1855694143368964e-08));
}

// value 2^n.
fn scaled(value: real, n: real) -> real {
    let negative = n < 0.0;
    var x = Resolved(value, abs(n));
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
    x = raised(x, 126.0, 8.507059173023462e37);
    x = raised(x, 23.0, 8388608.0);
    x = lowered(x, 64.0, 1.8446744073709552e19, 5.421010862427522e-20);
    x = lowered(x, 32.0, 4294967296.0, 2.3283064365386963e-10);
    x = lowered(x, 16.0, 65536.0, 0.0000152587890625);
    x = lowered(x, 8.0, 256.0, 0.00390625);
    x = lowered(x, 4.0, 16.0, 0.0625);
    x = lowered(x, 2.0, 4.0, 0.25);
    x = lowered(x, 1.0, 2.0, 0.5);
    return lowered(x, 1.0, 2.0, 0.5);
}
