// log-spring: -k theta n towards an attitude. Twin: src/torque/log_spring.rs, where the series is described.

fn log_spring(stiffness: real, spring_target: quaternion, orientation: quaternion) -> vector {
    let between = product(conjugate(spring_target), orientation);
    return between.xyz * (-(stiffness * angle_ratio(between)));
}

// theta n = angle_ratio v for the rotation (v, s), with the sign of s.
fn angle_ratio(between: quaternion) -> real {
    let v2 = dot_vector(between.xyz, between.xyz);
    // Halved once: |v| / (|q| + |s|), the tangent of theta/4, at most 1.
    let norm = sqrt(norm_squared(between));
    let divisor = norm + abs(between.w);
    let quarter_squared = v2 / (divisor * divisor);
    // Twice: the tangent of theta/8, at most 0.415; three times: of theta/16, at most 0.199.
    let eighth_divisor = 1.0 + sqrt(1.0 + quarter_squared);
    let eighth_squared = quarter_squared / (eighth_divisor * eighth_divisor);
    let sixteenth_divisor = 1.0 + sqrt(1.0 + eighth_squared);
    let x2 = eighth_squared / (sixteenth_divisor * sixteenth_divisor);
    let ratio = 16.0 * arctangent_series(x2) / (divisor * eighth_divisor * sixteenth_divisor);
    return select(ratio, -ratio, between.w < 0.0);
}
