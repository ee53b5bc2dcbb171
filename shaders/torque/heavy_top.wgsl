// heavy-top: gravity about a fixed pivot, c' x R^T d. Twin: src/torque/heavy_top.rs.

fn heavy_top(moment_principal: vector, direction_world: vector, orientation: quaternion) -> vector {
    return cross_vector(moment_principal, rotate_inverse(orientation, direction_world));
}
