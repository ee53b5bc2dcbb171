// gravity-gradient on an elliptic orbit. Twin: src/torque/gravity_gradient_kepler.rs.

fn gravity_gradient_kepler(
    coefficients: vector,
    x_world: vector,
    y_world: vector,
    eccentricity: real,
    start: real,
    phase: real,
    orientation: quaternion,
) -> vector {
    let anomaly = phase + start;
    let place = kepler_place(x_world, y_world, eccentricity, anomaly - round(anomaly));
    let cube = place.inverse_distance * place.inverse_distance * place.inverse_distance;
    return gradient_torque(coefficients * cube, place.direction_world, orientation);
}
