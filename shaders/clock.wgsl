// Exact time and phases that advance with it. Twin: src/clock.rs, where they are described.

// Digits of 16 bits that a rate is stored as in columns, lowest first.
const RATE_DIGITS: u32 = 8u;

struct Instant {
    // Whole ticks from the initial state to the start of the step, low word first.
    ticks: vec2<u32>,
    // Time since the start of the step, s.
    elapsed: real,
}

// a b as low and high word.
fn wide_product(a: u32, b: u32) -> vec2<u32> {
    let a0 = a & 0xffffu;
    let a1 = a >> 16u;
    let b0 = b & 0xffffu;
    let b1 = b >> 16u;
    let low = a0 * b0;
    let middle = a1 * b0 + (low >> 16u);
    let cross = a0 * b1 + (middle & 0xffffu);
    return vec2<u32>((cross << 16u) | (low & 0xffffu), a1 * b1 + (middle >> 16u) + (cross >> 16u));
}

// sum + a b 2^(32 word), modulo 2^128.
fn add_product(sum: vec4<u32>, a: u32, b: u32, word: u32) -> vec4<u32> {
    let product = wide_product(a, b);
    var result = sum;
    let low = result[word] + product.x;
    var carry = select(0u, 1u, low < product.x);
    result[word] = low;
    var addend = product.y;
    for (var next = word + 1u; next < 4u; next += 1u) {
        // addend + carry cannot overflow: a product's high word is at most 2^32 - 2.
        let add = addend + carry;
        let total = result[next] + add;
        carry = select(0u, 1u, total < add);
        result[next] = total;
        addend = 0u;
    }
    return result;
}

// a n modulo 2^128.
fn product_128(a: vec4<u32>, n: u32) -> vec4<u32> {
    var sum = vec4<u32>(0u, 0u, 0u, 0u);
    for (var word = 0u; word < 4u; word += 1u) {
        sum = add_product(sum, a[word], n, word);
    }
    return sum;
}

// a + b modulo 2^128.
fn sum_128(a: vec4<u32>, b: vec4<u32>) -> vec4<u32> {
    var sum = a;
    for (var word = 0u; word < 4u; word += 1u) {
        sum = add_product(sum, b[word], 1u, word);
    }
    return sum;
}

// The rate in columns `first` to `first` + 7 of body i, in units of 2^-128 turn per tick.
fn rate_at(first: u32, i: u32) -> vec4<u32> {
    var rate = vec4<u32>(0u, 0u, 0u, 0u);
    for (var word = 0u; word < 4u; word += 1u) {
        let low = u32(parameter_at(first + 2u * word, i));
        let high = u32(parameter_at(first + 2u * word + 1u, i));
        rate[word] = low | (high << 16u);
    }
    return rate;
}

// The phase after `ticks`, in turns in [-1/2, 1/2].
fn turns(rate: vec4<u32>, ticks: vec2<u32>) -> real {
    var phase = product_128(rate, ticks.x);
    phase = add_product(phase, rate.x, ticks.y, 1u);
    phase = add_product(phase, rate.y, ticks.y, 2u);
    phase = add_product(phase, rate.z, ticks.y, 3u);
    let upper = real(bitcast<i32>(phase.w)) * (1.0 / 4294967296.0);
    if (WORDS == 2u) {
        return upper;
    }
    return mul_add(real(phase.z), 1.0 / 18446744073709551616.0, upper);
}

// A phase in turns, within [-1/2, 1/2]; the rate's digits are in columns from `first`, its rounded value after them.
fn phase(first: u32, i: u32, instant: Instant) -> real {
    let start = turns(rate_at(first, i), instant.ticks);
    let advanced = mul_add(parameter_at(first + RATE_DIGITS, i), instant.elapsed, start);
    return advanced - round(advanced);
}
