// No torque. Twin: Free in src/torque/mod.rs.

const FREE: bool = true;

struct Epoch {
    unused: u32,
}

fn epoch(step: u32, fraction: real) -> Epoch {
    return Epoch(0u);
}

fn torque(epoch: Epoch, body: Body, orientation: quaternion, angular_velocity_principal: vector) -> vector {
    return vector(0.0, 0.0, 0.0);
}
