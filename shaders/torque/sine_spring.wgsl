// sine-spring: -2 k s v towards an attitude. Twin: src/torque/sine_spring.rs.

fn sine_spring(stiffness: real, spring_target: quaternion, orientation: quaternion) -> vector {
    let between = product(conjugate(spring_target), orientation);
    return between.xyz * (-2.0 * stiffness * between.w);
}
