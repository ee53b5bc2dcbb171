// Positions on a Kepler orbit. Twin: src/torque/orbit.rs, where the iteration is described.

struct Place {
    // Unit vector from the centre, world axes.
    direction_world: vector,
    // Semi-major axis over distance.
    inverse_distance: real,
}

fn circular_place(x_world: vector, y_world: vector, phase: real) -> vector {
    let angle = sin_cos(phase * TAU);
    return axpy_vector(x_world, angle.cos, y_world * angle.sin);
}

fn kepler_place(x_world: vector, y_world: vector, eccentricity: real, phase: real) -> Place {
    let anomaly = eccentric_anomaly(phase * TAU, eccentricity);
    let inverse_distance = 1.0 / (1.0 - eccentricity * anomaly.cos);
    let minor = sqrt(1.0 - eccentricity * eccentricity);
    let x = (anomaly.cos - eccentricity) * inverse_distance;
    let y = minor * anomaly.sin * inverse_distance;
    return Place(axpy_vector(x_world, x, y_world * y), inverse_distance);
}

// Sine and cosine of E with E - e sin E = M; the iterations are written out for the bound on loops in
// src/engine/gpu/dispatch.rs.
fn eccentric_anomaly(mean_anomaly: real, eccentricity: real) -> SinCos {
    let start = 0.85 * eccentricity;
    var anomaly = mean_anomaly + select(start, -start, mean_anomaly < 0.0);
    anomaly = nearer_anomaly(anomaly, mean_anomaly, eccentricity);
    anomaly = nearer_anomaly(anomaly, mean_anomaly, eccentricity);
    anomaly = nearer_anomaly(anomaly, mean_anomaly, eccentricity);
    anomaly = nearer_anomaly(anomaly, mean_anomaly, eccentricity);
    return sin_cos(anomaly);
}

// One iteration.
fn nearer_anomaly(anomaly: real, mean_anomaly: real, eccentricity: real) -> real {
    let angle = sin_cos(anomaly);
    let e_sin = eccentricity * angle.sin;
    let e_cos = eccentricity * angle.cos;
    let excess = (anomaly - mean_anomaly) - e_sin;
    let slope = 1.0 - e_cos;
    let first = -(excess / slope);
    let second = -(excess / mul_add(0.5 * first, e_sin, slope));
    let sixth = real(1.0 / 6.0);
    let third = -(excess / mul_add(sixth * second * second, e_cos, mul_add(0.5 * second, e_sin, slope)));
    return anomaly + third;
}

// u x I u with u = R^T direction_world; the coefficients hold the differences of the moments.
fn gradient_torque(coefficients: vector, direction_world: vector, orientation: quaternion) -> vector {
    let u = rotate_inverse(orientation, direction_world);
    return coefficients * (u.yzx * u.zxy);
}
