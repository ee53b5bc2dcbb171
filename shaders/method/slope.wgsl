// What the Runge-Kutta methods on (q, m) share: rates, and dt/6. Twin: src/kernel/method/slope.rs.

struct Slope {
    q: quaternion,
    m: vector,
}

// dq/dt and dm/dt.
fn rates(body: Body, epoch: Epoch, correction: Correction, q: quaternion, m: vector) -> Slope {
    let motion = motion(epoch, body, correction, m);
    var m_rate = motion.gyroscopic_term;
    if (!FREE) {
        m_rate = m_rate + torque(epoch, body, q, motion.angular_velocity);
    }
    return Slope(orientation_rate(q, motion.axes_rate), m_rate);
}

// dt/6 rounded, and the difference between dt and six times that. Both subtractions are exact.
fn sixth_of(dt: TwoWordsReal) -> TwoWordsReal {
    let sixth = rounded(dt.value * (1.0 / 6.0));
    if (WORDS == 1u) {
        return TwoWordsReal(sixth, 0.0);
    }
    let lacking = rounded(dt.value - 4.0 * sixth) - 2.0 * sixth;
    return TwoWordsReal(sixth, lacking + dt.residue);
}
