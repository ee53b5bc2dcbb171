// internal-dissipation: loss of energy at constant angular momentum. Twin: src/torque/internal_dissipation.rs.

// k m x omega, which is added to the rate at which the body's axes turn.
fn internal_dissipation(coefficient: real, m: vector, angular_velocity_principal: vector) -> vector {
    return cross_vector(m, angular_velocity_principal) * coefficient;
}
