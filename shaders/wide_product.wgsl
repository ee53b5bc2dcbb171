// The product of two words. Twin: none, as the host multiplies numbers of 64 and of 128 bits (src/math/clock.rs, src/math/phase.rs).

// a b, exactly, as low and high word, from products of 16 bits.
fn wide_product(a: u32, b: u32) -> vec2<u32> {
    let a0 = a & 0xffffu;
    let a1 = a >> 16u;
    let b0 = b & 0xffffu;
    let b1 = b >> 16u;
    let low = a0 * b0;
    // At most (2^16 - 1)^2 + 2 (2^16 - 1) = 2^32 - 1.
    let first = a1 * b0 + (low >> 16u);
    let second = a0 * b1 + (first & 0xffffu);
    return vec2<u32>((low & 0xffffu) | (second << 16u), a1 * b1 + (first >> 16u) + (second >> 16u));
}
