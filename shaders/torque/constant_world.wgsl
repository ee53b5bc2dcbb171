// constant-world: a torque that is constant in world axes. Twin: src/torque/constant_world.rs.

fn constant_world(torque_world: vector, orientation: quaternion) -> vector {
    return rotate_inverse(orientation, torque_world);
}
