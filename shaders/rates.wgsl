// Entry points: as many multiply-adds and copies as a device can do. `real` is an alias that precedes this text. Twin:
// src/engine/gpu/rates.rs, which times them.

// A factor, an addend, the number of iterations and the number of invocations, then numbers.
@group(0) @binding(0) var<storage, read> source: array<real>;
@group(0) @binding(1) var<storage, read_write> results: array<real>;

// Four links of a chain: enough that the loop's own operations do not show.
fn fused_links(x: vec4<real>, factor: vec4<real>, addend: vec4<real>) -> vec4<real> {
    return fma(fma(fma(fma(x, factor, addend), factor, addend), factor, addend), factor, addend);
}

fn separate_links(x: vec4<real>, factor: vec4<real>, addend: vec4<real>) -> vec4<real> {
    return (((x * factor + addend) * factor + addend) * factor + addend) * factor + addend;
}

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
        a = fused_links(a, factor, addend); b = fused_links(b, factor, addend);
        c = fused_links(c, factor, addend); d = fused_links(d, factor, addend);
        e = fused_links(e, factor, addend); f = fused_links(f, factor, addend);
        g = fused_links(g, factor, addend); h = fused_links(h, factor, addend);
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
        a = separate_links(a, factor, addend); b = separate_links(b, factor, addend);
        c = separate_links(c, factor, addend); d = separate_links(d, factor, addend);
        e = separate_links(e, factor, addend); f = separate_links(f, factor, addend);
        g = separate_links(g, factor, addend); h = separate_links(h, factor, addend);
    }
    let sum = a + b + c + d + e + f + g + h;
    results[id.x] = sum.x + sum.y + sum.z + sum.w;
}

// Every invocation copies its share with the stride of all, as kernels do; four numbers are on their way at a time.
@compute @workgroup_size(64)
fn copy(@builtin(global_invocation_id) id: vec3<u32>) {
    let invocations = u32(source[3]);
    let count = arrayLength(&source);
    for (var i = id.x; i < count; i += 4u * invocations) {
        let j = i + invocations;
        let k = j + invocations;
        let l = k + invocations;
        let numbers = vec4<real>(source[i], source[j], source[k], source[l]);
        results[i] = numbers.x;
        results[j] = numbers.y;
        results[k] = numbers.z;
        results[l] = numbers.w;
    }
}
