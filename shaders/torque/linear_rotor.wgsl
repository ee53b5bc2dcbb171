// What a linear rotor does not take of a torque. Twin: src/torque/linear_rotor.rs.

fn across_axis(factor: real, torque: vector) -> vector {
    return vector(factor * torque.x, torque.y, torque.z);
}
