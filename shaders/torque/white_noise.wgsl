// white-noise: a random torque without memory. Twin: src/torque/white_noise.rs, which describes it.

// Philox4x32-10 (Salmon, Moraes, Dror, Shaw 2011), with its rounds unrolled because of the bound on loops in
// src/engine/gpu/dispatch.rs.
fn philox(counter: vec4<u32>, key: vec2<u32>) -> vec4<u32> {
    var words = philox_round(counter, key, 0u);
    words = philox_round(words, key, 1u);
    words = philox_round(words, key, 2u);
    words = philox_round(words, key, 3u);
    words = philox_round(words, key, 4u);
    words = philox_round(words, key, 5u);
    words = philox_round(words, key, 6u);
    words = philox_round(words, key, 7u);
    words = philox_round(words, key, 8u);
    return philox_round(words, key, 9u);
}

fn philox_round(counter: vec4<u32>, key: vec2<u32>, round_index: u32) -> vec4<u32> {
    let first = wide_product(counter.x, 0xd2511f53u);
    let second = wide_product(counter.z, 0xcd9e8d57u);
    let round_key = key + round_index * vec2<u32>(0x9e3779b9u, 0xbb67ae85u);
    return vec4<u32>(second.y ^ counter.y ^ round_key.x, second.x, first.y ^ counter.w ^ round_key.y, first.x);
}

// Three standard normal numbers from four random words (Box, Muller 1958).
fn normal_vector(words: vec4<u32>) -> vector {
    let first_radius = sqrt(2.0 * minus_log(uniform_parts(words.x)));
    let second_radius = sqrt(2.0 * minus_log(uniform_parts(words.z)));
    let first = sin_cos(uniform_turns(words.y) * TAU);
    let second = sin_cos(uniform_turns(words.w) * TAU);
    return vector(first_radius * first.cos, first_radius * first.sin, second_radius * second.cos);
}

// mantissa 2^-exponent, the mantissa in [1, 2).
struct UniformParts {
    mantissa: real,
    exponent: real,
}

// -ln u.
fn minus_log(u: UniformParts) -> real {
    let large = SQRT_2 < u.mantissa;
    let m = select(u.mantissa, u.mantissa * 0.5, large);
    let halvings = select(u.exponent, u.exponent - 1.0, large);
    let z = (m - 1.0) / (m + 1.0);
    return mul_add(halvings, LN_2, -(2.0 * z * artanh_series(z * z)));
}

// A random word as the uniform number (n + 1/2) 2^-32.
fn uniform_parts(word: u32) -> UniformParts {
    if (word == 0u) {
        return UniformParts(real(1.0), real(33.0));
    }
    // 2n + 1 has 33 bits; the leading one is shifted out.
    let zeros = countLeadingZeros(word);
    let fraction = ((word << zeros) << 1u) | (1u << zeros);
    return UniformParts(1.0 + fraction_of_word(fraction), real(zeros + 1u));
}

// A random word as an angle in turns, in [-1/2, 1/2).
fn uniform_turns(word: u32) -> real {
    return real(bitcast<i32>(word)) * (1.0 / 4294967296.0);
}
