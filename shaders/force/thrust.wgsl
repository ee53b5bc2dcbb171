// thrust: a force fixed in the body, through its centre of mass. Twin: src/torque/force/thrust.rs.

// R F/M, m/s^2, world axes, of F/M in the axes that `orientation` rotates to world.
fn thrust_acceleration(thrust: vector, orientation: quaternion) -> vector {
    return rotate(orientation, thrust);
}
