// Exact time and phases that advance with it. Twin: src/math/clock.rs, which describes them. The phase at an instant, one
// function here, is phases_at at the start of a step and phase_after from there on.

// Number of 16-bit digits in which columns store a rate, lowest first.
const RATE_DIGITS: u32 = 8u;

struct Instant {
    // Whole ticks from the initial state to the start of the step, low word first.
    ticks: vec2<u32>,
    // Time since the start of the step, s.
    elapsed: real,
}

// No loops here: see the bound on iterations in src/engine/gpu/dispatch.rs.

// a + b with a carry in, as sum and carry out.
fn add_with_carry(a: u32, b: u32, carry: u32) -> vec2<u32> {
    let partial = a + b;
    let sum = partial + carry;
    return vec2<u32>(sum, select(0u, 1u, partial < a) + select(0u, 1u, sum < partial));
}

// a + b modulo 2^128.
fn sum_128(a: vec4<u32>, b: vec4<u32>) -> vec4<u32> {
    let x = add_with_carry(a.x, b.x, 0u);
    let y = add_with_carry(a.y, b.y, x.y);
    let z = add_with_carry(a.z, b.z, y.y);
    return vec4<u32>(x.x, y.x, z.x, a.w + b.w + z.y);
}

// a n modulo 2^128.
fn product_128(a: vec4<u32>, n: u32) -> vec4<u32> {
    let x = wide_product(a.x, n);
    let y = wide_product(a.y, n);
    let z = wide_product(a.z, n);
    return sum_128(vec4<u32>(x.x, y.x, z.x, a.w * n), vec4<u32>(0u, x.y, y.y, z.y));
}

// The rate in columns `first` to `first` + 7 of body i, in units of 2^-128 turn per tick.
fn rate_at(first: u32, i: u32) -> vec4<u32> {
    return vec4<u32>(
        rate_word(first, i), rate_word(first + 2u, i), rate_word(first + 4u, i), rate_word(first + 6u, i));
}

fn rate_word(first: u32, i: u32) -> u32 {
    return u32(parameter_at(first, i)) | (u32(parameter_at(first + 1u, i)) << 16u);
}

// The phase after `ticks`, in turns in [-1/2, 1/2].
fn turns(rate: vec4<u32>, ticks: vec2<u32>) -> real {
    let high = product_128(rate, ticks.y);
    let phase = sum_128(product_128(rate, ticks.x), vec4<u32>(0u, high.xyz));
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
