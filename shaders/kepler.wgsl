// Kepler's equation. Twin: src/torque/orbit.rs, where the iteration is described.

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
