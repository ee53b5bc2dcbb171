// The elementary functions of formulas. Twin: src/math/elementary/functions.rs, which describes methods, domains and errors. The functions
// hide WGSL's own with the same names, which are inaccurate in 32 bits and missing in 64.

// A number as high + low.
struct Words {
    high: real,
    low: real,
}

// A function has the value high + low at a point.
struct Expansion {
    point: real,
    high: real,
    low: real,
}

// A number in which powers of two are inserted or removed, and the part of the exponent that remains or was found.
struct Resolved {
    value: real,
    exponent: real,
}

// Infinity and NaN cannot be written as literals, nor result from arithmetic that a compiler evaluates: their bits are assembled at
// run time.
fn infinity() -> real {
    return real(bitcast<f32>(0x7f800000u | settings.zero));
}
fn not_a_number() -> real {
    return real(bitcast<f32>(0x7fc00000u | settings.zero));
}

// e^x; error at most 1.5 ulp.
fn exp(x: real) -> real {
    return exp_of_words(x, 0.0);
}

// ln x for x > 0; error at most 1 ulp.
fn ln(x: real) -> real {
    let logarithm = logarithm(x);
    let result = select(logarithm.high + logarithm.low, x, LARGEST < x);
    return select(not_a_number(), result, 0.0 < x);
}

// x^y for x >= 0; error at most 2 ulp.
fn pow(x: real, y: real) -> real {
    let limit = LARGEST_EXPONENT;
    let exponent = select(select(y, limit, limit < y), -limit, y < -limit);
    let logarithm = logarithm(x);
    let exponent_half = upper_half(exponent);
    let logarithm_half = upper_half(logarithm.high);
    let rest = separated(logarithm.high - logarithm_half) + logarithm.low;
    let product = separated(exponent_half * logarithm_half);
    let product_rest = exponent * rest + separated(exponent - exponent_half) * logarithm_half;
    let sum = quick_sum(product, separated(product_rest));
    let power = exp_of_words(sum.high, sum.low);

    let y_positive = 0.0 < y;
    let y_negative = y < 0.0;
    let x_infinite = LARGEST < x;
    // NaN is neither positive nor negative, nor below one.
    let x_zero = !(0.0 < x) && !(x < 0.0) && x < 1.0;
    let y_zero = !y_positive && !y_negative && y < 1.0;
    let infinite = (x_infinite && y_positive) || (x_zero && y_negative);
    let vanishing = (x_infinite && y_negative) || (x_zero && y_positive);
    let in_domain = select(power, not_a_number(), x < 0.0);
    let bounded = select(select(in_domain, real(0.0), vanishing), infinity(), infinite);
    return select(bounded, real(1.0), y_zero);
}

// tan x for |x| <= 2^10 (f32) or 2^20 (f64); error at most 3 ulp.
fn tan(x: real) -> real {
    let turns = round(x * TWO_OVER_PI);
    // The products with the first three words are exact, and so is the first difference.
    let near = separated(mul_add(turns, -RIGHT_ANGLE_1, x));
    let nearer = exact_sum(near, separated(turns * -RIGHT_ANGLE_2));
    let nearest = exact_sum(nearer.high, separated(turns * -RIGHT_ANGLE_3));
    let rest = mul_add(turns, -RIGHT_ANGLE_4, nearer.low + nearest.low);
    let reduced = quick_sum(nearest.high, separated(rest));
    let sin = sin_eighth(reduced.high);
    let cos = cos_eighth(reduced.high);
    let sin_low = reduced.low * cos;
    let cos_low = -(reduced.low * sin);

    let odd = 0.5 < abs(turns - 2.0 * round(turns * 0.5));
    let numerator = Words(select(sin, -cos, odd), select(sin_low, -cos_low, odd));
    let denominator = Words(select(cos, sin, odd), select(cos_low, sin_low, odd));
    let tangent = quotient(numerator, denominator);
    return tangent.high + tangent.low;
}

// arcsin x, in [-pi/2, pi/2]; error at most 1.5 ulp.
fn asin(x: real) -> real {
    let sine = abs(x);
    let cosine = complement(sine);
    // The tangent of half the angle is sin/(1 + cos).
    let divisor = quick_sum(1.0, cosine.high);
    let denominator = Words(divisor.high, divisor.low + cosine.low);
    let half = arctangent(Words(select(sine, real(1.0), 1.0 < sine), 0.0), denominator);
    let angle = 2.0 * (half.high + half.low);
    let with_sign = select(angle, -angle, x < 0.0);
    return select(with_sign, not_a_number(), LARGEST_SINE < sine);
}

// arccos x, in [0, pi]; error at most 1.5 ulp.
fn acos(x: real) -> real {
    let cosine = abs(x);
    let sine = complement(cosine);
    // The tangent of half the angle of |x|.
    let half = arctangent(sine, quick_sum(1.0, select(cosine, real(1.0), 1.0 < cosine)));
    let negative = x < 0.0;
    let high = 2.0 * half.high;
    let low = 2.0 * half.low;
    let angle = quick_sum(select(real(0.0), HALF_TURN, negative), select(high, -high, negative));
    let rest = select(low, HALF_TURN_LOW - low, negative);
    let result = angle.high + (angle.low + rest);
    return select(result, not_a_number(), LARGEST_SINE < cosine);
}

// The angle of the point (x, y) from the x axis, in [-pi, pi]; error at most 1 ulp.
fn atan2(y: real, x: real) -> real {
    let size_x = select(abs(x), LARGEST, LARGEST < abs(x));
    let size_y = select(abs(y), LARGEST, LARGEST < abs(y));
    let steep = size_x < size_y;
    let shorter = select(size_y, size_x, steep);
    let longer = select(size_x, size_y, steep);
    // Halves of a mantissa then neither overflow nor vanish.
    let scale = select(select(REDUCTION, real(1.0), longer < FAR), ENLARGEMENT, longer < NEAR);
    let longer_scaled = longer * scale;
    let divisor = select(longer_scaled, real(1.0), longer_scaled < NOTHING);
    let angle = arctangent(Words(shorter * scale, 0.0), Words(divisor, 0.0));

    let left = x < 0.0;
    let backwards = (steep && !left) || (!steep && left);
    let axis = select(select(real(0.0), HALF_TURN, left), QUARTER_TURN, steep);
    let axis_low = select(select(real(0.0), HALF_TURN_LOW, left), QUARTER_TURN_LOW, steep);
    let sum = quick_sum(axis, select(angle.high, -angle.high, backwards));
    let rest = axis_low + select(angle.low, -angle.low, backwards);
    let result = sum.high + (sum.low + rest);
    return select(result, -result, y < 0.0);
}

// arctan(sqrt(x2))/sqrt(x2) for 0 <= x2 <= 0.04; error at most 1 ulp.
fn arctangent_ratio(x2: real) -> real {
    return mul_add(angle_series(x2), x2, 1.0);
}

// x with the lower half of its mantissa cleared: products of such numbers are exact.
fn upper_half(x: real) -> real {
    let enlarged = separated(x * SPLITTER);
    return separated(enlarged - separated(enlarged - x));
}

// a + b and its rounding error, exactly, where |a| >= |b| or a = 0.
fn quick_sum(a: real, b: real) -> Words {
    let sum = separated(a + b);
    return Words(sum, separated(b - separated(sum - a)));
}

// a + b and its rounding error, exactly.
fn exact_sum(a: real, b: real) -> Words {
    let sum = separated(a + b);
    let b_taken = separated(sum - a);
    let a_taken = separated(sum - b_taken);
    return Words(sum, separated(a - a_taken) + separated(b - b_taken));
}

// n/d to about one and a half words, `high` half a mantissa long.
fn quotient(n: Words, d: Words) -> Words {
    let high = upper_half(n.high / d.high);
    let half = upper_half(d.high);
    // The product and the difference are exact.
    let rest = separated(n.high - separated(high * half));
    let residual = (rest - high * (separated(d.high - half) + d.low)) + n.low;
    return Words(high, separated(residual / d.high));
}

// One digit of an exponent: if it is set, it moves into the value.
fn digit_taken(x: Resolved, weight: real, power: real) -> Resolved {
    let is_set = weight - 0.5 < x.exponent;
    return Resolved(
        separated(x.value * select(real(1.0), power, is_set)),
        x.exponent - select(real(0.0), weight, is_set),
    );
}

// A value below 1 is multiplied by a power of two.
fn raised(x: Resolved, weight: real, power: real) -> Resolved {
    let small = x.value < 1.0;
    return Resolved(
        separated(x.value * select(real(1.0), power, small)),
        x.exponent - select(real(0.0), weight, small),
    );
}

// A value of at least a power of two is divided by it.
fn lowered(x: Resolved, weight: real, power: real, reciprocal: real) -> Resolved {
    let is_set = !(x.value < power);
    return Resolved(
        separated(x.value * select(real(1.0), reciprocal, is_set)),
        x.exponent + select(real(0.0), weight, is_set),
    );
}

fn expanded_beyond(before: Expansion, beyond: bool, after: Expansion) -> Expansion {
    return Expansion(
        select(before.point, after.point, beyond),
        select(before.high, after.high, beyond),
        select(before.low, after.low, beyond),
    );
}

// e^(high + low).
fn exp_of_words(high: real, low: real) -> real {
    let below = high < EXP_RANGE_LEAST;
    let above = EXP_RANGE_MOST < high;
    let bounded = select(select(high, EXP_RANGE_MOST, above), EXP_RANGE_LEAST, below);
    let n = round(bounded * 1.44269504088896340736);
    // Exact.
    let rest = separated(mul_add(n, -LOGARITHM_OF_2, bounded));
    let reduced = rest + separated(mul_add(n, -LOGARITHM_OF_2_LOW, low));
    let tail = exp_series(reduced);
    // Otherwise a driver might add 1 to the greater addend first.
    let power = 1.0 + separated(mul_add(tail * reduced, reduced, reduced));
    let result = scaled(power, n);
    return select(select(result, infinity(), above), real(0.0), below);
}

// ln x for 0 < x < infinity to about one and a half words.
fn logarithm(x: real) -> Words {
    let found = resolved(x);
    let large = 1.41421356237309504880 < found.value;
    let mantissa = found.value * select(real(1.0), real(0.5), large);
    let exponent = found.exponent + select(real(0.0), real(1.0), large);
    let expansion = logarithm_expansion(mantissa);
    // The difference is exact.
    let difference = Words(2.0 * (mantissa - expansion.point), 0.0);
    let ratio = quotient(difference, quick_sum(expansion.point, mantissa));
    let twice = ratio.high + ratio.low;
    let z = 0.5 * twice;
    let z2 = z * z;
    let tail = twice * (z2 * logarithm_series(z2));

    // Both products are exact, and so is the first sum.
    let whole = separated(mul_add(exponent, LOGARITHM_OF_2, expansion.high));
    let whole_low = mul_add(exponent, LOGARITHM_OF_2_LOW, expansion.low);
    let sum = quick_sum(whole, ratio.high);
    return quick_sum(sum.high, separated(sum.low + (whole_low + (ratio.low + tail))));
}

// sqrt(1 - x^2) for 0 <= x <= 1, and 0 for x > 1.
fn complement(x: real) -> Words {
    let difference = separated(1.0 - x);
    let square = separated(select(difference * (1.0 + x), real(0.0), difference < 0.0));
    let root = separated(sqrt(square));
    // One Newton step, for devices whose root has an error above its rounding.
    let half = upper_half(root);
    let rest = separated(root - half);
    let residual = separated(separated(square - separated(half * half)) - (half + half) * rest) - rest * rest;
    let divisor = select(real(1.0), root + root, 0.0 < root);
    return Words(root, separated(residual / divisor));
}

// arctan(n/d) for 0 <= n <= d to about one and a half words.
fn arctangent(n: Words, d: Words) -> Words {
    let expansion = angle_expansion(n.high, d.high);
    let difference = Words(separated(n.high - expansion.point * d.high), n.low - expansion.point * d.low);
    let partial = quick_sum(d.high, expansion.point * n.high);
    let sum = Words(partial.high, partial.low + (d.low + expansion.point * n.low));
    let ratio = quotient(difference, sum);
    let t = ratio.high + ratio.low;
    let t2 = t * t;
    let tail = t * (t2 * angle_series(t2));
    let angle = quick_sum(expansion.high, ratio.high);
    return Words(angle.high, angle.low + (expansion.low + (ratio.low + tail)));
}
