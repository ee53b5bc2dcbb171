// Sine and cosine without library functions. Twin: sin_cos in src/math/real.rs.

struct SinCos {
    sin: real,
    cos: real,
}

// Valid for |x| <= 2^10 (f32) or 2^20 (f64), error at most 1 ulp of 1.
fn sin_cos(x: real) -> SinCos {
    let turns = round(x * TWO_OVER_PI);
    let reduced = reduced_by_quarters(x, turns);
    let sin = sin_eighth(reduced);
    let cos = cos_eighth(reduced);

    // Quadrant, as -2, -1, 0, 1 or 2.
    let quadrant = turns - 4.0 * round(turns * 0.25);
    let odd = 0.5 < abs(quadrant) && abs(quadrant) < 1.5;
    let opposite = 1.5 < abs(quadrant);
    let swapped_sin = select(sin, cos, odd);
    let swapped_cos = select(cos, sin, odd);
    let sin_negative = opposite || quadrant < -0.5;
    let cos_negative = opposite || (odd && 0.5 < quadrant);
    return SinCos(select(swapped_sin, -swapped_sin, sin_negative), select(swapped_cos, -swapped_cos, cos_negative));
}
