// Kepler's equation. Twin: src/math/kepler.rs, which describes the iteration.

// Sine and cosine of E with E - e sin E = M; the iterations are unrolled because of the bound on loops in
// src/engine/gpu/dispatch.rs.
fn eccentric_anomaly(mean_anomaly: real, eccentricity: real) -> SinCos {
    // On a circle the iterations below change nothing, to the bit.
    if eccentricity == 0.0 {
        return sin_cos(mean_anomaly);
    }
    let start = 0.85 * eccentricity;
    var anomaly = mean_anomaly + select(start, -start, mean_anomaly < 0.0);
    if eccentricity > 0.9 {
        anomaly += anomaly_change(anomaly, mean_anomaly, eccentricity).change;
    }
    if eccentricity > 0.4 {
        anomaly += anomaly_change(anomaly, mean_anomaly, eccentricity).change;
    }
    anomaly += anomaly_change(anomaly, mean_anomaly, eccentricity).change;
    let last = anomaly_change(anomaly, mean_anomaly, eccentricity);
    // 1 - cos and the sine of the change.
    let square = last.change * last.change;
    let short = mul_add(square * square, real(-1.0 / 24.0), 0.5 * square);
    let turn = mul_add(square * last.change, real(-1.0 / 6.0), last.change);
    return SinCos(last.sin + mul_add(-last.sin, short, last.cos * turn), last.cos - mul_add(last.cos, short, last.sin * turn));
}

struct AnomalyChange {
    change: real,
    sin: real,
    cos: real,
}

// The change of E by one iteration, and the sine and cosine of E before it.
fn anomaly_change(anomaly: real, mean_anomaly: real, eccentricity: real) -> AnomalyChange {
    let angle = sin_cos(anomaly);
    let e_sin = eccentricity * angle.sin;
    let e_cos = eccentricity * angle.cos;
    let excess = (anomaly - mean_anomaly) - e_sin;
    let slope = 1.0 - e_cos;
    let square = slope * slope;
    let bend = excess * e_sin;
    let above = excess * mul_add(real(0.5), -bend, square);
    let below = mul_add(slope, square - bend, excess * excess * (real(1.0 / 6.0) * e_cos));
    return AnomalyChange(-(above / below), angle.sin, angle.cos);
}
