// splitting2, splitting4, splitting6: kicks by the torque between free flows. Twin: src/kernel/method/splitting.rs, which describes the
// methods. The order and the ends of the substeps are in splitting2.wgsl, splitting4.wgsl or splitting6.wgsl.

struct Prepared {
    modification: Modification,
    free: Body,
}

fn prepare(body: Body, invariants: Invariants, dt: TwoWordsReal) -> Prepared {
    let modification = modification_new(body);
    return Prepared(modification, modified(modification, body, dt.value, invariants));
}

fn step(body: Body, prepared: Prepared, step_index: u32, dt: TwoWordsReal, initial: State) -> State {
    if (FREE) {
        return drift(prepared.free, dt, initial);
    }
    var state = initial;
    var kicked: real = 0.0;
    var drifted: real = 0.0;
    for (var i = 0u; i < kick_count(); i += 1u) {
        let time = epoch(step_index, drifted);
        state = kick(body, time, part_of(dt, kicked, kick_end(i)), state, ORDER);
        kicked = kick_end(i);
        if (i < drift_count()) {
            let h = part_of(dt, drifted, drift_end(i));
            state = drift(modified_at(prepared.modification, body, h.value, state), h, state);
            drifted = drift_end(i);
        }
    }
    return state;
}

// The part of dt between two fractions of it, so that parts with common ends add up to the whole exactly.
fn part_of(dt: TwoWordsReal, start: real, end: real) -> TwoWordsReal {
    if (WORDS == 1u) {
        return TwoWordsReal(dt.value * (end - start), 0.0);
    }
    let a = rounded(dt.value * end);
    let b = rounded(dt.value * start);
    let part = two_difference(vector(a, a, a), vector(b, b, b));
    return TwoWordsReal(part.value.x, mul_add(dt.residue, end - start, part.residue.x));
}
