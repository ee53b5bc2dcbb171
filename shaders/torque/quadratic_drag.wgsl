// quadratic-drag: -c |omega| omega. Twin: src/torque/quadratic_drag.rs.

fn quadratic_drag(coefficient: real, angular_velocity_principal: vector) -> vector {
    let speed = sqrt(dot_vector(angular_velocity_principal, angular_velocity_principal));
    return -(angular_velocity_principal * (coefficient * speed));
}
