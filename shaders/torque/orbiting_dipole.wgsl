// orbiting-dipole: a magnet in a planet's tilted dipole field along an orbit. Twin: src/torque/orbiting_dipole.rs.

struct DipoleField {
    // Towards the pericentre, world axes.
    x_world: vector,
    // At right angles to it in the direction of motion, world axes.
    y_world: vector,
    eccentricity: real,
    // Mean anomaly at t = 0, turns.
    start: real,
    // Of the dipole's angle from the z axis.
    sin_tilt: real,
    cos_tilt: real,
    // The dipole's azimuth at t = 0, turns.
    azimuth: real,
}

fn orbiting_dipole(
    moment_principal: vector,
    field: DipoleField,
    orbit_phase: real,
    rotation_phase: real,
    orientation: quaternion,
) -> vector {
    let anomaly = orbit_phase + field.start;
    let place = kepler_place(field.x_world, field.y_world, field.eccentricity, anomaly - round(anomaly));
    let azimuth = rotation_phase + field.azimuth;
    let angle = sin_cos((azimuth - round(azimuth)) * TAU);
    let dipole = vector(field.sin_tilt * angle.cos, field.sin_tilt * angle.sin, field.cos_tilt);
    let r = place.direction_world;
    let cube = place.inverse_distance * place.inverse_distance * place.inverse_distance;
    let field_world = axpy_vector(r, 3.0 * dot_vector(dipole, r), -dipole) * cube;
    return cross_vector(moment_principal, rotate_inverse(orientation, field_world));
}
