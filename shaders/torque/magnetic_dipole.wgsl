// magnetic-dipole: a magnet in a uniform field, m' x R^T d. Twin: src/torque/magnetic_dipole.rs.

fn magnetic_dipole(moment_principal: vector, direction_world: vector, orientation: quaternion) -> vector {
    return cross_vector(moment_principal, rotate_inverse(orientation, direction_world));
}
