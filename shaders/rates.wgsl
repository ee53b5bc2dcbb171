// Entry points: as many multiply-adds and copies as a device can do. `real` is an alias that precedes this text. Twin:
// src/engine/gpu/rates.rs, which times them.

// A factor, an addend and the number of iterations, then numbers.
@group(0) @binding(0) var<storage, read> source: array<real>;
@group(0) @binding(1) var<storage, read_write> results: array<real>;

// Number of invocations of a dispatch.
const INVOCATIONS: u32 = 65536u;

// Eight independent chains of four lanes with `fma`, which adapters without the instruction emulate at great cost.
@compute @workgroup_size(64)
fn fused(@builtin(global_invocation_id) id: vec3<u32>) {
    let factor = vec4<real>(source[0]);
    let addend = vec4<real>(source[1]);
    var a = vec4<real>(source[id.x]);
    var b = a + addend; var c = b + addend; var d = c + addend;
    var e = d + addend; var f = e + addend; var g = f + addend; var h = g + addend;
    let iterations = u32(source[2]);
    for (var i = 0u; i < iterations; i += 1u) {
        a = fma(a, factor, addend); b = fma(b, factor, addend); c = fma(c, factor, addend); d = fma(d, factor, addend);
        e = fma(e, factor, addend); f = fma(f, factor, addend); g = fma(g, factor, addend); h = fma(h, factor, addend);
    }
    let sum = a + b + c + d + e + f + g + h;
    results[id.x] = sum.x + sum.y + sum.z + sum.w;
}

// The same with a product and a sum, which compilers may fuse.
@compute @workgroup_size(64)
fn separate(@builtin(global_invocation_id) id: vec3<u32>) {
    let factor = vec4<real>(source[0]);
    let addend = vec4<real>(source[1]);
    var a = vec4<real>(source[id.x]);
    var b = a + addend; var c = b + addend; var d = c + addend;
    var e = d + addend; var f = e + addend; var g = f + addend; var h = g + addend;
    let iterations = u32(source[2]);
    for (var i = 0u; i < iterations; i += 1u) {
        a = a * factor + addend; b = b * factor + addend; c = c * factor + addend; d = d * factor + addend;
        e = e * factor + addend; f = f * factor + addend; g = g * factor + addend; h = h * factor + addend;
    }
    let sum = a + b + c + d + e + f + g + h;
    results[id.x] = sum.x + sum.y + sum.z + sum.w;
}

// Every invocation copies its share with the stride of all, as kernels do.
@compute @workgroup_size(64)
fn copy(@builtin(global_invocation_id) id: vec3<u32>) {
    for (var i = id.x; i < arrayLength(&source); i += INVOCATIONS) {
        results[i] = source[i];
    }
}
