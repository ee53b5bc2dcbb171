// Entry point: tests an adapter's arithmetic, row by row of a table. Twin: `expected` in src/engine/gpu/probe.rs.
// Columns of `operands`: a, b, c; columns of `results` in the order of the stores below.

struct Settings {
    count: u32,
    // Always 0, which no compiler knows.
    zero: u32,
}

@group(0) @binding(0) var<uniform> settings: Settings;
@group(0) @binding(1) var<storage, read> operands: array<real>;
@group(0) @binding(2) var<storage, read_write> results: array<real>;

// The rounding error of a + b, as in textbooks (Knuth, TAOCP vol. 2, 4.2.2, theorem B).
fn two_sum_residue_plain(a: real, b: real) -> real {
    let sum = a + b;
    let b_taken = sum - a;
    let a_taken = sum - b_taken;
    return (a - a_taken) + (b - b_taken);
}

// The same with every rounded intermediate behind the barrier.
fn two_sum_residue(a: real, b: real) -> real {
    let sum = separated(a + b);
    let b_taken = separated(sum - a);
    let a_taken = separated(sum - b_taken);
    return separated(a - a_taken) + separated(b - b_taken);
}

@compute @workgroup_size(64)
fn probe(@builtin(global_invocation_id) id: vec3<u32>) {
    let i = id.x;
    let n = settings.count;
    if (i >= n) {
        return;
    }
    let a = operands[i];
    let b = operands[n + i];
    let c = operands[2u * n + i];
    results[i] = a + b;
    results[n + i] = a * b;
    results[2u * n + i] = two_sum_residue_plain(a, b);
    results[3u * n + i] = two_sum_residue(a, b);
    results[4u * n + i] = a / b;
    results[5u * n + i] = sqrt(abs(a));
    results[6u * n + i] = fma(a, b, c);
    results[7u * n + i] = a * b + c;
}
