// matrix-drag: -C omega, C by its diagonal and its elements yx, zx, zy. Twin: src/torque/matrix_drag.rs.

fn matrix_drag(diagonal: vector, off_diagonal: vector, angular_velocity_principal: vector) -> vector {
    let d = diagonal;
    let o = off_diagonal;
    let w = angular_velocity_principal;
    return -vector(
        mul_add(d.x, w.x, mul_add(o.x, w.y, o.y * w.z)),
        mul_add(o.x, w.x, mul_add(d.y, w.y, o.z * w.z)),
        mul_add(o.y, w.x, mul_add(o.z, w.y, d.z * w.z)),
    );
}
