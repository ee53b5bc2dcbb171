// variable-inertia: principal moments that change in time. Twin: src/torque/variable_inertia.rs, which describes the laws.

// Ticks from the start of a ramp to `ticks`, rounded; negative before it.
fn ticks_since(ticks: vec2<u32>, start: vec2<u32>) -> real {
    let low = ticks.x - start.x;
    let high = ticks.y - start.y - select(0u, 1u, ticks.x < start.x);
    return mul_add(real(bitcast<i32>(high)), 4294967296.0, real(low));
}

// u, clamped to [0, 1], `elapsed` seconds after it was `start`.
fn ramp_progress(start: real, per_second: real, elapsed: real) -> real {
    return min(max(mul_add(per_second, elapsed, start), 0.0), 1.0);
}

// The polynomial of degree 13 that rises from 0 to 1 with six vanishing derivatives at both ends.
fn inertia_ramp(progress: real) -> real {
    let u = progress;
    let w = 1.0 - u;
    var sum: real = 924.0;
    sum = mul_add(sum, w, 462.0);
    sum = mul_add(sum, w, 210.0);
    sum = mul_add(sum, w, 84.0);
    sum = mul_add(sum, w, 28.0);
    sum = mul_add(sum, w, 7.0);
    sum = mul_add(sum, w, 1.0);
    let cube = u * u * u;
    return cube * cube * u * sum;
}

// (1 - cos 2 pi x)/2 at a phase x in turns.
fn inertia_oscillation(phase: real) -> real {
    let angle = sin_cos((phase * 0.5) * TAU);
    return angle.sin * angle.sin;
}

// The change of a body's moments, from its columns.
struct Change {
    // I0/I1, axis by axis.
    kappa: vector,
    // 1/I1 - 1/I0.
    difference: TwoWordsVector,
}

// A body during the change.
struct Changed {
    body: Body,
    // I0/I, to a few roundings.
    ratio: vector,
}

// How far the moments have changed at a time.
struct ChangeAt {
    // The part of each reciprocal moment's change that is done.
    share: vector,
    // The increase of the differences I3 - I2, I1 - I3, I2 - I1.
    gained: vector,
}

// The part of each reciprocal moment's change that is done when the part `done` of the moments' change is, and 1 at the end.
fn change_share(change: Change, done: real) -> vector {
    let ones = vector(1.0, 1.0, 1.0);
    let part_done = ones * done;
    let part_left = ones * (1.0 - done);
    return select(ones, part_done / fma(change.kappa, part_left, part_done), done < 1.0);
}

// The increase of the differences of moments for the relative increase `share` of their reciprocals.
fn gained_differences(moments: vector, share: vector) -> vector {
    let lost = moments * share / (vector(1.0, 1.0, 1.0) + share);
    return vector(lost.y - lost.z, lost.z - lost.x, lost.x - lost.y);
}

fn changed_body(body: Body, change: Change, done: real) -> Changed {
    return changed_by(body, change, change_share(change, done));
}

fn changed_by(body: Body, change: Change, share: vector) -> Changed {
    let ones = vector(1.0, 1.0, 1.0);
    let ratio = fma(change.kappa - ones, share, ones);
    let value = body.inverse_moments.value;
    let residue = body.inverse_moments.residue;
    if (WORDS == 1u) {
        let difference = change.difference.value + change.difference.residue;
        return Changed(body_new(TwoWordsVector(fma(difference, share, value), residue)), ratio);
    }
    let part = rounded_vector(change.difference.value * share);
    let sum = two_difference(value, -part);
    let lost = sum.residue + fma(change.difference.residue, share, residue);
    return Changed(body_new(TwoWordsVector(sum.value, lost)), ratio);
}
