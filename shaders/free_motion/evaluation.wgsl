// The closed form of a torque-free body at a time, from its row of constants. Twin: src/kernel/free_motion/evaluation.rs, which with
// src/kernel/free_motion/mod.rs has the formulas and their sources.

// Row.shape where the series in the nome converge fast (the direct series).
const ALPHA_REAL: u32 = 0u;
const ALPHA_IMAGINARY: u32 = 3u;
const BETA_REAL: u32 = 6u;
const BETA_IMAGINARY: u32 = 9u;
const NOME: u32 = 12u;
// Row.shape near the separatrix (the transformed series).
const COSINES: u32 = 0u;
const SINES: u32 = 4u;
const BETA_FACTOR: u32 = 8u;
const SLOPE: u32 = 9u;
const OFFSET: u32 = 10u;
const GAIN: u32 = 11u;
const TRANSFORMED_NOME: u32 = 12u;

struct Row {
    shape: array<real, 13>,
    // Left factor of the orientation.
    frame: quaternion,
    // Factors of the components a, 2, d of the angular momentum.
    amplitude: vector,
    // +-1 or +-2: circulation about the third or the first axis; +-4 added for the transformed series.
    axes: real,
}

// The time at which a row is evaluated.
struct Instant {
    polhode: Turns,
    precession: Turns,
    // In units of 2^-r s, for the separatrix.
    time: real,
}

struct FreeState {
    orientation: quaternion,
    angular_momentum_principal: vector,
}

// alpha, beta and the numerators of the theta quotients, all up to one common factor.
struct Shape {
    alpha_real: real,
    alpha_imaginary: real,
    beta_real: real,
    beta_imaginary: real,
    numerators: vector,
}

fn is_transformed(row: Row) -> bool {
    return 3.0 < abs(row.axes);
}

fn circulates_about_first(row: Row, transformed: bool) -> bool {
    let code = abs(row.axes) - select(real(0.0), real(4.0), transformed);
    return 1.5 < code;
}

// The distance of the angle from the nearest half turn, in turns, in [-1/4, 1/4].
fn from_half_turn(angle: Turns) -> real {
    let quarter = select(real(-0.25), real(0.25), angle.residual < 0.0);
    return select(angle.residual, angle.residual + quarter, is_odd_quadrant(angle));
}

fn is_odd_quadrant(angle: Turns) -> bool {
    let distance = abs(angle.quadrant - 2.0);
    return 0.5 < distance && distance < 1.5;
}

// -1 if the nearest half turn is an odd one, otherwise 1.
fn half_turn_sign(angle: Turns) -> real {
    let behind = angle.residual < 0.0;
    let distance = abs(angle.quadrant - 2.0);
    let second = distance < 0.5;
    let first = angle.quadrant < 1.5 && !behind;
    let third = 2.5 < angle.quadrant && behind;
    let odd = second || (is_odd_quadrant(angle) && (first || third));
    return select(real(1.0), real(-1.0), odd);
}

// x, or 0 if x^4 vanishes next to 1, so that no power of it is a subnormal number.
fn unless_fourth_power_vanishes(x: real) -> real {
    return select(x, real(0.0), x < FOURTH_POWER_NEGLIGIBLE);
}

fn unless_negligible(x: real) -> real {
    return select(x, real(0.0), x < NEGLIGIBLE);
}

fn quadratic(a: real, b: real, d: real, c: real) -> real {
    return mul_add(mul_add(d, c, b), c, a);
}

// theta_2(v)/(2 q^(1/4) cos v), theta_1(v)/(2 q^(1/4) sin v) and theta_3(v) of nome q, where c = cos 2v.
fn direct_numerators(q: real, c: real) -> vector {
    let q2 = q * q;
    let h = unless_fourth_power_vanishes(q);
    let h2 = h * h;
    let h4 = h2 * h2;
    let q6 = h4 * h2;
    let q12 = q6 * q6;
    // Even and odd parts in c of 1 + q^2 (2c - 1) + q^6 (4c^2 - 2c - 1) + q^12 (8c^3 - 4c^2 - 4c + 1).
    let c2 = c * c;
    let four_c2 = 4.0 * c2;
    let even = mul_add(1.0 - four_c2, q12, mul_add(four_c2 - 1.0, q6, 1.0 - q2));
    let odd = (2.0 * c) * mul_add(2.0 * (c2 + c2) - 2.0, q12, q2 - q6);
    // c + q^3 (2c^2 - 1) + q^8 (4c^3 - 3c) + q^15 (8c^4 - 8c^2 + 1).
    let cos_4v = (c2 + c2) - 1.0;
    let cos_6v = mul_add(c + c, cos_4v, -c);
    let cos_8v = mul_add(c + c, cos_6v, -cos_4v);
    let q3 = h2 * h;
    let sum = mul_add(q12 * q3, cos_8v, mul_add(h4 * h4, cos_6v, mul_add(q3, cos_4v, c)));
    return vector(even + odd, even - odd, mul_add(q + q, sum, 1.0));
}

// The theta series in powers of cos 2v.
fn direct_shape(row: Row, v: Turns) -> Shape {
    let turned = sin_cos_turns(v);
    let sin = turned.sin;
    let cos = turned.cos;
    let c = (cos - sin) * (cos + sin);
    let sin_2v = (sin + sin) * cos;
    let alpha_real = mul_add(
        quadratic(row.shape[ALPHA_REAL], row.shape[ALPHA_REAL + 1u], row.shape[ALPHA_REAL + 2u], c), c, 1.0);
    let alpha_imaginary = quadratic(
        row.shape[ALPHA_IMAGINARY], row.shape[ALPHA_IMAGINARY + 1u], row.shape[ALPHA_IMAGINARY + 2u], c) * sin_2v;
    let beta_real =
        quadratic(row.shape[BETA_REAL], row.shape[BETA_REAL + 1u], row.shape[BETA_REAL + 2u], c) * sin;
    let beta_imaginary =
        quadratic(row.shape[BETA_IMAGINARY], row.shape[BETA_IMAGINARY + 1u], row.shape[BETA_IMAGINARY + 2u], c) * cos;
    let numerators = direct_numerators(row.shape[NOME], c);
    return Shape(
        alpha_real, alpha_imaginary, beta_real, beta_imaginary,
        vector(numerators.x * cos, numerators.y * sin, numerators.z),
    );
}

// From F = e^(-2|y|), D = Q' e^(2|y|) and the sign of y.
fn transformed_series(
    row: Row, nome: real, decay: real, full_growth: real, direction: real, half_turn_sign: real,
) -> Shape {
    let growth = unless_negligible(full_growth);
    let small = unless_negligible(nome * decay);
    let d2 = growth * growth;
    let g2 = small * small;
    let cos_0 = row.shape[COSINES];
    let cos_1 = row.shape[COSINES + 1u];
    let cos_2 = row.shape[COSINES + 2u];
    let cos_3 = row.shape[COSINES + 3u];
    let sin_0 = row.shape[SINES];
    let sin_1 = row.shape[SINES + 1u];
    let sin_2 = row.shape[SINES + 2u];
    let sin_3 = row.shape[SINES + 3u];
    let cos_d = mul_add(cos_2, d2, cos_0);
    let cos_d_odd = growth * mul_add(cos_3, d2, cos_1);
    let sin_d = mul_add(sin_2, d2, sin_0);
    let sin_d_odd = growth * mul_add(sin_3, d2, sin_1);
    let cos_g = mul_add(cos_2, g2, cos_0);
    let cos_g_odd = small * mul_add(cos_3, g2, cos_1);
    let sin_g = mul_add(sin_2, g2, sin_0);
    let sin_g_odd = small * mul_add(sin_3, g2, sin_1);
    let alpha_real = mul_add(decay, cos_g + cos_g_odd, cos_d + cos_d_odd);
    let alpha_imaginary = direction * mul_add(decay, -(sin_g + sin_g_odd), sin_d + sin_d_odd);
    let factor = row.shape[BETA_FACTOR] * half_turn_sign;
    let beta_real = factor * (direction * mul_add(decay, cos_g_odd - cos_g, cos_d - cos_d_odd));
    let beta_imaginary = factor * mul_add(decay, sin_g - sin_g_odd, sin_d - sin_d_odd);
    // theta_4, theta_1 and theta_3 of the imaginary argument 2iy and nome Q'^2, times F.
    let n2 = nome * nome;
    let h = unless_fourth_power_vanishes(nome);
    let h2 = h * h;
    let n4 = h2 * h2;
    let n12 = (n4 * n4) * n4;
    let high = unless_fourth_power_vanishes(growth);
    let low = unless_fourth_power_vanishes(small);
    let high2 = high * high;
    let low2 = low * low;
    let d4 = high2 * high2;
    let g4 = low2 * low2;
    let second = n4 * (d4 + g4);
    // The contribution of the third term to G is below 2^-67 of the whole.
    let rest = mul_add(n12 * d4, high2, d2 + g2);
    let decay2 = decay * decay;
    let sinh = mul_add(n4 * n4, mul_add(-decay2, g4, d4), mul_add(n2, mul_add(decay2, g2, -d2), 1.0 - decay2));
    return Shape(
        alpha_real, alpha_imaginary, beta_real, beta_imaginary,
        vector(
            half_turn_sign * decay * ((1.0 + second) - rest),
            half_turn_sign * direction * sinh,
            decay * ((1.0 + second) + rest),
        ),
    );
}

// The series after Jacobi's imaginary transformation, in powers of e^(+-2y), with e^y taken out.
fn transformed_shape(row: Row, x: real, half_turn_sign: real, time: real) -> Shape {
    let nome = row.shape[TRANSFORMED_NOME];
    let periodic = 0.0 < nome;
    let y = mul_add(row.shape[SLOPE], select(time, x, periodic), row.shape[OFFSET]);
    let backward = y < 0.0;
    let decay = exp_negative(-2.0 * abs(y));
    let growth = nome / decay;
    let direction = select(real(1.0), real(-1.0), backward);
    return transformed_series(row, nome, decay, growth, direction, half_turn_sign);
}

// The series of the row. Its twin evaluates both in lanes and selects one.
fn motion_shape(row: Row, transformed: bool, v: Turns, x: real, time: real) -> Shape {
    if (transformed) {
        return transformed_shape(row, x, half_turn_sign(v), time);
    }
    return direct_shape(row, v);
}

// q (cos + k sin).
fn turned_about_z(q: quaternion, turn: SinCos) -> quaternion {
    return quaternion(
        mul_add(q.x, turn.cos, q.y * turn.sin),
        mul_add(q.y, turn.cos, -(q.x * turn.sin)),
        mul_add(q.z, turn.cos, q.w * turn.sin),
        mul_add(q.w, turn.cos, -(q.z * turn.sin)),
    );
}

// The state at `instant`.
fn evaluate(row: Row, instant: Instant) -> FreeState {
    let transformed = is_transformed(row);
    let x = from_half_turn(instant.polhode);
    let extra = select(real(0.0), row.shape[GAIN] * x, transformed);
    let shape = motion_shape(row, transformed, instant.polhode, x, instant.time);
    let precession = sin_cos_turns(turned_by(instant.precession, extra));
    // The quaternion (alpha, beta), not normalised, and from axes (a, 2, d) to principal axes: a product by 1, i,
    // i + k or i (i + k) from the right.
    var q = quaternion(shape.beta_real, shape.beta_imaginary, shape.alpha_imaginary, shape.alpha_real);
    let n = norm_squared(q);
    q = select(q, quaternion(q.w, q.z, -q.y, -q.x), row.axes < 0.0);
    let about_first = circulates_about_first(row, transformed);
    q = select(q, quaternion(q.w + q.y, q.z - q.x, q.w - q.y, -(q.x + q.z)), about_first);
    let quotients = row.amplitude * shape.numerators * (1.0 / n);
    // Twice that if the change of axes has doubled it.
    let length_squared = select(n, n + n, about_first);
    let unit = q * (1.0 / sqrt(length_squared));
    return FreeState(
        product(turned_about_z(row.frame, precession), unit),
        vector(
            select(quotients.x, quotients.z, about_first),
            quotients.y,
            select(quotients.z, quotients.x, about_first),
        ),
    );
}
