// gravity-gradient on a circular orbit. Twin: src/torque/gravity_gradient.rs.

fn gravity_gradient(
    coefficients: vector,
    x_world: vector,
    y_world: vector,
    phase: real,
    orientation: quaternion,
) -> vector {
    return gradient_torque(coefficients, circular_place(x_world, y_world, phase), orientation);
}
