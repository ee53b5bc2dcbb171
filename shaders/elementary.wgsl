// Sine and cosine of a turn count, and the exponential of a number that is not positive. Twin: src/math/elementary/mod.rs.

const TAU: real = 6.283185307179586477;

// Least argument of exp_negative.
const EXP_LEAST: real = -86.0;

// An angle in turns, quadrant / 4 + residual, the residual in [-1/8, 1/8].
struct Turns {
    quadrant: real,
    residual: real,
}

// sin and cos of an angle in turns; error at most 1.25e-7 (f32) or 2.2e-16 (f64), absolute.
fn sin_cos_turns(angle: Turns) -> SinCos {
    let x = angle.residual * TAU;
    let sin = sin_eighth(x);
    let cos = cos_eighth(x);
    let quadrant = angle.quadrant;
    let at_least_1 = 0.5 < quadrant;
    let at_least_2 = 1.5 < quadrant;
    let at_least_3 = 2.5 < quadrant;
    let odd = (at_least_1 && !at_least_2) || at_least_3;
    let swapped_sin = select(sin, cos, odd);
    let swapped_cos = select(cos, sin, odd);
    let cos_negative = at_least_1 && !at_least_3;
    return SinCos(select(swapped_sin, -swapped_sin, at_least_2), select(swapped_cos, -swapped_cos, cos_negative));
}

// The angle plus `turns`, at most an eighth of a turn in magnitude, reduced again.
fn turned_by(angle: Turns, turns: real) -> Turns {
    let sum = angle.residual + turns;
    let quarters = round(sum * 4.0);
    let residual = mul_add(quarters, -0.25, sum);
    let quadrant = angle.quadrant + quarters;
    let wrap = select(select(real(0.0), real(-4.0), 3.5 < quadrant), real(4.0), quadrant < -0.5);
    return Turns(quadrant + wrap, residual);
}

// A number as high + low + log(power).
struct Reduction {
    high: real,
    low: real,
    power: real,
}

// One binary digit of n: where `high` is below (1/2 - weight) ln 2, `weight` halvings are taken out of it.
fn halved(x: Reduction, weight: real, power: real) -> Reduction {
    let is_set = x.high < (0.5 - weight) * LN_2_1;
    return Reduction(
        x.high + select(real(0.0), weight * LN_2_1, is_set),
        x.low + select(real(0.0), weight * LN_2_2, is_set),
        x.power * select(real(1.0), power, is_set),
    );
}

// e^x for x <= 0; below EXP_LEAST the value there. Relative error at most 2 units of roundoff.
// Every subtraction of a multiple of ln 2 is exact, and there is no product to contract or re-associate.
fn exp_negative(x: real) -> real {
    var y = Reduction(max(x, EXP_LEAST), 0.0, 1.0);
    y = halved(y, 64.0, 5.421010862427522e-20);
    y = halved(y, 32.0, 2.3283064365386963e-10);
    y = halved(y, 16.0, 0.0000152587890625);
    y = halved(y, 8.0, 0.00390625);
    y = halved(y, 4.0, 0.0625);
    y = halved(y, 2.0, 0.25);
    y = halved(y, 1.0, 0.5);
    let reduced = y.high + y.low;
    return (1.0 + mul_add(exp_tail(reduced) * reduced, reduced, reduced)) * y.power;
}
