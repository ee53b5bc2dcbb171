// quadratic-drag: a force against the velocity, proportional to its square. Twin: src/torque/force/quadratic_drag.rs.

// -k |v| v, m/s^2.
fn quadratic_drag_acceleration(coefficient: real, velocity: vector) -> vector {
    return velocity * (-coefficient * sqrt(dot_vector(velocity, velocity)));
}

// The rate (1/s) at which the velocity responds, driven by an acceleration of size `driving`.
fn quadratic_drag_rate(coefficient: real, velocity: vector, driving: real) -> real {
    return 2.0 * coefficient * sqrt(dot_vector(velocity, velocity)) + sqrt(coefficient * driving);
}
