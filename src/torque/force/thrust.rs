//! `thrust`: a force fixed in the body, through its centre of mass. Twin: `shaders/force/thrust.wgsl`.

use glam::{DQuat, DVec3};

/// R F/M, m/s², world axes, of F/M in body axes and an orientation (body to world).
pub fn acceleration(thrust_body: DVec3, orientation: DQuat) -> DVec3 {
    if thrust_body == DVec3::ZERO { DVec3::ZERO } else { orientation * thrust_body }
}
