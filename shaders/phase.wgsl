// Phases as integer fractions of a turn: a 128-bit rate times a time, of which the 64 bits after the point of a turn are kept.
// Twin: src/math/phase.rs, which gives the same bits. Numbers of 64 bits are vec2<u32>, low word first.

// A time, sign * mantissa * 2^exponent seconds.
struct Time {
    mantissa: vec2<u32>,
    exponent: i32,
    negative: u32,
}

// Size in units of 2^(exponent - 128) turns per second, and the sign.
struct Rate {
    fraction: vec4<u32>,
    exponent: i32,
    negative: bool,
}

fn wide_sum(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    let low = a.x + b.x;
    return vec2<u32>(low, a.y + b.y + select(0u, 1u, low < a.x));
}

fn wide_negative(a: vec2<u32>) -> vec2<u32> {
    return wide_sum(vec2<u32>(~a.x, ~a.y), vec2<u32>(1u, 0u));
}

// fraction * mantissa * 2^(exponent - 64) modulo 2^64, rounded down.
fn fraction_of_turn(rate: vec4<u32>, mantissa: vec2<u32>, exponent: i32) -> vec2<u32> {
    let t0 = wide_product(rate.x, mantissa.x);
    let t1 = wide_sum(wide_product(rate.y, mantissa.x), vec2<u32>(t0.y, 0u));
    let t2 = wide_sum(wide_product(rate.z, mantissa.x), vec2<u32>(t1.y, 0u));
    let t3 = wide_sum(wide_product(rate.w, mantissa.x), vec2<u32>(t2.y, 0u));
    let u1 = wide_sum(wide_product(rate.x, mantissa.y), vec2<u32>(t1.x, 0u));
    let u2 = wide_sum(wide_sum(wide_product(rate.y, mantissa.y), vec2<u32>(t2.x, 0u)), vec2<u32>(u1.y, 0u));
    let u3 = wide_sum(wide_sum(wide_product(rate.z, mantissa.y), vec2<u32>(t3.x, 0u)), vec2<u32>(u2.y, 0u));
    let u4 = wide_sum(wide_sum(wide_product(rate.w, mantissa.y), vec2<u32>(t3.y, 0u)), vec2<u32>(u3.y, 0u));
    var product = array<u32, 8>(t0.x, u1.x, u2.x, u3.x, u4.x, u4.y, 0u, 0u);
    // The 64 bits from bit `shift` upwards.
    let shift = 64 - exponent;
    if (shift >= 192 || shift <= -64) {
        return vec2<u32>(0u, 0u);
    }
    if (shift < 0) {
        let left = u32(-shift);
        let low = select(product[0] << (left & 31u), 0u, left >= 32u);
        let carried = select((product[0] >> 1u) >> (31u - (left & 31u)), product[0] << (left & 31u), left >= 32u);
        return vec2<u32>(low, carried | select(product[1] << (left & 31u), 0u, left >= 32u));
    }
    let word = u32(shift) >> 5u;
    let bits = u32(shift) & 31u;
    let lower = product[word];
    let middle = product[word + 1u];
    let upper = product[word + 2u];
    return vec2<u32>(
        (lower >> bits) | ((middle << 1u) << (31u - bits)),
        (middle >> bits) | ((upper << 1u) << (31u - bits)),
    );
}

// The phase at `time` in units of 2^-64 turn, modulo one turn.
fn phase_at(start: vec2<u32>, rate: Rate, time: Time) -> vec2<u32> {
    let advanced = fraction_of_turn(rate.fraction, time.mantissa, time.exponent + rate.exponent);
    let backward = (time.negative != 0u) != rate.negative;
    return wide_sum(start, select(advanced, wide_negative(advanced), backward));
}

// A phase as the nearest quarter turn and the rest.
fn phase_turns(phase: vec2<u32>) -> Turns {
    let quadrant = (phase.y + 0x20000000u) >> 30u;
    let residual = from_fixed_point(vec2<u32>(phase.x, phase.y - (quadrant << 30u)));
    return Turns(real(quadrant), residual);
}
