// linear-drag: -c omega. Twin: src/torque/linear_drag.rs.

fn linear_drag(coefficient: real, angular_velocity_principal: vector) -> vector {
    return -(angular_velocity_principal * coefficient);
}
