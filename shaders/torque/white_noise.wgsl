// white-noise: a random torque without memory. Twin: src/torque/white_noise.rs, where it is described.

// Philox4x32-10 (Salmon, Moraes, Dror, Shaw 2011).
fn philox(initial_counter: vec4<u32>, initial_key: vec2<u32>) -> vec4<u32> {
    var counter = initial_counter;
    var key = initial_key;
    for (var round_index = 0u; round_index < 10u; round_index += 1u) {
        let first = wide_product(counter.x, 0xd2511f53u);
        let second = wide_product(counter.z, 0xcd9e8d57u);
        counter = vec4<u32>(second.y ^ counter.y ^ key.x, second.x, first.y ^ counter.w ^ key.y, first.x);
        key = vec2<u32>(key.x + 0x9e3779b9u, key.y + 0xbb67ae85u);
    }
    return counter;
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
