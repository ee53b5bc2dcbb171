// Projection of a torque-free body's state onto what it conserves, after each step. Twin: src/kernel/method/projection.rs, which
// describes the method.

// What a free body conserves, from its initial state.
struct Combinations {
    // g2 m1^2 - g1 m2^2, not negative.
    first_second: real,
    // g2 m3^2 - g3 m2^2, not negative.
    second_third: real,
    // g3 m1^2 - g1 m3^2.
    first_third: real,
}

var<private> kept: Combinations;

// Loads the combinations, whose columns follow the body's own and those of its invariants.
fn load_combinations(i: u32) {
    let first = 4u + 3u * (WORDS - 1u) + 2u;
    kept = Combinations(parameter_at(first, i), parameter_at(first + 1u, i), parameter_at(first + 2u, i));
}

// The state with its angular momentum projected; components whose formula has no divisor stay as they are.
fn projected(body: Body, state: State) -> State {
    let p = -body.gyroscopic.value.x;
    let q = body.gyroscopic.value.y;
    let r = -body.gyroscopic.value.z;
    let m = state.angular_momentum_principal.value;
    let x2 = m.x * m.x;
    let y2 = m.y * m.y;
    let z2 = m.z * m.z;
    let first_second = kept.first_second;
    let second_third = kept.second_third;
    let first_third = kept.first_third;

    let spins_about_middle = 0.5 * first_second < p * y2;
    let keeps_third = spins_about_middle && first_third < 0.0;
    let keeps_first = spins_about_middle && !(first_third < 0.0);

    let x_of_z = root(m.x, p * z2 - first_third, r);
    let x_of_y = root(m.x, first_second - p * y2, q);
    let y_of_x = root(m.y, first_second - q * x2, p);
    let y_of_z = root(m.y, second_third - q * z2, r);
    let z_of_x = root(m.z, first_third + r * x2, p);
    let z_of_y = root(m.z, second_third - r * y2, q);
    let x = select(select(x_of_y, x_of_z, keeps_third), m.x, keeps_first);
    let y = select(select(m.y, y_of_z, keeps_third), y_of_x, keeps_first);
    let z = select(select(z_of_y, m.z, keeps_third), z_of_x, keeps_first);
    let residue = state.angular_momentum_principal.residue;
    return State(state.orientation, TwoWordsVector(vector(x, y, z), residue), state.status);
}

// The square root of numerator/divisor with the sign of `old`; `old` if the divisor is zero.
fn root(old: real, numerator: real, divisor: real) -> real {
    let usable = 0.0 < divisor;
    let size = sqrt(max(numerator, 0.0) / select(real(1.0), divisor, usable));
    return select(old, select(size, -size, old < 0.0), usable);
}
