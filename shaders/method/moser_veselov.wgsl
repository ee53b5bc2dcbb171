// The free flow of the splittings: the preprocessed discrete Moser-Veselov step of order 6. Twin:
// src/kernel/method/moser_veselov.rs, which describes it.

struct Modification {
    scale_c: real,
    scale_h: real,
    scale_cc: real,
    scale_ch: real,
    scale_hh: real,
    shift_c: real,
    shift_h: real,
    shift_cc: real,
    shift_ch: real,
    shift_hh: real,
}

fn modification_new(body: Body) -> Modification {
    let b = body.inverse_moments.value;
    let moments = vector(1.0 / b.x, 1.0 / b.y, 1.0 / b.z);
    let sum = moments.x + moments.y + moments.z;
    let inverse_sum = b.x + b.y + b.z;
    let squares = dot_vector(moments, moments);
    let inverse_squares = dot_vector(b, b);
    let inverse_product = b.x * b.y * b.z;
    let ratios = sum * inverse_sum - 3.0;
    return Modification(
        sum * inverse_product * (1.0 / 6.0),
        -(inverse_sum * (1.0 / 3.0)),
        (squares * inverse_product - inverse_sum) * inverse_product * (1.0 / 30.0),
        (1.0 - ratios) * inverse_product * (1.0 / 30.0),
        (3.0 * sum * inverse_product + 2.0 * inverse_squares) * (1.0 / 60.0),
        -(inverse_product * (1.0 / 3.0)),
        sum * inverse_product * (1.0 / 6.0),
        -(sum * inverse_product * inverse_product * (1.0 / 60.0)),
        (6.0 * inverse_sum - squares * inverse_product) * inverse_product * (1.0 / 60.0),
        -((9.0 + ratios) * inverse_product * (1.0 / 60.0)),
    );
}

// The body with the moments changed for steps of h at these invariants.
fn modified(m: Modification, body: Body, h: real, invariants: Invariants) -> Body {
    let c = h * h * (invariants.angular_momentum_squared * 0.5);
    let e = h * h * invariants.kinetic_energy;
    let scale_quadratic = mul_add(m.scale_cc, c * c, mul_add(m.scale_ch, c * e, m.scale_hh * (e * e)));
    let scale = mul_add(m.scale_c, c, mul_add(m.scale_h, e, scale_quadratic));
    let shift_quadratic = mul_add(m.shift_cc, c * c, mul_add(m.shift_ch, c * e, m.shift_hh * (e * e)));
    let shift = mul_add(m.shift_c, c, mul_add(m.shift_h, e, shift_quadratic));
    let shifts = vector(shift, shift, shift);
    return Body(
        accumulate_vector(body.inverse_moments, axpy_vector(body.inverse_moments.value, scale, shifts)),
        accumulate_vector(body.gyroscopic, body.gyroscopic.value * scale),
    );
}

// The body with the moments changed for steps of h from `state`.
fn modified_at(modification: Modification, body: Body, h: real, state: State) -> Body {
    let m = state.angular_momentum_principal.value;
    return modified(modification, body, h, Invariants(dot_vector(m, m), kinetic_energy(body, m)));
}

// The free flow over h, where `modified` is the body with the moments changed for h.
fn drift(modified: Body, h: TwoWordsReal, state: State) -> State {
    let c = correction(modified, state);
    let solved = solve_discrete(modified, c, h.value, state.angular_momentum_principal.value);

    let norm = sqrt(1.0 + solved.excess);
    let part = solved.excess / (norm * (1.0 + norm));
    let q = state.orientation.value;
    let q_increment = cayley_increment(q, solved.angular_velocity, h, part * norm, -part) + norm_correction(q);
    let g = solved.gyroscopic_term;
    let m_increment = axpy_vector(g, h.value, rounded_vector(g * mul_add(solved.excess, h.value, h.residue)));

    let inverse = modified.inverse_moments.value;
    let least = min(inverse.x, min(inverse.y, inverse.z));
    let too_long = solved.beyond || !(0.0 < least);
    let status = flagged(state.status, too_long, STEP_TOO_LONG);
    return State(
        accumulate_quaternion(state.orientation, q_increment),
        accumulate_vector(state.angular_momentum_principal, m_increment),
        flagged(status, solved.unsolved, NOT_CONVERGED),
    );
}
