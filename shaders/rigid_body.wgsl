// Euler's equations of a rigid body in its principal axes. Twin: src/kernel/rigid_body.rs.

struct Body {
    // 1/I1, 1/I2, 1/I3 in units of the body's own scale.
    inverse_moments: TwoWordsVector,
    // 1/I3 - 1/I2, 1/I1 - 1/I3, 1/I2 - 1/I1: the coefficients of the gyroscopic term.
    gyroscopic: TwoWordsVector,
}

struct State {
    // Principal axes to world.
    orientation: TwoWordsQuaternion,
    // m = I omega, in units of the body's own scale.
    angular_momentum_principal: TwoWordsVector,
    // 0 until a step fails on this body, then the number of the first failure (src/bodies/status.rs).
    status: real,
}

// What a torque-free body conserves, from its initial state.
struct Invariants {
    // |m|^2.
    angular_momentum_squared: real,
    // m . omega / 2.
    kinetic_energy: real,
}

// The contribution of the second words of parameters and state to the rates, formed once per step.
struct Correction {
    angular_velocity: vector,
    gyroscopic_term: vector,
}

fn body_new(inverse_moments: TwoWordsVector) -> Body {
    let a = inverse_moments.value;
    let b = inverse_moments.residue;
    let difference = two_difference(a.zxy, a.yzx);
    return Body(inverse_moments, TwoWordsVector(difference.value, difference.residue + (b.zxy - b.yzx)));
}

// Rounded: otherwise drivers factor out what value and residue share before the sum, value + residue rounds to value, and the correction is
// lost.
fn correction(body: Body, state: State) -> Correction {
    if (WORDS == 1u) {
        return Correction(vector(0.0, 0.0, 0.0), vector(0.0, 0.0, 0.0));
    }
    let m = state.angular_momentum_principal;
    return Correction(
        rounded_vector(fma(body.inverse_moments.value, m.residue, body.inverse_moments.residue * m.value)),
        rounded_vector(body.gyroscopic.residue * pair_products(m.value)),
    );
}

// The correction for `changed`, whose 1/I is `ratio` times that of `start`, from the correction for `start` at about the same m. It
// includes the residue of m.
fn carried_correction(changed: Body, start: Body, correction: Correction, ratio: vector, m: vector) -> Correction {
    if (WORDS == 1u) {
        return correction;
    }
    let of_m = correction.angular_velocity - rounded_vector(start.inverse_moments.residue * m);
    return Correction(
        rounded_vector(fma(ratio, of_m, changed.inverse_moments.residue * m)),
        rounded_vector(changed.gyroscopic.residue * pair_products(m)),
    );
}

// omega = m / I.
fn angular_velocity(body: Body, m: vector, correction: Correction) -> vector {
    return fma(body.inverse_moments.value, m, correction.angular_velocity);
}

// m x omega.
fn gyroscopic_term(body: Body, m: vector, correction: Correction) -> vector {
    return fma(body.gyroscopic.value, pair_products(m), correction.gyroscopic_term);
}

// m . omega / 2.
fn kinetic_energy(body: Body, m: vector) -> real {
    return 0.5 * dot_vector(m, body.inverse_moments.value * m);
}

// (m2 m3, m3 m1, m1 m2).
fn pair_products(m: vector) -> vector {
    return m.yzx * m.zxy;
}

// dq/dt = q omega / 2.
fn orientation_rate(q: quaternion, angular_velocity: vector) -> quaternion {
    return product_vector(q, angular_velocity * 0.5);
}

// L = R m, the angular momentum in world axes.
fn angular_momentum_world(q: quaternion, m: vector) -> vector {
    return rotate(q, m);
}
