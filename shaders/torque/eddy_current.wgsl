// eddy-current: k' (omega x d) x d, d the field's direction. Twin: src/torque/eddy_current.rs.

fn eddy_current(
    coefficient: real,
    direction_world: vector,
    orientation: quaternion,
    angular_velocity_principal: vector,
) -> vector {
    let direction = rotate_inverse(orientation, direction_world);
    return cross_vector(cross_vector(angular_velocity_principal, direction), direction) * coefficient;
}
